// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/safety.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"
#include "palpate/core/parameters.hpp"

namespace palpate {
namespace {

// No place [m], force [N] or direction that means anything is larger; their squares do not
// overflow.
constexpr double largest = 1e6;
// A tick earns at most this much time [s] of slew and ramp, however late it is.
constexpr double longest_credit = 1e-3;
// The share of the continuous budget below which all of max_force is there.
constexpr double cool = 0.8;
// Smoothing of the hand's velocity [s]: several ticks, so that one count of an encoder is no speed.
constexpr double velocity_time = 5e-3;
// So long without a swing [s] and what the detector took comes back.
constexpr double calm_time = 0.5;

constexpr std::array<std::string_view, safety_flag_count> flag_names{
    "input_refused",   "pull_removed",  "force_cut", "continuous_cut", "slew_cut",
    "oscillation_cut", "disengaged",    "ramping",   "frame_late",     "frame_fading",
    "frame_lost",      "hand_too_fast", "stalled"};

using P = SafetyParameters;
constexpr std::array table{
    SafetyParameterInfo{"max_device_force", "N", 3.3, 0.0, 50.0,
                        "the user's limit; the device's own may be lower", &P::max_force},
    SafetyParameterInfo{"continuous_time", "s", 20.0, 1.0, 600.0,
                        "time constant of the motors' heat", &P::continuous_time},
    SafetyParameterInfo{"rise_rate", "N/s", 500.0, 1.0, 1e5,
                        "fastest change of the force, unless towards zero", &P::rise_rate},
    SafetyParameterInfo{"fall_rate", "N/s", 2000.0, 1.0, 1e5, "fastest shrinking of the force",
                        &P::fall_rate},
    SafetyParameterInfo{"swing", "N", 0.5, 0.01, 10.0, "a smaller swing is no oscillation",
                        &P::swing},
    SafetyParameterInfo{"swing_time", "s", 0.025, 1e-3, 0.5, "a slower swing is no oscillation",
                        &P::swing_time},
    SafetyParameterInfo{"swing_count", "-", 8.0, 2.0, 100.0,
                        "so many swings in a row are an oscillation", &P::swing_count},
    SafetyParameterInfo{"engage_force", "N", 0.2, 0.0, 3.0,
                        "engaging waits until less than this is asked for", &P::engage_force},
    SafetyParameterInfo{"engage_ticks", "ticks", 10.0, 1.0, 1e5, "for so long", &P::engage_ticks},
    SafetyParameterInfo{"ramp_time", "s", 1.5, 0.01, 10.0, "from no force to all of it",
                        &P::ramp_time},
    SafetyParameterInfo{"late_intervals", "frames", 3.0, 1.0, 100.0,
                        "without a frame for so many intervals the force may only fall",
                        &P::late_intervals},
    SafetyParameterInfo{"fade_age", "s", 0.1, 0.01, 5.0,
                        "age of the newest frame from which the force fades", &P::fade_age},
    SafetyParameterInfo{"lost_age", "s", 0.5, 0.02, 10.0,
                        "age of the newest frame at which the hand disengages", &P::lost_age},
    SafetyParameterInfo{"max_speed", "m/s", 1.5, 0.05, 20.0,
                        "a faster hand gets no force, then a ramp", &P::max_speed},
    SafetyParameterInfo{"stall_time", "s", 5e-3, 2e-3, 0.1, "a tick that comes later starts a ramp",
                        &P::stall_time},
};

void check_range(const SafetyParameterInfo& row, double value) {
  if (value >= row.min && value <= row.max) return;
  throw Error("parameter '" + std::string(row.name) + "'",
              std::to_string(value) + " " + std::string(row.unit) + " is out of range",
              "give a value from " + std::to_string(row.min) + " to " + std::to_string(row.max));
}

// Of what changes with a time constant, the share that `dt` changes.
double share_of(double dt, double time_constant) {
  return -std::expm1(-dt / time_constant);
}

bool is_sound(const Vec3& v) {
  return v.allFinite() && v.cwiseAbs().maxCoeff() <= largest;
}

// Shortens `force` to `limit`; false if it is short enough.
bool cut_to(double limit, Vec3& force) {
  const double length = force.norm();
  if (!(length > limit)) return false;
  force *= limit / length;
  return true;
}

}  // namespace

std::span<const std::string_view> safety_flag_names() {
  return flag_names;
}

std::span<const SafetyParameterInfo> safety_parameter_table() {
  return table;
}

void set_parameter(SafetyParameters& parameters, std::string_view name, double value) {
  std::vector<std::string_view> names;
  for (const SafetyParameterInfo& row : table) {
    names.push_back(row.name);
    if (row.name != name) continue;
    check_range(row, value);
    parameters.*row.member = value;
    return;
  }
  const std::string_view near = nearest_name(name, names);
  throw Error("parameter '" + std::string(name) + "'", "there is no such safety parameter",
              near.empty() ? "" : "did you mean '" + std::string(near) + "'?");
}

void validate(const SafetyParameters& parameters) {
  for (const SafetyParameterInfo& row : table) check_range(row, parameters.*row.member);
  if (!(parameters.fade_age < parameters.lost_age)) {
    throw Error("parameters fade_age, lost_age", "a frame is lost before the force has faded",
                "give fade_age < lost_age");
  }
}

SafetyChain::SafetyChain(const DeviceLimits& device, const SafetyParameters& parameters,
                         std::uint32_t links)
    : device_(device), parameters_(parameters), links_(links) {
  validate(parameters_);
  if (!(device_.max_force > 0.0 && device_.continuous_force > 0.0)) {
    throw Error("device limits", "a force limit is not positive", "give newtons above 0");
  }
}

bool SafetyChain::stalls_at(double t) const noexcept {
  return has(stalled) && last_t_ && t - *last_t_ > parameters_.stall_time;
}

// Finite, pushes only, magnitude, continuous force; and frames that are late.
Vec3 SafetyChain::limited(const SafetyInput& input, Vec3 force, std::uint32_t& flags) noexcept {
  if (has(pull_removed)) {
    const Vec3 outwards = input.normal.isZero() ? Vec3(input.proxy - input.hip) : input.normal;
    const double length = outwards.norm();
    const double push = length > 0.0 ? force.dot(outwards) / length : 0.0;
    if (push < 0.0) {
      force -= push / length * outwards;
      flags |= pull_removed;
    } else if (length == 0.0 && !force.isZero()) {  // no telling which way it acts
      force.setZero();
      flags |= pull_removed;
    }
  }
  const double peak = std::min(parameters_.max_force, device_.max_force);
  if (has(force_cut) && cut_to(peak, force)) flags |= force_cut;

  // The share of the budget that is used up takes the peak down to what can be given for ever.
  const double budget = device_.continuous_force * device_.continuous_force;
  if (has(continuous_cut) && device_.continuous_force < peak) {
    const double left = std::clamp((1.0 - heat_ / budget) / (1.0 - cool), 0.0, 1.0);
    if (cut_to(std::sqrt(budget + left * (peak * peak - budget)), force)) flags |= continuous_cut;
  }

  // The chain's own way to forbid extrapolation: what was asked for in time is the most there is.
  const bool late = input.frame_age > parameters_.late_intervals * input.frame_interval;
  if (!late) fresh_force_ = force.norm();
  if (has(frame_late) && late) {
    flags |= frame_late;
    cut_to(fresh_force_, force);
  }
  return force;
}

// Halves what is allowed at each train of fast, large swings, and gives it back when they stop.
double SafetyChain::oscillation_ceiling(double t, double dt) noexcept {
  for (int axis = 0; axis < 3; ++axis) {
    Swings& swings = swings_[static_cast<std::size_t>(axis)];
    const double x = swings.up ? last_force_[axis] : -last_force_[axis];
    if (x > swings.extreme) swings.extreme = x;
    if (swings.extreme - x < parameters_.swing) continue;
    const bool fast = t - swings.turned_at < parameters_.swing_time;
    swings = {-x, t, fast ? swings.count + 1.0 : 0.0, !swings.up};
    if (fast) swung_at_ = t;
    if (swings.count >= parameters_.swing_count) {
      swings.count = 0.0;
      calm_ *= 0.5;
    }
  }
  if (t - swung_at_ > calm_time) calm_ = std::min(1.0, calm_ + dt / parameters_.ramp_time);
  return calm_;
}

// What the links from the oscillation detector on let through, 0 to 1.
double SafetyChain::ceiling(const SafetyInput& input, double demand, double dt,
                            std::uint32_t& flags) noexcept {
  double ceiling = 1.0;
  if (has(oscillation_cut)) {
    ceiling = oscillation_ceiling(input.t, dt);
    if (ceiling < 1.0) flags |= oscillation_cut;
  }

  const bool lost = has(frame_lost) && !(input.frame_age <= parameters_.lost_age);
  if (has(disengaged)) {
    const bool allowed = input.hand && !lost;
    const bool quiet = allowed && demand < parameters_.engage_force;
    quiet_ticks_ = quiet ? quiet_ticks_ + 1.0 : 0.0;
    engaged_ = allowed && (engaged_ || quiet_ticks_ >= parameters_.engage_ticks);
    if (!engaged_) {
      flags |= disengaged;
      ceiling = 0.0;
    }
  }

  if (lost) {
    flags |= frame_lost;
    ceiling = 0.0;
  } else if (has(frame_fading) && input.frame_age > parameters_.fade_age) {
    flags |= frame_fading;
    const double left =
        (parameters_.lost_age - input.frame_age) / (parameters_.lost_age - parameters_.fade_age);
    ceiling = std::min(ceiling, std::max(left, 0.0));
  }

  if (has(hand_too_fast) && velocity_.norm() > parameters_.max_speed) {
    flags |= hand_too_fast;
    ceiling = 0.0;
  }
  return ceiling;
}

// Shrinks along the last force at fall_rate and changes otherwise at rise_rate.
Vec3 SafetyChain::slewed(const Vec3& force, double rise_dt, double fall_dt) const noexcept {
  const double last = last_force_.norm();
  const Vec3 along = last > 0.0 ? Vec3(last_force_ / last) : Vec3::Zero();
  const double least = std::max(last - parameters_.fall_rate * fall_dt, 0.0);
  const Vec3 from = std::clamp(force.dot(along), least, last) * along;
  Vec3 change = force - from;
  if (least > 0.0) change -= std::min(change.dot(along), 0.0) * along;  // shrunk as far as it may
  cut_to(parameters_.rise_rate * rise_dt, change);
  return from + change;
}

SafetyOutput SafetyChain::run(const SafetyInput& input) noexcept {
  std::uint32_t flags = 0;
  const bool in_order = std::isfinite(input.t) && (!last_t_ || input.t >= *last_t_);
  const bool sound = in_order && is_sound(input.force) && is_sound(input.normal) &&
                     is_sound(input.hip) && is_sound(input.proxy) && is_sound(input.position);
  const double since_last = in_order && last_t_ ? input.t - *last_t_ : 0.0;
  const double dt = std::min(since_last, longest_credit);
  heat_ += share_of(since_last, parameters_.continuous_time) * (last_force_.squaredNorm() - heat_);

  if (sound && since_last > 0.0) {
    const Vec3 velocity = (input.position - last_position_) / since_last;
    velocity_ += share_of(since_last, velocity_time) * (velocity - velocity_);
  }
  if (sound) last_position_ = input.position;

  Vec3 force = Vec3::Zero();
  if (sound || !has(input_refused)) {
    force = limited(input, input.force, flags);
    double most = ceiling(input, force.norm(), dt, flags);
    if (stalls_at(input.t)) {
      flags |= stalled;
      most = 0.0;
    }
    gain_ =
        most < gain_ || !has(ramping) ? most : std::min(most, gain_ + dt / parameters_.ramp_time);
    if (gain_ < most) flags |= ramping;
    force *= gain_;
  } else {
    flags |= input_refused;
    gain_ = 0.0;
  }

  if (has(slew_cut)) {
    // Without a clock the force falls as if a tick had passed.
    const Vec3 wanted = force;
    force = slewed(wanted, dt, in_order && last_t_ ? dt : longest_credit);
    if (force != wanted) flags |= slew_cut;
  }

  if (std::isfinite(input.t)) last_t_ = input.t;
  last_force_ = force;
  for (std::size_t i = 0; i < safety_flag_count; ++i) {
    if (((flags & ~last_flags_) >> i & 1u) != 0) ++interventions_[i];
  }
  last_flags_ = flags;
  return {force, flags, gain_};
}

}  // namespace palpate
