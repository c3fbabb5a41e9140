#include "dynamics/steppers.hpp"

#include <stdexcept>

#include "dynamics/directed_stepper.hpp"
#include "dynamics/dormand_prince.hpp"
#include "dynamics/paced_stepper.hpp"
#include "dynamics/radau.hpp"
#include "dynamics/switching_stepper.hpp"
#include "dynamics/tangent_stepper.hpp"

namespace unhand::dynamics {
namespace {

template <int N>
std::unique_ptr<Stepper<double, N>> make_stepper(Method method, FlowKind kind, const Tolerances& tolerances,
                                                 bool seeded) {
  if constexpr (N + 1 > kDualSize) {  // no exact Jacobian in one sweep of dual numbers
    if (method != Method::dormand_prince)
      throw std::invalid_argument(
          "integrate: systems of this size are stepped explicitly only; no method but "
          "dormand_prince, no flow but a smooth one");
    return std::make_unique<DormandPrince<double, N>>(tolerances);
  } else {
    switch (method) {
      case Method::dormand_prince:
        return std::make_unique<DormandPrince<double, N>>(tolerances);
      case Method::rosenbrock:
        return std::make_unique<Rosenbrock<N>>(tolerances, seeded);
      case Method::radau:
        return std::make_unique<Radau<N>>(tolerances, seeded);
      case Method::cvode:
        if (seeded)
          throw std::invalid_argument("integrate: method cvode has no derivatives; use automatic with Dual");
        return make_cvode_stepper<N>(tolerances, kind);
      case Method::automatic:
        return std::make_unique<SwitchingStepper<N>>(tolerances, seeded, kind);
    }
    throw std::invalid_argument("integrate: unknown method");
  }
}

/// The values, in time or in the pace of the flow.
template <int N>
std::unique_ptr<Stepper<double, N>> make_stepper(Method method, FlowKind kind, const Tolerances& tolerances,
                                                 bool seeded, bool paced) {
  if constexpr (N + 2 <= kDualSize)
    if (paced) {
      auto in_pace = std::make_unique<PacedStepper<N>>(make_stepper<N + 1>(method, kind, tolerances, seeded));
      if (method != Method::automatic || kind != FlowKind::stiff) return in_pace;
      return std::make_unique<DirectedStepper<N>>(tolerances, std::move(in_pace));
    }
  return make_stepper<N>(method, kind, tolerances, seeded);
}

}  // namespace

template <class S, int N>
Stepper<S, N>& Steppers<S, N>::of(FlowKind kind, bool paced) {
  if (kind == FlowKind::frozen) return frozen_;
  auto& stepper = made_[static_cast<int>(kind)][paced];
  if (stepper) return *stepper;
  const Method how = method(kind);
  constexpr bool seeded = !std::is_same_v<S, double>;
  if constexpr (seeded) {
    if (how == Method::dormand_prince && !paced)
      stepper = std::make_unique<DormandPrince<S, N>>(options_.tolerances);
    else
      stepper =
          std::make_unique<TangentStepper<N>>(make_stepper<N>(how, kind, options_.tolerances, seeded, paced));
  } else {
    stepper = make_stepper<N>(how, kind, options_.tolerances, seeded, paced);
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
  return Method::automatic;
}

template class Steppers<double, 2>;
template class Steppers<double, 6>;
template class Steppers<double, 7>;
template class Steppers<double, 10>;
template class Steppers<Dual, 2>;
template class Steppers<Dual, 6>;
template class Steppers<Dual, 7>;

}  // namespace unhand::dynamics
