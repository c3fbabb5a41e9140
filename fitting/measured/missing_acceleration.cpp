#include "fitting/measured/missing_acceleration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "dynamics/dense_solve.hpp"
#include "dynamics/parallel.hpp"
#include "fitting/hat.hpp"

namespace unhand::fitting {

using dynamics::gram, dynamics::inner_products, dynamics::pseudo_inverse, dynamics::product;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using flight::Vec3;

namespace {

constexpr int kKnots = 6, kFolds = 5;
constexpr std::size_t kFewestTrain = 10;
/// Second differences, and values, cost this share of what the best determined knot is worth: what the rows
/// hardly tell stays near zero.
constexpr double kSmooth = 1e-3;

/// Directions at a sample, one per component; zero where there is none.
using Directions = std::function<Vec3<double>(const GroupMotion&, std::size_t sample, std::size_t component)>;

struct Form {
  std::string of;
  std::vector<std::string> along;  ///< by component
  Directions direction;
  bool of_speed;  ///< else of time
};

Vec3<double> unit(const Vec3<double>& x) {
  const double size = flight::norm(x);
  return size > 0 ? flight::scaled(1 / size, x) : Vec3<double>{};
}

std::vector<Form> forms() {
  const auto velocity = [](const GroupMotion& m, std::size_t i, std::size_t) { return unit(m.velocity[i]); };
  const auto lift = [](const GroupMotion& m, std::size_t i, std::size_t) {
    return m.spin.empty() ? Vec3<double>{} : unit(flight::cross(m.spin[i], m.velocity[i]));
  };
  const auto world = [](const GroupMotion& m, std::size_t, std::size_t c) {
    Vec3<double> out{};
    if (m.in_world) out[c] = 1;
    return out;
  };
  const auto body = [](const GroupMotion& m, std::size_t i, std::size_t c) {
    return m.body.empty() ? Vec3<double>{} : m.body[i][c];
  };
  const std::vector<std::string> axes{"x", "y", "z"}, of_body{"the body's x", "the body's y", "the body's z"};
  return {{"along the velocity", {"the velocity"}, velocity, true},
          {"along the velocity", {"the velocity"}, velocity, false},
          {"along omega x v", {"omega x v"}, lift, true},
          {"along the axes of the world", axes, world, false},
          {"along the axes of the body", of_body, body, false},
          {"along the axes of the body", of_body, body, true}};
}

double argument(const GroupMotion& motion, std::size_t sample, const Form& form) {
  return form.of_speed ? flight::norm(motion.velocity[sample]) : motion.time[sample];
}

/// A group's rows and how it moved.
struct Seen {
  std::size_t group{};
  GroupMotion motion;
  GroupEquations equations;  ///< with derivatives by everything
};

std::vector<Seen> seen_in(const GroupedProblem& problem, const GroupedFit& fit, int threads) {
  std::vector<Seen> out;
  for (const std::size_t i : fit.solved_groups()) out.push_back({i, {}, {}});
  const auto names = fit.names();
  const std::vector<double> values(fit.values.data(), fit.values.data() + fit.values.size());
  dynamics::parallel_for(out.size(), threads, [&](std::size_t n) {
    const std::size_t i = out[n].group;
    out[n].motion = problem.motion(i, names, values, fit.groups[i].own);
    out[n].equations = problem.equations(i, names, values, fit.groups[i].own, Derivatives::all);
  });
  std::erase_if(out, [](const Seen& one) { return one.motion.time.empty() || !one.equations.solved; });
  return out;
}

/// Between the hundredths of what the samples have.
std::vector<double> knots_of(const std::vector<Seen>& seen, const Form& form) {
  std::vector<double> all;
  for (const Seen& one : seen)
    for (std::size_t i = 0; i < one.motion.time.size(); ++i) all.push_back(argument(one.motion, i, form));
  std::sort(all.begin(), all.end());
  const std::size_t cut = all.size() / 100;
  const double low = all[cut], high = all[all.size() - 1 - cut];
  std::vector<double> out;
  for (int j = 0; j < kKnots; ++j) out.push_back(low + (high - low) * j / (kKnots - 1));
  return out;
}

/// Gram matrices of every group's [shared unknowns, knots by component, residual], its own unknowns projected
/// out.
std::vector<MatrixXd> parts_of(const GroupedProblem& problem, const GroupedFit& fit,
                               const std::vector<Seen>& seen, const Form& form,
                               const std::vector<double>& knots, const GroupedFitOptions& options) {
  std::vector<MatrixXd> out(seen.size());
  dynamics::parallel_for(seen.size(), options.threads, [&](std::size_t n) {
    const auto& [group, motion, equations] = seen[n];
    std::vector<VectorXd> columns;
    for (std::size_t c = 0; c < form.along.size(); ++c)
      for (std::size_t j = 0; j < knots.size(); ++j) {
        std::vector<Vec3<double>> a;
        for (std::size_t i = 0; i < motion.time.size(); ++i)
          a.push_back(flight::scaled(hat(knots, j, argument(motion, i, form)), form.direction(motion, i, c)));
        columns.push_back(problem.response(group, a));
      }
    GroupEquations e = equations;
    const Index shared = e.shared.cols(), width = static_cast<Index>(columns.size());
    MatrixXd with(e.residual.size(), shared + width);
    with.leftCols(shared) = e.shared;
    for (Index k = 0; k < width; ++k) with.col(shared + k) = columns[static_cast<std::size_t>(k)];
    e.shared = std::move(with);
    const auto p = projected(std::move(e), problem.groups()[group], fit.weights, options.sample_limit);
    out[n] = fit.weights.group[group] * gram(p.columns);
  });
  return out;
}

/// The same where every one of these objects has functions of its own.
std::vector<MatrixXd> of_objects(const std::vector<MatrixXd>& parts, Index shared,
                                 const std::vector<Seen>& seen, const GroupedProblem& problem,
                                 const std::vector<std::string>& objects) {
  std::vector<MatrixXd> out;
  for (std::size_t n = 0; n < parts.size(); ++n) {
    const Index width = parts[n].rows() - 1 - shared,
                all = shared + static_cast<Index>(objects.size()) * width;
    const auto own = std::find(objects.begin(), objects.end(), problem.groups()[seen[n].group].object);
    std::vector<Index> places;
    for (Index k = 0; k < shared; ++k) places.push_back(k);
    for (Index k = 0; k < width; ++k) places.push_back(shared + (own - objects.begin()) * width + k);
    places.push_back(all);
    out.push_back(MatrixXd::Zero(all + 1, all + 1));
    out.back()(places, places) = parts[n];
  }
  return out;
}

/// The knots and what the shared unknowns do beside them, from the groups for which `use`.
struct Estimate {
  VectorXd change;   ///< shared, then knots
  MatrixXd inverse;  ///< of the knots' information, smoothness included
  MatrixXd taken;    ///< by the shared unknowns, of every knot's column
};
Estimate estimate(const std::vector<MatrixXd>& parts, Index shared, std::size_t functions,
                  const std::function<bool(std::size_t)>& use) {
  const Index all = parts.front().rows() - 1, width = all - shared;
  MatrixXd H = MatrixXd::Zero(all + 1, all + 1);
  for (std::size_t n = 0; n < parts.size(); ++n)
    if (use(n)) H += parts[n];
  // What the shared unknowns can do is theirs.
  const MatrixXd taken =
      product(pseudo_inverse(H.topLeftCorner(shared, shared)), H.topRows(shared).rightCols(width + 1));
  MatrixXd rest = H.bottomRightCorner(width + 1, width + 1) -
                  inner_products(H.topRows(shared).rightCols(width + 1), taken);
  MatrixXd A = rest.topLeftCorner(width, width);
  const double most = A.diagonal().maxCoeff();
  Estimate out{VectorXd::Zero(all), MatrixXd::Zero(width, width), taken.leftCols(width)};
  if (!(most > 0)) return out;
  for (std::size_t c = 0; c < functions; ++c) {
    const Index first = static_cast<Index>(c) * kKnots;
    const double scale = A.diagonal().segment(first, kKnots).maxCoeff();
    A.diagonal().segment(first, kKnots).array() += kSmooth * scale;
    for (Index k = first; k + 2 < first + kKnots; ++k) {
      const std::array<double, 3> bend{1, -2, 1};
      for (Index i = 0; i < 3; ++i)
        for (Index j = 0; j < 3; ++j)
          A(k + i, k + j) +=
              kSmooth * scale * bend[static_cast<std::size_t>(i)] * bend[static_cast<std::size_t>(j)];
    }
  }
  out.inverse = pseudo_inverse(A);
  out.change.tail(width) = -product(out.inverse, rest.topRightCorner(width, 1));
  out.change.head(shared) = -taken.rightCols(1) - product(taken.leftCols(width), out.change.tail(width));
  return out;
}

/// By how much it lowers a group's χ².
double gain_of(const MatrixXd& part, const VectorXd& change) {
  const Index all = change.size();
  const VectorXd bent = product(part.topLeftCorner(all, all), change);
  return -(change.dot(bent) + 2 * change.dot(part.topRightCorner(all, 1).col(0)));
}

/// The slope of half of χ² at the change: what noise, and whatever else is missing, leaves to gain.
VectorXd score_of(const MatrixXd& part, const VectorXd& change) {
  const Index all = change.size();
  return part.topRightCorner(all, 1).col(0) + product(part.topLeftCorner(all, all), change);
}

/// The gain over train groups that it was not estimated from.
double cross_validated(const std::vector<MatrixXd>& parts, Index shared, std::size_t functions) {
  double gain = 0;
  for (int fold = 0; fold < kFolds; ++fold) {
    const auto in_fold = [&](std::size_t n) { return static_cast<int>(n) % kFolds == fold; };
    const Estimate one = estimate(parts, shared, functions, [&](std::size_t n) { return !in_fold(n); });
    for (std::size_t n = 0; n < parts.size(); ++n)
      if (in_fold(n)) gain += gain_of(parts[n], one.change);
  }
  return gain;
}

/// From the scatter of the groups' scores.
VectorXd sigmas(const std::vector<MatrixXd>& parts, Index shared, const Estimate& of) {
  const Index all = of.change.size(), width = all - shared;
  MatrixXd scatter = MatrixXd::Zero(width, width);
  for (const MatrixXd& part : parts) {
    const VectorXd all_scores = score_of(part, of.change);
    const VectorXd score = all_scores.tail(width) - inner_products(of.taken, all_scores.head(shared));
    scatter += score * score.transpose();
  }
  const auto groups = static_cast<double>(parts.size());
  const MatrixXd covariance =
      product(product(of.inverse, scatter), of.inverse) * (groups / std::max(1.0, groups - 1));
  return covariance.diagonal().cwiseMax(of.inverse.diagonal()).cwiseSqrt();
}

}  // namespace

std::string MissingComponent::name() const { return object.empty() ? along : along + " of " + object; }

std::optional<MissingAcceleration> missing_acceleration(const GroupedProblem& problem, const GroupedFit& fit,
                                                        const GroupedFit& held_out,
                                                        const GroupedFitOptions& options) {
  const auto train = seen_in(problem, fit, options.threads),
             test = seen_in(problem, held_out, options.threads);
  if (train.size() < kFewestTrain || test.empty()) return {};
  const auto shared = static_cast<Index>(fit.shared.size());
  const Form* best = nullptr;
  double best_gain = 0;
  std::vector<double> knots;
  std::vector<MatrixXd> parts;
  const auto all = forms();
  const std::vector<std::string> each = objects_of(problem), together{""};
  std::vector<std::string> objects;  // who has functions of their own: each, or all together
  for (const Form& form : all) {
    const auto at = knots_of(train, form);
    if (!(at.back() > at.front())) continue;
    const auto take = [&](std::vector<MatrixXd> its, const std::vector<std::string>& of) {
      const double gain = cross_validated(its, shared, of.size() * form.along.size());
      if (!(gain > best_gain)) return;
      best = &form, best_gain = gain, objects = of, knots = at, parts = std::move(its);
    };
    const auto its = parts_of(problem, fit, train, form, at, options);
    take(its, together);
    if (each.size() > 1) take(of_objects(its, shared, train, problem, each), each);
  }
  if (!best) return {};
  const std::size_t along = best->along.size(), functions = objects.size() * along;
  const Estimate found = estimate(parts, shared, functions, [](std::size_t) { return true; });
  const VectorXd sigma = sigmas(parts, shared, found);

  MissingAcceleration out;
  out.of = best->of;
  out.against = best->of_speed ? "speed [m/s]" : "time [s]";
  for (std::size_t c = 0; c < functions; ++c) {
    MissingComponent component{best->along[c % along], objects[c / along], knots, {}, {}};
    double information = 0;
    for (std::size_t j = 0; j < knots.size(); ++j) {
      const auto k = static_cast<Index>(c * knots.size() + j);
      component.value.push_back(found.change[shared + k]);
      component.sigma.push_back(sigma[k]);
      for (const MatrixXd& part : parts) information += part(shared + k, shared + k);
    }
    if (information > 0) out.components.push_back(std::move(component));
  }
  auto judges = parts_of(problem, fit, test, *best, knots, options);
  if (objects != together) judges = of_objects(judges, shared, test, problem, objects);
  double before = 0, gain = 0, left = 0, samples = 0;
  for (std::size_t n = 0; n < judges.size(); ++n) {
    const Index last = judges[n].rows() - 1;
    before += judges[n](last, last), gain += gain_of(judges[n], found.change);
    left += std::pow(score_of(judges[n], found.change).dot(found.change), 2);
    const Group& group = problem.groups()[test[n].group];
    samples += fit.weights.group[test[n].group] * (held_out.groups[test[n].group].n - group.taken());
  }
  out.test_before = before / std::max(1.0, samples);
  out.test_after = (before - gain) / std::max(1.0, samples);
  out.helps = gain > 2 * 2 * std::sqrt(left);
  return out;
}

}  // namespace unhand::fitting
