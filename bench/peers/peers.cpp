// Work and precision of unhand beside other engines, on motions with a closed form:
//   build/release/bench/peers/peers OUT_DIRECTORY
// A table on stdout; the figure with its data and script, and every run as peers.csv, in the directory.
#include <fmt/core.h>

#include <filesystem>
#include <map>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"
#include "bench/peers/truths.hpp"

namespace {

using namespace unhand;
using bench::Work;

constexpr double kExact = 1e-13;  ///< m: an error below this is drawn here

const std::vector<std::string> kMotions{"slide", "spin", "stick", "stick-slip", "release", "bounce"};

apps::Figure figure(const std::vector<Work>& all) {
  apps::Figure out{"peers", 17, 12, {}, {}};
  const std::vector<std::pair<std::string, std::string>> engines{
      {"unhand", "pointtype 7 linecolor rgb '#0072b2'"},
      {"MuJoCo", "pointtype 8 linecolor rgb '#d55e00'"},
      {"Bullet", "pointtype 4 linecolor rgb '#000000'"}};
  for (const auto& motion : kMotions)
    for (const auto& [engine, style] : engines) {
      apps::DataBlock block{motion + ", " + engine, {"s per simulated s", "error [m]"}, {}, {}};
      for (const Work& w : all)
        if (w.truth == motion && w.engine == engine)
          block.rows.push_back({w.seconds, std::max(w.error, kExact)});
      out.data.push_back(block);
    }
  std::string& s = out.script;
  s += "set multiplot\nunset key\nset logscale xy\nset format x '10^{%T}'\nset format y '10^{%T}'\n"
       "set xtics 1e-6,100\nset ytics 1e-13,1000\nset mxtics 1\nset mytics 1\n";
  const double width = 4.3, height = 3.9;
  for (std::size_t m = 0; m < kMotions.size(); ++m) {
    const double x = 1.8 + static_cast<double>(m % 3) * (width + 0.75);
    const double y = 1.9 + static_cast<double>(1 - m / 3) * (height + 1.1);
    s += apps::place(out, {x, x + width, y, y + height});
    s += fmt::format("set title '{}' offset 0,-0.6\n", kMotions[m]);
    s += m % 3 == 0 ? "set ylabel 'error [m]' offset 1,0\n" : "unset ylabel\n";
    s += m >= 3 ? "set xlabel 'time per simulated second' offset 0,0.5\n" : "unset xlabel\n";
    s += "plot [1e-6:30] [5e-14:3]";
    bool first = true;
    for (std::size_t e = 0; e < engines.size(); ++e) {
      if (out.data[m * engines.size() + e].rows.empty()) continue;
      s += fmt::format("{} DATA index {} using 1:2 with points {}", first ? "" : ",", m * engines.size() + e,
                       engines[e].second);
      first = false;
    }
    s += "\n";
  }
  std::vector<apps::KeyEntry> key;
  for (const auto& [engine, style] : engines) key.push_back({"with points " + style, engine});
  return s += apps::key_strip(out, key, 3) + "unset multiplot\n", out;
}

std::string number(double x) { return fmt::format("{:.1e}", x); }

/// Per motion: the best of each engine, and what unhand makes of it at equal time and at equal error.
apps::Table verdicts(const std::vector<Work>& all) {
  apps::Table out{{"motion", "engine", "its best setting", "error [m]", "time per s", "unhand in that time",
                   "more accurate", "time of unhand for that error", "faster"},
                  {},
                  3};
  for (const auto& motion : kMotions)
    for (const std::string engine : {"MuJoCo", "Bullet"}) {
      const Work* best = nullptr;
      for (const Work& w : all)
        if (w.truth == motion && w.engine == engine && (!best || w.error < best->error)) best = &w;
      if (!best) continue;
      const Work *in_time = nullptr, *for_error = nullptr;
      for (const Work& w : all) {
        if (w.truth != motion || w.engine != "unhand") continue;
        if (w.seconds <= best->seconds && (!in_time || w.error < in_time->error)) in_time = &w;
        if (w.error <= std::max(best->error, kExact) && (!for_error || w.seconds < for_error->seconds))
          for_error = &w;
      }
      const auto ratio = [&](const Work& ours) {
        if (best->error < kExact) return std::string("both exact");
        return fmt::format("{:.0e}", best->error / std::max(ours.error, kExact));
      };
      out.rows.push_back({motion, engine, best->setting, number(best->error), number(best->seconds),
                          in_time ? number(in_time->error) : "-", in_time ? ratio(*in_time) : "-",
                          for_error ? number(for_error->seconds) : "-",
                          for_error ? fmt::format("{:.0f}", best->seconds / for_error->seconds) : "-"});
    }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: peers OUT_DIRECTORY\n");
    return 2;
  }
  const std::filesystem::path out = argv[1];
  std::vector<Work> all;
  for (const auto& part : {bench::run_unhand(), bench::run_bullet(), bench::run_mujoco()})
    all.insert(all.end(), part.begin(), part.end());
  apps::Table runs{{"motion", "engine", "setting", "error [m]", "s per simulated s"}, {}, 3};
  for (const auto& motion : kMotions)
    for (const Work& w : all)
      if (w.truth == motion)
        runs.rows.push_back({w.truth, w.engine, w.setting, number(w.error), number(w.seconds)});
  std::filesystem::create_directories(out);
  apps::write_text(out / "peers.csv", runs.csv());
  apps::write_text(out / "peers.md", verdicts(all).markdown());
  draw(figure(all), out);
  fmt::print("{}\n{}", runs.text(), verdicts(all).text());
}
