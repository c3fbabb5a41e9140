// Measured throws of an object against what its SKU and a card say of them. Internal to fitting.
#pragma once

#include <optional>

#include "fitting/sku/sku_validation.hpp"

namespace unhand::fitting {

/// Of the log's throws of the object that is called as the SKU, or whose `sku` is; nothing if there is none
/// with a landing.
std::optional<MeasuredVerdict> measured_verdict(const datasets::Sku& sku, const datasets::ModelCard& card,
                                                const std::string& card_file, const SkuRequest& request);

}  // namespace unhand::fitting
