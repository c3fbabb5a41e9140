// What the loop says of an effect that it accepted, or accepted at first.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "fitting/discovery/residuals.hpp"
#include "fitting/distributions.hpp"

namespace unhand::fitting {

/// A parameter of an accepted effect.
struct Parameter {
  std::string name, unit;   ///< without the effect's id, with "[object]" where every object has its own
  double value{}, sigma{};  ///< in `unit`; 1 σ
  double degrees_of_freedom{kCertain};  ///< of sigma, which comes from the scatter between throws
  /// value ± t sigma, Student's t.
  std::array<double, 2> interval95() const { return student_interval(value, sigma, degrees_of_freedom); }
};

/// An effect's parameters as a fit has them.
std::vector<Parameter> parameters_of(const FitResult& fit, const dynamics::Effect& effect);

/// An experiment that would tell an accepted effect from another name of its footprint.
struct SeparatingExperiment {
  std::string from;          ///< the other name
  std::string what;          ///< to do, in words
  double before{}, after{};  ///< correlation of the footprints: in this log; with the experiment's throws
  bool separates{};          ///< they would then be two answers (DiscoverOptions::equivalent)
};

/// An effect that the data made believable.
struct AcceptedEffect {
  std::string id;                                          ///< of the effect, or "contact.law:MODEL"
  std::vector<std::pair<std::string, double>> equivalent;  ///< ids, with the correlation of the footprints
  std::vector<SeparatingExperiment> separating;            ///< the most telling first, for each other name
  std::vector<Parameter> parameters;                       ///< as fitted
  double delta_bic{};             ///< of the model with it against without: negative speaks for it
  std::optional<double> p_value;  ///< of its absence; none for a law, which replaces another
  /// Held-out error with it over without [-]; none where one of them is not known.
  std::optional<double> test_error_ratio;
  std::string why;  ///< where the held-out misfit fell, in words
  Phase phase{};    ///< where it fell most

  /// Another name that the data cannot tell from this one; of several correlations the largest counts.
  void add_other_name(const std::string& other, double correlation);
};

/// Whether an effect is one of them.
bool is_accepted(const std::string& id, std::span<const AcceptedEffect> effects);

/// Terms that describe tracked flights, and where they do so better than accepted effects of the air.
struct AskedForm {
  std::vector<std::string> outdone;  ///< effects none of whose own forms is among the terms
  std::string words;                 ///< the terms with their sizes, of each object; empty: none
  bool unlisted{};                   ///< a term is no accepted effect's own form
  /// Accepted effects whose own forms are among the terms: they act, whatever acts beside them.
  std::vector<std::string> backed;
};

/// An effect that was accepted at first, and withdrawn (withdrawal.hpp).
struct Imitation {
  std::string id;      ///< of the effect
  std::string why;     ///< it was withdrawn, in words
  double delta_bic{};  ///< with it against without, when it was
};

}  // namespace unhand::fitting
