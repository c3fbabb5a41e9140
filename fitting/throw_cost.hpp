// The costs that Ceres sees. Internal to fitting.
#pragma once

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "dynamics/parallel.hpp"
#include "fitting/simulated_throws.hpp"

namespace unhand::fitting {

/// Whether an unknown stays at the bound that it has reached: its cost (with that slope) falls beyond it.
inline bool is_held(double x, double slope, const Unknown& u, double scale) {
  return (x <= u.low / scale && slope > 0) || (x >= u.high / scale && slope < 0);
}

/// Simulates all throws of one evaluation at once, on several threads, before Ceres asks for them one by one
/// on a single one: its own threads would add up in an order that changes from run to run.
///
/// Unknowns that are held at a bound have no derivatives for this evaluation. Ceres cuts a step at the bounds
/// only after it was computed: the others would move by what is best if the held ones moved, too, which may
/// lead uphill until the trust region has shrunk to nothing.
class AllThrows final : public ceres::EvaluationCallback {
 public:
  AllThrows(const Shared& shared, SimulatedThrows& simulated, const std::vector<std::size_t>& used,
            const std::vector<double>& x, const std::vector<double>& own)
      : shared_(shared), simulated_(simulated), used_(used), x_(x), own_(own) {}

  void PrepareForEvaluation(bool jacobians, bool /*new_point*/) override {
    at_ = simulated_.at(x_, own_, jacobians);
    dynamics::parallel_for(used_.size(), shared_.options.threads, [&](std::size_t i) {
      const CampaignThrow& thrown = shared_.problem.throws()[used_[i]];
      if (at_[i].solved) weigh(at_[i], thrown.observed, thrown, shared_.weighting);
    });
    if (jacobians) hold_campaign();
  }
  const Linearisation& at(std::size_t i) const { return at_[i]; }
  /// Whether unknown k of the campaign is held at a bound.
  bool holds(std::size_t k) const { return held_[k]; }

 private:
  /// From the slopes of the robust cost, in units of the scales.
  void hold_campaign() {
    Eigen::VectorXd slope = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(x_.size()));
    const std::size_t n = shared_.own_sigma.size();
    for (std::size_t i = 0; i < at_.size(); ++i) {
      if (!at_[i].solved) continue;
      double cost = at_[i].residual.squaredNorm();
      for (std::size_t k = 0; k < n; ++k)
        cost += std::pow(own_[i * n + k] * shared_.own_scale[k] / shared_.own_sigma[k], 2);
      slope += std::sqrt(std::min(1.0, shared_.weighting.throw_limit / cost)) * at_[i].campaign.transpose() *
               at_[i].residual;
    }
    held_.resize(x_.size());
    for (std::size_t k = 0; k < x_.size(); ++k) {
      const Unknown& u = shared_.problem.campaign()[k];
      const double scale = shared_.scale[k];
      double all = scale * slope[static_cast<Eigen::Index>(k)];
      if (u.prior_sigma) all += (x_[k] - u.start / scale) * std::pow(scale / *u.prior_sigma, 2);
      held_[k] = is_held(x_[k], all, u, scale);
    }
  }

  const Shared& shared_;
  SimulatedThrows& simulated_;
  const std::vector<std::size_t>& used_;
  const std::vector<double>& x_;
  const std::vector<double>& own_;
  std::vector<Linearisation> at_;
  std::vector<bool> held_;
};

/// One throw's robust, whitened residual with the priors of its own unknowns below it.
class ThrowCost final : public ceres::CostFunction {
 public:
  ThrowCost(const Shared& shared, const AllThrows& all, std::size_t index, std::size_t observations)
      : shared_(shared), all_(all), index_(index) {
    mutable_parameter_block_sizes()->push_back(static_cast<int>(shared.scale.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(shared.own_scale.size()));
    set_num_residuals(static_cast<int>(observations + shared.own_scale.size()));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const auto own = shared_.own_unscaled(parameters[1]);
    const Linearisation& l = all_.at(index_);
    if (!l.solved) return false;
    const auto rows = static_cast<int>(l.residual.size()), width = static_cast<int>(shared_.scale.size()),
               n = static_cast<int>(own.size());
    Eigen::Map<Eigen::VectorXd> r(residuals, rows + n);
    r.head(rows) = l.residual;
    for (int k = 0; k < n; ++k)
      r[rows + k] = own[static_cast<std::size_t>(k)] / shared_.own_sigma[static_cast<std::size_t>(k)];
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    if (jacobians && jacobians[0]) {
      Eigen::Map<RowMajor> J(jacobians[0], rows + n, width);
      J.bottomRows(n).setZero();
      for (int k = 0; k < width; ++k)
        if (all_.holds(static_cast<std::size_t>(k)))
          J.col(k).setZero();
        else
          J.col(k).head(rows) = l.campaign.col(k) * shared_.scale[static_cast<std::size_t>(k)];
    }
    if (jacobians && jacobians[1]) {
      Eigen::Map<RowMajor> J(jacobians[1], rows + n, n);
      J.setZero();
      for (int k = 0; k < n; ++k) {
        const auto i = static_cast<std::size_t>(k);
        J.col(k).head(rows) = l.own.col(k) * shared_.own_scale[i];
        J(rows + k, k) = shared_.own_scale[i] / shared_.own_sigma[i];
        const double slope = J.col(k).dot(r);
        if (is_held(parameters[1][k], slope, shared_.problem.own()[i], shared_.own_scale[i]))
          J.col(k).setZero();
      }
    }
    return true;
  }

 private:
  const Shared& shared_;
  const AllThrows& all_;
  std::size_t index_;
};

/// What is known of a campaign unknown without the log.
class PriorCost final : public ceres::CostFunction {
 public:
  PriorCost(const AllThrows& all, int width, int index, double mean, double sigma)
      : all_(all), width_(width), index_(index), mean_(mean), sigma_(sigma) {
    mutable_parameter_block_sizes()->push_back(width);
    set_num_residuals(1);
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = (parameters[0][index_] - mean_) / sigma_;
    if (jacobians && jacobians[0]) {
      std::fill(jacobians[0], jacobians[0] + width_, 0.0);
      if (!all_.holds(static_cast<std::size_t>(index_))) jacobians[0][index_] = 1 / sigma_;
    }
    return true;
  }

 private:
  const AllThrows& all_;
  int width_, index_;
  double mean_, sigma_;
};

}  // namespace unhand::fitting
