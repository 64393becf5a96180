// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include "palpate/servo/safety.hpp"

namespace palpate {

/// The safety chain's limits for frames from a network. The network latency alone does not fade the
/// force: a frame fades once it is `fade_age` older than the typical age on arrival, and is lost
/// 0.3 s later. @param latency [s] typical time from capture to arrival; at most 1 s counts
inline SafetyParameters for_link(SafetyParameters safety, double latency) noexcept {
  constexpr double longest = 1.0;    // [s] nobody leads a robot by older images
  constexpr double fade_time = 0.3;  // [s]
  if (latency > 0.0) safety.fade_age += std::min(latency, longest);
  safety.lost_age = safety.fade_age + fade_time;
  return safety;
}

}  // namespace palpate
