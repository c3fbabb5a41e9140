#include "fitting/discovery/trace_rows.hpp"

#include <cmath>

#include "dynamics/dense_solve.hpp"
#include "dynamics/twice_integrated.hpp"

namespace unhand::fitting {

TraceRows::TraceRows(const ResidualTrace& trace, int component, const MissingOptions& options)
    : trace_(trace), response_(options.response), sigma_(trace.sigma[static_cast<std::size_t>(component)]) {
  const auto& r = trace.residual[static_cast<std::size_t>(component)];
  for (std::size_t k = 0; k < r.size(); ++k)
    if (std::isfinite(r[k])) rows_.push_back(k);
  if (response_ == Response::twice_integrated && enough()) {
    Eigen::MatrixXd line(static_cast<Eigen::Index>(rows_.size()), 2);
    for (std::size_t k = 0; k < rows_.size(); ++k)
      line.row(static_cast<Eigen::Index>(k)) << 1 / sigma_[rows_[k]],
          (trace.time[rows_[k]] - trace.time[rows_.front()]) / sigma_[rows_[k]];
    own_ = dynamics::orthonormal_basis(line);
  }
  seen_ = whitened(r, false);
}

Eigen::VectorXd TraceRows::response(const std::vector<double>& missing) const {
  return whitened(missing, response_ == Response::twice_integrated);
}

Eigen::VectorXd TraceRows::whitened(const std::vector<double>& series, bool integrate) const {
  const std::vector<double> full = integrate ? dynamics::twice_integrated(trace_.time, series) : series;
  Eigen::VectorXd out(static_cast<Eigen::Index>(rows_.size()));
  for (std::size_t k = 0; k < rows_.size(); ++k)
    out[static_cast<Eigen::Index>(k)] = full[rows_[k]] / sigma_[rows_[k]];
  if (own_.size() > 0) out -= own_ * (own_.transpose() * out);
  return out;
}

}  // namespace unhand::fitting
