// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/mouse_device.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/parameters.hpp"

namespace palpate {
namespace {

constexpr double fastest_turn = 4.0;  // [rad/s] of the hand: brisk for a wrist

void check_place(const Vec3& place) {
  constexpr double farthest = 1e6;  // [m]
  if (place.allFinite() && place.cwiseAbs().maxCoeff() <= farthest) return;
  throw Error("mouse", "the position is not finite or beyond 1000 km", "give metres");
}

}  // namespace

MouseDevice::MouseDevice(const Vec3& start, double response, double max_speed, std::string uri,
                         double silence)
    : info_{.uri = std::move(uri), .kind = "mouse in the viewer", .limits = no_motors},
      start_(start),
      frequency_(2.0 / response),
      max_speed_(max_speed),
      silence_(silence),
      target_{.position = start, .present = false},
      position_(start) {
  check_place(start);
  check_range("mouse", "response", "s", 1e-3, 1.0, response);
  check_range("mouse", "max_speed", "m/s", 0.01, 10.0, max_speed);
  check_range("mouse", "silence", "s", 0.2, 60.0, silence);
}

void MouseDevice::aim(const MouseTarget& target) {
  check_place(target.position);
  const std::lock_guard lock(aimers_);
  targets_.put(target);
}

// Hazard: silent-page
HandState MouseDevice::read(double t) noexcept {
  if (const MouseTarget* target = targets_.take()) {
    target_ = *target;
    aimed_t_.reset();
  }
  const double dt = last_t_ && t > *last_t_ ? t - *last_t_ : 0.0;
  if (std::isfinite(t)) {
    last_t_ = t;
    if (!aimed_t_) aimed_t_ = t;
    if (t - *aimed_t_ > silence_) target_.present = false;
  }

  // The exact solution over dt, from the distance e and the velocity.
  const Vec3 e = position_ - target_.position;
  const Vec3 drive = velocity_ + frequency_ * e;
  const double decay = std::exp(-frequency_ * dt);
  Vec3 move = (e + dt * drive) * decay - e;
  velocity_ = (velocity_ - frequency_ * dt * drive) * decay;

  const double speed = velocity_.norm();
  if (speed > max_speed_) velocity_ *= max_speed_ / speed;
  const double length = move.norm();
  if (length > max_speed_ * dt) move *= max_speed_ * dt / length;
  position_ += move;
  const Eigen::Quaterniond before = orientation_.value_or(Eigen::Quaterniond::Identity());
  orientation_ = target_.orientation;
  if (orientation_) {
    const double left = std::max(before.angularDistance(*orientation_), 1e-9);  // [rad]
    orientation_ = before.slerp(std::min(1.0 - decay, fastest_turn * dt / left), *orientation_);
  }
  return {.position = position_,
          .orientation = orientation_,
          .present = target_.present,
          .clutched = target_.clutched};
}

}  // namespace palpate
