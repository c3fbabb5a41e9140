#include "experiment/glitches.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamics/quantisation.hpp"
#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::experiment {
namespace {

constexpr double kNoise = 5;      // σ
constexpr std::size_t kSide = 6;  // frames that a parabola is fitted to
constexpr std::size_t kEnds = 2;  // frames, at most, of either end, where nothing comes before or follows

/// A coordinate by time, in units of its σ.
struct Coordinate {
  const std::vector<double>& times;   // [s]
  const std::vector<double>& column;  // [m or rad]
  double sigma;
  double operator()(std::size_t frame) const { return column[frame] / sigma; }
};

/// Third differences of a coordinate over some of its frames, in units of their σ.
class ThirdDifferences {
 public:
  ThirdDifferences(const Coordinate& coordinate, std::vector<std::size_t> frames)
      : coordinate_(coordinate), left_(std::move(frames)) {
    work_out();
  }

  /// Stretches of frames [first, last] by their number among those that are left: about differences that are
  /// no noise, one of them far off, with as many frames on either side as a parabola is fitted to. Between
  /// two of them are several differences that are noise.
  std::vector<std::array<std::size_t, 2>> stretches() const {
    constexpr std::size_t kQuiet = 8;
    std::vector<std::array<std::size_t, 2>> out;
    for (std::size_t k = 0; k < squares_.size(); ++k) {
      if (squares_[k] <= kNoise * kNoise) continue;
      std::size_t last = k;
      bool far = false;
      for (std::size_t next = k; next < squares_.size() && next <= last + kQuiet; ++next)
        if (squares_[next] > kNoise * kNoise) last = next, far = far || squares_[next] > kFar * kFar;
      if (far) out.push_back({k - std::min(k, kSide), std::min(last + 3 + kSide, left_.size() - 1)});
      k = last;
    }
    return out;
  }

  /// A run of frames, by number among those that are left.
  struct Run {
    std::size_t first{}, length{};
  };
  /// The run of up to `longest` frames without which the squares of differences fall most, by frame; of no
  /// length where none takes off more than noise might.
  Run worst(std::size_t longest) const {
    Run out;
    double most = kNoise * kNoise;
    for (std::size_t i = 0; i < left_.size(); ++i)
      for (std::size_t n = 1; n <= longest && i + n <= left_.size(); ++n)
        if (const double gain = gain_without(i, n) / static_cast<double>(n); gain > most)
          most = gain, out = {i, n};
    return out;
  }
  /// Takes a run out and returns its frames.
  std::vector<std::size_t> take_out(const Run& run) {
    const auto first = left_.begin() + static_cast<std::ptrdiff_t>(run.first),
               last = first + static_cast<std::ptrdiff_t>(run.length);
    const std::vector<std::size_t> out(first, last);
    left_.erase(first, last);
    work_out();
    return out;
  }
  /// Whether every difference that spans a frame's time is noise.
  bool is_smooth_about(std::size_t frame) const {
    const std::vector<double>& times = coordinate_.times;
    for (std::size_t k = 0; k < squares_.size(); ++k) {
      // At an end, the nearest ones.
      const bool spans = (k == 0 || times[left_[k]] <= times[frame]) &&
                         (k + 1 == squares_.size() || times[left_[k + 3]] >= times[frame]);
      if (spans && squares_[k] > kNoise * kNoise) return false;
    }
    return true;
  }
  std::size_t frames() const { return left_.size(); }

 private:
  static constexpr double kFar = 8;  // σ
  /// Its square, in units of σ².
  double square_of(const std::array<std::size_t, 4>& frames) const {
    std::array<double, 4> times{}, values{};
    for (std::size_t i = 0; i < 4; ++i)
      times[i] = coordinate_.times[frames[i]], values[i] = coordinate_(frames[i]);
    return dynamics::third_difference_variance(times, values);
  }
  void work_out() {
    squares_.clear();
    for (std::size_t k = 0; k + 3 < left_.size(); ++k)
      squares_.push_back(square_of({left_[k], left_[k + 1], left_[k + 2], left_[k + 3]}));
  }
  /// By how much the sum of the squares falls without n frames from i on.
  double gain_without(std::size_t i, std::size_t n) const {
    double out = 0;
    for (std::size_t k = i - std::min<std::size_t>(i, 3); k < std::min(i + n, squares_.size()); ++k)
      out += squares_[k];
    std::array<std::size_t, 6> rest{};
    std::size_t count = 0;
    for (std::size_t k = i - std::min<std::size_t>(i, 3); k < i; ++k) rest[count++] = left_[k];
    for (std::size_t k = i + n; k < std::min(i + n + 3, left_.size()); ++k) rest[count++] = left_[k];
    for (std::size_t k = 0; k + 3 < count; ++k)
      out -= square_of({rest[k], rest[k + 1], rest[k + 2], rest[k + 3]});
    return out;
  }

  Coordinate coordinate_;
  std::vector<std::size_t> left_;
  std::vector<double> squares_;
};

/// Whether a frame lies off the parabola through the frames on one side of it, by more than their noise and
/// its own. Too few for a parabola tell nothing: true.
bool is_off(const Coordinate& x, std::size_t frame, const std::vector<std::size_t>& side) {
  const auto n = static_cast<Eigen::Index>(side.size());
  if (n < 3) return true;
  const double span = std::abs(x.times[frame] - x.times[side.back()]);
  const auto row = [&](std::size_t at) {
    const double t = (x.times[at] - x.times[frame]) / span;
    return Eigen::RowVector3d(1, t, t * t);
  };
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, kSide, 3> A(n, 3);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kSide, 1> y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t at = side[static_cast<std::size_t>(i)];
    A.row(i) = row(at);
    y[i] = x(at) - x(frame);
  }
  const Eigen::LDLT<Eigen::Matrix3d> normal(A.transpose() * A);
  const Eigen::Vector3d parabola = normal.solve(A.transpose() * y), own = Eigen::Vector3d::UnitX();
  const double left = n > 3 ? (y - A * parabola).squaredNorm() / static_cast<double>(n - 3) : 0;
  const double variance = std::max(1.0, left) * (1 + own.dot(normal.solve(own)));
  return std::abs(parabola[0]) > kNoise * std::sqrt(variance);
}

/// Frames of a coordinate that were elsewhere, of those in a stretch of `frames`; `taken` are frames that are
/// under suspicion.
void find_in_stretch(const Coordinate& x, const std::vector<std::size_t>& frames,
                     const std::array<std::size_t, 2>& stretch, std::vector<bool>& taken,
                     std::vector<bool>& out) {
  constexpr std::size_t kFewest = 5, kLongestRun = 5, kMost = 100;
  const auto at = [&](std::size_t i) { return frames.begin() + static_cast<std::ptrdiff_t>(i); };
  ThirdDifferences differences(x, {at(stretch[0]), at(stretch[1] + 1)});
  const std::size_t most = std::min(1 + differences.frames() / 3, kMost);
  std::vector<std::size_t> removed;
  while (removed.size() < most && differences.frames() > kFewest) {
    const auto run = differences.worst(kLongestRun);
    if (run.length == 0) break;
    for (const std::size_t frame : differences.take_out(run)) removed.push_back(frame), taken[frame] = true;
  }
  for (const std::size_t frame : removed) {
    const auto here =
        static_cast<std::size_t>(std::lower_bound(frames.begin(), frames.end(), frame) - frames.begin());
    std::array<std::vector<std::size_t>, 2> side;  // nearest first
    std::size_t run = 1;
    for (std::size_t i = here; i-- > 0 && side[0].size() < kSide;)
      if (!taken[frames[i]])
        side[0].push_back(frames[i]);
      else if (side[0].empty())
        ++run;
    for (std::size_t i = here + 1; i < frames.size() && side[1].size() < kSide; ++i)
      if (!taken[frames[i]])
        side[1].push_back(frames[i]);
      else if (side[1].empty())
        ++run;
    const auto shortest = std::min(side[0].size(), side[1].size()),
               longest = std::max(side[0].size(), side[1].size());
    if (longest < 3 || run > (shortest < 3 ? kEnds : kLongestRun)) continue;
    if (differences.is_smooth_about(frame) && is_off(x, frame, side[0]) && is_off(x, frame, side[1]))
      out[frame] = true;
  }
}

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
    sigma.push_back(std::max(mocap.pose.sigma_of(c), scatter_of(columns[c])));
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
  constexpr std::size_t kShare = 10;  // at most a tenth goes
  const std::vector<bool> held = held_frames(columns, sigma);
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < times.size(); ++i)
    if (!held[i]) frames.push_back(i);
  std::vector<bool> out = held;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (!(sigma[c] > 0)) continue;
    const Coordinate x{times, columns[c], sigma[c]};
    std::vector<bool> taken(times.size(), false);
    for (const auto& stretch : ThirdDifferences(x, frames).stretches())
      find_in_stretch(x, frames, stretch, taken, out);
  }
  const auto elsewhere = static_cast<std::size_t>(std::count(out.begin(), out.end(), true) -
                                                  std::count(held.begin(), held.end(), true));
  return elsewhere > 1 + times.size() / kShare ? held : out;
}

std::size_t mark_glitches(datasets::ThrowLog& log) {
  std::size_t count = 0;
  if (log.dimension != 2) return 0;
  for (datasets::Throw& one : log.throws)
    if (one.hand && one.mocap) count += mark_glitches(*one.mocap);
  return count;
}

}  // namespace unhand::experiment
