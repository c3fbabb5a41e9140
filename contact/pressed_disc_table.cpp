#include "contact/pressed_disc_table.hpp"

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

namespace unhand::contact {
namespace {

using std::numbers::pi;

constexpr int kOrder = PressedSeries::kOrder, kExponents = 24;
constexpr double kLow = -0.4, kHigh = 3.0;  // s

/// The complete integrals K and D = (K − E)/k², from the arithmetic-geometric mean. `rest` = 1 − k² > 0.
struct Elliptic {
  double k, d;
};
Elliptic elliptic(double m, double rest) {
  double a = 1, g = std::sqrt(rest), sum = 0.5 * m, power = 0.5;
  for (int i = 0; i < 12 && std::abs(a - g) > 1e-17 * a; ++i) {
    const double c = 0.5 * (a - g), mean = 0.5 * (a + g);
    g = std::sqrt(a * g);
    a = mean;
    power *= 2;
    sum += power * c * c;
  }
  const double k = pi / (2 * a);
  return {k, m > 0 ? k * sum / m : 0.25 * pi};
}

/// Nodes of the tanh-sinh rule on (0, 1): distances from both ends, and weights.
struct Node {
  double left, right, weight;
};
const std::vector<Node>& nodes() {
  static const std::vector<Node> all = [] {
    std::vector<Node> out;
    constexpr double h = 1.0 / 20;
    for (int i = -74; i <= 74; ++i) {  // to 1e-27 from the ends: (1 − x)^(1 + s) is below 1e-16 there
      const double t = h * i, e = std::exp(pi * std::sinh(t));
      out.push_back({e / (1 + e), 1 / (1 + e), h * pi * std::cosh(t) * e / ((1 + e) * (1 + e))});
    }
    return out;
  }();
  return all;
}

/// A ring of the disc: 1 − x = `rim`, and its share of {F, F_ε or Φ′, T or Ψ} without the pressure.
struct Ring {
  double rim;
  PressedProfile share;
};

/// `rest` = 1 − m.
std::vector<Ring> rings(bool inner, double m, double rest) {
  std::vector<Ring> out;
  const double e = std::sqrt(m);
  for (const auto& [left, right, weight] : nodes()) {
    const double w = weight * 2 / pi;
    if (!inner) {
      const double x = left, square = x * m;
      const auto [K, D] = elliptic(square, rest + m * right);
      out.push_back({right, {w * (K - square * D), -0.5 * w * x * D, w * x * (K - D)}});
      continue;
    }
    {  // x < m: the ring is slower than the patch slides
      const double x = m * left, square = left;
      const auto [K, D] = elliptic(square, right);
      const double v = m * w;
      out.push_back({rest + m * right, {v * (K - square * D), v * x / (e * m) * D, v * x / e * (K - D)}});
    }
    {
      const double x = m + rest * left, square = m / x, root = std::sqrt(x);
      const auto [K, D] = elliptic(square, rest * left / x);
      const double v = rest * w;
      out.push_back({rest * right, {v * e / root * (K - D), v / root * D, v * root * (K - square * D)}});
    }
  }
  return out;
}

PressedProfile pressed(const std::vector<Ring>& all, bool inner, double m, double s) {
  PressedProfile sum{};
  for (const Ring& ring : all) {
    const double pressure = (s + 1) * std::pow(ring.rim, s);
    for (int k = 0; k < 3; ++k) sum[k] += pressure * ring.share[k];
  }
  if (inner) {  // F, F_ε → Φ, Φ′
    sum[0] /= std::sqrt(m);
    sum[1] = 0.5 * (sum[1] - sum[0]) / m;
  }
  return sum;
}

double chebyshev_node(int i, int n) { return std::cos(pi * (i + 0.5) / n); }
double chebyshev(int j, double x) { return std::cos(j * std::acos(x)); }

/// Coefficients of s by coefficients of (1 − m)^(1/4).
struct Table {
  std::array<PressedSeries, kExponents> by_exponent;
};

Table make_table() {
  Table values;
  for (const bool inner : {true, false})
    for (int i = 0; i < kOrder; ++i) {
      const double z = 0.5 * (1 + chebyshev_node(i, kOrder)), rest = z * z * z * z, m = 1 - rest;
      const auto all = rings(inner, m, rest);
      for (int j = 0; j < kExponents; ++j) {
        const double s = 0.5 * (kLow + kHigh) + 0.5 * (kHigh - kLow) * chebyshev_node(j, kExponents);
        (inner ? values.by_exponent[j].inner : values.by_exponent[j].outer)[i] = pressed(all, inner, m, s);
      }
    }
  // Values at the nodes → coefficients, first in m and then in s.
  std::array<std::array<double, kOrder>, kOrder> in_m;
  for (int n = 0; n < kOrder; ++n)
    for (int i = 0; i < kOrder; ++i)
      in_m[n][i] = (n == 0 ? 1.0 : 2.0) / kOrder * chebyshev(n, chebyshev_node(i, kOrder));
  std::array<PressedSeries, kExponents> half{};
  for (int j = 0; j < kExponents; ++j)
    for (int n = 0; n < kOrder; ++n)
      for (int i = 0; i < kOrder; ++i)
        for (int k = 0; k < 3; ++k) {
          half[j].inner[n][k] += in_m[n][i] * values.by_exponent[j].inner[i][k];
          half[j].outer[n][k] += in_m[n][i] * values.by_exponent[j].outer[i][k];
        }
  Table out{};
  for (int l = 0; l < kExponents; ++l)
    for (int j = 0; j < kExponents; ++j) {
      const double c = (l == 0 ? 1.0 : 2.0) / kExponents * chebyshev(l, chebyshev_node(j, kExponents));
      for (int n = 0; n < kOrder; ++n)
        for (int k = 0; k < 3; ++k) {
          out.by_exponent[l].inner[n][k] += c * half[j].inner[n][k];
          out.by_exponent[l].outer[n][k] += c * half[j].outer[n][k];
        }
    }
  return out;
}

}  // namespace

PressedProfile pressed_profile_exact(bool inner, double m, double s) {
  return pressed(rings(inner, m, 1 - m), inner, m, s);
}

PressedSeriesAt pressed_series(double s) {
  static const std::unique_ptr<const Table> table = std::make_unique<const Table>(make_table());
  const double scale = 2 / (kHigh - kLow), x = scale * (s - 0.5 * (kLow + kHigh));
  PressedSeriesAt out{};
  double t = 1, t_next = x, u = 0, u_next = 1;  // T_l, T_{l+1}, U_{l−1}, U_l
  for (int l = 0; l < kExponents; ++l) {
    const double slope = scale * l * u;  // dT_l/ds = l U_{l−1}
    const PressedSeries& row = table->by_exponent[l];
    for (int n = 0; n < kOrder; ++n)
      for (int k = 0; k < 3; ++k) {
        out.value.inner[n][k] += t * row.inner[n][k];
        out.value.outer[n][k] += t * row.outer[n][k];
        out.by_exponent.inner[n][k] += slope * row.inner[n][k];
        out.by_exponent.outer[n][k] += slope * row.outer[n][k];
      }
    const double t_after = 2 * x * t_next - t, u_after = 2 * x * u_next - u;
    t = t_next, t_next = t_after;
    u = u_next, u_next = u_after;
  }
  return out;
}

PressedProfile evaluate(const std::array<PressedProfile, kOrder>& series, double m) {
  const double z = m < 1 ? std::sqrt(std::sqrt(1 - m)) : 0.0, y = 2 * (2 * z - 1);
  PressedProfile b1{}, b2{};
  for (int n = kOrder - 1; n > 0; --n)
    for (int k = 0; k < 3; ++k) {
      const double b = series[n][k] + y * b1[k] - b2[k];
      b2[k] = b1[k];
      b1[k] = b;
    }
  PressedProfile out;
  for (int k = 0; k < 3; ++k) out[k] = series[0][k] + 0.5 * y * b1[k] - b2[k];
  return out;
}

}  // namespace unhand::contact
