#include "planners/flip/forecast.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "contact/registry.hpp"
#include "dynamics/dense_solve.hpp"
#include "planners/flip/arm_throw.hpp"

namespace unhand::planners::flip {
namespace {

constexpr int kFitted = 4;  ///< ln mu, ln length, dead time, opening time
using Vector4 = Eigen::Matrix<double, kFitted, 1>;

ReleaseCard moved(const ReleaseCard& prior, const Vector4& p, const Vector4& sigma) {
  ReleaseCard out = prior;
  out.mu.value *= std::exp(p[0] * sigma[0]);
  out.length *= std::exp(p[1] * sigma[1]);
  out.dead_time.value = std::max(0.0, out.dead_time.value + p[2] * sigma[2]);
  out.opening_time.value = std::max(0.01, out.opening_time.value + p[3] * sigma[3]);
  return out;
}

}  // namespace

HandLibrary::HandLibrary(const FlipRobot& robot, const Bar& bar, int per_side)
    : robot_(robot), bar_(bar), per_side_(per_side), spacing_(1.0 / (per_side - 1)) {
  if (per_side < 2 || per_side > 64)
    throw std::invalid_argument(fmt::format("hand library: per_side = {}; accepted: 2 to 64", per_side));
  for (int i = 0; i < per_side; ++i)
    for (int j = 0; j < per_side; ++j)
      for (int k = 0; k < per_side; ++k)
        commands_.push_back(robot.motion.range.at(i * spacing_, j * spacing_, k * spacing_));
  hands_.reserve(commands_.size());
  for (const FlipCommand& u : commands_) hands_.push_back(simulate(u));
}

std::optional<DetachVector> HandLibrary::between(const std::vector<std::optional<DetachVector>>& values,
                                                 const std::array<double, 3>& fractions) const {
  if (values.size() != commands_.size())
    throw std::invalid_argument(fmt::format("hand library: {} values are not one for each of {} commands",
                                            values.size(), commands_.size()));
  std::array<int, 3> cell{};
  std::array<double, 3> part{};
  for (std::size_t k = 0; k < 3; ++k) {
    if (std::isnan(fractions[k]))
      throw std::invalid_argument("hand library: a fraction of the command's range is not finite");
    const double at = std::clamp(fractions[k], 0.0, 1.0) / spacing_;
    cell[k] = std::min(static_cast<int>(at), per_side_ - 2);
    part[k] = at - cell[k];
  }
  DetachVector out{};
  for (int corner = 0; corner < 8; ++corner) {
    std::size_t index = 0;
    double weight = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      const int up = corner >> k & 1;
      index = index * static_cast<std::size_t>(per_side_) + static_cast<std::size_t>(cell[k] + up);
      weight *= up ? part[k] : 1 - part[k];
    }
    if (!values[index]) return {};
    for (std::size_t j = 0; j < 6; ++j) out[j] += weight * (*values[index])[j];
  }
  return out;
}

release::PolynomialHand HandLibrary::simulate(const FlipCommand& u) const {
  const ArmBody body = declared_body(robot_, bar_);
  return ThrowingArm(robot_, body, u, 0).brake().hand;
}

ReleaseCard prior_card(const FlipRobot& robot, const std::string& law) {
  ReleaseCard out;
  const Gripper& g = robot.gripper;
  const RobotSpread& s = robot.robots;
  out.model = law;
  out.mu = {robot.pads.mu, robot.pads.mu * std::hypot(s.mu, s.grip_force)};
  out.length = robot.pads.length;
  out.pads = robot.pads.count;
  if (law == robot.pads.law) out.law_values = robot.pads.law_values;
  out.grip_force = g.grip_force;
  out.dead_time = {g.dead_time, s.dead_time};
  out.opening_time = {g.opening_time, s.opening_time};
  out.shape = g.shape;
  return out;
}

std::optional<FlipRelease> predicted_release(const release::HandMotion& hand, const ReleaseCard& card,
                                             const Bar& bar, double angle) {
  return release_bar(hand, {bar,
                            angle,
                            {card.grip_force, card.dead_time.value, card.opening_time.value, card.shape},
                            {card.model, card.mu.value, card.length, card.pads, card.law_values}});
}

std::vector<std::optional<FlipPose>> declared_landings(const HandLibrary& library) {
  const ReleaseCard card = prior_card(library.robot(), library.robot().pads.law);
  std::vector<std::optional<FlipPose>> out;
  for (std::size_t i = 0; i < library.commands().size(); ++i) {
    const auto release = predicted_release(library.hand(i), card, library.bar());
    out.push_back(release ? fly_flip(release->detach) : std::nullopt);
  }
  return out;
}

double likeness(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  constexpr double reach = 0.6;
  double d = 0;
  for (std::size_t i = 0; i < 3; ++i) d += (a[i] - b[i]) * (a[i] - b[i]);
  return 0.5 + 0.5 * std::exp(-0.5 * d / (reach * reach));
}

namespace {

/// The correlation of all components' discrepancies, six rows per datum.
Eigen::MatrixXd correlations(const CommandRange& range, std::span<const FlipDatum> data) {
  const auto n = static_cast<Eigen::Index>(data.size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(6 * n, 6 * n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b)
      out.block<6, 6>(6 * a, 6 * b)
          .diagonal()
          .setConstant(likeness(range.fractions(data[static_cast<std::size_t>(a)].command),
                                range.fractions(data[static_cast<std::size_t>(b)].command)));
  return out;
}

/// Covariance, degrees of freedom and discrepancy from the Jacobian and the residuals, both with the prior's
/// rows last; parameters in the prior's σ.
void judge(const Eigen::MatrixXd& J, const Eigen::VectorXd& residual, const Eigen::MatrixXd& K,
           ReleaseFit& out) {
  using dynamics::congruent, dynamics::gram, dynamics::product;
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  const Eigen::Index n = K.rows();
  const Eigen::MatrixXd D = J.topRows(n), inverse = dynamics::definite_inverse(gram(J)),
                        from_prior = product(inverse, inverse);
  out.covariance = from_prior;
  out.degrees_of_freedom.fill(kInfinite);
  if (n == 0) return;
  const Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(n, n) - congruent(D, inverse),
                        MK = product(gram(rest), K);
  const double trace = MK.trace();
  if (!(trace > 0)) return;
  const double square = product(MK, MK).trace(), freedom = trace * trace / square,
               s2 = residual.head(n).squaredNorm() / trace;
  out.discrepancy = std::sqrt(s2);
  const Eigen::MatrixXd from_data = s2 * congruent(product(inverse, D.transpose()), K);
  out.covariance += from_data;
  for (int k = 0; k < kFitted; ++k)
    if (from_data(k, k) > 0)
      out.degrees_of_freedom[static_cast<std::size_t>(k)] =
          std::max(1.0, freedom * std::pow(out.covariance(k, k) / from_data(k, k), 2));
}

}  // namespace

ReleaseFit fit_release(const HandLibrary& library, const ReleaseCard& prior,
                       std::span<const FlipDatum> data) {
  const Vector4 sigma{std::max(0.02, prior.mu.sigma / prior.mu.value), 0.15,
                      std::max(1e-3, prior.dead_time.sigma), std::max(1e-3, prior.opening_time.sigma)};
  std::vector<release::PolynomialHand> hands;
  for (const FlipDatum& one : data) hands.push_back(library.simulate(one.command));
  const Eigen::Index rows = 6 * static_cast<Eigen::Index>(data.size()) + kFitted;
  // Residuals in σ: predicted − observed, and the parameters' own.
  const auto residuals = [&](const Vector4& p) -> std::optional<Eigen::VectorXd> {
    const ReleaseCard card = moved(prior, p, sigma);
    Eigen::VectorXd out(rows);
    for (std::size_t i = 0; i < data.size(); ++i) {
      const auto release = predicted_release(hands[i], card, library.bar());
      if (!release) return {};
      for (std::size_t j = 0; j < 6; ++j)
        out[static_cast<Eigen::Index>(6 * i + j)] =
            (release->detach[j] - data[i].detach[j]) / kDiscrepancy[j];
    }
    out.tail<kFitted>() = p;
    return out;
  };
  Vector4 p = Vector4::Zero();
  const auto slopes = [&](const Vector4& at) -> std::optional<Eigen::MatrixXd> {
    Eigen::MatrixXd J(rows, kFitted);
    constexpr double step =
        0.05;  // of a σ: the release's events move smoothly, its integration errors do not
    for (int k = 0; k < kFitted; ++k) {
      Vector4 up = at, down = at;
      up[k] += step;
      down[k] -= step;
      const auto a = residuals(up), b = residuals(down);
      if (!a || !b) return {};
      J.col(k) = (*a - *b) / (2 * step);
    }
    return J;
  };
  ReleaseFit out;
  auto r = residuals(p);
  out.cost_before = out.cost_after = r ? r->squaredNorm() : 0;
  double damping = 1e-3;
  for (; r && out.iterations < 12; ++out.iterations) {
    const auto J = slopes(p);
    if (!J) break;
    const Eigen::MatrixXd information = dynamics::gram(*J);
    const Eigen::VectorXd gradient = dynamics::inner_products(*J, *r);
    double cost = out.cost_after;
    for (int attempt = 0; attempt < 6 && !(cost < out.cost_after); ++attempt) {
      Eigen::MatrixXd A = information;
      A.diagonal().array() += damping;
      const Vector4 tried = (p - dynamics::definite_solve(A, gradient)).cwiseMax(-4.0).cwiseMin(4.0);
      const auto now = residuals(tried);
      if (now && now->squaredNorm() < cost) {
        p = tried;
        r = now;
        cost = now->squaredNorm();
        damping *= 0.3;
      } else {
        damping *= 8;
      }
    }
    const bool enough = cost > (1 - 1e-4) * out.cost_after;
    out.cost_after = cost;
    if (enough) break;
  }
  // Where the release has no slopes at the answer, nothing was learned that could be told.
  const auto J = r ? slopes(p) : std::nullopt;
  if (J)
    judge(*J, *r, correlations(library.robot().motion.range, data), out);
  else
    judge(Eigen::MatrixXd::Identity(kFitted, kFitted), p, Eigen::MatrixXd(0, 0), out);
  out.card = moved(prior, p, sigma);
  const Vector4 unit{out.card.mu.value * sigma[0], out.card.length * sigma[1], sigma[2], sigma[3]};
  out.covariance = (unit.asDiagonal() * out.covariance * unit.asDiagonal()).eval();
  for (int k = 0; k < kFitted; ++k)
    *std::array{&out.card.mu.sigma, &out.card.length_sigma, &out.card.dead_time.sigma,
                &out.card.opening_time.sigma}[static_cast<std::size_t>(k)] = std::sqrt(out.covariance(k, k));
  return out;
}

datasets::ModelCard model_card_of(const ReleaseFit& fit, const HandLibrary& library,
                                  std::span<const FlipDatum> data, const std::string& source) {
  const ReleaseCard& c = fit.card;
  datasets::ModelCard out;
  out.model = c.model;
  auto& covariance = out.covariance.emplace();
  const auto learned = [&](const char* name, double value, double sigma, const char* unit) {
    auto& one = out.parameters[name] = {value, sigma, unit};
    if (const double freedom = fit.degrees_of_freedom[covariance.names.size()]; std::isfinite(freedom))
      one.degrees_of_freedom = freedom;
    covariance.names.emplace_back(name);
  };
  learned("mu", c.mu.value, c.mu.sigma, "-");
  learned("length", c.length, c.length_sigma, "m");
  learned("dead_time", c.dead_time.value, c.dead_time.sigma, "s");
  learned("opening_time", c.opening_time.value, c.opening_time.sigma, "s");
  for (int i = 0; i < kFitted; ++i)
    for (int j = 0; j < kFitted; ++j) covariance.matrix.push_back(fit.covariance(i, j));
  for (const auto& [own, value] : contact::given_law_parameters(c.model, c.law_values))
    out.parameters[own.name] = {value, {}, own.unit};
  out.parameters["pads"] = {static_cast<double>(c.pads), {}, "-"};
  out.parameters["grip_force"] = {c.grip_force, {}, "N"};
  out.parameters["shape"] = {c.shape, {}, "-"};
  const ThrowSpread& spread = library.robot().throws;
  out.own_spreads = {{"mu_deviation", {std::hypot(spread.mu, spread.grip_force), "-"}},
                     {"dead_time_deviation", {std::hypot(spread.dead_time, spread.opening_time), "s"}},
                     {"grasp_offset", {spread.grasp_offset, "m"}},
                     {"grasp_angle", {spread.grasp_angle, "rad"}}};
  const auto tried = [&](const char* name, double value, const char* unit) {
    auto& range = out.valid_range.try_emplace(name, datasets::CardRange{value, value, unit}).first->second;
    range.low = std::min(range.low, value);
    range.high = std::max(range.high, value);
  };
  tried("mass", library.bar().mass, "kg");
  tried("com_offset", library.bar().com_offset, "m");
  for (const FlipDatum& one : data) {
    tried("detach_speed", std::hypot(one.detach[3], one.detach[4]), "m/s");
    tried("detach_omega", one.detach[5], "rad/s");
  }
  out.log.file = source;
  out.log.title = "support throws of a simulated robot";
  return out;
}

}  // namespace unhand::planners::flip
