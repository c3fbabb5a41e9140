#include "experiment/glitches.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "dynamics/quantisation.hpp"
#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::experiment {
namespace {

/// The third differences of one coordinate over the frames that are left, in units of their σ.
class ThirdDifferences {
 public:
  /// Over the frames that are not `out`.
  ThirdDifferences(const std::vector<double>& times, const std::vector<double>& column, double sigma,
                   const std::vector<bool>& out)
      : times_(times), column_(column), sigma_(sigma) {
    for (std::size_t i = 0; i < times.size(); ++i)
      if (!out[i]) left_.push_back(i);
    work_out();
  }

  /// The frame that has most of a share in differences, where one is far off, or no noise over a gap that a
  /// frame has left.
  std::optional<std::size_t> worst() const {
    std::vector<double> toward(left_.size(), 0.0), squares(left_.size(), 0.0);
    bool any = false;
    for (std::size_t k = 0; k < all_.size(); ++k) {
      const bool over_a_gap = left_[k + 3] - left_[k] > 3;
      any = any || std::abs(all_[k].size) > (over_a_gap ? kNoise : kFar);
      for (std::size_t i = 0; i < 4; ++i) {
        toward[k + i] += all_[k].weight[i] * all_[k].size;
        squares[k + i] += all_[k].weight[i] * all_[k].weight[i];
      }
    }
    if (!any) return std::nullopt;
    std::size_t out = 0;
    double most = 0;
    for (std::size_t i = 0; i < left_.size(); ++i)
      if (const double explains = toward[i] * toward[i] / squares[i]; explains > most)
        most = explains, out = left_[i];
    return out;
  }
  void remove(std::size_t frame) {
    std::erase(left_, frame);
    work_out();
  }
  /// Whether every difference that spans a frame's time is noise.
  bool is_smooth_about(std::size_t frame) const {
    for (std::size_t k = 0; k < all_.size(); ++k) {
      // At an end, the nearest ones.
      const bool spans = (k == 0 || times_[left_[k]] <= times_[frame]) &&
                         (k + 1 == all_.size() || times_[left_[k + 3]] >= times_[frame]);
      if (spans && std::abs(all_[k].size) > kNoise) return false;
    }
    return true;
  }
  std::size_t frames() const { return left_.size(); }

 private:
  static constexpr double kFar = 8, kNoise = 5;  // σ
  struct Difference {
    std::array<double, 4> weight{};  // of its frames, for σ = 1
    double size{};                   // [σ]
  };

  void work_out() {
    all_.clear();
    for (std::size_t k = 0; k + 3 < left_.size(); ++k) {
      const auto at = [&](std::size_t i) { return times_[left_[k + i]]; };
      Difference one{dynamics::third_difference_weights({at(0), at(1), at(2), at(3)}), 0};
      double squares = 0;
      for (const double w : one.weight) squares += w * w;
      for (std::size_t i = 0; i < 4; ++i) {
        one.weight[i] /= std::sqrt(squares);
        one.size += one.weight[i] * column_[left_[k + i]] / sigma_;
      }
      all_.push_back(one);
    }
  }

  const std::vector<double>&times_, &column_;
  double sigma_;
  std::vector<std::size_t> left_;
  std::vector<Difference> all_;
};

/// 1 σ by frame, of what differs from frame to frame; 0 of too few.
double scatter_of(const std::vector<double>& column) {
  std::vector<double> squares;
  for (std::size_t i = 3; i < column.size(); ++i)
    squares.push_back(
        dynamics::third_difference_variance(column[i - 3], column[i - 2], column[i - 1], column[i]));
  return dynamics::typical_rms(squares);
}

std::size_t mark_glitches(datasets::MocapLog& mocap) {
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < mocap.time.rows; ++i)
    if (mocap.is_valid(i)) frames.push_back(i);
  if (frames.size() < 5) return 0;
  std::vector<double> times, sigma;
  std::vector<std::vector<double>> columns(mocap.pose.cols);
  for (const std::size_t i : frames) {
    times.push_back(mocap.time(i));
    for (std::size_t c = 0; c < columns.size(); ++c) columns[c].push_back(mocap.pose(i, c));
  }
  for (std::size_t c = 0; c < columns.size(); ++c)
    sigma.push_back(std::max(c < mocap.pose.sigma.size() ? mocap.pose.sigma[c] : 0, scatter_of(columns[c])));
  const auto off = glitches(times, columns, sigma);
  const auto count = static_cast<std::size_t>(std::count(off.begin(), off.end(), true));
  if (count == 0) return 0;
  if (mocap.valid.empty()) mocap.valid.assign(mocap.time.rows, 1);
  for (std::size_t k = 0; k < frames.size(); ++k)
    if (off[k]) mocap.valid[frames[k]] = 0;
  return count;
}

}  // namespace

std::vector<bool> held_frames(std::span<const std::vector<double>> columns, std::span<const double> sigma) {
  constexpr double kSigmas = 4, kSteps = 3;
  constexpr std::size_t kEnds = 2;  // frames, at most, where no motion comes before or follows
  const std::size_t n = columns.front().size();
  std::vector<bool> out(n, false);
  std::vector<double> least;  // what is a motion, by column
  const auto repeats = [&](std::size_t i) {
    return std::all_of(columns.begin(), columns.end(), [i](const auto& x) { return x[i] == x[i - 1]; });
  };
  for (std::size_t i = 1; i < n; ++i) {
    if (!repeats(i)) continue;
    std::size_t next = i + 1;
    while (next < n && repeats(next)) ++next;
    const bool to_the_end = next == n;
    if ((to_the_end || i < 2) && next - i > kEnds) {  // at rest
      i = next;
      continue;
    }
    if (least.empty())
      for (std::size_t c = 0; c < columns.size(); ++c)
        least.push_back(std::max(kSigmas * sigma[c], kSteps * dynamics::quantisation_step(columns[c])));
    bool moves = false;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const auto& x = columns[c];
      const bool came = i < 2 || std::abs(x[i - 1] - x[i - 2]) > least[c],
                 went = to_the_end || std::abs(x[next] - x[i]) > least[c];
      moves = moves || (came && went && !(i < 2 && to_the_end));
    }
    for (std::size_t k = i; moves && k < next; ++k) out[k] = true;
    i = next;
  }
  return out;
}

std::vector<bool> glitches(const std::vector<double>& times, std::span<const std::vector<double>> columns,
                           std::span<const double> sigma) {
  constexpr std::size_t kFewest = 5, kShare = 10;  // frames that stay; at most a tenth goes
  const std::vector<bool> held = held_frames(columns, sigma);
  std::vector<bool> out = held;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (!(sigma[c] > 0)) continue;
    ThirdDifferences differences(times, columns[c], sigma[c], held);
    std::vector<std::size_t> removed;
    while (removed.size() < 1 + times.size() / kShare && differences.frames() > kFewest) {
      const auto frame = differences.worst();
      if (!frame) break;
      differences.remove(*frame);
      removed.push_back(*frame);
    }
    for (const std::size_t frame : removed)
      if (differences.is_smooth_about(frame)) out[frame] = true;
  }
  return out;
}

std::size_t mark_glitches(datasets::ThrowLog& log) {
  std::size_t count = 0;
  if (log.dimension != 2) return 0;
  for (datasets::Throw& one : log.throws)
    if (one.hand && one.mocap) count += mark_glitches(*one.mocap);
  return count;
}

}  // namespace unhand::experiment
