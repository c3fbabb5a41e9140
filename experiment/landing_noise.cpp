#include "experiment/landing_noise.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>
#include <numbers>
#include <vector>

#include "datasets/assemble.hpp"
#include "dynamics/pooled_scatter.hpp"
#include "dynamics/straight_line.hpp"

namespace unhand::experiment {
namespace {

using Pair = std::array<double, 2>;  // x [m], θ [rad]

/// The parabola through samples, by lines through them and through their times squared.
struct Parabola {
  dynamics::StraightLine values, squares;
  double bend{};
  Parabola(const std::vector<double>& t, const std::vector<double>& y) : values(dynamics::fit_line(t, y)) {
    std::vector<double> tt;
    for (const double s : t) tt.push_back(s * s);
    squares = dynamics::fit_line(t, tt);
    double cross = 0, spread = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      const double e = tt[i] - squares.at(t[i]);
      cross += e * (y[i] - values.at(t[i])), spread += e * e;
    }
    bend = cross / spread;
  }
  double at(double t) const { return values.at(t) + bend * (t * t - squares.at(t)); }
  double rate(double t) const { return values.slope + bend * (2 * t - squares.slope); }
};

/// Where the track passes the landing height.
std::optional<Pair> tracked_landing(const datasets::ThrowLog& log, const datasets::Throw& one) {
  constexpr double kLast = 0.1, kBeyond = 0.05;  // [s] that are fitted; that the fit is trusted beyond them
  constexpr double kClocks = 0.2;                // [s] by which clocks may differ
  constexpr std::size_t kEnough = 8;
  if (!one.mocap) return {};
  const auto& mocap = *one.mocap;
  const double landed = one.landing->time.empty() ? HUGE_VAL : one.landing->time(0);
  double end = landed;
  if (const auto below = datasets::first_below(mocap, log.dimension, log.landing_height))
    if (mocap.time(*below) < landed + kClocks) end = mocap.time(*below);
  std::vector<double> t, x, z, theta;
  for (std::size_t i = 0; i < mocap.time.rows; ++i) {
    if (!mocap.is_valid(i) || mocap.time(i) >= end || mocap.pose(i, 1) <= log.landing_height) continue;
    t.push_back(mocap.time(i));
    x.push_back(mocap.pose(i, 0)), z.push_back(mocap.pose(i, 1)), theta.push_back(mocap.pose(i, 2));
  }
  if (t.empty() || !(end - t.back() <= kClocks)) return {};
  const double last = t.back();
  std::size_t before = 0;
  while (t[before] < last - kLast) ++before;
  for (auto* series : {&t, &x, &z, &theta})
    series->erase(series->begin(), series->begin() + static_cast<std::ptrdiff_t>(before));
  if (t.size() < kEnough) return {};
  for (double& s : t) s -= last;
  const Parabola height(t, z);
  double s = 0;
  for (int k = 0; k < 10; ++k) {
    if (!(height.rate(s) < 0)) return {};
    s -= (height.at(s) - log.landing_height) / height.rate(s);
  }
  if (!(s <= kBeyond && s >= -kBeyond)) return {};
  return Pair{Parabola(t, x).at(s), dynamics::fit_line(t, theta).at(s)};
}

/// Whether a fit takes part of the throws.
bool has_train(const datasets::ThrowLog& log) {
  return std::any_of(log.throws.begin(), log.throws.end(),
                     [](const auto& one) { return one.split == datasets::Split::train; });
}

/// A number of the landings, and what motion capture says of it, by what they repeat.
struct Landings {
  std::map<std::string, std::vector<double>> landed, differences;
  std::vector<double> together;
};

/// Of x, and of the angle where a landing tells it.
std::array<Landings, 2> landings_of(const datasets::ThrowLog& log) {
  std::array<Landings, 2> out;
  const bool fitted = has_train(log);
  for (const auto& one : log.throws) {
    if (log.dimension != 2 || !one.landing || one.landing->pose.empty() ||
        (fitted && one.split != datasets::Split::train))
      continue;
    const std::string repeats = one.object + ", " + one.condition;
    const auto tracked = tracked_landing(log, one);
    for (std::size_t c = 0; c < (tells_angle(*one.landing) ? 2 : 1); ++c) {
      const double landed = one.landing->pose(0, c);
      out[c].landed[repeats].push_back(landed);
      if (!tracked) continue;
      out[c].differences[repeats].push_back(landed - (*tracked)[c]);
      out[c].together.push_back(landed - (*tracked)[c]);
    }
  }
  return out;
}

struct Noise {
  std::optional<double> sigma;
  std::string how;
};

Noise noise_of(const Landings& landings) {
  constexpr int kLeast = 3;
  using Pooled = dynamics::PooledScatter;
  const auto within = [](const std::map<std::string, std::vector<double>>& groups) {
    Pooled out;
    for (const auto& [name, members] : groups) out.add(members);
    return out;
  };
  const auto say = [](const Pooled& of, const char* what) {
    return Noise{of.sigma(), fmt::format("{}, {} degrees of freedom", what, of.freedom())};
  };
  if (const Pooled of = within(landings.differences); of.freedom() >= kLeast)
    return say(of, "scatter of landing minus motion capture within repetitions of a condition");
  if (const Pooled of = within({{"", landings.together}}); of.freedom() >= kLeast)
    return say(of, "scatter of landing minus motion capture over all throws");
  if (const Pooled of = within(landings.landed); of.freedom() >= kLeast)
    return say(of, "scatter of landings within repetitions of a condition, as large as throws differ");
  return {};
}

}  // namespace

LandingNoise landing_noise(const datasets::ThrowLog& log) {
  const auto [x, theta] = landings_of(log);
  const Noise of_x = noise_of(x), of_theta = noise_of(theta);
  if (of_x.sigma) {
    const bool alike = !of_theta.sigma || of_theta.how == of_x.how;
    return {of_x.sigma, of_theta.sigma,
            alike ? of_x.how : fmt::format("{}; of the angle, {}", of_x.how, of_theta.how)};
  }
  std::size_t seen = 0;
  for (const auto& [repeats, landed] : x.landed) seen += landed.size();
  return {{},
          {},
          fmt::format("{} landings{}, and neither repetitions nor motion capture at the landing height to "
                      "judge their noise by",
                      seen, has_train(log) ? " of train throws" : "")};
}

std::string in_words(const LandingNoise& noise, int landings) {
  if (!noise.x)
    return fmt::format("landing/pose declares no sigma in {} throws: its landings are not used ({})",
                       landings, noise.how);
  return fmt::format("landing/pose declares no sigma in {} throws: taken are {:.3g} m and {} ({})", landings,
                     *noise.x, noise.theta ? fmt::format("{:.3g} rad", *noise.theta) : "no angle", noise.how);
}

bool tells_angle(const datasets::LandingLog& landing) {
  return !landing.pose.empty() &&
         (landing.pose.sigma.empty() || landing.pose.sigma.back() < std::numbers::pi);
}

bool declares_noise(const datasets::LandingLog& landing, std::size_t column) {
  return landing.pose.sigma_of(column) > 0;
}

int landings_without_sigma(const datasets::ThrowLog& log) {
  int out = 0;
  for (const auto& one : log.throws)
    out += one.landing && !(declares_noise(*one.landing, 0) && declares_noise(*one.landing, 1));
  return out;
}

}  // namespace unhand::experiment
