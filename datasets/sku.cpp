#include "datasets/sku.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "datasets/toml_keys.hpp"

namespace unhand::datasets {
namespace {

namespace fs = std::filesystem;

constexpr TomlLimits mass_limits{0, 1000, true, "kg"};
constexpr TomlLimits sigma_mass_limits{0, 1000, false, "kg"};
constexpr TomlLimits length_limits{0, 10, true, "m"};
constexpr TomlLimits offset_limits{-10, 10, false, "m"};
constexpr TomlLimits sigma_offset_limits{0, 10, false, "m"};
constexpr TomlLimits inertia_limits{0, 1e5, true, "kg m^2"};
constexpr TomlLimits sigma_inertia_limits{0, 1e5, false, "kg m^2"};
constexpr TomlLimits drag_limits{0, 100, false, "1/m"};

constexpr std::string_view shape_names = "box, rod, cylinder, disc, sphere";

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
  TomlKeys keys = TomlKeys::parse(file);
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
  if (*sku.shape == "disc") {
    const double across = about_y / 2 + sku.mass * y * y / 12;
    return {{across, about_y, across}};
  }
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
