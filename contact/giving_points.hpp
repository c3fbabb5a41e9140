// Pads that give at every point of a round patch before that point slips.
#pragma once

#include <Eigen/Core>
#include <array>
#include <type_traits>
#include <vector>

#include "contact/friction_limits.hpp"
#include "contact/limit_surface_shapes.hpp"

namespace unhand::contact {

/// Points of the unit disc with the share of its area that each stands for, Σ area = 1: rings at the Radau
/// nodes of ∫ · 2ρ dρ, so that force, torque and torsional stiffness (∫ 1, ρ, ρ² over the disc) are exact.
struct DiscPoints {
  std::vector<double> x, z, area;  ///< [-]
};
/// `counts` points on each ring, from the centre outwards.
DiscPoints disc_quadrature(const std::vector<int>& counts);

/// How far the pads are stretched under each point [m], in the hand's frame, with derivatives where S is
/// Dual.
template <class S>
struct Stretch {
  /// With respect to each of a Dual's parameters.
  using Gradient = std::array<double, dynamics::kDualSize>;
  std::vector<double> x, z;      ///< m, by point
  std::vector<Gradient> dx, dz;  ///< empty where S is double
};

/// A patch of points i, at a p_i in the hand's frame, with the share w_i of the area and λ_i w_i of the load.
/// Between pad and object each has a spring with a slider and a damper,
///
///   s_i' = v_i = v_r + ω_r J a p_i while |s_i| < δ λ_i, no further than that otherwise,
///   f_i = −k w_i (s_i + T v_i), no more than n μ f_N w_i λ_i;   δ = n μ f_N/k
///
/// k = 1/compliance [N/m], T the loss time [s], a and μ as of FrictionLimits (the patch may shrink, and μ may
/// depend on |v_i|, the point's own speed, as it is known before a step): the elasto-plastic friction of
/// [DupontHaywardArmstrongAltpeter2002] at every point, with Coulomb's limit on the whole of a point's force.
/// The outer points slip before the inner ones; what creeps before the patch slips as a whole is theirs. As k
/// grows, the sum tends to the limit surface of the disc; its torque limit is that of FrictionLimits exactly.
///
/// Nothing here is a mode or an event. An implicit step that ends with y1 = y0 + h f(y1), y0 = (s_i, q_0), is
/// a convex problem in the slip q = (v_r, ω_r) at its end, in the hand's frame,
///
///   min ½ (q − q_free)ᵀ N (q − q_free)/h + k/(h+T) Σ w_i ψ_i(s_i + (h+T) B_i q),   B_i q = v_r + ω_r J a p_i
///
/// N = (G M⁻¹ Gᵀ)⁻¹, ψ_i(u) = |u|²/2 up to δ λ_i and linear beyond it.
/// y0 and h are those of a stage of an implicit method.
template <class S>
class GivingPoints {
 public:
  using Slip = Vec3<S>;                    ///< m/s, m/s, rad/s
  using Inertia = std::array<Vec3<S>, 3>;  ///< kg, kg m, kg m²

  /// `limits` must have a compliance > 0.
  explicit GivingPoints(const FrictionLimits<S>& limits);

  /// Nothing stretched: where an unloaded patch starts.
  Stretch<S> zero() const;
  /// Static: the stretches under which the points carry `wrench` [N, N, N m] in the hand's frame, with limits
  /// n μ f_N [N] under Coulomb's law and L(f_N) [m]. Where they cannot, they carry what they can. Whether it
  /// was found.
  bool hold(const Vec3<S>& wrench, const S& force, const S& length, Stretch<S>& to);

  /// One implicit step of object and points.
  struct Step {
    S h;              ///< by which y' at the end counts [s]
    S force;          ///< n μ f_N [N] at the end, under Coulomb's law
    S length;         ///< L(f_N) [m] at the end
    Inertia inertia;  ///< N
    Slip free;        ///< the slip at the end without the points' wrench
    Slip known;       ///< the slip as it is expected: for friction by speed, and springs at their limits
  };
  /// From `from` to `to` (not the same); `slip` is the first guess and the answer, `wrench` [N, N, N m] what
  /// acts on the object at the end. False if the iteration spends its budget.
  bool step(const Step& step, const Stretch<S>& from, Stretch<S>& to, Slip& slip, Vec3<S>& wrench);

  /// a p + b q
  static void mix(double a, const Stretch<S>& p, double b, const Stretch<S>& q, Stretch<S>& to);

 private:
  struct Sum {
    double energy;
    Vec3<double> moment;            ///< Σ w Bᵀ e
    std::array<double, 6> bending;  ///< Σ w Bᵀ C B: xx, xz, zz, xτ, zτ, ττ
  };
  /// The potential of a step or a hold in values, ½ qᵀ A q − c·q + k/g Σ w_i ψ_i(s_i + g B_i q), and where it
  /// is least.
  struct Potential {
    Eigen::Matrix3d inertia;  ///< A
    Eigen::Vector3d pull;     ///< c
    double stiffness, gain;   ///< k, g
    double radius;            ///< of the patch [m]

    double value(const Eigen::Vector3d& q, const Sum& at) const;
    Eigen::Vector3d gradient(const Eigen::Vector3d& q, const Sum& at) const;
    Eigen::Matrix3d hessian(const Sum& at) const;
  };
  struct Minimum {
    Eigen::Vector3d slip;
    Sum sum;
    bool found;
  };
  Sum sum(const Stretch<S>& from, const Vec3<double>& slip, double gain, double radius) const;
  Minimum minimise(const Potential& potential, const Stretch<S>& from, const Eigen::Vector3d& guess) const;
  /// How the slip of the minimum moves with the parameters, by the implicit function theorem.
  void follow(const Minimum& minimum, const Potential& potential, const Step& problem, const Stretch<S>& from,
              const S& gain, const S& radius, Slip& slip) const requires std::is_same_v<S, dynamics::Dual>;
  bool solve(const Step& problem, const Stretch<S>& from, const S& gain, const S& radius, Slip& slip,
             Vec3<S>& wrench);
  /// How far a point goes in a step [m], in the hand's frame: h B_i q.
  struct Way {
    double x, z;
    Eigen::Matrix<double, dynamics::kDualSize, 1> dx, dz;
  };
  Way way(std::size_t i, const Slip& slip, const S& radius, const S& h) const;
  void move(const Stretch<S>& from, const Slip& slip, const S& radius, const S& h, Stretch<S>& to) const;
  void move(std::size_t i, const Stretch<S>& from, const Way& way, Stretch<S>& to) const;
  /// Where a spring is at its limit, that moves it, too, and s_i + (h+T) v_i is wrong by what it does.
  /// Without a damper this is nothing, since the force is at its limit as well. Else a step of a point that
  /// goes less far than its spring is stretched begins at a stretch from which the slip, as it is known,
  /// leads to the limit: wrong by h times what the slip is known wrong by.
  const Stretch<S>& led_to_limit(const Stretch<S>& from, const Slip& known, const S& radius, const S& h);
  void set_limits(const S& yield, const S& radius, const Slip& known);

  DiscPoints points_;
  std::vector<double> load_;                              ///< λ_i
  std::vector<typename Stretch<S>::Gradient> load_dual_;  ///< empty where it does not vary
  S stiffness_, loss_time_, torque_factor_;
  SpeedDependence<S> speed_;
  std::vector<double> limit_;                              ///< how far the springs reach [m], in this step
  std::vector<typename Stretch<S>::Gradient> limit_dual_;  ///< empty where S is double
  Stretch<S> led_;                                         ///< what led_to_limit() gives
};

extern template class GivingPoints<double>;
extern template class GivingPoints<dynamics::Dual>;

/// Contact models whose pads may give at every point.
class GivesAtPoints {
 public:
  virtual ~GivesAtPoints() = default;
  /// Whether these pads do, by their parameters.
  virtual bool gives_at_points() const = 0;
  /// The friction limits that the points share; the argument only says which scalar.
  virtual const FrictionLimits<double>& point_limits(double) const = 0;
  virtual const FrictionLimits<dynamics::Dual>& point_limits(const dynamics::Dual&) const = 0;
};

}  // namespace unhand::contact
