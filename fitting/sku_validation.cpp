#include "fitting/sku_validation.hpp"

#include <fmt/core.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "experiment/outcome_slopes.hpp"
#include "experiment/parallel.hpp"
#include "experiment/random_stream.hpp"
#include "experiment/reference_throw.hpp"
#include "fitting/card.hpp"
#include "fitting/sku_measured.hpp"

namespace unhand::fitting {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using experiment::kDegrees;
using Index = Eigen::Index;
using Prediction = experiment::ThrowPrediction<double>;

namespace {

/// A motion with the object in the hand, and what is uncertain about it.
struct Motion {
  experiment::PreparedThrow prepared;
  ThrowInputs inputs;

  Prediction predict(const std::vector<double>& values) const {
    return experiment::predict_channels(prepared, {}, inputs.model,
                                        dynamics::Values<double>(inputs.names, values));
  }
  bool held(const std::vector<double>& values) const {
    return experiment::grip_holds(prepared, inputs.model, dynamics::Values<double>(inputs.names, values));
  }
  /// ∂(landing x, θ)/∂(inputs).
  std::optional<MatrixXd> slopes() const {
    const auto all = experiment::outcome_slopes(prepared, inputs.model, inputs.names, inputs.values);
    if (!all) return {};
    MatrixXd landing(2, all->cols());
    landing << all->row(experiment::kLandingX), all->row(experiment::kLandingTheta);
    return landing * inputs.mixing();
  }
};

void require(const SkuRequest& request) {
  const auto check = [](bool ok, const char* name, double value, const char* range) {
    if (!ok)
      throw std::invalid_argument(fmt::format("validate_sku: {} = {} is not in {}", name, value, range));
  };
  check(request.tolerance.x > 0 && request.tolerance.x <= 100, "tolerance x", request.tolerance.x,
        "(0, 100] m");
  check(request.tolerance.theta > 0 && request.tolerance.theta <= 1000, "tolerance theta",
        request.tolerance.theta, "(0, 1000] rad");
  check(request.confidence > 0 && request.confidence < 1, "confidence", request.confidence, "(0, 1)");
  check(request.samples >= 100 && request.samples <= 1'000'000, "samples", request.samples, "[100, 1000000]");
}

/// A plain card's scatter of the delay, as fitted cards have it.
datasets::ModelCard with_spread(datasets::ModelCard card) {
  if (const auto found = card.parameters.find("delay_sigma"); found != card.parameters.end()) {
    card.own_spreads["delay_deviation"] = {found->second.value, "s"};
    card.parameters.erase(found);
  }
  return card;
}

std::vector<Motion> motions(const datasets::Sku& sku, const datasets::ModelCard& card,
                            const std::string& file, const SkuRequest& request) {
  const auto object = datasets::to_object(sku);
  std::vector<Motion> out;
  const auto add = [&](experiment::PreparedThrow prepared) {
    prepared.object = sku.name;
    auto inputs = throw_inputs(sku, card, file, prepared, request.assumed);
    out.push_back({std::move(prepared), std::move(inputs)});
  };
  if (request.log == nullptr) {
    add(experiment::reference_throw(sku.name, object));
    return out;
  }
  std::vector<std::string> seen;
  for (const auto& one : request.log->throws) {
    if (request.condition && one.condition != *request.condition) continue;
    if (std::find(seen.begin(), seen.end(), one.condition) != seen.end()) continue;
    seen.push_back(one.condition);
    add(experiment::with_object(*request.log, one, request.log_file, object));
  }
  if (out.empty())
    throw std::invalid_argument(
        request.condition
            ? fmt::format("validate_sku: {} has no condition '{}'", request.log_file, *request.condition)
            : fmt::format("validate_sku: {} holds no throws", request.log_file));
  return out;
}

ThrowCandidate candidate_of(const Motion& motion) {
  ThrowCandidate out;
  out.condition = motion.prepared.condition;
  const auto nominal = motion.predict(motion.inputs.values);
  out.held = motion.held(motion.inputs.values);
  out.landed = nominal.landed();
  if (!out.landed) return out;
  out.landing_x = nominal.landing.pose.x;
  out.landing_theta = nominal.landing.pose.theta;
  const auto J = motion.slopes();
  out.landed = J.has_value();
  if (!J) return out;
  const MatrixXd C = *J * motion.inputs.covariance * J->transpose();
  out.linear = {std::sqrt(C(0, 0)), std::sqrt(C(1, 1)), 0, 0};
  return out;
}

double scaled(const LandingSpread& s, const LandingTolerance& tolerance) {
  return std::hypot(s.x / tolerance.x, s.theta / tolerance.theta);
}

/// The one that is held, lands, and scatters least.
std::size_t best(const std::vector<ThrowCandidate>& candidates, const LandingTolerance& tolerance) {
  std::size_t out = 0;
  const auto rank = [&](const ThrowCandidate& c) {
    return c.held && c.landed ? scaled(c.linear, tolerance) : c.landed ? 1e6 : 2e6;
  };
  for (std::size_t i = 1; i < candidates.size(); ++i)
    if (rank(candidates[i]) < rank(candidates[out])) out = i;
  return out;
}

/// The least grip force of a profile that holds the object; nothing if a thousand newton do not.
std::optional<double> needed_grip(const Motion& motion) {
  const auto at = std::find(motion.inputs.names.begin(), motion.inputs.names.end(), "grip_force");
  if (at == motion.inputs.names.end() || motion.prepared.normal_force) return {};
  auto values = motion.inputs.values;
  double& force = values[static_cast<std::size_t>(at - motion.inputs.names.begin())];
  double low = force, high = 1000;
  force = high;
  if (!motion.held(values)) return {};
  while (high - low > 1e-3 * high) {
    force = 0.5 * (low + high);
    (motion.held(values) ? high : low) = force;
  }
  return high;
}

/// The part of a share of variance: of outcome y, divided by the tolerance's square.
struct Scaled {
  MatrixXd J, CJ;  // per tolerance
  double whole;
  Scaled(const MatrixXd& slopes, const MatrixXd& C, const LandingTolerance& tolerance)
      : J(Eigen::Vector2d(1 / tolerance.x, 1 / tolerance.theta).asDiagonal() * slopes),
        CJ(C * J.transpose()),
        whole((J * CJ).trace()) {}
};

std::vector<BudgetLine> budget_of(const Motion& motion, const MatrixXd& J,
                                  const LandingTolerance& tolerance) {
  const auto& inputs = motion.inputs;
  const Scaled s(J, inputs.covariance, tolerance);
  const auto nominal = motion.predict(inputs.values).landing.pose;
  const MatrixXd C = J * inputs.covariance * J.transpose();
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
    const double off = (rows.transpose() * own.ldlt().solve(rows)).trace();
    gain.share = s.whole > 0 ? off / s.whole : 0;
    out.push_back(std::move(gain));
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.share > b.share; });
  return out;
}

/// A matrix R with R Rᵀ = C, for C positive semidefinite.
MatrixXd root_of(const MatrixXd& C) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(C);
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

struct Draw {
  bool landed{}, within{}, linear_within{};
  LandingSample sample;
};

Draw draw(const Motion& motion, const ThrowCandidate& nominal, const MatrixXd& J, const MatrixXd& root,
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
      const auto values = motion.inputs.moved(by);
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

void monte_carlo(const Motion& motion, const MatrixXd& J, const SkuRequest& request, SkuValidation& out) {
  const MatrixXd root = root_of(motion.inputs.covariance);
  std::vector<Draw> draws(static_cast<std::size_t>(request.samples));
  experiment::parallel_for(draws.size(), request.threads, [&](std::size_t i) {
    draws[i] = draw(motion, out.reference(), J, root, request, i);
  });
  const auto n = static_cast<double>(draws.size());
  for (const Draw& d : draws) {
    out.within += d.within / n;
    out.within_linear += d.linear_within / n;
    out.lost += !d.landed / n;
    if (d.landed) out.samples.push_back(d.sample);
  }
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
  out.agree = same(x, sx, lx, slx) && same(theta, stheta, ltheta, sltheta) && out.lost == 0;
  if (out.agree) return;
  const auto worst = std::max_element(out.budget.begin(), out.budget.end(),
                                      [](const auto& a, const auto& b) { return a.curvature < b.curvature; });
  out.disagreement = fmt::format(
      "Monte Carlo and derivatives differ by more than {:.0f} % of sigma: the landing is not linear in {} "
      "over its "
      "spread; believe the Monte Carlo",
      100 * kAgree, worst == out.budget.end() ? "its inputs" : worst->input.name);
}

void decide(const SkuRequest& request, SkuValidation& out) {
  const ThrowCandidate& c = out.reference();
  if (!c.landed) {
    out.verdict = SkuVerdict::does_not_land;
    out.message = "no motion that was tried brings this object to a landing";
  } else if (!c.held) {
    out.verdict = SkuVerdict::cannot_be_held;
    out.message = "the grip lets the object slip before the gripper opens";
    if (out.needed_grip_force)
      out.message += fmt::format(": this motion needs at least {:.3g} N per pad", *out.needed_grip_force);
  } else {
    const bool enough = out.within >= request.confidence;
    out.verdict = enough ? SkuVerdict::throwable : SkuVerdict::too_uncertain;
    out.message = fmt::format(
        "{:.1f} % of its landings lie within {:.3g} m and {:.3g} deg of the predicted one; "
        "asked for are {:.3g} %",
        100 * out.within, request.tolerance.x, request.tolerance.theta * kDegrees, 100 * request.confidence);
  }
}

}  // namespace

const char* to_string(SkuVerdict verdict) {
  switch (verdict) {
    case SkuVerdict::throwable:
      return "throwable";
    case SkuVerdict::too_uncertain:
      return "too_uncertain";
    case SkuVerdict::cannot_be_held:
      return "cannot_be_held";
    case SkuVerdict::does_not_land:
      return "does_not_land";
  }
  return "?";
}

SkuValidation validate_sku(const datasets::Sku& sku, const datasets::ModelCard& given,
                           const std::string& card_file, const SkuRequest& request) {
  require(request);
  if (!sku.inertia)
    throw std::invalid_argument("validate_sku: " + sku.name +
                                " has no inertia: inertia_kg_m2, or shape and dims_m, are needed");
  const auto card = with_spread(given);
  const auto tried = motions(sku, card, card_file, request);
  SkuValidation out;
  for (const Motion& motion : tried) out.candidates.push_back(candidate_of(motion));
  out.chosen = best(out.candidates, request.tolerance);
  const Motion& motion = tried[out.chosen];
  out.notes = motion.inputs.notes;
  for (const auto& why : outside_range(card, motion.prepared))
    out.notes.push_back("outside the card's valid range: " + why);
  out.linear = out.reference().linear;
  if (out.reference().landed && !out.reference().held) out.needed_grip_force = needed_grip(motion);
  if (out.reference().landed && out.reference().held) {
    const MatrixXd J = *motion.slopes();
    out.budget = budget_of(motion, J, request.tolerance);
    out.gains = gains_of(motion.inputs, J, request.tolerance);
    monte_carlo(motion, J, request, out);
  }
  decide(request, out);
  if (request.log != nullptr) out.measured = measured_verdict(sku, card, card_file, request);
  return out;
}

}  // namespace unhand::fitting
