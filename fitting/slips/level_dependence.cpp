#include "fitting/slips/level_dependence.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"

namespace unhand::fitting {
namespace {

constexpr int kMostRounds = 20;  // of a surface in turn with what its level depends on
constexpr LevelBy kQuestions[] = {LevelBy::viscous, LevelBy::stribeck, LevelBy::order, LevelBy::sense};

/// Whether id `a` comes before `b`, numbers in them by their value: 2 before 10.
bool is_before(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    const auto number = [&](const std::string& s, std::size_t& at) {
      while (at < s.size() && s[at] == '0') ++at;
      const std::size_t begin = at;
      while (at < s.size() && digit(s[at])) ++at;
      return s.substr(begin, at - begin);
    };
    const std::string m = number(a, i), n = number(b, j);
    if (m.size() != n.size()) return m.size() < n.size();
    if (m != n) return m < n;
  }
  return a.size() - i < b.size() - j;
}

bool is_of_speed(LevelBy by) { return by == LevelBy::viscous || by == LevelBy::stribeck; }

/// Levels of one surface beside what they may depend on.
struct Levels {
  const SlipSamples* slips{};
  std::vector<double> level;  ///< gauge, 1 on the surface
  std::vector<double> place;  ///< of every slip in the order of ids, −1/2 to 1/2
  std::vector<double> speed;  ///< |(v_x, v_y, r ω)| [m/s], r the largest torque over the mean largest force

  Levels(const SlipSamples& of, const SlipSurface& fit) : slips(&of), place(of.slips.size()) {
    std::vector<std::size_t> order(of.slips.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return is_before(of.slips[a], of.slips[b]); });
    for (std::size_t k = 0; k < order.size(); ++k)
      place[order[k]] = static_cast<double>(k) / std::max(1.0, static_cast<double>(order.size()) - 1) - 0.5;
    const SlipSurface::Extremes e = fit.extremes();
    const double radius = e.torque / std::sqrt(e.least_force * e.largest_force),
                 share = radius / of.characteristic_length;
    for (const SlipSample& s : of.samples) {
      level.push_back(fit.gauge(s.wrench));
      speed.push_back(s.speed * std::hypot(s.direction[0], s.direction[1], share * s.direction[2]));
    }
  }
  const SlipSample& sample(std::size_t i) const { return slips->samples[i]; }
};

/// a (1 + Σ b f) with the columns of some questions, fitted to some samples.
class LevelFit {
 public:
  LevelFit(const Levels& levels, std::vector<LevelBy> of, const std::vector<std::size_t>& rows)
      : of_(std::move(of)) {
    for (const LevelBy by : of_) sides_.insert(sides_.end(), width(by), is_of_speed(by) ? 1 : 0);
    design_.resize(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(sides_.size()));
    level_.resize(design_.rows());
    double least = HUGE_VAL, most = 0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const std::size_t i = rows[k];
      design_.row(static_cast<Eigen::Index>(k)) = columns(levels, i).transpose();
      level_[static_cast<Eigen::Index>(k)] = levels.level[i];
      least = std::min(least, levels.speed[i]), most = std::max(most, levels.speed[i]);
    }
    if (std::find(of_.begin(), of_.end(), LevelBy::stribeck) == of_.end() || !(most > least && least > 0)) {
      solve();
      return;
    }
    search_speed(levels, rows, least, most);
  }

  double at(const Levels& levels, std::size_t i) const { return columns(levels, i).dot(x_); }

  /// How many numbers were fitted.
  std::size_t unknowns() const {
    const bool shaped = std::find(of_.begin(), of_.end(), LevelBy::stribeck) != of_.end();
    return sides_.size() + (shaped ? 1 : 0);
  }

  /// The sizes of `by`, as level_dependence names them; of the sense one for each component of the wrench.
  Eigen::VectorXd sizes(LevelBy by) const {
    const auto first = static_cast<Eigen::Index>(place(by));
    const Eigen::VectorXd relative =
        x_.segment(first, static_cast<Eigen::Index>(width(by))) / x_[0];  // to the level without it
    switch (by) {
      case LevelBy::viscous:
      case LevelBy::order:
        return relative;
      case LevelBy::stribeck:
        return Eigen::Vector2d(1 + relative[0], stribeck_speed_);
      case LevelBy::sense:
        break;
    }
    return 2 * relative;  // one way against the other
  }

 private:
  static std::size_t width(LevelBy by) { return by == LevelBy::sense ? 3 : 1; }
  std::size_t place(LevelBy by) const {
    std::size_t k = 1;
    for (const LevelBy one : of_) {
      if (one == by) break;
      k += width(one);
    }
    return k;
  }
  Eigen::VectorXd columns(const Levels& levels, std::size_t i) const {
    const SlipSample& s = levels.sample(i);
    std::vector<double> out{1};
    for (const LevelBy by : of_) switch (by) {
        case LevelBy::viscous:
          out.push_back(levels.speed[i]);
          break;
        case LevelBy::stribeck:
          out.push_back(falling(levels.speed[i]));
          break;
        case LevelBy::order:
          out.push_back(levels.place[static_cast<std::size_t>(s.slip)]);
          break;
        case LevelBy::sense: {
          const double size = std::hypot(s.wrench[0], s.wrench[1], s.wrench[2]);
          for (const double w : s.wrench) out.push_back(w / size);
          break;
        }
      }
    return Eigen::Map<const Eigen::VectorXd>(out.data(), static_cast<Eigen::Index>(out.size()));
  }
  /// From speeds at which all slips but the slowest are kinetic to ones at which friction falls in all of
  /// them; then finer about the best.
  void search_speed(const Levels& levels, const std::vector<std::size_t>& rows, double least, double most) {
    constexpr int kGrid = 24;
    const double ratio = std::pow(3 * most / least, 1.0 / kGrid);
    double best = HUGE_VAL, at = least;
    const auto take = [&](double speed) {
      solve_at(levels, rows, speed);
      if (squares_ < best) best = squares_, at = speed;
    };
    for (int k = 0; k <= kGrid; ++k) take(least * std::pow(ratio, k));
    for (double step = std::sqrt(ratio); step > 1.002; step = std::sqrt(step)) {
      const double middle = at;
      take(middle * step), take(middle / step);
    }
    solve_at(levels, rows, at);
  }
  /// Of the columns as they are, and of Stribeck's at another speed.
  void solve() {
    x_ = dynamics::pseudo_solve(dynamics::gram(design_), design_.transpose() * level_, sides_);
    squares_ = (level_ - design_ * x_).squaredNorm();
  }
  void solve_at(const Levels& levels, const std::vector<std::size_t>& rows, double speed) {
    stribeck_speed_ = speed;
    const auto column = static_cast<Eigen::Index>(place(LevelBy::stribeck));
    for (std::size_t k = 0; k < rows.size(); ++k)
      design_(static_cast<Eigen::Index>(k), column) = falling(levels.speed[rows[k]]);
    solve();
  }
  double falling(double speed) const { return std::exp(-std::pow(speed / stribeck_speed_, 2)); }

  std::vector<LevelBy> of_;
  std::vector<int> sides_{0};  // friction rises, or falls, with speed as its effect says
  Eigen::MatrixXd design_;     // a row per sample
  Eigen::VectorXd level_, x_;
  double stribeck_speed_{1};  // [m/s]
  double squares_{};
};

std::vector<std::size_t> rows_where(const Levels& levels, const auto& is_taken) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < levels.level.size(); ++i)
    if (is_taken(levels.sample(i).slip)) out.push_back(i);
  return out;
}

/// |level − predicted| of every sample by the folds that left its slip out.
std::vector<double> held_out(const Levels& levels, const std::vector<LevelBy>& of, int folds) {
  std::vector<double> out(levels.level.size());
  for (int fold = 0; fold < folds; ++fold) {
    const auto is_left_out = [&](int slip) { return slip % folds == fold; };
    const LevelFit fit(levels, of, rows_where(levels, [&](int slip) { return !is_left_out(slip); }));
    for (const std::size_t i : rows_where(levels, is_left_out))
      out[i] = std::abs(levels.level[i] - fit.at(levels, i));
  }
  return out;
}

/// Held-out errors of all surfaces with some questions asked.
struct Errors {
  std::vector<std::vector<double>> of;  ///< by surface, sample
  double mean{};                        ///< over the surfaces' means
};
Errors errors_with(const std::vector<Levels>& all, const std::vector<LevelBy>& questions, int folds) {
  Errors out;
  for (const Levels& levels : all) {
    out.of.push_back(held_out(levels, questions, folds));
    Paired errors;
    for (const double error : out.of.back()) errors.add(error);
    out.mean += errors.mean() / static_cast<double>(all.size());
  }
  return out;
}

/// By slip: how much less the second errs.
Paired gain_of(const std::vector<Levels>& all, const Errors& before, const Errors& after) {
  Paired out;
  for (std::size_t k = 0; k < all.size(); ++k) {
    std::map<int, Paired> of_slip;
    for (std::size_t i = 0; i < all[k].level.size(); ++i)
      of_slip[all[k].sample(i).slip].add(before.of[k][i] - after.of[k][i]);
    for (const auto& [slip, gain] : of_slip) out.add(gain.mean());
  }
  return out;
}

std::vector<std::size_t> all_rows(const Levels& levels) {
  return rows_where(levels, [](int) { return true; });
}

/// A surface in turn with what its level depends on: fitted to the wrenches without that.
struct InTurn {
  SlipSurface surface;
  Levels levels;  ///< refers to the slips
  LevelFit fit;

  InTurn(const SlipSamples& slips, const SlipSurface& start, const std::vector<LevelBy>& of, int most_rounds)
      : surface(start), levels(slips, start), fit(levels, of, all_rows(levels)) {
    constexpr double kAtRest = 1e-4;  // of a factor
    if (of.empty()) return;
    std::vector<double> factors(slips.samples.size(), 1.0);
    for (int round = 0; round < most_rounds; ++round) {
      SlipSamples level = slips;
      double moved = 0;
      for (std::size_t i = 0; i < level.samples.size(); ++i) {
        const double factor = fit.at(levels, i);
        if (!(factor > 0)) return;
        moved = std::max(moved, std::abs(factor - std::exchange(factors[i], factor)));
        for (double& w : level.samples[i].wrench) w /= factor;
      }
      if (moved <= kAtRest) return;
      const SurfaceFit again = fit_surface(level, surface.model);
      if (!again.fitted()) return;
      surface = again.surface;
      levels = Levels(slips, surface);
      fit = LevelFit(levels, of, all_rows(levels));
    }
  }
};

/// The sizes of `by` with their σ: those of `without` are the same, each without a part of the slips.
std::vector<Parameter> parameters(LevelBy by, const Eigen::VectorXd& sizes,
                                  const std::vector<Eigen::VectorXd>& without, double freedom) {
  const auto parts = static_cast<double>(without.size());
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(sizes.size());
  for (const Eigen::VectorXd& one : without) mean += one / parts;
  Eigen::MatrixXd C = Eigen::MatrixXd::Zero(sizes.size(), sizes.size());
  for (const Eigen::VectorXd& one : without)
    C += (parts - 1) / parts * (one - mean) * (one - mean).transpose();
  const auto sigma = [&](const Eigen::VectorXd& along) { return std::sqrt(along.dot(C * along)); };
  const auto sigma_of = [&](Eigen::Index k) { return sigma(Eigen::VectorXd::Unit(sizes.size(), k)); };
  switch (by) {
    case LevelBy::viscous:
      return {{"1/v_0", "s/m", sizes[0], sigma_of(0), freedom}};
    case LevelBy::stribeck:
      if (!(sizes[0] > 1)) return {{"mu_s/mu_k", "-", 1, sigma_of(0), freedom}};  // at no speed
      return {{"mu_s/mu_k", "-", sizes[0], sigma_of(0), freedom},
              {"v_s", "m/s", sizes[1], sigma_of(1), freedom}};
    case LevelBy::order:
      return {{"change", "-", sizes[0], sigma_of(0), freedom}};
    case LevelBy::sense:
      break;
  }
  return {{"change", "-", sizes.norm(), sigma(sizes.normalized()), freedom}};
}

/// Sizes of what was accepted on one surface; the surface is fitted again without each part of the slips.
void add_sizes(const SlipSamples& slips, const InTurn& whole, const std::vector<LevelBy>& accepted,
               int threads, LevelAnswer& out) {
  constexpr std::size_t kMostParts = 20;
  constexpr int kRounds = 2;  // from where the whole rests: sigmas are within 2 % of those at rest
  const std::size_t parts = std::min(kMostParts, slips.slips.size());
  const double freedom = static_cast<double>(parts) - static_cast<double>(whole.fit.unknowns());
  if (!(freedom > 0)) return;
  std::vector<std::optional<LevelFit>> without(parts);
  dynamics::parallel_for(parts, threads, [&](std::size_t part) {
    SlipSamples rest = slips;
    std::erase_if(rest.samples,
                  [&](const SlipSample& s) { return static_cast<std::size_t>(s.slip) % parts == part; });
    without[part] = InTurn(rest, whole.surface, accepted, kRounds).fit;
  });
  for (LevelDependence& one : out.found) {
    std::vector<Eigen::VectorXd> sizes;
    for (const auto& fit : without) sizes.push_back(fit->sizes(one.by));
    for (Parameter p : parameters(one.by, whole.fit.sizes(one.by), sizes, freedom)) {
      p.name += "[" + slips.surface + "]";
      one.parameters.push_back(std::move(p));
    }
  }
}

/// Surfaces of enough slips.
std::vector<std::size_t> judged(const std::vector<SlipSamples>& slips, int folds) {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < slips.size(); ++k)
    if (slips[k].slips.size() >= 2 * static_cast<std::size_t>(folds) && !slips[k].samples.empty())
      out.push_back(k);
  return out;
}

}  // namespace

std::string level_effect(LevelBy by) {
  return by == LevelBy::viscous ? kViscous : by == LevelBy::stribeck ? kStribeck : "";
}

double level_error(const std::vector<SlipSamples>& slips, const std::vector<SlipSurface>& fits, int folds) {
  std::vector<Levels> all;
  for (const std::size_t k : judged(slips, folds)) all.emplace_back(slips[k], fits[k]);
  return errors_with(all, {}, folds).mean;
}

LevelAnswer level_dependence(const std::vector<SlipSamples>& slips, const std::vector<SlipSurface>& fits,
                             const SurfaceDiscoveryOptions& options) {
  const int folds = options.comparison.folds;
  const std::vector<std::size_t> which = judged(slips, folds);
  std::vector<Levels> all;
  for (const std::size_t k : which) all.emplace_back(slips[k], fits[k]);
  LevelAnswer out;
  if (all.empty()) return out;
  std::vector<LevelBy> accepted;
  Errors now = errors_with(all, {}, folds);
  out.before = now.mean;
  const double rate = options.family_wise_level / static_cast<double>(std::size(kQuestions));
  for (;;) {
    std::optional<LevelDependence> best;
    Errors best_errors;
    for (const LevelBy by : kQuestions) {
      const bool has_speed = std::any_of(accepted.begin(), accepted.end(), is_of_speed);
      if (options.is_forgotten(level_effect(by)) ||
          std::find(accepted.begin(), accepted.end(), by) != accepted.end() || (is_of_speed(by) && has_speed))
        continue;
      std::vector<LevelBy> with = accepted;
      with.push_back(by);
      Errors errors = errors_with(all, with, folds);
      const LevelDependence one{by, gain_of(all, now, errors), now.mean, errors.mean, {}};
      const bool significant = one.gain.p() < rate;
      const bool convinces = significant && one.before - one.after > options.matters * one.before;
      if (accepted.empty() && !level_effect(by).empty()) {
        Ranked r{level_effect(by), std::max(0.0, one.gain.t() * one.gain.t())};
        r.p_value = one.gain.p(), r.refit_step = 1, r.held_out_gain = one.before - one.after;
        r.delta_bic = one.gain.delta_bic();
        r.fate = convinces ? Fate::outdone : significant ? Fate::too_small : Fate::not_significant;
        out.ranking.push_back(std::move(r));
      }
      if (convinces && (!best || one.after < best->after)) best = one, best_errors = std::move(errors);
    }
    if (!best) break;
    accepted.push_back(best->by);
    out.found.push_back(*best);
    now = std::move(best_errors);
  }
  out.after = now.mean;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const SlipSamples& of = slips[which[k]];
    const InTurn whole(of, fits[which[k]], accepted, kMostRounds);
    Paired errors;
    for (std::size_t i = 0; i < whole.levels.level.size(); ++i)
      errors.add(std::abs(whole.levels.level[i] - whole.fit.at(whole.levels, i)));
    out.after_train += errors.mean() / static_cast<double>(all.size());
    if (!accepted.empty()) add_sizes(of, whole, accepted, options.comparison.threads, out);
  }
  return out;
}

}  // namespace unhand::fitting
