// Synthetic throwing campaigns: known physics, seen through known sensors, written as a throw log.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "contact/contact_model.hpp"
#include "contact/normal_force.hpp"
#include "contact/patch.hpp"
#include "datasets/throw_log.hpp"
#include "dynamics/integrator.hpp"
#include "dynamics/rigid_body.hpp"
#include "experiment/campaign_effects.hpp"
#include "experiment/planar_arm.hpp"

namespace unhand::experiment {

/// A thrown object: held near its tip, its CoM `com_offset` further along its x axis.
struct ThrownObject {
  std::string name;                  ///< its id in the log
  dynamics::RigidBody<double> body;  ///< kg; kg m² about the CoM
  double com_offset{};               ///< pad centre to CoM [m]
  std::array<double, 3> dims{};      ///< bounding box [m]
  double drag_k{};                   ///< quadratic drag [1/m], declared where it is not 0
};

/// A 92 g bar with a 154 g cylinder in the slot that puts the CoM `com_offset` [m] from the pads. D4.6 2.2.3
/// gives the masses and the offsets; the bar's 0.32 m and the cylinder's 20 × 60 mm are this project's
/// choice.
ThrownObject loaded_bar(std::string name, double com_offset);

/// The hand at the switch of its acceleration, one of the campaign's postures.
struct Posture {
  std::string name;             ///< for names of conditions
  dynamics::Pose<double> hand;  ///< m, m, rad (the pitch)
  double speed{};               ///< of the hand [m/s]
  double elevation{};           ///< of its velocity above +x [rad]
  double omega{};               ///< of the hand [rad/s]
  /// θ_O − θ_H [rad] instead of the campaign's
  std::optional<double> grasp_angle{};
};

/// What differs from throw to throw, each 1 σ, normal and independent. None of it is in the log except where
/// a sensor sees it: the hand is logged as it truly moved.
struct ThrowVariation {
  double hand_position{1e-3};        ///< x and z at the switch [m]
  double hand_angle{0.006};          ///< pitch at the switch [rad]
  double hand_speed{0.012};          ///< relative [-]; turns with the speed, so ω varies alike
  double release_acceleration{0.3};  ///< [m/s²]
  double grasp_angle{0.02};          ///< [rad]
  double grip_force{0.03};           ///< relative [-]
  double mu{0.02};                   ///< relative [-]
  double dead_time{1.0e-3};          ///< [s]
  double opening_time{1.0e-3};       ///< [s]
  double grasp_offset{0};            ///< of the pads along the object's x axis [m]
  double grasp_across{0};            ///< and across it [m]
};

/// Rates and noise (1 σ) of the sensors; a σ of 0 is a perfect channel, which declares no noise.
struct SensorSuite {
  double hand_rate{1000}, ft_rate{1000}, mocap_rate{240};  ///< [1/s]
  double hand_sigma{1e-6};                                 ///< pose, twist and acceleration, SI units
  std::array<double, 3> wrench_sigma{0.02, 0.02, 2e-4};    ///< N, N, N m
  double normal_force_sigma{0.05};                         ///< [N]
  std::array<double, 3> mocap_sigma{2e-4, 2e-4, 0.2 * std::numbers::pi / 180};  ///< m, m, rad
  double mocap_dropout{0.005};  ///< share of samples lost, in [0, 1)
  std::array<double, 2> landing_sigma{1e-3, 0.5 * std::numbers::pi / 180};  ///< m, rad
  double landing_time_sigma{1e-3};                                          ///< [s]

  /// Which groups are written. Without `wrench` the F/T sensor reads the normal force alone: its wrench is
  /// written as zeros. Without `mocap` the log declares the posture's grasp angle.
  bool ft{true}, wrench{true}, mocap{true}, landing{true};  ///< whether these are written

  /// The same rates and groups without noise and without dropouts.
  SensorSuite perfect() const;
};

/// Makes the law that the throw obeys from its patch and its opening profile.
using ContactFactory = std::function<std::unique_ptr<contact::ContactModel>(
    const contact::Patch<double>&, const contact::OpeningProfile<double>&)>;

/// A full factorial campaign, objects × postures × release accelerations × repetitions, and everything that
/// determines it but the seed. World x forward, z up, angles from +x to +z.
struct CampaignDesign {
  std::string name;                           ///< for the log's title
  std::vector<ThrownObject> objects;          ///< factor of the campaign
  std::vector<Posture> postures;              ///< factor of the campaign
  std::vector<double> release_accelerations;  ///< of the hand along its path after the switch [m/s²]
  int repetitions{5};                         ///< of every condition

  PlanarArm arm;                                                             ///< that carries the hand
  double begin{-0.05}, switch_time{0.020}, follow_through{0.16}, end{0.30};  ///< of the hand's motion [s]
  double launch_acceleration{3.0};  ///< of the hand along its path before the switch [m/s²]

  contact::Patch<double> patch{0.5, 0.0106};  ///< mu is the campaign's mean
  std::optional<double> declared_pad_radius;  ///< [m]; the true one if absent
  /// f₀ of one pad [N], dead and opening time [s] are the campaign's means; `open_command` [s] holds for all
  /// throws.
  contact::OpeningProfile<double> opening{0.025, 60.0, 0.010, 0.070, 2.0};
  double grasp_angle{-0.7};                         ///< θ_O − θ_H [rad]
  std::string contact_model{"limit_surface_disc"};  ///< a name that contact::make_contact_model knows
  ContactFactory contact_factory;  ///< takes the place of `contact_model` if set; never gives null

  double gravity{9.81};        ///< [m/s²]
  double landing_height{0.0};  ///< [m]
  /// Share of each object's conditions that goes into the training split, whole conditions at a time.
  double train_share{0.5};
  ThrowVariation variation;  ///< from throw to throw
  SensorSuite sensors;       ///< what is written, and how noisy
  /// What the world or the sensors do and the log does not say: it declares the neutral values.
  EffectSettings effects;
  dynamics::IntegratorOptions integrator{};  ///< of the true release and flight

  int conditions() const;  ///< objects × postures × accelerations
  int throws() const;      ///< conditions × repetitions
  /// The hand's motion of a posture, without what varies from throw to throw; release_acceleration [m/s²].
  ThrowMotion motion(const Posture& posture, double release_acceleration) const;
  /// f₀ of FrictionVariation [N]
  double reference_force() const { return opening.grip_force; }
};

/// The designs by name: "batch180" (2 × 3 × 6 × 5, after D4.6 2.2.3), "throw-flip" (1 × 9 × 3 × 3),
/// "quick12" (2 × 1 × 3 × 2) and "random", random_campaign(seed); the others do not depend on the seed.
/// Throws std::invalid_argument, listing the names, for any other.
CampaignDesign campaign_design(std::string_view name, std::uint64_t seed = 1);
/// The names that campaign_design knows.
std::vector<std::string> campaign_names();

/// A campaign of 48 to 60 throws as a lab might make them: a bar with its CoM 0.10, 0.12 or 0.16 m from the
/// pads and another bar, a box or a light jar, three pitches, two or three release accelerations, under- or
/// overhand; μ 0.45–0.6, patch radius 9.5–13 mm, declared up to 10 % wrong, grip 20–30 N (more where only
/// that holds the bar), dead time 6–9 ms, opening 48–60 ms with shape 1 or 1.25; in every second campaign
/// drag is declared. Bars are grasped where they balance until the gripper opens.
CampaignDesign random_campaign(std::uint64_t seed);

/// What the sensors do not tell.
struct ThrowTruth {
  ThrowMotion motion;                       ///< of the hand, as it truly moved
  contact::Patch<double> patch;             ///< of this throw
  contact::OpeningProfile<double> opening;  ///< of this throw
  double grasp_angle{};                     ///< [rad]
  double grasp_offset{};                    ///< of the pads along the object's −x axis [m]
  double grasp_across{};                    ///< and along its −z axis [m]
  double detach_time{};                     ///< [s]
  dynamics::Pose<double> detach_pose;       ///< of the CoM; m, m, rad
  dynamics::Twist<double> detach_twist;     ///< m/s, m/s, rad/s
  double slip{};                            ///< of the CoM against the pads, in the object, at detach [m]
  double pivot{};                           ///< change of the angle against the hand, at detach [rad]
  double landing_time{};                    ///< [s]
  dynamics::Pose<double> landing_pose;      ///< of the CoM; m, m, rad
  std::string contact_model;                ///< the law that the throw obeyed
};

/// A synthetic record and the truth behind it.
struct SyntheticThrow {
  datasets::Throw record;  ///< what the sensors wrote
  ThrowTruth truth;        ///< what happened
};

/// The throw number `index` (0-based; repetitions fastest, then accelerations, postures, objects). Each throw
/// and each of its sensors draws from a stream of its own, made from (seed, index, purpose), so that throws
/// can be made in any order or at once, and turning a sensor's noise off changes nothing else. Generator
/// (splitmix64) and normal distribution (Box-Muller) are this library's own, hence the same with every
/// standard library; only the last bits of log, sin and cos are the mathematics library's.
///
/// Throws std::runtime_error, naming the throw and its parameters, if it fails: the arm cannot reach,
/// the grip does not hold the object at the start, it never separates, or it never lands. std::out_of_range
/// for an index outside the design.
SyntheticThrow generate_throw(const CampaignDesign& design, std::uint64_t seed, int index);

/// The log without its throws. Declared are the objects' true mass, inertia and CoM, but where sensor.mass,
/// sensor.inertia or sensor.com_offset say otherwise.
datasets::ThrowLog campaign_header(const CampaignDesign& design, std::uint64_t seed);

/// The whole campaign: a log whose title and source say that it is synthetic. The same design and seed give
/// the same log, bit for bit. Nothing in the log tells the effects. Throws std::invalid_argument for a design
/// that makes no sense, and as generate_throw does.
datasets::ThrowLog generate_campaign(const CampaignDesign& design, std::uint64_t seed);

}  // namespace unhand::experiment
