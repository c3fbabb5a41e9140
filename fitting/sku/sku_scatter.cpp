#include "fitting/sku/sku_scatter.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "experiment/random_stream.hpp"

namespace unhand::fitting {

using dynamics::congruent, dynamics::definite_solve, dynamics::inner_products, dynamics::product,
    dynamics::Spectrum, dynamics::spectrum_of;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The part of a share of variance: of outcome y, divided by the tolerance's square.
struct Scaled {
  MatrixXd J, CJ;  // per tolerance
  double whole;
  Scaled(const MatrixXd& slopes, const MatrixXd& C, const LandingTolerance& tolerance) : J(slopes) {
    J.row(0) /= tolerance.x, J.row(1) /= tolerance.theta;
    CJ = product(C, J.transpose());
    whole = product(J, CJ).trace();
  }
};

}  // namespace

std::vector<BudgetLine> budget_of(const SkuMotion& motion, const MatrixXd& J,
                                  const LandingTolerance& tolerance) {
  const auto& inputs = motion.inputs;
  const Scaled s(J, inputs.covariance, tolerance);
  const auto nominal = motion.predict(inputs.values).landing.pose;
  const MatrixXd C = congruent(J, inputs.covariance);
  std::vector<BudgetLine> out;
  for (Index k = 0; k < J.cols(); ++k) {
    BudgetLine line;
    line.input = inputs.inputs[static_cast<std::size_t>(k)];
    line.x = std::abs(J(0, k)) * line.input.sigma;
    line.theta = std::abs(J(1, k)) * line.input.sigma;
    line.share = s.whole > 0 ? s.J.col(k).dot(s.CJ.row(k)) / s.whole : 0;
    VectorXd by = VectorXd::Zero(J.cols());
    by[k] = 1.5 * line.input.sigma;
    try {
      const auto up = motion.predict(inputs.moved(by)), down = motion.predict(inputs.moved(-by));
      if (!up.landed() || !down.landed()) {
        line.curvature = HUGE_VAL;
      } else {
        const auto bend = [&](double a, double b, double middle, double variance) {
          return variance > 0 ? std::abs(0.5 * (a + b) - middle) / std::sqrt(variance) : 0;
        };
        line.curvature =
            std::max(bend(up.landing.pose.x, down.landing.pose.x, nominal.x, C(0, 0)),
                     bend(up.landing.pose.theta, down.landing.pose.theta, nominal.theta, C(1, 1)));
      }
    } catch (const std::invalid_argument&) {
      line.curvature = HUGE_VAL;  // a value out of range within 1.5 σ
    }
    out.push_back(std::move(line));
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const BudgetLine& a, const BudgetLine& b) { return a.share > b.share; });
  return out;
}

std::vector<MeasurementGain> gains_of(const ThrowInputs& inputs, const MatrixXd& J,
                                      const LandingTolerance& tolerance) {
  const Scaled s(J, inputs.covariance, tolerance);
  std::vector<MeasurementGain> out;
  for (const auto& one : inputs.inputs) {
    if (one.measurement.empty() || std::any_of(out.begin(), out.end(), [&](const MeasurementGain& g) {
          return g.measurement == one.measurement;
        }))
      continue;
    MeasurementGain gain{one.measurement, {}, 0};
    std::vector<Index> group;
    for (std::size_t k = 0; k < inputs.inputs.size(); ++k)
      if (inputs.inputs[k].measurement == one.measurement) {
        group.push_back(static_cast<Index>(k));
        gain.inputs.push_back(inputs.inputs[k].name);
      }
    // What knowing the group takes off: J C_g C_gg⁻¹ C_gᵀ Jᵀ.
    const MatrixXd rows = s.CJ(group, Eigen::all), own = inputs.covariance(group, group);
    const double off = inner_products(rows, definite_solve(own, rows)).trace();
    gain.share = s.whole > 0 ? off / s.whole : 0;
    out.push_back(std::move(gain));
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.share > b.share; });
  return out;
}

namespace {

/// A matrix R with R Rᵀ = C, for C positive semidefinite.
MatrixXd root_of(const MatrixXd& C) {
  const Spectrum spectrum = spectrum_of(C);
  return spectrum.vectors * spectrum.values.cwiseMax(0).cwiseSqrt().asDiagonal();
}

struct Draw {
  bool landed{}, within{}, linear_within{};
  LandingSample sample;
};

Draw draw(const SkuMotion& motion, const ThrowCandidate& nominal, const MatrixXd& J, const MatrixXd& root,
          const SkuRequest& request, std::uint64_t index) {
  experiment::RandomStream random(request.seed, index, experiment::Purpose::validation);
  const auto& t = request.tolerance;
  constexpr int kAgain = 50;
  for (int attempt = 0; attempt < kAgain; ++attempt) {
    VectorXd normal(root.cols());
    for (Index k = 0; k < normal.size(); ++k) normal[k] = random.normal();
    const VectorXd by = root * normal;
    Draw out;
    const Eigen::Vector2d linear = J * by;
    out.sample.linear_x = linear[0];
    out.sample.linear_theta = linear[1];
    out.linear_within = std::abs(linear[0]) <= t.x && std::abs(linear[1]) <= t.theta;
    try {
      const auto values = motion.inputs.drawn(by);
      const auto p = motion.predict(values);
      out.landed = p.landed() && motion.held(values);
      if (out.landed) {
        out.sample.x = p.landing.pose.x - nominal.landing_x;
        out.sample.theta = p.landing.pose.theta - nominal.landing_theta;
        out.within = std::abs(out.sample.x) <= t.x && std::abs(out.sample.theta) <= t.theta;
      }
      return out;
    } catch (const std::invalid_argument&) {  // out of range: no such throw
    }
  }
  return {};
}

/// Mean and 1 σ of a member of the samples.
std::pair<double, double> moments(const std::vector<LandingSample>& samples, double LandingSample::*member) {
  double mean = 0, square = 0;
  const auto n = static_cast<double>(samples.size());
  for (const auto& s : samples) mean += s.*member / n;
  for (const auto& s : samples) square += (s.*member - mean) * (s.*member - mean);
  return {mean, n > 1 ? std::sqrt(square / (n - 1)) : 0};
}

}  // namespace

void monte_carlo(const SkuMotion& motion, const MatrixXd& J, const SkuRequest& request, SkuValidation& out) {
  const MatrixXd root = root_of(motion.inputs.covariance);
  std::vector<Draw> draws(static_cast<std::size_t>(request.samples));
  dynamics::parallel_for(draws.size(), request.threads, [&](std::size_t i) {
    draws[i] = draw(motion, out.reference(), J, root, request, i);
  });
  const auto n = static_cast<double>(draws.size());
  out.within_sigma = std::sqrt(request.confidence * (1 - request.confidence) / n);
  const auto share = [&](bool Draw::*is) {  // a quotient of whole numbers: a sum of n-ths may exceed one
    return static_cast<double>(
               std::count_if(draws.begin(), draws.end(), [=](const Draw& d) { return d.*is; })) /
           n;
  };
  out.within = share(&Draw::within);
  out.within_linear = share(&Draw::linear_within);
  out.lost = 1 - share(&Draw::landed);
  for (const Draw& d : draws)
    if (d.landed) out.samples.push_back(d.sample);
  const auto [x, sx] = moments(out.samples, &LandingSample::x);
  const auto [theta, stheta] = moments(out.samples, &LandingSample::theta);
  const auto [lx, slx] = moments(out.samples, &LandingSample::linear_x);
  const auto [ltheta, sltheta] = moments(out.samples, &LandingSample::linear_theta);
  out.monte_carlo = {sx, stheta, x, theta};
  // The same draws: what differs is curvature, not chance.
  constexpr double kAgree = 0.1;
  const auto same = [](double mean, double sigma, double linear_mean, double linear_sigma) {
    return std::abs(mean - linear_mean) <= kAgree * linear_sigma &&
           std::abs(sigma - linear_sigma) <= kAgree * linear_sigma;
  };
  const bool linear = same(x, sx, lx, slx) && same(theta, stheta, ltheta, sltheta);
  out.agree = linear && out.lost == 0;
  if (out.agree) return;
  const auto whom = [](const UncertainInput* open) -> std::string {
    return open == nullptr ? "believe the Monte Carlo"
                           : fmt::format(
                                 "the card's log does not determine {}, so that neither is sure: make the "
                                 "card from a log that does",
                                 open->name);
  };
  if (linear) {
    const auto open = std::find_if(out.budget.begin(), out.budget.end(),
                                   [](const BudgetLine& line) { return !line.input.determined; });
    out.disagreement =
        "Monte Carlo and derivatives agree where the object lands, but derivatives know nothing of "
        "draws that slip out of the grip or do not land; " +
        whom(open == out.budget.end() ? nullptr : &open->input);
    return;
  }
  const auto worst = std::max_element(out.budget.begin(), out.budget.end(),
                                      [](const auto& a, const auto& b) { return a.curvature < b.curvature; });
  out.disagreement = fmt::format(
      "Monte Carlo and derivatives differ by more than {:.0f} % of sigma: the landing is not linear in {} "
      "over its spread; {}",
      100 * kAgree, worst == out.budget.end() ? "its inputs" : worst->input.name,
      whom(worst == out.budget.end() || worst->input.determined ? nullptr : &worst->input));
}

namespace {

/// Predicted landings of one condition, each with its own hand and force.
struct Repetitions {
  int n{};
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();     ///< [m, rad]
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();  ///< about the mean

  explicit Repetitions(const std::vector<Eigen::Vector2d>& all) : n(static_cast<int>(all.size())) {
    for (const auto& one : all) mean += one / n;
    for (const auto& one : all) squares += (one - mean) * (one - mean).transpose();
  }
};

}  // namespace

std::optional<MotionRepeats> repeats_of(const SkuRequest& request, const LoggedLandings& landings,
                                        const SkuValidation& answer) {
  const auto& throws = request.log->throws;
  std::map<std::string, std::vector<Eigen::Vector2d>> by_condition;
  for (std::size_t i = 0; i < throws.size(); ++i)
    if (landings[i]) by_condition[repeated_motion(throws[i])].push_back(*landings[i]);
  constexpr int kFewest = 3;  // degrees of freedom
  const ThrowCandidate& nominal = answer.reference();
  const auto own = by_condition.find(nominal.repeats);
  MotionRepeats out;
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  int freedom = 0;
  const auto add = [&](const std::vector<Eigen::Vector2d>& all) {
    if (all.size() < 2) return;
    const Repetitions here(all);
    squares += here.squares, freedom += here.n - 1;
    out.motions += here.n, ++out.conditions;
  };
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
  const bool repeated = own != by_condition.end() && own->second.size() > 1;
  if (repeated)
    offset = Repetitions(own->second).mean - Eigen::Vector2d(nominal.landing_x, nominal.landing_theta);
  if (repeated && static_cast<int>(own->second.size()) > kFewest)
    add(own->second);
  else
    for (const auto& [condition, all] : by_condition) add(all);
  if (freedom < kFewest) return {};
  const MatrixXd covariance = squares / freedom, root = root_of(covariance);
  out.x = std::sqrt(covariance(0, 0)), out.theta = std::sqrt(covariance(1, 1));
  out.offset_x = offset[0], out.offset_theta = offset[1];
  int within = 0;
  for (std::size_t i = 0; i < answer.samples.size(); ++i) {
    experiment::RandomStream random(request.seed, i, experiment::Purpose::repetition);
    const VectorXd normal = Eigen::Vector2d(random.normal(), random.normal()), by = root * normal + offset;
    within += std::abs(answer.samples[i].x + by[0]) <= request.tolerance.x &&
              std::abs(answer.samples[i].theta + by[1]) <= request.tolerance.theta;
  }
  out.within = static_cast<double>(within) / request.samples;
  return out;
}

}  // namespace unhand::fitting
