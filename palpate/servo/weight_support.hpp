// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace palpate {

/// How much of a handle's weight the motors hold: from nothing to all of it over `ramp_time`, and
/// nothing at once when it may not be. Knows no clock but the ticks'. One thread. [servo]
class WeightSupport {
 public:
  static constexpr double ramp_time = 1.5;     ///< [s] slow enough to let go
  static constexpr double longest_gap = 5e-3;  ///< [s] between two ticks; over more it starts again
  static constexpr double most = 1.0;          ///< [N]

  /// @param t       [s] now
  /// @param weight  [N] of the handle
  /// @param limit   [N] that the motors may give at most
  /// @param may     a hand is there, and nothing is wrong
  /// @return [N] 0 to `weight`, no more than `most` and `limit`
  // Hazard: handle-weight
  double run(double t, double weight, double limit, bool may) noexcept {
    constexpr double longest_credit = 1e-3;  // [s] of ramp that a tick earns, however late it is
    const double since = t - last_t_;
    last_t_ = t;
    // A first tick, a stall, a clock that runs back or is no number: from the beginning.
    if (!may || !(since >= 0.0 && since <= longest_gap))
      share_ = 0.0;
    else
      share_ = std::min(1.0, share_ + std::min(since, longest_credit) / ramp_time);
    return std::max(0.0, share_ * std::min({weight, most, limit}));
  }

  /// Nothing, from this tick on.
  void release() noexcept { share_ = 0.0; }

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("support.last_t", self.last_t_);
    way("support.share", self.share_);
  }

 private:
  double last_t_ = 0.0;  // [s]
  double share_ = 0.0;   // [-]
};

}  // namespace palpate
