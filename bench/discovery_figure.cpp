#include "bench/discovery_figure.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>

#include "fitting/distributions.hpp"

namespace unhand {
namespace {

/// Trials of sizes within a factor of two.
struct SizeBin {
  double low{}, high{};
  double ln_sum{};
  int n{}, found{};
  double middle() const { return std::exp(ln_sum / n); }  ///< geometric mean of the sizes
};

std::vector<SizeBin> bins_of(const std::vector<Trial>& trials) {
  std::map<int, SizeBin> bins;
  for (const Trial& trial : trials) {
    const int power = static_cast<int>(std::floor(std::log2(trial.size)));
    SizeBin& bin = bins[power];
    bin.low = std::exp2(power), bin.high = std::exp2(power + 1);
    bin.ln_sum += std::log(trial.size), bin.n += 1, bin.found += trial.found ? 1 : 0;
  }
  std::vector<SizeBin> out;
  for (const auto& entry : bins) out.push_back(entry.second);
  return out;
}

/// Whether the bins scatter about the curve as chance makes them: Pearson's χ², for which a bin must promise
/// one found and one missed campaign at least; others are left out.
bool follows(const std::vector<SizeBin>& bins, const Logistic& curve) {
  double chi2 = 0;
  int n = 0;
  for (const SizeBin& bin : bins) {
    const double p = curve.at(bin.middle()), expected = bin.n * p;
    if (expected < 1 || bin.n - expected < 1) continue;
    chi2 += (bin.found - expected) * (bin.found - expected) / (expected * (1 - p));
    ++n;
  }
  return fitting::chi2_tail(chi2, n - 2) > 0.01;
}

/// A campaign of one effect as the figure marks it.
struct Mark {
  double size{};
  bool found{}, evident{};
};
std::map<std::string, std::vector<Mark>> marks_of(const std::vector<StudyRecord>& records) {
  std::map<std::string, std::vector<Mark>> out;
  for (const auto& r : records)
    if (r.kind == "one" && r.without.empty() && r.made)
      for (const auto& effect : r.effects)
        if (effect.size > 0) out[effect.id].push_back({effect.size, effect.right, effect.evident});
  return out;
}

std::vector<Trial> trials_of(const std::vector<Mark>& marks) {
  std::vector<Trial> out;
  for (const Mark& mark : marks) out.push_back({mark.size, mark.found});
  return out;
}

/// Found, evident but too small, not seen: they differ in form, in lightness and in colour (Okabe and Ito).
constexpr std::array<const char*, 3> kMarks{
    "with points pointtype 7 pointsize 0.8 linecolor rgb '#0072b2'",
    "with points pointtype 8 pointsize 1.1 linewidth 1.3 linecolor rgb '#d55e00'",
    "with points pointtype 6 pointsize 1.0 linewidth 1.3 linecolor rgb '#000000'"};
constexpr const char* kHalf = "linewidth 2.2 linecolor rgb '#909090'";

}  // namespace

double Logistic::at(double size) const { return 1 / (1 + std::exp(-a - b * std::log(size))); }
double Logistic::half() const { return std::exp(-a / b); }

std::optional<Logistic> fit_logistic(const std::vector<Trial>& trials) {
  std::array<double, 2> low{HUGE_VAL, HUGE_VAL}, high{0, 0};  // of the sizes, missed and found
  for (const Trial& trial : trials) {
    low[trial.found] = std::min(low[trial.found], trial.size);
    high[trial.found] = std::max(high[trial.found], trial.size);
  }
  if (!(low[0] < high[1] && low[1] < high[0])) return std::nullopt;
  Eigen::Vector2d at{0, 0};
  const auto log_likelihood = [&](const Eigen::Vector2d& x) {
    double sum = 0;
    for (const Trial& trial : trials) {
      const double z = x[0] + x[1] * std::log(trial.size);
      sum -= std::log1p(std::exp(trial.found ? -z : z));
    }
    return sum;
  };
  for (int iteration = 0; iteration < 100; ++iteration) {  // Newton's, halved where it goes too far
    Eigen::Vector2d slope{0, 0};
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    for (const Trial& trial : trials) {
      const Eigen::Vector2d row{1, std::log(trial.size)};
      const double p = 1 / (1 + std::exp(-row.dot(at)));
      slope += ((trial.found ? 1 : 0) - p) * row;
      information += p * (1 - p) * row * row.transpose();
    }
    Eigen::Vector2d step = information.ldlt().solve(slope);
    if (step.norm() < 1e-9 * (1 + at.norm())) {
      if (!(at[1] > 0)) return std::nullopt;
      const Eigen::Vector2d turn{-1 / at[1], at[0] / (at[1] * at[1])};  // d ln half / d(a, b)
      return Logistic{at[0], at[1], std::sqrt(turn.dot(information.ldlt().solve(turn)))};
    }
    while (log_likelihood(at + step) < log_likelihood(at) && step.norm() > 1e-12) step *= 0.5;
    at += step;
  }
  return std::nullopt;
}

std::pair<double, double> wilson95(int found, int n) {
  const double z2 = fitting::kNormal95 * fitting::kNormal95, p = static_cast<double>(found) / n;
  const double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = fitting::kNormal95 * std::sqrt(p * (1 - p) / n + z2 / (4.0 * n * n)) / (1 + z2 / n);
  return {std::max(0.0, middle - half), std::min(1.0, middle + half)};
}

apps::Figure detection_figure(const std::vector<StudyRecord>& records) {
  const auto by_effect = marks_of(records);
  std::vector<Mark> all;
  for (const auto& entry : by_effect) all.insert(all.end(), entry.second.begin(), entry.second.end());
  if (all.empty())
    throw std::runtime_error("discovery_study: no campaigns of one effect with all sensors, none to draw");
  const auto [least, most] = std::minmax_element(
      all.begin(), all.end(), [](const Mark& a, const Mark& b) { return a.size < b.size; });
  const double left = least->size / 1.15, right = most->size * 1.15;

  const double row = 0.56, names = 4.6, rest = 1.45, key = 0.1 + apps::key_height(4, 2);
  const auto rows = static_cast<double>(by_effect.size());
  apps::Figure out{"detection", 17, key + 1.5 + row * rows + 0.5 + 4.6 + 0.4, {}, {}};

  const auto trials = trials_of(all);
  const auto bins = bins_of(trials);
  apps::DataBlock rates{"share found of all effects, by size",
                        {"geometric mean of the sizes [typical steps]", "least", "largest", "share found",
                         "95 % from", "to", "campaigns"},
                        {},
                        {}};
  for (const SizeBin& bin : bins) {
    const auto [from, to] = wilson95(bin.found, bin.n);
    rates.rows.push_back({bin.middle(), std::max(bin.low, left), std::min(bin.high, right),
                          static_cast<double>(bin.found) / bin.n, from, to, static_cast<double>(bin.n)});
  }
  apps::DataBlock curve{
      "logistic fit in the logarithm of the size", {"size [typical steps]", "share found"}, {}, {}};
  const auto pooled = fit_logistic(trials);
  if (pooled && follows(bins, *pooled))
    for (int k = 0; k <= 100; ++k) {
      const double size = left * std::pow(right / left, k / 100.0);
      curve.rows.push_back({size, pooled->at(size)});
    }
  std::array<apps::DataBlock, 3> marks;
  constexpr std::array<const char*, 3> titles{"found", "missed, but called evident and too small to matter",
                                              "missed"};
  for (std::size_t k = 0; k < 3; ++k) marks[k] = {titles[k], {"size [typical steps]", "row"}, {}, {}};
  apps::DataBlock halves{"half are found at (logistic fit in the logarithm of the size)",
                         {"size [typical steps]", "row", "95 % from", "to"},
                         {},
                         {}};
  apps::DataBlock counts{"found of all, by effect", {"row"}, {}, {}};
  std::vector<std::string> ids;
  for (const auto& [id, of] : by_effect) {
    const auto at = static_cast<double>(ids.size());
    int found = 0;
    for (const Mark& mark : of) {
      marks[mark.found ? 0 : mark.evident ? 1 : 2].rows.push_back({mark.size, at});
      found += mark.found ? 1 : 0;
    }
    if (const auto fit = fit_logistic(trials_of(of)); fit && fit->half() > left && fit->half() < right) {
      const double factor = std::exp(fitting::kNormal95 * fit->sigma_ln_half);
      halves.rows.push_back(
          {fit->half(), at, std::max(left, fit->half() / factor), std::min(right, fit->half() * factor)});
    }
    counts.rows.push_back({at});
    counts.labels.push_back(fmt::format("{}/{}", found, of.size()));
    ids.push_back(id);
  }
  out.data = {rates, curve, marks[0], marks[1], marks[2], halves, counts};

  std::string& s = out.script;
  s += "set multiplot\nunset key\n";
  std::string tics;
  for (double decade = 1e-3; decade < right; decade *= 10)
    for (const int digit : {1, 2, 5}) tics += fmt::format("{}{:g}", tics.empty() ? "" : ", ", digit * decade);
  s += fmt::format("set logscale x\nset xtics ({})\nset xrange [{:.6g}:{:.6g}]\n", tics, left, right);
  const double bottom = key + 1.5, between = bottom + row * rows;
  s += apps::place(out, {names, out.width - rest, between + 0.5, out.height - 0.4});
  s += "set format x ''\nset yrange [0:1.08]\nset ytics 0, 0.25, 1\nset ylabel 'share found, all effects'\n";
  const auto found = std::count_if(all.begin(), all.end(), [](const Mark& mark) { return mark.found; });
  s += fmt::format("set label 1 '{}/{}' at graph 1, first 1 left offset 0.6,0 textcolor rgb '#404040'\n",
                   found, all.size());
  s += "plot ";
  if (!curve.rows.empty())
    s += "DATA index 1 using 1:2 with lines linewidth 1.6 linecolor rgb '#e69f00', \\\n  ";
  s +=
      "DATA index 0 using 1:4:2:3:5:6 with xyerrorbars pointtype 7 pointsize 0.9 linewidth 1.2 linecolor rgb "
      "'#202020', \\\n"
      "  DATA index 0 using 1:(0.06):(sprintf('%d', $7)) with labels textcolor rgb '#606060'\n";
  s += apps::place(out, {names, out.width - rest, bottom, between});
  s += "unset label 1\nset format x '%g'\nset xlabel 'size [typical steps]'\nunset ylabel\n";
  s += fmt::format("set yrange [{}:-0.5]\nset ytics ({}) scale 0\n", rows - 0.5, apps::named_tics(ids));
  s += fmt::format("plot DATA index 5 using 1:2:3:4 with xerrorbars pointtype -1 {}, \\\n", kHalf);
  s += fmt::format("  DATA index 5 using 1:($2-0.38):(0):(0.76) with vectors nohead {}", kHalf);
  for (std::size_t k = 0; k < 3; ++k)
    s += fmt::format(", \\\n  DATA index {} using 1:2 {}", k + 2, kMarks[k]);
  s += fmt::format(
      ", \\\n  DATA index 6 using ({:.6g}):1:2 with labels left offset 0.6,0 textcolor rgb '#404040'\n",
      right);
  s += apps::key_strip(out,
                       {{kMarks[0], "found"},
                        {kMarks[1], "evident but too small to matter"},
                        {kMarks[2], "missed"},
                        {fmt::format("with lines {}", kHalf), "half are found (fit), with 95 %"}},
                       2);
  s += "unset multiplot\n";
  return out;
}

}  // namespace unhand
