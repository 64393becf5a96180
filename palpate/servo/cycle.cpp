// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "palpate/core/error.hpp"
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

bool is_faulty(const HandState& hand) noexcept {
  return hand.fault != DeviceFault::none;
}

std::uint32_t hand_bits(const HandState& hand) noexcept {
  return (hand.present ? hand_present : 0U) | (hand.clutched ? hand_clutched : 0U) |
         (is_faulty(hand) ? hand_fault : 0U) |
         (static_cast<std::uint32_t>(hand.fault) << hand_fault_shift);
}

}  // namespace

void validate(const ServoSettings& settings) {
  validate(settings.rendering);
  validate(settings.safety);
  validate(settings.placement);
}

Cycle::Cycle(std::unique_ptr<Rendering> rendering, Device& device, const ServoSettings& settings,
             std::size_t ring)
    : first_rendering_(std::move(rendering)),
      rendering_(first_rendering_.get()),
      device_(device),
      safety_(device.info().limits, settings.safety),
      workspace_(settings.placement),
      parameters_(settings.rendering),
      ring_(ring) {
  validate(settings);
  rendering_->set_parameters(settings.rendering);
}

std::uint64_t Cycle::put_frame(std::shared_ptr<const Cloud> cloud, double stamp, double now) {
  if (!cloud) throw Error("frame", "it has no cloud", "put only frames that hold something");
  return frames_.put({std::move(cloud), stamp, now});
}

std::uint64_t Cycle::set_settings(const ServoSettings& settings) {
  validate(settings);
  const std::lock_guard lock(writers_);
  return settings_.put(settings);
}

void Cycle::renew(std::shared_ptr<Rendering> rendering) {
  if (!rendering) throw Error("renderer", "there is none", "give one");
  const std::lock_guard lock(writers_);
  renewals_.put(std::move(rendering));
}

void Cycle::adopt_settings(const ServoSettings& settings) noexcept {
  safety_.set_parameters(settings.safety);
  workspace_.place(settings.placement);
  parameters_ = settings.rendering;
  try {
    rendering_->set_parameters(settings.rendering);
  } catch (const Error&) {  // validated, so only a method with limits of its own comes here
    add(statistics_.settings_refused, 1);
  }
}

void Cycle::adopt_frame(const CapturedFrame& frame, double t) noexcept {
  rendering_->frame(*frame.cloud, frame.stamp);
  // A camera that repeats itself or whose clock runs elsewhere is not fresh, whatever arrives.
  constexpr double most_ahead = 1.0;  // [s]
  const double interval = frame.stamp - last_stamp_;
  const bool in_order = !has_frame_ || interval > 0.0;
  if (in_order && frame.stamp <= t + most_ahead) {
    fresh_stamp_ = frame.stamp;
    fresh_since_ = t;
    if (has_frame_) interval_ = std::min(interval, most_ahead);
  }
  has_frame_ = has_frame_ || std::isfinite(frame.stamp);
  last_stamp_ = frame.stamp;
  add(statistics_.frames_adopted, 1);
  statistics_.frames_dropped.store(frames_.dropped(), std::memory_order_relaxed);
  statistics_.hand_over.add(nanoseconds(t - frame.put_at));
}

// The proxy is all that a new renderer is told of the one before.
bool Cycle::adopt_rendering() noexcept {
  const std::shared_ptr<Rendering>* renewal = renewals_.take();
  if (renewal == nullptr) return false;
  rendering_ = renewal->get();
  try {
    rendering_->set_parameters(parameters_);
  } catch (const Error&) {
    add(statistics_.settings_refused, 1);
  }
  if (number_ > 0) rendering_->seat(last_proxy_);
  last_normal_ = Vec3::Zero();
  return true;
}

double Cycle::frame_age(double t) const noexcept {
  return has_frame_ ? std::max(t - fresh_stamp_, t - fresh_since_)
                    : std::numeric_limits<double>::infinity();
}

void Cycle::run(const Wake& wake) noexcept {
  const double t = wake.t;
  HandState hand = device_.read(t);
  if (const ServoSettings* settings = settings_.take()) adopt_settings(*settings);
  hand.clutched = workspace_.is_clutched(hand);
  const bool renewed = adopt_rendering();
  if (const CapturedFrame* frame = frames_.take()) {
    adopt_frame(*frame, t);
  } else if (const auto& in_use = frames_.taken_last(); renewed && in_use.cloud) {
    rendering_->frame(*in_use.cloud, in_use.stamp);
  }

  const Vec3 hip = workspace_.hip_in_world(hand);
  bool reseated = false;
  if (const auto& frame = frames_.taken_last(); frame.cloud && safety_.stalls_at(t)) {
    reseated = true;
    rendering_->seat(
        free_side(*frame.cloud, last_proxy_, last_normal_, parameters_.proxy.r_c(), patch_));
  }
  const Tick tick = rendering_->tick(hip, t);
  last_proxy_ = tick.proxy;
  last_normal_ = tick.normal;

  const double age = frame_age(t);
  const SafetyOutput safe = safety_.run({.t = t,
                                         .force = tick.force,
                                         .hip = hip,
                                         .proxy = tick.proxy,
                                         .normal = tick.normal,
                                         .position = hand.position,
                                         .hand = hand.present && !hand.clutched && !is_faulty(hand),
                                         .frame_age = age,
                                         .frame_interval = interval_});
  device_.write(workspace_.force_in_device(safe.force), t);

  const ServoTick record{.tick = tick,
                         .force = safe.force,
                         .position = hand.position,
                         .gain = safe.gain,
                         .frame_stamp = last_stamp_,
                         .frame_age = age,
                         .number = number_++,
                         .frame_number = frames_.number(),
                         .settings_number = settings_.number(),
                         .safety = safe.flags,
                         .wake_up_ns = wake.wake_up_ns,
                         .previous_compute_ns = wake.previous_compute_ns,
                         .hand = hand_bits(hand) | (reseated ? proxy_reseated : 0U) |
                                 (renewed ? rendering_renewed : 0U)};
  ring_.push(record);
  keep_statistics(record);
}

void Cycle::keep_statistics(const ServoTick& record) noexcept {
  add(statistics_.ticks, 1);
  add(statistics_.steps, static_cast<std::uint64_t>(std::max(record.tick.steps, 0)));
  if (record.tick.state != ContactState::free_motion) add(statistics_.contact_ticks, 1);
  if (has_frame_) statistics_.frame_age.add(nanoseconds(record.frame_age));
  statistics_.hand.store(record.hand, std::memory_order_relaxed);
  const double force = record.force.norm();
  if (force > statistics_.max_force.load(std::memory_order_relaxed))
    statistics_.max_force.store(force, std::memory_order_relaxed);
  for (std::size_t i = 0; i < safety_flag_count; ++i) {
    statistics_.interventions[i].store(safety_.interventions()[i], std::memory_order_relaxed);
  }
}

}  // namespace palpate
