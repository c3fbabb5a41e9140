#include "fitting/discrepancy.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "experiment/parallel.hpp"
#include "fitting/normal_equations.hpp"

namespace unhand::fitting {

using experiment::Channel;

namespace {

enum Block { kWrench, kHeld, kFlight, kLanding, kBlocks };

Block block_of(Channel channel, Phase phase) {
  if (phase == Phase::landing) return kLanding;
  if (phase == Phase::flight) return kFlight;
  return channel == Channel::mocap_x || channel == Channel::mocap_z || channel == Channel::mocap_theta
             ? kHeld
             : kWrench;
}

/// The normal equations of some samples: campaign unknowns c, the throw's own o.
struct Part {
  Eigen::MatrixXd cc, co, oo;
  Eigen::VectorXd c, o;

  Part(Eigen::Index width, Eigen::Index own)
      : cc(Eigen::MatrixXd::Zero(width, width)),
        co(Eigen::MatrixXd::Zero(width, own)),
        oo(Eigen::MatrixXd::Zero(own, own)),
        c(Eigen::VectorXd::Zero(width)),
        o(Eigen::VectorXd::Zero(own)) {}
  void add(const Part& other, double sign) {
    cc += sign * other.cc, co += sign * other.co, oo += sign * other.oo;
    c += sign * other.c, o += sign * other.o;
  }
};

/// H and gradient of the campaign's unknowns.
struct Equations {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;
  void add(const Equations& other, double sign) { H += sign * other.H, g += sign * other.g; }
};

/// One throw: all of its samples, and without each block; its own unknowns eliminated.
struct ThrowShare {
  Equations whole;
  std::array<Equations, kBlocks> without;
};

Equations eliminated(const Part& part) {
  const Eigen::LDLT<Eigen::MatrixXd> solver(part.oo);
  return {part.cc - part.co * solver.solve(part.co.transpose()), part.c - part.co * solver.solve(part.o)};
}

ThrowShare share_of(const CampaignProblem& problem, std::size_t index, const FitResult& fit,
                    const std::vector<double>& campaign, const Weighting& weighting) {
  const CampaignThrow& thrown = problem.throws()[index];
  const ThrowFit& fitted = fit.throws[index];
  const auto width = static_cast<Eigen::Index>(campaign.size()),
             n = static_cast<Eigen::Index>(fitted.own.size());
  const Equations none{Eigen::MatrixXd::Zero(width, width), Eigen::VectorXd::Zero(width)};
  ThrowShare out{none, {none, none, none, none}};
  Linearisation l = problem.linearise(thrown, campaign, fitted.own, true);
  if (!l.solved) return out;
  weigh(l, thrown.observed, thrown, weighting);
  std::array<std::vector<Eigen::Index>, kBlocks> rows;
  for (Eigen::Index i = 0; i < l.residual.size(); ++i) {
    const auto& o = thrown.observed.all[static_cast<std::size_t>(i)];
    rows[block_of(o.channel, phase_of(o, thrown.opening, thrown.release_or(l.detach)))].push_back(i);
  }
  std::vector<Part> parts;
  Part all(width, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double precision = 1 / (fit.own_spread[i] * fit.own_spread[i]);
    all.oo(k, k) = precision;
    all.o[k] = precision * fitted.own[i];
  }
  for (const auto& of : rows) {
    Part part(width, n);
    const Eigen::MatrixXd C = l.campaign(of, Eigen::all), O = l.own(of, Eigen::all);
    const Eigen::VectorXd r = l.residual(of);
    part.cc = C.transpose() * C, part.co = C.transpose() * O, part.oo = O.transpose() * O;
    part.c = C.transpose() * r, part.o = O.transpose() * r;
    all.add(part, 1);
    parts.push_back(std::move(part));
  }
  out.whole = eliminated(all);
  for (int b = 0; b < kBlocks; ++b) {
    Part rest = all;
    rest.add(parts[static_cast<std::size_t>(b)], -1);
    out.without[static_cast<std::size_t>(b)] = eliminated(rest);
  }
  out.whole.H *= fitted.weight, out.whole.g *= fitted.weight;
  for (auto& e : out.without) e.H *= fitted.weight, e.g *= fitted.weight;
  return out;
}

/// t₀.₉₇₅ of n degrees of freedom over 1.96 (Cornish and Fisher's expansion; n = 2 is 6 % low).
double student_factor(double n) {
  constexpr double z = 1.959964, z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
  return 1 + ((z3 + z) / 4 / n + (5 * z5 + 16 * z3 + 3 * z) / 96 / (n * n) +
              (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / 384 / (n * n * n)) /
                 z;
}

/// Inverse in units in which the diagonal is one; directions that are not determined have none.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& H) {
  const Eigen::VectorXd unit = H.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = unit.asDiagonal() * H * unit.asDiagonal();
  const Eigen::MatrixXd inverse = scaled.completeOrthogonalDecomposition().pseudoInverse();
  return unit.asDiagonal() * inverse * unit.asDiagonal();
}

}  // namespace

void count_discrepancy(const CampaignProblem& problem, FitResult& fit, int threads) {
  const auto campaign = fit.values();
  const auto width = static_cast<Eigen::Index>(campaign.size());
  Weighting weighting;
  std::copy(fit.group_weight.begin(), fit.group_weight.end(), weighting.group.begin());
  std::vector<ThrowShare> shares(fit.throws.size());
  experiment::parallel_for(fit.throws.size(), threads, [&](std::size_t i) {
    if (fit.throws[i].used) shares[i] = share_of(problem, i, fit, campaign, weighting);
  });
  Equations all{Eigen::MatrixXd::Zero(width, width), Eigen::VectorXd::Zero(width)};
  for (Eigen::Index k = 0; k < width; ++k) {
    const Unknown& u = fit.campaign[static_cast<std::size_t>(k)].unknown;
    if (!u.prior_sigma) continue;
    all.H(k, k) = 1 / (*u.prior_sigma * *u.prior_sigma);
    all.g[k] = (campaign[static_cast<std::size_t>(k)] - u.start) * all.H(k, k);
  }
  const Equations prior = all;
  std::array<Equations, kBlocks> without{prior, prior, prior, prior};
  std::map<std::string, Equations> conditions;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    if (!fit.throws[i].used) continue;
    all.add(shares[i].whole, 1);
    for (std::size_t b = 0; b < kBlocks; ++b) without[b].add(shares[i].without[b], 1);
    const auto& prepared = problem.throws()[i].prepared;
    const auto [at, first] =
        conditions.try_emplace(prepared.object + "/" + prepared.condition, shares[i].whole);
    if (!first) at->second.add(shares[i].whole, 1);
  }
  const Eigen::MatrixXd noise = inverse(all.H);
  const Eigen::VectorXd left = noise * all.g;  // what the solver has not gone yet

  Eigen::VectorXd variance = noise.diagonal();
  const auto count = static_cast<double>(conditions.size());
  if (count >= 3) {
    Eigen::VectorXd jackknife = Eigen::VectorXd::Zero(width);
    for (const auto& [name, of] : conditions) {
      Equations rest = all;
      rest.add(of, -1);
      const Eigen::VectorXd step = inverse(rest.H) * rest.g - left;
      jackknife += step.cwiseAbs2();
    }
    const double t = student_factor(count - 1);
    variance = variance.cwiseMax((count - 1) / count * t * t * jackknife);
  }
  Eigen::VectorXd excess = Eigen::VectorXd::Zero(width);
  for (const Equations& rest : without) {
    const Eigen::MatrixXd of = inverse(rest.H);
    const Eigen::VectorXd step = of * rest.g - left;
    for (Eigen::Index k = 0; k < width; ++k) {
      const double inflated = variance[k] / std::max(noise(k, k), 1e-300);
      const double expected = std::max(0.0, of(k, k) - noise(k, k)) * inflated;
      // Ten times as uncertain without the block: the rest has no say of its own.
      if (!(rest.H(k, k) > 0) || of(k, k) > 100 * noise(k, k)) continue;
      excess[k] = std::max(excess[k], step[k] * step[k] - expected);
    }
  }
  variance += excess;

  std::vector<double> factor(static_cast<std::size_t>(width), 1.0);
  for (Eigen::Index k = 0; k < width; ++k) {
    auto& u = fit.campaign[static_cast<std::size_t>(k)];
    if (!(u.sigma > 0) || !(variance[k] > u.sigma * u.sigma)) continue;
    factor[static_cast<std::size_t>(k)] = std::sqrt(variance[k]) / u.sigma;
    u.sigma = std::sqrt(variance[k]);
  }
  for (std::size_t j = 0; j < factor.size(); ++j)
    for (std::size_t k = 0; k < factor.size(); ++k)
      fit.covariance[j * factor.size() + k] *= factor[j] * factor[k];
}

}  // namespace unhand::fitting
