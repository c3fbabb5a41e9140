#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <numbers>

#include "fitting/distributions.hpp"
#include "fitting/slips/surface_discovery.hpp"

namespace unhand::fitting {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;

struct Paired {
  double n{}, sum{}, squares{};
  void add(double x) { n += 1, sum += x, squares += x * x; }
  double mean() const { return n > 0 ? sum / n : 0; }
  double error() const {
    return n > 1 ? std::sqrt(std::max(0.0, squares - n * mean() * mean()) / (n - 1) / n) : 0;
  }
  double t() const { return error() > 0 ? mean() / error() : 0; }
  /// One-sided: the mean is above zero.
  double p() const { return n > 2 && mean() > 0 ? 0.5 * f_tail(t() * t(), 1, n - 1) : 1; }
};

/// Mean held-out error of every slip [deg].
std::map<int, double> by_slip(const SlipSamples& slips, const std::vector<double>& errors) {
  std::map<int, std::pair<double, double>> sums;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    auto& [sum, n] = sums[slips.samples[i].slip];
    sum += errors[i], n += 1;
  }
  std::map<int, double> out;
  for (const auto& [slip, s] : sums) out[slip] = s.first / s.second;
  return out;
}

/// Do pushes that know nothing of each other err the same way where their wrenches are alike? Every sample
/// against the one of another slip whose direction of wrench is nearest; slips are the observations.
Paired left_by(const SlipSamples& slips, const SlipSurface& surface, double& correlation) {
  const std::size_t n = slips.samples.size();
  std::vector<Eigen::Vector3d> residual(n), at(n);
  double squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const auto& s = slips.samples[i];
    const auto normal = surface.normal(s.wrench);
    residual[i] =
        Eigen::Vector3d(s.direction[0] - normal[0], s.direction[1] - normal[1], s.direction[2] - normal[2]);
    at[i] = Eigen::Vector3d(s.wrench[0], s.wrench[1], s.wrench[2]).normalized();
    squares += residual[i].squaredNorm() / static_cast<double>(n);
  }
  std::map<int, std::pair<double, double>> sums;
  for (std::size_t i = 0; i < n; ++i) {
    double nearest = -2;
    std::size_t other = i;
    for (std::size_t j = 0; j < n; ++j)
      if (slips.samples[j].slip != slips.samples[i].slip && at[i].dot(at[j]) > nearest)
        nearest = at[i].dot(at[j]), other = j;
    if (other == i) continue;
    auto& [sum, count] = sums[slips.samples[i].slip];
    sum += residual[i].dot(residual[other]) / squares, count += 1;
  }
  Paired out;
  for (const auto& [slip, s] : sums) out.add(s.first / s.second);
  correlation = out.mean();
  return out;
}

double in_sample(const SlipSamples& slips, const SlipSurface& surface) {
  double out = 0;
  for (const auto& s : slips.samples) out += kDegrees * direction_error(surface, s);
  return slips.samples.empty() ? 0 : out / static_cast<double>(slips.samples.size());
}

double level_error(const SlipSamples& slips, const SlipSurface& surface) {
  double out = 0;
  for (const auto& s : slips.samples) out += std::abs(surface.gauge(s.wrench) - 1);
  return slips.samples.empty() ? 0 : out / static_cast<double>(slips.samples.size());
}

std::string id_of(SurfaceModel model) { return "contact.law:" + to_string(model); }

}  // namespace

SurfaceDiscovery discover_surfaces(const datasets::SlipLog& log, const SurfaceDiscoveryOptions& options) {
  std::vector<SlipSamples> surfaces;
  for (const auto& [name, surface] : log.surfaces) surfaces.push_back(slip_samples(name, surface));
  return discover_surfaces(surfaces, options);
}

SurfaceDiscovery discover_surfaces(const std::vector<SlipSamples>& surfaces,
                                   const SurfaceDiscoveryOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  SurfaceDiscovery out;
  MeasuredDiscovery& answer = out.answer;
  answer.kind = "slips";
  answer.model = to_string(options.base);
  answer.phase = "release";
  std::vector<SurfaceModel> models{options.base};
  for (const SurfaceModel model : surface_models)
    if (model != options.base &&
        std::find(options.forget.begin(), options.forget.end(), id_of(model)) == options.forget.end())
      models.push_back(model);
  const auto scores = compare_surfaces(surfaces, models, options.comparison);

  // Every law against the base, over slips.
  std::vector<Paired> pooled(models.size());
  std::vector<int> better(models.size()), compared(models.size());
  std::vector<double> errors(models.size()), base_errors(models.size()), train(models.size()),
      level(models.size()), null_gain(models.size());
  double used = 0;
  std::vector<Paired> left_pooled(models.size());
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const SurfaceScore& base = scores[i].front();
    for (const auto& score : scores[i])
      if (!score.scored())
        answer.skipped.push_back({surfaces[i].surface + ", " + to_string(score.model), score.reason});
    if (!base.scored()) continue;
    used += 1;
    answer.test += static_cast<int>(surfaces[i].slips.size());
    const auto of_base = by_slip(surfaces[i], base.errors_deg);
    for (std::size_t k = 0; k < models.size(); ++k) {
      const SurfaceScore& score = scores[i][k];
      if (!score.scored()) continue;
      SurfaceEvidence e{surfaces[i].surface,
                        models[k],
                        static_cast<int>(of_base.size()),
                        base.mean_deg,
                        score.mean_deg,
                        base.null_control_deg,
                        score.null_control_deg,
                        0,
                        0,
                        0,
                        0};
      Paired own;
      for (const auto& [slip, error] : by_slip(surfaces[i], score.errors_deg)) {
        own.add(of_base.at(slip) - error);
        pooled[k].add(of_base.at(slip) - error);
      }
      e.gain_deg = own.mean(), e.gain_sigma = own.error();
      const Paired left_here = left_by(surfaces[i], score.fit.surface, e.left);
      e.left_sigma = left_here.error();
      left_pooled[k].n += left_here.n, left_pooled[k].sum += left_here.sum,
          left_pooled[k].squares += left_here.squares;
      better[k] += score.mean_deg < base.mean_deg ? 1 : 0, ++compared[k];
      errors[k] += score.mean_deg, base_errors[k] += base.mean_deg;
      null_gain[k] += base.null_control_deg - score.null_control_deg;
      train[k] += in_sample(surfaces[i], score.fit.surface);
      level[k] += level_error(surfaces[i], score.fit.surface);
      out.evidence.push_back(std::move(e));
    }
  }
  if (used == 0) {
    answer.verdict = Verdict::not_answered;
    answer.message = answer.skipped.empty() ? "no surface" : answer.skipped.front().second;
    return out;
  }
  for (auto* sums : {&errors, &base_errors, &train, &level, &null_gain})
    for (std::size_t k = 0; k < models.size(); ++k) (*sums)[k] /= std::max(1, compared[k]);
  answer.train = answer.test;

  const double rate = options.family_wise_level / std::max<double>(1, static_cast<double>(models.size()) - 1);
  std::size_t best = 0;
  for (std::size_t k = 1; k < models.size(); ++k) {
    const double gain = base_errors[k] - errors[k];
    Ranked r{id_of(models[k]), std::max(0.0, pooled[k].t() * pooled[k].t())};
    r.p_value = pooled[k].p(), r.refit_step = 1, r.held_out_gain = gain;
    r.delta_bic = std::log(std::max(2.0, pooled[k].n)) - pooled[k].t() * std::abs(pooled[k].t());
    answer.ranking.push_back(r);
    const bool convinces =
        pooled[k].p() < rate && gain > options.matters * base_errors[k] && gain > null_gain[k];
    // Ellipsoids come first: a richer law has to be better by a twentieth.
    if (convinces && (best == 0 || errors[k] / base_errors[k] < 0.95 * errors[best] / base_errors[best]))
      best = k;
  }
  const auto named = [&](std::size_t k, double error) {
    return NamedErrors{{"direction_mae_deg", error}, {"level_mae", level[k]}};
  };
  answer.before_train = named(0, train[0]), answer.after_train = named(best, train[best]);
  answer.before_test = {{"direction_mae_deg", errors[0]}},
  answer.after_test = {{"direction_mae_deg", errors[best]}};
  std::sort(answer.ranking.begin(), answer.ranking.end(),
            [](const Ranked& a, const Ranked& b) { return a.gain > b.gain; });
  for (auto& r : answer.ranking) r.correlation_with_best = r.id == id_of(models[best]) ? 1 : 0;

  if (best > 0) {
    AcceptedEffect effect;
    effect.id = id_of(models[best]);
    effect.p_value = pooled[best].p();
    effect.delta_bic = std::log(std::max(2.0, pooled[best].n)) - pooled[best].t() * pooled[best].t();
    effect.test_error_ratio = errors[best] / errors[0];
    effect.parameters.push_back({"gain", "deg", pooled[best].mean(), pooled[best].error()});
    effect.why = fmt::format(
        "mean angle between predicted and measured direction of sliding falls from {:.2f} to {:.2f} degrees, "
        "on {} of {} "
        "surfaces",
        errors[0], errors[best], better[best], compared[best]);
    answer.effects.push_back(std::move(effect));
    answer.evidence.push_back(
        {id_of(models[best]),
         fmt::format("Null control: on data simulated from the fitted {} with its own residuals as noise, "
                     "the same law loses "
                     "{:.2f} degrees; what it gains on the measurement is not flexibility",
                     to_string(options.base), -null_gain[best]),
         null_gain[best] > 0});
    answer.separating.push_back({id_of(models[best]),
                                 "a shape of the limit surface and a pressure that is not the same "
                                 "everywhere: pushes with the weight moved, or "
                                 "wrenches at a fixed normal force over all directions"});
  }
  for (const auto& e : out.evidence)
    if (e.law == models[best] && best > 0 && e.gain_deg < 2 * e.gain_sigma)
      answer.evidence.push_back(
          {id_of(models[best]),
           fmt::format("On {} it gains only {:.2f} ± {:.2f} degrees", e.surface, e.gain_deg, e.gain_sigma),
           true});
  const Paired& l = left_pooled[best];
  answer.evidence.push_back(
      {"",
       fmt::format("Residual directions of neighbouring wrenches of different slips correlate by {:.3f} ± "
                   "{:.3f} ({} before)",
                   l.mean(), l.error(),
                   fmt::format("{:.3f} ± {:.3f}", left_pooled[0].mean(), left_pooled[0].error())),
       l.mean() > options.unexplained && l.t() > 3});
  answer.first = {left_pooled[0].t() > 3 && left_pooled[0].mean() > options.unexplained, 0, "direction",
                  errors[0]};
  if (l.mean() > options.unexplained && l.t() > 3)
    answer.unexplained = MeasuredUnexplained{
        answer.phase, "direction", l.mean(),
        fmt::format("pushes that know nothing of each other err the same way where their wrenches are alike "
                    "(correlation {:.2f} ± {:.2f}): the surface has features that the law has not; on three "
                    "feet a limit surface has flat facets and edges, which no smooth law follows",
                    l.mean(), l.error())};
  answer.misfit.push_back(
      {"direction", static_cast<int>(pooled[0].n), train[0], errors[0], train[best], errors[best]});
  answer.verdict = best > 0             ? Verdict::effect_found
                   : answer.unexplained ? Verdict::unexplained
                                        : Verdict::no_missing_effect;
  answer.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return out;
}

}  // namespace unhand::fitting
