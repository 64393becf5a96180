// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/hand.hpp"

namespace palpate {

/// Where the proxy stands with respect to the points. Section 4.1.
enum class ContactState {
  free_motion,   ///< no point within r_2
  contact,       ///< points between r_1 and r_2, none within r_1
  entrenchment,  ///< points within r_1
};

/// The field's word for a state, as in the trace: `free`, `contact`, `entrenchment`.
const char* to_string(ContactState state) noexcept;

/// Conditions that a tick met; bits of `Tick::flags`.
enum TickFlag : std::uint32_t {
  /// The proxy had not converged after `step_budget` steps: it continues in the next tick. Raise
  /// step_budget if this is frequent and there is time.
  step_budget_hit = 1u << 0,
  /// More points were nearby than a patch can store; an even part of them was used. Move the camera
  /// away or lower its resolution.
  patch_thinned = 1u << 1,
  /// The coupling requested more than max_force.
  force_saturated = 1u << 2,
  /// The HIP or the time was not finite: no force, and the proxy stayed.
  non_finite_input = 1u << 3,
  /// There is no frame to touch yet: no force, and the proxy is at the HIP.
  no_frame = 1u << 4,
  /// The timestamps of the last two frames do not increase by 1 ms or more: no velocity was
  /// computed from them.
  stamp_not_increasing = 1u << 5,
  /// The newest frame is older than max_extrapolation: the surface is assumed to rest at the last
  /// predicted position.
  frame_stale = 1u << 6,
  /// The points' directions cancel out, so there is no normal: the last one was used.
  normal_undefined = 1u << 7,
  /// Method `sight`: the surface is occluded or lies in a hole of the image. The proxy rests on the
  /// last estimate, and the force fades out if this lasts.
  surface_hidden = 1u << 8,
  /// Method `sight`: the newest frame shows the proxy behind the surface that it should be in front
  /// of, by more than noise explains. Set for as long as that frame is in use.
  pop_through_suspected = 1u << 9,
  /// Method `sight`: contact was ended because the newest frame shows free space around the HIP, or
  /// because the force pointed away from all cameras although the surface was not first touched
  /// from behind. The force is zero and the proxy is reset to the HIP. Set only in that tick, as
  /// are the next two flags.
  free_space_released = 1u << 10,
  /// Method `sight`: the proxy was too far from the HIP for a contact (it moved away by more than
  /// 0.3 m in one tick, or it is behind the surface and farther from the HIP than the penetration
  /// at max_force). It is reset to the HIP and the force is zero.
  proxy_let_go = 1u << 11,
  /// Method `sight`: the proxy was behind the surface and was moved back to the front; the force
  /// rises as if the surface returned at `return_speed`.
  returned_to_front = 1u << 12,
};
constexpr std::size_t tick_flag_count = 13;

/// A flag's name and what it means, for people.
struct FlagInfo {
  std::string_view name;     ///< such as "step_budget_hit"
  std::string_view meaning;  ///< one line, with the remedy where there is one
};
/// One row for each bit of `TickFlag`, in their order.
std::span<const FlagInfo> tick_flag_table();
/// The rows of such a table whose bits are set.
std::vector<FlagInfo> flags_in(std::uint32_t bits, std::span<const FlagInfo> table);

/// A place where a surface pushes a tool with a shape. In single precision, which is for telemetry.
struct ContactPush {
  Eigen::Vector3f lever = Eigen::Vector3f::Zero();  ///< [m] world, to it from the proxy
  Eigen::Vector3f force = Eigen::Vector3f::Zero();  ///< [N] world, on the tool; with friction
};

/// The result of one cycle of haptic rendering: HIP in, proxy and force out.
struct Tick {
  double t = 0.0;              ///< [s] as given
  Vec3 hip = Vec3::Zero();     ///< [m] world, as given
  Vec3 proxy = Vec3::Zero();   ///< [m] world, centre of the sphere after the tick's steps
  Vec3 normal = Vec3::Zero();  ///< [-] unit, away from the surface; zero: nothing within r_3
  Vec3 force = Vec3::Zero();   ///< [N] world, on the hand; finite, at most max_force long
  Vec3 torque = Vec3::Zero();  ///< [N m] world, on the hand about the HIP; of a ball always zero
  Rotation orientation = Rotation::Identity();        ///< world_from_handle, as given
  Rotation proxy_orientation = Rotation::Identity();  ///< of a ball that of the hand
  ContactState state = ContactState::free_motion;     ///< after the tick's steps
  int steps = 0;                                      ///< proxy steps taken
  double surface_velocity = 0.0;                      ///< [m/s] v of (13), towards the proxy
  /// [m/s] world: of the surface at the proxy since the tick before, as tracked, along its normal:
  /// depth shows no more of it. Corrections of the estimate by a frame are no motion.
  Vec3 surface_motion = Vec3::Zero();
  /// [N] world: the part of `force` that is an impact's ringing, which the safety chain limits by
  /// itself
  Vec3 transient = Vec3::Zero();
  /// [N] world: the part of `force` that a material's grain makes under a hand that slides, which
  /// is no oscillation of the loop
  Vec3 vibration = Vec3::Zero();
  /// [-] of the coupling's stiffness that is felt, where a material is softer
  double hardness = 1.0;
  std::int64_t frame = -1;          ///< number of the frame in use, from 0; -1 before the first
  std::uint32_t flags = 0;          ///< TickFlag bits
  std::uint32_t contact_count = 0;  ///< of `contacts`; of a ball always 0
  /// Of a tool with a shape, where it is held: the coupling's force and torque by contact, as their
  /// materials make them. While hand and surface rest, the forces add up to `force` without
  /// `transient` and `vibration`, and the moments (lever x force), about proxy as about HIP, to
  /// `torque`. What damps or brakes a hand that moves is of no contact. No recording has them: a
  /// replay makes them again.
  std::array<ContactPush, 6> contacts = {};
};

/// Can `p` [m] be a place? It is finite and within 1000 km of the origin.
bool is_place(const Vec3& p) noexcept;

/// The tick of a hand in free space: the proxy is at the HIP, and there is no force.
Tick free_tick(const Vec3& hip, double t, std::int64_t frame) noexcept;

}  // namespace palpate
