#include "fitting/discovery/discover_options.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "datasets/near_miss.hpp"
#include "experiment/throw_setup.hpp"
#include "fitting/discovery/footprints.hpp"

namespace unhand::fitting {

void validate(const DiscoverOptions& options) {
  const auto require = [](bool ok, const char* name, double value, const char* range) {
    if (!ok) throw std::invalid_argument(fmt::format("{} = {} is not in {}", name, value, range));
  };
  for (const auto& [name, value] : {std::pair{"matters", options.matters},
                                    {"wrench_matters", options.wrench_matters},
                                    {"wrench_misfit", options.wrench_misfit},
                                    {"law_matters", options.law_matters}})
    require(value > 0 && std::isfinite(value), name, value, "(0, inf)");
  for (const auto& [name, value] :
       {std::pair{"prediction_matters", options.prediction_matters}, {"unexplained", options.unexplained}})
    require(value >= 1 && std::isfinite(value), name, value, "[1, inf)");
  require(options.family_wise_level > 0 && options.family_wise_level < 1, "family_wise_level",
          options.family_wise_level, "(0, 1)");
  require(options.equivalent > 0 && options.equivalent <= 1, "equivalent", options.equivalent, "(0, 1]");
  require(options.refits >= 1, "refits", options.refits, "[1, inf)");
  require(options.most_effects >= 0, "most_effects", options.most_effects, "[0, inf)");
  std::vector<std::string> known;
  for (const auto& effect : experiment::known_effects()) known.push_back(effect.id);
  for (const auto& law : contact::pad_law_names()) known.push_back(std::string(kLaw) + law);
  for (const auto& id : options.forget)
    if (std::find(known.begin(), known.end(), id) == known.end())
      throw std::invalid_argument(
          datasets::unknown_name(fmt::format("forget: there is no effect '{}'", id), id, known));
  for (const auto& law : options.laws)
    if (std::find(known.begin(), known.end(), std::string(kLaw) + law) == known.end())
      throw std::invalid_argument(
          fmt::format("laws: {} is no contact law whose pads press on the object", law));
}

}  // namespace unhand::fitting
