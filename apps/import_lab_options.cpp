// The options of unhand import for the files of a lab.

#include "apps/command.hpp"
#include "apps/import_lab.hpp"

namespace unhand::apps {
void add_lab_options(Parser& parser, LabOptions& options) {
  options.parser = &parser;
  const auto add = [&](const char* group, const char* name, auto& value, const char* text) {
    return parser.option(name, value, text).group(group);
  };
  const char* one = "A log to add to (hand-csv, ft-csv, mocap-csv, motive-csv)";
  add(one, "--into", options.into,
      "Add to the throws of this log that are named like the files or, with --sku or --mass, throws of "
      "another "
      "object; it is --out if that is not given")
      .not_empty();
  parser.flag("--replace", options.replace, "Where a throw has such data already, replace it").group(one);
  const char* fresh = "A new log (hand-csv, ft-csv, mocap-csv, motive-csv, phyphox)";
  add(fresh, "--sku", options.sku, "The object as an SKU file (TOML): mass, inertia, offset of the CoM")
      .not_empty();
  add(fresh, "--mass", options.mass, "[kg] The object's mass, where there is no SKU file").positive();
  add(fresh, "--object", options.object, "The object's name; else the SKU file's");
  add(fresh, "--title", options.title, "The campaign's title");
  add(fresh, "--source", options.source, "Where the data are from");
  add(fresh, "--licence", options.licence, "Their licence");
  add(fresh, "--gravity", options.gravity, "[m/s^2] Gravity").with_default().not_negative();
  add(fresh, "--landing-height", options.landing_height, "[m] Where a throw counts as landed").with_default();
  add(fresh, "--pads", options.pads, "Pads of the gripper").with_default().range(1, 1000);
  add(fresh, "--pad-radius", options.pad_radius, "[m] Their radius").positive();
  add(fresh, "--opening-time", options.opening_time,
      "[s] When the gripper is told to open, on the robot's clock");
  add(fresh, "--condition", options.condition,
      "What these throws repeat; else the file's name without its number");
  add(fresh, "--test-every", options.test_every, "Hold out every Nth throw of each condition; 0: none")
      .with_default();
  add(fresh, "--test-conditions", options.test_conditions,
      "Hold out these conditions as a whole, too; with --test-every 0, these alone")
      .with_commas();
  const char* files = "What is in the files (hand-csv, ft-csv, mocap-csv, motive-csv)";
  add(files, "--throw", options.throw_id, "The throw's name; else the file's");
  add(files, "--time-offset", options.time_offset,
      "[s] Added to the file's time, to bring it to the robot's clock");
  add(files, "--columns", options.columns,
      "CHANNEL=HEADER,... or CHANNEL=#NUMBER; =-HEADER flips the sign. Channels of hand-csv: "
      "time,x,z,theta,vx,vz,omega,ax,az,alpha; of ft-csv: time,fx,fz,tau,normal; of mocap-csv: "
      "time,x,z,theta");
  add(files, "--units", options.units,
      "CHANNEL=UNIT,... where the header does not say it as 'Fx (N)' or 'Fx [N]'");
  add(files, "--sigma", options.sigma,
      "CHANNEL=NOISE,..., 1 sigma in the column's unit; of motive-csv: position=M,angle=RAD");
  const char* motive = "Motive (motive-csv)";
  add(motive, "--body", options.body, "The rigid body; else the only one");
  add(motive, "--dimension", options.dimension, "3: free flights in space; 2: throws in a plane")
      .with_default()
      .one_of({"2", "3"});
  add(motive, "--heading", options.heading,
      "[deg] Of the throw in Motive's floor, from its X axis, counter-clockwise seen from above");
  parser
      .flag("--trust-heading", options.trust_heading,
            "Take a planar throw that flies elsewhere than --heading all the same")
      .group(motive);
  add(motive, "--origin", options.origin, "[m] X,Y,Z of the robot's base in Motive's frame")
      .with_commas()
      .expected(3, 3);
  add(motive, "--com", options.com, "[m] X,Y,Z of the CoM in the rigid body's frame")
      .with_commas()
      .expected(3, 3);
  const char* track = "What a track shows (mocap-csv, motive-csv)";
  add(track, "--free-flight", options.free_flight, "[s] T0,T1 between which the object touches nothing")
      .with_commas()
      .expected(2, 2);
  parser
      .flag("--landing", options.landing,
            "Take the landing from the track, where it passes the landing height")
      .group(track);
  const char* phone = "Phones (phyphox)";
  add(phone, "--min-fall", options.min_fall, "[s] The shortest free fall").with_default().positive();
  add(phone, "--fall-threshold", options.fall_threshold, "[m/s^2] The specific force in a fall is below it")
      .with_default()
      .positive();
}

}  // namespace unhand::apps
