#include "datasets/import_phyphox.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "datasets/csv.hpp"
#include "datasets/median_step.hpp"
#include "datasets/near_miss.hpp"
#include "dynamics/median.hpp"
#include "dynamics/quantisation.hpp"
#include "dynamics/third_difference.hpp"

namespace unhand::datasets {
namespace {

constexpr double absolute_tolerance = 1e-3;  // relative, of the absolute value that a file carries
constexpr double kImpact = 60;               // [m/s²] a specific force that no hand gives
constexpr double kBounceWithin = 0.25;       // [s] what starts that soon after an impact is a bounce

struct ExportColumns {
  std::size_t width = 0;
  std::size_t time = 0;
  std::array<std::size_t, 3> force{1, 2, 3};
  std::optional<std::array<std::size_t, 3>> rate;
  std::array<std::string, 7> names{"1", "2", "3", "4", "", "", ""};
  std::optional<std::size_t> absolute;
};

/// As phyphox writes its units.
std::string with_caret(std::string cell) {
  constexpr std::string_view square = "²";
  if (const auto at = cell.find(square); at != std::string::npos) cell.replace(at, square.size(), "^2");
  return cell;
}

ExportColumns columns_of(const CsvLine& line) {
  ExportColumns out;
  out.width = line.cells.size();
  std::vector<std::string> cells;
  for (const std::string& cell : line.cells) cells.push_back(with_caret(cell));
  constexpr const char* kNoGravity = "has gravity taken out by the phone: record 'Acceleration (with g)'";
  for (const std::string& cell : cells)
    if (cell.starts_with("Linear Acceleration") || cell.starts_with("Linear acceleration"))
      line.fail(cell, kNoGravity);
  const auto has = [&](const std::string& name) {
    return std::find(cells.begin(), cells.end(), name) != cells.end();
  };
  const auto need = [&](const std::string& name) {
    const auto found = std::find(cells.begin(), cells.end(), name);
    if (found != cells.end()) return static_cast<std::size_t>(found - cells.begin());
    line.fail("", unknown_name(fmt::format("there is no column '{}'", name), name, line.cells));
  };
  out.time = need("Time (s)");
  out.names[0] = "Time (s)";
  // An experiment of the user's own has a file per sensor, which alone says what X, Y and Z are of.
  const bool by_axis = has("X (m/s^2)") && !has("Acceleration x (m/s^2)");
  if (by_axis && std::filesystem::path(line.file).stem().string().starts_with("Linear"))
    line.fail("X (m/s^2)", kNoGravity);
  for (std::size_t j = 0; j < 3; ++j) {
    out.names[1 + j] =
        by_axis ? fmt::format("{} (m/s^2)", "XYZ"[j]) : fmt::format("Acceleration {} (m/s^2)", "xyz"[j]);
    out.force[j] = need(out.names[1 + j]);
    out.names[4 + j] = fmt::format("Gyroscope {} (rad/s)", "xyz"[j]);
  }
  if (has(out.names[4])) out.rate = {need(out.names[4]), need(out.names[5]), need(out.names[6])};
  return out;
}

/// A file without a header is believed only if it looks like one of phyphox's.
ExportColumns columns_without_header(const CsvLine& line) {
  ExportColumns out;
  out.width = line.cells.size();
  if (out.width != 4 && out.width != 5)
    line.fail("",
              fmt::format("{} numbers and no header, expected phyphox's header or rows of time, x, y, z and "
                          "perhaps the absolute value",
                          out.width));
  if (out.width == 5) out.absolute = 4;
  return out;
}

ImuLog read_imu(const std::filesystem::path& file) {
  CsvReader reader(file, '\0');
  CsvLine line;
  if (!reader.next(line))
    reader.fail(1, "is empty, expected phyphox's header 'Time (s),Acceleration x (m/s^2),...'");
  const bool is_row = line.is_number(0);
  const ExportColumns columns = is_row ? columns_without_header(line) : columns_of(line);
  ImuLog imu{{0, 1, {}, {}}, {0, 3, {}, {}}, {0, 3, {}, {}}};
  for (bool more = is_row || reader.next(line); more; more = reader.next(line)) {
    line.expect_cells(columns.width);
    const double t = line.real(columns.time, columns.names[0]);
    if (imu.time.rows > 0 && t <= imu.time.data.back())
      line.fail(columns.names[0],
                fmt::format("time is not strictly increasing: {} s after {} s", t, imu.time.data.back()));
    imu.time.data.push_back(t);
    ++imu.time.rows;
    double square = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      const double value = line.real(columns.force[j], columns.names[1 + j]);
      imu.specific_force.data.push_back(value);
      square += value * value;
    }
    ++imu.specific_force.rows;
    if (columns.absolute) {
      const double said = line.real(*columns.absolute, "5");
      if (!(std::abs(said - std::sqrt(square)) <= absolute_tolerance * (1 + said)))
        line.fail(
            "5",
            fmt::format("{} is not the absolute value of columns 2 to 4, {:.6g}: is this a file of phyphox?",
                        said, std::sqrt(square)));
    }
    if (!columns.rate) continue;
    for (std::size_t j = 0; j < 3; ++j)
      imu.angular_rate.data.push_back(line.real((*columns.rate)[j], columns.names[4 + j]));
    ++imu.angular_rate.rows;
  }
  if (imu.time.rows == 0) reader.fail(1, "holds no rows after the header");
  return imu;
}

double magnitude(const ImuLog& imu, std::size_t i) {
  return std::hypot(imu.specific_force(i, 0), imu.specific_force(i, 1), imu.specific_force(i, 2));
}

/// Times in another unit than seconds, and accelerations in another than m/s², by what phones do: they sample
/// 20 to some thousand times a second, and read gravity while they are held. Gives what it reads then.
std::optional<double> check_units(const std::filesystem::path& file, const ImuLog& imu, double step) {
  constexpr double kStep[2] = {1e-4, 0.1};            // s
  constexpr double kGravity = 9.80665, kFalling = 5;  // m/s²
  constexpr double kNear = 0.05;                      // as a share
  constexpr std::size_t kEnough = 20;
  if (imu.time.rows < kEnough) return {};
  if (!(step >= kStep[0] && step <= kStep[1]))
    throw ImportError(
        file.string(), "column Time (s)",
        fmt::format("samples are {:.3g} s apart (median), accepted are {:g} to {:g} s: is it in {}?", step,
                    kStep[0], kStep[1], step > kStep[1] ? "ms or another unit" : "another unit"));
  std::vector<double> all, held;
  for (std::size_t i = 0; i < imu.time.rows; ++i) {
    all.push_back(magnitude(imu, i));
    if (all.back() >= kFalling) held.push_back(all.back());
  }
  const auto fail = [&](const std::string& why) {
    throw ImportError(file.string(), "columns Acceleration (m/s^2)", why);
  };
  // Of a unit that is no m/s^2 the median shows gravity in that unit; a phone that is shaken or thrown hard
  // reads anything else.
  const double usual = dynamics::median(all);
  const auto is_near = [](double seen, double factor) {
    return std::abs(seen - kGravity * factor) < kNear * kGravity * factor;
  };
  constexpr double kPerG = 1 / 9.80665, kPerFoot = 1 / 0.3048;
  if (held.size() < all.size() / 5 && is_near(usual, kPerG))
    fail(fmt::format(
        "{:.3g} m/s^2 is what it reads (median), and a phone that is held reads about 9.8: is it in g?",
        usual));
  if (held.size() < kEnough) return {};
  const double rest = dynamics::median(held);
  if (is_near(rest, kPerFoot))
    fail(fmt::format(
        "outside of falls it reads {:.3g} m/s^2 (median), and a phone that is held reads about 9.8: "
        "is it in ft/s^2?",
        rest));
  return rest;
}

/// Samples [first, last] of small specific force.
struct Stretch {
  std::size_t first = 0, last = 0;
};

std::vector<Stretch> small_force(const ImuLog& imu, double threshold) {
  std::vector<Stretch> out;
  bool inside = false;
  for (std::size_t i = 0; i < imu.time.rows; ++i) {
    const bool small = magnitude(imu, i) < threshold;
    if (small && !inside) out.push_back({i, i});
    if (small) out.back().last = i;
    inside = small;
  }
  return out;
}

/// Why a stretch is no free fall, or nothing.
std::string fault_of(const ImuLog& imu, const Stretch& stretch, const PhyphoxOptions& options, double step) {
  const double begin = imu.time(stretch.first), end = imu.time(stretch.last);
  if (stretch.first == 0) return "the recording starts in it";
  if (stretch.last + 1 == imu.time.rows) return "the recording ends in it";
  for (std::size_t i = stretch.first; i-- > 0 && imu.time(i) >= begin - kBounceWithin;)
    if (magnitude(imu, i) > kImpact)
      return fmt::format("a bounce: {:.0f} m/s^2 at {:.3f} s", magnitude(imu, i), imu.time(i));
  if (end - begin < options.min_duration)
    return fmt::format("lasts {:.3f} s, less than {} s", end - begin, options.min_duration);
  for (std::size_t i = stretch.first; i < stretch.last; ++i)
    if (imu.time(i + 1) - imu.time(i) > 5 * step)
      return fmt::format("samples are missing from {:.3f} s on", imu.time(i));
  return {};
}

/// The independent noise of each axis, from third differences; not below what rounding to the grid of the
/// recording's readings adds.
std::vector<double> estimate_sigma(const Series& values, const std::vector<Stretch>& falls) {
  std::vector<double> out;
  for (std::size_t j = 0; j < values.cols; ++j) {
    double sum = 0;
    std::size_t n = 0;
    for (const Stretch& fall : falls)
      for (std::size_t i = fall.first + 3; i <= fall.last; ++i, ++n)
        sum += dynamics::third_difference_variance(values(i - 3, j), values(i - 2, j), values(i - 1, j),
                                                   values(i, j));
    if (n < 8) return {};
    std::vector<double> readings;
    for (std::size_t i = 0; i < values.rows; ++i) readings.push_back(values(i, j));
    out.push_back(std::max(std::sqrt(sum / static_cast<double>(n)),
                           dynamics::rounding_sigma(dynamics::quantisation_step(std::move(readings)))));
  }
  return out;
}

Series rows_of(const Series& all, std::size_t first, std::size_t end) {
  if (all.empty()) return {};
  const auto at = [&](std::size_t i) { return all.data.begin() + static_cast<std::ptrdiff_t>(i * all.cols); };
  return {end - first, all.cols, {at(first), at(end)}, all.sigma};
}

/// The samples of a stretch without its guards; nothing is left of a stretch too short for them.
std::optional<Stretch> guarded(const ImuLog& imu, const Stretch& stretch, double guard) {
  const double begin = imu.time(stretch.first) + guard, end = imu.time(stretch.last) - guard;
  Stretch out = stretch;
  while (out.first < out.last && imu.time(out.first) < begin) ++out.first;
  while (out.last > out.first && imu.time(out.last) > end) --out.last;
  if (out.last <= out.first) return {};
  return out;
}

void check_options(const PhyphoxOptions& options) {
  const auto positive = [](const char* name, double value) {
    if (!(std::isfinite(value) && value > 0))
      throw std::invalid_argument(fmt::format("{}: {} is not > 0", name, value));
  };
  positive("threshold", options.threshold);
  positive("min_duration", options.min_duration);
  if (!(options.guard >= 0 && 2 * options.guard < options.min_duration))
    throw std::invalid_argument(
        fmt::format("guard: {} is not >= 0 and below half of min_duration", options.guard));
}

}  // namespace

bool phyphox_names_it(const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  return stem == "Raw Data" || stem == "Accelerometer" || stem == "Acceleration";
}

std::vector<std::filesystem::path> phyphox_files(std::span<const std::filesystem::path> inputs) {
  std::vector<std::filesystem::path> out;
  for (const std::filesystem::path& input : inputs) {
    std::error_code error;
    if (!std::filesystem::is_directory(input, error)) {
      out.push_back(input);
      continue;
    }
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(input))
      if (entry.is_regular_file() && entry.path().extension() == ".csv" && phyphox_names_it(entry.path()))
        found.push_back(entry.path());
    if (found.empty()) throw ImportError(input.string(), "", "a folder without phyphox's 'Raw Data.csv'");
    std::sort(found.begin(), found.end());
    out.insert(out.end(), found.begin(), found.end());
  }
  return out;
}

PhyphoxRecording read_phyphox(const std::filesystem::path& file, const PhyphoxOptions& options) {
  check_options(options);
  ImuLog imu = read_imu(file);
  PhyphoxRecording out;
  out.samples = imu.time.rows;
  const double step = median_step(imu.time);
  out.rest = check_units(file, imu, step);

  std::vector<Stretch> falls;
  for (const Stretch& stretch : small_force(imu, options.threshold)) {
    std::string why = fault_of(imu, stretch, options, step);
    const auto fall = guarded(imu, stretch, options.guard);
    if (why.empty() && !fall) why = "too few samples";
    if (why.empty())
      falls.push_back(*fall);
    else if (imu.time(stretch.last) - imu.time(stretch.first) >= options.min_duration / 4)
      out.dropped.push_back({imu.time(stretch.first), imu.time(stretch.last), why});
  }
  imu.specific_force.sigma = estimate_sigma(imu.specific_force, falls);
  imu.angular_rate.sigma =
      imu.angular_rate.empty() ? std::vector<double>{} : estimate_sigma(imu.angular_rate, falls);
  std::size_t first = 0;
  for (std::size_t k = 0; k < falls.size(); ++k) {
    const std::size_t end = k + 1 < falls.size() ? (falls[k].last + falls[k + 1].first) / 2 : imu.time.rows;
    Throw& fall = out.falls.emplace_back();
    fall.imu = {rows_of(imu.time, first, end), rows_of(imu.specific_force, first, end),
                rows_of(imu.angular_rate, first, end)};
    fall.free_flight = {imu.time(falls[k].first), imu.time(falls[k].last)};
    first = end;
  }
  return out;
}

}  // namespace unhand::datasets
