// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/kernel/core/tick.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/energy_monitor.hpp"
#include "palpate/servo/transient_budget.hpp"

namespace palpate {

/// What the safety chain did in a tick; bits of `SafetyOutput::flags`.
enum SafetyFlag : std::uint32_t {
  /// A force, position or time was not finite or absurdly large, or time ran backwards: no force,
  /// and the hand is disengaged. Look for the fault in the device or the method.
  input_refused = 1u << 0,
  /// The force pulled into the surface or away from the proxy: that part was removed. A coupling
  /// only pushes.
  pull_removed = 1u << 1,
  /// The force was longer than the device or the user allows. Lower the stiffness.
  force_cut = 1u << 2,
  /// The motors have given much for long: less than max_force is left until they have cooled.
  continuous_cut = 1u << 3,
  /// The force changed faster than rise_rate or fall_rate. Regular at impacts with a stiff wall.
  slew_cut = 1u << 4,
  /// The force swung fast and far, again and again: the surface is softened until that stops. Lower
  /// the stiffness, or raise the servo rate or the damping.
  oscillation_cut = 1u << 5,
  /// The hand is not engaged: it engages after engage_ticks ticks below engage_force.
  disengaged = 1u << 6,
  /// Engaged, and the force is on its way up over ramp_time.
  ramping = 1u << 7,
  /// A camera's next frame is overdue by more than late_intervals of its intervals: the force that
  /// is sent may only fall.
  frame_late = 1u << 8,
  /// A camera's newest frame is older than fade_age: the force fades.
  frame_fading = 1u << 9,
  /// A camera's newest frame is older than lost_age, or there is none: the hand is disengaged.
  frame_lost = 1u << 10,
  /// The hand was faster than max_speed: no force, then a ramp.
  hand_too_fast = 1u << 11,
  /// A tick came later than stall_time: the force ramps up from nothing.
  stalled = 1u << 12,
  /// The method's normal points more than 90 degrees away from the direction HIP to proxy: it may
  /// push through the surface. No force, and the hand is disengaged.
  direction_refused = 1u << 13,
  /// fault_count faults (input_refused or direction_refused) within fault_time: no force until an
  /// operator calls SafetyChain::reset. SafetyChain::latched_by says which faults they were.
  fault_latched = 1u << 14,
  /// The rendered surface gave the hand more energy than it took, cycle after cycle: an oscillation
  /// that keeps itself up. The surface is softened until it stops. Lower the stiffness, raise the
  /// servo rate or damping, or hold the handle more firmly.
  energy_cut = 1u << 15,
  /// What the chain computed broke its own bounds: no force. Never seen; please report it.
  output_refused = 1u << 16,
  /// The scale of a camera's depths is in doubt, or was until ramp_time ago: the force limit is
  /// lower, down to 0.5 N.
  scale_unsure = 1u << 17,
};
constexpr std::size_t safety_flag_count = 18;
/// One row for each bit, in their order: why the force is what it is.
std::span<const FlagInfo> safety_flag_table();

/// What the chain allows. Defaults are safe for a Touch-class device; docs/safety.md gives the
/// reason for each number.
struct SafetyParameters {
  double max_force = 3.3;          ///< [N] the user's limit; the device's may be lower
  double continuous_time = 20.0;   ///< [s] time constant of the motors' heat
  double initial_heat = 1.0;       ///< [-] of what the motors bear, taken to be there at the start
  double rise_rate = 500.0;        ///< [N/s] largest rate of change, unless towards zero
  double fall_rate = 2000.0;       ///< [N/s] largest rate at which the force shrinks
  double swing = 0.5;              ///< [N] a smaller swing of the force is no oscillation
  double swing_time = 0.025;       ///< [s] a slower swing of the force is no oscillation
  double swing_count = 8.0;        ///< [-] swings in a row that are an oscillation
  double cycle_distance = 1e-3;    ///< [m] a smaller swing of the hand is no cycle
  double cycle_count = 6.0;        ///< [-] cycles in a row that generate energy: an oscillation
  double cut_memory = 30.0;        ///< [s] time constant with which a cut of energy is forgotten
  double engage_force = 0.2;       ///< [N] the hand engages while less than this is asked for
  double engage_ticks = 10.0;      ///< [ticks] in a row below engage_force
  double ramp_time = 1.5;          ///< [s] from no force to all of it
  double late_intervals = 3.0;     ///< [intervals] without a frame: the force may only fall
  double fade_age = 0.1;           ///< [s] age of the newest frame from which the force fades
  double lost_age = 0.5;           ///< [s] age at which it is gone and the hand disengaged
  double future_tolerance = 0.05;  ///< [s] stamps farther ahead of the clock are not fresh
  double max_speed = 1.5;          ///< [m/s] of the hand, on the device
  double stall_time = 5e-3;        ///< [s] between two ticks
  double fault_count = 3.0;        ///< [-] faults within fault_time that latch
  double fault_time = 2.0;         ///< [s]
};

using SafetyParameterInfo = ParameterRow<SafetyParameters>;

/// All of them, in the order in which they are shown.
std::span<const SafetyParameterInfo> safety_parameter_table();
/// The row of that name. @throws Error if there is none.
const SafetyParameterInfo& safety_parameter(std::string_view name);
/// @throws Error for an unknown name (naming the nearest) or a value out of its range.
void set_parameter(SafetyParameters& parameters, std::string_view name, double value);
/// @throws Error naming the first parameter out of range, or if fade_age >= lost_age.
void validate(const SafetyParameters& parameters);

/// What a tick asks for, and what the chain needs to judge it.
struct SafetyInput {
  double t;                 ///< [s] now
  Vec3 force;               ///< [N] world: what the method asks for
  Vec3 hip;                 ///< [m] world
  Vec3 proxy;               ///< [m] world
  Vec3 normal;              ///< [-] away from the surface; zero if not known
  Vec3 position;            ///< [m] of the hand, device frame
  bool hand;                ///< somebody holds the device, and it is not clutched
  double frame_age;         ///< [s] of the oldest camera's newest fresh frame; inf: none
  double frame_intervals;   ///< [intervals] the most overdue camera is without one; Freshness::Age
  double surface_velocity;  ///< [m/s] of the surface along the normal, as the method tracks it
  Vec3 surface_motion = Vec3::Zero();  ///< [m/s] world: the same as a vector; refused if not finite
  /// [N m] world: what the method asks for about the HIP. What scales the force down scales it, and
  /// the other way round, so that they stay one wrench. A device without motors for it gets none.
  Vec3 torque = Vec3::Zero();
  Vec3 turned = Vec3::Zero();  ///< [rad] world: how far the hand has turned since the tick before
  /// [N] magnitude of the force that the motors apply in addition to `force` to support the
  /// handle's weight. It reduces the available force and counts in the thermal model.
  double held = 0.0;
  /// [N] world: the part of `force` that is an impact's ringing: it may rise at once
  Vec3 transient = Vec3::Zero();
  /// [N] world: the part of `force` that is texture vibration. Up to half of the force it does not
  /// count as an oscillation of the loop.
  Vec3 vibration = Vec3::Zero();
  /// [N] world: force of forbidden regions, in addition to `force`. Only the method's force is
  /// tested against normal and proxy. At the force limit it has the highest priority, and guidance
  /// the lowest.
  Vec3 region = Vec3::Zero();
  Vec3 guidance = Vec3::Zero();  ///< [N] world: of guides and viscous regions
  bool scale_unsure = false;     ///< the scale of a camera's depths is in doubt
};

/// What the device gets.
struct SafetyOutput {
  Vec3 force;                  ///< [N] world; finite, within all limits
  std::uint32_t flags;         ///< SafetyFlag bits
  double ring;                 ///< [N] length of the part of it that is an impact's
  double gain;                 ///< [-] 0 disengaged, 1 engaged and nothing faded
  Vec3 torque = Vec3::Zero();  ///< [N m] world; finite, within all limits
};

/// Last stage before the device; independent of the rendering method and of clocks.
///
/// Order: (1) oscillation detectors scale the force down; (2) checks and limits of the force; (3)
/// gain, which falls at once and rises over ramp_time; (4) slew limit on the result, so that no
/// stage can cause a step. The magnitude of the force never exceeds the larger of the previous
/// force and the limit. While a frame is late, the force never grows. Faults disengage the hand;
/// repeated faults latch. The impact vibration is added after the slew limit, within a
/// TransientBudget and the force limit, and only if there is no fault and no fixture force.
class SafetyChain {
 public:
  /// All stages; the argument below can omit some, only for tests of the chain.
  static constexpr std::uint32_t all_links = (1u << safety_flag_count) - 1;

  /// @throws Error if the parameters do not validate or the device's limits are not positive.
  explicit SafetyChain(const DeviceLimits& device = {}, const SafetyParameters& parameters = {},
                       std::uint32_t links = all_links);

  /// [servo] O(1), no allocation, lock, system call or exception.
  SafetyOutput run(const SafetyInput& input) noexcept;

  /// Would a tick at `t` come after a stall? Then the proxy must be seated again before it (see
  /// `free_side`). [servo]
  [[nodiscard]] bool stalls_at(double t) const noexcept;

  /// Ends a latched fault, by order of an operator; the hand has to pass the engage gate. [servo]
  void reset() noexcept;
  /// Faults that led to fault_latched, as SafetyFlag bits; 0 while it is not latched.
  [[nodiscard]] std::uint32_t latched_by() const noexcept { return latched_by_; }
  /// [-] heat of the motors as a share of what they bear: 1 allows the continuous force only. To be
  /// kept and given to the next session as SafetyParameters::initial_heat.
  [[nodiscard]] double heat() const noexcept;

  /// How often each flag was raised: changed from not set to set.
  [[nodiscard]] const std::array<std::uint64_t, safety_flag_count>& interventions() const noexcept {
    return interventions_;
  }

  /// Changes limits between two ticks. They must validate. [servo]
  void set_parameters(const SafetyParameters& parameters) noexcept { parameters_ = parameters; }
  [[nodiscard]] const SafetyParameters& parameters() const noexcept { return parameters_; }

  /// Walks over all that the chain remembers from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("last_t", self.last_t_);
    way("last_force", self.last_force_);
    way("last_vibration", self.last_vibration_);
    way("last_flags", self.last_flags_);
    way("scale_trust", self.scale_trust_);
    way("heat", self.heat_);
    way("fault_clock", self.fault_clock_);
    for (auto& fault : self.last_faults_) {
      way("fault.began", fault.began);
      way("fault.flags", fault.flags);
    }
    way("faults", self.faults_);
    way("latched_by", self.latched_by_);
    for (auto& swings : self.swings_) {
      way("swings.extreme", swings.extreme);
      way("swings.turned_at", swings.turned_at);
      way("swings.count", swings.count);
      way("swings.up", swings.up);
    }
    way("swung_at", self.swung_at_);
    way("calm", self.calm_);
    EnergyMonitor::walk(way, self.energy_);
    EnergyMonitor::walk(way, self.turning_energy_);
    way("turned", self.turned_);
    way("energy_ceiling", self.energy_ceiling_);
    TransientBudget::walk(way, self.transients_);
    way("last_sent", self.last_sent_);
    way("last_torque", self.last_torque_);
    way("engaged", self.engaged_);
    way("quiet_ticks", self.quiet_ticks_);
    way("gain", self.gain_);
    way("last_position", self.last_position_);
    way("velocity", self.velocity_);
  }

 private:
  // Counts swings of one coordinate of the force, or of the torque over `lever`.
  struct Swings {
    double extreme = 0.0;
    double turned_at = 0.0;
    double count = 0.0;
    bool up = true;
  };

  [[nodiscard]] bool has(std::uint32_t links) const noexcept { return (links_ & links) != 0; }
  [[nodiscard]] bool is_contradictory(const SafetyInput& input) const noexcept;
  void note_faults(std::uint32_t flags) noexcept;
  void warm_up(double since_last) noexcept;
  // [N] for the surface, beside what is held.
  [[nodiscard]] double peak() const noexcept;
  [[nodiscard]] double peak_as_warm() const noexcept;
  Vec3 limited(const SafetyInput& input, double share, std::uint32_t& flags) const noexcept;
  double softened(const SafetyInput& input, double since_last, double dt,
                  std::uint32_t& flags) noexcept;
  double ceiling(const SafetyInput& input, double demand, std::uint32_t& flags) noexcept;
  double oscillation_ceiling(double t, double dt) noexcept;
  double energy_ceiling(const SafetyInput& input, double since_last) noexcept;
  void restart_energy() noexcept {
    energy_.restart();
    turning_energy_.restart();
  }
  Vec3 limited_torque(const SafetyInput& input, Vec3& force, std::uint32_t& flags) const noexcept;
  /// [m] The torque limit over that of the force: over it, turning is judged as pushing is. 0: the
  /// device has no motors for a torque.
  [[nodiscard]] double lever() const noexcept { return device_.max_torque / device_.max_force; }
  /// [N] world: the torque of the last tick, as such a force.
  [[nodiscard]] Vec3 last_turning() const noexcept {
    return lever() > 0.0 ? Vec3(last_torque_ / lever()) : Vec3(Vec3::Zero());
  }
  /// Is less than the peak left while the motors are warm?
  [[nodiscard]] bool warms() const noexcept {
    return has(continuous_cut) && device_.continuous_force < peak() + held_;
  }
  [[nodiscard]] static Vec3 slewed(const Vec3& before, const Vec3& force, double rise,
                                   double fall) noexcept;
  [[nodiscard]] Vec3 bounded(Vec3 force, double rise, std::uint32_t& flags) noexcept;
  void limit_change(double dt, double fall_time, Vec3& force, Vec3& torque,
                    std::uint32_t& flags) noexcept;
  [[nodiscard]] Vec3 with_transient(const SafetyInput& input, const Vec3& force,
                                    std::uint32_t& flags) noexcept;

  DeviceLimits device_;
  SafetyParameters parameters_;
  std::uint32_t links_;

  // walk() lists all of these, but for the interventions, which change nothing, and `held_`, which
  // each tick sets.
  std::optional<double> last_t_;
  Vec3 last_force_ = Vec3::Zero();      // as sent, but for what rang
  Vec3 last_vibration_ = Vec3::Zero();  // the grain's part of it
  Vec3 last_sent_ = Vec3::Zero();       // all of it
  Vec3 last_torque_ = Vec3::Zero();     // [N m] as sent
  double held_ = 0.0;                   // [N] SafetyInput::held of this tick
  std::uint32_t last_flags_ = 0;
  std::array<std::uint64_t, safety_flag_count> interventions_{};

  // [-] 1: the scale is known; on its way to 0 while it is in doubt.
  double scale_trust_ = 1.0;
  // [N^2] mean square of the force over continuous_time, or of the torque over `lever`: of each
  // tick the larger counts.
  double heat_ = 0.0;
  // Faults: when the last few of them began, on a clock that only counts time that makes sense.
  struct Fault {
    double began;
    std::uint32_t flags;
  };
  static constexpr std::size_t most_faults = 16;
  double fault_clock_ = 0.0;  // [s]
  std::array<Fault, most_faults> last_faults_{};
  std::size_t faults_ = 0;
  std::uint32_t latched_by_ = 0;  // SafetyFlag bits
  std::array<Swings, 6> swings_{};
  double swung_at_ = 0.0;  // [s] last swing of an oscillation
  double calm_ = 1.0;      // [-] what the oscillation detector allows
  EnergyMonitor energy_;
  EnergyMonitor turning_energy_;  // the same of torque and turning
  Vec3 turned_ = Vec3::Zero();    // [m] of the hand so far, times `lever`
  double energy_ceiling_ = 1.0;   // [-] what the energy link allows
  TransientBudget transients_;
  bool engaged_ = false;
  double quiet_ticks_ = 0.0;
  double gain_ = 0.0;
  Vec3 last_position_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();  // [m/s] of the hand, smoothed
};

}  // namespace palpate
