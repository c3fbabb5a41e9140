#include "experiment/synthetic_campaign.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "contact/registry.hpp"
#include "flight/projectile.hpp"
#include "release/simulate_release.hpp"

namespace unhand::experiment {

using datasets::Series;
using dynamics::Pose;

namespace {

constexpr double kDegree = std::numbers::pi / 180;
/// Samples nearer than this to an event [s] count as after it: what decimal times leave of rounding.
constexpr double kSnap = 1e-9;

/// What a stream is for; adding a purpose at the end leaves the others as they were.
enum class Purpose : std::uint64_t { variation, hand, force_torque, mocap, landing, split };

/// A stream of random numbers. splitmix64 (Steele, Lea and Flood 2014), started from a hash of its key.
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::uint64_t index, Purpose purpose)
      : state_(mix(mix(mix(seed) ^ (index + 1)) ^ (static_cast<std::uint64_t>(purpose) + 1))) {}

  std::uint64_t bits() { return mix(state_ += kGolden); }
  /// In [0, 1), 53 bits.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }
  /// Standard normal (Box-Muller; the second of each pair is kept for the next call).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(1 - uniform())), angle = 2 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }
  double normal(double mean, double sigma) { return mean + sigma * normal(); }

 private:
  static constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15;
  static std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
    x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
    return x ^ (x >> 31);
  }
  std::uint64_t state_;
  double spare_{};
  bool has_spare_{false};
};

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

/// A series of the given columns; σ is declared where there is noise.
Series series(std::size_t cols, std::vector<double> sigma = {}) {
  Series out;
  out.cols = cols;
  if (std::any_of(sigma.begin(), sigma.end(), [](double s) { return s > 0; })) out.sigma = std::move(sigma);
  return out;
}

template <std::size_t N>
void append(Series& to, const std::array<double, N>& row) {
  to.data.insert(to.data.end(), row.begin(), row.end());
  ++to.rows;
}

template <std::size_t N>
std::array<double, N> noisy(std::array<double, N> row, const std::array<double, N>& sigma,
                            RandomStream& random) {
  for (std::size_t i = 0; i < N; ++i) row[i] = random.normal(row[i], sigma[i]);
  return row;
}

std::array<double, 3> row(const Pose<double>& p) { return {p.x, p.z, p.theta}; }

/// The multiples of 1/rate inside [begin, end].
std::vector<double> sample_times(double begin, double end, double rate) {
  std::vector<double> out;
  for (double k = std::ceil((begin - kSnap) * rate); k <= (end + kSnap) * rate; ++k) out.push_back(k / rate);
  return out;
}

/// The stretch between two jumps of the hand that holds t; at a jump the later one, which is what a log
/// holds.
dynamics::Window window_at(const release::HandMotion& hand, double t) {
  dynamics::Window window{hand.begin(), hand.end()};
  for (const double jump : hand.jumps()) {
    if (jump <= t + kSnap)
      window.begin = jump;
    else {
      window.end = jump;
      break;
    }
  }
  return window;
}

datasets::HandLog log_hand(const PlanarArmHand& hand, const SensorSuite& sensors, RandomStream random) {
  const double s = sensors.hand_sigma;
  datasets::HandLog log{series(1), series(3, {s, s, s}), series(3, {s, s, s}), series(3, {s, s, s})};
  const std::array<double, 3> sigma{s, s, s};
  for (const double t : sample_times(hand.begin(), hand.end(), sensors.hand_rate)) {
    const auto state = hand.at(window_at(hand, t), t);
    const auto& [v, a] = std::pair(state.twist, state.acceleration);
    append(log.time, std::array{t});
    append(log.pose, noisy(row(state.pose), sigma, random));
    append(log.twist, noisy(std::array{v.vx, v.vz, v.omega}, sigma, random));
    append(log.acceleration, noisy(std::array{a.ax, a.az, a.alpha}, sigma, random));
  }
  return log;
}

using Problem = release::ReleaseProblem<double>;
using Result = release::ReleaseResult<double>;

/// The sensor is behind one pad, so it feels its share of the wrench, and turns with the hand.
datasets::FtLog log_forces(const Problem& problem, const Result& result, int pads, const SensorSuite& sensors,
                           RandomStream random) {
  const auto& w = sensors.wrench_sigma;
  datasets::FtLog log{series(1), series(3, {w[0], w[1], w[2]}), series(1, {sensors.normal_force_sigma})};
  for (const double t : sample_times(problem.hand.begin(), problem.hand.end(), sensors.ft_rate)) {
    std::array<double, 3> wrench{};
    double normal_force = 0;
    if (t < result.detach.time - kSnap) {
      auto at = release::sample_release(problem, result, std::max(t, problem.start));
      // Where slip sets in at this very instant, its direction exists only as the limit from the right.
      if (!std::isfinite(at.wrench.fx + at.wrench.fz + at.wrench.tau))
        at = release::sample_release(problem, result, std::max(t, problem.start) + kSnap);
      const auto force = dynamics::rotate(-at.hand.pose.theta, at.wrench.force());
      wrench = {force.x / pads, force.z / pads, at.wrench.tau / pads};
      normal_force = at.normal_force;
    }
    append(log.time, std::array{t});
    append(log.wrench, noisy(wrench, w, random));
    append(log.normal_force, noisy(std::array{normal_force}, {sensors.normal_force_sigma}, random));
  }
  return log;
}

datasets::MocapLog log_mocap(const Problem& problem, const Result& result, double landing,
                             const SensorSuite& sensors, RandomStream random) {
  const auto& s = sensors.mocap_sigma;
  datasets::MocapLog log{series(1), series(3, {s[0], s[1], s[2]}), {}};
  const double phase = random.uniform();  // the camera runs freely
  for (double k = 0;; ++k) {
    const double t = problem.start + (k + phase) / sensors.mocap_rate;
    if (t > landing) return log;
    const Pose<double> pose = t < result.detach.time
                                  ? release::sample_release(problem, result, t).pose
                                  : flight::ballistic(result.detach.pose, result.detach.twist,
                                                      problem.gravity, t - result.detach.time)
                                        .pose;
    std::array<double, 3> seen = noisy(row(pose), s, random);
    const bool lost = random.uniform() < sensors.mocap_dropout;
    if (lost) seen.fill(std::numeric_limits<double>::quiet_NaN());
    append(log.time, std::array{t});
    append(log.pose, seen);
    log.valid.push_back(lost ? 0 : 1);
  }
}

std::unique_ptr<contact::ContactModel> make_law(const CampaignDesign& design, const ThrowTruth& truth) {
  if (design.contact_factory) return design.contact_factory(truth.patch, truth.opening);
  contact::ContactParameters<double> parameters;
  parameters.patch = truth.patch;
  parameters.open_command = truth.opening.open_command;
  parameters.delay = truth.opening.dead_time + truth.opening.opening_time;
  return contact::make_contact_model(design.contact_model, parameters);
}

/// What this throw is, before it is simulated.
ThrowTruth draw(const CampaignDesign& design, const Cell& cell, RandomStream random) {
  const ThrowVariation& v = design.variation;
  const Posture& posture = design.postures[cell.posture];
  ThrowTruth truth;
  ThrowMotion& motion = truth.motion;
  motion.begin = design.begin;
  motion.switch_time = design.switch_time;
  motion.follow_through = design.follow_through;
  motion.end = design.end;
  motion.pose.x = random.normal(posture.hand.x, v.hand_position);
  motion.pose.z = random.normal(posture.hand.z, v.hand_position);
  motion.pose.theta = random.normal(posture.hand.theta, v.hand_angle);
  const double speed = random.normal(1, v.hand_speed);
  const double turned = posture.elevation + motion.pose.theta - posture.hand.theta;
  motion.twist = {speed * posture.speed * std::cos(turned), speed * posture.speed * std::sin(turned),
                  speed * posture.omega};
  motion.before = design.launch_acceleration;
  motion.after = random.normal(design.release_accelerations[cell.acceleration], v.release_acceleration);
  truth.grasp_angle = random.normal(design.grasp_angle, v.grasp_angle);
  truth.opening = design.opening;
  truth.opening.grip_force *= random.normal(1, v.grip_force);
  truth.opening.dead_time = std::max(0.0, random.normal(design.opening.dead_time, v.dead_time));
  truth.opening.opening_time = random.normal(design.opening.opening_time, v.opening_time);
  truth.patch = design.patch;
  truth.patch.mu *= random.normal(1, v.mu);
  return truth;
}

void validate(const CampaignDesign& design) {
  const auto require = [&](bool ok, std::string_view name, double value, std::string_view range) {
    if (!ok)
      throw std::invalid_argument(
          fmt::format("campaign {}: {} = {} is not in {}", design.name, name, value, range));
  };
  require(!design.objects.empty(), "number of objects", 0, "[1, 10000]");
  require(!design.postures.empty(), "number of postures", 0, "[1, 10000]");
  require(!design.release_accelerations.empty(), "number of release accelerations", 0, "[1, 10000]");
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

  const auto fail = [&](const std::string& why) -> std::runtime_error {
    const auto& [m, o, p] = std::tie(truth.motion, truth.opening, truth.patch);
    return std::runtime_error(
        fmt::format("campaign {}, seed {}, throw {} ({}, repetition {}): {}; hand at the switch ({:.4g} m, "
                    "{:.4g} m, {:.4g} rad) at "
                    "({:.4g} m/s, {:.4g} m/s, {:.4g} rad/s), release acceleration {:.4g} m/s², grasp angle "
                    "{:.4g} rad, mu {:.4g}, pad "
                    "radius {:.4g} m, grip force {:.4g} N, dead time {:.4g} s, opening time {:.4g} s",
                    design.name, seed, record.id, record.condition, record.repetition, why, m.pose.x,
                    m.pose.z, m.pose.theta, m.twist.vx, m.twist.vz, m.twist.omega, m.after, truth.grasp_angle,
                    p.mu, p.radius, o.grip_force, o.dead_time, o.opening_time));
  };

  const ThrownObject& object = design.objects[cell.object];
  try {
    const PlanarArmHand hand = throw_motion(design.arm, truth.motion);
    const contact::ProfileNormalForce force(truth.opening);
    const auto law = make_law(design, truth);
    truth.contact_model = law->name();
    const Problem problem{hand,
                          force,
                          *law,
                          object.body,
                          dynamics::level_gravity(design.gravity),
                          {object.com_offset, truth.grasp_angle},
                          hand.begin()};
    release::ReleaseOptions options;
    options.integrator.record = true;
    const Result result = release::simulate_release(problem, options);
    if (result.outcome != release::ReleaseOutcome::detached)
      throw fail(fmt::format("{} ({})", to_string(result.outcome), to_string(result.integration)));
    if (result.slips_at_start) throw fail("the grip does not hold the object");
    truth.detach_time = result.detach.time;
    truth.detach_pose = result.detach.pose;
    truth.detach_twist = result.detach.twist;
    truth.slip = norm(result.relative.arm - dynamics::Vec2<double>{object.com_offset, 0});
    truth.pivot = result.relative.angle - truth.grasp_angle;
    const auto landing =
        flight::project(result.detach.pose, result.detach.twist, problem.gravity, design.landing_height);
    if (!landing) throw fail(fmt::format("never reaches the landing height of {} m", design.landing_height));
    truth.landing_time = result.detach.time + landing->flight_time;
    truth.landing_pose = landing->pose;

    record.hand_jump_times = hand.jumps();
    record.hand = log_hand(hand, design.sensors, stream(Purpose::hand));
    record.ft = log_forces(problem, result, truth.patch.pads, design.sensors, stream(Purpose::force_torque));
    record.mocap = log_mocap(problem, result, truth.landing_time, design.sensors, stream(Purpose::mocap));
    const auto& s = design.sensors;
    record.landing = {series(1, {s.landing_time_sigma}), series(2, {s.landing_sigma[0], s.landing_sigma[1]})};
    RandomStream random = stream(Purpose::landing);
    append(record.landing->time, noisy(std::array{truth.landing_time}, {s.landing_time_sigma}, random));
    append(record.landing->pose,
           noisy(std::array{landing->pose.x, landing->pose.theta}, s.landing_sigma, random));
  } catch (const std::invalid_argument& error) {
    throw fail(error.what());
  }
  return made;
}

}  // namespace

ThrownObject loaded_bar(std::string name, double com_offset) {
  constexpr double bar = 0.092, length = 0.32, width = 0.03, held = 0.01;  // kg, m, m, m from the tip
  constexpr double load = 0.154, radius = 0.01, height = 0.06;             // a steel cylinder along the bar
  constexpr double centre = 0.5 * length - held, mass = bar + load;
  const double slot = (mass * com_offset - bar * centre) / load;
  if (!(slot >= 0 && slot <= length - held - 0.5 * height))
    throw std::invalid_argument(fmt::format("loaded_bar: com_offset = {} m is not in [{:.4g}, {:.4g}] m",
                                            com_offset, bar * centre / mass,
                                            (bar * centre + load * (length - held - 0.5 * height)) / mass));
  const auto square = [](double x) { return x * x; };
  const double inertia = bar * (square(length) + square(width)) / 12 + bar * square(centre - com_offset) +
                         load * (3 * square(radius) + square(height)) / 12 + load * square(slot - com_offset);
  return {std::move(name), {mass, inertia}, com_offset, {length, width, 0.02}};
}

SensorSuite SensorSuite::perfect() const {
  SensorSuite out;
  out.hand_rate = hand_rate;
  out.ft_rate = ft_rate;
  out.mocap_rate = mocap_rate;
  out.hand_sigma = out.normal_force_sigma = out.mocap_dropout = out.landing_time_sigma = 0;
  out.wrench_sigma = {};
  out.mocap_sigma = {};
  out.landing_sigma = {};
  return out;
}

int CampaignDesign::conditions() const {
  return static_cast<int>(objects.size() * postures.size() * release_accelerations.size());
}
int CampaignDesign::throws() const { return conditions() * repetitions; }

std::vector<std::string> campaign_names() { return {"batch180", "quick12"}; }

CampaignDesign campaign_design(std::string_view name) {
  CampaignDesign design;
  design.name = name;
  design.objects = {loaded_bar("bar-com100", 0.10), loaded_bar("bar-com160", 0.16)};
  const auto posture = [](int pitch, double speed, double elevation) -> Posture {
    return {fmt::format("pitch{:+}", pitch), {0.50, 0.55, pitch * kDegree}, speed, elevation * kDegree, 4.0};
  };
  if (name == "batch180") {
    design.postures = {posture(-40, 2.4, 34), posture(-22, 2.4, 42), posture(-4, 2.4, 50)};
    design.release_accelerations = {8, 3, -4, -9, -14, -19};
  } else if (name == "quick12") {
    design.postures = {posture(-22, 2.4, 42)};
    design.release_accelerations = {8, -4, -14};
    design.repetitions = 2;
  } else {
    throw std::invalid_argument(
        fmt::format("no campaign is called '{}': choose one of {}", name, fmt::join(campaign_names(), ", ")));
  }
  return design;
}

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
    datasets::Object& entry = log.objects[object.name];
    entry.mass = object.body.mass;
    entry.inertia = {object.body.inertia};
    entry.com_offset = object.com_offset;
    entry.dims = object.dims;
  }
  log.gripper = {design.patch.pads, design.patch.radius, design.opening.open_command};
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
