// MuJoCo: one contact with elliptic cone, condim 4 (sliding and torsional friction).
#include <fmt/core.h>
#include <mujoco/mujoco.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <numbers>
#include <stdexcept>

#include "bench/peers/truths.hpp"

namespace unhand::bench {
namespace {

struct Setting {
  std::string words;
  double step{};
  double settles{};     ///< time until the soft contact stands [s]
  std::string option;   ///< attributes of <option>
  std::string contact;  ///< attributes of the geoms
};

class Simulation {
 public:
  explicit Simulation(const std::string& xml) {
    const auto file = std::filesystem::temp_directory_path() / fmt::format("unhand_peer_{}.xml", getpid());
    std::ofstream(file) << xml;
    char error[1000] = "";
    model_ = mj_loadXML(file.c_str(), nullptr, error, sizeof error);
    std::filesystem::remove(file);
    if (!model_) throw std::runtime_error(fmt::format("MuJoCo: {}", error));
    data_ = mj_makeData(model_);
  }
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;
  ~Simulation() {
    mj_deleteData(data_);
    mj_deleteModel(model_);
  }
  mjModel& model() { return *model_; }
  mjData& data() { return *data_; }
  void step() { mj_step(model_, data_); }

 private:
  mjModel* model_{};
  mjData* data_{};
};

std::string disc_xml(const Setting& s) {
  return fmt::format(
      "<mujoco><compiler angle=\"radian\"/>"
      "<option timestep=\"{}\" gravity=\"0 0 0\" cone=\"elliptic\" solver=\"Newton\" {}/>"
      "<default><geom condim=\"4\" friction=\"{} {} 0\" {}/></default>"
      "<worldbody><geom type=\"plane\" size=\"5 5 0.1\"/>"
      "<body pos=\"0 0 0.05\"><inertial pos=\"0 0 0\" mass=\"{}\" diaginertia=\"{} {} {}\"/>"
      "<joint type=\"slide\" axis=\"1 0 0\"/><joint type=\"slide\" axis=\"0 1 0\"/>"
      "<joint type=\"slide\" axis=\"0 0 1\"/><joint type=\"hinge\" axis=\"0 0 1\"/>"
      "<geom type=\"sphere\" size=\"0.05\"/></body></worldbody></mujoco>",
      s.step, s.option, kMu, kMu * kLength, s.contact, kMass, kInertia, kInertia, kInertia);
}

Work disc(const Setting& setting, const Truth& truth) {
  Simulation sim(disc_xml(setting));
  mjData& d = sim.data();
  const int body = 1;
  const int steps = static_cast<int>(std::lround(truth.end / setting.step));
  const auto run = [&] {
    mj_resetData(&sim.model(), &d);
    // pressed until the soft contact carries the whole force; not timed
    d.xfrc_applied[6 * body + 2] = -kNormal;
    std::fill_n(sim.model().opt.gravity, 3, 0.0);
    for (int k = 0; k < static_cast<int>(setting.settles / setting.step); ++k) sim.step();
    d.qpos[0] = d.qpos[1] = d.qpos[3] = 0;
    d.qvel[0] = truth.slide, d.qvel[3] = truth.spin;
    const double begin = thread_seconds();
    std::size_t push = 0;
    for (int k = 0; k < steps; ++k) {
      const double middle = (k + 0.5) * setting.step;
      while (push + 1 < truth.pushes.size() && middle > truth.pushes[push].until) ++push;
      sim.model().opt.gravity[0] = truth.pushes[push].along;
      if (truth.releases) d.xfrc_applied[6 * body + 2] = -kNormal * (1 - middle / truth.end);
      sim.step();
    }
    return thread_seconds() - begin;
  };
  double seconds = run();
  if (seconds < 0.01) seconds = std::min(seconds, run());
  return {"MuJoCo", setting.words, truth.name, error_of(truth, d.qpos[0], d.qpos[3]), seconds / truth.end};
}

/// A contact as a damped spring whose half period is 20 steps and whose damping makes the restitution.
Work ball(double step) {
  const double rate = std::numbers::pi / (20 * step), log_e = std::log(kRestitution);
  const double damping = -log_e / std::sqrt(std::numbers::pi * std::numbers::pi + log_e * log_e);
  Simulation sim(fmt::format(
      "<mujoco><option timestep=\"{}\" gravity=\"0 0 -{}\" solver=\"Newton\" integrator=\"RK4\"/>"
      "<default><geom condim=\"1\" solref=\"-{} -{}\" solimp=\"0.999 0.999 0.001 0.5 2\"/></default>"
      "<worldbody><geom type=\"plane\" size=\"5 5 0.1\"/>"
      "<body pos=\"0 0 0.05\"><joint type=\"slide\" axis=\"0 0 1\"/><geom type=\"sphere\" size=\"0.05\" "
      "mass=\"0.5\"/>"
      "</body></worldbody></mujoco>",
      step, kBallGravity, rate * rate, 2 * damping * rate));
  const int steps = static_cast<int>(std::lround(kBallTime / step));
  double seconds = 1e300;
  for (int k = 0; k < 2; ++k) {
    mj_resetData(&sim.model(), &sim.data());
    sim.data().qpos[0] = 1;
    const double begin = thread_seconds();
    for (int i = 0; i < steps; ++i) sim.step();
    seconds = std::min(seconds, thread_seconds() - begin);
  }
  return {"MuJoCo", fmt::format("{:g} ms, damped spring, RK4", 1e3 * step), "bounce",
          std::abs(sim.data().qpos[0] - ball_height()), seconds / kBallTime};
}

}  // namespace

std::vector<Work> run_mujoco() {
  std::vector<Work> out;
  for (const double step : {2e-3, 5e-4, 1e-4, 2e-5}) {
    const std::string ms = fmt::format("{:g} ms", 1e3 * step);
    const std::string hard = fmt::format("solref=\"{} 1\" solimp=\"0.99 0.9999 0.0001 0.5 2\"", 2 * step);
    const std::vector<Setting> settings{
        {ms + ", defaults", step, 0.15, "", ""},
        {ms + ", hard, impratio 100", step, 100 * step,
         "impratio=\"100\" tolerance=\"1e-12\" iterations=\"100\"", hard},
        {ms + ", hard, no-slip solver", step, 100 * step,
         "impratio=\"10\" noslip_iterations=\"50\" noslip_tolerance=\"1e-12\" tolerance=\"1e-12\"", hard}};
    for (const auto& setting : settings)
      for (const Truth& truth : truths()) out.push_back(disc(setting, truth));
    out.push_back(ball(step));
  }
  return out;
}

}  // namespace unhand::bench
