#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include <exception>
#include <stdexcept>
#include <string>

#include "dynamics/jacobian.hpp"
#include "dynamics/stepper.hpp"

namespace unhand::dynamics {
namespace {

template <int N>
class CvodeStepper final : public Stepper<double, N> {
 public:
  CvodeStepper(const Tolerances& tolerances, FlowKind kind) : tolerances_(tolerances) {
    check(SUNContext_Create(nullptr, &context_), "SUNContext_Create");
    vector_ = N_VNew_Serial(N, context_);
    scratch_ = N_VNew_Serial(N, context_);
    memory_ = CVodeCreate(kind == FlowKind::smooth ? CV_ADAMS : CV_BDF, context_);
    if (vector_ == nullptr || scratch_ == nullptr || memory_ == nullptr)
      throw std::runtime_error("CVODE: out of memory");
    check(CVodeInit(memory_, &CvodeStepper::call_flow, 0.0, vector_), "CVodeInit");
    check(CVodeSetErrHandlerFn(memory_, &CvodeStepper::ignore_messages, nullptr), "CVodeSetErrHandlerFn");
    check(CVodeWFtolerances(memory_, &CvodeStepper::call_weights), "CVodeWFtolerances");
    check(CVodeSetUserData(memory_, this), "CVodeSetUserData");
    check(CVodeSetMaxConvFails(memory_, 50), "CVodeSetMaxConvFails");
    matrix_ = SUNDenseMatrix(N, N, context_);
    solver_ = SUNLinSol_Dense(vector_, matrix_, context_);
    check(CVodeSetLinearSolver(memory_, solver_, matrix_), "CVodeSetLinearSolver");
    if constexpr (N + 1 <= kDualSize)
      check(CVodeSetJacFn(memory_, &CvodeStepper::call_jacobian), "CVodeSetJacFn");
  }

  ~CvodeStepper() override {
    CVodeFree(&memory_);
    SUNLinSolFree(solver_);
    SUNMatDestroy(matrix_);
    N_VDestroy(scratch_);
    N_VDestroy(vector_);
    SUNContext_Free(&context_);
  }
  CvodeStepper(const CvodeStepper&) = delete;
  CvodeStepper& operator=(const CvodeStepper&) = delete;

  void start(const HybridSystem<N>& system, const Phase& phase, const double& t,
             const State<double, N>& y) override {
    system_ = &system;
    phase_ = phase;
    this->t1_ = t;
    this->y1_ = y;
    not_finite_ = false;
    for (int i = 0; i < N; ++i) NV_Ith_S(vector_, i) = y[i];
    check(CVodeReInit(memory_, t, vector_), "CVodeReInit");
  }

  StepStatus step(const double& limit, double longest) override {
    this->t0_ = this->t1_;
    this->y0_ = this->y1_;
    check(CVodeSetStopTime(memory_, limit), "CVodeSetStopTime");
    check(CVodeSetMaxStep(memory_, longest), "CVodeSetMaxStep");
    double reached = this->t0_;
    const int status = CVode(memory_, limit, vector_, &reached, CV_ONE_STEP);
    if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
    if (status == CV_TOO_CLOSE) {  // limit and t0 are the same instant to CVODE
      reached = limit;
    } else if (status < 0) {
      return not_finite_ ? StepStatus::not_finite : StepStatus::too_small;
    }
    this->t1_ = reached;
    for (int i = 0; i < N; ++i) {
      this->y1_[i] = NV_Ith_S(vector_, i);
      if (!std::isfinite(this->y1_[i])) return StepStatus::not_finite;
    }
    if (!(reached > this->t0_)) return not_finite_ ? StepStatus::not_finite : StepStatus::too_small;
    if (reached - this->t0_ > 1e3 * shortest_step(reached)) not_finite_ = false;  // got past it
    return StepStatus::accepted;
  }

  void interpolate(double theta, State<double, N>& y) const override {
    at(this->t0_ + theta * (this->t1_ - this->t0_), y);
  }
  /// A multistep method cannot retake a step from its start alone; its interpolant is of the method's own
  /// order.
  void retake(double h, State<double, N>& y) override { at(this->t0_ + h, y); }

 private:
  static void check(int status, const char* call) {
    if (status < 0)
      throw std::runtime_error(std::string("CVODE: ") + call + " returned " + std::to_string(status));
  }
  static void ignore_messages(int, const char*, const char*, char*, void*) {}

  // Exceptions must not cross C frames: they are kept and rethrown by step().
  static int call_flow(double t, N_Vector y, N_Vector dy, void* self_pointer) {
    auto& self = *static_cast<CvodeStepper*>(self_pointer);
    try {
      State<double, N> state, rate;
      for (int i = 0; i < N; ++i) state[i] = NV_Ith_S(y, i);
      ++self.flow_evaluations_;
      self.system_->flow(self.phase_, t, state, rate);
      for (int i = 0; i < N; ++i) {
        if (!std::isfinite(rate[i])) {
          self.not_finite_ = true;
          return 1;
        }
        NV_Ith_S(dy, i) = rate[i];
      }
      return 0;
    } catch (...) {
      self.thrown_ = std::current_exception();
      return -1;
    }
  }

  static int call_weights(N_Vector y, N_Vector weights, void* self_pointer) {
    auto& self = *static_cast<CvodeStepper*>(self_pointer);
    State<double, N> state, scale;
    for (int i = 0; i < N; ++i) state[i] = NV_Ith_S(y, i);
    self.system_->error_scale(self.phase_, self.tolerances_, state, state, scale);
    for (int i = 0; i < N; ++i) {
      if (!(scale[i] > 0)) return -1;
      NV_Ith_S(weights, i) = 1 / scale[i];
    }
    return 0;
  }

  static int call_jacobian(double t, N_Vector y, N_Vector, SUNMatrix matrix, void* self_pointer, N_Vector,
                           N_Vector, N_Vector) {
    if constexpr (N + 1 <= kDualSize) {
      auto& self = *static_cast<CvodeStepper*>(self_pointer);
      try {
        State<double, N> state, f, ft;
        for (int i = 0; i < N; ++i) state[i] = NV_Ith_S(y, i);
        Eigen::Matrix<double, N, N> jacobian;
        flow_jacobian<N>(*self.system_, self.phase_, t, state, f, jacobian, ft);
        for (int i = 0; i < N; ++i)
          for (int j = 0; j < N; ++j) SM_ELEMENT_D(matrix, i, j) = jacobian(i, j);
        self.not_finite_ = self.not_finite_ || !jacobian.allFinite();
        return jacobian.allFinite() ? 0 : 1;
      } catch (...) {
        self.thrown_ = std::current_exception();
        return -1;
      }
    }
    return -1;
  }

  void at(double t, State<double, N>& y) const {
    if (t >= this->t1_) {
      y = this->y1_;
      return;
    }
    if (t <= this->t0_) {
      y = this->y0_;
      return;
    }
    check(CVodeGetDky(memory_, t, 0, scratch_), "CVodeGetDky");
    for (int i = 0; i < N; ++i) y[i] = NV_Ith_S(scratch_, i);
  }

  Tolerances tolerances_;
  SUNContext context_{};
  N_Vector vector_{}, scratch_{};
  void* memory_{};
  SUNMatrix matrix_{};
  SUNLinearSolver solver_{};
  const HybridSystem<N>* system_{};
  Phase phase_;
  std::exception_ptr thrown_;
  bool not_finite_{};  ///< the flow was not finite in an attempt, and no step of some length has succeeded
                       ///< since
};

}  // namespace

template <int N>
std::unique_ptr<Stepper<double, N>> make_cvode_stepper(const Tolerances& tolerances, FlowKind kind) {
  return std::make_unique<CvodeStepper<N>>(tolerances, kind);
}

template std::unique_ptr<Stepper<double, 2>> make_cvode_stepper<2>(const Tolerances&, FlowKind);
template std::unique_ptr<Stepper<double, 3>> make_cvode_stepper<3>(const Tolerances&, FlowKind);
template std::unique_ptr<Stepper<double, 6>> make_cvode_stepper<6>(const Tolerances&, FlowKind);
template std::unique_ptr<Stepper<double, 7>> make_cvode_stepper<7>(const Tolerances&, FlowKind);

}  // namespace unhand::dynamics
