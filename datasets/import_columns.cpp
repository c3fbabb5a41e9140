#include "datasets/import_columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>

#include "datasets/csv.hpp"
#include "datasets/near_miss.hpp"
#include "datasets/units.hpp"

namespace unhand::datasets {
namespace {

struct Wanted {
  std::string_view name;
  Quantity quantity;
};
using enum Quantity;
constexpr Wanted hand_table[] = {{"time", time},          {"x", length},
                                 {"z", length},           {"theta", angle},
                                 {"vx", speed},           {"vz", speed},
                                 {"omega", angular_rate}, {"ax", acceleration},
                                 {"az", acceleration},    {"alpha", angular_acceleration}};
constexpr Wanted ft_table[] = {
    {"time", time}, {"fx", force}, {"fz", force}, {"tau", torque}, {"normal", force}};
constexpr Wanted mocap_table[] = {{"time", time}, {"x", length}, {"z", length}, {"theta", angle}};

/// The channels of a file, and how many of them each dataset of the log takes.
struct Table {
  std::span<const Wanted> channels;
  std::vector<std::size_t> widths;
};
Table table_of(TableKind kind) {
  switch (kind) {
    case TableKind::hand:
      return {hand_table, {1, 3, 3, 3}};
    case TableKind::ft:
      return {ft_table, {1, 3, 1}};
    case TableKind::mocap:
      return {mocap_table, {1, 3}};
  }
  return {};
}

/// Whether a tracker that lost the body writes this: nothing, or that it is no number.
bool stands_for_nothing(std::string cell) {
  std::transform(cell.begin(), cell.end(), cell.begin(), [](unsigned char c) { return std::tolower(c); });
  const bool nan = cell == "nan" || cell == "-nan" || cell == "+nan";
  return cell.empty() || nan || cell == "n/a" || cell == "na";
}

/// A channel's column: where it is, what it is called in errors, and how it becomes SI.
struct Column {
  std::size_t index = 0;
  std::string header;
  double sign = 1;
  const Unit* unit = nullptr;

  double read(const CsvLine& line) const { return sign * unit->to_si(line.real(index, header)); }
  bool is_lost(const CsvLine& line) const { return stands_for_nothing(line.cells[index]); }
};

/// "Fx (N)" or "Fx [N]" as name and unit.
struct Header {
  std::string name, unit;
};
Header parse_header(std::string_view text) {
  const std::size_t open = text.find_last_of("([");
  if (text.empty() || open == std::string_view::npos || (text.back() != ')' && text.back() != ']'))
    return {std::string(text), {}};
  std::string_view name = text.substr(0, open);
  while (!name.empty() && (name.back() == ' ' || name.back() == '_')) name.remove_suffix(1);
  return {std::string(name), std::string(text.substr(open + 1, text.size() - open - 2))};
}

/// How labs spell some units, as the log does.
std::string spelt(std::string_view unit) {
  constexpr std::pair<std::string_view, std::string_view> ours[] = {
      {"Nm", "N m"}, {"Nmm", "N mm"}, {"mNm", "mN m"}, {"sec", "s"}, {"°", "deg"}, {"°/s", "deg/s"}};
  for (const auto& [theirs, symbol] : ours)
    if (unit == theirs) return std::string(symbol);
  return std::string(unit);
}

/// "#3" as 2.
std::optional<std::size_t> parse_index(std::string_view text) {
  std::size_t index = 0;
  if (!text.starts_with('#')) return {};
  const auto [end, error] = std::from_chars(text.data() + 1, text.data() + text.size(), index);
  if (error != std::errc{} || end != text.data() + text.size() || index == 0) return {};
  return index - 1;
}

/// The columns of a file that has this first line.
class ColumnFinder {
 public:
  ColumnFinder(const CsvLine& line, const ColumnMap& map, bool has_header)
      : line_(line), map_(map), has_header_(has_header) {
    for (const std::string& cell : line.cells) headers_.push_back(parse_header(cell));
  }

  Column find(const Wanted& wanted) const {
    std::string said = map_.columns.at(std::string(wanted.name));
    Column out;
    if (said.starts_with('-')) {
      out.sign = -1;
      said.erase(0, 1);
    }
    out.index = index_of(wanted, said);
    out.header = has_header_ ? line_.cells[out.index] : said;
    const auto given = map_.units.find(std::string(wanted.name));
    const std::string symbol = given != map_.units.end() ? given->second
                               : has_header_             ? headers_[out.index].unit
                                                         : std::string();
    const std::string hint = fmt::format("give {}=UNIT ({})", wanted.name, units_of(wanted.quantity));
    if (symbol.empty()) line_.fail(out.header, "has no unit: " + hint);
    out.unit = find_unit(spelt(symbol));
    if (out.unit == nullptr) line_.fail(out.header, fmt::format("unit '{}' is not known: {}", symbol, hint));
    if (out.unit->quantity != wanted.quantity)
      line_.fail(out.header,
                 fmt::format("unit '{}' is for {}, but {} is measured in {}", symbol,
                             quantity_name(out.unit->quantity), wanted.name, units_of(wanted.quantity)));
    return out;
  }

 private:
  std::size_t index_of(const Wanted& wanted, const std::string& said) const {
    if (const auto index = parse_index(said)) {
      if (*index >= line_.cells.size())
        line_.fail("", fmt::format("{}={} of {} columns", wanted.name, said, line_.cells.size()));
      return *index;
    }
    std::size_t found = headers_.size(), count = 0;
    for (std::size_t j = 0; j < headers_.size(); ++j) {
      if (headers_[j].name != said && line_.cells[j] != said) continue;
      if (count++ == 0) found = j;
    }
    if (count > 1)
      line_.fail(said, fmt::format("stands {} times in the header: say which by #number", count));
    if (count == 1) return found;
    std::vector<std::string> known;
    for (const Header& header : headers_) known.push_back(header.name);
    line_.fail("",
               unknown_name(fmt::format("there is no column '{}' for {}", said, wanted.name), said, known));
  }

  const CsvLine& line_;
  const ColumnMap& map_;
  bool has_header_;
  std::vector<Header> headers_;
};

/// Columns [first, first + cols) of the wanted ones become one dataset.
Series make_series(std::span<const Wanted> table, const std::vector<Column>& columns, const ColumnMap& map,
                   std::size_t first, std::size_t cols) {
  Series out{0, cols, {}, {}};
  for (std::size_t j = first; j < first + cols; ++j) {
    const auto sigma = map.sigma.find(std::string(table[j].name));
    if (sigma != map.sigma.end()) out.sigma.push_back(columns[j].unit->to_si(sigma->second));
  }
  return out;
}

/// The datasets, the first of them time. With `valid`, rows in which a value beside the time is lost become
/// NaN.
std::vector<Series> read_table(const std::filesystem::path& file, const ColumnMap& map, TableKind kind,
                               Flags* valid = nullptr) {
  const std::string fault = fault_of(map, kind);
  if (!fault.empty()) throw std::invalid_argument(fault);
  const auto [table, widths] = table_of(kind);
  CsvReader reader(file, '\0');
  CsvLine line;
  if (!reader.next(line)) reader.fail(1, "is empty, expected a header and rows of numbers");
  const bool by_number = std::all_of(map.columns.begin(), map.columns.end(),
                                     [](const auto& entry) { return entry.second.find('#') <= 1; });
  // The first line, where it holds numbers and nothing else but losses; a bare sign is no header.
  bool is_row = true, any = false;
  for (std::size_t j = 0; j < line.cells.size(); ++j) {
    const bool number = line.is_number(j);
    any = any || number;
    const bool sign = line.cells[j] == "-" || line.cells[j] == "+";
    is_row = is_row && (number || sign || (valid != nullptr && stands_for_nothing(line.cells[j])));
  }
  is_row = is_row && any;
  if (is_row && !by_number)
    line.fail("", "the header is missing: name the columns by number, " + map.columns.begin()->first + "=#1");
  const ColumnFinder finder(line, map, !is_row);
  std::vector<Column> columns;
  for (const Wanted& wanted : table) columns.push_back(finder.find(wanted));

  std::vector<Series> out;
  std::size_t first = 0;
  for (const std::size_t cols : widths) {
    out.push_back(make_series(table, columns, map, first, cols));
    first += cols;
  }
  const std::size_t width = line.cells.size();
  Series& clock = out.front();
  for (bool more = is_row || reader.next(line); more; more = reader.next(line)) {
    line.expect_cells(width);
    const bool lost = valid != nullptr && std::any_of(columns.begin() + 1, columns.end(),
                                                      [&](const Column& one) { return one.is_lost(line); });
    if (valid != nullptr) valid->push_back(lost ? 0 : 1);
    std::size_t next = 0;
    for (Series& series : out) {
      for (std::size_t j = 0; j < series.cols; ++j, ++next)
        series.data.push_back(lost && next > 0 ? std::numeric_limits<double>::quiet_NaN()
                                               : columns[next].read(line));
      ++series.rows;
    }
    clock.data.back() += map.time_offset;
    const std::size_t n = clock.rows;
    if (n > 1 && clock(n - 1) <= clock(n - 2))
      line.fail(columns[0].header,
                fmt::format("time is not strictly increasing: {} s after {} s", clock(n - 1), clock(n - 2)));
  }
  if (clock.rows == 0) reader.fail(1, "holds no rows after the header");
  return out;
}

/// Angles in column 2 never step by more than π from one finite row to the next.
void unwrap(Series& pose) {
  constexpr double turn = 2 * std::numbers::pi;
  std::optional<double> last;
  for (std::size_t i = 0; i < pose.rows; ++i) {
    if (std::isnan(pose(i, 2))) continue;
    if (last) pose(i, 2) -= turn * std::round((pose(i, 2) - *last) / turn);
    last = pose(i, 2);
  }
}

}  // namespace

std::vector<std::string> channels_of(TableKind kind) {
  std::vector<std::string> names;
  for (const Wanted& wanted : table_of(kind).channels) names.emplace_back(wanted.name);
  return names;
}

std::string fault_of(const ColumnMap& map, TableKind kind) {
  const auto channels = channels_of(kind);
  const auto unknown = [&](const auto& entries, std::string_view what) -> std::string {
    for (const auto& [name, value] : entries)
      if (std::find(channels.begin(), channels.end(), name) == channels.end())
        return unknown_name(fmt::format("{}: there is no channel '{}'", what, name), name, channels);
    return {};
  };
  for (const std::string& fault :
       {unknown(map.columns, "columns"), unknown(map.units, "units"), unknown(map.sigma, "sigma")})
    if (!fault.empty()) return fault;
  for (const std::string& name : channels)
    if (!map.columns.contains(name))
      return fmt::format("columns: '{}' is missing (needed: {})", name, fmt::join(channels, ", "));
  for (const auto& [name, value] : map.sigma)
    if (!(std::isfinite(value) && value >= 0)) return fmt::format("sigma: {}={} is not >= 0", name, value);
  std::size_t first = 0;
  for (const std::size_t width : table_of(kind).widths) {
    std::size_t given = 0;
    for (std::size_t j = first; j < first + width; ++j) given += map.sigma.contains(channels[j]);
    if (given != 0 && given != width)
      return fmt::format("sigma: give it for all of {} or for none",
                         fmt::join(channels.begin() + static_cast<std::ptrdiff_t>(first),
                                   channels.begin() + static_cast<std::ptrdiff_t>(first + width), ", "));
    first += width;
  }
  return {};
}

HandLog read_hand_csv(const std::filesystem::path& file, const ColumnMap& map) {
  auto series = read_table(file, map, TableKind::hand);
  unwrap(series[1]);
  return {std::move(series[0]), std::move(series[1]), std::move(series[2]), std::move(series[3])};
}

FtLog read_ft_csv(const std::filesystem::path& file, const ColumnMap& map) {
  auto series = read_table(file, map, TableKind::ft);
  return {std::move(series[0]), std::move(series[1]), std::move(series[2])};
}

MocapLog read_mocap_csv(const std::filesystem::path& file, const ColumnMap& map) {
  Flags valid;
  auto series = read_table(file, map, TableKind::mocap, &valid);
  if (std::find(valid.begin(), valid.end(), 1) == valid.end())
    throw ImportError(file.string(), "",
                      fmt::format("the object is lost in all of its {} rows", valid.size()));
  unwrap(series[1]);
  return {std::move(series[0]), std::move(series[1]), std::move(valid)};
}

}  // namespace unhand::datasets
