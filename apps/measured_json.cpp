// discovery.json of unhand discover on measured logs.
#include "apps/measured_report.hpp"
#include "apps/ranking.hpp"
#include "fitting/card.hpp"

namespace unhand::apps {
namespace {

using fitting::MeasuredDiscovery;
using fitting::NamedErrors;

Json errors_json(const NamedErrors& errors, int n) {
  // The fields that every discovery has; null where the log has no such outcome.
  Json out{{"n", n},
           {"landing_x_mae_m", nullptr},
           {"landing_theta_mae_deg", nullptr},
           {"detach_vx_mae_m_s", nullptr},
           {"detach_omega_mae_deg_s", nullptr},
           {"trajectory_rms_m", nullptr},
           {"chi2_per_dof", nullptr}};
  for (const auto& [name, value] : errors) out[name] = number(value);
  return out;
}

Json autocorrelation_json(const std::vector<fitting::Autocorrelation>& all) {
  Json out = Json::object();
  for (const auto& a : all) out[a.channel] = {{"lag1", number(a.lag1)}, {"z", number(a.z)}};
  return out;
}

Json missing_json(const fitting::MissingAcceleration& missing) {
  Json curves = Json::object();
  for (const auto& c : missing.components)
    curves[c.name()] = {{"knots", c.at}, {"value", c.value}, {"sigma", c.sigma}};
  return {{"quantity", "acceleration [m/s^2]"},
          {"of", missing.of},
          {"against", missing.against},
          {"curves", std::move(curves)},
          {"correction", missing.helps ? "curve" : "withheld"},
          {"held_out_error",
           {{"before", number(missing.test_before)},
            {"after", number(missing.test_after)},
            {"unit", "chi2 per degree of freedom"}}}};
}

}  // namespace

Json measured_json(const MeasuredResult& result) {
  const MeasuredDiscovery& found = result.answer;
  Json out = json_head("discovery");
  out["log"] = std::filesystem::path(result.log).filename().string();
  if (const auto checksum = fitting::checksum_of(result.log)) out["log_checksum"] = *checksum;
  out["base_model"] = found.model;
  out["kind"] = found.kind;
  out["verdict"] = to_string(found.verdict);
  out["effects"] = Json::array();
  for (const auto& effect : found.effects) {
    Json one = effect_json(effect);
    for (const auto& [id, text] : found.separating)
      if (id == effect.id) one["separated_by"] = text;
    out["effects"].push_back(std::move(one));
  }
  out["unexplained"] = nullptr;
  if (found.unexplained)
    out["unexplained"] = {{"phase", found.unexplained->phase},
                          {"channel", found.unexplained->channel},
                          {"chi2_per_dof", number(found.unexplained->chi2_per_dof)},
                          {"description", found.unexplained->description}};
  if (found.unexplained && found.unexplained->correlation)
    out["unexplained"]["correlation"] = number(*found.unexplained->correlation);
  if (found.unexplained && found.unexplained->missing)
    out["unexplained"]["missing"] = missing_json(*found.unexplained->missing);
  out["error"] = {{"before",
                   {{"train", errors_json(found.before_train, found.train)},
                    {"test", errors_json(found.before_test, found.test)}}},
                  {"after",
                   {{"train", errors_json(found.after_train, found.train)},
                    {"test", errors_json(found.after_test, found.test)}}}};
  out["ranking"] = ranking_json(found.ranking);
  out["first_misfit"] = nullptr;
  if (found.first.any)
    out["first_misfit"] = {{"phase", found.phase},
                           {"channel", found.first.channel},
                           {"chi2_per_sample", number(found.first.chi2_per_dof)},
                           {"time_s", number(found.first.time)}};
  out["misfit"] = Json::array();
  for (const auto& m : found.misfit)
    out["misfit"].push_back({{"channel", m.channel},
                             {"n", m.n},
                             {"before_train", number(m.before_train)},
                             {"before_test", number(m.before_test)},
                             {"after_train", number(m.after_train)},
                             {"after_test", number(m.after_test)},
                             {"unit", result.surfaces.empty() ? "chi2 per sample" : "deg"}});
  out["autocorrelation"] = {{"before", autocorrelation_json(found.autocorrelation_before)},
                            {"after", autocorrelation_json(found.autocorrelation_after)}};
  out["evidence"] = Json::array();
  for (const auto& e : found.evidence)
    out["evidence"].push_back({{"about", e.about}, {"text", e.text}, {"speaks_against", e.against}});
  out["stability"] = Json::array();
  for (const auto& s : found.stability)
    out["stability"].push_back({{"parameter", s.parameter},
                                {"covariate", s.covariate},
                                {"split_at", number(s.split_at)},
                                {"below", {{"value", number(s.low)}, {"sigma", number(s.low_sigma)}}},
                                {"above", {{"value", number(s.high)}, {"sigma", number(s.high_sigma)}}},
                                {"apart_sigma", number(s.z())}});
  if (!result.surfaces.empty()) {
    out["surfaces"] = Json::array();
    for (const auto& e : result.surfaces)
      out["surfaces"].push_back({{"surface", e.surface},
                                 {"law", to_string(e.law)},
                                 {"slips", e.slips},
                                 {"cv_direction_error_deg", number(e.law_deg)},
                                 {"base_direction_error_deg", number(e.base_deg)},
                                 {"null_control_deg", number(e.null_law_deg)},
                                 {"null_control_base_deg", number(e.null_base_deg)},
                                 {"gain_deg", number(e.gain_deg)},
                                 {"gain_sigma_deg", number(e.gain_sigma)},
                                 {"neighbour_correlation", number(e.left)},
                                 {"neighbour_correlation_sigma", number(e.left_sigma)}});
  }
  out["skipped"] = skipped_json(found.skipped);
  out["command"] = result.command;
  return out;
}

}  // namespace unhand::apps
