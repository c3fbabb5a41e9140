// How often Wald's test rejects effects that are not there, on campaigns of eight train throws:
//   build/release/bench/null_p_values [CAMPAIGNS [FIRST_SEED [THREADS]]]
// `as known`: the same test of the same fits, were their covariance known and not estimated from few throws.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include "dynamics/parallel.hpp"
#include "experiment/synthetic_campaign.hpp"
#include "fitting/discovery/stage.hpp"
#include "fitting/discovery/wald.hpp"

namespace {

using namespace unhand;

constexpr std::array kEffects{
    "flight.gravity_tilt", "flight.magnus_lift",      "flight.quadratic_drag", "sensor.mocap_time_offset",
    "sensor.length_scale", "sensor.com_offset",       "sensor.mass",           "sensor.inertia",
    "sensor.ft_bias",      "sensor.normal_force_bias"};

struct Tested {
  double p{}, as_known{}, degrees_of_freedom{};
  bool answered{};
};

Tested test(const datasets::ThrowLog& log, const char* id) {
  fitting::DiscoverOptions options;
  options.fit.threads = 1;
  options.campaign.effects = {id};
  options.campaign.integrator.tolerances = {1e-5, 1e-8};
  fitting::Stage stage{fitting::CampaignProblem(log, "synthetic", options.campaign), {}, {}, {}};
  if (!fitting::solve_train(stage, options, {})) return {};
  const dynamics::Effect effect = fitting::find_effect(id);
  Tested out{fitting::wald_p_value(stage.fit, effect), 1, 1e9, true};
  for (auto& u : stage.fit.campaign) {
    if (u.unknown.name.starts_with(id))
      out.degrees_of_freedom = std::min(out.degrees_of_freedom, u.degrees_of_freedom);
    u.degrees_of_freedom = 1e9;
  }
  out.as_known = fitting::wald_p_value(stage.fit, effect);
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const int campaigns = argc > 1 ? std::atoi(argv[1]) : 40;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoi(argv[2]) : 1);
  const int threads = argc > 3 ? std::atoi(argv[3]) : 0;
  if (campaigns < 1) {
    fmt::print(stderr, "usage: null_p_values [campaigns] [first seed] [threads]\n");
    return 2;
  }
  std::vector<std::array<Tested, kEffects.size()>> all(static_cast<std::size_t>(campaigns));
  dynamics::parallel_for(all.size(), threads, [&](std::size_t i) {
    const auto log = experiment::generate_campaign(experiment::campaign_design("quick12"), first + i);
    for (std::size_t e = 0; e < kEffects.size(); ++e) all[i][e] = test(log, kEffects[e]);
  });
  fmt::print(
      "| effect | tests | degrees of freedom, median | p < 0.05 | p < 0.01 | as known: p < 0.05 | p < 0.01 "
      "|\n");
  fmt::print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |\n");
  std::array<int, 5> sum{};
  const auto row = [](const char* name, const std::string& median, const std::array<int, 5>& n) {
    fmt::print("| {} | {} | {} | {} | {} | {} | {} |\n", name, n[0], median, n[1], n[2], n[3], n[4]);
  };
  for (std::size_t e = 0; e < kEffects.size(); ++e) {
    std::array<int, 5> n{};
    std::vector<double> freedom;
    for (const auto& campaign : all) {
      const Tested& t = campaign[e];
      if (!t.answered) continue;
      freedom.push_back(t.degrees_of_freedom);
      ++n[0], n[1] += t.p < 0.05, n[2] += t.p < 0.01, n[3] += t.as_known < 0.05, n[4] += t.as_known < 0.01;
    }
    for (std::size_t k = 0; k < n.size(); ++k) sum[k] += n[k];
    std::sort(freedom.begin(), freedom.end());
    row(kEffects[e], freedom.empty() ? "" : fmt::format("{:.1f}", freedom[freedom.size() / 2]), n);
  }
  row("all", "", sum);
}
