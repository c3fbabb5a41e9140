// Structure in plain residual series: what noise looks like, and what a dependence looks like.
#include "fitting/discovery/residual_structure.hpp"
#include "fitting/distributions.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "experiment/random_stream.hpp"
#include "experiment/throw_setup.hpp"
#include "fitting/discovery/jackknife.hpp"
#include "fitting/discovery/missing_force.hpp"
#include "fitting/discovery/order_trend.hpp"
#include "fitting/discovery/residuals.hpp"
#include "tests/fitting/loop_campaign.hpp"

namespace unhand::fitting {
namespace {

using experiment::RandomStream;

/// 40 series of 50 samples, eight conditions, a speed that varies; `systematic(condition, time, speed)` [σ].
template <class Systematic>
ResidualSamples samples(std::uint64_t seed, const Systematic& systematic) {
  RandomStream random(seed, 0, experiment::Purpose::effect);
  ResidualSamples out;
  out.states = {{"speed", {}}};
  for (int series = 0; series < 40; ++series)
    for (int k = 0; k < 50; ++k) {
      const double time = 0.01 * k, speed = 2 + random.uniform();
      out.value.push_back(random.normal(0, 1) + systematic(series / 5, time, speed));
      out.time.push_back(time);
      out.series.push_back(series);
      out.condition.push_back(series / 5);
      out.states[0].value.push_back(speed);
    }
  return out;
}

TEST(ResidualStructure, TailsAreThoseOfTheTables) {
  EXPECT_NEAR(chi2_tail(3.841459, 1), 0.05, 1e-7);
  EXPECT_NEAR(chi2_tail(18.307038, 10), 0.05, 1e-7);
  EXPECT_NEAR(chi2_tail(1074.679449, 1000), 0.05, 1e-7);
  EXPECT_NEAR(f_tail(4.9646027, 1, 10), 0.05, 1e-7);
  EXPECT_NEAR(f_tail(2.3478775, 10, 20), 0.05, 1e-6);
}

// The textbooks' regression: of five points with an error that is orthogonal to the line, t = 3.1824 is the
// two-sided 5 % of three degrees of freedom; a second condition with the same points adds four throws and one
// mean, and one of a single throw adds nothing.
TEST(OrderTrend, IsTheRegressionOfTheTextbooksWithinConditions) {
  const std::array<double, 5> place{-2, -1, 0, 1, 2}, bend{2, -1, -2, -1, 2};  // squares: 10, 14
  const auto points = [&](double t, double degrees, int conditions) {
    const double error = std::sqrt(10 * degrees / (14 * t * t));
    std::vector<Placed> out;
    for (int c = 0; c < conditions; ++c)
      for (std::size_t i = 0; i < 5; ++i)
        out.push_back({c, place[i], 100.0 * c + place[i] + error * bend[i]});
    return out;
  };
  auto one = points(3.1824, 3, 1);
  EXPECT_NEAR(order_trend(one).slope, 1, 1e-12);
  EXPECT_NEAR(order_trend(one).p_value, 0.05, 1e-5);
  const double left = 10 * 3 / (3.1824 * 3.1824);  // about the line
  EXPECT_NEAR(order_trend(one).explained, 10 - left / 3, 1e-9)
      << "chance takes one part in three degrees away";
  EXPECT_NEAR(order_trend(one).ratio, (10 + left) / left, 1e-9);
  one.push_back({7, 40, -3});
  EXPECT_NEAR(order_trend(one).p_value, 0.05, 1e-5) << "a condition that was thrown once";
  const double t7 = 2.3646;  // of seven degrees: ten throws, two means, a slope
  EXPECT_NEAR(order_trend(points(t7, 7, 2)).p_value, 0.05, 1e-5);
}

// The mean of eight numbers of unit noise, left out in turn: what they scatter beyond it, over n − 1.
TEST(Jackknife, OfAMeanIsTheTextbooks) {
  const std::vector<double> y{3, -1, 4, 1, -5, 9, -2, 6};
  const auto n = static_cast<double>(y.size());
  double mean = 0, square = 0;
  for (const double one : y) mean += one / n;
  for (const double one : y) square += (one - mean) * (one - mean) / (n - 1);
  std::map<std::string, Equations> groups;
  Equations all = no_equations(1);
  for (std::size_t i = 0; i < y.size(); ++i) {
    Equations one = no_equations(1);
    one(0, 0) = 1, one(0, 1) = one(1, 0) = mean - y[i];
    groups[std::to_string(i)] = one;
    all += one;
  }
  const Jackknife found = jackknife(groups, all, LinearAnswer(all));
  EXPECT_NEAR(found.groups[0], n, 1e-9);
  EXPECT_NEAR(found.excess[0], (square - 1) / (n - 1), 1e-9);
  // So that noise and excess are the textbooks' variance of a mean.
  EXPECT_NEAR(1 / n + (n - 1) / n * found.excess[0], square / n, 1e-9);
}

// Three recordings of one sample each, 1, 2 and 3: a mean of 2 with the variance 1/3. t² = 12 of two degrees
// of freedom has the two-sided tail 1 − t/√(t² + 2); the mean's square beyond chance is 11/3 of a mean square
// of 14/3.
TEST(ResidualStructure, AnOffsetIsStudentsMean) {
  ResidualSamples of;
  for (int k = 0; k < 3; ++k) {
    of.value.push_back(k + 1), of.time.push_back(0);
    of.series.push_back(k), of.condition.push_back(k);
  }
  const SharedOffset offset = find_structure(of).offset;
  EXPECT_NEAR(offset.mean, 2, 1e-12);
  EXPECT_NEAR(offset.p_value, 1 - std::sqrt(12.0 / 14), 1e-9);
  EXPECT_NEAR(offset.share, 11.0 / 14, 1e-9);
}

// Three recordings of each of three conditions, one sample each: F = 3 of 2 and 6 degrees of freedom, whose
// tail is (1 + 2 F/6)^-3 = 1/8; what conditions share beyond chance is 6 − 2 of a sum of squares of 12.
TEST(ResidualStructure, ConditionsAreAnAnalysisOfVariance) {
  ResidualSamples of;
  for (int condition = 0; condition < 3; ++condition)
    for (int k = 0; k < 3; ++k) {
      of.value.push_back(condition - 1 + k - 1);
      of.time.push_back(0);
      of.series.push_back(3 * condition + k);
      of.condition.push_back(condition);
    }
  for (const Dependence& d : find_structure(of).depends)
    if (d.on == "condition") {
      EXPECT_NEAR(d.p_value, 0.125, 1e-9);
      EXPECT_NEAR(d.share, 4.0 / 12, 1e-9);
    }
}

TEST(ResidualStructure, NoiseHasNone) {
  int structured = 0;
  constexpr int kTries = 200;
  for (int seed = 1; seed <= kTries; ++seed)
    structured += find_structure(samples(static_cast<std::uint64_t>(seed), [](int, double, double) {
                    return 0.0;
                  })).p_value() < 0.05;
  // Bonferroni: at most 5 %; 200 tries scatter by 1.5 %, three of which are allowed
  EXPECT_LE(structured, static_cast<int>(0.095 * kTries));
}

// Neighbours that err alike are fewer witnesses than they are samples: noise that correlates goes with
// nothing.
TEST(ResidualStructure, SlowNoiseGoesWithNothing) {
  int told = 0;
  constexpr int kTries = 200;
  for (int seed = 1; seed <= kTries; ++seed) {
    ResidualSamples slow = samples(static_cast<std::uint64_t>(seed), [](int, double, double) { return 0.0; });
    for (std::size_t i = 1; i < slow.value.size(); ++i)
      if (slow.series[i] == slow.series[i - 1])
        slow.value[i] = 0.9 * slow.value[i - 1] + std::sqrt(1 - 0.81) * slow.value[i];
    for (const Dependence& d : find_structure(slow).depends) told += d.on == "time" && d.p_value < 0.01;
  }
  EXPECT_LE(told,
            static_cast<int>(0.03 * kTries));  // three times what is designed; samples as witnesses: half
}

// What every condition has wrong for itself is no offset that all throws share, and goes with no speed that
// differs from condition to condition: its repetitions are no further witnesses.
TEST(ResidualStructure, RepetitionsThatErrAlikeAreOneWitness) {
  constexpr int kTries = 200;
  int offsets = 0, speeds = 0, conditions = 0, shared = 0;
  for (int seed = 1; seed <= kTries; ++seed) {
    RandomStream random(static_cast<std::uint64_t>(seed), 1, experiment::Purpose::effect);
    std::array<double, 8> off{}, speed{};
    for (double& x : off) x = random.normal(0, 2);
    for (double& x : speed) x = random.normal(3, 1);
    ResidualSamples own =
        samples(static_cast<std::uint64_t>(seed), [&](int c, double, double) { return off[c]; });
    for (std::size_t i = 0; i < own.condition.size(); ++i)
      own.states[0].value[i] = speed[static_cast<std::size_t>(own.condition[i])];
    const ResidualStructure found = find_structure(own);
    offsets += found.offset.p_value < 0.01;
    for (const Dependence& d : found.depends) {
      speeds += d.on == "speed" && d.p_value < 0.01;
      conditions += d.on == "condition" && d.p_value < 0.01;
    }
    shared += find_structure(samples(static_cast<std::uint64_t>(seed), [](int, double, double) {
                return 0.3;
              })).offset.p_value < 0.01;
  }
  // 1 % by design, of 200 tries 3 σ more; recordings as witnesses tell an offset in a third of them
  EXPECT_LE(offsets, static_cast<int>(0.03 * kTries));
  EXPECT_LE(speeds, static_cast<int>(0.03 * kTries));
  EXPECT_EQ(conditions, kTries);
  EXPECT_GT(shared, static_cast<int>(0.9 * kTries)) << "one that all do share is told";
}

TEST(ResidualStructure, WhatItGoesWithIsNamed) {
  const auto strongest = [](const ResidualSamples& s) { return find_structure(s).depends.front(); };
  const auto speed = strongest(samples(7, [](int, double, double v) { return 3 * (v - 2.5); }));
  EXPECT_EQ(speed.on, "speed");
  // 9/12 of a variance of 1 + 9/12 goes with it, less what ten groups do not resolve (1/100 of that)
  EXPECT_NEAR(speed.share, 0.75 / 1.75, 0.04);
  EXPECT_EQ(strongest(samples(8, [](int, double t, double) { return 4 * (t - 0.25); })).on, "time");
  EXPECT_EQ(strongest(samples(9, [](int c, double, double) { return 0.3 * (c - 3.5); })).on, "condition");
  const auto drifting = find_structure(samples(10, [](int, double t, double) { return std::sin(20 * t); }));
  EXPECT_NEAR(drifting.autocorrelation, 0.5 / 1.5 * std::cos(0.2), 0.06);
  EXPECT_LT(drifting.autocorrelation_p, 1e-6);
}

TEST(ResidualStructure, AnOffsetIsWhatAllRecordingsShare) {
  const auto same = find_structure(samples(11, [](int, double, double) { return 0.8; }));
  EXPECT_NEAR(same.offset.mean, 0.8, 0.1);
  EXPECT_NEAR(same.offset.share, 0.64 / 1.64, 0.05);
  EXPECT_LT(same.offset.p_value, 1e-6);
  EXPECT_NE(same.in_words().find("is an offset of +0."), std::string::npos) << same.in_words();
  // Half of the conditions one way, half the other: what they share is nothing.
  const auto either =
      find_structure(samples(12, [](int c, double, double) { return c % 2 == 0 ? 0.8 : -0.8; }));
  EXPECT_LT(either.offset.share, 0.02);
  EXPECT_GT(either.offset.p_value, 0.01);
}

TEST(ResidualStructure, WhatChangesOverTheCampaignGoesWithTheOrder) {
  ResidualSamples drifting = samples(13, [](int, double, double) { return 0.0; });
  for (std::size_t i = 0; i < drifting.value.size(); ++i) {
    drifting.condition[i] =
        drifting.series[i] % 8;  // in turn, so that every condition sees all of the campaign
    drifting.value[i] += 0.1 * (drifting.series[i] - 19.5);
  }
  const ResidualStructure found = find_structure(drifting);
  EXPECT_EQ(found.depends.front().on, "order in the log");
  EXPECT_NEAR(found.depends.front().share, 0.01 * 1599 / 12 / (1 + 0.01 * 1599 / 12), 0.05);
  EXPECT_LT(found.offset.share, 0.02);
}

TEST(ResidualStructure, NeighboursThatAreTheSameCorrelateByOne) {
  // Large in the one series that has neighbours, small in the recordings of a single sample.
  const ResidualSamples s{{9, 9, 9, 0.1, -0.1}, {0, 0.1, 0.2, 0, 0}, {0, 0, 0, 1, 2}, {0, 0, 0, 1, 1}, {}};
  EXPECT_DOUBLE_EQ(find_structure(s).autocorrelation, 1);
}

/// Residuals of flights that lack `missing`, an acceleration of the state, with noise of 0.2 mm.
template <class Missing>
std::vector<ResidualTrace> flights(const Missing& missing, int first = 0) {
  std::vector<ResidualTrace> out;
  for (int i = first; i < first + 12; ++i) {
    RandomStream random(5, static_cast<std::uint64_t>(i), experiment::Purpose::effect);
    ResidualTrace t;
    ResidualTrace::State s{1.5 + 0.1 * (i % 6), 1 + 0.2 * (i % 3), i % 2 ? 4.0 : -2.0, 0.3 * i, 0};
    std::array<double, 3> x{random.normal(0, 1e-3), random.normal(0, 1e-3), 0},
        v{random.normal(0, 5e-3), 0, 0};
    constexpr double kStep = 1.0 / 240;
    for (int k = 0; k < 100; ++k) {
      t.time.push_back(k * kStep);
      t.state.push_back(s);
      const auto a = missing(s);
      s.vz -= 9.81 * kStep;
      s.theta += s.omega * kStep;
      const auto b = missing(s);
      for (std::size_t c = 0; c < 3; ++c) {
        t.residual[c].push_back(x[c] + random.normal(0, 2e-4));
        t.sigma[c].push_back(2e-4);
        x[c] += kStep * v[c] + kStep * kStep * (2 * a[c] + b[c]) / 6;
        v[c] += 0.5 * kStep * (a[c] + b[c]);
      }
    }
    out.push_back(std::move(t));
  }
  return out;
}
const MissingOptions kFlight{Response::twice_integrated, 7, 2};

TEST(MissingForce, DragIsReadFromFlightsWithoutBeingAskedFor) {
  constexpr double k = 0.05;
  const auto traces = flights([](const ResidualTrace::State& s) {
    const double speed = std::hypot(s.vx, s.vz);
    return std::array<double, 3>{-k * speed * s.vx, -k * speed * s.vz, 0};
  });
  const auto candidate = missing_terms(traces, kFlight);
  ASSERT_EQ(candidate.terms.size(), 1u) << candidate.in_words({});
  EXPECT_EQ(candidate.terms[0].name, "|v| v");
  EXPECT_NEAR(candidate.terms[0].coefficient(0), -k, 5 * candidate.terms[0].sizes[0].sigma + 0.01 * k);
  EXPECT_GT(candidate.explained, 0.95);
}

TEST(MissingForce, LiftIsNotMistakenForDrag) {
  constexpr double k = 0.02;
  const auto candidate =
      missing_terms(flights([](const ResidualTrace::State& s) {
                      return std::array<double, 3>{-k * s.omega * s.vz, k * s.omega * s.vx, 0};
                    }),
                    kFlight);
  ASSERT_FALSE(candidate.terms.empty());
  EXPECT_EQ(candidate.terms[0].name, "omega J v");
  EXPECT_NEAR(candidate.terms[0].coefficient(0), k, 5 * candidate.terms[0].sizes[0].sigma + 0.01 * k);
}

/// Traces of two groups, each with its own missing acceleration.
template <class First, class Second>
std::vector<ResidualTrace> two_groups(const First& first, const Second& second) {
  std::vector<ResidualTrace> out = flights(first);
  for (ResidualTrace& trace : flights(second, 50)) {
    trace.group = 1;
    out.push_back(std::move(trace));
  }
  return out;
}

// What the air does depends on the body: a drag of each, and of one that has none, zero.
TEST(MissingForce, BodiesHaveDragsOfTheirOwn) {
  const auto drag = [](double k) {
    return [k](const ResidualTrace::State& s) {
      const double speed = std::hypot(s.vx, s.vz);
      return std::array<double, 3>{-k * speed * s.vx, -k * speed * s.vz, 0};
    };
  };
  for (const double second : {0.03, 0.0}) {
    const auto candidate = missing_terms(two_groups(drag(0.15), drag(second)), kFlight);
    const std::string words = candidate.in_words({{0, "jar"}, {1, "bar"}});
    ASSERT_EQ(candidate.terms.size(), 1u) << words;
    EXPECT_EQ(candidate.terms[0].name, "|v| v");
    ASSERT_EQ(candidate.terms[0].sizes.size(), 2u) << words;
    EXPECT_NEAR(candidate.terms[0].coefficient(0), -0.15, 0.002);
    EXPECT_NEAR(candidate.terms[0].coefficient(1), -second, 0.002);
    for (const MissingSize& size : candidate.terms[0].sizes) EXPECT_LT(size.sigma, 0.001);
    EXPECT_GT(candidate.explained, 0.95);
    EXPECT_NE(words.find("for jar, "), std::string::npos) << words;
  }
}

// Gravity is the same for all: one coefficient, √2 better known than that of either alone.
TEST(MissingForce, WhatActsOnAllAlikeHasOneCoefficient) {
  const auto tilt = [](const ResidualTrace::State&) { return std::array<double, 3>{0.05, 0, 0}; };
  const auto traces = two_groups(tilt, tilt);
  const auto both = missing_terms(traces, kFlight);
  const std::vector<ResidualTrace> half(traces.begin(), traces.begin() + 12);
  const auto one = missing_terms(half, kFlight);
  ASSERT_EQ(both.terms.size(), 1u);
  ASSERT_EQ(one.terms.size(), 1u);
  EXPECT_EQ(both.terms[0].name, "1 along x");
  ASSERT_EQ(both.coefficients(), 1u) << both.in_words({{0, "jar"}, {1, "bar"}});
  EXPECT_NEAR(both.terms[0].coefficient(1), 0.05, 4 * both.terms[0].sizes[0].sigma);
  EXPECT_NEAR(both.terms[0].sizes[0].sigma, one.terms[0].sizes[0].sigma / std::sqrt(2.0),
              0.1 * both.terms[0].sizes[0].sigma);
}

// A tilt of gravity that both feel beside a drag that one has: a coefficient of both, and one of each.
TEST(MissingForce, ACommonTermBesideOneOfTheBodies) {
  const auto with = [](double k) {
    return [k](const ResidualTrace::State& s) {
      const double speed = std::hypot(s.vx, s.vz);
      return std::array<double, 3>{0.2 - k * speed * s.vx, -k * speed * s.vz, 0};
    };
  };
  const auto candidate = missing_terms(two_groups(with(0.15), with(0.0)), kFlight);
  const std::string words = candidate.in_words({{0, "jar"}, {1, "bar"}});
  ASSERT_EQ(candidate.terms.size(), 2u) << words;
  for (const MissingTerm& term : candidate.terms) {
    const bool is_drag = term.name == "|v| v";
    ASSERT_TRUE(is_drag || term.name == "1 along x") << words;
    EXPECT_EQ(term.sizes.size(), is_drag ? 2u : 1u) << words;
    EXPECT_NEAR(term.coefficient(0), is_drag ? -0.15 : 0.2, 0.005) << words;
    EXPECT_NEAR(term.coefficient(1), is_drag ? 0 : 0.2, 0.005) << words;
  }
}

// What is left around the right form is noise: χ² of its degrees of freedom, on throws that it has not seen.
TEST(MissingForce, TheRightFormLeavesNoiseAndANearOneDoesNot) {
  const auto drag = [](const ResidualTrace::State& s) {
    return std::array<double, 3>{-0.4 * s.vx, -0.4 * s.vz, 0};
  };
  const auto seen = flights(drag), unseen = flights(drag, 100);
  const MissingCandidate candidate = missing_terms(seen, kFlight);
  ASSERT_FALSE(candidate.terms.empty());
  EXPECT_EQ(candidate.terms.front().name, "v");
  const auto per_sample = [&](const std::vector<ResidualTrace>& traces, const MissingCandidate& around) {
    const Rest rest = rest_around(traces, around, kFlight);
    return rest.chi2 / static_cast<double>(rest.degrees_of_freedom);
  };
  EXPECT_GT(per_sample(seen, {}), 50);
  // Of offset and slope of each of 36 series of 100 samples nothing is left: they are no degrees of freedom.
  EXPECT_EQ(rest_around(seen, candidate, kFlight).degrees_of_freedom, 36 * (100 - 2));
  EXPECT_NEAR(per_sample(seen, candidate), 1, 0.1);
  EXPECT_NEAR(per_sample(unseen, candidate), 1, 0.1);
  MissingCandidate near = candidate;
  near.terms.resize(1);
  near.terms[0].shape = [](const ResidualTrace::State& s) {
    const double speed = std::hypot(s.vx, s.vz) / 2.2;
    return std::array<double, 3>{speed * s.vx, speed * s.vz, 0};
  };
  EXPECT_GT(per_sample(seen, near), 2);
}

TEST(MissingForce, AConstantIsTheCurve) {
  const auto traces = flights([](const ResidualTrace::State&) {
    return std::array<double, 3>{0.3, -0.1, 2.0};
  });
  const auto curves = missing_curves(traces, kFlight);
  ASSERT_EQ(curves.size(), 1u);
  for (const double t : {0.05, 0.2, 0.35}) {
    EXPECT_NEAR(curves[0].at(t)[0], 0.3, 0.06) << t;
    EXPECT_NEAR(curves[0].at(t)[1], -0.1, 0.06) << t;
    EXPECT_NEAR(curves[0].at(t)[2], 2.0, 0.06) << t;
  }
  EXPECT_LT(curves[0].chi2_after, 0.1 * curves[0].chi2_before);
}

// Samples count by their own noise: a constant is known to σ/√n of the quiet half, and its interval says so.
TEST(MissingForce, NoisySamplesCountForWhatTheyKnow) {
  constexpr double kQuiet = 0.01, kLoud = 1, kMissing = 0.05;
  constexpr int kThrows = 20, kSamples = 100;
  std::vector<ResidualTrace> traces;
  for (int i = 0; i < kThrows; ++i) {
    RandomStream random(6, static_cast<std::uint64_t>(i), experiment::Purpose::effect);
    ResidualTrace t;
    for (int k = 0; k < kSamples; ++k) {
      const double sigma = k < kSamples / 2 ? kLoud : kQuiet;
      t.time.push_back(0.01 * k);
      t.state.push_back({0.1, 0, 0, 0, 10});
      for (std::size_t c = 0; c < 3; ++c) {
        t.residual[c].push_back((c == 0 ? kMissing : 0) + random.normal(0, sigma));
        t.sigma[c].push_back(sigma);
      }
    }
    traces.push_back(std::move(t));
  }
  const auto candidate = missing_terms(traces, {Response::direct, 7, 1});
  ASSERT_EQ(candidate.terms.size(), 1u);
  const double known_to = kQuiet / std::sqrt(kThrows * kSamples / 2.0);
  const double size = candidate.terms[0].coefficient(0) * candidate.terms[0].shape({0.1, 0, 0, 0, 10})[0];
  EXPECT_NEAR(size, kMissing, 4 * known_to);
}

// What an effect says it seems to be in flight is found under that name: else it would be taken for a shadow
// of that term.
TEST(MissingForce, TheFormsOfEffectsAreFound) {
  using State = ResidualTrace::State;
  using Missing = std::array<double, 3>;
  const auto drag = [](const State& s) { return 0.05 * std::hypot(s.vx, s.vz); };
  const auto spin = [](const State& s) { return 0.01 * s.omega * s.omega; };
  using Form = dynamics::AccelerationForm;
  const std::map<Form, std::function<Missing(const State&)>> missing{
      {Form::quadratic,
       [&](const State& s) {
         return Missing{drag(s) * s.vx, drag(s) * s.vz, 0};
       }},
      {Form::lift,
       [](const State& s) {
         return Missing{-0.02 * s.omega * s.vz, 0.02 * s.omega * s.vx, 0};
       }},
      {Form::along_x,
       [](const State&) {
         return Missing{0.3, 0, 0};
       }},
      {Form::along_z,
       [](const State&) {
         return Missing{0, 0.3, 0};
       }},
      {Form::centripetal_x, [&](const State& s) {
         return Missing{spin(s) * std::cos(s.theta), spin(s) * std::sin(s.theta), 0};
       }}};
  int forms = 0;
  for (const auto& effect : experiment::known_effects()) {
    if (effect.form == Form::none) continue;
    ++forms;
    ASSERT_TRUE(missing.contains(effect.form))
        << effect.id << ": what acceleration is of its form? Add it above";
    const auto candidate = missing_terms(flights(missing.at(effect.form)), kFlight);
    ASSERT_FALSE(candidate.terms.empty()) << effect.id;
    EXPECT_EQ(candidate.terms.front().form, effect.form) << effect.id;
  }
  EXPECT_GE(forms, 5);  // drag, lift, tilt, scale, centre of mass
}

// A model that is too slow by 0.02 m/s and 0.3 rad/s: what is missing depends on the motion that was
// measured.
TEST(States, OfTheMeasurementAreThoseThatTheModelMisses) {
  const CampaignProblem problem(support::loop_campaign({}), "synthetic", {});
  const CampaignThrow& thrown = problem.throws().front();
  const auto& all = thrown.observed.all;
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(all.size()));
  for (std::size_t j = 0; j < all.size(); ++j) {
    const double rate = all[j].channel == experiment::Channel::mocap_x       ? -0.02
                        : all[j].channel == experiment::Channel::mocap_theta ? -0.3
                                                                             : 0;
    residual[static_cast<Eigen::Index>(j)] = rate * all[j].time / all[j].sigma;
  }
  const StateSeries model = states_of(thrown, residual, MotionOf::model),
                    measured = states_of(thrown, residual, MotionOf::measurement);
  ASSERT_GT(model.time.size(), 20u);
  for (std::size_t k = 0; k < model.time.size(); ++k) {
    EXPECT_NEAR(measured.state[k].vx - model.state[k].vx, 0.02, 1e-9) << k;
    EXPECT_NEAR(measured.state[k].omega - model.state[k].omega, 0.3, 1e-9) << k;
    EXPECT_NEAR(measured.state[k].vz - model.state[k].vz, 0, 1e-9) << k;
  }
}

TEST(MissingForce, NoiseHasNoCandidate) {
  const auto traces = flights([](const ResidualTrace::State&) { return std::array<double, 3>{}; });
  EXPECT_TRUE(missing_terms(traces, kFlight).terms.empty());
}

}  // namespace
}  // namespace unhand::fitting
