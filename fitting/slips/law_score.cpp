#include "fitting/slips/law_score.hpp"

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "fitting/distributions.hpp"

namespace unhand::fitting {

double Paired::p() const { return n > 2 && mean() > 0 ? 0.5 * f_tail(t() * t(), 1, n - 1) : 1; }

namespace {

/// Mean held-out error of every slip [deg].
std::map<int, double> by_slip(const SlipSamples& slips, const std::vector<double>& errors) {
  std::map<int, std::pair<double, double>> sums;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    auto& [sum, n] = sums[slips.samples[i].slip];
    sum += errors[i], n += 1;
  }
  std::map<int, double> out;
  for (const auto& [slip, s] : sums) out[slip] = s.first / s.second;
  return out;
}

/// Do pushes that know nothing of each other err the same way where their wrenches are alike? Every sample
/// against the one of another slip whose direction of wrench is nearest. Pairs of slips are the observations:
/// of errors that know nothing of each other, the products in different pairs do not correlate.
Paired left_by(const SlipSamples& slips, const SlipSurface& surface, double& correlation) {
  const std::size_t n = slips.samples.size();
  std::vector<Eigen::Vector3d> residual(n), at(n);
  double squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const auto& s = slips.samples[i];
    const auto normal = surface.normal(s.wrench);
    residual[i] =
        Eigen::Vector3d(s.direction[0] - normal[0], s.direction[1] - normal[1], s.direction[2] - normal[2]);
    at[i] = Eigen::Vector3d(s.wrench[0], s.wrench[1], s.wrench[2]).normalized();
    squares += residual[i].squaredNorm() / static_cast<double>(n);
  }
  std::map<std::pair<int, int>, double> sums;
  double count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    double nearest = -2;
    std::size_t other = i;
    for (std::size_t j = 0; j < n; ++j)
      if (slips.samples[j].slip != slips.samples[i].slip && at[i].dot(at[j]) > nearest)
        nearest = at[i].dot(at[j]), other = j;
    if (other == i) continue;
    sums[std::minmax({slips.samples[i].slip, slips.samples[other].slip})] +=
        residual[i].dot(residual[other]) / squares;
    count += 1;
  }
  Paired out;  // whose mean is the mean over samples
  for (const auto& [pair, sum] : sums) out.add(sum * static_cast<double>(sums.size()) / count);
  correlation = out.mean();
  return out;
}

/// Over the samples; 0 without any.
double mean_of(const SlipSamples& slips, const auto& error_of) {
  double out = 0;
  for (const SlipSample& s : slips.samples) out += error_of(s);
  return slips.samples.empty() ? 0 : out / static_cast<double>(slips.samples.size());
}

}  // namespace

SurfaceEvidence LawScore::add(const SlipSamples& slips, const SurfaceScore& base, const SurfaceScore& score) {
  const auto of_base = by_slip(slips, base.errors_deg);
  Paired own;
  for (const auto& [slip, by_law] : by_slip(slips, score.errors_deg)) {
    own.add(of_base.at(slip) - by_law);
    gain.add(of_base.at(slip) - by_law);
  }
  SurfaceEvidence e;
  e.surface = slips.surface, e.law = model, e.slips = static_cast<int>(of_base.size());
  e.base_deg = base.mean_deg, e.law_deg = score.mean_deg;
  e.null_base_deg = base.null_control_deg, e.null_law_deg = score.null_control_deg;
  e.gain_deg = own.mean(), e.gain_sigma = own.error();
  const Paired left_here = left_by(slips, score.fit.surface, e.left);
  e.left_sigma = left_here.error();
  left.add(left_here);
  better += score.mean_deg < base.mean_deg ? 1 : 0, ++compared;
  error += score.mean_deg, base_error += base.mean_deg;
  null_gain += base.null_control_deg - score.null_control_deg;
  const SlipSurface& surface = score.fit.surface;
  train +=
      mean_of(slips, [&](const SlipSample& s) { return kDegreesPerRadian * direction_error(surface, s); });
  level += mean_of(slips, [&](const SlipSample& s) { return std::abs(surface.gauge(s.wrench) - 1); });
  return e;
}

}  // namespace unhand::fitting
