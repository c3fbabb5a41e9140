#include "fitting/measured/rest_heights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flight/quaternion.hpp"

namespace unhand::fitting {
namespace {

constexpr std::size_t kStillSamples = 6;
constexpr double kStill = 5e-4;   // [m] that a box at rest may seem to move
constexpr double kLevel = 0.995;  // cosine between a face's normal and the vertical

struct Rest {
  double height{};
  std::size_t axis{};
  int up{};      // sign of the body axis that points up
  bool level{};  // it does
};

std::optional<Rest> rest_of(const datasets::Throw& one) {
  if (!one.mocap || one.mocap->pose.cols != 7) return {};
  const datasets::MocapLog& mocap = *one.mocap;
  if (one.free_flight && mocap.time.rows > 0 && !(one.free_flight->second < mocap.time(mocap.time.rows - 1)))
    return {};  // nothing was recorded after the flight
  std::vector<std::size_t> last;
  for (std::size_t i = mocap.time.rows; i-- > 0 && last.size() < kStillSamples;)
    if (mocap.is_valid(i)) last.push_back(i);
  if (last.size() < kStillSamples) return {};
  Rest out;
  for (const std::size_t i : last) {
    for (std::size_t j = 0; j < 3; ++j)
      if (std::abs(mocap.pose(i, j) - mocap.pose(last.front(), j)) > kStill) return {};
    out.height += mocap.pose(i, 2) / static_cast<double>(kStillSamples);
  }
  const std::size_t i = last.front();
  const auto q = flight::normalised(
      flight::Quaternion<double>{mocap.pose(i, 3), mocap.pose(i, 4), mocap.pose(i, 5), mocap.pose(i, 6)});
  const auto up = flight::rotate(flight::conjugate(q), flight::Vec3<double>{0, 0, 1});
  for (std::size_t a = 1; a < 3; ++a)
    if (std::abs(up[a]) > std::abs(up[out.axis])) out.axis = a;
  out.level = std::abs(up[out.axis]) >= kLevel;
  out.up = up[out.axis] > 0 ? 1 : -1;
  return out;
}

struct Mean {
  double n{}, sum{}, squares{};
  void add(double x) { n += 1, sum += x, squares += x * x; }
  double mean() const { return sum / n; }
  double error() const {
    return n > 1 ? std::sqrt(std::max(0.0, squares / n - mean() * mean()) / (n - 1)) : 0;
  }
};

}  // namespace

std::optional<RestHeights> rest_heights(const datasets::ThrowLog& log, const std::string& object,
                                        double floor) {
  const auto found = log.objects.find(object);
  if (log.dimension != 3 || found == log.objects.end() || !found->second.dims) return {};
  const auto& dims = *found->second.dims;
  std::array<std::array<Mean, 2>, 3> heights;
  RestHeights out;
  for (const auto& one : log.throws) {
    if (one.object != object) continue;
    const auto rest = rest_of(one);
    if (!rest || !rest->level) continue;
    heights[rest->axis][rest->up > 0 ? 1 : 0].add(rest->height - floor);
    ++out.n;
  }
  Mean scales, above;
  double within = 0;
  for (std::size_t a = 0; a < 3; ++a) {
    const Mean &down = heights[a][0], &up = heights[a][1];
    if (!(down.n > 1 && up.n > 1) || !(dims[a] > 0)) continue;
    const double middle = 0.5 * (up.mean() + down.mean());
    scales.add(2 * middle / dims[a] - 1);
    above.add(middle - 0.5 * dims[a]);
    within = std::max(within, std::hypot(up.error(), down.error()) / dims[a]);
    out.offset[a] = 0.5 * (up.mean() - down.mean());
    out.offset_sigma[a] = 0.5 * std::hypot(up.error(), down.error());
  }
  if (out.n < 5 || !(scales.n > 0)) return {};
  out.scale = scales.mean();
  out.above = above.mean();
  out.sigma = std::max(scales.error(), within);
  return out;
}

bool RestsOnFaces::is_doubtful() const {
  constexpr int kFewest = 10;
  return still >= kFewest && 2 * on_face < still;
}

std::string RestsOnFaces::in_words() const {
  return fmt::format(
      "{} throws of boxes end still, and {} of them on a face: are the quaternions (w, x, y, z), "
      "from the body to the world?",
      still, on_face);
}

RestsOnFaces rests_on_faces(const datasets::ThrowLog& log) {
  RestsOnFaces out;
  if (log.dimension != 3) return out;
  for (const auto& one : log.throws) {
    if (!log.objects.at(one.object).dims) continue;
    if (const auto rest = rest_of(one)) ++out.still, out.on_face += rest->level ? 1 : 0;
  }
  return out;
}

}  // namespace unhand::fitting
