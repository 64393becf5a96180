// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "palpate/core/patch.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// What the safety chain did in a tick; bits of `SafetyOutput::flags`.
enum SafetyFlag : std::uint32_t {
  /// Force, place or time was not finite or absurd, or time ran backwards: no force. Look for
  /// the fault in the device or the renderer.
  input_refused = 1u << 0,
  /// The force pulled into the surface: that part was removed. A coupling only pushes.
  pull_removed = 1u << 1,
  /// The force was longer than the device or the user allows. Lower the stiffness.
  force_cut = 1u << 2,
  /// The motors have given much for long: less than max_force is left until they have cooled.
  continuous_cut = 1u << 3,
  /// The force changed faster than rise_rate or fall_rate. Regular at impacts with a stiff wall.
  slew_cut = 1u << 4,
  /// The force swung fast and far, again and again: it is weakened until that stops. Lower the
  /// stiffness, or raise the servo rate or the damping.
  oscillation_cut = 1u << 5,
  /// The hand is not engaged: it engages after engage_ticks ticks below engage_force.
  disengaged = 1u << 6,
  /// Engaged, and the force is on its way up over ramp_time.
  ramping = 1u << 7,
  /// The newest frame is older than late_intervals intervals: the force may only fall.
  frame_late = 1u << 8,
  /// The newest frame is older than fade_age: the force fades.
  frame_fading = 1u << 9,
  /// The newest frame is older than lost_age, or there is none: the hand is disengaged.
  frame_lost = 1u << 10,
  /// The hand was faster than max_speed: no force, then a ramp.
  hand_too_fast = 1u << 11,
  /// A tick came later than stall_time: the force ramps up from nothing.
  stalled = 1u << 12,
};
constexpr std::size_t safety_flag_count = 13;
/// A short name for each bit, in their order, e.g. "force_cut".
std::span<const std::string_view> safety_flag_names();

/// What the chain allows. Defaults are safe for a Touch-class device.
struct SafetyParameters {
  double max_force = 3.3;         ///< [N] the user's limit; the device's may be lower
  double continuous_time = 20.0;  ///< [s] time constant of the motors' heat
  double rise_rate = 500.0;       ///< [N/s] the force's change, unless towards zero
  double fall_rate = 2000.0;      ///< [N/s] its shrinking
  double swing = 0.5;             ///< [N] a smaller swing is no oscillation
  double swing_time = 0.025;      ///< [s] nor a slower one
  double swing_count = 8.0;       ///< [-] that many in a row are one
  double engage_force = 0.2;      ///< [N] engaging waits until less than this is asked for
  double engage_ticks = 10.0;     ///< [ticks] for so long
  double ramp_time = 1.5;         ///< [s] from no force to all of it
  double late_intervals = 3.0;    ///< [frames] after so many intervals the force may only fall
  double fade_age = 0.1;          ///< [s] age of the newest frame from which the force fades
  double lost_age = 0.5;          ///< [s] age at which it is gone and the hand disengaged
  double max_speed = 1.5;         ///< [m/s] of the hand, on the device
  double stall_time = 5e-3;       ///< [s] between two ticks
};

/// One row of the table that feeds help texts, configuration files and sliders.
struct SafetyParameterInfo {
  std::string_view name;
  std::string_view unit;
  double default_value;
  double min;
  double max;
  std::string_view meaning;
  double SafetyParameters::*member;
};

/// All of them, in the order in which they are shown.
std::span<const SafetyParameterInfo> safety_parameter_table();
/// @throws Error for an unknown name (naming the nearest) or a value out of its range.
void set_parameter(SafetyParameters& parameters, std::string_view name, double value);
/// @throws Error naming the first parameter out of range, or if fade_age >= lost_age.
void validate(const SafetyParameters& parameters);

/// What a tick asks for, and what the chain needs to judge it.
struct SafetyInput {
  double t;               ///< [s] now
  Vec3 force;             ///< [N] world: what the renderer wants
  Vec3 hip;               ///< [m] world
  Vec3 proxy;             ///< [m] world
  Vec3 normal;            ///< [-] away from the surface; zero if not known
  Vec3 position;          ///< [m] of the hand, device frame
  bool hand;              ///< somebody holds the device, and it is not clutched
  double frame_age;       ///< [s] of the newest frame with a stamp that makes sense; inf: none
  double frame_interval;  ///< [s] between frames
};

/// What the device gets.
struct SafetyOutput {
  Vec3 force;           ///< [N] world; finite, within all limits
  std::uint32_t flags;  ///< SafetyFlag bits
  double gain;          ///< [-] 0 disengaged, 1 engaged and nothing faded
};

/// Last before the device, whatever made the force. Knows no clock and no renderer.
///
/// The links judge in the order of the flags. Those from the oscillation detector on give a gain
/// that falls at once and rises over ramp_time; the slew limit is applied to the product, so that
/// no link can make a step, and |force| never exceeds the larger of the last force and the limit.
class SafetyChain {
 public:
  /// All links; the argument below leaves some out, which only tests of the chain may do.
  static constexpr std::uint32_t all_links = (1u << safety_flag_count) - 1;

  /// @throws Error if the parameters do not validate or the device's limits are not positive.
  explicit SafetyChain(const DeviceLimits& device = {}, const SafetyParameters& parameters = {},
                       std::uint32_t links = all_links);

  /// [servo] O(1), no allocation, lock, system call or exception.
  SafetyOutput run(const SafetyInput& input) noexcept;

  /// Would a tick at `t` come after a stall? Then the proxy must be seated anew before it (see
  /// `free_side`). [servo]
  [[nodiscard]] bool stalls_at(double t) const noexcept;

  /// How often each flag was raised: changed from not set to set.
  [[nodiscard]] const std::array<std::uint64_t, safety_flag_count>& interventions() const noexcept {
    return interventions_;
  }

  /// Changes limits between two ticks. They must validate. [servo]
  void set_parameters(const SafetyParameters& parameters) noexcept { parameters_ = parameters; }

 private:
  // Counts swings of one coordinate of the force.
  struct Swings {
    double extreme = 0.0;
    double turned_at = 0.0;
    double count = 0.0;
    bool up = true;
  };

  [[nodiscard]] bool has(std::uint32_t links) const noexcept { return (links_ & links) != 0; }
  Vec3 limited(const SafetyInput& input, Vec3 force, std::uint32_t& flags) noexcept;
  double ceiling(const SafetyInput& input, double demand, double dt, std::uint32_t& flags) noexcept;
  double oscillation_ceiling(double t, double dt) noexcept;
  [[nodiscard]] Vec3 slewed(const Vec3& force, double rise_dt, double fall_dt) const noexcept;

  DeviceLimits device_;
  SafetyParameters parameters_;
  std::uint32_t links_;

  std::optional<double> last_t_;
  Vec3 last_force_ = Vec3::Zero();  // as sent
  std::uint32_t last_flags_ = 0;
  std::array<std::uint64_t, safety_flag_count> interventions_{};

  double heat_ = 0.0;         // [N^2] mean square of the force over continuous_time
  double fresh_force_ = 0.0;  // [N] asked for while the frame was not late
  std::array<Swings, 3> swings_{};
  double swung_at_ = 0.0;  // [s] last swing of an oscillation
  double calm_ = 1.0;      // [-] what the oscillation detector allows
  bool engaged_ = false;
  double quiet_ticks_ = 0.0;
  double gain_ = 0.0;
  Vec3 last_position_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();  // [m/s] of the hand, smoothed
};

}  // namespace palpate
