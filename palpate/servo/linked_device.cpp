// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/linked_device.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {

bool is_in_trouble(const CycleStatistics& hand, double t, double silence) noexcept {
  // A late tick of another hand ramps that hand's force; only if it stays away is it trouble.
  constexpr std::uint32_t refusals =
      input_refused | direction_refused | hand_too_fast | fault_latched | output_refused;
  const DeviceFault fault = fault_of(hand.hand.load(std::memory_order_relaxed));
  if (fault != DeviceFault::none && fault != DeviceFault::another_hand) return true;
  if ((hand.safety.load(std::memory_order_relaxed) & refusals) != 0) return true;
  if (!std::isfinite(silence)) return false;
  return hand.ticks.load(std::memory_order_relaxed) == 0 ||
         t - hand.last_t.load(std::memory_order_relaxed) > silence;
}

// Hazard: another-hand
HandState LinkedDevice::read(double t) noexcept {
  HandState hand = device_->read(t);
  if (hand.fault == DeviceFault::none &&
      std::any_of(others_.begin(), others_.end(),
                  [&](const auto& other) { return is_in_trouble(*other, t, silence_); }))
    hand.fault = DeviceFault::another_hand;
  return hand;
}

}  // namespace palpate
