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
                                             const Bar& bar) {
  return release_bar(hand, {bar,
                            0.0,
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
  ReleaseFit out{prior, 0.15 * prior.length, 0, 0, 0};
  auto r = residuals(p);
  if (!r) return out;
  out.cost_before = out.cost_after = r->squaredNorm();
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(kFitted, kFitted);
  double damping = 1e-3;
  for (; out.iterations < 12; ++out.iterations) {
    Eigen::MatrixXd J(rows, kFitted);
    constexpr double step =
        0.05;  // of a σ: the release's events move smoothly, its integration errors do not
    bool solved = true;
    for (int k = 0; k < kFitted && solved; ++k) {
      Vector4 up = p, down = p;
      up[k] += step;
      down[k] -= step;
      const auto a = residuals(up), b = residuals(down);
      solved = a && b;
      if (solved) J.col(k) = (*a - *b) / (2 * step);
    }
    if (!solved) break;
    information = dynamics::gram(J);
    const Eigen::VectorXd gradient = dynamics::inner_products(J, *r);
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
  out.card = moved(prior, p, sigma);
  const Eigen::MatrixXd covariance = dynamics::definite_inverse(information);
  out.card.mu.sigma = out.card.mu.value * sigma[0] * std::sqrt(covariance(0, 0));
  out.length_sigma = out.card.length * sigma[1] * std::sqrt(covariance(1, 1));
  out.card.dead_time.sigma = sigma[2] * std::sqrt(covariance(2, 2));
  out.card.opening_time.sigma = sigma[3] * std::sqrt(covariance(3, 3));
  return out;
}

datasets::ModelCard model_card_of(const ReleaseFit& fit, const std::string& source) {
  const ReleaseCard& c = fit.card;
  datasets::ModelCard out;
  out.model = c.model;
  out.parameters["mu"] = {c.mu.value, c.mu.sigma, "-"};
  out.parameters["length"] = {c.length, fit.length_sigma, "m"};
  for (const auto& [own, value] : contact::given_law_parameters(c.model, c.law_values))
    out.parameters[own.name] = {value, {}, own.unit};
  out.parameters["pads"] = {static_cast<double>(c.pads), {}, "-"};
  out.parameters["grip_force"] = {c.grip_force, {}, "N"};
  out.parameters["dead_time"] = {c.dead_time.value, c.dead_time.sigma, "s"};
  out.parameters["opening_time"] = {c.opening_time.value, c.opening_time.sigma, "s"};
  out.parameters["shape"] = {c.shape, {}, "-"};
  out.log.file = source;
  out.log.title = "support throws of a simulated robot";
  return out;
}

}  // namespace unhand::planners::flip
