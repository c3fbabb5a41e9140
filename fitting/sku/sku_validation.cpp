#include "fitting/sku/sku_validation.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>

#include "contact/registry.hpp"
#include "experiment/compare.hpp"
#include "fitting/card.hpp"
#include "fitting/sku/sku_measured.hpp"
#include "fitting/sku/sku_scatter.hpp"

namespace unhand::fitting {

using experiment::kDegrees;

namespace {

void require(const SkuRequest& request) {
  const auto check = [](bool ok, const char* name, double value, const char* range) {
    if (!ok)
      throw std::invalid_argument(fmt::format("validate_sku: {} = {} is not in {}", name, value, range));
  };
  check(request.tolerance.x > 0 && request.tolerance.x <= 100, "tolerance x", request.tolerance.x,
        "(0, 100] m");
  check(request.tolerance.theta > 0 && request.tolerance.theta <= 1000, "tolerance theta",
        request.tolerance.theta, "(0, 1000] rad");
  check(request.confidence > 0 && request.confidence < 1, "confidence", request.confidence, "(0, 1)");
  check(request.samples >= 100 && request.samples <= 1'000'000, "samples", request.samples, "[100, 1000000]");
}

/// A plain card's scatter of the delay, as fitted cards have it.
datasets::ModelCard with_spread(datasets::ModelCard card) {
  if (const auto found = card.parameters.find("delay_sigma"); found != card.parameters.end()) {
    card.own_spreads["delay_deviation"] = {found->second.value, "s"};
    card.parameters.erase(found);
  }
  return card;
}

double scaled(const LandingSpread& s, const LandingTolerance& tolerance) {
  return std::hypot(s.x / tolerance.x, s.theta / tolerance.theta);
}

/// The one that is held, lands, and scatters least.
std::size_t best(const std::vector<ThrowCandidate>& candidates, const LandingTolerance& tolerance) {
  std::size_t out = 0;
  const auto rank = [&](const ThrowCandidate& c) {
    return c.held && c.landed ? scaled(c.linear, tolerance) : c.landed ? 1e6 : 2e6;
  };
  for (std::size_t i = 1; i < candidates.size(); ++i)
    if (rank(candidates[i]) < rank(candidates[out])) out = i;
  return out;
}

/// How the share of landings compares with what is asked, in words.
std::string share_in_words(const SkuRequest& request, const SkuValidation& answer) {
  const double within = answer.share();
  std::string out = fmt::format(
      "{:.1f} % of its landings lie within {:.3g} m and {:.3g} deg of the predicted one; "
      "asked for are {:.3g} %",
      100 * within, request.tolerance.x, request.tolerance.theta * kDegrees, 100 * request.confidence);
  if (std::abs(within - request.confidence) < 2 * answer.within_sigma)
    out += fmt::format(", which {} draws hardly tell from that (1 sigma {:.2g} %; --samples draws more)",
                       request.samples, 100 * answer.within_sigma);
  if (const auto& r = answer.repeats)
    return out +
           fmt::format(
               ". Of the same motion as it was logged {:.1f} % would, but the log's motions, repeated, bring "
               "it down {:.3g} m and {:.3g} deg apart (1 sigma of {} motions of {} {}), and in the mean "
               "{:+.3g} m and {:+.3g} deg from the predicted one, which is of the one nearest to it",
               100 * answer.within, r->x, r->theta * kDegrees, r->motions, r->conditions,
               r->conditions == 1 ? "condition" : "conditions", r->offset_x, r->offset_theta * kDegrees);
  return out +
         ", if the robot repeats its motion exactly: a log that repeats some (--log) tells how well it does";
}

/// Sets the verdict of an object that is held and lands.
void decide_by_landings(const datasets::Sku& sku, const datasets::ModelCard& card, const SkuRequest& request,
                        SkuValidation& out) {
  const bool enough = out.share() >= request.confidence;
  out.verdict = enough ? SkuVerdict::throwable : SkuVerdict::too_uncertain;
  out.message = share_in_words(request, out);
  const bool lever = !contact::follows_pads(card.model) && std::abs(sku.com_offset) > kLeastLever;
  if (lever && !(out.measured && out.measured->confirmed)) {
    out.verdict = SkuVerdict::beyond_the_model;
    out.message += fmt::format(
        ", as {} sees it, which carries the object rigidly until it is free; this one hangs {:.3g} m from "
        "the pads and turns in them as they open: a card of limit_surface_disc or sliding_pivot tells of "
        "that",
        card.model, std::abs(sku.com_offset));
  }
  if (!out.measured || out.measured->confirmed) return;
  const MeasuredVerdict& m = *out.measured;
  const std::string seen =
      fmt::format("; of {} measured throws {:.1f} % lie within", m.count(), 100 * m.within);
  if (m.rms_z > kMostSurprise || (enough && m.p_value < kTooFewToBeChance)) {
    out.verdict = SkuVerdict::contradicted;
    out.message += seen + fmt::format(", with errors {:.2g} times what was foretold", m.rms_z);
  } else if (enough) {
    out.message += seen + fmt::format(", which may be chance (p = {:.2g})", m.p_value);
  }
}

void decide(const datasets::Sku& sku, const datasets::ModelCard& card, const SkuRequest& request,
            SkuValidation& out) {
  const ThrowCandidate& c = out.reference();
  if (c.landed && c.held) return decide_by_landings(sku, card, request, out);
  out.verdict = c.landed ? SkuVerdict::cannot_be_held : SkuVerdict::does_not_land;
  out.message = c.landed ? "the grip lets the object slip before the gripper opens"
                         : "no motion that was tried brings this object to a landing";
  if (out.needed_grip_force)
    out.message += fmt::format(": this motion needs at least {:.3g} N per pad", *out.needed_grip_force);
}

}  // namespace

const char* to_string(SkuVerdict verdict) {
  constexpr const char* kNames[] = {"throwable",     "too_uncertain",    "cannot_be_held",
                                    "does_not_land", "beyond_the_model", "contradicted"};
  return kNames[static_cast<int>(verdict)];
}

SkuValidation validate_sku(const datasets::Sku& sku, const datasets::ModelCard& given,
                           const std::string& card_file, const SkuRequest& request) {
  require(request);
  if (!sku.inertia)
    throw std::invalid_argument("validate_sku: " + sku.name +
                                " has no inertia: inertia_kg_m2, or shape and dims_m, are needed");
  const auto card = with_spread(given);
  const auto landings = logged_landings(sku, card, card_file, request);
  const auto tried = motions_of(sku, card, card_file, request, landings);
  SkuValidation out;
  for (const SkuMotion& motion : tried) out.candidates.push_back(candidate_of(motion));
  out.chosen = best(out.candidates, request.tolerance);
  const SkuMotion& motion = tried[out.chosen];
  out.notes = motion.inputs.notes;
  out.untried = outside_range(card, motion.prepared);
  if (const auto surface = untried_surface(card, sku.surface); surface && request.assumed.other_surface == 0)
    out.untried.push_back(*surface);
  out.linear = out.reference().linear;
  if (out.reference().landed && !out.reference().held) out.needed_grip_force = needed_grip(motion);
  if (out.reference().landed && out.reference().held) {
    const Eigen::MatrixXd J = *motion.slopes();
    out.budget = budget_of(motion, J, request.tolerance);
    out.gains = gains_of(motion.inputs, J, request.tolerance);
    monte_carlo(motion, J, request, out);
  }
  if (request.log != nullptr) {
    const bool own = card.log.checksum && checksum_of(request.log_file) == card.log.checksum;
    if (own)
      out.notes.push_back(
          "the log is the card's own: its train throws, which the card was fitted to, do not count");
    out.measured = measured_verdict(sku, card, card_file, request, own);
  }
  if (request.log != nullptr && !out.samples.empty()) out.repeats = repeats_of(request, landings, out);
  decide(sku, card, request, out);
  return out;
}

}  // namespace unhand::fitting
