#include "dynamics/steppers.hpp"

#include <stdexcept>

#include "dynamics/dormand_prince.hpp"
#include "dynamics/paced_stepper.hpp"
#include "dynamics/radau.hpp"
#include "dynamics/switching_stepper.hpp"

namespace unhand::dynamics {
namespace {

template <class S, int N>
std::unique_ptr<Stepper<S, N>> make_stepper(Method method, FlowKind kind, const Tolerances& tolerances) {
  if (method == Method::dormand_prince) return std::make_unique<DormandPrince<S, N>>(tolerances);
  if (method == Method::radau) return std::make_unique<Radau<S, N>>(tolerances);
  if constexpr (std::is_same_v<S, double>) {
    if (method == Method::automatic) return std::make_unique<SwitchingStepper<N>>(tolerances);
    if (method == Method::rosenbrock) return std::make_unique<Rosenbrock<N>>(tolerances);
    return make_cvode_stepper<N>(tolerances, kind);
  }
  throw std::invalid_argument(
      "integrate: methods rosenbrock and cvode have no derivatives; use automatic with Dual");
}

}  // namespace

template <class S, int N>
Stepper<S, N>& Steppers<S, N>::of(FlowKind kind, bool paced) {
  if (kind == FlowKind::frozen) return frozen_;
  auto& stepper = made_[static_cast<int>(kind)][paced];
  if (!stepper) {
    if constexpr (N + 2 <= kDualSize) {
      if (paced) {
        stepper = std::make_unique<PacedStepper<S, N>>(
            make_stepper<S, N + 1>(method(kind), kind, options_.tolerances));
        return *stepper;
      }
    }
    stepper = make_stepper<S, N>(method(kind), kind, options_.tolerances);
  }
  return *stepper;
}

template <class S, int N>
void Steppers<S, N>::count(IntegratorStatistics& statistics) const {
  for (const auto& row : made_)
    for (const auto& stepper : row) {
      if (!stepper) continue;
      statistics.flow_evaluations += stepper->flow_evaluations();
      statistics.rejected_steps += stepper->rejected_steps();
    }
}

template <class S, int N>
Method Steppers<S, N>::method(FlowKind kind) const {
  if (options_.method != Method::automatic) return options_.method;
  if (kind == FlowKind::smooth) return Method::dormand_prince;
  if (kind == FlowKind::mixed && std::is_same_v<S, double>) return Method::automatic;
  return std::is_same_v<S, double> ? Method::rosenbrock : Method::radau;
}

template class Steppers<double, 2>;
template class Steppers<double, 6>;
template class Steppers<double, 7>;
template class Steppers<Dual, 2>;
template class Steppers<Dual, 6>;
template class Steppers<Dual, 7>;

}  // namespace unhand::dynamics
