// Structure in a residual: is it noise, and if not, what does it depend on? Knows nothing of throws.
#pragma once

#include <string>
#include <vector>

namespace unhand::fitting {

/// Residuals in units of their noise, with what they may depend on. The samples of a series follow each other
/// in time; all vectors have the length of `value`.
struct ResidualSamples {
  std::vector<double> value;   ///< [σ]
  std::vector<double> time;    ///< within the series [s]
  std::vector<int> series;     ///< which recording the sample is from: its place in the log
  std::vector<int> condition;  ///< recordings that repeat one experiment share it
  /// Something that the residual may depend on.
  struct State {
    std::string name;           ///< "speed"
    std::vector<double> value;  ///< one per sample; NaN where it is unknown
  };
  std::vector<State> states;  ///< what the residual may depend on
};

/// How much of a residual goes with something.
struct Dependence {
  std::string on;     ///< "condition", "order in the log", "time", or the state's name
  double share{};     ///< of the residual's mean square that the group means explain, beyond what noise would
  double p_value{1};  ///< of the F test of the group means against the scatter within groups
};

/// What every recording shares: a residual that is off by the same everywhere.
struct SharedOffset {
  double mean{};      ///< of all samples [σ]
  double share{};     ///< of the residual's mean square that it is, beyond what chance would make it
  double p_value{1};  ///< of none, by Student's t test of the recordings' means
};

/// What the tests say of one residual.
struct ResidualStructure {
  int n{};                      ///< samples
  double chi2_per_sample{};     ///< 1 is the noise
  double chi2_p_value{1};       ///< of a mean square as large, were the residual white noise of unit variance
  double autocorrelation{};     ///< of neighbours within a series
  double autocorrelation_p{1};  ///< two-sided, against 0 ± 1/√pairs
  SharedOffset offset;          ///< of all recordings
  std::vector<Dependence> depends;  ///< most significant first

  /// The smallest of all p-values, times how many there are.
  double p_value() const;
  /// In words: "1.9 times the noise, neighbours correlate by 0.8; 60 % of it is an offset of -0.9 sigma,
  /// predicted minus measured; goes with speed (11 %), condition (8 %)".
  std::string in_words() const;
};

/// Groups of the analyses, and what is named in words.
struct StructureOptions {
  int groups{10};      ///< of equal count, for time and states
  double share{0.05};  ///< least share for a dependence to be named in words
  double level{0.01};  ///< and the most that its p-value may be
};

/// Tests: χ² of the whole; the lag-one autocorrelation within series; Student's t of an offset that the
/// series share; one-way analyses of variance over conditions (with the mean of a series as its one witness,
/// as throws differ as wholes) and over groups of equal count in time and in every state (with the mean of a
/// series' samples in a group as one, as neighbours may err alike); a straight line of
/// the series' means over their number, beside means of the conditions.
ResidualStructure find_structure(const ResidualSamples& samples, const StructureOptions& options = {});

}  // namespace unhand::fitting
