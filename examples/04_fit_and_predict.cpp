// From a log to a card, and from the card to predictions with their uncertainty.
#include <cstdio>

#include "experiment/synthetic_campaign.hpp"
#include "fitting/card.hpp"
#include "fitting/evaluate.hpp"

using namespace unhand;

int main() {
  // In place of a log of yours: datasets::read_throw_log("mine.h5").
  const auto log = experiment::generate_campaign(experiment::campaign_design("quick12"), 1);

  fitting::CampaignOptions options;
  options.model = "limit_surface_disc";
  const fitting::CampaignProblem problem(log, "mine.h5", options);
  const auto fit = fitting::fit(problem);
  if (fit.outcome != fitting::FitOutcome::converged) return 1;
  for (const auto& u : fit.campaign)
    std::printf("%-8s %.5f +- %.5f %s\n", u.unknown.name.c_str(), u.value, u.sigma, u.unknown.unit.c_str());
  datasets::ModelCard card = fitting::card_of(problem, fit);
  card.log = {.file = "mine.h5", .title = log.title};
  datasets::write_model_card("card.json", card);

  for (const auto& one : fitting::predict_throws(problem, fit))
    if (one.sigma && one.comparison.split == datasets::Split::test)
      std::printf("throw %s lands at %.3f +- %.3f m\n", one.comparison.id.c_str(),
                  one.comparison.prediction.landing.pose.x, one.sigma->landing_x);
}
