#include "experiment/glitches.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/third_difference.hpp"
#include "dynamics/white_noise.hpp"

namespace unhand::experiment {
namespace {

/// How far frame `member` of the four from `first` on lies off the parabola through the other three, and its
/// σ for frames of σ = 1.
struct Off {
  double size{}, sigma{};
};
Off off_parabola(const std::vector<double>& times, const std::vector<double>& column, std::size_t first,
                 std::size_t member) {
  const double* t = &times[first];
  const auto weight = dynamics::third_difference_weights({t[0], t[1], t[2], t[3]});
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += weight[i] * column[first + i], squares += weight[i] * weight[i];
  const double own = weight[member];
  return {sum / own, std::sqrt(squares) / std::abs(own)};
}

bool is_glitch(const std::vector<double>& times, const std::vector<double>& column, double sigma,
               std::size_t i) {
  constexpr double kFar = 8;
  const Off after = off_parabola(times, column, i - 1, 1), before = off_parabola(times, column, i - 2, 2);
  const double x = std::abs(after.size), y = std::abs(before.size);
  return x > kFar * after.sigma * sigma && y > kFar * before.sigma * sigma &&
         std::abs(after.size - before.size) < 0.25 * (x + y);
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

std::vector<bool> glitches(const std::vector<double>& times, std::span<const std::vector<double>> columns,
                           std::span<const double> sigma) {
  std::vector<bool> out(times.size(), false);
  for (std::size_t c = 0; c < columns.size(); ++c)
    for (std::size_t i = 2; sigma[c] > 0 && i + 2 < times.size(); ++i)
      if (is_glitch(times, columns[c], sigma[c], i)) out[i] = true;
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
