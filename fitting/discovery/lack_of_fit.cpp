#include "fitting/discovery/lack_of_fit.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <random>

namespace unhand::fitting {

namespace {

/// Errors of one condition, and Σ|e|².
struct Repeated {
  std::vector<std::array<double, 2>> error;
  double squares{};

  /// n |mean|²/Σ|e|², each error with the sign that `signs` has for it.
  template <class Signs>
  double agreement(Signs&& signs) const {
    if (!(squares > 0)) return 0;
    double x = 0, z = 0;
    for (const auto& e : error) {
      const double sign = signs();
      x += sign * e[0], z += sign * e[1];
    }
    return (x * x + z * z) / (static_cast<double>(error.size()) * squares);
  }
};

/// Fair coins, 64 to a draw.
class SignTurns {
 public:
  double operator()() {
    if (left_ == 0) bits_ = random_(), left_ = 64;
    const double out = (bits_ & 1U) ? 1 : -1;
    bits_ >>= 1U, --left_;
    return out;
  }

 private:
  std::mt19937_64 random_{1};
  std::uint64_t bits_{};
  int left_{};
};

double chance_of(const std::map<int, Repeated>& conditions) {
  const auto agreement = [&](auto& signs) {
    double sum = 0;
    for (const auto& [id, c] : conditions) sum += c.agreement(signs);
    return sum;
  };
  const auto as_they_are = [] { return 1.0; };
  const double seen = agreement(as_they_are);
  constexpr int kDraws = 20000;
  constexpr double kRounding = 1e-12;
  SignTurns coins;
  int as_much = 1;  // what was seen is one of the draws
  for (int draw = 0; draw < kDraws; ++draw) as_much += agreement(coins) >= seen - kRounding ? 1 : 0;
  return static_cast<double>(as_much) / (kDraws + 1);
}

}  // namespace

LackOfFit lack_of_fit(const std::vector<std::array<double, 2>>& error, const std::vector<int>& condition) {
  std::map<int, Repeated> conditions;
  double squares = 0, of_means = 0;
  for (std::size_t i = 0; i < error.size(); ++i) {
    const double square = error[i][0] * error[i][0] + error[i][1] * error[i][1];
    Repeated& c = conditions[condition[i]];
    c.error.push_back(error[i]);
    c.squares += square;
    squares += square;
  }
  const auto n = static_cast<double>(error.size()), k = static_cast<double>(conditions.size());
  if (n - k < 2) return {};
  for (const auto& [id, c] : conditions) of_means += c.squares * c.agreement([] { return 1.0; });
  LackOfFit out;
  out.repetitions = std::max(0.0, squares - of_means) / (n - k);
  if (!(out.repetitions > 0)) return {};
  out.shared = std::max(0.0, squares / n - out.repetitions);
  out.p_value = chance_of(conditions);
  return out;
}

}  // namespace unhand::fitting
