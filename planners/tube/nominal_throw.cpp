#include "planners/tube/nominal_throw.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "dynamics/parallel.hpp"
#include "flight/fly.hpp"
#include "planners/arm/kinematics.hpp"

namespace unhand::planners {

using Eigen::Vector2d, Eigen::Vector3d;

double TargetBox::half_length(const Vector2d& direction) const {
  const Vector2d d = direction.normalized();
  const auto limit = [](double half, double part) {
    return part != 0 ? half / std::abs(part) : std::numeric_limits<double>::infinity();
  };
  return std::min(limit(length_x / 2, d.x()), limit(length_y / 2, d.y()));
}

namespace {

constexpr double kLowestTip = 0.15;     ///< height [m]
constexpr double kShortestThrow = 0.3;  ///< level distance from the tip to the target [m]
constexpr double kSpeedReserve = 0.02;  ///< of the joints' velocity limits, kept free

/// Points that fill the unit cube evenly, x_k = frac(½ + k α) with α_i = φ⁻ⁱ and φ^(d+1) = φ + 1
/// [Roberts2018].
class EvenPoints {
 public:
  explicit EvenPoints(int dimension) {
    double phi = 2;
    for (int i = 0; i < 40; ++i) phi = std::pow(1 + phi, 1.0 / (dimension + 1));
    double power = 1;
    for (int i = 0; i < dimension; ++i) steps_.push_back(power /= phi);
  }
  double at(int k, int i) const {
    const double x = 0.5 + k * steps_[i];
    return x - std::floor(x);
  }

 private:
  std::vector<double> steps_;
};

class Search {
 public:
  Search(const Chain& chain, const TargetBox& box, const NominalOptions& options)
      : chain_(chain), box_(box), options_(options) {
    for (const auto& fixed : options.fixed) held_[fixed.joint] = true;
  }

  /// The best throw from a configuration, if there is one.
  std::optional<NominalThrow> best_at(const JointVector<double>& q) const {
    const auto frames = frames_of(chain_, q);
    const Vector3d p = frames.tip.p, e = box_.middle - p;
    const double distance = e.head<2>().norm();
    if (p.z() < kLowestTip || p.head<2>().norm() < kColumn || distance < kShortestThrow) return {};
    const TipJacobian J = jacobian(chain_, frames).topRows<3>();
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();  // J W Jᵀ
    for (int i = 0; i < chain_.size(); ++i)
      if (!held_[i]) A += weight(i) * J.col(i) * J.col(i).transpose();
    A += 1e-9 * A.trace() * Eigen::Matrix3d::Identity();  // a planar arm moves in its plane only
    const Eigen::Matrix3d inverse = A.inverse();
    const Vector2d along = e.head<2>() / distance;
    const double height = p.z() - box_.middle.z();
    std::optional<NominalThrow> best;
    for (double degrees = 5; degrees < 70; degrees += 7.5) {
      const double elevation = degrees * std::numbers::pi / 180, beaten = best ? best->margin : 0;
      auto speed = least_speed(distance, height, elevation);
      if (!speed) continue;
      const auto swing_at = [&](double fast) {
        Vector3d v;
        v << fast * std::cos(elevation) * along, fast * std::sin(elevation);
        return swing(q, J, inverse, v, beaten);
      };
      auto swung = swing_at(*speed);
      if (!swung) continue;  // the faster, the less room
      if (options_.medium.drag_k > 0) {
        const double most = *speed * (1 - kSpeedReserve - beaten) / (1 - kSpeedReserve - swung->speed_margin);
        speed = speed_with_drag(distance, height, elevation, *speed, most);
        if (!speed || !(swung = swing_at(*speed))) continue;
      }
      flight::LandingSet landing = options_.landing;
      landing.half_length = box_.half_length(along);
      const double level = flight::tube_level({-distance, -e.z(), *speed * std::cos(elevation), swung->v.z()},
                                              landing, options_.medium);
      const double margin = std::min({swung->speed_margin, swung->position_margin, -level});
      if (!(margin > beaten)) continue;
      if (!options_.clear_column || !through_column(frames, along, swung->v))
        best = NominalThrow{{q, swung->qd}, margin, swung->speed_margin, swung->position_margin, -level};
    }
    return best;
  }

 private:
  using TipJacobian = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxJoints>;

  /// What a velocity of the tip asks of the joints.
  struct Swing {
    Vector3d v;
    JointVector<double> qd;
    double speed_margin, position_margin;
  };
  /// Nothing where the joints cannot, or with no more margin than what is `beaten` by then.
  std::optional<Swing> swing(const JointVector<double>& q, const TipJacobian& J,
                             const Eigen::Matrix3d& inverse, const Vector3d& v, double beaten) const {
    const Vector3d scaled = inverse * v;
    Swing out{v, JointVector<double>::Zero(chain_.size()), 0, 0};
    double use = 0;
    for (int i = 0; i < chain_.size(); ++i)
      if (!held_[i]) {
        out.qd[i] = weight(i) * J.col(i).dot(scaled);
        use = std::max(use, std::abs(out.qd[i]) / chain_.joints[i].limits.velocity);
      }
    out.speed_margin = 1 - kSpeedReserve - use;
    if (!(out.speed_margin > beaten)) return {};
    out.position_margin = room(q, out.qd);
    if (!(out.position_margin > beaten) || (J * out.qd - v).norm() > 1e-6) return {};
    return out;
  }

  double weight(int i) const {
    const double most = chain_.joints[i].limits.velocity;
    return most * most;
  }

  /// Whether a throw from these frames flies through the arm's column.
  bool through_column(const ChainFrames<double>& frames, const Vector2d& along, const Vector3d& v) const {
    const Vector3d& p = frames.tip.p;
    const double distance = along.dot(box_.middle.head<2>() - p.head<2>()),
                 nearest = std::clamp(-along.dot(p.head<2>()), 0.0, distance);
    const auto inside = [&](const Vector2d& at) { return at.norm() < kColumn; };
    if (!inside(p.head<2>() + nearest * along)) return false;
    double top = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < chain_.size(); ++i)
      if (inside(frames.links[i].p.head<2>())) top = std::max(top, frames.links[i].p.z());
    flight::FlightProblem<double> flight;
    flight.pose = {0, p.z(), 0};
    flight.twist = {v.head<2>().norm(), v.z(), 0};
    flight.gravity = {0, -options_.medium.gravity};
    flight.drag_k = options_.medium.drag_k;
    flight.landing_height = box_.middle.z();
    const auto flown = flight::fly(flight);
    if (flown.outcome != flight::FlightOutcome::landed) return true;  // nothing says that it is clear
    const double duration = flown.landing.flight_time;
    std::vector<double> times;
    for (int k = 0; k <= 60; ++k) times.push_back(duration * k / 60);
    const auto path = flight::fly_through(flight, times);
    return std::any_of(path.begin(), path.end(), [&](const dynamics::Pose<double>& at) {
      return at.z < top && inside(p.head<2>() + at.x * along);
    });
  }

  /// The speed that lands `distance` ahead and `height` below; with drag, one that lands shorter. There, of
  /// the level speed u = v cos ε e^(−k s) no more is left than at the path's length s = x. So it falls
  ///   x tan ε + h = g ∫₀ˣ (x − ξ)/u(ξ)² dξ  >=  g/(v cos ε)² (e^(2 k x) − 1 − 2 k x)/(4 k²).
  std::optional<double> least_speed(double distance, double height, double elevation) const {
    const double c = std::cos(elevation), s = std::sin(elevation), fall = distance * s / c + height;
    if (!(fall > 0)) return {};
    const double speed = distance / c * std::sqrt(options_.medium.gravity / (2 * fall)),
                 x = 2 * options_.medium.drag_k * distance;
    if (x < 1e-3) return speed;  // the rest is rounding
    return speed * std::sqrt(2 * (std::expm1(x) - x)) / x;
  }

  /// The speed in [least, most] with drag: Newton's steps, halvings of what is left where they leave it.
  std::optional<double> speed_with_drag(double distance, double height, double elevation, double least,
                                        double most) const {
    const double c = std::cos(elevation), s = std::sin(elevation);
    const auto landing = [&](double speed) {
      return flight::landing_of<double>({-distance, height, speed * c, speed * s}, options_.medium);
    };
    if (!std::isfinite(most)) return {};
    if (const auto fastest = landing(most); !fastest || fastest->r < 0) return {};
    double speed = least;
    for (int i = 0; i < 40; ++i) {
      double next = 0;
      if (const auto flow = flight::flow_map({-distance, height, speed * c, speed * s}, options_.medium)) {
        (flow->landing < 0 ? least : most) = speed;
        next = speed - flow->landing / (flow->gradient[2] * c + flow->gradient[3] * s);
        if (std::abs(next - speed) < 1e-10 * speed) return next;
      } else {
        least = speed;  // it does not rise to the box
      }
      speed = next > least && next < most ? next : 0.5 * (least + most);
    }
    return {};
  }

  /// Room to the position limits, over half the range: speeding up and braking take v D/2 each, with D the
  /// time that the slowest joint needs, and the window v T.
  double room(const JointVector<double>& q, const JointVector<double>& qd) const {
    double duration = 0;
    for (int i = 0; i < chain_.size(); ++i)
      duration = std::max(duration, std::abs(qd[i]) / chain_.joints[i].limits.acceleration);
    duration = 1.1 * duration + 0.005;
    double least = 1;
    for (int i = 0; i < chain_.size(); ++i) {
      const auto& [lower, upper, velocity, acceleration, jerk, torque] = chain_.joints[i].limits;
      if (!std::isfinite(upper - lower)) continue;
      for (const double at :
           {q[i] - 0.5 * duration * qd[i], q[i] + (options_.window + 0.5 * duration) * qd[i]})
        least = std::min(least, std::min(at - lower, upper - at) / (0.5 * (upper - lower)));
    }
    return least;
  }

  const Chain& chain_;
  const TargetBox& box_;
  const NominalOptions& options_;
  std::array<bool, kMaxJoints> held_{};
};

double within(const JointLimits& l, double x) { return std::clamp(x, l.lower, l.upper); }

void check(const Chain& chain, const TargetBox& box, const NominalOptions& options) {
  validate(chain);
  if (!(box.length_x > 0 && box.length_y > 0 && box.middle.allFinite()))
    throw std::invalid_argument("target box: its middle must be finite and its lengths > 0 m");
  for (const Joint& joint : chain.joints)
    if (!std::isfinite(joint.limits.velocity) || !std::isfinite(joint.limits.acceleration) ||
        !std::isfinite(joint.limits.jerk))
      throw std::invalid_argument("chain '" + chain.name + "': joint '" + joint.name +
                                  "' needs limits of velocity, acceleration and jerk to plan a throw");
  validate(options, chain);
}

}  // namespace

std::vector<NominalThrow> find_throws(const Chain& chain, const TargetBox& box,
                                      const NominalOptions& options) {
  check(chain, box, options);
  const int n = chain.size();
  const Search search(chain, box, options);
  const auto hold = [&](JointVector<double>& q) {
    for (const auto& fixed : options.fixed) q[fixed.joint] = fixed.angle;
  };
  const EvenPoints points(n);
  std::vector<std::optional<NominalThrow>> at(static_cast<std::size_t>(options.samples));
  dynamics::parallel_for(at.size(), options.threads, [&](std::size_t k) {
    JointVector<double> q(n);
    for (int i = 0; i < n; ++i) {
      const JointLimits& l = chain.joints[i].limits;
      const double lower = std::max(l.lower, -std::numbers::pi), upper = std::min(l.upper, std::numbers::pi);
      q[i] = lower + (0.05 + 0.9 * points.at(static_cast<int>(k), i)) * (upper - lower);
    }
    hold(q);
    at[k] = search.best_at(q);
  });
  std::vector<NominalThrow> found;
  for (auto& one : at)
    if (one) found.push_back(std::move(*one));
  const auto better = [](const NominalThrow& a, const NominalThrow& b) { return a.margin > b.margin; };
  const auto kept = std::min(found.size(), static_cast<std::size_t>(options.candidates));
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), found.end(), better);
  found.resize(kept);
  const auto refined = std::min(found.size(), static_cast<std::size_t>(options.refined));
  dynamics::parallel_for(refined, options.threads, [&](std::size_t j) {
    double size = 0.15;  // rad, halved where it does not help
    for (int k = 0; k < 60; ++k) {
      JointVector<double> q = found[j].state.q;
      for (int i = 0; i < n; ++i)
        q[i] = within(chain.joints[i].limits, q[i] + size * (2 * points.at(k + 7, i) - 1));
      hold(q);
      const auto one = search.best_at(q);
      if (one && one->margin > found[j].margin)
        found[j] = *one;
      else if (k % 6 == 5)
        size *= 0.7;
    }
  });
  std::sort(found.begin(), found.end(), better);
  return found;
}

}  // namespace unhand::planners
