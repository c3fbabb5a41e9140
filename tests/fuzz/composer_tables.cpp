// The part of the composer that writes tables of samples.
#include <algorithm>

#include "tests/fuzz/composer.hpp"
#include "tests/fuzz/composer_types.hpp"

namespace unhand::fuzz {
namespace {

std::vector<std::string> parts(std::string_view list) {
  std::vector<std::string> out(1);
  for (const char c : list)
    if (c == ',')
      out.emplace_back();
    else
      out.back() += c;
  return out;
}

std::string joined(const std::vector<std::string>& list) {
  std::string out = list.at(0);
  for (std::size_t i = 1; i < list.size(); ++i) out += "," + list[i];
  return out;
}

/// The same quantity in another unit.
std::string other_unit(const std::string& si, unsigned which) {
  const std::pair<const char*, std::array<const char*, 2>> known[] = {{"m", {"mm", "um"}},
                                                                      {"s", {"ms", " ns"}},
                                                                      {"rad", {"deg", "mrad"}},
                                                                      {"N", {"mN", "kN"}},
                                                                      {"m/s", {"mm/s", "cm/s"}},
                                                                      {"rad/s", {"deg/s", "mrad/s"}},
                                                                      {"m/s^2", {"mm/s²", "cm/s^2"}},
                                                                      {"rad/s^2", {"deg/s^2", "deg/s²"}},
                                                                      {"N m", {"N*mm", "mN·m"}}};
  for (const auto& [unit, others] : known)
    if (si == unit) return others[which % 2];
  return si;
}

/// As numbers that a sensor could have given; a unit quaternion in the last four of seven columns.
std::vector<double> samples(std::size_t rows, std::size_t columns, bool time) {
  std::vector<double> out(rows * columns);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < columns; ++j) {
      const bool quaternion = columns == 7 && j >= 3;
      out[i * columns + j] = time         ? 0.5 + 0.25 * static_cast<double>(i)
                             : quaternion ? (j == 3 ? 1 : 0)
                                          : 0.1 * static_cast<double>(j + 1) + 0.01 * static_cast<double>(i);
    }
  return out;
}

bool sound(const std::vector<double>& values, std::size_t columns, const Composer::Table& table) {
  for (std::size_t i = 0; i * columns < values.size(); ++i) {
    if (i < table.mask.size() && table.mask[i] == 0) continue;
    const double* row = &values[i * columns];
    if (!std::all_of(row, row + columns, [](double x) { return std::isfinite(x); })) return false;
    if (table.time && i > 0 && values[i] <= values[i - 1]) return false;
    if (columns == 7 &&
        std::abs(std::hypot(std::hypot(row[3], row[4]), std::hypot(row[5], row[6])) - 1) > 1e-3)
      return false;
  }
  return true;
}

}  // namespace

/// Where the values are to lie in the file.
struct Composer::Extent {
  std::vector<hsize_t> sizes;
  Handle creation = list_handle(H5Pcreate(H5P_DATASET_CREATE));
  std::vector<hsize_t> most{};  ///< empty: as `sizes`
  bool written = true;

  /// As long as `edge` every way, but no longer than a table that cannot grow.
  void chunked(hsize_t edge) {
    std::vector<hsize_t> chunk(sizes.size(), edge);
    for (std::size_t k = 0; most.empty() && k < chunk.size(); ++k) chunk[k] = std::min(edge, sizes[k]);
    H5Pset_chunk(creation.id(), static_cast<int>(chunk.size()), chunk.data());
  }
  Handle make(hid_t owner, const std::string& name, hid_t type) const {
    const Handle space = sizes.empty()
                             ? scalar()
                             : space_handle(H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(),
                                                             most.empty() ? nullptr : most.data()));
    Handle made = dataset_handle(
        H5Dcreate2(owner, name.c_str(), type, space.id(), H5P_DEFAULT, creation.id(), H5P_DEFAULT));
    must(bool(made));
    return made;
  }
};

bool Composer::link(hid_t owner, std::string& name, unsigned how) {
  switch (how) {
    case 1:
      harm();
      group_handle(H5Gcreate2(owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
      return false;
    case 2:
      harm();
      H5Lcreate_soft("/nowhere", owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return false;
    case 3:
      harm();
      H5Lcreate_external("elsewhere.h5", "/", owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      return false;
    case 4:
      H5Lcreate_soft(("aside " + name).c_str(), owner, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      name = "aside " + name;
      return true;
    case 5:
      harm();
      name = swapped(name);
      return true;
    default:
      return true;
  }
}

void Composer::units_of(hid_t dataset, std::string_view si) {
  auto list = parts(si);
  const bool same = std::all_of(list.begin(), list.end(), [&](const auto& unit) { return unit == list[0]; });
  switch (choices_.next()) {
    default:
      break;
    case 1:
      if (same) list.resize(1);
      break;
    case 2:
      for (auto& unit : list) unit = other_unit(unit, choices_.next());
      break;
    case 3:
      harm();
      list.back() = "kg";
      break;
    case 4:
      harm();
      list.front() = "furlong";
      break;
    case 5:
      harm();
      list.resize(list.size() + 1 + choices_.pick(3), list[0]);
      break;
  }
  const std::string text_of_them = joined(list);
  const std::string_view good[] = {text_of_them};
  text(dataset, "units", text_of_them, true, good);
}

void Composer::table(hid_t owner, const std::string& wanted, const Table& table) {
  std::string name = wanted;
  const std::size_t columns = parts(table.units).size();
  auto values = samples(table.rows, columns, table.time);
  Extent extent{{table.rows}};
  if (columns > 1) extent.sizes.push_back(columns);
  const hid_t memory = H5T_NATIVE_DOUBLE;
  hid_t type = H5T_IEEE_F64LE;
  Handle odd;
  switch (choices_.next()) {
    default:
      break;
    case 1:
      if (table.required) harm();
      return;
    case 2:
      harm();
      odd = odd_type(choices_.next());
      type = odd.id();
      extent.written = false;
      break;
    case 3:
      harm();
      type = stored(choices_.next(), true);
      break;
    case 4: {
      harm();
      const unsigned axes = choices_.pick(3);
      extent.sizes = axes == 0 ? std::vector<hsize_t>{} : std::vector<hsize_t>(2 + axes, 1);
      extent.written = false;
      break;
    }
    case 5:
      harm();
      extent.sizes = {table.rows, columns + 1 - 2 * choices_.pick(2)};
      if (columns == 1) extent.sizes[1] = 1 + choices_.pick(2);
      extent.written = false;
      break;
    case 6:
      harm();
      extent.sizes[0] = choices_.pick(2) == 0 ? 0 : table.rows + 1;
      extent.written = false;
      break;
    case 7: {
      const std::size_t at = choices_.next() % values.size();
      values[at] = odd_number(choices_.next());
      break;
    }
    case 8:
      std::fill(values.begin(), values.end(), 0.0);
      extent.written = false;
      break;
    case 9:
      type = stored(choices_.next(), false);
      break;
    case 10:
      extent.chunked(1 + choices_.pick(7));
      H5Pset_shuffle(extent.creation.id());
      H5Pset_deflate(extent.creation.id(), 1);
      H5Pset_fletcher32(extent.creation.id());
      break;
    case 11:
      extent.most.assign(extent.sizes.size(), H5S_UNLIMITED);
      extent.chunked(100);
      break;
    case 12:
      H5Pset_layout(extent.creation.id(), H5D_COMPACT);
      break;
    case 13:  // more than a log may hold, and nothing of it in the file
      harm();
      extent.sizes[0] = hsize_t{1} << (26 + choices_.pick(36));
      extent.chunked(1);
      extent.written = false;
      break;
    case 14:
      harm();
      H5Pset_external(extent.creation.id(), "elsewhere.bin", 0, H5F_UNLIMITED);
      extent.written = false;
      break;
    case 15:
      if (!link(owner, name, 1 + choices_.pick(5))) return;
      break;
  }
  if (!sound(values, columns, table)) harm();
  const Handle set = extent.make(owner, name, type);
  if (extent.written) must(H5Dwrite(set.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) >= 0);
  units_of(set.id(), table.units);
  reals(set.id(), "sigma", std::vector<double>(columns, 0.01), {1, columns}, kNonNegative, false);
  extras(set.id());
}

std::vector<std::uint8_t> Composer::flags(hid_t owner, const std::string& wanted, std::size_t rows) {
  std::string name = wanted;
  std::vector<long long> values(rows, 1);
  Extent extent{{rows}};
  hid_t type = H5T_STD_U8LE;
  Handle odd;
  switch (choices_.next()) {
    default:
      break;
    case 1:
      return {};
    case 2:
      values[choices_.next() % rows] = 0;
      break;
    case 3:
      std::fill(values.begin(), values.end(), 0);
      break;
    case 4:
      harm();
      type = H5T_STD_I64LE;
      values[choices_.next() % rows] = choices_.pick(2) == 0 ? -1 : 300;
      break;
    case 5:
      type = stored(choices_.next(), true);
      break;
    case 6:
      harm();
      type = H5T_IEEE_F64LE;
      break;
    case 7:
      harm();
      odd = odd_type(choices_.next());
      type = odd.id();
      extent.written = false;
      break;
    case 8:
      harm();
      extent.sizes[0] = rows + 1;
      extent.written = false;
      break;
    case 9:
      harm();
      extent.sizes.push_back(1 + choices_.pick(2));
      extent.written = false;
      break;
    case 10:
      if (!link(owner, name, 1 + choices_.pick(5))) return {};
      break;
    case 11:
      std::fill(values.begin(), values.end(), 0);
      extent.written = false;
      break;
  }
  const Handle set = extent.make(owner, name, type);
  if (extent.written)
    must(H5Dwrite(set.id(), H5T_NATIVE_LLONG, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) >= 0);
  units_of(set.id(), "1");
  extras(set.id());
  return {values.begin(), values.end()};
}

}  // namespace unhand::fuzz
