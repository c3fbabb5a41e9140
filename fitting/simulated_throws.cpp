#include "fitting/simulated_throws.hpp"

#include <utility>

#include "dynamics/parallel.hpp"

namespace unhand::fitting {

const std::vector<Linearisation>& SimulatedThrows::at(const std::vector<double>& campaign,
                                                      const std::vector<double>& own, bool derivatives) {
  const auto serves = [&](const Point& point) {
    return !point.throws.empty() && point.campaign == campaign && point.own == own &&
           (point.derivatives || !derivatives);
  };
  if (serves(last_)) return last_.throws;
  std::swap(last_, before_);
  if (serves(last_)) return last_.throws;
  last_.campaign = campaign;
  last_.own = own;
  last_.derivatives = derivatives;
  last_.throws.resize(used_.size());
  const auto values = shared_.unscaled(campaign.data());
  const std::size_t width = shared_.own_scale.size();
  const auto asked = !derivatives                ? DerivativesBy::nothing
                     : shared_.options.all_fixed ? DerivativesBy::own
                                                 : DerivativesBy::all;
  dynamics::parallel_for(used_.size(), shared_.options.threads, [&](std::size_t i) {
    const auto begin = Clock::now();
    last_.throws[i] = shared_.problem.linearise(shared_.problem.throws()[used_[i]], values,
                                                shared_.own_unscaled(own.data() + i * width), asked);
    if (derivatives) shared_.jacobian_nanoseconds += static_cast<long>(1e9 * seconds_since(begin));
  });
  return last_.throws;
}

}  // namespace unhand::fitting
