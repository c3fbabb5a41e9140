#include "contact/normal_force.hpp"

#include <fmt/core.h>

#include <stdexcept>
#include <utility>

namespace unhand::contact {
namespace {

using dynamics::value_of;
using Polynomial = SampledNormalForce::Polynomial;

OpeningProfile<Dual> with_derivatives(const OpeningProfile<double>& q) {
  return {q.open_command, Dual(q.grip_force), Dual(q.dead_time), Dual(q.opening_time), Dual(q.shape)};
}

void check(const OpeningProfile<double>& q) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok || !std::isfinite(value))
      throw std::invalid_argument(fmt::format("OpeningProfile: {} = {} is not in {}", name, value, range));
  };
  require(true, "open_command", q.open_command, "(-inf, inf) s");
  require(q.grip_force > 0.0, "grip_force", q.grip_force, "(0, inf) N");
  require(q.dead_time >= 0.0, "dead_time", q.dead_time, "[0, inf) s");
  require(q.opening_time > 0.0, "opening_time", q.opening_time, "(0, inf) s");
  require(q.shape > 0.0, "shape", q.shape, "(0, inf)");
}

/// f_N of the profile at t, as ProfileNormalForce says.
template <class S>
S opening_profile(const OpeningProfile<S>& q, const Window& window, const S& t) {
  using dynamics::value_of;
  const double start = q.open_command + value_of(q.dead_time), end = start + value_of(q.opening_time);
  // A point well inside the window decides for the branch at its limits.
  const double snap = std::min(1e-9, 0.25 * (window.end - window.begin));
  const double inside = std::min(std::max(value_of(t), window.begin + snap), window.end - snap);
  if (inside <= start) return q.grip_force;
  if (inside >= end) return S(0.0);
  const S rest = 1.0 - (t - q.open_command - q.dead_time) / q.opening_time;
  const double u = std::clamp(value_of(rest), 0.0, 1.0), p = value_of(q.shape), f0 = value_of(q.grip_force);
  const double power = p == 1.0 ? u : std::pow(u, p);
  if constexpr (std::is_same_v<S, double>) {
    return f0 * power;
  } else {
    const double v = std::max(u, 1e-9), slope = p == 1.0 ? 1.0 : p * std::pow(v, p - 1.0);
    return S(f0 * power, power * q.grip_force.v + f0 * slope * rest.v + f0 * power * std::log(v) * q.shape.v);
  }
}

}  // namespace

ProfileNormalForce::ProfileNormalForce(const OpeningProfile<Dual>& profile)
    : profile_(profile),
      values_{profile.open_command, profile.grip_force.a, profile.dead_time.a, profile.opening_time.a,
              profile.shape.a} {
  check(values_);
}

ProfileNormalForce::ProfileNormalForce(const OpeningProfile<double>& profile)
    : ProfileNormalForce(with_derivatives(profile)) {}

double ProfileNormalForce::at(const Window& window, double t) const {
  return opening_profile(values_, window, t);
}
Dual ProfileNormalForce::at(const Window& window, const Dual& t) const {
  return opening_profile(profile_, window, t);
}

void ProfileNormalForce::kinks(std::vector<double>& out) const {
  out.push_back(values_.open_command + values_.dead_time);
  out.push_back(release_time());
}

void ProfileNormalForce::kinks(std::vector<Dual>& out) const {
  out.push_back(profile_.open_command + profile_.dead_time);
  out.push_back(profile_.open_command + profile_.dead_time + profile_.opening_time);
}

double ProfileNormalForce::release_time() const {
  return values_.open_command + values_.dead_time + values_.opening_time;
}

SampledNormalForce::SampledNormalForce(Polynomial force, std::vector<double> kinks, double release)
    : force_(std::move(force)), kinks_(std::move(kinks)), release_(release) {
  for (std::size_t i = 1; i < kinks_.size(); ++i)
    if (!(kinks_[i] > kinks_[i - 1])) throw std::invalid_argument("SampledNormalForce: kinks must increase");
  if (std::isfinite(release_) && (kinks_.empty() || kinks_.back() != release_))
    throw std::invalid_argument(
        fmt::format("SampledNormalForce: the last kink must be the release, {} s", release_));
  for (const auto& piece : force_.pieces())
    for (const auto& coefficient : piece)
      if (!std::isfinite(coefficient[0]))
        throw std::invalid_argument(
            fmt::format("SampledNormalForce: coefficient {} is not finite", coefficient[0]));
}

void SampledNormalForce::kinks(std::vector<double>& out) const {
  out.insert(out.end(), kinks_.begin(), kinks_.end());
}

void SampledNormalForce::kinks(std::vector<Dual>& out) const {
  for (double t : kinks_) out.push_back(Dual(t));
}

}  // namespace unhand::contact
