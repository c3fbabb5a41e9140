#include "fitting/discovery/order_trend.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "fitting/distributions.hpp"

namespace unhand::fitting {

OrderTrend order_trend(const std::vector<Placed>& values) {
  struct Sums {
    double n{}, x{}, y{}, xx{}, xy{}, yy{};
  };
  std::map<int, Sums> conditions;
  for (const auto& [condition, x, y] : values) {
    Sums& s = conditions[condition];
    s.n += 1, s.x += x, s.y += y, s.xx += x * x, s.xy += x * y, s.yy += y * y;
  }
  double n = -1, xx = 0, xy = 0, yy = 0;
  for (const auto& [condition, s] : conditions) {
    n += s.n - 1;
    xx += s.xx - s.x * s.x / s.n, xy += s.xy - s.x * s.y / s.n, yy += s.yy - s.y * s.y / s.n;
  }
  OrderTrend out;
  if (n < 1 || !(xx > 0) || !(yy > 0)) return out;
  out.slope = xy / xx;
  out.correlation = xy / std::sqrt(xx * yy);
  out.explained = std::max(0.0, xy * xy / xx - (yy - xy * xy / xx) / n);
  const double share = std::min(out.correlation * out.correlation, 1 - 1e-12);
  out.p_value = f_tail(share * n / (1 - share), 1, n);
  out.ratio = 1 / (1 - share);
  return out;
}

}  // namespace unhand::fitting
