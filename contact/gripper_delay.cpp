#include "contact/gripper_delay.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "contact/contact_model_from.hpp"

namespace unhand::contact {

namespace {

double normal_probability(double x) { return 0.5 * std::erfc(-x * M_SQRT1_2); }

/// The quantile of the truncated normal at probability p, by bisection (its distribution function is
/// monotone).
double truncated_normal_quantile(const DelayDistribution& d, double p) {
  const double low = normal_probability((0 - d.centre) / d.spread);
  const double high = normal_probability((d.longest - d.centre) / d.spread);
  if (!(high > low)) return p * d.longest;  // over so short an interval the normal is flat
  double a = 0, b = d.longest;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (a + b);
    const double reached = (normal_probability((middle - d.centre) / d.spread) - low) / (high - low);
    (reached < p ? a : b) = middle;
  }
  return 0.5 * (a + b);
}

}  // namespace

void validate(const DelayDistribution& d) {
  const auto reject = [](const char* name, double value, const char* range) {
    throw std::invalid_argument(fmt::format("gripper delay: {} = {} is not in {}", name, value, range));
  };
  if (!(d.longest >= 0) || !(d.longest <= 10)) reject("longest", d.longest, "[0, 10] s");
  if (!(d.centre >= 0) || !(d.centre <= d.longest)) reject("centre", d.centre, "[0, longest] s");
  if (d.kind == DelayDistribution::Kind::uniform && d.centre != 0.5 * d.longest)
    reject("centre", d.centre, "{longest/2}, of a uniform delay");
  if (d.kind == DelayDistribution::Kind::truncated_normal && !(d.spread > 0 && d.spread <= 10))
    reject("spread", d.spread, "(0, 10] s");
}

std::vector<double> DelayDistribution::quantiles(int n) const {
  validate(*this);
  if (n < 1) throw std::invalid_argument(fmt::format("gripper delay: {} quantiles are not in [1, inf)", n));
  if (kind == Kind::number) return {centre};
  std::vector<double> out;
  for (int k = 0; k < n; ++k) {
    const double p = (k + 0.5) / n;
    out.push_back(kind == Kind::uniform ? p * longest : truncated_normal_quantile(*this, p));
  }
  return out;
}

double DelayDistribution::mean() const {
  validate(*this);
  if (kind != Kind::truncated_normal) return centre;
  const double a = (0 - centre) / spread, b = (longest - centre) / spread;
  const auto density = [](double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI); };
  const double mass = normal_probability(b) - normal_probability(a);
  if (!(mass > 0)) return 0.5 * longest;  // over so short an interval the normal is flat
  return std::clamp(centre + spread * (density(a) - density(b)) / mass, 0.0, longest);
}

GripperDelay::GripperDelay(double open_command, const Dual& delay)
    : open_command_(open_command), delay_(delay) {
  if (!std::isfinite(open_command))
    throw std::invalid_argument(
        fmt::format("gripper delay: open_command = {} s is not finite", open_command));
  if (!(delay.a >= 0 && delay.a <= 10))
    throw std::invalid_argument(fmt::format("gripper delay: delay = {} is not in [0, 10] s", delay.a));
}

template class ContactModelFrom<GripperDelay>;

}  // namespace unhand::contact
