#include "planners/flip/release_learner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "dynamics/dense_solve.hpp"

namespace unhand::planners::flip {
namespace {

/// What throws scatter by before any has been seen, 1 σ.
constexpr double kScatterX = 0.03, kScatterAngle = 0.25;
constexpr DetachVector kScatterDetach{0.003, 0.003, 0.05, 0.04, 0.04, 0.5};
constexpr int kScatterFreedom = 4;

double kernel(const LeftOver& a, const std::array<double, 3>& at, const Bar& bar) {
  constexpr double other_bar = 0.8;
  return (a.bar == bar ? 1.0 : other_bar) * likeness(a.at, at);
}

/// Probability that a normal variable lies within ± half of `middle`.
double within(double mean, double sigma, double middle, double half) {
  const auto phi = [&](double x) { return 0.5 * std::erfc(-(x - mean) / (sigma * std::numbers::sqrt2)); };
  return std::max(0.0, phi(middle + half) - phi(middle - half));
}

}  // namespace

std::vector<LeftOver> left_over(const HandLibrary& library, const ReleaseCard& card,
                                std::span<const FlipDatum> data) {
  std::vector<LeftOver> out;
  const double l = library.bar().com_offset;
  for (const FlipDatum& one : data) {
    const auto release = predicted_release(library.simulate(one.command), card, library.bar());
    if (!release) continue;
    const DetachVector seen = shifted(one.detach, -l), predicted = shifted(release->detach, -l);
    LeftOver left{library.robot().motion.range.fractions(one.command), library.bar(), {}, one.throws};
    for (std::size_t j = 0; j < 6; ++j) left.value[j] = seen[j] - predicted[j];
    out.push_back(left);
  }
  return out;
}

ThrowScatter scatter_of(std::span<const FlipTrial> trials, double com_offset) {
  ThrowScatter out{kScatterX * kScatterX * kScatterFreedom,
                   kScatterAngle * kScatterAngle * kScatterFreedom,
                   {},
                   kScatterFreedom};
  for (std::size_t j = 0; j < 6; ++j) out.detach[j] = kScatterDetach[j] * kScatterDetach[j] * kScatterFreedom;
  for (std::size_t begin = 0; begin < trials.size();) {
    std::size_t end = begin;
    while (end < trials.size() && trials[end].command == trials[begin].command) ++end;
    const auto group = trials.subspan(begin, end - begin);
    begin = end;
    const auto mean = mean_of(group);
    if (!mean || mean->throws < 2) continue;
    DetachVector middle{};
    for (const FlipTrial& t : group) {
      if (t.outcome != FlipOutcome::landed) continue;
      const DetachVector d = shifted(t.detach, -com_offset);
      for (std::size_t j = 0; j < 6; ++j) middle[j] += d[j] / mean->throws;
    }
    for (const FlipTrial& t : group) {
      if (t.outcome != FlipOutcome::landed) continue;
      const DetachVector d = shifted(t.detach, -com_offset);
      out.x += std::pow(t.landing.x - mean->landing.x, 2);
      out.angle += std::pow(t.landing.angle - mean->landing.angle, 2);
      for (std::size_t j = 0; j < 6; ++j) out.detach[j] += std::pow(d[j] - middle[j], 2);
    }
    out.freedom += mean->throws - 1;
  }
  out.x /= out.freedom;
  out.angle /= out.freedom;
  for (double& v : out.detach) v /= out.freedom;
  return out;
}

void LeftOverField::set(std::vector<LeftOver> samples, const DetachVector& throw_variance) {
  samples_ = std::move(samples);
  const Eigen::Index n = static_cast<Eigen::Index>(samples_.size());
  if (n == 0) return;
  Eigen::MatrixXd K(n, n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b) {
      const LeftOver& other = samples_[static_cast<std::size_t>(b)];
      K(a, b) = kernel(samples_[static_cast<std::size_t>(a)], other.at, other.bar);
    }
  for (std::size_t j = 0; j < 6; ++j) {
    Eigen::VectorXd y(n), noise(n);
    for (Eigen::Index a = 0; a < n; ++a) {
      const LeftOver& one = samples_[static_cast<std::size_t>(a)];
      y[a] = one.value[j];
      noise[a] = throw_variance[j] / std::max(1, one.throws);
    }
    double best = -std::numeric_limits<double>::infinity();
    for (double factor = 0.125; factor < 5; factor *= 2) {
      const double sigma = factor * kDiscrepancy[j];
      Eigen::MatrixXd A = sigma * sigma * K;
      A.diagonal() += noise;
      const Eigen::VectorXd weights = dynamics::definite_solve(A, y);
      const double evidence = -0.5 * (y.dot(weights) + dynamics::log_determinant(A));
      if (!(evidence > best)) continue;
      best = evidence;
      sigma_[j] = sigma;
      inverse_[j] = dynamics::definite_inverse(A);
      weights_[j] = weights;
    }
  }
}

LeftOverField::At LeftOverField::at(const std::array<double, 3>& fractions, const Bar& bar) const {
  At out;
  const Eigen::Index n = static_cast<Eigen::Index>(samples_.size());
  Eigen::VectorXd k(n);
  for (Eigen::Index a = 0; a < n; ++a) k[a] = kernel(samples_[static_cast<std::size_t>(a)], fractions, bar);
  for (std::size_t j = 0; j < 6; ++j) {
    const double s2 = sigma_[j] * sigma_[j];
    out.variance[j] = s2;
    if (n == 0) continue;
    out.mean[j] = s2 * k.dot(weights_[j]);
    out.variance[j] = std::max(0.0, s2 - s2 * s2 * k.dot(inverse_[j] * k));
  }
  return out;
}

double probability_of_hits(const FlipForecast& forecast, const FlipTarget& target, int throws) {
  constexpr double kReach = 5, kLongest = 0.8, kShortest = kReach / 200;  // of what is not known [σ]
  const double scatter_x = forecast.scatter_x, scatter_angle = forecast.scatter_angle,
               along = forecast.correlation * forecast.sigma_angle,
               across = std::sqrt(std::max(0.0, 1 - forecast.correlation * forecast.correlation)) *
                        forecast.sigma_angle;
  const auto is_beyond = [](double off, double tolerance, double unknown, double scatter) {
    return std::abs(off) > tolerance + 7 * std::hypot(unknown, scatter);
  };
  if (is_beyond(forecast.mean.x - target.pose.x, target.tolerance_x, forecast.sigma_x, scatter_x) ||
      is_beyond(forecast.mean.angle - target.pose.angle, target.tolerance_angle, forecast.sigma_angle,
                scatter_angle))
    return 0;
  // What is summed varies within a scatter of the throws.
  const auto step = [&](double scattered, double moves) {
    return std::clamp(scattered / std::max(1e-12, std::abs(moves)), kShortest, kLongest);
  };
  const double du = std::min(step(scatter_x, forecast.sigma_x), step(scatter_angle, along)),
               dv = step(scatter_angle, across);
  const int last_u = static_cast<int>(kReach / du), last_v = static_cast<int>(kReach / dv);
  double out = 0;
  for (int i = -last_u; i <= last_u; ++i) {
    const double u = i * du, px = within(forecast.mean.x + u * forecast.sigma_x, scatter_x, target.pose.x,
                                         target.tolerance_x);
    if (px < 1e-9) continue;
    double of_angles = 0;
    for (int j = -last_v; j <= last_v; ++j) {
      const double v = j * dv, p = within(forecast.mean.angle + along * u + across * v, scatter_angle,
                                          target.pose.angle, target.tolerance_angle);
      of_angles += std::exp(-0.5 * v * v) * std::pow(p, throws);
    }
    out += std::exp(-0.5 * u * u) * std::pow(px, throws) * of_angles;
  }
  return std::min(1.0, out * du * dv / (2 * std::numbers::pi));
}

std::optional<PredictedDetach> predicted_detach(const release::HandMotion& hand, const ReleaseFit& fit,
                                                const Bar& bar, const ThrowSpread& throws) {
  const auto let_go = [&](const ReleaseCard& card, double offset, double angle) {
    Bar held = bar;
    held.com_offset += offset;
    const auto release = predicted_release(hand, card, held, angle);
    return release ? std::optional(release->detach) : std::nullopt;
  };
  const auto changed = [&](const Eigen::Vector4d& by) {
    ReleaseCard out = fit.card;
    out.mu.value = std::max(0.01, out.mu.value + by[0]);
    out.length = std::max(1e-4, out.length + by[1]);
    out.dead_time.value = std::max(0.0, out.dead_time.value + by[2]);
    out.opening_time.value = std::max(0.01, out.opening_time.value + by[3]);
    return out;
  };
  PredictedDetach out;
  const auto middle = let_go(fit.card, 0, 0);
  if (!middle) return {};
  out.detach = *middle;
  const auto differ = [&](std::size_t direction, const Eigen::Vector4d& by, double offset, double angle) {
    if (by.isZero() && offset == 0 && angle == 0) return;
    const auto up = let_go(changed(by), offset, angle), down = let_go(changed(-by), -offset, -angle);
    const DetachVector &high = up ? *up : *middle, &low = down ? *down : *middle;
    for (std::size_t j = 0; j < 6; ++j) out.by[direction][j] = (high[j] - low[j]) / (up && down ? 2 : 1);
  };
  const dynamics::Spectrum spectrum = dynamics::spectrum_of(fit.covariance);
  for (std::size_t k = 0; k < PredictedDetach::kOfCard; ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    differ(k, std::sqrt(std::max(0.0, spectrum.values[column])) * spectrum.vectors.col(column), 0, 0);
  }
  const double mu = fit.card.mu.value * std::hypot(throws.mu, throws.grip_force);
  differ(4, {mu, 0, 0, 0}, 0, 0);
  differ(5, {0, 0, throws.dead_time, 0}, 0, 0);
  differ(6, {0, 0, 0, throws.opening_time}, 0, 0);
  differ(7, Eigen::Vector4d::Zero(), throws.grasp_offset, 0);
  differ(8, Eigen::Vector4d::Zero(), 0, throws.grasp_angle);
  return out;
}

namespace {

/// Variances and covariance of a landing [m², rad², m rad].
struct LandingSpread {
  double x{}, angle{}, cross{};
  /// Of a σ each way; the flight is mildly curved. Whether both land.
  bool add(const std::optional<FlipPose>& up, const std::optional<FlipPose>& down) {
    if (!up || !down) return false;
    const double dx = 0.5 * (up->x - down->x), da = 0.5 * (up->angle - down->angle);
    x += dx * dx, angle += da * da, cross += dx * da;
    return true;
  }
};

DetachVector plus(DetachVector a, const DetachVector& b, double sign) {
  for (std::size_t j = 0; j < 6; ++j) a[j] += sign * b[j];
  return a;
}

/// What landings of a command scatter by, as declared; empty where some do not land.
template <class Land>
std::optional<LandingSpread> declared_scatter(const PredictedDetach& predicted, const Land& land) {
  LandingSpread out;
  for (std::size_t k = PredictedDetach::kOfCard; k < PredictedDetach::kAll; ++k)
    if (!out.add(land(plus(predicted.detach, predicted.by[k], 1)),
                 land(plus(predicted.detach, predicted.by[k], -1))))
      return {};
  return out;
}

}  // namespace

ReleaseLearner::ReleaseLearner(const HandLibrary& library, const ReleaseFit& fit, std::vector<LeftOver> known,
                               const ThrowScatter& scatter, const FlipTarget& target, int throws)
    : library_(library),
      fit_(fit),
      samples_(std::move(known)),
      scatter_(scatter),
      target_(target),
      throws_(throws) {
  validate(target_);
  if (throws_ < 1)
    throw std::invalid_argument(fmt::format("release learner: throws = {} is not in [1, inf)", throws_));
  const FlipRobot& robot = library_.robot();
  for (std::size_t i = 0; i < library_.commands().size(); ++i) {
    const auto predicted = predicted_detach(library_.hand(i), fit_, library_.bar(), robot.throws);
    mesh_[0].push_back(predicted ? std::optional(predicted->detach) : std::nullopt);
    for (std::size_t k = 0; k < PredictedDetach::kAll; ++k)
      mesh_[1 + k].push_back(predicted ? std::optional(predicted->by[k]) : std::nullopt);
  }
  double x = 0, angle = 0, n = 0;
  std::optional<HandLibrary> of_another_bar;
  const auto hands_with = [&](const Bar& bar) -> const HandLibrary& {
    if (bar == library_.bar()) return library_;
    if (!of_another_bar || !(of_another_bar->bar() == bar)) of_another_bar.emplace(robot, bar, 2);
    return *of_another_bar;
  };
  for (const LeftOver& one : samples_) {
    const HandLibrary& of_its_bar = hands_with(one.bar);
    const auto predicted =
        predicted_detach(of_its_bar.simulate(robot.motion.range.at(one.at[0], one.at[1], one.at[2])), fit_,
                         one.bar, robot.throws);
    const auto declared = predicted ? declared_scatter(*predicted, fly_flip) : std::nullopt;
    if (declared) x += declared->x, angle += declared->angle, n += 1;
  }
  if (x > 0 && angle > 0) of_declared_ = {scatter_.x * n / x, scatter_.angle * n / angle};
  field_.set(samples_, scatter_.detach);
}

ReleaseLearner ReleaseLearner::aimed_at(const FlipTarget& target) const {
  validate(target);
  ReleaseLearner out = *this;
  out.target_ = target;
  return out;
}

std::optional<PredictedDetach> ReleaseLearner::between(const Fractions& fractions) const {
  PredictedDetach out;
  const auto detach = library_.between(mesh_[0], fractions);
  if (!detach) return {};
  out.detach = *detach;
  for (std::size_t k = 0; k < PredictedDetach::kAll; ++k)
    out.by[k] = library_.between(mesh_[1 + k], fractions).value();
  return out;
}

std::optional<FlipForecast> ReleaseLearner::forecast(const Fractions& fractions,
                                                     const PredictedDetach& predicted) const {
  const double l = library_.bar().com_offset;
  const LeftOverField::At left = field_.at(fractions, library_.bar());
  const auto land = [&](const DetachVector& detach, const DetachVector& rest) {
    return fly_flip(shifted(plus(shifted(detach, -l), rest, 1), l));
  };
  const auto mean = land(predicted.detach, left.mean);
  if (!mean) return {};
  LandingSpread unknown;
  for (std::size_t j = 0; j < 6; ++j) {
    DetachVector up = left.mean, down = left.mean;
    up[j] += std::sqrt(left.variance[j]), down[j] -= std::sqrt(left.variance[j]);
    if (!unknown.add(land(predicted.detach, up), land(predicted.detach, down))) return {};
  }
  for (std::size_t k = 0; k < PredictedDetach::kOfCard; ++k)
    if (!unknown.add(land(plus(predicted.detach, predicted.by[k], 1), left.mean),
                     land(plus(predicted.detach, predicted.by[k], -1), left.mean)))
      return {};
  FlipForecast out{*mean, std::sqrt(unknown.x),  std::sqrt(unknown.angle),
                   0,     std::sqrt(scatter_.x), std::sqrt(scatter_.angle),
                   0};
  if (of_declared_) {
    const auto declared =
        declared_scatter(predicted, [&](const DetachVector& detach) { return land(detach, left.mean); });
    if (!declared) return {};
    out.scatter_x = std::sqrt((*of_declared_)[0] * declared->x);
    out.scatter_angle = std::sqrt((*of_declared_)[1] * declared->angle);
  }
  const double product = out.sigma_x * out.sigma_angle;
  out.correlation = product > 0 ? std::clamp(unknown.cross / product, -1.0, 1.0) : 0.0;
  out.probability = probability_of_hits(out, target_, throws_);
  return out;
}

std::optional<FlipForecast> ReleaseLearner::forecast(const FlipCommand& u) const {
  const FlipRobot& robot = library_.robot();
  const auto predicted = predicted_detach(library_.simulate(u), fit_, library_.bar(), robot.throws);
  if (!predicted) return {};
  return forecast(robot.motion.range.fractions(u), *predicted);
}

/// The probability; among commands that hit about as surely, and far from the target, where none does, the
/// error decides.
double ReleaseLearner::worth(const std::optional<FlipForecast>& forecast) const {
  if (!forecast) return -1;
  constexpr double kPerTolerance = 0.02;
  return forecast->probability - kPerTolerance * std::min(49.0, normalized_error(forecast->mean, target_));
}

std::optional<FlipCommand> ReleaseLearner::next() {
  const CommandRange& range = library_.robot().motion.range;
  struct Point {
    std::array<double, 3> at;
    double worth;
  };
  std::vector<Point> points;
  for (std::size_t i = 0; i < mesh_[0].size(); ++i) {
    if (!mesh_[0][i]) continue;
    const auto at = range.fractions(library_.commands()[i]);
    PredictedDetach predicted{*mesh_[0][i], {}};
    for (std::size_t k = 0; k < PredictedDetach::kAll; ++k) predicted.by[k] = *mesh_[1 + k][i];
    points.push_back({at, worth(forecast(at, predicted))});
  }
  if (points.empty()) return {};
  // The best points of the mesh that are not neighbours, each improved along the axes by halved steps.
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.worth > b.worth; });
  std::vector<Point> starts;
  for (const Point& p : points) {
    const bool close = std::any_of(starts.begin(), starts.end(), [&](const Point& s) {
      return std::hypot(s.at[0] - p.at[0], s.at[1] - p.at[1], s.at[2] - p.at[2]) < 1.9 * library_.spacing();
    });
    if (!close) starts.push_back(p);
    if (starts.size() == 2) break;
  }
  Point best = starts.front();
  for (Point at : starts) {
    double step = 0.5 * library_.spacing();
    for (int round = 0; round < 12 && step > 0.01; ++round) {
      bool moved = false;
      for (std::size_t k = 0; k < 3; ++k)
        for (const double side : {step, -step}) {
          Point tried = at;
          tried.at[k] = std::clamp(tried.at[k] + side, 0.0, 1.0);
          if (tried.at[k] == at.at[k]) continue;
          const auto predicted = between(tried.at);
          tried.worth = worth(predicted ? forecast(tried.at, *predicted) : std::nullopt);
          if (!(tried.worth > at.worth)) continue;
          at = tried;
          moved = true;
          break;
        }
      if (!moved) step /= 2;
    }
    if (at.worth > best.worth) best = at;
  }
  return range.clamp(range.at(best.at[0], best.at[1], best.at[2]));
}

void ReleaseLearner::observe(std::span<const FlipTrial> trials) {
  const auto mean = mean_of(trials);
  if (!mean) return;
  const std::vector<FlipDatum> one{*mean};
  for (const LeftOver& left : left_over(library_, fit_.card, one)) samples_.push_back(left);
  field_.set(samples_, scatter_.detach);
}

}  // namespace unhand::planners::flip
