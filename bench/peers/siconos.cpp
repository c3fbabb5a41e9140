// Siconos: Moreau-Jean time stepping of a rigid contact, friction as a cone complementarity problem.
#include <SolverOptions.h>
#include <FrictionContact.hpp>
#include <Interaction.hpp>
#include <LCP.hpp>
#include <LagrangianLinearTIDS.hpp>
#include <LagrangianLinearTIR.hpp>
#include <MoreauJeanOSI.hpp>
#include <NewtonImpactFrictionNSL.hpp>
#include <NewtonImpactNSL.hpp>
#include <NonSmoothDynamicalSystem.hpp>
#include <SiconosVector.hpp>
#include <SimpleMatrix.hpp>
#include <TimeDiscretisation.hpp>
#include <TimeStepping.hpp>
#include <memory>

#include <fmt/core.h>

#include "bench/peers/truths.hpp"

namespace unhand::bench {
namespace {

struct Setting {
  std::string words;
  double theta{};      ///< of the θ method: 1/2 is of second order between events
  double tolerance{};  ///< of the contact's solver
};

/// Coordinates q with a diagonal mass, a force and one contact whose velocities are the rows of H q̇, the
/// normal one first.
class Simulation {
 public:
  Simulation(const std::vector<double>& q, const std::vector<double>& v, const std::vector<double>& mass,
             const std::vector<double>& rows, SP::NonSmoothLaw law, SP::OneStepNSProblem problem,
             double theta, double step)
      : force_(std::make_shared<SiconosVector>(q.size())) {
    body_ = std::make_shared<LagrangianLinearTIDS>(std::make_shared<SiconosVector>(q),
                                                   std::make_shared<SiconosVector>(v), diagonal(mass));
    body_->setFExtPtr(force_);
    auto contact = std::make_shared<Interaction>(law, std::make_shared<LagrangianLinearTIR>(diagonal(rows)));
    auto system = std::make_shared<NonSmoothDynamicalSystem>(0.0, 10.0);
    system->insertDynamicalSystem(body_);
    system->link(contact, body_);
    stepping_ = std::make_shared<TimeStepping>(system, std::make_shared<TimeDiscretisation>(0.0, step),
                                               std::make_shared<MoreauJeanOSI>(theta), problem);
    stepping_->setNewtonOptions(SICONOS_TS_LINEAR);
    stepping_->initialize();
  }
  SiconosVector& force() { return *force_; }
  double position(unsigned int i) const { return (*body_->q())(i); }
  void step() {
    stepping_->computeOneStep();
    stepping_->nextStep();
  }

 private:
  static std::shared_ptr<SimpleMatrix> diagonal(const std::vector<double>& values) {
    const auto n = static_cast<unsigned int>(values.size());
    auto out = std::make_shared<SimpleMatrix>(n, n);
    out->zero();
    for (unsigned int i = 0; i < n; ++i) (*out)(i, i) = values[i];
    return out;
  }

  std::shared_ptr<SiconosVector> force_;
  std::shared_ptr<LagrangianLinearTIDS> body_;
  std::shared_ptr<TimeStepping> stepping_;
};

/// ∫ of the push from 0 to t [m/s].
double pushed(const Truth& truth, double t) {
  double sum = 0, begin = 0;
  for (const auto& [until, along] : truth.pushes) {
    sum += along * std::max(0.0, std::min(t, until) - begin);
    begin = until;
  }
  return sum;
}

/// Height, position and angle; the contact's tangential velocities are ẋ and L θ̇, so that Coulomb's cone is
/// the limit surface |(f, τ/L)| <= μN.
Work disc(const Setting& setting, const std::string& engine, int steps, const Truth& truth) {
  const double step = truth.end / steps;
  double position = 0, angle = 0, best = 1e300;
  for (int k = 0; k < 2 && (k == 0 || best < 0.01); ++k) {
    auto law = std::make_shared<NewtonImpactFrictionNSL>(0.0, 0.0, kMu, 3);
    auto problem = std::make_shared<FrictionContact>(3);
    auto& options = *problem->numericsSolverOptions();
    options.dparam[SICONOS_DPARAM_TOL] = setting.tolerance;
    options.iparam[SICONOS_IPARAM_MAX_ITER] = 1000;
    Simulation sim({0, 0, 0}, {0, truth.slide, truth.spin}, {kMass, kMass, kInertia}, {1, 1, kLength}, law,
                   problem, setting.theta, step);
    const double begin = thread_seconds();
    for (int i = 0; i < steps; ++i) {
      // the mean over the step, so that what is applied in all is exact
      sim.force()(0) = -kNormal * (truth.releases ? 1 - (i + 0.5) / steps : 1.0);
      sim.force()(1) = kMass * (pushed(truth, (i + 1) * step) - pushed(truth, i * step)) / step;
      sim.step();
    }
    best = std::min(best, thread_seconds() - begin);
    position = sim.position(1), angle = sim.position(2);
  }
  return {engine, fmt::format("{:.3g} ms, {}", 1e3 * step, setting.words), truth.name,
          error_of(truth, position, angle), best / truth.end};
}

/// Newton's law of impact, a linear complementarity problem at each step.
Work ball(int steps) {
  const double step = kBallTime / steps;
  double height = 0, best = 1e300;
  for (int k = 0; k < 2; ++k) {
    Simulation sim({1}, {0}, {1}, {1}, std::make_shared<NewtonImpactNSL>(kRestitution),
                   std::make_shared<LCP>(), 0.5, step);
    sim.force()(0) = -kBallGravity;
    const double begin = thread_seconds();
    for (int i = 0; i < steps; ++i) sim.step();
    best = std::min(best, thread_seconds() - begin);
    height = sim.position(0);
  }
  return {"Siconos", fmt::format("{:g} ms, θ 1/2", 1e3 * step), "bounce", std::abs(height - ball_height()),
          best / kBallTime};
}

}  // namespace

std::vector<Work> run_siconos() {
  const std::vector<Setting> settings{{"θ 1/2, solver 1e-4", 0.5, 1e-4},
                                      {"θ 1/2, solver 1e-12", 0.5, 1e-12},
                                      {"θ 1, solver 1e-12", 1, 1e-12}};
  std::vector<Work> out;
  for (const double step : {1e-2, 1e-3, 1e-4, 2e-5}) {
    for (const auto& setting : settings)
      for (const Truth& truth : truths()) {
        // All events of these truths are at sixteenths of their ends: on a step if sixteen divides the number
        // of steps, between two if it is odd.
        const int steps = 16 * static_cast<int>(std::max(1L, std::lround(truth.end / step / 16)));
        out.push_back(disc(setting, "Siconos in step", steps, truth));
        out.push_back(disc(setting, "Siconos", steps + 1, truth));
      }
    out.push_back(ball(static_cast<int>(std::lround(kBallTime / step))));
  }
  return out;
}

}  // namespace unhand::bench
