// unhand compare on free flights and falls with the card that unhand discover wrote of such.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/cards.hpp"
#include "apps/command.hpp"
#include "apps/compare.hpp"
#include "apps/figure.hpp"
#include "apps/measured_report.hpp"
#include "apps/tell.hpp"
#include "apps/throws.hpp"
#include "fitting/measured/measured_card.hpp"

namespace unhand::apps {
namespace {

using fitting::CardComparison;
using fitting::NamedErrors;

Json errors_json(const NamedErrors& errors) {
  Json out = Json::object();
  for (const auto& [name, value] : errors) out[name] = number(value);
  return out;
}

std::string value_of(const NamedErrors& errors, std::size_t k) {
  return k < errors.size() ? error_text(errors[k].first, errors[k].second) : "";
}

}  // namespace

void compare_with_card(const CompareRequest& request, const datasets::ThrowLog& log) {
  if (request.cards.size() != 1)
    throw WrongUsage("free flights and falls are compared with one --card at a time");
  const std::string& file = request.cards.front();
  const auto card = read_card(file);
  if (!request.models.empty() && request.models != std::vector{card.model})
    throw WrongUsage(fmt::format("{}: a card for '{}', which is not what --models names", file, card.model));
  if (!request.write_cards.empty())
    throw WrongUsage(
        "--write-cards: free flights and falls get theirs from `unhand discover LOG --card FILE`");
  CardComparison found;
  try {
    found = fitting::compare_with_card(card, file, log, request.threads);
  } catch (const std::invalid_argument& error) {
    throw Unanswered(fmt::format("{}: {}", request.log, error.what()));
  }
  if (found.train + found.test == 0)
    throw Unanswered(fmt::format("{}: no throw could be fitted", request.log));
  for (const auto& [id, reason] : found.skipped) tell("unhand: throw {}: {}\n", id, reason);

  Json json = json_head("compare");
  json["log"] = request.log;
  json["source"] = log.source;
  json["card"] = file;
  json["model"] = card.model;
  json["effects"] = card.effects;
  json["parameters"] = Json::object();
  for (const auto& [name, p] : card.parameters) json["parameters"][name] = p.value;
  json["base"] = {{"train", errors_json(found.base_train)}, {"test", errors_json(found.base_test)}};
  json["with_card"] = {{"train", errors_json(found.card_train)}, {"test", errors_json(found.card_test)}};
  json["train"] = found.train, json["test"] = found.test;

  Table table{{"error", card.model + ", train", "test", "card, train", "test"}, {}, 1};
  const NamedErrors& names = found.train > 0 ? found.base_train : found.base_test;
  for (std::size_t k = 0; k < names.size(); ++k)
    table.rows.push_back({error_title(names[k].first), value_of(found.base_train, k),
                          value_of(found.base_test, k), value_of(found.card_train, k),
                          value_of(found.card_test, k)});
  const std::string heading = fmt::format(
      "{}: {}\n{} {}, {} of them held out; each one's start is fitted, {} from {}\n", request.log,
      origin_text(log), found.train + found.test, found.kind, found.test,
      card.effects.empty() ? "without effects" : fmt::format("{}", fmt::join(card.effects, ", ")), file);
  answer_with(request, heading, table, json, [&](const std::filesystem::path& directory) {
    const Figure figure =
        measured_residual_figure(found.base_profile, found.card_profile, card.model, "with the card");
    draw(figure, directory, origin_text(log));
    write_text(
        directory / "report.md",
        fmt::format("# A card against a log\n\n{}\n{}\nResiduals of the {} throws over their duration, "
                    "each with its start fitted; 1 is the noise.\n\n![Residuals]({}.png)\n",
                    markdown_text(heading), table.markdown(), found.test > 0 ? "held-out" : "train",
                    figure.name));
  });
}

}  // namespace unhand::apps
