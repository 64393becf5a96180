// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/tick.hpp"

#include <array>

namespace palpate {
namespace {

constexpr std::array<FlagInfo, tick_flag_count> flag_table{{
    {"step_budget_hit",
     "the proxy has not converged and continues in the next tick; raise step_budget"},
    {"patch_thinned", "more points were nearby than a patch can store; move the camera away"},
    {"force_saturated", "the coupling requested more than max_force; lower the stiffness"},
    {"non_finite_input", "the HIP position or the time is not finite"},
    {"no_frame", "there is no frame to touch yet"},
    {"stamp_not_increasing", "a camera's clock stood still or ran backwards"},
    {"frame_stale", "the newest frame is older than max_extrapolation"},
    {"normal_undefined", "the points' directions cancel out; the last normal was used"},
    {"surface_hidden", "the surface is occluded: the last estimate is used"},
    {"pop_through_suspected", "the proxy was found behind the surface that the camera sees"},
    {"free_space_released", "the camera sees free space around the HIP: the force was set to zero"},
    {"proxy_let_go", "the proxy was too far from the HIP for a contact and was reset to it"},
    {"returned_to_front", "the proxy was behind the surface and was brought back in front of it"},
}};

}  // namespace

std::span<const FlagInfo> tick_flag_table() { return flag_table; }

std::vector<FlagInfo> flags_in(std::uint32_t bits, std::span<const FlagInfo> table) {
  std::vector<FlagInfo> set;
  for (std::size_t i = 0; i < table.size(); ++i) {
    if ((bits >> i & 1U) != 0) set.push_back(table[i]);
  }
  return set;
}

const char* to_string(ContactState state) noexcept {
  switch (state) {
    case ContactState::free_motion:
      return "free";
    case ContactState::contact:
      return "contact";
    case ContactState::entrenchment:
      return "entrenchment";
  }
  return "unknown";
}

bool is_place(const Vec3& p) noexcept {
  constexpr double farthest = 1e6;  // [m]
  return p.allFinite() && p.cwiseAbs().maxCoeff() <= farthest;
}

Tick free_tick(const Vec3& hip, double t, std::int64_t frame) noexcept {
  Tick tick;
  tick.t = t;
  tick.hip = hip;
  tick.proxy = hip;
  tick.frame = frame;
  return tick;
}

}  // namespace palpate
