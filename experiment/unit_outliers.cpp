#include "experiment/unit_outliers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string_view>

#include "dynamics/median.hpp"
#include "experiment/unit_rules.hpp"

namespace unhand::experiment {

using datasets::Throw;

namespace {

constexpr std::size_t kEnoughThrows = 3;  ///< to say what is usual
constexpr double kLeastOfLog = 20;        ///< factor by which grips of one campaign do not differ

/// Doubts of single throws, one to a column.
class Doubts {
 public:
  void add(const Throw& one, const ColumnSide& side, double ratio, std::string reason) {
    const std::string path = fmt::format("/throws/{}{}{}", one.id, side.path[0] == '@' ? "" : "/", side.path);
    if (!told_.insert({path, side.column}).second) return;
    if (side.path[0] != '@') throws_.insert(one.id);
    out_.push_back({path, side.column, ratio, 1, std::move(reason)});
  }
  /// Of one of the throw's series.
  bool of(const Throw& one) const { return throws_.contains(one.id); }
  std::vector<UnitDoubt> take() { return std::move(out_); }

 private:
  std::vector<UnitDoubt> out_;
  std::set<std::pair<std::string, std::string>> told_;  // path and column
  std::set<std::string> throws_;                        // ids
};

/// What the throw's own channels say.
void check_ratios(const Throw& one, const SizeRatios& sizes, const std::map<SizedColumn, double>& medians,
                  Doubts& out) {
  const double far = std::log(kLeastOutlier);
  for (const auto& [column, rule] : unit_rules()) {
    const auto size = sizes.find(column);
    if (size == sizes.end() || !(size->second > 0)) continue;
    const double median = medians.at(column);
    if (median > 0 && std::abs(std::log(size->second / median)) < far) continue;
    const auto check = [&](const ColumnSide& side, const ColumnSide& other, double ratio) {
      if (side.path[0] == '/' || std::abs(std::log(ratio)) < far) return;
      const auto* unit = explaining_unit(side.units, ratio, rule.within);
      if (!unit) return;
      out.add(one, side, ratio,
              fmt::format("in this throw {} is {:.3g} times what {}, accepted are {:.3g} to {:.3g} (usual "
                          "in this log is {:.3g}): {}?",
                          side.column, ratio, rule.said_by(other), 1 / kLeastOutlier, kLeastOutlier,
                          ratio == size->second ? median : 1 / median, unit->words));
    };
    check(rule.seen, rule.expected, size->second);
    check(rule.expected, rule.seen, 1 / size->second);
    if (column == SizedColumn::hand_clock && out.of(one)) return;  // it is behind all that follows
  }
}

/// The size that nine in ten samples keep below: a glitch does not count.
std::optional<double> size_of(const PlainColumn& column, const Throw& one) {
  const auto* series = column.series(one);
  if (series == nullptr || series->rows == 0) return {};
  std::vector<double> sizes;
  for (std::size_t i = 0; i < series->rows; ++i) {
    double squares = 0;
    for (std::size_t c = column.first; c < column.last; ++c) squares += (*series)(i, c) * (*series)(i, c);
    if (std::isfinite(squares)) sizes.push_back(std::sqrt(squares));
  }
  if (sizes.empty()) return {};
  const auto tenth = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() * 9 / 10);
  std::nth_element(sizes.begin(), tenth, sizes.end());
  return *tenth;
}

/// Whether another channel of the throw says that the column has its size.
bool is_confirmed(const ColumnSide& column, const SizeRatios& sizes) {
  return std::any_of(sizes.begin(), sizes.end(), [&](const auto& size) {
    const auto found = unit_rules().find(size.first);
    if (found == unit_rules().end() || !(size.second > 0)) return false;
    const UnitRule& rule = found->second;
    const auto is = [&](const ColumnSide& side) {
      return std::string_view(side.path) == column.path && std::string_view(side.column) == column.column;
    };
    return (is(rule.seen) || is(rule.expected)) && std::abs(std::log(size.second)) < std::log(rule.within);
  });
}

/// What other throws say that should be `apart` times as large at most, where no other channel of the throw
/// tells its size; `sizes_of` a throw of the log.
template <class Sizes>
void check_repetitions(const std::vector<const Throw*>& alike, const PlainColumn& column, double apart,
                       const Sizes& sizes_of, Doubts& out) {
  struct Sized {
    const Throw* one;
    double size;
  };
  std::vector<Sized> all;
  for (const auto* one : alike)
    if (const auto size = size_of(column, *one)) all.push_back({one, *size});
  if (all.size() < kEnoughThrows) return;
  std::vector<double> sizes;
  for (const auto& [one, size] : all) sizes.push_back(size);
  std::sort(sizes.begin(), sizes.end());
  for (const auto& [one, size] : all) {
    const auto self =
        static_cast<std::size_t>(std::lower_bound(sizes.begin(), sizes.end(), size) - sizes.begin());
    const auto other = [&](std::size_t rank) { return sizes[rank < self ? rank : rank + 1]; };
    const std::size_t others = all.size() - 1;
    const double least = other(0), most = other(others - 1), median = other(others / 2);
    const double low = least / apart, high = most * apart;
    if (!(std::max(size, median) > column.shows) || !(median > 0) || (size >= low && size <= high)) continue;
    constexpr double kWithin = 2;  // repetitions differ
    const auto* unit = explaining_unit(column.side.units, size / median, kWithin);
    if (unit == nullptr || out.of(*one) || is_confirmed(column.side, sizes_of(*one))) continue;
    out.add(*one, column.side, size / median,
            fmt::format("in this throw {} reaches {:.3g}, and {:.3g} to {:.3g} in {} others like "
                        "it, accepted are {:.3g} to {:.3g}: {}?",
                        column.side.column, size, least, most, others, low, high, unit->words));
  }
}

/// A declared angle needs no other channel: it lies within a whole turn, or whole turns from the others.
void check_grasp_angles(const datasets::ThrowLog& log, Doubts& out) {
  constexpr double kTurn = 2 * std::numbers::pi, kAlike = 0.5;  // rad
  std::vector<double> usual;
  for (const auto& one : log.throws)
    if (one.grasp_angle && std::abs(*one.grasp_angle) <= kTurn) usual.push_back(*one.grasp_angle);
  const auto is_alike = [&](double angle) {
    return !usual.empty() && std::abs(std::remainder(angle - dynamics::median(usual), kTurn)) < kAlike;
  };
  for (const auto& one : log.throws)
    if (one.grasp_angle && std::abs(*one.grasp_angle) > kTurn && !is_alike(*one.grasp_angle))
      out.add(one, {"@grasp_angle", "grasp_angle", {}}, *one.grasp_angle,
              fmt::format("grasp_angle is {:.3g} rad in this throw, accepted are -{:.3g} to {:.3g}: degrees "
                          "for rad?",
                          *one.grasp_angle, kTurn, kTurn));
}

}  // namespace

std::vector<UnitDoubt> outlying_throws(const datasets::ThrowLog& log, std::span<const SizeRatios> throws) {
  std::map<SizedColumn, std::vector<double>> all;
  for (const auto& sizes : throws)
    for (const auto& [column, ratio] : sizes) all[column].push_back(ratio);
  std::map<SizedColumn, double> medians;
  // Of fewer, what the channels of one throw should say of each other
  for (const auto& [column, ratios] : all)
    medians[column] = ratios.size() < kEnoughThrows ? 1 : dynamics::median(ratios);
  Doubts out;
  for (std::size_t i = 0; i < throws.size(); ++i) check_ratios(log.throws[i], throws[i], medians, out);
  if (log.dimension != 2) return out.take();
  std::map<std::string, std::vector<const Throw*>> conditions;
  for (const auto& one : log.throws) conditions[one.condition + "\n" + one.object].push_back(&one);
  std::vector<const Throw*> any;
  for (const auto& one : log.throws) any.push_back(&one);
  const auto sizes_of = [&](const Throw& one) -> const SizeRatios& {
    return throws[static_cast<std::size_t>(&one - log.throws.data())];
  };
  for (const auto& column : plain_columns()) {
    for (const auto& [condition, alike] : conditions)
      if (alike.size() >= kEnoughThrows) check_repetitions(alike, column, kLeastOutlier, sizes_of, out);
    if (column.grip) check_repetitions(any, column, kLeastOfLog, sizes_of, out);
  }
  check_grasp_angles(log, out);
  return out.take();
}

}  // namespace unhand::experiment
