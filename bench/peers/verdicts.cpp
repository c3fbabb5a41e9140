#include "bench/peers/verdicts.hpp"

#include <fmt/core.h>

#include <utility>

namespace unhand::bench {
namespace {

double told(const Work& w) { return std::max(w.error, kExact); }

/// unhand beside one run of another engine.
Verdict judge(const Work& theirs, const std::vector<Work>& all) {
  Verdict v{theirs, 0, 0, {}, {}};
  for (const Work& w : all) {
    if (w.truth != theirs.truth || w.engine != "unhand") continue;
    if (w.seconds <= theirs.seconds && (!v.in_time || w.error < v.in_time->error)) v.in_time = w;
    if (w.error <= told(theirs) && (!v.for_error || w.seconds < v.for_error->seconds)) v.for_error = w;
  }
  return v;
}

}  // namespace

double Verdict::more_accurate() const { return in_time ? told(best) / told(*in_time) : 0; }

double Verdict::faster() const { return for_error ? best.seconds / for_error->seconds : 0; }

std::string Verdict::accuracy_words() const {
  if (!in_time) return "-";
  return both_exact() ? "both exact" : fmt::format("{:.0e}", more_accurate());
}

std::string Verdict::speed_words() const {
  if (!for_error) return "-";
  return faster() < 10 ? fmt::format("{:.2g}", faster()) : fmt::format("{:.0f}", faster());
}

std::vector<Work> run_all() {
  std::vector<Work> all;
  for (const auto& part : {run_unhand(), run_bullet(), run_mujoco(), run_siconos()})
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

std::vector<Verdict> verdicts(const std::vector<Work>& all) {
  std::vector<Verdict> out;
  for (const auto& motion : kMotions)
    for (const std::string engine : {"MuJoCo", "Bullet", "Siconos", "Siconos in step"}) {
      const Work* best = nullptr;
      int settings = 0, met = 0;
      for (const Work& w : all) {
        if (w.truth != motion || w.engine != engine) continue;
        ++settings, met += judge(w, all).goal() ? 1 : 0;
        if (!best || std::pair(told(w), w.seconds) < std::pair(told(*best), best->seconds)) best = &w;
      }
      if (!best) continue;
      out.push_back(judge(*best, all));
      out.back().settings = settings, out.back().met = met;
    }
  return out;
}

}  // namespace unhand::bench
