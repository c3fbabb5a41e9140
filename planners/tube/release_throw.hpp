// A throw whose object leaves the hand as a contact model says: where it lands, and how sure that is.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "contact/friction_effects.hpp"
#include "contact/law_parameter.hpp"
#include "contact/patch.hpp"
#include "datasets/model_card.hpp"
#include "planners/tube/tube_cvx.hpp"

namespace unhand::planners {

/// A number known up to a standard deviation, in the same unit.
struct Uncertain {
  double value{}, sigma{};  ///< 1 σ
};

/// Where a number of the release is from.
enum class NumberSource {
  assumed,    ///< nothing told it
  parameter,  ///< the card's parameters and spreads
  range,      ///< the card's valid range: measured in the throws that the card is of
  widened,    ///< of a σ: assumed, and a spread of the card's on top
};
/// As reports write it.
const char* to_string(NumberSource);
/// Of a number and of its σ.
struct NumberOrigin {
  NumberSource value{}, sigma{};    ///< of each
  std::vector<std::string> with{};  ///< spreads and numbers on cards whose σ is in this one, too
  std::string counted_in{};         ///< the number that this one's σ is in; empty: σ is its own
};

/// What is known of the release: a contact model, the friction of its pads, and how the gripper opens.
struct ReleaseCard {
  /// A name that contact::make_contact_model knows, of a law that follows the pads (contact::follows_pads).
  std::string model{"limit_surface"};
  Uncertain mu{0.5, 0.05};                        ///< friction coefficient [-]
  double length{contact::kFingerLength};          ///< L = τ_max/f_max [m]
  int pads{2};                                    ///< n >= 1
  double grip_force{40};                          ///< of one pad [N]
  Uncertain dead_time{0.020, 0.005};              ///< from the command to the first change of the force [s]
  Uncertain opening_time{0.060, 0.006};           ///< from there until the pads part [s]
  double shape{1.0};                              ///< p of contact::OpeningProfile [-]
  contact::LawValues<double> law_values{};        ///< of the law's own parameters
  contact::FrictionVariation<double> friction{};  ///< of the effects on friction
  std::vector<std::string> effects{};             ///< ids of these
  double grasp_offset{};  ///< 1 σ of the place of the pads on the object, throw to throw [m]
  double grasp_angle{};   ///< 1 σ of the object's angle in the hand, throw to throw [rad]
  std::map<std::string, NumberOrigin> origins{};  ///< by a number's name on cards; assumed if absent
  std::vector<std::string> passed_over{};         ///< names of numbers whose σ no unknown of the throw has
  double length_sigma{}, shape_sigma{};           ///< 1 σ of `length` [m] and of `shape` [-]
};

/// The least that a gripper's numbers scatter where a card's valid range tells them, 1 σ.
inline constexpr double kLeastForceSigma = 0.03,  ///< of the grip force, as its share [-]
    kLeastOpeningSigma = 1e-3;                    ///< of the dead time and of the opening time [s]

/// A model card's numbers: of its parameters mu, length, those of the law's own, pads, grip_force,
/// dead_time, opening_time and shape; else, for these four of the gripper, of its valid range; else those of
/// `otherwise`. The card's spreads from throw to throw add to σ: mu_deviation, dead_time_deviation,
/// grasp_offset and grasp_angle; force_deviation is of a log's sensor and passed over. σ of the grip force
/// counts as friction's, with which it forms one product. Effects on friction (contact::friction_effects)
/// act in the release; those of sensors, of what a log measured or declared, are passed over. Throws
/// datasets::CardError for a card of gripper_delay, for one with other effects, which this planner does not
/// take, and for parameters and spreads that it does not know.
ReleaseCard release_card(const datasets::ModelCard& card, const std::string& file,
                         const ReleaseCard& otherwise = {});

/// What the hand holds, and how.
struct HeldObject {
  double mass{0.246}, inertia{2.4e-3};  ///< [kg], about the centre of mass [kg m²]
  Uncertain com_offset{0.14, 0.004};    ///< pads to centre of mass [m]
  double angle{};  ///< of the object's x axis against the tip's z axis, in the plane [rad]
  double mass_sigma{}, inertia_sigma{};  ///< 1 σ [kg, kg m²]
};

/// The uncertain numbers of one throw.
enum Unknown {
  kMu,           ///< friction coefficient [-]
  kDeadTime,     ///< of the gripper [s]
  kOpeningTime,  ///< of the gripper [s]
  kComOffset,    ///< of the object [m]
  kGraspAngle,   ///< of the object against the hand [rad]
  kLength,       ///< L = τ_max/f_max of the pads [m]
  kShape,        ///< p of the gripper's opening [-]
  kMass,         ///< of the object [kg]
  kInertia,      ///< of the object, about its centre of mass [kg m²]
  kUnknowns      ///< how many there are
};
/// A value of every unknown, in its own unit, by kMu … kInertia.
using Draw = std::array<double, kUnknowns>;
/// The name that a card has for it: "dead_time".
const char* name_of(Unknown);

/// A throw in the vertical plane through the tip and the target: a chain whose tip is the middle of the pads,
/// its state when the gripper is told to open (t = 0), and the joint acceleration from then on.
struct ReleaseThrow {
  const Chain& chain;       ///< kept by reference
  ThrowState start;         ///< when the gripper is told to open
  JointVector<double> qdd;  ///< rad/s²
  Eigen::Vector3d target;   ///< [m]
  double hold{0.13};        ///< q̈ is held until then [s]; the object is free before
  ReleaseCard card{};       ///< pads and gripper
  HeldObject object{};      ///< what is thrown
  flight::Medium medium{};  ///< of the flight
};

/// Throws std::invalid_argument, naming value and accepted range: one finite number per joint, hold > 0,
/// every sigma >= 0, what is thrown and what holds it > 0, a card whose law follows the pads: plans have no
/// delay of a gripper. All functions below that take a throw check it.
void validate(const ReleaseThrow& problem);

/// One landing, and the release before it.
struct ReleaseLanding {
  double miss{};         ///< of the centre of mass, forward of the target [m]
  double detach_time{};  ///< [s]
  double angle{};        ///< through which the object turns against the hand until it is free [rad]
  double speed{};        ///< of the centre of mass when it is free [m/s]
};

/// Where a throw lands; empty if the object is not free by `hold` or never comes down to the target's height.
/// Throws std::invalid_argument where the tip does not move in a vertical plane with the target.
std::optional<ReleaseLanding> release_landing(const ReleaseThrow& problem, const Draw& draw);
/// The unknowns at their nominal values.
Draw nominal_draw(const ReleaseThrow& problem);

/// The same with the object carried rigidly until `delay` and then free: the kinematic model.
std::optional<ReleaseLanding> rigid_landing(const ReleaseThrow& problem, double com_offset, double delay);

/// Landing and its exact derivatives by the unknowns, at their nominal values; spread² = Σ (∂x/∂θ σ)².
struct ReleaseSpread {
  double miss{}, spread{};                   ///< nominal landing, forward of the target; its 1 σ [m]
  std::array<double, kUnknowns> gradient{};  ///< m per unit of the unknown
};
/// Nothing where the nominal throw does not land.
std::optional<ReleaseSpread> release_spread(const ReleaseThrow& problem);

class HeldMotion;

/// Landings of `count` draws from normal distributions (cut off at zero where the number must be positive),
/// each unknown by itself. An unknown without σ takes no draw.
struct Landings {
  std::vector<double> miss;  ///< of those that land [m]
  int lost{};                ///< slipping before the gripper opens, not free in time, or never down
  double mean{}, std{};      ///< of those that land [m]
};
/// Mean and standard deviation of what landed.
void summarise(Landings& landings);
/// Equal seeds give equal draws; count >= 1. Draws that slip at t = 0 are lost and, where `before` tells the
/// motion up to there, those that slip on the way.
Landings draw_landings(const ReleaseThrow& problem, int count, std::uint64_t seed,
                       const HeldMotion* before = nullptr);

/// A throw that depends little on what is not known.
struct InsensitiveResult {
  ThrowState start;          ///< q̇₀ as chosen
  JointVector<double> qdd;   ///< q̈ as chosen [rad/s²]
  double before{}, after{};  ///< root mean square miss over the unknowns' spread [m]
  int iterations{};          ///< taken
  /// The unknown of which a draw within its spread does not land; then nothing was minimised. Empty: none.
  std::string lost{};
};

/// Chooses q̇₀ and q̈ of `joints`, those that move in the plane (1 to 4, each once), so that landings miss
/// least over the card's and the grasp's uncertainty: minimises
///
///   E[x²] ≈ 1/(2 p) Σ_k (x(θ ± √p σ_k e_k; q̇₀, q̈))²,   k = 1 … p
///
/// by Levenberg-Marquardt. The rule is exact where x² is a cubic of the p unknowns, so for a landing that is
/// linear in them; of curvature it knows only roughly: of x = (θ_k/σ_k)² it makes p where 3 is true, of x =
/// θ_i θ_j nothing. The derivatives by q̇₀ and q̈ pass exactly through hand, release with its events, and
/// flight, and each of at most fifteen steps is a quadratic program within 98 % of the limits of q̇₀,
/// q̇₀ + hold q̈ and q̈. Throws std::invalid_argument as validate() does, and for other joints.
InsensitiveResult make_insensitive(const ReleaseThrow& problem, const std::vector<int>& joints);

}  // namespace unhand::planners
