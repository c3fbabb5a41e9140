#include "experiment/doubtful_force.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace unhand::experiment {

using dynamics::convert;
using dynamics::Dual;
using dynamics::value_of;
using dynamics::Window;

namespace {
constexpr double kWide = 20;   // σ of the release that the ramp is long: below, deviations saturate
constexpr double kMost = 0.2;  // of the ramp's length, in saturation
}  // namespace

bool DoubtfulForce::applies_to(const contact::NormalForceSummary& ramp) {
  return std::isfinite(ramp.ramp_start) && std::isfinite(ramp.release_time) &&
         std::isfinite(ramp.release_sigma) && std::isfinite(ramp.shape) &&
         ramp.release_time > ramp.ramp_start;
}

DoubtfulForce::DoubtfulForce(const contact::NormalForce& base, const contact::NormalForceSummary& ramp,
                             const Dual& deviation)
    : base_(base), start_(ramp.ramp_start), release_(ramp.release_time) {
  const double length = release_ - start_, most = kMost * length;
  Dual by = deviation * ramp.release_sigma;
  if (kWide * ramp.release_sigma > length) by = most * tanh(by / most);
  if (!(std::abs(by.a) < 0.5 * length))
    throw std::invalid_argument(
        fmt::format("force_deviation = {}: moves the release by {} s, must be below half the ramp, {} s",
                    deviation.a, by.a, 0.5 * length));
  const double twice = 2 * std::max(ramp.shape, 0.5), follow = (twice + 1) / twice;
  new_start_ = start_ + by / (twice * twice);
  new_release_ = release_ + by;
  power_ = by * (ramp.shape / length * follow * follow);
}

template <class S>
S DoubtfulForce::to_base(const S& t) const {
  const S start = convert<S>(new_start_), release = convert<S>(new_release_);
  if (value_of(t) <= value_of(start)) return t + (start_ - start);
  if (value_of(t) >= value_of(release)) return t + (release_ - release);
  return start_ + (t - start) * ((release_ - start_) / (release - start));
}

template <class S>
S DoubtfulForce::from_base(double t) const {
  const S start = convert<S>(new_start_), release = convert<S>(new_release_);
  if (t <= start_) return t + (start - start_);
  if (t >= release_) return t + (release - release_);
  return start + (t - start_) * ((release - start) / (release_ - start_));
}

template <class S>
S DoubtfulForce::at_(const Window& window, const S& t) const {
  const S there = to_base(t);
  const Window seen{to_base(window.begin), to_base(window.end)};
  const S force = base_.at(seen, there);
  constexpr double kEnd = 1e-9;  // nearer to the release the force is nothing
  const double share = (release_ - value_of(there)) / (release_ - start_);
  if (!(share > kEnd && share < 1) || value_of(force) <= 0) return force;
  const S u = (release_ - there) / (release_ - start_);
  using std::exp;
  using std::log;
  return force * exp(convert<S>(power_) * log(u));
}

template <class S>
void DoubtfulForce::kinks_(std::vector<S>& out) const {
  std::vector<double> of_base;
  base_.kinks(of_base);
  for (const double t : of_base) out.push_back(from_base<S>(t));
}

double DoubtfulForce::release_time() const { return from_base<double>(base_.release_time()); }

template double DoubtfulForce::at_(const Window&, const double&) const;
template Dual DoubtfulForce::at_(const Window&, const Dual&) const;
template void DoubtfulForce::kinks_(std::vector<double>&) const;
template void DoubtfulForce::kinks_(std::vector<Dual>&) const;

}  // namespace unhand::experiment
