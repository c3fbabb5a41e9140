#include "datasets/sku.hpp"

#include <fmt/format.h>

#include <toml++/toml.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "datasets/near_miss.hpp"

namespace unhand::datasets {
namespace {

namespace fs = std::filesystem;

/// Accepted values of a key, ends included unless open.
struct Limits {
  double low, high;
  bool open_low;
  const char* unit;

  bool accept(double value) const { return value <= high && (open_low ? value > low : value >= low); }
  std::string text() const { return fmt::format("{}{}, {}] {}", open_low ? "(" : "[", low, high, unit); }
};

constexpr Limits mass_limits{0, 1000, true, "kg"};
constexpr Limits sigma_mass_limits{0, 1000, false, "kg"};
constexpr Limits length_limits{0, 10, true, "m"};
constexpr Limits offset_limits{-10, 10, false, "m"};
constexpr Limits sigma_offset_limits{0, 10, false, "m"};
constexpr Limits inertia_limits{0, 1e5, true, "kg m^2"};
constexpr Limits sigma_inertia_limits{0, 1e5, false, "kg m^2"};
constexpr Limits drag_limits{0, 100, false, "1/m"};

constexpr std::string_view shape_names = "box, rod, cylinder, disc, sphere";

/// A table whose keys are asked for one by one; a key nobody asked for is an error.
class Keys {
 public:
  Keys(std::string file, toml::table table) : file_(std::move(file)), table_(std::move(table)) {}

  [[noreturn]] void fail(std::string_view key, const std::string& why) const {
    const toml::node* node = table_.get(key);
    const toml::source_position at = node != nullptr ? node->source().begin : toml::source_position{};
    throw SkuError(file_, static_cast<int>(at.line), static_cast<int>(at.column), std::string(key), why);
  }

  std::optional<double> number(std::string_view key, const Limits& limits) {
    const toml::node* node = ask(key);
    if (node == nullptr) return {};
    return checked(key, *node, limits);
  }

  std::optional<std::string> text(std::string_view key) {
    const toml::node* node = ask(key);
    if (node == nullptr) return {};
    if (!node->is_string()) fail(key, fmt::format("{} is not text", shown(*node)));
    std::string value = node->as_string()->get();
    if (value.empty()) fail(key, "is empty text");
    return value;
  }

  std::optional<std::array<double, 3>> triple(std::string_view key, const Limits& limits) {
    const toml::node* node = ask(key);
    if (node == nullptr) return {};
    const toml::array* list = node->as_array();
    if (list == nullptr || list->size() != 3)
      fail(key, fmt::format("{} is not a list of 3 numbers", shown(*node)));
    std::array<double, 3> values{};
    for (std::size_t i = 0; i < 3; ++i) values[i] = checked(key, *list->get(i), limits);
    return values;
  }

  template <class T>
  T required(std::string_view key, std::optional<T> value) const {
    if (!value) fail(key, "required key is missing");
    return *std::move(value);
  }

  /// To be called once every key has been asked for.
  void reject_unknown() const {
    for (const auto& [key, node] : table_) {
      const std::string_view name = key.str();
      if (std::find(asked_.begin(), asked_.end(), name) != asked_.end()) continue;
      const std::string_view meant = nearest_name(name, asked_);
      std::string known;
      for (const std::string_view k : asked_) known += fmt::format("{}{}", known.empty() ? "" : ", ", k);
      fail(name, meant.empty() ? fmt::format("unknown key (known: {})", known)
                               : fmt::format("unknown key: did you mean '{}'?", meant));
    }
  }

 private:
  const toml::node* ask(std::string_view key) {
    asked_.push_back(key);
    return table_.get(key);
  }

  static std::string shown(const toml::node& node) {
    std::ostringstream out;
    node.visit([&](const auto& value) { out << value; });
    return out.str();
  }

  double checked(std::string_view key, const toml::node& node, const Limits& limits) const {
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value) fail(key, fmt::format("{} is not a number; accepted: {}", shown(node), limits.text()));
    if (!limits.accept(*value)) fail(key, fmt::format("{} is outside {}", shown(node), limits.text()));
    return *value;
  }

  std::string file_;
  toml::table table_;
  std::vector<std::string_view> asked_;
};

toml::table parse(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) throw SkuError(file.string(), 0, 0, "file", "no such file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw SkuError(file.string(), 0, 0, "file", "cannot be opened");
  try {
    return toml::parse(in, file.string());
  } catch (const toml::parse_error& bad) {
    const toml::source_position at = bad.source().begin;
    throw SkuError(file.string(), static_cast<int>(at.line), static_cast<int>(at.column), "syntax",
                   std::string(bad.description()));
  }
}

}  // namespace

double shape_inertia(const std::string& shape, double mass, const std::array<double, 3>& dims) {
  const auto [x, y, z] = dims;
  if (shape == "box") return mass * (x * x + z * z) / 12;
  if (shape == "rod") return mass * x * x / 12;
  if (shape == "cylinder") return mass * (3 * (z / 2) * (z / 2) + x * x) / 12;
  if (shape == "disc") return mass * (x / 2) * (x / 2) / 2;
  if (shape == "sphere") return 2 * mass * (x / 2) * (x / 2) / 5;
  throw std::invalid_argument(fmt::format("shape: '{}' is not one of {}", shape, shape_names));
}

Sku read_sku(const fs::path& file) {
  Keys keys(file.string(), parse(file));
  Sku sku;
  const auto name = keys.text("name");
  const auto mass = keys.number("mass_kg", mass_limits);
  sku.mass_sigma = keys.number("mass_sigma_kg", sigma_mass_limits);
  sku.dims = keys.triple("dims_m", length_limits);
  sku.com_offset = keys.number("com_offset_m", offset_limits).value_or(0);
  sku.com_offset_sigma = keys.number("com_offset_sigma_m", sigma_offset_limits);
  sku.shape = keys.text("shape");
  sku.inertia = keys.number("inertia_kg_m2", inertia_limits);
  sku.inertia_sigma = keys.number("inertia_sigma_kg_m2", sigma_inertia_limits);
  sku.drag_k = keys.number("drag_k_per_m", drag_limits);
  const auto surface = keys.text("surface");
  sku.source = keys.text("source");
  sku.notes = keys.text("notes");
  keys.reject_unknown();

  sku.name = keys.required("name", name);
  sku.mass = keys.required("mass_kg", mass);
  sku.surface = keys.required("surface", surface);
  if (!sku.shape) return sku;
  if (!sku.dims) keys.fail("shape", "needs dims_m beside it");
  const auto [x, y, z] = *sku.dims;
  const auto differ = [](double a, double b) {
    return std::abs(a - b) > 0.01 * std::max(a, b);
  };  // tape-measure equal
  if (*sku.shape == "cylinder" && differ(y, z))
    keys.fail("shape", "a cylinder along x needs equal y and z in dims_m");
  if (*sku.shape == "disc" && differ(x, z))
    keys.fail("shape", "a disc about y needs equal x and z in dims_m");
  if (*sku.shape == "sphere" && (differ(x, y) || differ(x, z)))
    keys.fail("shape", "a sphere needs three equal dims_m");
  try {
    const double computed = shape_inertia(*sku.shape, sku.mass, *sku.dims);
    if (!sku.inertia) sku.inertia = computed;
  } catch (const std::invalid_argument&) {
    keys.fail("shape", fmt::format("'{}' is not one of {}", *sku.shape, shape_names));
  }
  return sku;
}

/// About x, y and z; nothing where the shape or a measured inertia leaves one of them open.
std::optional<std::vector<double>> spatial_inertia(const Sku& sku) {
  if (!sku.shape || !sku.dims || *sku.shape == "rod") return {};
  const auto [x, y, z] = *sku.dims;
  const double about_y = shape_inertia(*sku.shape, sku.mass, *sku.dims);
  if (std::abs(about_y - sku.inertia.value_or(0)) > 1e-12 * about_y) return {};
  if (*sku.shape == "sphere") return {{about_y, about_y, about_y}};
  if (*sku.shape == "disc") return {{about_y / 2, about_y, about_y / 2}};
  if (*sku.shape == "cylinder") return {{sku.mass * z * z / 8, about_y, about_y}};
  return {{sku.mass * (y * y + z * z) / 12, about_y, sku.mass * (x * x + y * y) / 12}};
}

Object to_object(const Sku& sku, int dimension) {
  Object object;
  object.mass = sku.mass;
  if (dimension == 3)
    object.inertia = spatial_inertia(sku);
  else if (sku.inertia)
    object.inertia = std::vector<double>{*sku.inertia};
  object.com_offset = sku.com_offset;
  object.dims = sku.dims;
  object.surface = sku.surface;
  object.sku = sku.name;
  object.drag_k = sku.drag_k;
  return object;
}

}  // namespace unhand::datasets
