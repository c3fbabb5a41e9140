#include "datasets/summary.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "datasets/throw_log_table.hpp"
#include "dynamics/median.hpp"
#include "dynamics/third_difference.hpp"

namespace unhand::datasets {
namespace {

ChannelSummary summarise_channel(std::string_view group, const Series& time, const Flags& valid) {
  ChannelSummary out;
  out.group = group;
  out.rows = time.rows;
  out.start = time.data.front();
  out.end = time.data.back();
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.rows; ++i) {
    const double step = time(i) - time(i - 1);
    steps.push_back(step);
    if (step > out.longest_gap) {
      out.longest_gap = step;
      out.gap_at = time(i - 1);
    }
  }
  if (!steps.empty()) {
    out.median_step = dynamics::median(steps);
    out.rate = 1 / out.median_step;
  }
  std::size_t run = 0;
  for (const std::uint8_t flag_value : valid) {
    run = flag_value == 0 ? run + 1 : 0;
    out.lost += flag_value == 0;
    out.longest_loss = std::max(out.longest_loss, run);
  }
  return out;
}

ThrowSummary summarise_throw(Throw& toss) {
  ThrowSummary out{toss.id, toss.object, toss.condition, toss.split, toss.landing.has_value(), {}};
  for (const Channel<Throw>& channel : throw_channels) {
    if (channel.kind != ChannelKind::time || channel.single) continue;
    const Slot slot = channel.slot(toss, false);
    if (std::holds_alternative<std::monostate>(slot)) continue;
    const bool tracked = channel.group == "mocap";
    out.channels.push_back(
        summarise_channel(channel.group, *std::get<Series*>(slot), tracked ? toss.mocap->valid : Flags{}));
  }
  return out;
}

void add(std::vector<GroupSummary>& groups, const ChannelSummary& channel, const std::string& id) {
  auto group =
      std::find_if(groups.begin(), groups.end(), [&](const auto& g) { return g.group == channel.group; });
  if (group == groups.end()) {
    group = groups.insert(group, {channel.group, 0, 0, 0, channel.rate, channel.rate, 0, ""});
  }
  group->throws += 1;
  group->rows += channel.rows;
  group->lost += channel.lost;
  group->lowest_rate = std::min(group->lowest_rate, channel.rate);
  group->highest_rate = std::max(group->highest_rate, channel.rate);
  const double ratio = channel.median_step > 0 ? channel.longest_gap / channel.median_step : 0;
  if (ratio > group->worst_gap_ratio) {
    group->worst_gap_ratio = ratio;
    group->worst_gap_throw = id;
  }
}

void add(NoiseSummary& noise, const Series& series) {
  noise.throws += 1;
  if (series.sigma.empty()) return;
  noise.declared += 1;
  noise.zero += std::ranges::count(series.sigma, 0.0) > 0;
  if (noise.lowest.empty()) noise.lowest = noise.highest = series.sigma;
  const std::size_t n = std::min(noise.lowest.size(), series.sigma.size());
  for (std::size_t j = 0; j < n; ++j) {
    noise.lowest[j] = std::min(noise.lowest[j], series.sigma[j]);
    noise.highest[j] = std::max(noise.highest[j], series.sigma[j]);
  }
}

/// The scatter of one column: what four samples in a row show of it beside what every other one of the seven
/// about them shows, where a motion counts 64 times as much.
class Scatter {
 public:
  void add(const Series& time, const Series& values, std::size_t column, const std::vector<std::size_t>& rows,
           double unit) {
    const auto square = [&](std::size_t first, std::size_t stride) {
      std::array<double, 4> t{}, x{};
      for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t row = rows[first + i * stride];
        t[i] = time(row), x[i] = values(row, column) / unit;
      }
      return dynamics::third_difference_variance(t, x);
    };
    for (std::size_t k = 0; k + 3 < rows.size(); ++k) {
      once_.push_back(square(k, 1));
      twice_.push_back(k >= 1 && k + 5 < rows.size() ? square(k - 1, 2) : -1);
    }
  }
  struct Seen {
    double once{}, twice{};  ///< variances [unit²]
    double n{};              ///< pairs that they are of
    double sigma() const { return std::sqrt(std::max(0.0, (64 * once - twice) / 63)); }
    /// Whether the noise is most of it also over doubled steps.
    bool is_noise() const { return twice <= 4 * once; }
    /// Of sigma, relative, for white noise.
    double standard_error() const { return 1.07 / std::sqrt(n); }
  };
  /// Pairs that a glitch or a jump makes large, one of them or both, are left out. Of less than seven
  /// samples, where there are no pairs, all is noise.
  Seen seen() const {
    Seen out;
    std::vector<double> of_pairs;
    for (const double twice : twice_)
      if (twice >= 0) of_pairs.push_back(twice);
    const double most_once = 25 * dynamics::median(once_), most_twice = 25 * dynamics::median(of_pairs);
    for (std::size_t k = 0; k < once_.size(); ++k) {
      const double twice = of_pairs.empty() ? once_[k] : twice_[k];
      if (twice < 0 || once_[k] > most_once || (!of_pairs.empty() && twice > most_twice)) continue;
      out.once += once_[k], out.twice += twice, out.n += 1;
    }
    if (out.n > 0) out.once /= out.n, out.twice /= out.n;
    return out;
  }

 private:
  std::vector<double> once_, twice_;  // of the same samples; below zero where there are not seven
};

const Series& time_of(Throw& toss, std::string_view group) {
  const auto time = std::ranges::find_if(
      throw_channels, [&](const auto& c) { return c.group == group && c.kind == ChannelKind::time; });
  return *std::get<Series*>(time->slot(toss, false));
}

/// The channel's samples in a throw; null where it has none.
const Series* recorded(const Channel<Throw>& channel, Throw& toss) {
  const Slot slot = channel.slot(toss, false);
  const Series* const* series = std::get_if<Series*>(&slot);
  return series != nullptr && !(*series)->empty() ? *series : nullptr;
}

void add_scatter(NoiseSummary& noise, const Channel<Throw>& channel, std::vector<Throw>& throws) {
  std::vector<Scatter> all, whitened;
  for (Throw& toss : throws) {
    const Series* const series = recorded(channel, toss);
    if (series == nullptr) continue;
    const Series& values = *series;
    std::vector<std::size_t> rows;
    const bool falls = channel.group == "imu" && toss.free_flight && !toss.mocap;
    for (std::size_t i = 0; i < values.rows; ++i) {
      if (channel.group == "mocap" && !toss.mocap->is_valid(i)) continue;
      if (const double t = falls ? toss.imu->time(i) : 0;
          falls && !(t >= toss.free_flight->first && t <= toss.free_flight->second))
        continue;
      rows.push_back(i);
    }
    all.resize(std::max(all.size(), values.cols));
    whitened.resize(all.size());
    for (std::size_t j = 0; j < values.cols; ++j) {
      all[j].add(time_of(toss, channel.group), values, j, rows, 1);
      if (const double sigma = values.sigma_of(j); sigma > 0)
        whitened[j].add(time_of(toss, channel.group), values, j, rows, sigma);
    }
  }
  constexpr double kSure = 3;
  for (std::size_t j = 0; j < all.size(); ++j) {
    const Scatter::Seen seen = whitened[j].seen();
    noise.scatter.push_back(all[j].seen().sigma());
    noise.ratio.push_back(seen.sigma());
    noise.too_small.push_back(seen.is_noise() && seen.sigma() > NoiseSummary::kMore &&
                              seen.sigma() > 1 + kSure * seen.standard_error());
  }
}

std::vector<std::string> parts_of(std::string_view list) {
  std::vector<std::string> out;
  while (!list.empty()) out.emplace_back(next_part(list));
  return out;
}

}  // namespace

std::string held_by(const ThrowLog& log, const Throw& toss) {
  if (toss.hand || toss.free_flight || !toss.mocap) return "";
  const MocapLog& mocap = *toss.mocap;
  std::size_t first = 0;
  while (first < mocap.time.rows && !mocap.is_valid(first)) ++first;
  if (first == mocap.time.rows) return "";
  const double seen = mocap.time(first);
  if (toss.detach_time) return *toss.detach_time > seen ? "a detach_time" : "";
  if (toss.ft) return "an ft";
  if (log.gripper && log.gripper->opening_command_time && *log.gripper->opening_command_time >= seen)
    return "an opening_command_time";
  return "";
}

LogSummary summarise(const ThrowLog& log) {
  validate(log);
  LogSummary out;
  out.dimension = log.dimension;
  out.title = log.title;
  out.source = log.source;
  out.licence = log.licence.value_or("");
  out.gravity = log.gravity;
  out.landing_height = log.landing_height;
  out.throws = log.throws.size();
  for (const auto& [name, object] : log.objects) out.objects.push_back(name);
  std::vector<Throw> throws = log.throws;
  for (Throw& toss : throws) {
    ++(toss.split == Split::train ? out.train : out.test);
    ++out.conditions[toss.condition];
    out.free_flights += !toss.hand && held_by(log, toss).empty();
    out.each.push_back(summarise_throw(toss));
    for (ChannelSummary& channel : out.each.back().channels)
      for (double* const time : {&channel.start, &channel.end, &channel.gap_at}) *time += log.clock_origin;
    for (const ChannelSummary& channel : out.each.back().channels) add(out.groups, channel, toss.id);
  }
  for (const Channel<Throw>& channel : throw_channels) {
    if (channel.kind == ChannelKind::flag) continue;
    NoiseSummary noise;
    noise.dataset = std::string(channel.group) + "/" + std::string(channel.name);
    std::size_t widest = 0;
    for (Throw& toss : throws) {
      const Series* const series = recorded(channel, toss);
      if (series == nullptr) continue;
      add(noise, *series);
      widest = std::max(widest, series->cols);
    }
    if (const ColumnLayout* layout = layout_of_width(channel.layouts(log.dimension), widest))
      noise.columns = layout->columns, noise.units = layout->units;
    if (channel.kind != ChannelKind::time && !channel.single) add_scatter(noise, channel, throws);
    if (noise.throws > 0) out.noise.push_back(std::move(noise));
  }
  return out;
}

std::string NoiseSummary::understated() const {
  const auto names = parts_of(columns);
  std::string out;
  for (std::size_t j = 0; j < too_small.size(); ++j)
    if (too_small[j])
      out += fmt::format("{}{} {:.2g} times", out.empty() ? "" : ", ",
                         names.size() == ratio.size() ? names[j] : fmt::format("column {}", j), ratio[j]);
  return out;
}

std::string to_json(const LogSummary& summary) {
  using nlohmann::ordered_json;
  ordered_json out{{"schema", "inspect"},
                   {"schema_version", 1},
                   {"title", summary.title},
                   {"source", summary.source},
                   {"licence", summary.licence},
                   {"dimension", summary.dimension},
                   {"gravity_m_s2", summary.gravity},
                   {"landing_height_m", summary.landing_height},
                   {"throws", summary.throws},
                   {"train", summary.train},
                   {"test", summary.test},
                   {"free_flights", summary.free_flights},
                   {"objects", summary.objects},
                   {"conditions", summary.conditions}};
  ordered_json& groups = out["groups"] = ordered_json::object();
  for (const GroupSummary& g : summary.groups) {
    groups[g.group] = {{"throws", g.throws},
                       {"samples", g.rows},
                       {"lost", g.lost},
                       {"lowest_rate_hz", g.lowest_rate},
                       {"highest_rate_hz", g.highest_rate},
                       {"worst_gap_over_median_step", g.worst_gap_ratio},
                       {"worst_gap_throw", g.worst_gap_throw}};
  }
  ordered_json& datasets = out["datasets"] = ordered_json::object();
  for (const NoiseSummary& n : summary.noise)
    datasets[n.dataset] = {
        {"columns", parts_of(n.columns)}, {"units", parts_of(n.units)}, {"throws", n.throws}};
  ordered_json& noise = out["noise"] = ordered_json::object();
  for (const NoiseSummary& n : summary.noise) {
    noise[n.dataset] = {{"throws", n.throws},
                        {"declared", n.declared},
                        {"lowest", n.lowest},
                        {"highest", n.highest},
                        {"declared_zero", n.zero},
                        {"scatter", n.scatter},
                        {"scatter_over_declared", n.ratio},
                        {"declared_too_small", n.too_small}};
  }
  ordered_json& each = out["each"] = ordered_json::array();
  for (const ThrowSummary& toss : summary.each) {
    ordered_json channels = ordered_json::object();
    for (const ChannelSummary& c : toss.channels) {
      channels[c.group] = {{"samples", c.rows},
                           {"start_s", c.start},
                           {"end_s", c.end},
                           {"rate_hz", c.rate},
                           {"longest_gap_s", c.longest_gap},
                           {"gap_at_s", c.gap_at},
                           {"lost", c.lost},
                           {"longest_loss", c.longest_loss}};
    }
    each.push_back({{"id", toss.id},
                    {"object", toss.object},
                    {"condition", toss.condition},
                    {"split", to_string(toss.split)},
                    {"landing", toss.landing},
                    {"channels", channels}});
  }
  return out.dump(1) + "\n";
}

}  // namespace unhand::datasets
