#include "apps/cards.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>

namespace unhand::apps {
namespace {

namespace fs = std::filesystem;
using datasets::CardError;
using datasets::ModelCard;

constexpr const char* delay_model = "gripper_delay";

/// The parameters of a card, asked for by name.
class Reader {
 public:
  Reader(std::string file, const ModelCard& card) : file_(std::move(file)), card_(card) {}

  [[noreturn]] void fail(const std::string& path, const std::string& why) const {
    throw CardError(file_, path, why);
  }

  double take(const std::string& name, const std::string& unit, double low, double high) {
    const auto found = card_.parameters.find(name);
    if (found == card_.parameters.end())
      fail("/parameters/" + name, fmt::format("is missing: {} takes it", card_.model));
    asked_.push_back(name);
    const auto& [value, sigma, given] = found->second;
    if (given != unit) fail("/parameters/" + name + "/unit", fmt::format("is '{}', not '{}'", given, unit));
    if (!(value >= low && value <= high))
      fail("/parameters/" + name + "/value", fmt::format("{} is not in [{}, {}] {}", value, low, high, unit));
    return value;
  }

  double take_or(const std::string& name, const std::string& unit, double low, double high,
                 double otherwise) {
    return card_.parameters.contains(name) ? take(name, unit, low, high) : otherwise;
  }

  void reject_unknown() const {
    for (const auto& [name, ignored] : card_.parameters)
      if (std::find(asked_.begin(), asked_.end(), name) == asked_.end())
        fail("/parameters/" + name,
             fmt::format("is no parameter of {}, which takes {}", card_.model, fmt::join(asked_, ", ")));
  }

 private:
  std::string file_;
  const ModelCard& card_;
  std::vector<std::string> asked_;
};

/// FNV-1a of the file's bytes: tells logs apart, and is no protection.
std::optional<std::string> checksum(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::uint64_t hash = 0xcbf29ce484222325u;
  std::array<char, 65536> block{};
  while (in.read(block.data(), block.size()), in.gcount() > 0)
    for (std::streamsize i = 0; i < in.gcount(); ++i)
      hash = (hash ^ static_cast<unsigned char>(block[static_cast<std::size_t>(i)])) * 0x100000001b3u;
  if (!in.eof()) return {};
  return fmt::format("fnv1a64:{:016x}", hash);
}

}  // namespace

std::vector<NamedValue> named_values(const std::string& model, const experiment::ModelParameters& p) {
  if (model == delay_model) {
    std::vector<NamedValue> out{{"delay", "s", p.delay.centre}};
    if (p.delay.kind == contact::DelayDistribution::Kind::truncated_normal)
      out.push_back({"delay_sigma", "s", p.delay.spread});
    return out;
  }
  return {{"mu", "-", p.mu}, {"length", "m", p.length}, {"pads", "-", static_cast<double>(p.pads)}};
}

UsableCard read_usable_card(const fs::path& file) {
  UsableCard out{datasets::read_model_card(file), {}};
  Reader reader(file.string(), out.card);
  const auto models = experiment::release_model_names();
  if (std::find(models.begin(), models.end(), out.card.model) == models.end())
    reader.fail("/model", fmt::format("'{}' is no model of releases; there are {}", out.card.model,
                                      fmt::join(models, ", ")));
  auto& p = out.parameters;
  if (out.card.model == delay_model) {
    const double delay = reader.take("delay", "s", 0, 10),
                 sigma = reader.take_or("delay_sigma", "s", 0, 10, 0);
    p.delay = sigma > 0 ? contact::DelayDistribution::normal(delay, sigma, std::max(0.1, 2 * delay))
                        : contact::DelayDistribution::number(delay);
  } else {
    p.mu = reader.take("mu", "-", 0, 10);
    p.length = reader.take("length", "m", 1e-9, 2.0 / 3.0);
    const double pads = reader.take_or("pads", "-", 1, 1000, 2);
    if (pads != std::floor(pads))
      reader.fail("/parameters/pads/value", fmt::format("{} is not a whole number", pads));
    p.pads = static_cast<int>(pads);
  }
  reader.reject_unknown();
  return out;
}

std::vector<NamedValue> conditions_of(const experiment::PreparedThrow& one) {
  std::vector<NamedValue> out{{"mass", "kg", one.body.mass}};
  if (one.normal_force) out.push_back({"grip_force", "N", one.force_fit.grip_force});
  if (one.measured.detach_twist)
    out.push_back(
        {"detach_speed", "m/s", std::hypot(one.measured.detach_twist->vx, one.measured.detach_twist->vz)});
  return out;
}

ModelCard card_of(const experiment::ModelComparison& model, const fs::path& log_file,
                  const datasets::ThrowLog& log, const std::vector<experiment::PreparedThrow>& throws) {
  ModelCard card;
  card.model = model.model;
  for (const auto& [name, unit, value] : named_values(model.model, model.estimate.parameters))
    card.parameters[name] = {value, {}, unit};
  card.log = {log_file.filename().string(), log.title, checksum(log_file)};
  card.split = "train";
  for (const auto& one : throws) {
    if (one.split != datasets::Split::train) continue;
    for (const auto& [name, unit, value] : conditions_of(one)) {
      auto& range = card.valid_range.try_emplace(name, datasets::CardRange{value, value, unit}).first->second;
      range.low = std::min(range.low, value);
      range.high = std::max(range.high, value);
    }
  }
  card.library_version = UNHAND_VERSION;
  return card;
}

}  // namespace unhand::apps
