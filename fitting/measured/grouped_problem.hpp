// Measurements in groups (throws, drops): what the groups share is asked for, each has unknowns of its own.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "datasets/throw_log.hpp"
#include "dynamics/effect.hpp"
#include "flight/quaternion.hpp"

namespace unhand::fitting {

/// Rows of this channel hold what is known of a group's own unknowns beforehand; they are no measurements.
inline constexpr int kPriorChannel = -1;

/// One measurement of a group.
struct GroupRow {
  int channel{};  ///< index into channels(), or kPriorChannel
  double time{};  ///< from the start of the group [s]
};

/// Measurements that share unknowns of their own: a flight, a fall.
struct Group {
  std::string id, object, condition;  ///< as in the log
  datasets::Split split{};            ///< whether it may be fitted to
  std::vector<GroupRow> rows;         ///< its measurements, and what is known beforehand
  std::vector<double> start;          ///< of its own unknowns
  /// What the group is like, for asking whether an answer depends on it: one value per covariate of the
  /// problem.
  std::vector<double> covariates;
  bool set_aside{};  ///< it errs as no other does: nothing is fitted to it, and it judges nothing

  /// Degrees of freedom that its own unknowns take from its measurements: what is known of them beforehand
  /// counts as measured.
  double taken() const;
};

/// (predicted − measured)/σ of a group, by row, with derivatives where they were asked for.
struct GroupEquations {
  bool solved{};                ///< false: they are not finite
  Eigen::VectorXd residual;     ///< one per row [σ]
  Eigen::MatrixXd shared, own;  ///< derivatives: a row each, a column per unknown
};

/// By which unknowns equations are asked to be differentiated.
enum class Derivatives {
  none,  ///< by none
  own,   ///< by the group's own
  all,   ///< by those, and by the shared parameters
};

struct GroupedFit;

/// How a group moves, at its samples. Vectors are in the axes of GroupedProblem::response.
struct GroupMotion {
  std::vector<double> time;                               ///< from the start of the group [s]
  std::vector<flight::Vec3<double>> velocity;             ///< of the CoM [m/s]
  std::vector<flight::Vec3<double>> spin;                 ///< [rad/s]; empty where it is not known
  std::vector<std::array<flight::Vec3<double>, 3>> body;  ///< the body's axes; empty where they are not known
  bool in_world{};                                        ///< the axes are the world's, else the body's
};

/// Groups of measurements under one model: unknowns that all groups share, and some of each group's own.
class GroupedProblem {
 public:
  virtual ~GroupedProblem() = default;
  /// In the order of the log.
  const std::vector<Group>& groups() const { return groups_; }
  /// Names of the measured channels.
  const std::vector<std::string>& channels() const { return channels_; }
  /// Names of what groups are described by.
  const std::vector<std::string>& covariates() const { return covariates_; }
  /// These groups (indices), and no others, are set aside. In the place of a held-out one, the next train
  /// group of its condition in the log (none: of its object, of the log) is held out.
  void set_aside(const std::vector<std::size_t>& which);
  /// Groups that were left out, with the reason.
  const std::vector<std::pair<std::string, std::string>>& skipped() const { return skipped_; }

  /// Train groups that stand among the held-out ones in the place of such that were set aside.
  const std::vector<std::size_t>& held_out_instead() const { return held_out_instead_; }

  /// The effects that can be asked for; where two are the same in the data, the first one's name is given.
  virtual std::vector<dynamics::Effect> effects() const = 0;
  /// At the values of shared parameters ("id.parameter" or "id.parameter[object]"; what is not named is
  /// neutral) and of the group's own unknowns. Derivatives that were not asked for may be missing or zero.
  virtual GroupEquations equations(std::size_t group, std::span<const std::string> names,
                                   std::span<const double> values, const Eigen::VectorXd& own,
                                   Derivatives derivatives) const = 0;

  /// The motion that the model says, with values as of `equations`; without samples where it is not solved,
  /// and of a problem that knows no such motion.
  virtual GroupMotion motion(std::size_t group, std::span<const std::string> names,
                             std::span<const double> values, const Eigen::VectorXd& own) const;
  /// What the residual of a group (by row) would change by, to first order, if its body were accelerated by
  /// so much more at the samples of its motion [m/s²].
  virtual Eigen::VectorXd response(std::size_t group,
                                   const std::vector<flight::Vec3<double>>& acceleration) const;

  /// Whether an effect says anything beside `others` (ids): an anisotropy does where what it shapes is among
  /// them, or declared of every object.
  bool may_act(const std::string& id, const std::vector<std::string>& others) const;
  /// Whether nature has such values: false where an anisotropy makes what it shapes (declared and found)
  /// negative along an axis by more than two sigmas.
  bool may_be(const GroupedFit& fit) const;

 protected:
  std::map<std::string, double> declared_;          ///< by "id.parameter[object]"; what is not named is zero
  std::vector<Group> groups_;                       ///< filled by the problem's constructor
  std::vector<std::string> channels_, covariates_;  ///< likewise
  std::vector<std::pair<std::string, std::string>> skipped_;  ///< id and reason

 private:
  void hold_out_in_place_of(std::size_t group);
  std::vector<std::size_t> held_out_instead_;
  double declared(const std::string& name) const;
  /// The same of one effect with an anisotropy, and of one object.
  bool may_be(const GroupedFit& fit, const dynamics::Effect& effect, const std::string& object) const;
};

/// A parameter that groups share.
struct SharedParameter {
  std::string name, effect, short_name, unit;  ///< short_name: without the effect's id
  double neutral{}, low{}, high{}, typical{};  ///< without effect; accepted range; a step that matters
  bool shape{};  ///< it only shapes an effect that another parameter switches on
};
/// An effect's parameters over these objects.
std::vector<SharedParameter> shared_parameters(const dynamics::Effect& effect,
                                               const std::vector<std::string>& objects);

/// The objects that the groups have, sorted.
std::vector<std::string> objects_of(const GroupedProblem& problem);

/// A log's split; where it has none, every fifth throw is held out, counted condition by condition.
std::vector<datasets::Split> splits_of(const datasets::ThrowLog& log);

/// The shared values as a group of one object reads them: names without brackets, and the position of each
/// in the list it came from; those of other objects are left out.
struct OwnNames {
  std::vector<std::string> names;  ///< without brackets
  std::vector<std::size_t> from;   ///< their places in the whole list
  /// Of all shared names, those that a group of `object` reads.
  OwnNames(std::span<const std::string> all, const std::string& object);
  /// The values of `names`.
  std::vector<double> values(std::span<const double> all) const;
  /// Derivatives for `names` become derivatives for the whole list.
  void spread(GroupEquations& equations, std::size_t all) const;
};

/// Derivatives of f(shared, own) in sweeps of dynamics::kDualSize parameters: f takes two vectors of a scalar
/// and returns the residual in it. `shared` are the values that the group reads.
template <class F>
GroupEquations swept(const std::vector<double>& shared, const Eigen::VectorXd& own, Derivatives derivatives,
                     const F& f) {
  using dynamics::Dual;
  GroupEquations out;
  const auto n_shared = shared.size(), n_own = static_cast<std::size_t>(own.size()), n = n_shared + n_own;
  if (derivatives == Derivatives::none) {
    const std::vector<double> r = f(shared, std::vector<double>(own.data(), own.data() + own.size()));
    out.residual = Eigen::Map<const Eigen::VectorXd>(r.data(), static_cast<Eigen::Index>(r.size()));
    out.solved = out.residual.allFinite();
    return out;
  }
  const std::size_t begin = derivatives == Derivatives::own ? n_shared : 0;
  for (std::size_t first = begin; first < n || first == begin; first += dynamics::kDualSize) {
    std::vector<Dual> s, o;
    const auto seed = [&](double value, std::size_t k) {
      return k >= first && k < first + dynamics::kDualSize
                 ? dynamics::independent(value, static_cast<int>(k - first))
                 : Dual(value);
    };
    for (std::size_t k = 0; k < n_shared; ++k) s.push_back(seed(shared[k], k));
    for (std::size_t k = 0; k < n_own; ++k)
      o.push_back(seed(own[static_cast<Eigen::Index>(k)], n_shared + k));
    const std::vector<Dual> r = f(s, o);
    const auto rows = static_cast<Eigen::Index>(r.size());
    if (first == begin) {
      out.residual.resize(rows);
      out.shared.setZero(rows, static_cast<Eigen::Index>(n_shared));
      out.own.resize(rows, static_cast<Eigen::Index>(n_own));
    }
    for (Eigen::Index i = 0; i < rows; ++i) {
      const Dual& x = r[static_cast<std::size_t>(i)];
      out.residual[i] = x.a;
      for (std::size_t k = first; k < std::min(n, first + dynamics::kDualSize); ++k)
        (k < n_shared ? out.shared(i, static_cast<Eigen::Index>(k))
                      : out.own(i, static_cast<Eigen::Index>(k - n_shared))) =
            x.v[static_cast<Eigen::Index>(k - first)];
    }
  }
  out.solved = out.residual.allFinite() && out.shared.allFinite() && out.own.allFinite();
  return out;
}

}  // namespace unhand::fitting
