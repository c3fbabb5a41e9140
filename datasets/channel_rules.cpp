#include "datasets/channel_rules.hpp"

#include <fmt/format.h>

#include <cmath>

#include "datasets/attribute_fields.hpp"

namespace unhand::datasets {
namespace {

constexpr double quaternion_rounding = 1e-12;  // below this the quaternion is taken as it is, bit for bit

double quaternion_norm(const Series& pose, std::size_t i) {
  double sum = 0;
  for (std::size_t j = 3; j < 7; ++j) sum += pose(i, j) * pose(i, j);
  return std::sqrt(sum);
}

void check_shape(const ChannelCheck& check, const Series& series) {
  if (series.rows == 0) fail_at(check.file, check.path, "is empty: at least one row is needed");
  const ColumnLayout* layout = layout_of_width(check.layouts, series.cols);
  if (layout == nullptr) {
    std::string wanted;
    for (const ColumnLayout& option : check.layouts) {
      wanted += fmt::format("{}{} [{}]", wanted.empty() ? "" : " or ", width(option), option.columns);
    }
    fail_at(check.file, check.path, fmt::format("wrong shape: {} columns, expected {}", series.cols, wanted));
  }
  if (series.data.size() != series.rows * series.cols) {
    fail_at(check.file, check.path,
            fmt::format("holds {} numbers for {} x {}", series.data.size(), series.rows, series.cols));
  }
  if (check.single && series.rows != 1) {
    fail_at(check.file, check.path, fmt::format("wrong shape: {} rows, expected exactly 1", series.rows));
  }
  if (check.rows != 0 && series.rows != check.rows) {
    fail_at(check.file, check.path,
            fmt::format("wrong shape: {} rows, but the time beside it has {}", series.rows, check.rows));
  }
}

void check_sigma(const ChannelCheck& check, const Series& series) {
  if (series.sigma.empty()) return;
  const std::string path = check.path + "@sigma";
  if (series.sigma.size() != series.cols) {
    fail_at(check.file, path, fmt::format("{} values for {} columns", series.sigma.size(), series.cols));
  }
  for (const double s : series.sigma) {
    if (!(std::isfinite(s) && s >= 0))
      fail_at(check.file, path, fmt::format("{} is not a finite noise >= 0", s));
  }
}

void check_values(const ChannelCheck& check, const Series& series) {
  const ColumnLayout& layout = *layout_of_width(check.layouts, series.cols);
  for (std::size_t i = 0; i < series.rows; ++i) {
    if (check.kind == ChannelKind::pose && check.mask != nullptr && !check.mask->empty() &&
        (*check.mask)[i] == 0) {
      continue;
    }
    for (std::size_t j = 0; j < series.cols; ++j) {
      if (std::isfinite(series(i, j))) continue;
      fail_at(check.file, check.path,
              fmt::format("row {}, column {}: {}{}", i, part_of(layout.columns, j),
                          series(i, j) != series(i, j) ? "NaN" : "Inf",
                          check.kind == ChannelKind::pose ? " where valid is not 0" : ""));
    }
    if (check.kind == ChannelKind::pose && series.cols == 7) {
      const double norm = quaternion_norm(series, i);
      if (std::abs(norm - 1) > kQuaternionTolerance) {
        fail_at(check.file, check.path,
                fmt::format("row {}: quaternion of norm {:.6g}, expected 1 within {}", i, norm,
                            kQuaternionTolerance));
      }
    }
  }
}

}  // namespace

void fail_at(const std::string& file, const std::string& path, const std::string& reason) {
  throw LogError(file, path, reason);
}

std::string join(const std::string& path, std::string_view name) {
  if (name.empty()) return path;
  return path.ends_with('/') ? path + std::string(name) : path + '/' + std::string(name);
}

void check_series(const ChannelCheck& check, const Series& series) {
  check_shape(check, series);
  check_sigma(check, series);
  check_values(check, series);
  if (check.kind != ChannelKind::time) return;
  for (std::size_t i = 1; i < series.rows; ++i) {
    if (series(i) > series(i - 1)) continue;
    fail_at(check.file, check.path,
            fmt::format("time is not strictly increasing: {} s at row {} after {} s", series(i), i,
                        series(i - 1)));
  }
}

void check_flags(const ChannelCheck& check, const Flags& flags) {
  if (flags.size() != check.rows) {
    fail_at(check.file, check.path,
            fmt::format("wrong shape: {} rows, but the time beside it has {}", flags.size(), check.rows));
  }
  for (std::size_t i = 0; i < flags.size(); ++i) {
    if (flags[i] > 1) fail_at(check.file, check.path, fmt::format("row {}: {} is not 0 or 1", i, flags[i]));
  }
}

void check_name(const std::string& file, const std::string& path, const std::string& name) {
  if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos ||
      !is_utf8_text(name)) {
    fail_at(file, path,
            fmt::format("'{}' cannot name a group: it must be UTF-8, without '/', and not empty", name));
  }
}

void normalise_quaternions(Series& pose, const Flags& valid) {
  if (pose.cols != 7) return;
  for (std::size_t i = 0; i < pose.rows; ++i) {
    if (!valid.empty() && valid[i] == 0) continue;
    const double norm = quaternion_norm(pose, i);
    if (std::abs(norm - 1) <= quaternion_rounding) continue;
    for (std::size_t j = 3; j < 7; ++j) pose(i, j) /= norm;
  }
}

void AttributeChecker::fail(std::string_view name, std::string reason) const {
  throw LogError(file, path + "@" + std::string(name), std::move(reason));
}

void AttributeChecker::operator()(std::string_view name, double value, const Range& range) const {
  if (!(value >= range.low && value <= range.high))
    fail(name, fmt::format("{} is not {}", value, range.text));
}

void AttributeChecker::operator()(std::string_view name, const std::string& text) const {
  if (!is_utf8_text(text)) fail(name, "is not UTF-8 text");
}

void AttributeChecker::operator()(std::string_view name, const std::array<double, 3>& values,
                                  const Range& range) const {
  for (const double value : values) (*this)(name, value, range);
}

void AttributeChecker::operator()(std::string_view name, const std::vector<double>& values,
                                  const Range& range, std::size_t n) const {
  if (values.size() != n) fail(name, fmt::format("wrong shape: {} values, expected {}", values.size(), n));
  for (const double value : values) (*this)(name, value, range);
}

void AttributeChecker::operator()(std::string_view name, const std::pair<double, double>& interval) const {
  increasing(name, {interval.first, interval.second});
}

void AttributeChecker::increasing(std::string_view name, const std::vector<double>& times) const {
  for (std::size_t i = 0; i < times.size(); ++i) {
    (*this)(name, times[i], finite);
    if (i > 0 && times[i] <= times[i - 1]) {
      fail(name, fmt::format("times are not strictly increasing: {} s after {} s", times[i], times[i - 1]));
    }
  }
}

bool is_utf8_text(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t k) {
      return static_cast<unsigned>(static_cast<unsigned char>(text[k]));
    };
    const unsigned lead = byte(i);
    const std::size_t more = lead < 0x80                   ? 0
                             : lead >= 0xc2 && lead < 0xe0 ? 1
                             : (lead & 0xf0) == 0xe0       ? 2
                             : lead >= 0xf0 && lead < 0xf5 ? 3
                                                           : 9;
    if (lead == 0 || more == 9 || i + more >= text.size() + (more == 0)) return false;
    unsigned code = more == 0 ? lead : lead & (0x3fU >> more);
    for (std::size_t k = 1; k <= more; ++k) {
      if ((byte(i + k) & 0xc0) != 0x80) return false;
      code = code << 6 | (byte(i + k) & 0x3f);
    }
    const bool overlong = (more == 2 && code < 0x800) || (more == 3 && code < 0x10000);
    if (overlong || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return false;
    i += more + 1;
  }
  return true;
}

}  // namespace unhand::datasets
