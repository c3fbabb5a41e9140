// The throw whose landings miss least, whatever the release turns out to be.
#pragma once

#include <string>
#include <vector>

#include "planners/tube/release_throw.hpp"

namespace unhand::planners {

/// A throw that depends little on what is not known.
struct InsensitiveResult {
  ThrowState start;          ///< q̇₀ as chosen
  JointVector<double> qdd;   ///< q̈ as chosen [rad/s²]
  double before{}, after{};  ///< root mean square miss over the unknowns' spread [m]
  int iterations{};          ///< taken
  /// The unknown of which a draw within its spread does not land; then nothing was minimised. Empty: none.
  std::string lost{};
};

/// Chooses q̇₀ and q̈ of `joints`, those that move in the plane (1 to 4, each once), so that landings miss
/// least over the card's and the grasp's uncertainty: minimises
///
///   E[x²] ≈ 1/(2 p) Σ_k (x(θ ± √p σ_k e_k; q̇₀, q̈))²,   k = 1 … p
///
/// by Levenberg-Marquardt. The rule is exact where x² is a cubic of the p unknowns, so for a landing that is
/// linear in them; of curvature it knows only roughly: of x = (θ_k/σ_k)² it makes p where 3 is true, of x =
/// θ_i θ_j nothing. The derivatives by q̇₀ and q̈ pass exactly through hand, release with its events, and
/// flight, and each of at most fifteen steps is a quadratic program within 98 % of the limits of q̇₀,
/// q̇₀ + hold q̈ and q̈. Throws std::invalid_argument as validate() does, and for other joints.
InsensitiveResult make_insensitive(const ReleaseThrow& problem, const std::vector<int>& joints);

}  // namespace unhand::planners
