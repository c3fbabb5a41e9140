// The report of `unhand compare` on releases: figures, tables, per-throw errors.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/compare.hpp"
#include "apps/compare_figures.hpp"
#include "apps/throws.hpp"

namespace unhand::apps {

Table throw_table(const experiment::Comparison& comparison, const datasets::ThrowLog& log) {
  Table out{{"throw", "object", "condition", "split", "model", "outcome", "detach_time_s", "detach_vx_m_s",
             "detach_vz_m_s", "detach_omega_deg_s", "landing_x_m", "landing_theta_deg"},
            {},
            6};
  for (const auto& quantity : experiment::kQuantities)
    out.header.push_back(std::string("error_") + quantity.key);
  for (const auto& model : comparison.models)
    for (const auto& one : model.throws) {
      const auto& p = one.prediction;
      const bool detached = p.release == release::ReleaseOutcome::detached;
      std::vector<std::string> row{one.id,
                                   one.object,
                                   one.condition,
                                   one.split == datasets::Split::train ? "train" : "test",
                                   model.model,
                                   outcome_of(p),
                                   all_digits(detached, p.detach.time + log.clock_origin),
                                   all_digits(detached, p.detach.twist.vx),
                                   all_digits(detached, p.detach.twist.vz),
                                   all_digits(detached, p.detach.twist.omega * experiment::kDegrees),
                                   all_digits(p.landed(), p.landing.pose.x),
                                   all_digits(p.landed(), p.landing.pose.theta * experiment::kDegrees)};
      for (const auto& error : one.error) row.push_back(all_digits(error.has_value(), error.value_or(0)));
      out.rows.push_back(std::move(row));
    }
  return out;
}

void write_release_report(const experiment::Comparison& comparison, const datasets::ThrowLog& log,
                          const ReleaseTables& tables, const Json& json,
                          const std::filesystem::path& directory) {
  std::string pictures;
  if (const auto figure = landing_figure(comparison)) {
    draw(*figure, directory, origin_text(log));
    pictures += fmt::format("![Landing errors]({}.png)\n\n", figure->name);
  }
  if (const auto figure = condition_figure(comparison)) {
    draw(*figure, directory, origin_text(log));
    pictures += fmt::format("![Errors of each condition]({}.png)\n\n", figure->name);
  }
  write_text(
      directory / "report.md",
      fmt::format("# Models against a log\n\n{}\n{}\n{}\n{}## Bias (predicted - measured)\n\n{}\n"
                  "## Parameters\n\n{}\n{}\n",
                  tables.heading, tables.errors.markdown(), tables.floor, pictures, tables.bias.markdown(),
                  tables.parameters.markdown(), fmt::join(tables.methods, "\n\n")));
  write_text(directory / "throws.csv", throw_table(comparison, log).csv());
  write_text(directory / "compare.json", json_text(json));
}

}  // namespace unhand::apps
