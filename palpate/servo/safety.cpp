// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/safety.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {
namespace {

// No position [m], force [N] or direction that means anything is larger; their squares do not
// overflow.
constexpr double largest = 1e6;
// [s] of slew and ramp that a tick earns at most, however late it is: one period at 1 kHz.
constexpr double longest_credit = 1e-3;
// [-] share of the continuous budget below which all of max_force is allowed. From there to the
// whole budget the limit comes down gradually, so that the hand feels no step.
constexpr double cool = 0.8;
// [s] smoothing of the hand's velocity: several ticks, so that one count of an encoder (0.055 mm in
// a millisecond is 0.055 m/s) is no speed.
constexpr double velocity_time = 5e-3;
// [s] without a swing, after which the oscillation detector gives its cut back: 10 periods at 20
// Hz.
constexpr double calm_time = 0.5;
// [N] by which sums of forces up to the largest limit, 50 N, may be rounded.
constexpr double rounding = 1e-12;
// [-] A cut that leaves more than that is over: nobody feels 1 % of a stiffness.
constexpr double forgotten = 0.99;
// [m], [N] Below that distance of the proxy from the HIP, or that force, the direction from one to
// the other is noise: an encoder's count is 0.055 mm, and 0.05 N are hardly felt.
constexpr double least_lever = 1e-3;
constexpr double least_directed_force = 0.05;
// [N] limit while the scale of depths is in doubt. A surface may then be centimetres from where it
// seems: this is felt, and moves no hand that is not held loosely.
constexpr double unsure_force = 0.5;
// [s] in which the limit comes down to it: as long as a force fades with the age of frames.
constexpr double unsure_time = 0.4;

constexpr std::array<FlagInfo, safety_flag_count> flag_table{{
    {"input_refused",
     "no force: the device or the method gave a number that is not finite, or time ran backwards"},
    {"pull_removed", "the part of the force that pulled into the surface was removed"},
    {"force_cut",
     "the force is at its limit: the method requested more than the user or the device allows"},
    {"continuous_cut", "the force is limited because the motors are warm"},
    {"slew_cut", "the force changes more slowly than the method requested"},
    {"oscillation_cut", "the surface is softened because the force swung fast, again and again"},
    {"disengaged",
     "no force: the device is not engaged; move away from the surface: it engages when the "
     "requested force is nearly zero"},
    {"ramping", "the force is ramping up after engaging or after an interruption"},
    {"frame_late", "the force may only fall: a camera's next frame is overdue"},
    {"frame_fading", "the force fades: a camera's newest frame is old"},
    {"frame_lost", "no force: a camera has sent no frame that can be used for too long"},
    {"hand_too_fast", "no force: the hand was faster than max_speed"},
    {"stalled", "the force restarts from zero: the loop missed its deadlines"},
    {"direction_refused",
     "no force: the method's surface normal contradicts the direction from the HIP to the proxy"},
    {"fault_latched", "no force: repeated faults; an operator has to reset the safety chain"},
    {"energy_cut", "the surface is softened because it kept up an oscillation"},
    {"output_refused",
     "no force: the result of the safety chain violated its limits; please report it"},
    {"scale_unsure", "the force is limited because the scale of a camera's depths is in doubt"},
}};

using P = SafetyParameters;
template <double P::*member>
constexpr SafetyParameterInfo row(std::string_view name, std::string_view unit, double min,
                                  double max, std::string_view meaning) {
  return palpate::row_of<member>(name, "", unit, min, max, meaning, "");
}

constexpr std::array table{
    row<&P::max_force>("max_device_force", "N", 0.0, 50.0,
                       "the user's limit; the device's limit may be lower"),
    row<&P::continuous_time>("continuous_time", "s", 1.0, 600.0,
                             "time constant of the motors' heat"),
    row<&P::initial_heat>(
        "initial_heat", "-", 0.0, 1.0,
        "motor temperature at the start, as a fraction of the thermal limit; 1 if unknown"),
    row<&P::rise_rate>("rise_rate", "N/s", 1.0, 1e5,
                       "largest rate of change of the force, unless towards zero"),
    row<&P::fall_rate>("fall_rate", "N/s", 1.0, 1e5, "largest rate at which the force decreases"),
    row<&P::swing>("swing", "N", 0.01, 10.0, "minimum amplitude of a force oscillation"),
    row<&P::swing_time>("swing_time", "s", 1e-3, 0.5, "maximum half period of a force oscillation"),
    row<&P::swing_count>("swing_count", "-", 2.0, 100.0,
                         "consecutive half periods that count as an oscillation"),
    row<&P::cycle_distance>("cycle_distance", "m", 1e-4, 0.05,
                            "minimum amplitude of the hand in an oscillation cycle"),
    row<&P::cycle_count>("cycle_count", "-", 3.0, 100.0,
                         "consecutive energy-generating cycles that count as an oscillation"),
    row<&P::cut_memory>("cut_memory", "s", 1.0, 600.0,
                        "time constant with which the stiffness recovers after it was reduced for "
                        "generated energy"),
    row<&P::engage_force>("engage_force", "N", 0.0, 3.0,
                          "the device engages while the requested force is below this"),
    row<&P::engage_ticks>("engage_ticks", "ticks", 1.0, 1e5,
                          "consecutive ticks below engage_force that engage the device"),
    row<&P::ramp_time>("ramp_time", "s", 0.01, 10.0, "from no force to all of it"),
    row<&P::late_intervals>("late_intervals", "intervals", 1.0, 100.0,
                            "frame intervals without a frame after which the force may only fall"),
    row<&P::fade_age>("fade_age", "s", 0.01, 5.0,
                      "age of the newest frame from which the force fades"),
    row<&P::lost_age>("lost_age", "s", 0.02, 10.0,
                      "age of the newest frame at which the device disengages"),
    row<&P::future_tolerance>(
        "future_tolerance", "s", 0.0, 1.0,
        "a frame with a timestamp farther ahead of the loop's clock is not fresh"),
    row<&P::max_speed>("max_speed", "m/s", 0.05, 20.0,
                       "above this speed of the hand there is no force, then a ramp"),
    row<&P::stall_time>("stall_time", "s", 2e-3, 0.1, "a longer delay of a tick starts a ramp"),
    row<&P::fault_count>("fault_count", "-", 1.0, 16.0,
                         "faults within fault_time that latch until an operator resets them"),
    row<&P::fault_time>("fault_time", "s", 0.0, 600.0, "time window for fault_count"),
};

constexpr std::string_view noun = "safety parameter";

// Of what changes with a time constant, the share that `dt` changes.
double share_of(double dt, double time_constant) { return -math::expm1(-dt / time_constant); }

// Hazard: not-a-number
bool is_sound(const Vec3& v) { return v.allFinite() && v.cwiseAbs().maxCoeff() <= largest; }

bool is_sound(const SafetyInput& input) {
  return is_sound(input.force) && is_sound(input.normal) && is_sound(input.hip) &&
         is_sound(input.proxy) && is_sound(input.position) &&
         std::abs(input.surface_velocity) <= largest && is_sound(input.surface_motion) &&
         is_sound(input.torque) && is_sound(input.turned) && is_sound(input.transient) &&
         is_sound(input.vibration) && is_sound(input.region) && is_sound(input.guidance);
}

// Shortens `force` to `limit`; false if it is short enough.
bool cut_to(double limit, Vec3& force) {
  const double length = force.norm();
  if (!(length > limit)) return false;
  force *= (1.0 - 1e-15) * limit / length;  // no longer than the limit after rounding, too
  return true;
}

// Removes the component of `force` against `outwards`, of any length but none.
void remove_pull(const Vec3& outwards, Vec3& force) {
  const double push = force.dot(outwards);
  if (!outwards.isZero() && push < 0.0) force -= push / outwards.squaredNorm() * outwards;
}

// Both the normal that the method gives and the direction that its proxy shows have to agree.
// Hazard: pull
void only_push(const SafetyInput& input, Vec3& force) {
  const Vec3 lever = input.proxy - input.hip;
  if (input.normal.isZero() && lever.isZero()) force.setZero();  // no telling which way it acts
  remove_pull(input.normal, force);
  if (lever.norm() > least_lever || input.normal.isZero()) remove_pull(lever, force);
}

bool has_fixtures(const SafetyInput& input) {
  return !(input.region.isZero() && input.guidance.isZero());
}

// Adds to `force` the largest share of `more` with which it is no longer than `limit`; false if
// that is all of it.
bool add_within(double limit, const Vec3& more, Vec3& force) {
  const double size = more.squaredNorm();
  if (!(size > 0.0)) return false;
  const double room = std::max(limit * limit - force.squaredNorm(), 0.0);
  const double along = force.dot(more);
  const double share = (-along + std::sqrt(along * along + size * room)) / size;
  force += std::clamp(share, 0.0, 1.0) * more;
  return cut_to(limit, force) || share < 1.0;
}

}  // namespace

std::span<const FlagInfo> safety_flag_table() { return flag_table; }

std::span<const SafetyParameterInfo> safety_parameter_table() { return table; }

const SafetyParameterInfo& safety_parameter(std::string_view name) {
  return row_by_name(safety_parameter_table(), name, noun);
}

void set_parameter(SafetyParameters& parameters, std::string_view name, double value) {
  set_by_name(safety_parameter_table(), parameters, name, value, noun);
}

void validate(const SafetyParameters& parameters) {
  check_ranges(safety_parameter_table(), parameters, noun);
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
  heat_ = parameters_.initial_heat * device_.continuous_force * device_.continuous_force;
}

// Hazard: late-loop
bool SafetyChain::stalls_at(double t) const noexcept {
  return has(stalled) && last_t_ && t - *last_t_ > parameters_.stall_time;
}

double SafetyChain::heat() const noexcept {
  return heat_ / (device_.continuous_force * device_.continuous_force);
}

void SafetyChain::reset() noexcept {
  latched_by_ = 0;
  faults_ = 0;
}

// Does the method's normal point away from where its proxy is? A force of any weight then acts
// through the surface or sideways. A proxy next to the HIP shows no direction.
// Hazard: wrong-direction
bool SafetyChain::is_contradictory(const SafetyInput& input) const noexcept {
  const Vec3 lever = input.proxy - input.hip;
  return has(direction_refused) && input.normal.dot(lever) < 0.0 && lever.norm() > least_lever &&
         input.force.norm() > least_directed_force;
}

// A fault is counted when it begins and not for each tick that it lasts.
// Hazard: repeated-fault
void SafetyChain::note_faults(std::uint32_t flags) noexcept {
  const std::uint32_t begun =
      flags & ~last_flags_ & (std::uint32_t{input_refused} | std::uint32_t{direction_refused});
  if (begun == 0 || !has(fault_latched)) return;
  last_faults_[faults_ % most_faults] = {fault_clock_, begun};
  ++faults_;
  const auto enough = static_cast<std::size_t>(parameters_.fault_count);
  if (faults_ < enough) return;
  std::uint32_t reasons = 0;
  for (std::size_t i = faults_ - enough; i < faults_; ++i) {
    const Fault& fault = last_faults_[i % most_faults];
    if (fault_clock_ - fault.began > parameters_.fault_time) return;
    reasons |= fault.flags;
  }
  latched_by_ |= reasons;
}

// After a gap the last force counts as held all through, but cooling only as of a tick that is just
// not stalled: whether the motors were off is not known.
// Hazard: hot-motors
void SafetyChain::warm_up(double since_last) noexcept {
  const double given = std::max(last_sent_.norm() + held_, last_turning().norm());
  const double change = given * given - heat_;
  const double elapsed = change > 0.0 ? since_last : std::min(since_last, parameters_.stall_time);
  heat_ += share_of(elapsed, parameters_.continuous_time) * change;
}

// Hazard: scale-unsure
double SafetyChain::peak() const noexcept {
  const double most = std::max(std::min(parameters_.max_force, device_.max_force) - held_, 0.0);
  return scale_trust_ < 1.0 ? std::min(most, unsure_force + scale_trust_ * (most - unsure_force))
                            : most;
}

// The share of the budget that is used up takes the peak down to the continuous force.
double SafetyChain::peak_as_warm() const noexcept {
  const double cold = peak() + held_;
  if (!(device_.continuous_force < cold)) return peak();
  const double budget = device_.continuous_force * device_.continuous_force;
  const double left = std::clamp((1.0 - heat_ / budget) / (1.0 - cool), 0.0, 1.0);
  return std::max(std::sqrt(budget + left * (cold * cold - budget)) - held_, 0.0);
}

// Pushes only, magnitude, continuous force; and frames that are late. `share` is what the links
// that soften leave.
// Hazard: too-much-force
Vec3 SafetyChain::limited(const SafetyInput& input, double share,
                          std::uint32_t& flags) const noexcept {
  Vec3 force = share * (input.force - input.transient);
  if (has(pull_removed)) {
    const Vec3 before = force;
    only_push(input, force);
    if (force != before) flags |= pull_removed;
  }
  if (has_fixtures(input)) {
    const Vec3 surface = force;
    force = share * input.region;
    const double most = has(force_cut) ? peak() : largest;
    bool cut = cut_to(most, force);
    cut = add_within(most, surface, force) || cut;
    cut = add_within(most, share * input.guidance, force) || cut;
    if (cut) flags |= force_cut;
  } else if (has(force_cut) && cut_to(peak(), force)) {
    flags |= force_cut;
  }
  if (warms() && cut_to(peak_as_warm(), force)) flags |= continuous_cut;

  if (has(frame_late) && !(input.frame_intervals <= parameters_.late_intervals)) {
    flags |= frame_late;
  }
  return force;
}

// As much of the torque as is left of the force, and of both what the motors for it bear.
// Hazard: torque, hot-motors
Vec3 SafetyChain::limited_torque(const SafetyInput& input, Vec3& force,
                                 std::uint32_t& flags) const noexcept {
  const double asked = (input.force - input.transient).norm();
  const double left = asked > undirected_force ? std::min(force.norm() / asked, 1.0)
                                               : std::min(calm_, energy_ceiling_);
  Vec3 torque = left * input.torque;
  const double size = torque.norm();
  const double warm = lever() * (warms() ? peak_as_warm() : largest);
  const double most = has(force_cut) ? std::min(lever() * peak(), warm) : warm;
  if (size <= most) return torque;
  flags |= most < warm ? force_cut : continuous_cut;
  force *= most / size;
  cut_to(most, torque);
  return torque;
}

namespace {

// What of a grain's vibration is in the force that was sent: as much as of the rest, and never more
// than half, so that nobody hides a swing by calling it one.
Vec3 vibration_in(const SafetyInput& input, const Vec3& sent) noexcept {
  const double given = (input.force - input.transient).norm();
  if (!(given > 0.0) || !input.vibration.allFinite()) return Vec3::Zero();
  const double length = sent.norm();
  Vec3 vibration = std::min(length / given, 1.0) * input.vibration;
  cut_to(0.5 * length, vibration);
  return vibration;
}

}  // namespace

// Halves what is allowed at each train of fast, large swings, and gives it back when they stop.
// Hazard: fast-oscillation
double SafetyChain::oscillation_ceiling(double t, double dt) noexcept {
  Eigen::Matrix<double, 6, 1> steady;
  steady << last_force_ - last_vibration_, last_turning();
  for (int axis = 0; axis < 6; ++axis) {
    Swings& swings = swings_[static_cast<std::size_t>(axis)];
    const double x = swings.up ? steady[axis] : -steady[axis];
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

// Halves what is allowed at each oscillation that the surface keeps up, and gives it back over so
// long a time that the next one is not felt as one more burst of a vibration.
// Hazard: slow-oscillation
double SafetyChain::energy_ceiling(const SafetyInput& input, double since_last) noexcept {
  if (since_last > parameters_.stall_time) restart_energy();
  const EnergyMonitor::Limits limits{parameters_.cycle_distance, parameters_.cycle_count,
                                     energy_ceiling_ < 1.0};
  turned_ += lever() * input.turned;
  const bool turns =
      turning_energy_.run(since_last, last_turning(), turned_, input.torque, 0.0, limits);
  // Across the boundary that gives the larger force.
  const bool by_region = input.region.squaredNorm() > input.force.squaredNorm();
  const bool found =
      energy_.run(since_last, last_force_, input.hip, by_region ? input.region : input.normal,
                  by_region ? 0.0 : input.surface_velocity, limits);
  if (found || turns) {
    energy_ceiling_ *= 0.5;
  } else if (energy_ceiling_ < 1.0) {
    energy_ceiling_ += share_of(since_last, parameters_.cut_memory) * (1.0 - energy_ceiling_);
    if (energy_ceiling_ > forgotten) energy_ceiling_ = 1.0;
  }
  return energy_ceiling_;
}

// What the oscillation links leave of the stiffness, 0 to 1.
double SafetyChain::softened(const SafetyInput& input, double since_last, double dt,
                             std::uint32_t& flags) noexcept {
  const double by_swings = has(oscillation_cut) ? oscillation_ceiling(input.t, dt) : 1.0;
  const double by_energy = has(energy_cut) ? energy_ceiling(input, since_last) : 1.0;
  if (by_swings < 1.0) flags |= oscillation_cut;
  if (by_energy < 1.0) flags |= energy_cut;
  return std::min(by_swings, by_energy);
}

// What the links from the engage gate on let through, 0 to 1.
// Hazard: engaging-inside, late-frame, fast-hand, nobody-holds
double SafetyChain::ceiling(const SafetyInput& input, double demand,
                            std::uint32_t& flags) noexcept {
  double ceiling = 1.0;
  if (latched_by_ != 0) {
    flags |= fault_latched;
    engaged_ = false;
    ceiling = 0.0;
  }

  const bool lost = has(frame_lost) && !(input.frame_age <= parameters_.lost_age);
  if (has(disengaged)) {
    const bool allowed = input.hand && !lost && latched_by_ == 0;
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

// Shrinks along the last force or torque by `fall` at most and changes otherwise by `rise`.
// Hazard: force-step
Vec3 SafetyChain::slewed(const Vec3& before, const Vec3& force, double rise, double fall) noexcept {
  const double last = before.norm();
  const Vec3 along = last > 0.0 ? Vec3(before / last) : Vec3::Zero();
  const double least = std::max(last - fall, 0.0);
  const Vec3 from = std::clamp(force.dot(along), least, last) * along;
  Vec3 change = force - from;
  if (least > 0.0) change -= std::min(change.dot(along), 0.0) * along;  // shrunk as far as it may
  cut_to(rise, change);
  return from + change;
}

// The last word. A force that turns while it shrinks slowly may be longer than before and than the
// limit: here it is not. Then the promises are checked on the result itself, and what breaks one, a
// NaN included, is no force.
// Hazard: too-much-force
Vec3 SafetyChain::bounded(Vec3 force, double rise, std::uint32_t& flags) noexcept {
  const double last = last_force_.norm();
  const double most = (flags & frame_late) != 0 ? last : std::max(last, peak());
  if (has(force_cut) || (flags & frame_late) != 0) cut_to(most, force);
  if (links_ != all_links) return force;
  const double length = force.norm();
  if (length <= most && length - last <= rise + rounding) return force;
  flags |= output_refused;
  engaged_ = false;
  gain_ = 0.0;
  return Vec3::Zero();
}

// The ringing of an impact, for which the hand has to be as engaged as for any force. It takes from
// the force that is sent at most what that has, so that nothing pulls.
Vec3 SafetyChain::with_transient(const SafetyInput& input, const Vec3& force,
                                 std::uint32_t& flags) noexcept {
  constexpr std::uint32_t amiss = input_refused | direction_refused | disengaged | frame_late |
                                  frame_lost | hand_too_fast | stalled | fault_latched |
                                  output_refused | scale_unsure;
  if ((flags & amiss) != 0 || has_fixtures(input)) {
    transients_.end();
    return force;
  }
  const Vec3 wanted = gain_ * input.transient;
  const Vec3 allowed = transients_.run(input.t, input.hip, wanted);
  if (allowed != wanted) flags |= slew_cut;
  if (allowed.isZero()) return force;
  Vec3 sent = force + allowed;
  if (has(pull_removed)) only_push(input, sent);
  const double most = has(continuous_cut) ? peak_as_warm() : peak();
  if (has(force_cut) && cut_to(std::max(force.norm(), most), sent)) flags |= force_cut;
  return sent.allFinite() ? sent : force;
}

// Force and torque as far as they may change from those of the last tick, by so much time [s] for a
// rise and for a fall: without a clock the force falls as if a tick had passed.
void SafetyChain::limit_change(double dt, double fall_time, Vec3& force, Vec3& torque,
                               std::uint32_t& flags) noexcept {
  const double rise = parameters_.rise_rate * dt;
  if (has(slew_cut)) {
    const Vec3 wanted = force;
    const double fall = parameters_.fall_rate * fall_time;
    const Vec3 wanted_torque = torque;
    force = slewed(last_force_, wanted, rise, fall);
    torque = slewed(last_torque_, wanted_torque, lever() * rise, lever() * fall);
    if (force != wanted || torque != wanted_torque) flags |= slew_cut;
  }
  force = bounded(force, rise, flags);
  // Nor may what rang in the last tick be made up for while a frame is late, or as the force ends.
  if ((flags & frame_late) != 0) {
    cut_to(last_sent_.norm(), force);
    cut_to(last_torque_.norm(), torque);
  }
  if ((flags & (disengaged | fault_latched | frame_lost)) != 0 &&
      last_sent_.squaredNorm() < last_force_.squaredNorm())
    cut_to(std::max(last_sent_.norm() - parameters_.fall_rate * dt, 0.0), force);
  if (has(force_cut)) cut_to(std::max(last_torque_.norm(), lever() * peak()), torque);
  if ((flags & output_refused) != 0 || !torque.allFinite()) torque = Vec3::Zero();
}

// Hazard: not-a-number
SafetyOutput SafetyChain::run(const SafetyInput& input) noexcept {
  std::uint32_t flags = 0;
  const bool in_order = std::isfinite(input.t) && (!last_t_ || input.t >= *last_t_);
  const bool sound = in_order && is_sound(input);
  const double since_last = in_order && last_t_ ? input.t - *last_t_ : 0.0;
  const double dt = std::min(since_last, longest_credit);
  fault_clock_ += since_last;
  held_ = std::isfinite(input.held) ? std::max(input.held, 0.0) : 0.0;
  warm_up(since_last);
  scale_trust_ = has(scale_unsure) && input.scale_unsure
                     ? std::max(scale_trust_ - dt / unsure_time, 0.0)
                     : std::min(scale_trust_ + dt / parameters_.ramp_time, 1.0);

  if (sound && since_last > 0.0) {
    const Vec3 velocity = (input.position - last_position_) / since_last;
    velocity_ += share_of(since_last, velocity_time) * (velocity - velocity_);
  }
  if (sound) last_position_ = input.position;

  if (!sound && has(input_refused)) flags |= input_refused;
  if (sound && is_contradictory(input)) flags |= direction_refused;
  note_faults(flags);

  Vec3 force = Vec3::Zero();
  Vec3 torque = Vec3::Zero();
  if (flags == 0) {
    // Before the limits: a softer surface still holds a hand with all the force that is allowed.
    force = limited(input, softened(input, since_last, dt, flags), flags);
    if (lever() > 0.0) torque = limited_torque(input, force, flags);
    const double turning = lever() > 0.0 ? torque.norm() / lever() : 0.0;
    double most = ceiling(input, std::max(force.norm(), turning), flags);
    if (stalls_at(input.t)) {
      flags |= stalled;
      most = 0.0;
    }
    gain_ = has(ramping) ? std::min(most, gain_ + dt / parameters_.ramp_time) : most;
    if (gain_ < most) flags |= ramping;
    force *= gain_;
    torque *= gain_;
  } else {
    gain_ = 0.0;
    engaged_ = false;
    quiet_ticks_ = 0.0;
    restart_energy();
    if (latched_by_ != 0) flags |= fault_latched;
  }

  if (scale_trust_ < 1.0) flags |= scale_unsure;

  limit_change(dt, in_order && last_t_ ? dt : longest_credit, force, torque, flags);
  if (std::isfinite(input.t)) last_t_ = input.t;
  last_force_ = force;
  last_torque_ = torque;
  last_vibration_ = vibration_in(input, force);
  last_sent_ = with_transient(input, force, flags);
  for (std::size_t i = 0; i < safety_flag_count; ++i) {
    if (((flags & ~last_flags_) >> i & 1u) != 0) ++interventions_[i];
  }
  last_flags_ = flags;
  return {last_sent_, flags, (last_sent_ - force).norm(), gain_, torque};
}

}  // namespace palpate
