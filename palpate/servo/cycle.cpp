// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/servo/free_side.hpp"

namespace palpate {
namespace {

// One writer: no need for a locked addition.
void add(std::atomic<std::uint64_t>& counter, std::uint64_t n) noexcept {
  counter.store(counter.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
}

std::uint64_t nanoseconds(double seconds) noexcept {
  if (!(seconds > 0.0)) return 0;  // nor a NaN
  return static_cast<std::uint64_t>(std::min(seconds, 1e6) * 1e9);
}

bool is_faulty(const HandState& hand) noexcept { return hand.fault != DeviceFault::none; }

std::uint32_t hand_bits(const HandState& hand) noexcept {
  return (hand.present ? hand_present : 0U) | (hand.clutched ? hand_clutched : 0U) |
         (is_faulty(hand) ? hand_fault : 0U) |
         (static_cast<std::uint32_t>(hand.fault) << hand_fault_shift);
}

constexpr double gravity = 9.80665;  // [m/s^2]
// [s] for which a tick may add to the force, as the safety chain's longest_credit.
constexpr double longest_tick = 1e-3;
// In such a tick the chain has let go of the hand, which has to be engaged anew.
constexpr std::uint32_t let_go = disengaged | input_refused | direction_refused;
// What also ends the support of a handle's weight at once.
constexpr std::uint32_t no_support =
    input_refused | hand_too_fast | stalled | fault_latched | output_refused;

}  // namespace

// Hazard: bad-settings
void validate(const ServoSettings& settings) {
  validate(settings.parameters);
  validate(settings.safety);
  validate(settings.placement);
}

Cycle::Cycle(std::shared_ptr<Method> method, Device& device, const ServoSettings& settings,
             std::size_t ring)
    : Cycle(std::move(method), device, ServoCommands{.settings = settings}, ring) {}

Cycle::Cycle(std::shared_ptr<Method> method, Device& device, const ServoCommands& commands,
             std::size_t ring)
    : first_method_(std::move(method)),
      method_(first_method_.get()),
      first_fixtures_(commands.settings.fixtures),
      device_(device),
      safety_(device.info().limits, commands.settings.safety),
      workspace_(commands.settings.placement),
      parameters_(commands.settings.parameters),
      newest_change_{commands, first_method_},
      ring_(ring),
      scene_(commands.scene),
      on_hold_(commands.hold) {
  if (method_ == nullptr) throw Error("method", "there is none", "give one");
  validate(commands.settings);
  newest_change_.commands.number = 0;
  method_->set_parameters(parameters_);
  fixtures_.use(first_fixtures_.get());
}

std::uint64_t Cycle::put_frame(std::shared_ptr<const Cloud> cloud, double stamp, double now) {
  const CameraFrame camera{.camera = 0, .stamp = stamp};
  return put_frame(std::move(cloud), stamp, {&camera, 1}, now);
}

std::uint64_t Cycle::put_frame(std::shared_ptr<const Cloud> cloud, double stamp,
                               std::span<const CameraFrame> cameras, double now) {
  if (!cloud) throw Error("frame", "it has no cloud", "put only frames that hold something");
  if (cameras.empty() || cameras.size() > Freshness::max_cameras) {
    throw Error("frame", "it is of " + std::to_string(cameras.size()) + " cameras",
                "name 1 to " + std::to_string(Freshness::max_cameras) + " cameras");
  }
  CapturedFrame frame{.cloud = std::move(cloud), .stamp = stamp, .put_at = now};
  for (const CameraFrame& camera : cameras) {
    if (camera.camera >= Freshness::max_cameras) {
      throw Error("frame", "there is no camera " + std::to_string(camera.camera),
                  "number cameras from 0 to " + std::to_string(Freshness::max_cameras - 1));
    }
    frame.cameras[frame.camera_count++] = camera;
  }
  frame.number = ++frames_put_;
  frames_[cameras.front().camera].put(std::move(frame));
  return frames_put_;
}

ServoCommands Cycle::command(const std::function<void(ServoCommands&)>& edit,
                             std::shared_ptr<Method> method) {
  const std::lock_guard lock(writers_);
  ServoCommands commands = newest_change_.commands;
  edit(commands);
  validate(commands.settings);
  commands.number = newest_change_.commands.number + 1;
  if (method) {
    method->set_parameters(commands.settings.parameters);
    newest_change_.method = std::move(method);
  }
  newest_change_.commands = commands;
  changes_.put(newest_change_);
  return commands;
}

std::uint64_t Cycle::set_settings(const ServoSettings& settings) {
  return command([&](ServoCommands& commands) { commands.settings = settings; }).number;
}

ServoCommands Cycle::commands() const {
  const std::lock_guard lock(writers_);
  return newest_change_.commands;
}

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
HandState Cycle::read_hand(double t) noexcept {
  HandState hand = device_.read(t);
  if (hand.fault == DeviceFault::none &&
      std::any_of(others_.begin(), others_.end(),
                  [&](const auto& other) { return is_in_trouble(*other, t, silence_); }))
    hand.fault = DeviceFault::another_hand;
  return hand;
}

// Hazard: scene-jumps, method-switched
// The proxy is all that another method is told of the one before. True if it is another.
bool Cycle::adopt_change(const Change& change) noexcept {
  const ServoSettings& settings = change.commands.settings;
  const bool switched = change.method.get() != method_;
  method_ = change.method.get();
  safety_.set_parameters(settings.safety);
  parameters_ = settings.parameters;
  method_->set_parameters(parameters_);
  fixtures_.use(settings.fixtures.get());
  if (workspace_.placement() != settings.placement) {
    workspace_.place(settings.placement);
    placement_changed_ = number_ > 0;
  }
  if (std::exchange(scene_, change.commands.scene) != change.commands.scene)
    placement_changed_ = number_ > 0;
  on_hold_ = change.commands.hold;
  if (!switched) return false;
  if (number_ > 0) method_->seat(last_proxy_);
  last_normal_ = Vec3::Zero();
  return true;
}

template <class Way, class Self>
void Cycle::walk(Way& way, Self& self) {
  way("number", self.number_);
  way("last_proxy", self.last_proxy_);
  way("frame_stamp", self.last_stamp_);
  for (int i = 0; i < 4; ++i) way("orientation", self.last_orientation_.coeffs()[i]);
  SafetyChain::walk(way, self.safety_);
  Workspace::walk(way, self.workspace_);
  Freshness::walk(way, self.freshness_);
  PassivityObserver::walk(way, self.passivity_);
  FixtureStage::walk(way, self.fixtures_);
  WeightSupport::walk(way, self.support_);
  LastGate::walk(way, self.gate_);
}

std::vector<std::string> cycle_state_names() {
  struct {
    std::uint64_t number_ = 0;
    Vec3 last_proxy_ = Vec3::Zero();
    double last_stamp_ = 0.0;
    Rotation last_orientation_ = Rotation::Identity();
    SafetyChain safety_{};
    Workspace workspace_{};
    Freshness freshness_{};
    PassivityObserver passivity_{};
    FixtureStage fixtures_{};
    WeightSupport support_{};
    LastGate gate_{};
  } memory;
  NameNumbers name;
  Cycle::walk(name, memory);
  return std::move(name.names);
}

void Cycle::restore(const CycleState& state, std::span<const FrameInUse> frames) {
  GetNumbers get(
      std::span(state.numbers).first(std::min<std::size_t>(state.count, CycleState::capacity)),
      "state of the cycle");
  walk(get, *this);
  if (!get.at_end())
    throw Error("state of the cycle", "has too many numbers",
                "it may be damaged, or of another version of palpate");
  for (const FrameInUse& frame : frames) {
    CapturedFrame kept{.cloud = frame.cloud, .stamp = frame.stamp, .camera_count = 1};
    kept.cameras[0] = {.camera = frame.camera, .stamp = frame.stamp};
    frames_[frame.camera].put(std::move(kept));
    static_cast<void>(frames_[frame.camera].take());
    seen_.take(frame.camera, *frame.cloud);
  }
}

// For whoever records.
void Cycle::tell_of(const CapturedFrame& frame) noexcept {
  adopted_.push({.number = frame.number,
                 .stamp = frame.stamp,
                 .put_at = frame.put_at,
                 .cameras = frame.cameras,
                 .camera_count = frame.camera_count,
                 .tick = taken_in_[frame.cameras[0].camera]});
}

// Frames that came since the tick before, in the order of their stamps. A method that takes over
// gets what is in use of the other cameras, too. True if one came.
bool Cycle::adopt_frames(bool method_switched, double t) noexcept {
  struct Due {
    double stamp;  // [s]
    const CapturedFrame* frame;
    bool is_new;
  };
  std::array<Due, Freshness::max_cameras> due;
  std::size_t count = 0;
  bool any_new = false;
  for (auto& mailbox : frames_) {
    const CapturedFrame* frame = mailbox.take();
    const bool is_new = frame != nullptr;
    if (!is_new && method_switched && mailbox.taken_last().cloud) frame = &mailbox.taken_last();
    if (frame == nullptr) continue;
    any_new = any_new || is_new;
    const double stamp =
        std::isfinite(frame->stamp) ? frame->stamp : -std::numeric_limits<double>::infinity();
    due[count++] = {stamp, frame, is_new};
  }
  std::sort(due.begin(), due.begin() + count, [](const Due& a, const Due& b) {
    return a.stamp != b.stamp ? a.stamp < b.stamp
                              : a.frame->cameras[0].camera < b.frame->cameras[0].camera;
  });
  for (const Due& each : std::span(due.data(), count)) {
    const CapturedFrame& frame = *each.frame;
    method_->observe({*frame.cloud, frame.stamp, frame.cameras[0].camera});
    if (each.is_new)
      adopt_frame(frame, t);
    else
      tell_of(frame);  // a recording may begin here
  }
  return any_new;
}

void Cycle::adopt_frame(const CapturedFrame& frame, double t) noexcept {
  const std::size_t camera = frame.cameras[0].camera;
  seen_.take(camera, *frame.cloud);
  taken_in_[camera] = number_;
  // Arrived when it was put; if that is not on the loop's clock, now.
  const double arrived = frame.put_at <= t ? frame.put_at : t;
  freshness_.adopt({frame.cameras.data(), frame.camera_count}, arrived,
                   safety_.parameters().future_tolerance);
  last_stamp_ = frame.stamp;
  frame_number_ = std::max(frame_number_, frame.number);
  tell_of(frame);
  add(statistics_.frames_adopted, 1);
  std::uint64_t dropped = 0;
  for (const auto& mailbox : frames_) dropped += mailbox.dropped();
  statistics_.frames_dropped.store(dropped, std::memory_order_relaxed);
  statistics_.hand_over.add(nanoseconds(t - frame.put_at));
}

// What a tick knows, from stage to stage.
struct Cycle::Now {
  double t;  // [s]
  HandState hand;
  bool switched = false;   // another method
  bool reset = false;      // latched faults
  bool new_frame = false;  // of any camera
  bool jumped = false;     // where the hand is in the scene has changed at once, or the scene has
  bool reseated = false;   // the proxy
  HandPose pose{};         // world
  Vec3 turned = Vec3::Zero();  // [rad] world: by the handle since the tick before
  bool holds = false;          // does a hand hold the device, that may be pushed?
  bool may_hold = false;       // may the weight of the handle be borne?
  Tick tick{};
  FixtureOutput fixtures{};
  Freshness::Age age{};
  SafetyOutput safe{};
  double most_force = 0.0;  // [N]
  double support = 0.0;     // [N] of the handle's weight
  // What was sent.
  Vec3 force = Vec3::Zero();   // [N] world
  Vec3 torque = Vec3::Zero();  // [N m] world
  Wrench wrench{};             // device frame, with the weight's support
  std::uint32_t flags = 0;     // SafetyFlag bits
};

void Cycle::run(const Wake& wake) noexcept {
  Now now{.t = wake.t, .hand = read_hand(wake.t)};
  adopt(now);
  touch(now);
  protect(now);
  send(now);
  keep(now, wake);
}

// What came since the tick before: commands, resets, frames.
void Cycle::adopt(Now& now) noexcept {
  const Change* change = changes_.take();
  if (change != nullptr && change->method.get() != method_) {
    CycleState state;
    PutNumbers put(state.numbers);
    walk(put, *this);
    state.count = put.count();
    states_.push(state);
  }
  now.switched = change != nullptr && adopt_change(*change);
  now.hand.clutched = workspace_.is_clutched(now.hand);
  const std::uint64_t resets = fault_resets_.load(std::memory_order_relaxed);
  now.reset = std::exchange(fault_resets_done_, resets) != resets;
  if (now.reset) safety_.reset();
  now.new_frame = adopt_frames(now.switched, now.t);
  now.jumped = std::exchange(placement_changed_, false);
}

// What the hand feels of the scene and of the fixtures. After a jump or a stall the hand is
// disengaged, and the proxy starts again on the free side.
void Cycle::touch(Now& now) noexcept {
  const HandState& hand = now.hand;
  const double t = now.t;
  now.pose = {.position = workspace_.hip_in_world(hand, t),
              .orientation = workspace_.orientation_in_world(hand)};
  const bool sees = !seen_.parts().empty();
  if (sees && (safety_.stalls_at(t) || now.jumped)) {
    now.reseated = true;
    method_->seat(free_side(seen_, last_proxy_, last_normal_, parameters_.proxy.r_c(), patch_));
  }
  if (!now.jumped && number_ > 0)
    now.turned = rotation_vector(between(now.pose.orientation, last_orientation_));
  last_orientation_ = now.pose.orientation;
  const Tick& tick = now.tick = method_->tick(now.pose, t);
  last_proxy_ = tick.proxy;
  last_normal_ = tick.normal;
  now.holds = hand.present && !hand.clutched && !is_faulty(hand) && !now.jumped && !on_hold_;
  now.fixtures = fixtures_.run({.t = t,
                                .hip = now.pose.position,
                                .surface_force = tick.force - tick.transient,
                                .surface_motion = tick.surface_motion,
                                .hand = now.holds && !safety_.stalls_at(t),
                                .cloud = sees ? &seen_ : nullptr,
                                .new_frame = now.new_frame});
  workspace_.feel(tick.force + now.fixtures.region);
}

// What the safety chain allows of that, and of the handle's weight.
void Cycle::protect(Now& now) noexcept {
  const HandState& hand = now.hand;
  const Tick& tick = now.tick;
  const FixtureOutput& fixtures = now.fixtures;
  const bool held = hand.present && !is_faulty(hand) && hand.position.allFinite();
  const DeviceLimits& limits = device_.info().limits;
  now.most_force = std::min(safety_.parameters().max_force, limits.max_force);
  now.may_hold = held && !now.jumped && !on_hold_ && safety_.latched_by() == 0;
  now.support = support_.run(now.t, gravity * workspace_.placement().handle_weight,
                             std::min(now.most_force, limits.continuous_force), now.may_hold);

  const Freshness::Age& age = now.age = freshness_.at(now.t);
  now.safe = safety_.run(
      {.t = now.t,
       .force = fixtures.region.isZero() ? tick.force : Vec3(fixtures.surface + tick.transient),
       .hip = now.pose.position,
       .proxy = tick.proxy,
       .normal = tick.normal,
       .position = hand.position,
       .hand = now.holds,
       .frame_age = age.age,
       .frame_intervals = age.intervals,
       .surface_velocity = tick.surface_velocity,
       .surface_motion = tick.surface_motion,
       .torque = tick.torque,
       .turned = now.turned,
       .held = now.support,
       .transient = tick.transient,
       .vibration = tick.vibration,
       .region = fixtures.region,
       .guidance = fixtures.guidance,
       .scale_unsure = seen_.scale_unsure()});
  if ((now.safe.flags & no_support) != 0) {
    support_.release();
    now.support = 0.0;
  }
  // A surface's force that has yet to shrink is not added to: together they keep the limit.
  now.support = std::max(std::min(now.support, now.most_force - now.safe.force.norm()), 0.0);
}

// Through the last gate to the device.
void Cycle::send(Now& now) noexcept {
  const SafetyOutput& safe = now.safe;
  const Freshness::Age& age = now.age;
  const Placement& placement = workspace_.placement();
  const SafetyParameters& allowed = safety_.parameters();
  const DeviceLimits& limits = device_.info().limits;
  const Vec3 wanted = workspace_.force_in_device(safe.force);
  const Vec3 wanted_torque = workspace_.force_in_device(safe.torque);
  const double torque_share = limits.max_torque / limits.max_force;  // [m]
  const LastGate::Sent sent =
      gate_.write(device_,
                  {.t = now.t,
                   .force = gate_vector(wanted),
                   .torque = gate_vector(wanted_torque),
                   .held = gate_vector(-now.support * placement.down),
                   .ring = safe.ring,
                   .frame_age = age.age,
                   .lost_age = allowed.lost_age,
                   .frame_intervals = age.intervals,
                   .late_intervals = allowed.late_intervals,
                   .force_bounds = {now.most_force, allowed.rise_rate, allowed.fall_rate},
                   .torque_bounds = {limits.max_torque, torque_share * allowed.rise_rate,
                                     torque_share * allowed.fall_rate},
                   .ramp_time = allowed.ramp_time,
                   .longest_gap = allowed.stall_time,
                   .longest_time = longest_tick,
                   .engaged = (safe.flags & let_go) == 0,
                   .hand = now.holds,
                   .latched = safety_.latched_by() != 0,
                   .may_hold = now.may_hold},
                  now.t);
  // In the world as it was asked for, to the bit, where the gate did nothing.
  now.force =
      sent.force == wanted ? safe.force : Vec3(placement.world_from_device.linear() * sent.force);
  now.torque = sent.wrench.torque == wanted_torque
                   ? safe.torque
                   : Vec3(placement.world_from_device.linear() * sent.wrench.torque);
  now.wrench = sent.wrench;
  now.flags = safe.flags;
  if ((sent.verdict & palpate_gate_refused) != 0) now.flags |= output_refused;
  if (now.force != safe.force || now.torque != safe.torque) add(statistics_.gate_cuts, 1);
}

// The tick for whoever reads.
void Cycle::keep(const Now& now, const Wake& wake) noexcept {
  const HandState& hand = now.hand;
  const Vec3& hip = now.pose.position;
  const Placement& placement = workspace_.placement();
  const ServoEnergy& energy =
      passivity_.run({.t = now.t,
                      .handle = placement.world_from_device.linear() * hand.position,
                      .hip = hip,
                      .scale = placement.workspace_scale,
                      .surface = now.tick.surface_motion,
                      .jumped = now.jumped,
                      .sent = now.force,
                      .torque = now.torque,
                      .turned = now.turned});

  Vec3 kept_out = now.fixtures.displacement;
  join(now.tick.proxy - hip, kept_out);
  const ServoTick record{.tick = now.tick,
                         .region = now.fixtures.region,
                         .guidance = now.fixtures.guidance,
                         .place = hip + kept_out,
                         .force = now.force,
                         .torque = now.torque,
                         .position = hand.position,
                         .handle = hand.orientation.value_or(Eigen::Quaterniond::Identity()),
                         .gain = now.safe.gain,
                         .energy = energy,
                         .frame_stamp = last_stamp_,
                         .frame_age = now.age.age,
                         .number = number_++,
                         .frame_number = frame_number_,
                         .settings_number = changes_.taken_last().commands.number,
                         .safety = now.flags,
                         .wake_up_ns = wake.wake_up_ns,
                         .previous_compute_ns = wake.previous_compute_ns,
                         .fixtures = now.fixtures.acting,
                         .hand = hand_bits(hand) | (now.reseated ? proxy_reseated : 0U) |
                                 (now.switched ? method_switched : 0U) |
                                 (now.reset ? faults_reset : 0U) | (on_hold_ ? force_on_hold : 0U)};
  ring_.push(record);
  keep_statistics(record, now.wrench);
}

void Cycle::keep_statistics(const ServoTick& record, const Wrench& wrench) noexcept {
  statistics_.last_t.store(record.tick.t, std::memory_order_relaxed);
  add(statistics_.ticks, 1);
  statistics_.hand.store(record.hand, std::memory_order_relaxed);
  statistics_.safety.store(record.safety, std::memory_order_relaxed);
  statistics_.force_out.store(!wrench.force.isZero(0.0) || !wrench.torque.isZero(0.0),
                              std::memory_order_relaxed);
  for (std::size_t i = 0; i < safety_flag_count; ++i) {
    statistics_.interventions[i].store(safety_.interventions()[i], std::memory_order_relaxed);
  }
  statistics_.latched_by.store(safety_.latched_by(), std::memory_order_relaxed);
  statistics_.heat.store(safety_.heat(), std::memory_order_relaxed);
}

}  // namespace palpate
