#include <fmt/core.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "dynamics/dense_solve.hpp"
#include "fitting/discovery/missing_force.hpp"
#include "fitting/discovery/trace_rows.hpp"

namespace unhand::fitting {

using dynamics::gram, dynamics::inner_products, dynamics::pseudo_inverse, dynamics::pseudo_solve;

namespace {

using State = ResidualTrace::State;
using Vector3 = std::array<double, 3>;

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

/// A term with one coefficient for all groups, or with one for each.
struct Variant {
  std::size_t term;
  bool own;
};
/// A coefficient: of one group, or of all.
struct Column {
  std::size_t term;
  std::optional<int> group;
};

/// What the traces say of every term's coefficient in every group: their normal equations.
class Moments {
 public:
  Moments(const std::vector<ResidualTrace>& traces, const std::vector<Term>& terms,
          const MissingOptions& options) {
    const auto width = static_cast<Eigen::Index>(terms.size());
    for (const auto& trace : traces)
      for (int component = 0; component < 3; ++component) {
        const TraceRows rows(trace, component, options);
        if (!rows.enough()) continue;
        Eigen::MatrixXd columns(rows.seen().size(), width);
        for (std::size_t j = 0; j < terms.size(); ++j) {
          std::vector<double> series;
          for (const State& s : trace.state)
            series.push_back(terms[j].at(s)[static_cast<std::size_t>(component)]);
          columns.col(static_cast<Eigen::Index>(j)) = rows.response(series);
        }
        const auto [of, first] = of_group_.try_emplace(trace.group, Eigen::MatrixXd::Zero(width, width),
                                                       Eigen::VectorXd::Zero(width));
        of->second.first += gram(columns);
        of->second.second += inner_products(columns, rows.seen());
        squares_ += rows.seen().squaredNorm();
        samples_ += static_cast<double>(rows.degrees_of_freedom());
      }
  }
  double squares() const { return squares_; }
  double samples() const { return samples_; }
  /// Every term that the traces say something of, in order.
  std::vector<Variant> variants(std::size_t terms) const {
    std::vector<Variant> out;
    for (std::size_t j = 0; j < terms; ++j) {
      const std::size_t groups = columns_of({{j, true}}).size();
      if (groups > 0) out.push_back({j, false});
      if (groups > 1) out.push_back({j, true});
    }
    return out;
  }
  std::vector<Column> columns_of(const std::vector<Variant>& form) const {
    std::vector<Column> out;
    for (const auto& [term, own] : form) {
      if (!own) out.push_back({term, {}});
      const auto j = static_cast<Eigen::Index>(term);
      for (const auto& [group, of] : of_group_)
        if (own && of.first(j, j) > 0) out.push_back({term, group});
    }
    return out;
  }
  Eigen::MatrixXd information(const std::vector<Column>& columns) const {
    const auto width = static_cast<Eigen::Index>(columns.size());
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(width, width);
    for (const auto& [group, of] : of_group_)
      for (Eigen::Index i = 0; i < width; ++i)
        for (Eigen::Index j = 0; j < width; ++j)
          if (is_in(at(columns, i), group) && is_in(at(columns, j), group))
            out(i, j) += of.first(term(columns, i), term(columns, j));
    return out;
  }
  Eigen::VectorXd gradient(const std::vector<Column>& columns) const {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(columns.size()));
    for (const auto& [group, of] : of_group_)
      for (Eigen::Index i = 0; i < out.size(); ++i)
        if (is_in(at(columns, i), group)) out[i] += of.second[term(columns, i)];
    return out;
  }

 private:
  static const Column& at(const std::vector<Column>& columns, Eigen::Index i) {
    return columns[static_cast<std::size_t>(i)];
  }
  static Eigen::Index term(const std::vector<Column>& columns, Eigen::Index i) {
    return static_cast<Eigen::Index>(at(columns, i).term);
  }
  static bool is_in(const Column& column, int group) { return column.group.value_or(group) == group; }

  std::map<int, std::pair<Eigen::MatrixXd, Eigen::VectorXd>> of_group_;
  double squares_{}, samples_{};
};

/// A few terms, and by how much their best coefficients lower χ².
struct Fitted {
  std::vector<Variant> form;
  std::vector<Column> columns;
  Eigen::VectorXd size;  ///< of the columns
  double gain{};
};

Fitted fitted(const Moments& seen, std::vector<Variant> form) {
  Fitted out;
  out.columns = seen.columns_of(form);
  out.form = std::move(form);
  const Eigen::VectorXd b = seen.gradient(out.columns);
  out.size = pseudo_solve(seen.information(out.columns), b);
  out.gain = out.size.dot(b);
  return out;
}

/// What a coefficient has to lower χ² by, in units of the scatter that is left.
double price_of(const Moments& seen) { return 2 * std::log(seen.samples()); }

/// Every form of so many different terms.
std::vector<Fitted> forms_of(const Moments& seen, const std::vector<Variant>& variants, std::size_t terms) {
  std::vector<Fitted> out;
  std::vector<Variant> tried;
  const std::function<void(std::size_t)> try_from = [&](std::size_t first) {
    if (tried.size() == terms) return out.push_back(fitted(seen, tried));
    for (std::size_t j = first; j < variants.size(); ++j) {
      if (!tried.empty() && tried.back().term == variants[j].term) continue;
      tried.push_back(variants[j]);
      try_from(j + 1);
      tried.pop_back();
    }
  };
  try_from(0);
  return out;
}

/// The one that explains most for its coefficients. Where the right term is missing, the scatter is not noise
/// and says little for groups that differ.
std::optional<Fitted> best_of(const Moments& seen, const std::vector<Fitted>& forms) {
  if (forms.empty()) return {};
  double most = 0;
  for (const Fitted& one : forms) most = std::max(most, one.gain);
  const double scatter = std::max(1.0, (seen.squares() - most) / seen.samples());
  const auto worth = [&](const Fitted& one) {
    return one.gain / scatter - price_of(seen) * static_cast<double>(one.columns.size());
  };
  return *std::max_element(forms.begin(), forms.end(),
                           [&](const Fitted& a, const Fitted& b) { return worth(a) < worth(b); });
}

}  // namespace

double MissingTerm::coefficient(int group) const {
  for (const MissingSize& size : sizes)
    if (size.group.value_or(group) == group) return size.value;
  return 0;
}

std::array<double, 3> MissingCandidate::at(const State& state, int group) const {
  std::array<double, 3> out{};
  for (const MissingTerm& term : terms) {
    const double coefficient = term.coefficient(group);
    const Vector3 v = term.shape(state);
    for (std::size_t c = 0; c < 3; ++c) out[c] += coefficient * v[c];
  }
  return out;
}

std::size_t MissingCandidate::coefficients() const {
  std::size_t out = 0;
  for (const MissingTerm& term : terms) out += term.sizes.size();
  return out;
}

std::string MissingCandidate::in_words(const std::map<int, std::string>& names) const {
  std::string out;
  for (const MissingTerm& term : terms) {
    std::string sizes;
    for (const MissingSize& size : term.sizes) {
      sizes += fmt::format("{}{:.4g} ± {:.2g}", sizes.empty() ? "" : ", ", size.value, size.sigma);
      if (size.group) sizes += " for " + names.at(*size.group);
    }
    out += fmt::format("{}({}) {} [{}]", out.empty() ? "" : " + ", sizes, term.name, term.unit);
  }
  return out;
}

MissingCandidate missing_terms(const std::vector<ResidualTrace>& traces, const MissingOptions& options) {
  const auto terms = terms_for(options.response);
  const Moments seen(traces, terms, options);
  MissingCandidate out;
  const double samples = seen.samples(), squares = seen.squares();
  if (!(samples > 0)) return out;
  // The best single term, then the best pair, whether the first is in it or not, and so on.
  const auto variants = seen.variants(terms.size());
  Fitted chosen;
  for (int size = 1; size <= options.terms; ++size) {
    const auto best = best_of(seen, forms_of(seen, variants, static_cast<std::size_t>(size)));
    if (!best) break;
    const double gain = best->gain - chosen.gain, more = static_cast<double>(best->columns.size()) -
                                                         static_cast<double>(chosen.columns.size());
    if (!(gain > std::max({0.0, price_of(seen) * more, 0.2 * (squares - chosen.gain - samples)}))) break;
    chosen = *best;
  }
  // Strongest first: by what alone they take off.
  std::stable_sort(chosen.form.begin(), chosen.form.end(), [&](const Variant& a, const Variant& b) {
    return fitted(seen, {a}).gain > fitted(seen, {b}).gain;
  });
  chosen = fitted(seen, chosen.form);
  const double scatter = std::max(1.0, (squares - chosen.gain) / samples);
  const Eigen::MatrixXd covariance = pseudo_inverse(seen.information(chosen.columns)) * scatter;
  for (const Variant& variant : chosen.form) {
    const Term& term = terms[variant.term];
    out.terms.push_back({term.name, {}, term.unit, term.at, term.form});
    for (std::size_t k = 0; k < chosen.columns.size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      if (chosen.columns[k].term != variant.term) continue;
      out.terms.back().sizes.push_back(
          {chosen.columns[k].group, chosen.size[i], std::sqrt(std::max(0.0, covariance(i, i)))});
    }
  }
  if (squares > samples) out.explained = std::clamp(chosen.gain / (squares - samples), 0.0, 1.0);
  return out;
}

Rest rest_around(const std::vector<ResidualTrace>& traces, const MissingCandidate& candidate,
                 const MissingOptions& options) {
  Rest out;
  for (const auto& trace : traces)
    for (int component = 0; component < 3; ++component) {
      const TraceRows rows(trace, component, options);
      if (!rows.enough()) continue;
      std::vector<double> missing;
      for (const State& s : trace.state)
        missing.push_back(candidate.at(s, trace.group)[static_cast<std::size_t>(component)]);
      out.chi2 += (rows.seen() - rows.response(missing)).squaredNorm();
      out.degrees_of_freedom += rows.degrees_of_freedom();
    }
  return out;
}

}  // namespace unhand::fitting
