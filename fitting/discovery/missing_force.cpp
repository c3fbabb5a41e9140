#include "fitting/discovery/missing_force.hpp"

#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "dynamics/dense_solve.hpp"
#include "dynamics/twice_integrated.hpp"
#include "fitting/hat.hpp"

namespace unhand::fitting {

using dynamics::definite_inverse, dynamics::definite_solve, dynamics::gram, dynamics::inner_products,
    dynamics::orthonormal_basis, dynamics::pseudo_inverse, dynamics::pseudo_solve, dynamics::twice_integrated;

namespace {

using State = ResidualTrace::State;
using Vector3 = std::array<double, 3>;

/// The rows in which something was seen, with offset and slope projected out if they are the recording's own.
class Rows {
 public:
  Rows(const ResidualTrace& trace, int component, const MissingOptions& options)
      : trace_(trace), options_(options), sigma_(trace.sigma[static_cast<std::size_t>(component)]) {
    const auto& r = trace.residual[static_cast<std::size_t>(component)];
    for (std::size_t k = 0; k < r.size(); ++k)
      if (std::isfinite(r[k])) rows_.push_back(k);
    if (options.response == Response::twice_integrated && !rows_.empty()) {
      Eigen::MatrixXd line(static_cast<Eigen::Index>(rows_.size()), 2);
      for (std::size_t k = 0; k < rows_.size(); ++k)
        line.row(static_cast<Eigen::Index>(k)) << 1 / sigma_[rows_[k]],
            (trace.time[rows_[k]] - trace.time[rows_.front()]) / sigma_[rows_[k]];
      if (rows_.size() >= 3) own_ = orthonormal_basis(line);
    }
    seen_ = whitened(r, false);
  }
  bool enough() const { return rows_.size() >= 3; }
  const Eigen::VectorXd& seen() const { return seen_; }
  /// Of what was seen, less what was projected out.
  long degrees_of_freedom() const { return static_cast<long>(seen_.size() - own_.cols()); }
  /// What a missing quantity, given at every time of the trace, would do to the residual.
  Eigen::VectorXd response(const std::vector<double>& missing) const {
    return whitened(missing, options_.response == Response::twice_integrated);
  }

 private:
  Eigen::VectorXd whitened(const std::vector<double>& series, bool integrate) const {
    const std::vector<double> full = integrate ? twice_integrated(trace_.time, series) : series;
    Eigen::VectorXd out(static_cast<Eigen::Index>(rows_.size()));
    for (std::size_t k = 0; k < rows_.size(); ++k)
      out[static_cast<Eigen::Index>(k)] = full[rows_[k]] / sigma_[rows_[k]];
    if (own_.size() > 0) out -= own_ * (own_.transpose() * out);
    return out;
  }
  const ResidualTrace& trace_;
  const MissingOptions& options_;
  const std::vector<double>& sigma_;
  std::vector<std::size_t> rows_;
  Eigen::MatrixXd own_;
  Eigen::VectorXd seen_;
};

struct Term {
  dynamics::AccelerationForm form;
  std::string name, unit;
  std::function<Vector3(const State&)> at;
};

Vector3 moving(double x, double z) { return {x, z, 0}; }
Vector3 turning(double about) { return {0, 0, about}; }

std::vector<Term> acceleration_terms() {
  using Form = dynamics::AccelerationForm;
  const auto speed = [](const State& s) { return std::hypot(s.vx, s.vz); };
  return {
      {Form::quadratic, "|v| v", "1/m",
       [=](const State& s) { return moving(speed(s) * s.vx, speed(s) * s.vz); }},
      {Form::linear, "v", "1/s", [](const State& s) { return moving(s.vx, s.vz); }},
      {Form::cubic, "|v|^2 v", "s/m^2",
       [=](const State& s) {
         const double square = s.vx * s.vx + s.vz * s.vz;
         return moving(square * s.vx, square * s.vz);
       }},
      {Form::lift, "omega J v", "-", [](const State& s) { return moving(-s.omega * s.vz, s.omega * s.vx); }},
      {Form::along_x, "1 along x", "m/s^2", [](const State&) { return moving(1, 0); }},
      {Form::along_z, "1 along z", "m/s^2", [](const State&) { return moving(0, 1); }},
      {Form::along_body_x, "1 along the object's x", "m/s^2",
       [](const State& s) { return moving(std::cos(s.theta), std::sin(s.theta)); }},
      {Form::along_body_z, "1 along the object's z", "m/s^2",
       [](const State& s) { return moving(-std::sin(s.theta), std::cos(s.theta)); }},
      {Form::centripetal_x, "omega^2 along the object's x", "m",
       [](const State& s) {
         return moving(s.omega * s.omega * std::cos(s.theta), s.omega * s.omega * std::sin(s.theta));
       }},
      {Form::centripetal_z, "omega^2 along the object's z", "m",
       [](const State& s) {
         return moving(-s.omega * s.omega * std::sin(s.theta), s.omega * s.omega * std::cos(s.theta));
       }},
      {Form::turning, "1 in rotation", "rad/s^2", [](const State&) { return turning(1); }},
      {Form::turning_linear, "omega in rotation", "1/s", [](const State& s) { return turning(s.omega); }},
      {Form::turning_quadratic, "|omega| omega in rotation", "1/rad",
       [](const State& s) { return turning(std::abs(s.omega) * s.omega); }},
      {Form::turning_sine, "sin theta in rotation", "rad/s^2",
       [](const State& s) { return turning(std::sin(s.theta)); }},
      {Form::turning_cosine, "cos theta in rotation", "rad/s^2",
       [](const State& s) { return turning(std::cos(s.theta)); }}};
}

std::vector<Term> wrench_terms() {
  std::vector<Term> out;
  constexpr const char* kOf[] = {"fx", "fz", "tau"};
  constexpr const char* kUnit[] = {"N", "N", "N m"};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto add = [&](const std::string& what, const std::string& per, auto size) {
      out.push_back({dynamics::AccelerationForm::none, fmt::format("{} in {}", what, kOf[c]), kUnit[c] + per,
                     [=](const State& s) {
                       Vector3 v{};
                       v[c] = size(s);
                       return v;
                     }});
    };
    add("1", "", [](const State&) { return 1.0; });
    add("f_N", "/N", [](const State& s) { return s.normal_force; });
    add("f_N^2", "/N^2", [](const State& s) { return s.normal_force * s.normal_force; });
    add("|v|", " s/m", [](const State& s) { return std::hypot(s.vx, s.vz); });
    add("omega", " s/rad", [](const State& s) { return s.omega; });
  }
  return out;
}

std::vector<Term> terms_for(Response response) {
  return response == Response::direct ? wrench_terms() : acceleration_terms();
}

}  // namespace

std::array<double, 3> MissingCurve::at(double time) const {
  std::array<double, 3> out{};
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t j = 0; j < knots.size(); ++j) out[c] += value[c][j] * hat(knots, j, time);
  return out;
}

std::vector<MissingCurve> missing_curves(const std::vector<ResidualTrace>& traces,
                                         const MissingOptions& options) {
  std::set<int> groups;
  for (const auto& t : traces) groups.insert(t.group);
  std::vector<MissingCurve> out;
  const auto n = static_cast<std::size_t>(std::max(2, options.knots));
  for (const int group : groups) {
    MissingCurve curve;
    curve.group = group;
    double begin = HUGE_VAL, end = -HUGE_VAL;
    for (const auto& t : traces)
      if (t.group == group && t.time.size() >= 3)
        begin = std::min(begin, t.time.front()), end = std::max(end, t.time.back());
    if (!(end > begin)) continue;
    for (std::size_t j = 0; j < n; ++j)
      curve.knots.push_back(begin + (end - begin) * static_cast<double>(j) / static_cast<double>(n - 1));
    const auto width = static_cast<Eigen::Index>(n);
    for (int component = 0; component < 3; ++component) {
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(width, width);
      Eigen::VectorXd g = Eigen::VectorXd::Zero(width);
      double squares = 0;
      for (const auto& trace : traces) {
        if (trace.group != group) continue;
        const Rows rows(trace, component, options);
        if (!rows.enough()) continue;
        Eigen::MatrixXd columns(rows.seen().size(), width);
        for (std::size_t j = 0; j < n; ++j) {
          std::vector<double> basis;
          for (const double t : trace.time) basis.push_back(hat(curve.knots, j, t));
          columns.col(static_cast<Eigen::Index>(j)) = rows.response(basis);
        }
        H += gram(columns);
        g += inner_products(columns, rows.seen());
        squares += rows.seen().squaredNorm();
      }
      auto& value = curve.value[static_cast<std::size_t>(component)];
      auto& sigma = curve.sigma[static_cast<std::size_t>(component)];
      value.assign(n, 0.0), sigma.assign(n, 0.0);
      curve.chi2_before += squares, curve.chi2_after += squares;
      if (!(H.diagonal().maxCoeff() > 0)) continue;
      // Second differences cost a thousandth of what the best determined knot is worth.
      const Eigen::MatrixXd information = H;
      Eigen::MatrixXd D = Eigen::MatrixXd::Zero(std::max<Eigen::Index>(width - 2, 0), width);
      for (Eigen::Index k = 0; k + 2 < width; ++k) D(k, k) = 1, D(k, k + 1) = -2, D(k, k + 2) = 1;
      H += 1e-3 * H.diagonal().maxCoeff() * gram(D);
      H.diagonal().array() += 1e-9 * H.diagonal().maxCoeff();
      const Eigen::VectorXd a = definite_solve(H, g);
      const Eigen::MatrixXd covariance = definite_inverse(H);
      curve.chi2_after += a.dot(information * a) - 2 * a.dot(g);
      for (std::size_t j = 0; j < n; ++j) {
        value[j] = a[static_cast<Eigen::Index>(j)];
        sigma[j] =
            std::sqrt(std::max(0.0, covariance(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(j))));
      }
    }
    out.push_back(std::move(curve));
  }
  return out;
}

std::array<double, 3> MissingCandidate::at(const State& state) const {
  std::array<double, 3> out{};
  for (const MissingTerm& term : terms) {
    const Vector3 v = term.shape(state);
    for (std::size_t c = 0; c < 3; ++c) out[c] += term.coefficient * v[c];
  }
  return out;
}

std::string MissingCandidate::in_words() const {
  std::string out;
  for (const auto& t : terms)
    out += fmt::format("{}({:.4g} ± {:.2g}) {} [{}]", out.empty() ? "" : " + ", t.coefficient, t.sigma,
                       t.name, t.unit);
  return out;
}

MissingCandidate missing_terms(const std::vector<ResidualTrace>& traces, const MissingOptions& options) {
  const auto terms = terms_for(options.response);
  const auto width = static_cast<Eigen::Index>(terms.size());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(width, width);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(width);
  double squares = 0, samples = 0;
  for (const auto& trace : traces)
    for (int component = 0; component < 3; ++component) {
      const Rows rows(trace, component, options);
      if (!rows.enough()) continue;
      Eigen::MatrixXd columns(rows.seen().size(), width);
      for (std::size_t j = 0; j < terms.size(); ++j) {
        std::vector<double> series;
        for (const State& s : trace.state)
          series.push_back(terms[j].at(s)[static_cast<std::size_t>(component)]);
        columns.col(static_cast<Eigen::Index>(j)) = rows.response(series);
      }
      H += gram(columns);
      g += inner_products(columns, rows.seen());
      squares += rows.seen().squaredNorm();
      samples += static_cast<double>(rows.degrees_of_freedom());
    }
  MissingCandidate out;
  if (!(samples > 0)) return out;
  const auto solved = [&](const std::vector<Eigen::Index>& of, Eigen::VectorXd& at) {
    const Eigen::VectorXd b = g(of);
    at = pseudo_solve(H(of, of), b);
    return at.dot(b);
  };
  // The best single term, then the best pair, whether the first is in it or not, and so on.
  std::vector<Eigen::Index> chosen;
  double gain = 0;
  for (int size = 1; size <= options.terms; ++size) {
    std::vector<Eigen::Index> best, tried;
    double best_gain = gain;
    const std::function<void(Eigen::Index)> try_from = [&](Eigen::Index first) {
      if (static_cast<int>(tried.size()) == size) {
        Eigen::VectorXd at;
        if (const double of = solved(tried, at); of > best_gain) best_gain = of, best = tried;
        return;
      }
      for (Eigen::Index j = first; j < width; ++j) {
        if (!(H(j, j) > 0)) continue;
        tried.push_back(j);
        try_from(j + 1);
        tried.pop_back();
      }
    };
    try_from(0);
    if (best.empty() || best_gain - gain < std::max(2 * std::log(samples), 0.2 * (squares - gain - samples)))
      break;
    chosen = best, gain = best_gain;
  }
  // Strongest first: by what alone they take off.
  const auto alone = [&](Eigen::Index j) { return g[j] * g[j] / H(j, j); };
  std::sort(chosen.begin(), chosen.end(),
            [&](Eigen::Index i, Eigen::Index j) { return alone(i) > alone(j); });
  if (chosen.empty()) return out;
  Eigen::VectorXd x;
  solved(chosen, x);
  const double scatter = std::max(1.0, (squares - gain) / samples);
  const Eigen::MatrixXd covariance = pseudo_inverse(H(chosen, chosen)) * scatter;
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const Term& term = terms[static_cast<std::size_t>(chosen[k])];
    out.terms.push_back(
        {term.name, x[i], std::sqrt(std::max(0.0, covariance(i, i))), term.unit, term.at, term.form});
  }
  if (squares > samples) out.explained = std::clamp(gain / (squares - samples), 0.0, 1.0);
  return out;
}

Rest rest_around(const std::vector<ResidualTrace>& traces, const MissingCandidate& candidate,
                 const MissingOptions& options) {
  Rest out;
  for (const auto& trace : traces)
    for (int component = 0; component < 3; ++component) {
      const Rows rows(trace, component, options);
      if (!rows.enough()) continue;
      std::vector<double> missing;
      for (const State& s : trace.state)
        missing.push_back(candidate.at(s)[static_cast<std::size_t>(component)]);
      out.chi2 += (rows.seen() - rows.response(missing)).squaredNorm();
      out.degrees_of_freedom += rows.degrees_of_freedom();
    }
  return out;
}

}  // namespace unhand::fitting
