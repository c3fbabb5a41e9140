// Work and precision of unhand beside other engines, on motions with a closed form:
//   build/release/bench/peers/peers OUT_DIRECTORY
// A table on stdout; the figure with its data and script, and every run as peers.csv, in the directory.
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>

#include "apps/figure.hpp"
#include "apps/output.hpp"
#include "apps/table.hpp"
#include "bench/peers/verdicts.hpp"

namespace {

using namespace unhand;
using bench::kExact;
using bench::kMotions;
using bench::Work;

apps::Figure figure(const std::vector<Work>& all) {
  apps::Figure out{"peers", 17, 12.8, {}, {}};
  const std::vector<std::pair<std::string, std::string>> engines{
      {"unhand", "pointtype 7 linecolor rgb '#0072b2'"},
      {"MuJoCo", "pointtype 8 linecolor rgb '#d55e00'"},
      {"Bullet", "pointtype 4 linecolor rgb '#000000'"},
      {"Siconos", "pointtype 12 linecolor rgb '#009e73'"},
      {"Siconos in step", "pointtype 13 linecolor rgb '#009e73'"}};
  for (const auto& motion : kMotions)
    for (const auto& [engine, style] : engines) {
      apps::DataBlock block{motion + ", " + engine, {"s per simulated s", "error [m]"}, {}, {}};
      for (const Work& w : all)
        if (w.truth == motion && w.engine == engine)
          block.rows.push_back({w.seconds, std::max(w.error, kExact)});
      if (!block.rows.empty()) out.data.push_back(block);
    }
  std::string& s = out.script;
  s += "set multiplot\nunset key\nset logscale xy\nset format x '10^{%T}'\n"
       "set xtics 1e-6,100\nset ytics 1e-13,1000\nset mxtics 1\nset mytics 1\n";
  const double width = 4.3, height = 3.9;
  for (std::size_t m = 0; m < kMotions.size(); ++m) {
    const double x = 1.8 + static_cast<double>(m % 3) * (width + 0.75);
    const double y =
        1.5 + apps::key_height(engines.size(), 3) + static_cast<double>(1 - m / 3) * (height + 1.4);
    s += apps::place(out, {x, x + width, y, y + height});
    s += fmt::format("set title '{}' offset 0,-0.6\n", kMotions[m]);
    s += m % 3 == 0 ? "set ylabel 'error [m]' offset 1,0\nset format y '10^{%T}'\n"
                    : "unset ylabel\nset format y ''\n";
    s += m >= 3 ? "set xlabel 'time per simulated second' offset 0,0.5\n" : "unset xlabel\n";
    s += "plot [1e-6:30] [5e-14:3]";
    bool first = true;
    for (const auto& [engine, style] : engines) {
      const auto block = std::find_if(out.data.begin(), out.data.end(), [&, name = engine](const auto& data) {
        return data.title == kMotions[m] + ", " + name;
      });
      if (block == out.data.end()) continue;
      s += fmt::format("{} DATA index {} using 1:2 with points {}", first ? "" : ",",
                       block - out.data.begin(), style);
      first = false;
    }
    s += "\n";
  }
  std::vector<apps::KeyEntry> key;
  for (const auto& [engine, style] : engines) key.push_back({"with points " + style, engine});
  return s += apps::key_strip(out, key, 3) + "unset multiplot\n", out;
}

std::string number(double x) { return fmt::format("{:.1e}", x); }

apps::Table table_of(const std::vector<bench::Verdict>& verdicts) {
  apps::Table out{{"motion", "engine", "its best setting", "error [m]", "time per s", "unhand in that time",
                   "more accurate", "time of unhand for that error", "faster", "100x or 10x", "settings"},
                  {},
                  3};
  for (const auto& v : verdicts)
    out.rows.push_back({v.best.truth, v.best.engine, v.best.setting, number(v.best.error),
                        number(v.best.seconds), v.in_time ? number(v.in_time->error) : "-",
                        v.accuracy_words(), v.for_error ? number(v.for_error->seconds) : "-", v.speed_words(),
                        v.goal() ? "yes" : "no", fmt::format("{} of {}", v.met, v.settings)});
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: peers OUT_DIRECTORY\n");
    return 2;
  }
  const std::filesystem::path out = argv[1];
  const std::vector<Work> all = bench::run_all();
  apps::Table runs{{"motion", "engine", "setting", "error [m]", "s per simulated s"}, {}, 3};
  for (const auto& motion : kMotions)
    for (const Work& w : all)
      if (w.truth == motion)
        runs.rows.push_back({w.truth, w.engine, w.setting, number(w.error), number(w.seconds)});
  const apps::Table verdicts = table_of(bench::verdicts(all));
  std::filesystem::create_directories(out);
  apps::write_text(out / "peers.csv", runs.csv());
  apps::write_text(out / "peers.md", verdicts.markdown());
  draw(figure(all), out, "synthetic throws, bench/peers");
  fmt::print("{}\n{}", runs.text(), verdicts.text());
}
