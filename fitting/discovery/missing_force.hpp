// What is missing in a motion or a wrench, estimated without assuming a form, and a readable candidate for
// it. Knows nothing of throws: plain series in, findings out.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/effect.hpp"

namespace unhand::fitting {

/// One recording: what was seen minus what was predicted, and the predicted state beside it. Three components
/// (x, z, θ); NaN where nothing was seen.
struct ResidualTrace {
  int group{};               ///< recordings of a group share what is missing: an object, say
  std::vector<double> time;  ///< increasing [s]
  std::array<std::vector<double>, 3> residual;  ///< x, z, θ: m, m, rad, or N, N, N m
  std::array<std::vector<double>, 3> sigma;     ///< 1 σ of each residual, > 0 where one was seen
  /// The predicted motion at a sample, and the normal force of a pad.
  struct State {
    double vx{}, vz{}, omega{}, theta{};  ///< m/s, m/s, rad/s, rad
    double normal_force{};                ///< [N]
  };
  std::vector<State> state;  ///< one per time
};

/// A piecewise-linear function of time, shared by the traces of a group.
struct MissingCurve {
  int group{};                                      ///< of the traces that share it
  std::vector<double> knots;                        ///< [s]
  std::array<std::vector<double>, 3> value, sigma;  ///< at the knots
  double chi2_before{}, chi2_after{};               ///< of the residual around it
  /// By linear interpolation, level beyond the ends.
  std::array<double, 3> at(double time) const;
};

/// How the residual follows from what is missing: as it is (a wrench), or integrated twice over time (an
/// acceleration that moves a position, whose start and velocity are each recording's own).
enum class Response {
  direct,            ///< as it is: a wrench
  twice_integrated,  ///< over time: an acceleration
};

/// How the estimate is made.
struct MissingOptions {
  Response response{Response::direct};  ///< of the residual to what is missing
  int knots{7};                         ///< per curve
  int terms{2};                         ///< most that a candidate may have
};

/// Least squares, one curve per group; each recording's own offset and slope are projected out where the
/// response is integrated. A weak smoothness prior decides what the data do not.
std::vector<MissingCurve> missing_curves(const std::vector<ResidualTrace>& traces,
                                         const MissingOptions& options);

/// A coefficient of a term.
struct MissingSize {
  std::optional<int> group;  ///< of which traces; of all, where they do not differ
  double value{}, sigma{};   ///< in the term's unit; 1 σ
};

/// A physical term and its size.
struct MissingTerm {
  std::string name;                ///< "|v| v", "omega J v", "1 (x)", ...
  std::vector<MissingSize> sizes;  ///< one, or one of every group
  std::string unit;                ///< of the coefficients
  std::function<std::array<double, 3>(const ResidualTrace::State&)> shape;  ///< of coefficient one
  dynamics::AccelerationForm form{dynamics::AccelerationForm::none};        ///< of an acceleration
  /// In a group; zero in one that was not seen.
  double coefficient(int group) const;
};

/// The few terms that explain most.
struct MissingCandidate {
  std::vector<MissingTerm> terms;  ///< strongest first
  double explained{};              ///< share of the residual's χ² beyond noise that they take away
  /// The missing quantity in a state; zero without terms.
  std::array<double, 3> at(const ResidualTrace::State& state, int group) const;
  /// How many sizes its terms have.
  std::size_t coefficients() const;
  /// The terms with their sizes, for reports; `names` of groups, where these differ.
  std::string in_words(const std::map<int, std::string>& names) const;
};

/// Sparse regression: of every number of terms up to `terms` those that explain most; one more while it
/// lowers χ² by more than 2 log n for every coefficient and by a fifth of what exceeds the noise. (Adding to
/// the best smaller set would miss pairs that stand for a third term together.) A term has one coefficient,
/// or one for every group where that is worth them: bodies differ in what the air does to them, not in
/// gravity. Accelerations: v, |v| v, |v|² v, ω J v, a constant
/// along x or z, one and ω² along each of the object's axes (a reference point off the CoM), and for the
/// rotation a constant, ω, |ω| ω, sin θ and cos θ. Wrenches: a constant, f_N, and f_N² of each component, and
/// |v| and ω for their dependence on the motion.
MissingCandidate missing_terms(const std::vector<ResidualTrace>& traces, const MissingOptions& options);

/// χ² of the traces around what a candidate says, each recording's own offset and slope projected out where
/// the response is integrated.
struct Rest {
  double chi2{};              ///< sum over all components
  long degrees_of_freedom{};  ///< samples that were seen, less the offsets and slopes
};
/// What the candidate leaves; of one without terms, what there is.
Rest rest_around(const std::vector<ResidualTrace>& traces, const MissingCandidate& candidate,
                 const MissingOptions& options);

}  // namespace unhand::fitting
