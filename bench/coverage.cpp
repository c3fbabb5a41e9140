// How often 95 % intervals of fitted parameters hold the truth: campaigns with known parameters, fitted.
//
//   build/release/bench/coverage [campaigns per model = 100] [first seed = 1] [threads = 0] [model ...]
//
// Each campaign has the design of quick12, all throws for training, with a declared pad radius that the log
// gets wrong by up to 10 %. The truth of mu and of the delay is the mean that the throws scatter about.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "contact/convex_quartic.hpp"
#include "dynamics/parallel.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/fit.hpp"

namespace {

using namespace unhand;

double truth_of(const experiment::CampaignDesign& design, const std::string& unknown) {
  if (unknown == "mu") return design.patch.mu;
  if (unknown == "length") return design.patch.length();
  if (unknown == "kappa") return contact::ConvexQuartic::kappa_closest_to_disc();
  return design.opening.dead_time + design.opening.opening_time;  // "delay"
}

struct Tally {
  int n{}, covered{};
  double bias{}, square{}, claimed{};  // of (value − truth), relative
};

struct Outcome {
  bool fitted{};
  std::map<std::string, fitting::FittedUnknown> found;
};

Outcome one_campaign(const experiment::CampaignDesign& design, std::uint64_t seed) {
  Outcome out;
  datasets::ThrowLog log = experiment::generate_campaign(design, seed);
  // Nominal: off by −10, −5, 0, 5 or 10 %.
  if (log.gripper && log.gripper->pad_radius)
    *log.gripper->pad_radius *= 1 + 0.05 * (static_cast<double>(seed % 5) - 2);
  fitting::CampaignOptions campaign;
  campaign.model = design.contact_model;
  campaign.threads = 1;
  const fitting::CampaignProblem problem(log, "campaign", campaign);
  fitting::FitOptions options;
  options.threads = 1;
  options.profile = true;
  const auto fit = fitting::fit(problem, options);
  out.fitted =
      fit.outcome == fitting::FitOutcome::converged || fit.outcome == fitting::FitOutcome::iterations_spent;
  for (const auto& u : fit.campaign) out.found[u.unknown.name] = u;
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const int campaigns = argc > 1 ? std::atoi(argv[1]) : 100;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoi(argv[2]) : 1);
  const int threads = argc > 3 ? std::atoi(argv[3]) : 0;
  std::vector<std::string> models(argv + std::min(argc, 4), argv + argc);
  if (models.empty())
    models = {"limit_surface_disc", "limit_surface", "limit_surface_quartic", "sliding_pivot",
              "gripper_delay"};
  if (campaigns < 1) {
    fmt::print(stderr, "usage: coverage [campaigns per model] [first seed] [threads] [model ...]\n");
    return 2;
  }
  fmt::print("| model | parameter | campaigns | covered by 95 % | bias | scatter | claimed |\n");
  fmt::print("| --- | --- | ---: | ---: | ---: | ---: | ---: |\n");
  for (const auto& model : models) {
    auto design = experiment::campaign_design("quick12");
    design.contact_model = model;
    design.train_share = 1;
    const auto begin = std::chrono::steady_clock::now();
    std::vector<Outcome> outcomes(static_cast<std::size_t>(campaigns));
    dynamics::parallel_for(outcomes.size(), threads,
                           [&](std::size_t i) { outcomes[i] = one_campaign(design, first + i); });
    std::map<std::string, Tally> tallies;
    int failed = 0;
    for (const auto& outcome : outcomes) {
      failed += !outcome.fitted;
      if (!outcome.fitted) continue;
      for (const auto& [name, u] : outcome.found) {
        const double truth = truth_of(design, name), error = (u.value - truth) / truth;
        const auto [low, high] = u.interval95();
        Tally& t = tallies[name];
        ++t.n;
        t.covered += low <= truth && truth <= high;
        t.bias += error;
        t.square += error * error;
        t.claimed += u.sigma / truth;
      }
    }
    for (const auto& [name, t] : tallies) {
      const double n = t.n, bias = t.bias / n;
      fmt::print("| `{}` | {} | {} | {:.1f} % | {:+.2f} % | {:.2f} % | {:.2f} % |\n", model, name, t.n,
                 100.0 * t.covered / n, 100 * bias,
                 100 * std::sqrt(std::max(0.0, t.square / n - bias * bias)), 100 * t.claimed / n);
    }
    fmt::print(stderr, "{}: {} campaigns, {} without an answer, {:.1f} s\n", model, campaigns, failed,
               std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    std::fflush(stdout);
  }
}
