#include "fitting/slips/compare_surfaces.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <numeric>
#include <random>
#include <stdexcept>
#include <utility>

#include "dynamics/median.hpp"
#include "dynamics/parallel.hpp"

namespace unhand::fitting {
namespace {

struct SlipCrossValidation {
  SurfaceOutcome outcome{SurfaceOutcome::fitted};
  std::string reason;
  std::vector<double> errors_deg;
};

SlipCrossValidation cross_validate(const SlipSamples& slips, SurfaceModel model, int folds) {
  SlipCrossValidation out;
  out.errors_deg.resize(slips.samples.size());
  for (int fold = 0; fold < folds; ++fold) {
    SlipSamples seen = slips;
    std::erase_if(seen.samples, [&](const SlipSample& s) { return s.slip % folds == fold; });
    const SurfaceFit fit = fit_surface(seen, model);
    if (!fit.fitted()) {
      out.outcome = fit.outcome;
      out.reason = fmt::format("{} (fold {} of {} left out)", fit.reason, fold + 1, folds);
      return out;
    }
    for (std::size_t i = 0; i < slips.samples.size(); ++i)
      if (slips.samples[i].slip % folds == fold)
        out.errors_deg[i] = kDegreesPerRadian * direction_error(fit.surface, slips.samples[i]);
  }
  return out;
}

double mean_of(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

/// The same for the same names, whatever else is in the log. FNV-1a.
std::uint64_t seed_of(const std::string& name, std::uint64_t seed) {
  std::uint64_t hash = 14695981039346656037ull ^ seed;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return hash;
}

double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

template <class T>
const T& any_of(const std::vector<T>& values, std::mt19937_64& random) {
  return values[std::min(static_cast<std::size_t>(uniform(random) * static_cast<double>(values.size())),
                         values.size() - 1)];
}

}  // namespace

void SurfaceScore::set_errors(std::vector<double> deg) {
  errors_deg = std::move(deg);
  mean_deg = mean_of(errors_deg);
  median_deg = dynamics::median(errors_deg);
}

SlipSamples simulate_slips(const SlipSamples& slips, const SurfaceFit& fit, std::uint64_t seed) {
  std::vector<double> angles, levels;
  for (const SlipSample& s : slips.samples) {
    angles.push_back(direction_error(fit.surface, s));
    levels.push_back(fit.surface.gauge(s.wrench));
  }
  std::mt19937_64 random(seed_of(slips.surface, seed));
  SlipSamples out = slips;
  for (SlipSample& s : out.samples) {
    const auto n = fit.surface.normal(s.wrench);
    const Eigen::Vector3d along(n[0], n[1], n[2]);
    Eigen::Vector3d::Index least = 0;
    along.cwiseAbs().minCoeff(&least);
    const Eigen::Vector3d aside = along.cross(Eigen::Vector3d::Unit(least)).normalized();
    const double angle = any_of(angles, random), azimuth = 2 * std::numbers::pi * uniform(random);
    const Eigen::Vector3d u =
        std::cos(angle) * along +
        std::sin(angle) * (std::cos(azimuth) * aside + std::sin(azimuth) * along.cross(aside));
    const double factor = any_of(levels, random) / fit.surface.gauge(s.wrench);
    for (std::size_t j = 0; j < 3; ++j) {
      s.direction[j] = u[static_cast<Eigen::Index>(j)];
      s.wrench[j] *= factor;
    }
  }
  return out;
}

std::size_t surface_comparison_steps(std::size_t surfaces, std::size_t models,
                                     const SurfaceComparisonOptions& options) {
  return surfaces * models * static_cast<std::size_t>(1 + options.null_draws);
}

std::vector<std::vector<SurfaceScore>> compare_surfaces(const std::vector<SlipSamples>& surfaces,
                                                        const std::vector<SurfaceModel>& models,
                                                        const SurfaceComparisonOptions& options) {
  if (options.folds < 2) throw std::invalid_argument(fmt::format("folds: {} is not >= 2", options.folds));
  if (options.null_draws < 0)
    throw std::invalid_argument(fmt::format("null_draws: {} is not >= 0", options.null_draws));
  const std::size_t draws = static_cast<std::size_t>(options.null_draws), rounds = 1 + draws;
  std::vector<SurfaceFit> nulls(draws > 0 ? surfaces.size() : 0);
  dynamics::parallel_for(nulls.size(), options.threads, [&](std::size_t i) {
    nulls[i] = fit_surface(surfaces[i], SurfaceModel::ellipsoid);
  });

  // One job: a model on a surface's data, measured (round 0) or simulated.
  std::vector<SurfaceFit> fits(surfaces.size() * models.size());
  std::vector<SlipCrossValidation> results(fits.size() * rounds);
  dynamics::parallel_for(results.size(), options.threads, [&](std::size_t job) {
    const std::size_t pair = job / rounds, round = job % rounds, i = pair / models.size();
    const SurfaceModel model = models[pair % models.size()];
    if (round == 0)
      fits[pair] = fit_surface(surfaces[i], model),
      results[job] = cross_validate(surfaces[i], model, options.folds);
    else if (nulls[i].fitted())
      results[job] =
          cross_validate(simulate_slips(surfaces[i], nulls[i], options.seed + round), model, options.folds);
    else
      results[job] = {nulls[i].outcome, nulls[i].reason, {}};
    if (options.step) options.step();
  });

  std::vector<std::vector<SurfaceScore>> out(surfaces.size());
  for (std::size_t pair = 0; pair < fits.size(); ++pair) {
    SurfaceScore score{models[pair % models.size()], std::move(fits[pair]), {}, {}, {}, {}, {}, {}};
    score.outcome = score.fit.outcome;
    score.reason = score.fit.reason;
    for (std::size_t round = 0; round < rounds && score.scored(); ++round) {
      const SlipCrossValidation& one = results[pair * rounds + round];
      score.outcome = one.outcome;
      score.reason = one.reason;
      if (!score.scored()) break;
      if (round > 0) {
        score.null_control_deg += mean_of(one.errors_deg) / static_cast<double>(draws);
      } else {
        score.set_errors(one.errors_deg);
      }
    }
    out[pair / models.size()].push_back(std::move(score));
  }
  return out;
}

}  // namespace unhand::fitting
