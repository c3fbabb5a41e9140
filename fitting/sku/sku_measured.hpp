// Measured throws of an object against what its SKU and a card say of them. Internal to fitting.
#pragma once

#include <optional>

#include "fitting/sku/sku_validation.hpp"

namespace unhand::fitting {

/// Of the log's throws of the object that is called as the SKU, or whose `sku` is; nothing if there is none
/// with a landing. Of the card's own log, `held_out`, the train throws do not count.
std::optional<MeasuredVerdict> measured_verdict(const datasets::Sku& sku, const datasets::ModelCard& card,
                                                const std::string& card_file, const SkuRequest& request,
                                                bool held_out);

}  // namespace unhand::fitting
