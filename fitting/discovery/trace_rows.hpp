// The samples of a residual as rows of least squares for what is missing. Internal to fitting.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "fitting/discovery/missing_force.hpp"

namespace unhand::fitting {

/// One component of a trace: the samples in which something was seen, in units of their σ, with offset and
/// slope projected out if they are the recording's own. Refers to the trace.
class TraceRows {
 public:
  TraceRows(const ResidualTrace& trace, int component, const MissingOptions& options);
  bool enough() const { return rows_.size() >= 3; }
  const Eigen::VectorXd& seen() const { return seen_; }
  /// Of what was seen, less what was projected out.
  long degrees_of_freedom() const { return static_cast<long>(seen_.size() - own_.cols()); }
  /// What a missing quantity, given at every time of the trace, would do to the residual.
  Eigen::VectorXd response(const std::vector<double>& missing) const;

 private:
  Eigen::VectorXd whitened(const std::vector<double>& series, bool integrate) const;

  const ResidualTrace& trace_;
  Response response_;
  const std::vector<double>& sigma_;
  std::vector<std::size_t> rows_;
  Eigen::MatrixXd own_;
  Eigen::VectorXd seen_;
};

}  // namespace unhand::fitting
