// unhand import: logs from the files of others.
#include <fmt/format.h>

#include <memory>

#include "apps/command.hpp"
#include "apps/import_lab.hpp"
#include "apps/output.hpp"
#include "apps/tell.hpp"
#include "datasets/import_cube_tosses.hpp"
#include "datasets/import_planar_pushes.hpp"
#include "datasets/near_miss.hpp"

namespace unhand::apps {
namespace {

struct ImportOptions {
  std::string format, out, json;
  std::vector<std::string> inputs;
  LabOptions lab;
  double cube_side{}, cube_mass{}, cube_inertia{};  // [m], [kg], [kg m^2]; 0: not given
  std::vector<double> block_outline;                // x, y, x, y ... [m]
  double block_mass{};                              // [kg]; 0: not given
  int threads{0};

  bool another_cube() const { return cube_side > 0 || cube_mass > 0 || cube_inertia > 0; }
  bool another_block() const { return block_mass > 0 || !block_outline.empty(); }
};

/// Another cube than the published one: homogeneous, unless its inertia is given.
datasets::CubeTossOptions cube_of(const ImportOptions& options) {
  datasets::CubeTossOptions out;
  if (!options.another_cube()) return out;
  if (!(options.cube_side > 0 && options.cube_mass > 0))
    throw WrongUsage("--cube-side and --cube-mass are needed for another cube than the published one");
  const bool known = options.cube_inertia > 0;
  out.side = options.cube_side;
  out.mass = options.cube_mass;
  out.inertia.fill(known ? options.cube_inertia : out.mass * out.side * out.side / 6);
  out.source = fmt::format("measured; mass and side as given, inertia {}",
                           known ? "as given" : "of a homogeneous cube");
  out.licence.clear();
  return out;
}

/// Another block than the published one: homogeneous.
datasets::PlanarPushOptions pushes_of(const ImportOptions& options) {
  datasets::PlanarPushOptions out;
  if (!options.another_block()) return out;
  if (!(options.block_mass > 0 && !options.block_outline.empty()))
    throw WrongUsage("--block-outline and --block-mass are needed for another block than the published one");
  const std::vector<double>& numbers = options.block_outline;
  if (numbers.size() % 2 != 0)
    throw WrongUsage(fmt::format("--block-outline: {} numbers are not pairs X,Y", numbers.size()));
  std::vector<std::array<double, 2>> corners;
  for (std::size_t i = 0; i < numbers.size(); i += 2) corners.push_back({numbers[i], numbers[i + 1]});
  try {
    out.block = datasets::homogeneous_block(std::move(corners), options.block_mass);
  } catch (const std::invalid_argument& error) {
    throw WrongUsage(fmt::format("--block-{}", error.what()));
  }
  out.block.description = "a block; measured; mass and outline as given, centre of a homogeneous one";
  return out;
}

Imported import_cubes(const ImportOptions& options, Outputs& outputs) {
  if (options.inputs.size() != 1)
    throw WrongUsage(fmt::format("cube-tosses takes one CSV file, not {}", options.inputs.size()));
  datasets::ImportReport report;
  const auto log = datasets::import_cube_tosses(options.inputs.front(), cube_of(options), &report);
  outputs.log(options.out, log);
  Imported out;
  out.text = fmt::format("{}: {} of {} tosses ({} train, {} test)\n", options.out, report.kept, report.tosses,
                         report.train, report.test);
  for (const auto& dropped : report.dropped)
    out.text +=
        fmt::format("  dropped toss {} ({} samples): {}\n", dropped.toss, dropped.samples, dropped.reason);
  out.details = {{"rows", report.rows},   {"tosses", report.tosses}, {"kept", report.kept},
                 {"train", report.train}, {"test", report.test},     {"dropped", Json::array()}};
  for (const auto& dropped : report.dropped)
    out.details["dropped"].push_back(
        {{"toss", dropped.toss}, {"samples", dropped.samples}, {"reason", dropped.reason}});
  return out;
}

Imported import_lab_files(const ImportOptions& options, Outputs& outputs) {
  return import_lab(options.format, options.inputs, options.out, options.lab, outputs);
}

Imported import_pushes(const ImportOptions& options, Outputs& outputs) {
  const std::vector<std::filesystem::path> inputs(options.inputs.begin(), options.inputs.end());
  datasets::PlanarPushReport report;
  const auto log = datasets::import_planar_pushes(inputs, pushes_of(options), &report);
  outputs.log(options.out, log);
  Imported out;
  out.text = fmt::format(
      "{}: {} of {} pushes on {} surfaces ({} train, {} test), {} samples ({} dropped; {} pushes begin in "
      "contact)\n",
      options.out, report.kept, report.pushes, log.surfaces.size(), report.train, report.test, report.samples,
      report.dropped_samples, report.borrowed_offsets);
  out.details = {{"pushes", report.pushes},
                 {"kept", report.kept},
                 {"train", report.train},
                 {"test", report.test},
                 {"samples", report.samples},
                 {"dropped_samples", report.dropped_samples},
                 {"borrowed_offsets", report.borrowed_offsets},
                 {"dropped", Json::array()}};
  for (const auto& dropped : report.dropped) {
    out.text += fmt::format("  dropped {}, push {}: {}\n", dropped.surface, dropped.push, dropped.reason);
    out.details["dropped"].push_back(
        {{"surface", dropped.surface}, {"push", dropped.push}, {"reason", dropped.reason}});
  }
  return out;
}

struct Format {
  const char *name, *summary, *example;
  Imported (*read)(const ImportOptions&, Outputs&);
};
/// An importer is one line here.
constexpr Format formats[] = {
    {"cube-tosses", "measured tosses of a cube, one CSV in SI units: a throw log",
     "unhand import cube-tosses cube_tosses.csv --out cubes.h5", &import_cubes},
    {"planar-pushes", "measured pushes of a block, text logs or folders of them: a slip log",
     "unhand import planar-pushes planar_pushes --out pushes.h5", &import_pushes},
    {"hand-csv", "a robot's hand in the throwing plane, any CSV with a map of its columns",
     "unhand import hand-csv hand/*.csv --sku bar.toml --opening-time 0.1 --out log.h5 \\\n"
     "      --columns time=t,x=X,z=Z,theta=pitch,vx=VX,vz=VZ,omega=q,ax=AX,az=AZ,alpha=qd \\\n"
     "      --units time=ms,x=mm,z=mm,theta=deg,vx=m/s,vz=m/s,omega=deg/s,ax=m/s^2,az=m/s^2,alpha=deg/s^2",
     &import_lab_files},
    {"ft-csv", "the sensor behind one pad, any CSV with a map of its columns",
     "unhand import ft-csv ft/*.csv --into log.h5 --columns time=t,fx=-Fx,fz=-Fz,tau=Ty,normal=Fy \\\n"
     "      --units time=s,fx=N,fz=N,tau='N mm',normal=N --sigma fx=0.02,fz=0.02,tau=0.2,normal=0.05",
     &import_lab_files},
    {"mocap-csv", "a tracked object in the throwing plane, any CSV with a map of its columns",
     "unhand import mocap-csv mocap/*.csv --into log.h5 --landing --columns time=t,x=X,z=Z,theta=pitch \\\n"
     "      --units time=s,x=mm,z=mm,theta=deg --sigma x=0.2,z=0.2,theta=0.2",
     &import_lab_files},
    {"motive-csv", "rigid bodies exported by OptiTrack Motive, one take a throw",
     "unhand import motive-csv takes/*.csv --body bar --heading 90 --landing --into log.h5\n"
     "  unhand import motive-csv ball_01.csv --mass 0.057 --free-flight 1.20,1.85 --out flights.h5",
     &import_lab_files},
    {"phyphox", "a phone's accelerometer, cut into its free falls",
     "unhand import phyphox fall_* --mass 0.2 --out falls.h5", &import_lab_files},
};

std::string known_formats() {
  std::string out;
  for (const Format& format : formats) out += fmt::format("\n  {}: {}", format.name, format.summary);
  return out;
}

std::string examples() {
  std::string out = "Examples:";
  for (const Format& format : formats) out += fmt::format("\n  {}", format.example);
  return out;
}

void import(ImportOptions& options) {
  if (options.out.empty()) options.out = options.lab.into;
  if (options.out.empty()) throw WrongUsage("--out is required: the log to write");
  for (const Format& format : formats) {
    if (options.format != format.name) continue;
    if (format.read != &import_lab_files) refuse_lab_options(options.format, options.lab);
    if (format.read != &import_cubes && options.another_cube())
      throw WrongUsage(
          fmt::format("--cube-side, --cube-mass and --cube-inertia are not for {}", options.format));
    if (format.read != &import_pushes && options.another_block())
      throw WrongUsage(fmt::format("--block-outline and --block-mass are not for {}", options.format));
    const std::vector<std::filesystem::path> inputs(options.inputs.begin(), options.inputs.end());
    require_outputs({{options.out, Wanted::log}, {options.json}}, inputs);
    Outputs outputs{inputs};
    const Imported imported = format.read(options, outputs);
    if (!options.json.empty()) {
      Json report = json_head("import");
      report["format"] = options.format;
      report["inputs"] = options.inputs;
      report["log"] = options.out;
      report["notes"] = imported.notes;
      report.update(imported.details);
      outputs.json(options.json, report);
    }
    outputs.commit();
    fmt::print("{}", imported.text);
    for (const std::string& note : imported.notes) tell("unhand: {}\n", note);
    return;
  }
  std::vector<std::string> names;
  for (const Format& format : formats) names.emplace_back(format.name);
  throw WrongUsage(
      datasets::unknown_name(fmt::format("there is no format '{}'", options.format), options.format, names));
}

}  // namespace

Command import_command(Parser& root) {
  auto options = std::make_shared<ImportOptions>();
  Parser& parser = root.subcommand("import", "Make a log from measured data in another format");
  parser.option("FORMAT", options->format, "Which format:" + known_formats()).required();
  parser.option("INPUT", options->inputs, "The files to read").required();
  parser.file("--out", options->out, "The log to write (replaced if it exists); --into, where that is given");
  parser.file("--json", options->json, "Write what was read, kept and dropped as JSON");
  add_one_thread(parser, options->threads);
  const char* cube = "Another cube than the published one (cube-tosses)";
  parser.option("--cube-side", options->cube_side, "[m] Its side").group(cube).positive();
  parser.option("--cube-mass", options->cube_mass, "[kg] Its mass").group(cube).positive();
  parser
      .option("--cube-inertia", options->cube_inertia, "[kg m^2] About its middle; else a homogeneous cube's")
      .group(cube)
      .positive();
  const char* block = "Another block than the published one (planar-pushes)";
  parser
      .option("--block-outline", options->block_outline,
              "[m] X,Y of its corners one after another, in the tracked frame: convex, counter-clockwise")
      .group(block)
      .with_commas();
  parser.option("--block-mass", options->block_mass, "[kg] Its mass").group(block).positive();
  add_lab_options(parser, options->lab);
  parser.footer(examples());
  return {&parser, [options] { import(*options); }};
}

}  // namespace unhand::apps
