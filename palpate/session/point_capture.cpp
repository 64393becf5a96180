// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/point_capture.hpp"

#include <chrono>
#include <mutex>
#include <string>
#include <thread>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/last_gate.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double rest_time = 0.5;     // [s] a device without buttons rests for so long
constexpr double rest_radius = 1e-3;  // [m] within this distance of where the rest began
constexpr double least_travel =
    0.01;  // [m] from the last point, or from the start, before the next

}  // namespace

std::optional<Vec3> PointCapture::add(const HandState& hand, double t) noexcept {
  if (!hand.present || hand.fault != DeviceFault::none || !hand.position.allFinite()) {
    rest_began_.reset();
    return std::nullopt;
  }
  const Vec3& position = hand.position;
  if (hand.buttons) {
    const std::uint32_t before = buttons_.value_or(*hand.buttons);
    buttons_ = hand.buttons;
    if ((*hand.buttons & ~before) == 0) return std::nullopt;
    return position;
  }
  if (!reference_) reference_ = position;
  travelled_ = travelled_ || (position - *reference_).norm() >= least_travel;
  if (!rest_began_ || (position - rest_at_).norm() > rest_radius) {
    rest_began_ = t;
    rest_at_ = position;
    sum_.setZero();
    count_ = 0.0;
  }
  sum_ += position;
  count_ += 1.0;
  if (!travelled_ || t - *rest_began_ < rest_time) return std::nullopt;
  const Vec3 point = sum_ / count_;
  reference_ = point;
  travelled_ = false;
  rest_began_.reset();
  return point;
}

std::vector<Vec3> capture_points(Device& device, std::size_t count, double timeout,
                                 const std::function<void(const Vec3&)>& captured) {
  constexpr double period = 1e-3;  // [s]
  std::mutex mutex;                // a device's callback may be on a thread of its own
  PointCapture capture;
  std::vector<Vec3> points;
  HandState last;
  const auto read = [&](double t) {
    const HandState hand = device.read(t);
    LastGate::write_zero(device, t);
    const std::lock_guard lock(mutex);
    last = hand;
    if (points.size() >= count) return;
    if (const auto point = capture.add(hand, t)) points.push_back(*point);
  };
  std::size_t told = 0;
  // Tells of new points; true when there are enough.
  const auto done = [&] {
    std::vector<Vec3> now;
    HandState hand;
    {
      const std::lock_guard lock(mutex);
      now = points;
      hand = last;
    }
    for (; told < now.size(); ++told) {
      if (captured) captured(now[told]);
    }
    if (hand.fault != DeviceFault::none) {
      const std::string text = device.fault_text();
      throw Error(device.info().uri, text.empty() ? std::string(describe(hand.fault)) : text);
    }
    return now.size() >= count;
  };
  const auto give_up = [&] {
    throw Error(device.info().uri,
                "only " + std::to_string(told) + " of " + std::to_string(count) +
                    " points were touched in time",
                "touch each point and rest there for half a second, or press a button of the "
                "device");
  };
  if (device.info().simulated) {
    for (double t = 0.0; !done(); t += period) {
      if (t > timeout) give_up();
      read(t);
    }
    return points;
  }
  const double end = monotonic_now() + timeout;
  if (device.drives()) {
    struct Stop {
      Device& device;
      ~Stop() { device.stop(); }
    } stop{device};
    device.start([&] { read(monotonic_now()); });
    while (!done()) {
      if (monotonic_now() > end) give_up();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    device.stop();
    return points;
  }
  while (!done()) {
    if (monotonic_now() > end) give_up();
    read(monotonic_now());
    std::this_thread::sleep_for(std::chrono::duration<double>(period));
  }
  return points;
}

}  // namespace palpate
