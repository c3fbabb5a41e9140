#include "experiment/synthetic_campaign.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "contact/registry.hpp"
#include "experiment/synthetic_sensors.hpp"
#include "experiment/throw_setup.hpp"

namespace unhand::experiment {

namespace {

/// The indices of one throw in its design.
struct Cell {
  int object{}, posture{}, acceleration{}, repetition{};
  int condition{};
};

Cell cell_of(const CampaignDesign& design, int index) {
  const int accelerations = static_cast<int>(design.release_accelerations.size());
  const int postures = static_cast<int>(design.postures.size());
  const int condition = index / design.repetitions;
  return {condition / accelerations / postures, condition / accelerations % postures,
          condition % accelerations, index % design.repetitions, condition};
}

std::string condition_name(const CampaignDesign& design, const Cell& cell) {
  return fmt::format("{}/{}/acc{:+g}", design.objects[cell.object].name, design.postures[cell.posture].name,
                     design.release_accelerations[cell.acceleration]);
}

/// True where the condition belongs to the training split: a shuffle of each object's conditions.
std::vector<bool> training_conditions(const CampaignDesign& design, std::uint64_t seed) {
  const int each = design.conditions() / static_cast<int>(design.objects.size());
  const int train = std::clamp(static_cast<int>(std::lround(design.train_share * each)), 0, each);
  std::vector<bool> out(static_cast<std::size_t>(design.conditions()));
  for (int object = 0; object < static_cast<int>(design.objects.size()); ++object) {
    RandomStream random(seed, static_cast<std::uint64_t>(object), Purpose::split);
    std::vector<int> order(static_cast<std::size_t>(each));
    std::iota(order.begin(), order.end(), 0);
    for (int i = each - 1; i > 0; --i)
      std::swap(order[i], order[static_cast<int>(random.uniform() * (i + 1))]);
    for (int i = 0; i < train; ++i) out[object * each + order[i]] = true;
  }
  return out;
}

std::unique_ptr<contact::ContactModel> make_law(const CampaignDesign& design, const ThrowTruth& truth,
                                                const ThrowSetup<double>& setup) {
  if (design.contact_factory) {
    auto law = design.contact_factory(truth.patch, truth.opening);
    if (!law) throw std::logic_error(fmt::format("campaign {}: contact_factory gave null", design.name));
    return law;
  }
  contact::ContactParameters<double> parameters;
  parameters.patch = truth.patch;
  parameters.open_command = truth.opening.open_command;
  parameters.delay = truth.opening.dead_time + truth.opening.opening_time;
  parameters.variation = setup.friction;
  return contact::make_contact_model(design.contact_model, parameters);
}

/// The hand as it truly moves: as commanded, or late.
class TrueHand {
 public:
  TrueHand(const PlanarArmHand& commanded, const ThrowSetup<double>& setup) : hand_(&commanded) {
    if (dynamics::is_zero(setup.late.tracking_lag)) return;
    polynomial_ = std::make_unique<release::PolynomialHand>(polynomial_hand(commanded));
    lagged_ = std::make_unique<release::LaggedHand>(*polynomial_, dynamics::Dual(setup.late.tracking_lag));
    hand_ = lagged_.get();
  }
  const release::HandMotion& operator*() const { return *hand_; }

 private:
  const release::HandMotion* hand_;
  std::unique_ptr<release::PolynomialHand> polynomial_;
  std::unique_ptr<release::LaggedHand> lagged_;
};

/// What this throw is, before it is simulated.
ThrowTruth draw(const CampaignDesign& design, const Cell& cell, RandomStream random) {
  const ThrowVariation& v = design.variation;
  const Posture& posture = design.postures[cell.posture];
  ThrowTruth truth;
  ThrowMotion& motion = truth.motion;
  motion = design.motion(posture, design.release_accelerations[cell.acceleration]);
  motion.pose.x = random.normal(posture.hand.x, v.hand_position);
  motion.pose.z = random.normal(posture.hand.z, v.hand_position);
  motion.pose.theta = random.normal(posture.hand.theta, v.hand_angle);
  const double speed = random.normal(1, v.hand_speed);
  const double turned = posture.elevation + motion.pose.theta - posture.hand.theta;
  motion.twist = {speed * posture.speed * std::cos(turned), speed * posture.speed * std::sin(turned),
                  speed * posture.omega};
  motion.after = random.normal(motion.after, v.release_acceleration);
  truth.grasp_angle = random.normal(posture.grasp_angle.value_or(design.grasp_angle), v.grasp_angle);
  truth.opening = design.opening;
  truth.opening.grip_force *= random.normal(1, v.grip_force);
  truth.opening.dead_time = std::max(0.0, random.normal(design.opening.dead_time, v.dead_time));
  truth.opening.opening_time = random.normal(design.opening.opening_time, v.opening_time);
  truth.patch = design.patch;
  truth.patch.mu *= random.normal(1, v.mu);
  truth.grasp_offset = random.normal(0, v.grasp_offset);
  if (v.grasp_across > 0)
    truth.grasp_across = random.normal(0, v.grasp_across);  // else seeds draw what they did
  return truth;
}

void validate(const CampaignDesign& design) {
  const auto require = [&](bool ok, std::string_view name, double value, std::string_view range) {
    if (!ok)
      throw std::invalid_argument(
          fmt::format("campaign {}: {} = {} is not in {}", design.name, name, value, range));
  };
  require(!design.objects.empty(), "number of objects", 0, "[1, inf)");
  require(!design.postures.empty(), "number of postures", 0, "[1, inf)");
  require(!design.release_accelerations.empty(), "number of release accelerations", 0, "[1, inf)");
  require(design.repetitions >= 1 && design.repetitions <= 10'000, "repetitions", design.repetitions,
          "[1, 10000]");
  require(design.train_share >= 0 && design.train_share <= 1, "train_share", design.train_share, "[0, 1]");
  const auto laws = contact::contact_model_names();
  if (!design.contact_factory && std::find(laws.begin(), laws.end(), design.contact_model) == laws.end())
    throw std::invalid_argument(fmt::format("campaign {}: no contact model is called '{}': choose one of {}",
                                            design.name, design.contact_model, fmt::join(laws, ", ")));
  require(design.gravity > 0 && design.gravity < 100, "gravity", design.gravity, "(0, 100) m/s²");
  require(std::isfinite(design.landing_height), "landing_height", design.landing_height, "finite m");
  const SensorSuite& s = design.sensors;
  for (const auto& [name, rate] :
       {std::pair("hand_rate", s.hand_rate), {"ft_rate", s.ft_rate}, {"mocap_rate", s.mocap_rate}})
    require(rate >= 1 && rate <= 1e6, name, rate, "[1, 1e6] 1/s");
  require(s.mocap_dropout >= 0 && s.mocap_dropout < 1, "mocap_dropout", s.mocap_dropout, "[0, 1)");
  for (const double sigma : {s.hand_sigma, s.wrench_sigma[0], s.wrench_sigma[1], s.wrench_sigma[2],
                             s.normal_force_sigma, s.mocap_sigma[0], s.mocap_sigma[1], s.mocap_sigma[2],
                             s.landing_sigma[0], s.landing_sigma[1], s.landing_time_sigma})
    require(sigma >= 0 && std::isfinite(sigma), "a sensor's sigma", sigma, "[0, inf)");
  std::vector<std::string> objects;
  for (const ThrownObject& object : design.objects) {
    objects.push_back(object.name);
    require(object.drag_k >= 0 && object.drag_k < 100, object.name + ": drag_k", object.drag_k,
            "[0, 100) 1/m");
  }
  validate_effects(design.effects, objects);
  if (design.contact_factory)
    for (const auto& [name, value] : design.effects)
      if (name.starts_with("contact."))
        throw std::invalid_argument(fmt::format(
            "campaign {}: {} needs a named contact model, not a contact_factory", design.name, name));
}

/// Why a throw cannot be made, with what was drawn for it.
std::runtime_error failure(const CampaignDesign& design, std::uint64_t seed, const SyntheticThrow& made,
                           const std::string& why) {
  const auto& [record, truth] = made;
  const auto& [m, o, p] = std::tie(truth.motion, truth.opening, truth.patch);
  return std::runtime_error(fmt::format(
      "campaign {}, seed {}, throw {} ({}, repetition {}): {}; hand at the switch ({:.4g} m, {:.4g} m, "
      "{:.4g} rad) at ({:.4g} m/s, {:.4g} m/s, {:.4g} rad/s), release acceleration {:.4g} m/s², grasp angle "
      "{:.4g} rad, mu {:.4g}, pad radius {:.4g} m, grip force {:.4g} N, dead time {:.4g} s, opening time "
      "{:.4g} s",
      design.name, seed, record.id, record.condition, record.repetition, why, m.pose.x, m.pose.z,
      m.pose.theta, m.twist.vx, m.twist.vz, m.twist.omega, m.after, truth.grasp_angle, p.mu, p.radius,
      o.grip_force, o.dead_time, o.opening_time));
}

SyntheticThrow make_throw(const CampaignDesign& design, const std::vector<bool>& training, std::uint64_t seed,
                          int index) {
  const Cell cell = cell_of(design, index);
  const auto stream = [&](Purpose purpose) {
    return RandomStream(seed, static_cast<std::uint64_t>(index), purpose);
  };
  SyntheticThrow made{{}, draw(design, cell, stream(Purpose::variation))};
  auto& [record, truth] = made;
  record.id =
      fmt::format("{:0{}}", index + 1, std::max<std::size_t>(3, fmt::formatted_size("{}", design.throws())));
  record.object = design.objects[cell.object].name;
  record.condition = condition_name(design, cell);
  record.repetition = cell.repetition + 1;
  record.split = training[cell.condition] ? datasets::Split::train : datasets::Split::test;

  const auto fail = [&](const std::string& why) { return failure(design, seed, made, why); };
  const ThrownObject& object = design.objects[cell.object];
  if (!design.sensors.mocap)
    record.grasp_angle = design.postures[cell.posture].grasp_angle.value_or(design.grasp_angle);
  try {
    const OwnEffects effects(design.effects, object.name);
    ThrowSetup<double> setup(effects.values());
    setup.friction.reference_force = design.reference_force();
    const PlanarArmHand commanded = throw_motion(design.arm, truth.motion);
    const TrueHand hand(commanded, setup);
    const contact::ProfileNormalForce opening(truth.opening);
    FeltForce<double> force(opening);
    force.act(setup);
    const auto law = make_law(design, truth, setup);
    truth.contact_model = law->name();
    const release::ReleaseProblem<double> problem{
        *hand,
        *force,
        *law,
        object.body,
        setup.gravity.at(design.gravity),
        {object.com_offset + truth.grasp_offset, truth.grasp_angle, truth.grasp_across},
        commanded.begin()};
    release::ReleaseOptions options{design.integrator, false};
    options.integrator.record = true;
    const auto result = release::simulate_release(problem, options);
    if (result.outcome != release::ReleaseOutcome::detached)
      throw fail(fmt::format("{} ({}, {})", in_words(result.outcome), to_string(result.outcome),
                             to_string(result.integration)));
    if (result.slips_at_start) throw fail("the grip does not hold the object");
    truth.detach_time = result.detach.time;
    truth.detach_pose = result.detach.pose;
    truth.detach_twist = result.detach.twist;
    truth.slip =
        norm(result.relative.arm - dynamics::Vec2<double>{problem.grasp.com_offset, problem.grasp.across});
    truth.pivot = result.relative.angle - truth.grasp_angle;

    const auto flight =
        flight_from(result.detach, problem.gravity, object.drag_k, design.landing_height, setup);
    auto of_com = flight;
    of_com.tracked = {};
    of_com.landing_height = design.landing_height;  // the true one, whatever a tracker calls it
    const auto landed = flight::fly(of_com, design.integrator), seen = flight::fly(flight, design.integrator);
    for (const auto* flown : {&landed, &seen})
      if (flown->outcome != flight::FlightOutcome::landed)
        throw fail(flown->outcome == flight::FlightOutcome::never_reaches
                       ? fmt::format("never reaches the landing height of {} m", design.landing_height)
                       : fmt::format("flight: {}", to_string(flown->integration)));
    truth.landing_time = result.detach.time + landed.landing.flight_time;
    truth.landing_pose = landed.landing.pose;

    ThrowReader<double> reader(problem, result, flight, setup, truth.patch.pads);
    reader.fly(seen.landing.flight_time + 0.1, options.integrator);
    record_sensors({commanded, opening, reader, problem.start, result.detach.time + seen.landing.flight_time,
                    seen.landing.pose, setup.sensing.normal_force_bias, setup.sensing.mocap_time_offset,
                    setup.sensing.ft_time_offset},
                   design.sensors, seed, static_cast<std::uint64_t>(index), record);
  } catch (const std::invalid_argument& error) {
    throw fail(error.what());
  }
  return made;
}

}  // namespace

SyntheticThrow generate_throw(const CampaignDesign& design, std::uint64_t seed, int index) {
  validate(design);
  if (index < 0 || index >= design.throws())
    throw std::out_of_range(
        fmt::format("campaign {}: throw {} is not in [0, {})", design.name, index, design.throws()));
  return make_throw(design, training_conditions(design, seed), seed, index);
}

datasets::ThrowLog campaign_header(const CampaignDesign& design, std::uint64_t seed) {
  validate(design);
  datasets::ThrowLog log;
  log.title = fmt::format("synthetic throws: campaign {}", design.name);
  log.source = fmt::format("synthetic: simulated by unhand, contact law {}, seed {}",
                           design.contact_factory ? "of the caller's" : design.contact_model, seed);
  log.gravity = design.gravity;
  log.landing_height = design.landing_height;
  for (const ThrownObject& object : design.objects) {
    const OwnEffects effects(design.effects, object.name);
    const auto sensing = ThrowSetup<double>(effects.values()).sensing;
    datasets::Object& entry = log.objects[object.name];
    entry.mass = object.body.mass / (1 + sensing.mass);
    entry.inertia = {object.body.inertia / (1 + sensing.inertia)};
    entry.com_offset = object.com_offset - sensing.com_offset;
    entry.dims = object.dims;
    if (object.drag_k > 0) entry.drag_k = object.drag_k;
  }
  log.gripper = {design.patch.pads, design.declared_pad_radius.value_or(design.patch.radius),
                 design.opening.open_command};
  return log;
}

datasets::ThrowLog generate_campaign(const CampaignDesign& design, std::uint64_t seed) {
  datasets::ThrowLog log = campaign_header(design, seed);
  const std::vector<bool> training = training_conditions(design, seed);
  for (int i = 0; i < design.throws(); ++i)
    log.throws.push_back(make_throw(design, training, seed, i).record);
  return log;
}

}  // namespace unhand::experiment
