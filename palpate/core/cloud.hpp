// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/core/patch.hpp"

namespace palpate {

/// Whatever can be touched: it can gather the points near a place into a patch.
///
/// Clouds are immutable once built, hence safe to read from any thread.
class Cloud {
 public:
  virtual ~Cloud() = default;

  /// Opens a view in `patch` and adds every point with |point - ball.centre| <= ball.radius.
  ///
  /// [servo] Bounded work, no allocation, no lock, no exception. If the ball holds more than
  /// `max_points`, an evenly thinned part of them is added and the patch is marked thinned.
  /// `patch.ball()` must be `ball`, or a ball about the same centre.
  virtual void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept = 0;
};

/// Empties `patch` and fills it with the points of `cloud` in `ball`. [servo]
inline void gather(const Cloud& cloud, const Ball& ball, Patch& patch) noexcept {
  patch.start(ball);
  cloud.gather(ball, Patch::capacity, patch);
}

}  // namespace palpate
