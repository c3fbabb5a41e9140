// The answer of `unhand plan throw` as text, JSON, tables and figures.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/figure.hpp"
#include "apps/plan_throw.hpp"
#include "apps/table.hpp"
#include "fitting/sku/sku_validation.hpp"
#include "flight/fly.hpp"
#include "planners/arm/kinematics.hpp"

namespace unhand::apps {
namespace {

using planners::JointVector;
using planners::LandingAt;
using Rows = std::vector<std::vector<double>>;

Json list(const JointVector<double>& v) {
  Json out = Json::array();
  for (const double x : v) out.push_back(x);
  return out;
}

/// null where no landings were worked out: those of the tube's acceleration, once the motion is another's.
Json window_json(const std::vector<LandingAt>& landings) {
  if (landings.empty()) return nullptr;
  Json out{{"largest_miss_m", planners::largest_miss(landings)},
           {"time_s", Json::array()},
           {"forward_m", Json::array()},
           {"across_m", Json::array()}};
  for (const LandingAt& at : landings) {
    if (!at.lands) continue;
    out["time_s"].push_back(at.time);
    out["forward_m"].push_back(at.forward);
    out["across_m"].push_back(at.across);
  }
  return out;
}

Json use_json(const ThrowAnswer& a, const planners::LimitUse& use) {
  return {{"fraction", use.fraction}, {"joint", a.chain.joints[use.joint].name}, {"time_s", use.time}};
}

Json spread_json(const std::optional<planners::ReleaseSpread>& spread) {
  if (!spread) return nullptr;
  Json out{{"miss_m", spread->miss}, {"sigma_m", spread->spread}, {"derivatives", Json::object()}};
  for (int k = 0; k < planners::kUnknowns; ++k)
    out["derivatives"][planners::name_of(static_cast<planners::Unknown>(k))] = spread->gradient[k];
  return out;
}

Json landing_json(const std::optional<planners::ReleaseLanding>& at) {
  if (!at) return nullptr;
  return {{"miss_m", at->miss},
          {"detach_time_s", at->detach_time},
          {"turned_rad", at->angle},
          {"speed_m_s", at->speed}};
}

std::string percent(int part, std::size_t all) {
  return fmt::format("{:.1f} %", 100.0 * part / std::max(1.0, static_cast<double>(all)));
}

/// A length, or that there is none.
std::string metres(double x, bool sign = false) {
  if (!std::isfinite(x)) return "-";
  return sign ? with_sign(x, 4) : fmt::format("{:.4f}", x);
}

}  // namespace

double PredictedLandings::rms() const {
  if (drawn.miss.size() == 1) return std::hypot(drawn.mean, across.mean);
  const double along = std::hypot(drawn.mean, drawn.std), beside = std::hypot(across.mean, across.std);
  return std::hypot(along, beside);
}

std::string margins_text(const planners::NominalThrow& n) {
  return fmt::format("margin of the throw found {:.3f} (speed {:.3f}, position {:.3f}, tube {:.3f}); ",
                     n.margin, n.speed_margin, n.position_margin, n.tube_margin);
}

std::string text_of(const ThrowAnswer& a, bool markdown) {
  const auto shown = [&](const Table& t) { return markdown ? t.markdown() : t.text(); };
  const auto& plan = a.plan;
  const auto tip = planners::tip_motion<double>(a.chain, plan.nominal.state.q, plan.nominal.state.qd,
                                                JointVector<double>::Zero(a.chain.size()));
  std::string out = fmt::format(
      "box {:g} x {:g} m at ({:g}, {:g}, {:g}) m; the object may leave up to {:.0f} ms after the command\n"
      "{}the object moves at {:.2f} m/s, {:.1f} deg upward\n\n",
      a.box.length_x, a.box.length_y, a.box.middle.x(), a.box.middle.y(), a.box.middle.z(), 1e3 * a.window,
      a.of_tube ? margins_text(plan.nominal) : "", tip.velocity.norm(),
      std::atan2(tip.velocity.z(), tip.velocity.head<2>().norm()) * 180 / std::numbers::pi);
  Table joints{{"joint", "q0 [rad]", "qd0 [rad/s]", "qdd [rad/s2]"}, {}, 1};
  for (int i = 0; i < a.chain.size(); ++i)
    joints.rows.push_back({a.chain.joints[i].name, fixed(true, plan.nominal.state.q[i], 4),
                           fixed(true, plan.nominal.state.qd[i], 4), fixed(true, plan.qdd[i], 3)});
  out += shown(joints) + "\n";
  Table landings{{"motion", "landings", "in the box", "mean miss [m]", "std [m]", "mean across [m]",
                  "std across [m]", "rms [m]", "lost"},
                 {},
                 1};
  for (const auto& one : a.predicted)
    landings.rows.push_back(
        {one.name, fmt::to_string(one.drawn.miss.size()),
         percent(one.hits, one.drawn.miss.size() + static_cast<std::size_t>(one.drawn.lost)),
         metres(one.drawn.mean, true), metres(one.drawn.std), metres(one.across.mean, true),
         metres(one.across.std), metres(one.rms()), fmt::to_string(one.drawn.lost)});
  out += shown(landings);
  if (!plan.landings.empty())
    out += fmt::format("\nlargest miss of any release in the window: {:.4f} m\n",
                       planners::largest_miss(plan.landings));
  if (a.real && a.rigid)
    out += fmt::format(
        "\nunder the tube's motion a rigidly carried object would land {} m from the middle, the contact "
        "model says {} m\n",
        with_sign(a.rigid->miss, 3), with_sign(a.real->miss, 3));
  if (!a.numbers.empty()) {
    Table numbers{{"the release rests on", "value", "1 sigma", "from"}, {}, 1};
    for (const auto& one : a.numbers)
      numbers.rows.push_back({one.unit == "-" ? one.name : fmt::format("{} [{}]", one.name, one.unit),
                              fmt::format("{:.4g}", one.value),
                              !one.sigma_in.empty()       ? "in " + one.sigma_in
                              : one.sigma.value_or(0) > 0 ? fmt::format("{:.2g}", *one.sigma)
                                                          : "-",
                              one.from});
    out += "\n" + shown(numbers);
  }
  for (const auto& one : a.beyond_card) out += fmt::format("\nBeyond the card: {}.\n", one);
  if (!a.passed_over.empty())
    out += fmt::format("\npassed over in the spread: sigma of {}\n", fmt::join(a.passed_over, ", "));
  if (a.medium.drag_k > 0)
    out += fmt::format("\nthe flight has a drag of {:g} 1/m ({})\n", a.medium.drag_k, a.drag_from);
  if (a.needed_force)
    out += fmt::format("\nuntil the command to open the grip needs at least {:.3g} N per pad\n",
                       *a.needed_force);
  if (!a.with_release && std::abs(a.lever) > fitting::kLeastLever)
    out += fmt::format(
        "\nnote: without a card the object is taken as carried rigidly until it leaves; this one hangs "
        "{:.3g} cm from the pads and turns in them while they open, so that it lands elsewhere: give the "
        "gripper's card (--card)\n",
        100 * a.lever);
  const auto& limits = plan.limits;
  out += fmt::format(
      "\nlimits used, at most: position {:.1f} %, velocity {:.1f} %, acceleration {:.1f} %, jerk {:.1f} %, "
      "torque {:.1f} %\n"
      "torques change by up to {:.3g} N m/s ({} at {:.3f} s), which the plan does not limit\n",
      100 * limits.position.fraction, 100 * limits.velocity.fraction, 100 * limits.acceleration.fraction,
      100 * limits.jerk.fraction, 100 * limits.torque.fraction, limits.torque_rate.value,
      a.chain.joints[static_cast<std::size_t>(limits.torque_rate.joint)].name, limits.torque_rate.time);
  return out;
}

Json throw_json(const ThrowAnswer& a) {
  const auto& plan = a.plan;
  Json out;
  out["target_m"] = {a.box.middle.x(), a.box.middle.y(), a.box.middle.z()};
  out["box_m"] = {a.box.length_x, a.box.length_y};
  out["window_s"] = a.window;
  out["drag_k_per_m"] = a.medium.drag_k;
  out["margin"] = nullptr;
  if (a.of_tube)
    out["margin"] = {{"least", plan.nominal.margin},
                     {"speed", plan.nominal.speed_margin},
                     {"position", plan.nominal.position_margin},
                     {"tube", plan.nominal.tube_margin}};
  out["q0_rad"] = list(plan.nominal.state.q);
  out["qd0_rad_s"] = list(plan.nominal.state.qd);
  out["qdd_rad_s2"] = list(plan.qdd);
  out["qdd_tube_cvx_rad_s2"] = a.of_tube ? list(plan.tube.qdd) : Json(nullptr);
  out["window_landings"] = {{"planned", window_json(plan.landings)},
                            {"tube_cvx", window_json(plan.tube_landings)},
                            {"no_acceleration", window_json(plan.at_rest)}};
  out["motion"] = a.predicted.empty() ? Json(nullptr) : Json(a.predicted.front().name);
  out["predicted"] = Json::object();
  for (const auto& one : a.predicted)
    out["predicted"][one.name] = {{"landed", one.drawn.miss.size()},
                                  {"lost", one.drawn.lost},
                                  {"hits", one.hits},
                                  {"mean_m", number(one.drawn.mean)},
                                  {"std_m", number(one.drawn.std)},
                                  {"mean_across_m", number(one.across.mean)},
                                  {"std_across_m", number(one.across.std)},
                                  {"rms_m", number(one.rms())}};
  out["release"] = nullptr;
  Json numbers = Json::object();
  for (const auto& one : a.numbers)
    numbers[one.name] = {{"value", one.value},
                         {"sigma", number(one.sigma)},
                         {"sigma_in", one.sigma_in.empty() ? Json(nullptr) : Json(one.sigma_in)},
                         {"unit", one.unit},
                         {"from", one.from}};
  if (a.with_release)
    out["release"] = {{"numbers", numbers},
                      {"outside_valid_range", a.beyond_card},
                      {"sigmas_passed_over", a.passed_over},
                      {"needed_grip_force_N", a.needed_force ? Json(*a.needed_force) : Json(nullptr)},
                      {"carried_rigidly", landing_json(a.rigid)},
                      {"contact_model", landing_json(a.real)},
                      {"before", spread_json(a.spread_before)},
                      {"after", spread_json(a.spread_after)}};
  out["limits"] = {{"position", use_json(a, plan.limits.position)},
                   {"velocity", use_json(a, plan.limits.velocity)},
                   {"acceleration", use_json(a, plan.limits.acceleration)},
                   {"jerk", use_json(a, plan.limits.jerk)},
                   {"torque", use_json(a, plan.limits.torque)},
                   {"torque_rate",
                    {{"largest_N_m_s", plan.limits.torque_rate.value},
                     {"joint", a.chain.joints[static_cast<std::size_t>(plan.limits.torque_rate.joint)].name},
                     {"time_s", plan.limits.torque_rate.time}}}};
  return out;
}

namespace {

const char* const ink = "#0072b2";
const char* const other = "#d55e00";
const char* const quiet = "#999999";

std::string trajectory_csv(const ThrowAnswer& a) {
  std::string out = "time_s";
  for (const char* what : {"q", "qd", "qdd"})
    for (int i = 1; i <= a.chain.size(); ++i)
      out += fmt::format(",{}{}_{}", what, i,
                         std::string(what) == "q"    ? "rad"
                         : std::string(what) == "qd" ? "rad_s"
                                                     : "rad_s2");
  out += "\n";
  const auto& motion = a.plan.motion;
  const int steps = static_cast<int>(std::ceil((motion.end() - motion.begin) / 1e-3));
  for (int k = 0; k <= steps; ++k) {
    const double t = std::min(motion.begin + 1e-3 * k, motion.end());
    const auto s = motion.at(t);
    out += fmt::format("{:.6f}", t);
    for (const auto* v : {&s.q, &s.qd, &s.qdd})
      for (const double x : *v) out += fmt::format(",{:.9g}", x);
    out += "\n";
  }
  return out;
}

std::string landings_csv(const ThrowAnswer& a) {
  std::string out = "motion,forward_m,across_m\n";
  for (const auto& one : a.predicted)
    for (std::size_t i = 0; i < one.drawn.miss.size(); ++i)
      out += fmt::format("{},{:.6g},{:.6g}\n", one.name, one.drawn.miss[i], one.across.miss[i]);
  return out;
}

/// The throwing plane's forward direction at the command.
Eigen::Vector2d along_of(const ThrowAnswer& a) {
  return (a.box.middle - planners::forward_kinematics(a.chain, a.plan.nominal.state.q).p)
      .head<2>()
      .normalized();
}

/// (forward, height) of what is thrown, as seen from the target.
std::vector<double> side_view(const ThrowAnswer& a, const Eigen::Vector3d& p) {
  const Eigen::Vector3d off = p - a.box.middle;
  return {along_of(a).dot(off.head<2>()), off.z()};
}

Rows flight_from(const ThrowAnswer& a, double t, const JointVector<double>& qdd) {
  const JointVector<double> q = a.plan.nominal.state.q + t * a.plan.nominal.state.qd + 0.5 * t * t * qdd,
                            qd = a.plan.nominal.state.qd + t * qdd;
  const auto tip = planners::tip_motion<double>(a.chain, q, qd, JointVector<double>::Zero(a.chain.size()));
  const Eigen::Vector2d level = tip.velocity.head<2>();  // the flight stays in the vertical plane of it
  flight::FlightProblem<double> flight;
  flight.pose = {0, tip.frame.p.z(), 0};
  flight.twist = {level.norm(), tip.velocity.z(), 0};
  flight.gravity = {0, -a.medium.gravity};
  flight.drag_k = a.medium.drag_k;
  flight.landing_height = a.box.middle.z();
  const auto flown = flight::fly(flight);
  Rows out;
  if (flown.outcome != flight::FlightOutcome::landed) return out;
  std::vector<double> times;
  for (int k = 0; k <= 40; ++k) times.push_back(flown.landing.flight_time * k / 40);
  for (const auto& pose : flight::fly_through(flight, times)) {
    Eigen::Vector3d at = tip.frame.p;
    at.head<2>() += pose.x * level.normalized();
    at.z() = pose.z;
    out.push_back(side_view(a, at));
  }
  return out;
}

/// The path of what is thrown, and the flights from a few instants of the window.
Figure tube_figure(const ThrowAnswer& a) {
  Figure out{"tube", 17, 9, {}, {}};
  const auto path = [&](double from, double to) {
    Rows rows;
    for (int k = 0; k <= 60; ++k)
      rows.push_back(side_view(
          a, planners::forward_kinematics(a.chain, a.plan.motion.at(from + (to - from) * k / 60).q).p));
    return rows;
  };
  out.data.push_back({"path while the arm swings", {"forward [m]", "height [m]"}, path(-0.12, 0), {}});
  out.data.push_back({"path in the window", {"forward [m]", "height [m]"}, path(0, a.window), {}});
  const double half = a.box.half_length(along_of(a));
  out.data.push_back({"box", {"forward [m]", "height [m]"}, {{-half, 0}, {half, 0}}, {}});
  const int flights = 5;
  const auto none = JointVector<double>::Zero(a.chain.size());
  for (const bool planned : {true, false})
    for (int k = 0; k < flights; ++k) {
      const double t = a.window * k / (flights - 1);
      out.data.push_back({fmt::format("flight from {:.3f} s, {}", t, planned ? "planned" : "no acceleration"),
                          {"forward [m]", "height [m]"},
                          flight_from(a, t, planned ? a.plan.qdd : JointVector<double>(none)),
                          {}});
    }
  std::string predicted;
  if (const auto& drawn = a.predicted.front().drawn; a.with_release && drawn.miss.size() > 1) {
    out.data.push_back({"landings that the card predicts",
                        {"mean forward [m]", "height [m]", "standard deviation [m]"},
                        {{drawn.mean, 0, drawn.std}},
                        {}});
    predicted = fmt::format(
        ", \\\n     DATA index {} using 1:2:3 with xerrorbars pointtype 7 linewidth 2 linecolor rgb "
        "'#009e73' "
        "title 'landings that the card predicts'",
        out.data.size() - 1);
  }
  out.script = fmt::format(
      "set xlabel 'forward of the target [m]'; set ylabel 'above the target [m]'\n"
      "set object 1 rectangle center 0,0 size {4:.6g}, graph 0.018 fillcolor rgb 'black' fillstyle solid "
      "noborder back\n"
      "set key outside top center horizontal; set grid linecolor rgb '#dddddd'\n"
      "plot for [i=8:12] DATA index i with lines linecolor rgb '{2}' dashtype 2 title (i==8 ? 'flights "
      "without acceleration' : ''), \\\n"
      "     for [i=3:7] DATA index i with lines linecolor rgb '{0}' linewidth 1.2 title (i==3 ? '{3}' : ''), "
      "\\\n"
      "     DATA index 0 with lines linecolor rgb '#555555' linewidth 1.5 title 'path of the swing', \\\n"
      "     DATA index 1 with lines linecolor rgb '{1}' linewidth 4 title 'where the object may leave', \\\n"
      "     DATA index 2 with lines linecolor rgb 'black' linewidth 0.5 notitle, \\\n"
      "     keyentry with boxes fillstyle solid noborder fillcolor rgb 'black' title 'box'{5}\n",
      ink, other, quiet,
      a.with_release ? "flights if carried rigidly until then" : "flights of the planned motion", 2 * half,
      predicted);
  return out;
}

Figure motion_figure(const ThrowAnswer& a) {
  Figure out{"motion", 17, 12, {}, {}};
  DataBlock block{"use of the limits", {"time [s]"}, {}, {}};
  for (const char* what : {"velocity", "acceleration"})
    for (int i = 1; i <= a.chain.size(); ++i)
      block.columns.push_back(fmt::format("{} of joint {} over its limit", what, i));
  const auto& motion = a.plan.motion;
  for (int k = 0; k <= 800; ++k) {
    const double t = motion.begin + (motion.end() - motion.begin) * k / 800;
    const auto s = motion.at(t);
    std::vector<double> row{t};
    for (int i = 0; i < a.chain.size(); ++i) row.push_back(s.qd[i] / a.chain.joints[i].limits.velocity);
    for (int i = 0; i < a.chain.size(); ++i) row.push_back(s.qdd[i] / a.chain.joints[i].limits.acceleration);
    block.rows.push_back(std::move(row));
  }
  out.data.push_back(std::move(block));
  const int n = a.chain.size();
  const char* const colours[]{"#000000", "#e69f00", "#56b4e9", "#009e73",
                              "#cc79a7", "#0072b2", "#d55e00", "#666666"};
  out.script = "set multiplot\n";
  for (const bool upper : {true, false}) {
    out.script += place(out, upper ? Panel{1.8, 16.6, 7.5, 11.7} : Panel{1.8, 16.6, 2.9, 7.1});
    out.script += fmt::format(
        "set yrange [-1.1:1.1]; set xrange [{0:.4f}:{1:.4f}]; set grid linecolor rgb '#dddddd'\n"
        "set object 1 rectangle from 0,-1.1 to {2:.4f},1.1 fillcolor rgb '#fbe8d8' fillstyle solid noborder "
        "behind\n"
        "set ylabel '{3} over limit'; {4}\nunset key\nplot ",
        motion.begin, motion.end(), a.window, upper ? "velocity" : "acceleration",
        upper ? "set format x ''; unset xlabel"
              : "set format x '%h'; set xlabel 'after the command to open [s]'");
    for (int i = 0; i < n; ++i)
      out.script +=
          fmt::format("{}DATA index 0 using 1:{} with lines linecolor rgb '{}' dashtype {} linewidth 1.3",
                      i > 0 ? ", " : "", 2 + i + (upper ? 0 : n), colours[i], i % 4 + 1);
    out.script += "\n";
  }
  std::vector<KeyEntry> keys;
  for (int i = 0; i < n; ++i)
    keys.push_back(
        {fmt::format("with lines linecolor rgb '{}' dashtype {} linewidth 1.3", colours[i], i % 4 + 1),
         fmt::format("joint {}", i + 1)});
  out.script += key_strip(out, keys, 4) + "unset multiplot\n";
  return out;
}

Rows curve_of(const std::vector<LandingAt>& landings) {
  Rows out;
  for (const LandingAt& at : landings)
    if (at.lands) out.push_back({1e3 * at.time, 100 * at.forward, 100 * at.across});
  return out;
}

/// Landings against the time of release, or their distribution.
Figure planned_landing_figure(const ThrowAnswer& a) {
  Figure out{"landings", 17, 9, {}, {}};
  const double half = 100 * a.box.half_length(along_of(a));
  if (!a.with_release) {
    const std::vector<std::string> columns{"time of release [ms]", "forward of the middle [cm]",
                                           "across [cm]"};
    out.data = {{"planned", columns, curve_of(a.plan.landings), {}},
                {"Tube-CVX", columns, curve_of(a.plan.tube_landings), {}},
                {"no acceleration", columns, curve_of(a.plan.at_rest), {}}};
    const Eigen::Vector2d along = along_of(a);
    const double beside = 100 * a.box.half_length(Eigen::Vector2d(-along.y(), along.x()));
    const std::string styles[]{
        fmt::format("with linespoints pointtype 7 pointinterval 4 linewidth 2 linecolor rgb '{}'", ink),
        fmt::format("with linespoints pointtype 5 pointinterval 4 linecolor rgb '{}' dashtype 4", other),
        fmt::format("with linespoints pointtype 6 pointinterval 4 linecolor rgb '{}' dashtype 2", quiet)};
    out.script = "set multiplot\nset key off\nset grid linecolor rgb '#dddddd'\n";
    for (const bool forward : {true, false}) {
      out.script += place(out, forward ? Panel{1.9, 8.2, 2.7, 8.4} : Panel{10.2, 16.5, 2.7, 8.4});
      out.script += fmt::format(
          "set xlabel 'release after the command [ms]' offset 0,0.3; set ylabel 'landing, {0} the middle "
          "[cm]'\nplot {1:.3g} with lines linecolor rgb 'black', {2:.3g} with lines linecolor rgb 'black'",
          forward ? "forward of" : "across from", forward ? half : beside, forward ? -half : -beside);
      for (const int i : {2, 1, 0})
        out.script += fmt::format(", DATA index {} using 1:{} {}", i, forward ? 2 : 3, styles[i]);
      out.script += "\n";
    }
    out.script += key_strip(out,
                            {{"with lines linecolor rgb 'black'", "edges of the box"},
                             {styles[2], "no acceleration"},
                             {styles[1], "Tube-CVX"},
                             {styles[0], "planned"}},
                            2) +
                  "unset multiplot\n";
    return out;
  }
  double low = -half, high = half;
  for (const auto& one : a.predicted)
    for (const double x : one.drawn.miss) low = std::min(low, 100 * x), high = std::max(high, 100 * x);
  const int bins = 60;
  const double width = (high - low) / bins;
  for (const auto& one : a.predicted) {
    std::vector<double> counts(bins, 0.0);
    for (const double x : one.drawn.miss)
      counts[static_cast<std::size_t>(std::clamp(static_cast<int>((100 * x - low) / width), 0, bins - 1))] +=
          1;
    Rows rows;
    for (int k = 0; k < bins; ++k)
      rows.push_back({low + (k + 0.5) * width,
                      100 * counts[k] / std::max<double>(1, static_cast<double>(one.drawn.miss.size()))});
    out.data.push_back({one.name, {"forward of the middle [cm]", "share of the landings [%]"}, rows, {}});
  }
  out.script = fmt::format(
      "set xlabel 'landing, forward of the middle [cm]'; set ylabel 'share of the landings [%]'\n"
      "set grid linecolor rgb '#dddddd'; set key outside top center horizontal\nset yrange [0:*]\n"
      "set arrow from {0:.4g}, graph 0 to {0:.4g}, graph 1 nohead linewidth 1.5\n"
      "set arrow from {1:.4g}, graph 0 to {1:.4g}, graph 1 nohead linewidth 1.5\nplot ",
      -half, half);
  for (std::size_t i = 0; i < out.data.size(); ++i)
    out.script +=
        fmt::format("{}DATA index {} with histeps linewidth 2 dashtype {} linecolor rgb '{}' title '{}'",
                    i > 0 ? ", " : "", i, i + 1, i == 0 ? ink : other, plain(a.predicted[i].name));
  out.script += "\n";
  return out;
}

}  // namespace

void write_report(const ThrowAnswer& a, const Json& json, const std::filesystem::path& directory) {
  std::string page = "# A throw into a box\n\n" + text_of(a, true);
  write_text(directory / "trajectory.csv", trajectory_csv(a));
  write_text(directory / "landings.csv", landings_csv(a));
  for (const Figure& figure : {tube_figure(a), motion_figure(a), planned_landing_figure(a)}) {
    draw(figure, directory, "simulated by unhand plan throw");
    page += fmt::format("\n![{0}]({0}.png)\n", figure.name);
  }
  write_text(directory / "report.md", page);
  write_text(directory / "plan.json", json_text(json));
}

}  // namespace unhand::apps
