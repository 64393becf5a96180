// SPDX-License-Identifier: Apache-2.0
#include "palpate/teleop/lead.hpp"

namespace palpate {

Lead lead_of(const ServoTick& tick) noexcept {
  constexpr std::uint32_t blind = frame_lost | fault_latched | output_refused;
  constexpr std::uint32_t away = hand_clutched | hand_fault;
  Lead lead{.place = tick.place, .press = -tick.force};
  lead.leads = (tick.hand & hand_present) != 0 && (tick.hand & away) == 0 &&
               (tick.safety & blind) == 0 && is_place(lead.place) && lead.press.allFinite();
  return lead;
}

}  // namespace palpate
