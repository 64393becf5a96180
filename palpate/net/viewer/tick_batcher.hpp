// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/net/viewer/protocol.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// Makes of the servo's ticks what pages are sent: the newest, and the extremes of a few at a time.
class TickBatcher {
 public:
  /// @param ticks_per_sample  at least 1
  explicit TickBatcher(unsigned ticks_per_sample) : ticks_per_sample_(ticks_per_sample) {}

  /// @param contact_radius  [m] r_c: the surface is that far below the proxy
  void add(const ServoTick& record, double contact_radius);
  /// What was added since the last call; none if nothing was. Ticks that do not make a whole sample
  /// yet are part of the next batch's samples.
  std::optional<TickBatch> take();

 private:
  unsigned ticks_per_sample_;
  unsigned pending_ = 0;
  TickSample sample_;
  TickBatch batch_;
  bool any_ = false;
};

}  // namespace palpate
