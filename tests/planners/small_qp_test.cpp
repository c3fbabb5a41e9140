// The small quadratic programs: optimality by the KKT conditions, IPOPT, and certificates of infeasibility.
#include "planners/tube/small_qp.hpp"

#include <gtest/gtest.h>

#include <random>
#include <stdexcept>

#include "tests/planners/ipopt_qp.hpp"

namespace unhand::planners {
namespace {

QuadraticProgram random_program(std::mt19937_64& random, bool with_point) {
  std::uniform_int_distribution<int> unknowns(1, 7), rows(0, 20);
  std::normal_distribution<double> normal;
  const int n = unknowns(random), m = rows(random), equalities = std::min(n, m) > 0 ? m % std::min(n, 3) : 0;
  QuadraticProgram p{QpMatrix::Zero(n, n), QpVector(n), {}};
  for (int r = 0; r < n + 1; ++r) {
    QpVector a(n);
    for (int i = 0; i < n; ++i) a[i] = normal(random);
    p.H += a * a.transpose();
  }
  p.H += 0.05 * QpMatrix::Identity(n, n);
  QpVector inside(n);
  for (int i = 0; i < n; ++i) p.c[i] = 5 * normal(random), inside[i] = normal(random);
  for (int k = 0; k < m; ++k) {
    QpConstraint row{QpVector(n), 0, k < equalities};
    for (int i = 0; i < n; ++i) row.a[i] = normal(random);
    row.b =
        with_point ? row.a.dot(inside) - (row.equality ? 0 : std::abs(normal(random))) : 2 * normal(random);
    p.constraints.push_back(row);
  }
  return p;
}

TEST(SmallQp, MeetsTheKktConditions) {
  std::mt19937_64 random(1);
  for (int n = 0; n < 2000; ++n) {
    const auto p = random_program(random, true);
    const auto s = solve(p);
    ASSERT_EQ(s.outcome, QpOutcome::solved) << n;
    double size = 1;
    for (const double lambda : s.multipliers) size = std::max(size, std::abs(lambda));
    EXPECT_LT(kkt_residual(p, s), 1e-8 * size) << n;  // conditions of H up to some 1e4
  }
}

TEST(SmallQp, AgreesWithIpopt) {
  std::mt19937_64 random(2);
  for (int n = 0; n < 60; ++n) {
    const auto p = random_program(random, true);
    const auto own = solve(p);
    const auto other = solve_by_ipopt(p);
    ASSERT_LE(other.status, Ipopt::Solved_To_Acceptable_Level) << n;
    const auto value = [&](const QpVector& x) { return 0.5 * x.dot(p.H * x) + p.c.dot(x); };
    // An interior point of 1e-12 lies sqrt of that from a vertex at worst.
    EXPECT_NEAR(value(own.x), value(other.x), 1e-6 * (1 + std::abs(value(own.x)))) << n;
    EXPECT_LT((own.x - other.x).norm(), 1e-4 * (1 + own.x.norm())) << n;
  }
}

TEST(SmallQp, ClosedForms) {
  // The point of a box nearest to (3, −2): its corner; multipliers are the distances.
  QuadraticProgram p{QpMatrix::Identity(2, 2), QpVector{{-3, 2}}, {}};
  p.constraints = {
      {QpVector{{-1, 0}}, -1, false}, {QpVector{{0, 1}}, -1, false}, {QpVector{{1, 0}}, -1, false}};
  const auto corner = solve(p);
  EXPECT_NEAR((corner.x - QpVector{{1, -1}}).norm(), 0, 1e-15);
  EXPECT_NEAR(corner.multipliers[0], 2, 1e-15);
  EXPECT_NEAR(corner.multipliers[1], 1, 1e-15);
  EXPECT_EQ(corner.multipliers[2], 0);
  // The same equality twice says nothing new; twice with another value cannot be.
  p.constraints = {{QpVector{{1, 1}}, 2, true}, {QpVector{{2, 2}}, 4, true}};
  const auto twice = solve(p);
  ASSERT_EQ(twice.outcome, QpOutcome::solved);
  EXPECT_NEAR((twice.x - QpVector{{3.5, -1.5}}).norm(), 0, 1e-14);
  p.constraints[1].b = 5;
  const auto never = solve(p);
  EXPECT_EQ(never.outcome, QpOutcome::infeasible);
  EXPECT_EQ(never.conflict, (std::vector<int>{1, 0}));
}

/// How far the constraints are from holding together: the smallest s with aᵀx + s >= b (and the other way).
double smallest_violation(const QuadraticProgram& p, const std::vector<int>& which) {
  const auto n = p.c.size();
  QuadraticProgram elastic{QpMatrix::Identity(n + 1, n + 1), QpVector::Zero(n + 1), {}};
  elastic.H.topLeftCorner(n, n) *= 1e-6;
  for (const int k : which) {
    QpConstraint row{QpVector::Ones(n + 1), p.constraints[k].b, false};
    row.a.head(n) = p.constraints[k].a;
    elastic.constraints.push_back(row);
    if (p.constraints[k].equality) {
      row.a.head(n) *= -1;
      row.b *= -1;
      elastic.constraints.push_back(row);
    }
  }
  const auto s = solve(elastic);
  EXPECT_EQ(s.outcome, QpOutcome::solved);
  return s.x[n];
}

TEST(SmallQp, InfeasibleComesWithConstraintsThatCannotHoldTogether) {
  std::mt19937_64 random(3);
  int infeasible = 0;
  for (int n = 0; n < 1000; ++n) {
    const auto p = random_program(random, false);
    const auto s = solve(p);
    ASSERT_NE(s.outcome, QpOutcome::not_solved);
    if (s.outcome != QpOutcome::infeasible) continue;
    ++infeasible;
    EXPECT_GT(smallest_violation(p, s.conflict), 1e-7) << n;
    for (const int left_out : s.conflict) {  // nothing in it is superfluous
      QuadraticProgram rest{p.H, p.c, {}};
      for (const int k : s.conflict)
        if (k != left_out) rest.constraints.push_back(p.constraints[k]);
      EXPECT_EQ(solve(rest).outcome, QpOutcome::solved) << n;
    }
  }
  EXPECT_GT(infeasible, 100);
}

TEST(SmallQp, RefusesWhatIsNoProgram) {
  QuadraticProgram p{QpMatrix::Identity(2, 2), QpVector::Zero(3), {}};
  EXPECT_THROW(solve(p), std::invalid_argument);
  p.c = QpVector::Zero(2);
  p.H(1, 1) = -1;
  EXPECT_EQ(solve(p).outcome, QpOutcome::not_solved);
  p.H(1, 1) = NAN;
  EXPECT_THROW(solve(p), std::invalid_argument);
}

}  // namespace
}  // namespace unhand::planners
