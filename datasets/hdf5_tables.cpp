// The part of hdf5_reader.hpp that reads tables of samples: shapes and units first, then memory, then values.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "datasets/hdf5_reader.hpp"
#include "datasets/units.hpp"

namespace unhand::datasets::hdf5 {
namespace {

constexpr std::string_view dataset_attributes[] = {"units", "sigma"};
constexpr std::size_t widest_number = 16;  // bytes

/// Whether a type is what h5py and others write for booleans: an enumeration of FALSE = 0 and TRUE = 1.
bool is_boolean(const Handle& type) {
  if (H5Tget_class(type.id()) != H5T_ENUM || H5Tget_nmembers(type.id()) != 2) return false;
  const Handle base = type_handle(H5Tget_super(type.id()));
  for (const auto& [name, expected] : {std::pair{"FALSE", 0LL}, {"TRUE", 1LL}}) {
    std::array<long long, 2> value{};  // of at most widest_number bytes, converted in place
    if (H5Tenum_valueof(type.id(), name, value.data()) < 0) return false;
    if (H5Tconvert(base.id(), H5T_NATIVE_LLONG, 1, value.data(), nullptr, H5P_DEFAULT) < 0) return false;
    if (value[0] != expected) return false;
  }
  return true;
}

/// The unit of each column, for which the log names one for all or one per column.
std::vector<const Unit*> column_units(const Node& dataset, const ColumnLayout& layout, std::size_t columns) {
  const std::string units = dataset.text("units");
  const auto listed = static_cast<std::size_t>(std::count(units.begin(), units.end(), ',')) + 1;
  if (listed != 1 && listed != columns) {
    dataset.fail_attribute("units",
                           fmt::format("'{}' names {} units for {} columns", units, listed, columns));
  }
  std::vector<const Unit*> out(columns);
  for (std::size_t j = 0; j < columns; ++j) {
    const std::string_view symbol = part_of(units, listed == 1 ? 0 : j), column = part_of(layout.columns, j);
    const Quantity wanted = find_unit(part_of(layout.units, j))->quantity;
    out[j] = find_unit(symbol);
    if (out[j] == nullptr) {
      dataset.fail_attribute("units", fmt::format("unknown unit '{}' for column {} (known: {})", symbol,
                                                  column, units_of(wanted)));
    }
    if (out[j]->quantity != wanted) {
      dataset.fail_attribute("units", fmt::format("'{}' is a unit of {}, but column {} is {} (known: {})",
                                                  symbol, quantity_name(out[j]->quantity), column,
                                                  quantity_name(wanted), units_of(wanted)));
    }
  }
  return out;
}

/// The declared noise per column, in SI; empty when none is declared.
std::vector<double> column_sigma(const Node& dataset, const std::vector<const Unit*>& units) {
  if (!dataset.has_attribute("sigma")) return {};
  std::vector<double> sigma = dataset.reals("sigma", 0);
  if (sigma.size() == 1) sigma.resize(units.size(), sigma[0]);
  if (sigma.size() != units.size()) {
    dataset.fail_attribute("sigma", fmt::format("{} values for {} columns", sigma.size(), units.size()));
  }
  for (std::size_t j = 0; j < units.size(); ++j) sigma[j] = units[j]->to_si(sigma[j]);
  return sigma;
}

/// The first filter of a dataset that nothing here can undo, by name and number; empty if there is none.
std::string missing_filter(hid_t creation) {
  const int filters = H5Pget_nfilters(creation);
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0, configuration = 0;
    std::size_t values = 0;
    char name[64] = {};
    const H5Z_filter_t filter = H5Pget_filter2(creation, static_cast<unsigned>(i), &flags, &values, nullptr,
                                               sizeof name - 1, name, &configuration);
    if (filter < 0 || H5Zfilter_avail(filter) > 0) continue;
    return fmt::format("the filter {}{}", filter, *name ? fmt::format(" ({})", name) : "");
  }
  return {};
}

std::string shape_text(std::size_t rows, std::size_t cols, int rank) {
  return rank == 1 ? fmt::format("({})", rows) : fmt::format("({},{})", rows, cols);
}

}  // namespace

/// A dataset opened as far as its type and shape; nothing is allocated for its values yet.
struct Node::Table {
  Node node;
  H5T_class_t kind;
  std::size_t rows, cols;
  int rank;
};

Node::Table Node::open_table(std::string_view name) const {
  note(join(path_, name));
  if (!has(name)) fail(name, "required dataset is missing");
  check_link(name);
  Handle object = object_handle(H5Oopen(object_.id(), std::string(name).c_str(), H5P_DEFAULT));
  if (!object) fail(name, fmt::format("cannot be opened ({})", last_message()));
  if (H5Iget_type(object.id()) != H5I_DATASET) fail(name, "is not a dataset");
  const Handle type = type_handle(H5Dget_type(object.id()));
  const Handle space = space_handle(H5Dget_space(object.id()));
  const Handle creation = list_handle(H5Dget_create_plist(object.id()));
  if (!type || !space || !creation) fail(name, fmt::format("cannot be opened ({})", last_message()));
  if (H5Pget_external_count(creation.id()) > 0) fail(name, "keeps its values in another file");
  if (H5Pget_layout(creation.id()) == H5D_VIRTUAL) fail(name, "is virtual: its values are another dataset's");
  if (const std::string filter = missing_filter(creation.id()); !filter.empty())
    fail(name,
         fmt::format("is compressed with {}, which this HDF5 cannot read (gzip and lzf are read)", filter));
  if (H5Tget_size(type.id()) > widest_number)
    fail(name, fmt::format("wrong type: numbers of {} bytes", H5Tget_size(type.id())));
  hsize_t sizes[H5S_MAX_RANK] = {};
  const int rank = H5Sget_simple_extent_dims(space.id(), sizes, nullptr);
  if (rank < 1 || rank > 2) fail(name, fmt::format("wrong shape: {} axes, expected 1 or 2", rank));
  const hsize_t rows = sizes[0], cols = rank == 2 ? sizes[1] : 1;
  hsize_t chunk[H5S_MAX_RANK] = {1, 1};  // read whole, and with an unlimited size it may exceed the data
  if (H5Pget_layout(creation.id()) == H5D_CHUNKED) H5Pget_chunk(creation.id(), rank, chunk);
  const hsize_t budget = shared_->budget;
  const auto absurd = [&](hsize_t n, hsize_t m) {
    return n > budget || m > budget || (n > 0 && m > budget / n);
  };
  if (absurd(rows, cols) || absurd(chunk[0], chunk[1])) {
    fail(name, fmt::format("absurd size: {} x {} values, where one log may hold {} in all", rows, cols,
                           element_budget));
  }
  shared_->budget -= static_cast<std::size_t>(rows * cols);
  Node self(shared_, std::move(object), join(path_, name));
  self.reject_misspelt({}, dataset_attributes);
  return {std::move(self), H5Tget_class(type.id()), static_cast<std::size_t>(rows),
          static_cast<std::size_t>(cols), rank};
}

Series Node::series(std::string_view name, std::span<const ColumnLayout> layouts) const {
  const Table table = open_table(name);
  if (table.kind != H5T_FLOAT) {
    fail(name, fmt::format("wrong type: {}, expected floating-point numbers", class_name(table.kind)));
  }
  const bool list = width(layouts.front()) == 1;
  const ColumnLayout* layout = layout_of_width(layouts, table.cols);
  if (layout == nullptr || table.rank != (list ? 1 : 2)) {
    std::string wanted;
    for (const ColumnLayout& option : layouts) {
      wanted +=
          (wanted.empty() ? "" : " or ") + (list ? std::string("(N)") : fmt::format("(N,{})", width(option)));
    }
    fail(name,
         fmt::format("wrong shape {}, expected {}", shape_text(table.rows, table.cols, table.rank), wanted));
  }
  if (table.rows == 0) fail(name, "is empty: at least one row is needed");
  const std::vector<const Unit*> units = column_units(table.node, *layout, table.cols);
  Series series{table.rows, table.cols, std::vector<double>(table.rows * table.cols), {}};
  if (H5Dread(table.node.object_.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, series.data.data()) <
      0) {
    fail(name, fmt::format("its values cannot be read: damaged data or checksum ({})", last_message()));
  }
  for (std::size_t k = 0; k < series.data.size(); ++k) {
    series.data[k] = units[k % table.cols]->to_si(series.data[k]);
  }
  series.sigma = column_sigma(table.node, units);
  return series;
}

Flags Node::flags(std::string_view name) const {
  const Table table = open_table(name);
  const Node& self = table.node;
  if (table.kind != H5T_INTEGER && !is_boolean(type_handle(H5Dget_type(self.object_.id()))))
    fail(name,
         fmt::format("wrong type: {}, expected integers or HDF5's booleans (an enumeration of FALSE = 0 and "
                     "TRUE = 1)",
                     class_name(table.kind)));
  if (table.rank != 1)
    fail(name, fmt::format("wrong shape {}, expected (N)", shape_text(table.rows, table.cols, table.rank)));
  const std::string units = self.text("units");
  if (units != "1")
    self.fail_attribute("units", fmt::format("unknown unit '{}' for a flag (known: 1)", units));
  Flags flags(table.rows);
  // HDF5 clips what does not fit, so that 300 and -1 come out as 255 and 0: read wide, then look.
  std::vector<long long> wide(table.rows);
  if (H5Dread(self.object_.id(), H5T_NATIVE_LLONG, H5S_ALL, H5S_ALL, H5P_DEFAULT, wide.data()) < 0) {
    fail(name, fmt::format("its values cannot be read: damaged data or checksum ({})", last_message()));
  }
  for (std::size_t i = 0; i < table.rows; ++i) {
    if (wide[i] != 0 && wide[i] != 1) fail(name, fmt::format("row {}: {} is not 0 or 1", i, wide[i]));
    flags[i] = static_cast<std::uint8_t>(wide[i]);
  }
  return flags;
}

}  // namespace unhand::datasets::hdf5
