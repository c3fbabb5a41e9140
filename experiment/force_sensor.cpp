#include "experiment/force_sensor.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dynamics/median.hpp"

namespace unhand::experiment {
namespace {

constexpr double kStandardErrors = 5;
constexpr double kOfGrip = 0.005;

std::optional<contact::NormalForceSummary> opening_of_force(const datasets::Throw& one) {
  if (!one.ft || (!one.landing && !one.free_flight) || datasets::is_constant(one.ft->normal_force)) return {};
  const auto& series = one.ft->normal_force;
  contact::NormalForceOptions options;
  options.max_tail_bias = 1e3;  // the object flew, so what is left is the sensor's, whatever it is
  try {
    const auto smooth =
        contact::smooth_normal_force(one.ft->time.data, series.data, series.sigma_of(), options);
    if (std::isfinite(smooth.summary.release_time) && std::isfinite(smooth.summary.tail_mean_sigma))
      return smooth.summary;
  } catch (const std::invalid_argument&) {  // too short a series: those who use the throw say so
  }
  return {};
}

/// One oddity: in how many throws it is, and what the first one of them, or the worst, shows.
class Tally {
 public:
  void add(std::string path, std::string said, double size = 0) {
    if (note_.throws++ > 0 && !(size > size_)) return;
    size_ = size, note_.path = std::move(path), note_.said = std::move(said);
  }
  void end(std::vector<LogNote>& notes) const {
    if (note_.throws > 0) notes.push_back(note_);
  }

 private:
  LogNote note_;
  double size_{};
};

/// Where a column is clipped: the value at which it stands.
std::optional<double> clipped_at(const datasets::Series& series, std::size_t column) {
  constexpr std::size_t kStands = 8;  // samples in a row
  constexpr double kAlike = 0.2;      // of the other samples: more are on a grid, or have no noise
  if (series.rows < 2 * kStands) return {};
  double low = series(0, column), high = low;
  for (std::size_t i = 1; i < series.rows; ++i) {
    low = std::min(low, series(i, column));
    high = std::max(high, series(i, column));
  }
  if (!(high > low)) return {};
  for (const double end : {high, low}) {
    std::size_t run = 0, longest = 0, alike = 0, others = 0;
    for (std::size_t i = 0; i < series.rows; ++i) {
      run = series(i, column) == end ? run + 1 : 0;
      longest = std::max(longest, run);
      if (i == 0 || series(i, column) == end) continue;
      ++others;
      if (series(i, column) == series(i - 1, column)) ++alike;
    }
    if (longest >= kStands && static_cast<double>(alike) < kAlike * static_cast<double>(others)) return end;
  }
  return {};
}

/// The autocorrelation of a series' samples from `first` on, about their mean, by lag; empty where they are
/// too few or all the same. A few thousand samples tell.
std::vector<double> autocorrelation(const std::vector<double>& series, std::size_t first) {
  constexpr std::size_t kFewest = 20, kEnough = 4000, kLags = 500;
  if (series.size() < first + kFewest) return {};
  const auto begin = series.begin() + static_cast<std::ptrdiff_t>(first);
  std::vector<double> e(begin, begin + static_cast<std::ptrdiff_t>(std::min(series.size() - first, kEnough)));
  const double mean = std::accumulate(e.begin(), e.end(), 0.0) / static_cast<double>(e.size());
  double squares = 0;
  for (double& x : e) x -= mean, squares += x * x;
  if (!(squares > 0)) return {};
  std::vector<double> out;
  for (std::size_t lag = 0; lag < std::min(e.size() / 2, kLags); ++lag)
    out.push_back(std::inner_product(e.begin() + static_cast<std::ptrdiff_t>(lag), e.end(), e.begin(), 0.0) /
                  squares);
  return out;
}

/// What the samples of a normal force have in common after its release.
struct Likeness {
  double neighbours{}, period{};  // correlation [-]; of hum [s], 0 where they are not periodic
};
std::optional<Likeness> likeness(const datasets::FtLog& ft, double release) {
  constexpr double kPeriodic = -0.4;  // correlation half a period on
  const auto first = std::lower_bound(ft.time.data.begin(), ft.time.data.end(), release);
  const auto rho =
      autocorrelation(ft.normal_force.data, static_cast<std::size_t>(first - ft.time.data.begin()));
  if (rho.size() < 2) return {};
  Likeness out{rho[1], 0};
  const auto least = std::min_element(rho.begin(), rho.end());
  if (*least < kPeriodic)
    out.period = 2 * static_cast<double>(least - rho.begin()) * (ft.time.data.back() - ft.time.data.front()) /
                 static_cast<double>(ft.time.rows - 1);
  return out;
}

std::string force_path(const datasets::Throw& one, const char* name) {
  return fmt::format("/throws/{}/ft/{}", one.id, name);
}

void note_later_rise(const datasets::ThrowLog& log, const ForceOpenings& openings,
                     std::vector<LogNote>& out) {
  Tally rises;
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    if (!openings[i] || !(openings[i]->later_rise > 0)) continue;
    const double rise = openings[i]->later_rise;
    rises.add(
        force_path(log.throws[i], "normal_force"),
        fmt::format(
            "rises again by {:.3g} N ({:.2g} % of the grip) after the pads have parted: a sensor that "
            "rings, or pads that touch once more? The object is taken for free from the first release on",
            rise, 100 * rise / openings[i]->grip_force),
        rise);
  }
  rises.end(out);
}

void note_clipping(const datasets::ThrowLog& log, std::vector<LogNote>& out) {
  struct Column {
    const char *name, *unit;
    datasets::Series datasets::FtLog::*series;
    std::size_t index;
  };
  constexpr Column kColumns[] = {{"normal_force", "N", &datasets::FtLog::normal_force, 0},
                                 {"wrench, fx", "N", &datasets::FtLog::wrench, 0},
                                 {"wrench, fz", "N", &datasets::FtLog::wrench, 1},
                                 {"wrench, tau", "N m", &datasets::FtLog::wrench, 2}};
  for (const Column& column : kColumns) {
    Tally clips;
    for (const auto& one : log.throws)
      if (const auto end = one.ft ? clipped_at((*one.ft).*column.series, column.index) : std::nullopt)
        clips.add(
            force_path(one, column.name),
            fmt::format("stands at {:.4g} {}, which it never passes: the end of the sensor's range? What is "
                        "cut off there is missing in fits",
                        *end, column.unit));
    clips.end(out);
  }
}

/// Of throws whose force does not rise again, and only where most are so.
void note_likeness(const datasets::ThrowLog& log, const ForceOpenings& openings, std::vector<LogNote>& out) {
  constexpr std::size_t kFewest = 5;  // throws
  constexpr double kAlike = 0.5;      // correlation
  std::vector<double> neighbours, periods;
  LogNote note;
  for (std::size_t i = 0; i < log.throws.size(); ++i) {
    const auto& one = log.throws[i];
    if (!one.ft || !openings[i] || openings[i]->later_rise > 0) continue;
    const auto like = likeness(*one.ft, openings[i]->release_time);
    if (!like) continue;
    neighbours.push_back(like->neighbours);
    periods.push_back(like->period);
    if (like->neighbours > kAlike && note.throws++ == 0) note.path = force_path(one, "normal_force");
  }
  if (neighbours.size() < kFewest) return;
  const double rho = dynamics::median(neighbours), period = dynamics::median(periods);
  if (!(rho > kAlike)) return;
  const std::string cause =
      period > 0
          ? fmt::format("hum of some {:.2g} Hz? It moves the release that is read off each throw", 1 / period)
          : "a low-pass filter? It delays and rounds the opening, and friction that is fitted follows it: "
            "log "
            "the force unfiltered, or with as fast a filter as the sensor has";
  note.said =
      fmt::format("neighbouring samples after the release are alike (correlation {:.2f}): {}", rho, cause);
  out.push_back(note);
}

}  // namespace

std::string UntaredForce::in_words() const {
  return fmt::format(
      "/throws/*/ft/normal_force still reads {:.3g} N ({:.2g} % of the grip's {:.3g} N) after the pads have "
      "parted (median of {} throws): a sensor that was not tared? It is not taken off, and friction follows "
      "it: tare the log, or fit sensor.normal_force_bias",
      level, 100 * level / grip, grip, throws);
}

ForceOpenings force_openings(const datasets::ThrowLog& log) {
  ForceOpenings out;
  for (const auto& one : log.throws) out.push_back(log.dimension == 2 ? opening_of_force(one) : std::nullopt);
  return out;
}

ForceOpenings force_openings(const std::vector<PreparedThrow>& throws) {
  ForceOpenings out;
  for (const PreparedThrow& one : throws) {
    const bool parts = one.normal_force && std::isfinite(one.force_fit.release_time);
    out.push_back(parts ? std::optional(one.force_fit) : std::nullopt);
  }
  return out;
}

std::optional<UntaredForce> untared_force(const ForceOpenings& openings) {
  std::vector<double> levels, sigmas, grips;
  for (const auto& opening : openings)
    if (opening) {
      levels.push_back(opening->tail_mean);
      sigmas.push_back(opening->tail_mean_sigma);
      grips.push_back(opening->grip_force);
    }
  if (levels.empty()) return {};
  UntaredForce out{dynamics::median(levels), dynamics::median(sigmas), dynamics::median(grips),
                   static_cast<int>(levels.size())};
  // Zeros may scatter from throw to throw by more than a throw's samples show.
  std::vector<double> away;
  for (const double level : levels) away.push_back(std::abs(level - out.level));
  const double scatter = std::max(out.sigma, 1.4826 * dynamics::median(away)),
               median_error =
                   1.2533 * scatter / std::sqrt(static_cast<double>(out.throws));  // of normal ones
  if (std::abs(out.level) <= kStandardErrors * median_error || std::abs(out.level) <= kOfGrip * out.grip)
    return {};
  return out;
}

std::vector<LogNote> force_notes(const datasets::ThrowLog& log, const ForceOpenings& openings) {
  std::vector<LogNote> out;
  if (log.dimension != 2) return out;
  note_later_rise(log, openings, out);
  note_clipping(log, out);
  note_likeness(log, openings, out);
  return out;
}

}  // namespace unhand::experiment
