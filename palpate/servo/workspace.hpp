// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "palpate/servo/device.hpp"
#include "palpate/servo/placement.hpp"

namespace palpate {

/// [m, device] Beyond a bubble's radius the speed grows with the square of the distance over this
/// length: a fifth to a quarter of what a Touch or an omega reaches.
constexpr double bubble_rim = 0.02;

/// Brings hands into the world and forces back, and remembers what clutch and bubble have shifted.
///
/// The bubble is that of Dominjon et al. 2005, but for its wall, which one feels there. Its rate
/// control moves the HIP without a step in place or speed, and never into the surface that it
/// touches: the force is as continuous as the hand. [servo]
class Workspace {
 public:
  explicit Workspace(const Placement& placement = {}) : placement_(placement) {}

  void place(const Placement& placement) noexcept { placement_ = placement; }
  [[nodiscard]] const Placement& placement() const noexcept { return placement_; }

  /// The HIP [m, world]. While the hand is clutched the HIP stays, and continues from there after.
  /// A position that is not finite, or absurd, gives a HIP that is not finite and leaves no trace.
  /// @param t  [s] now, on the loop's clock
  Vec3 hip_in_world(const HandState& hand, double t) noexcept {
    constexpr double farthest = 1e6;  // [m]
    if (!(hand.position.cwiseAbs().maxCoeff() <= farthest && hand.position.allFinite()))
      return Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
    constexpr double longest_step = 0.005;  // [s] after a stall
    const double since = t - std::exchange(last_t_, t);
    const double dt = since > 0.0 ? std::min(since, longest_step) : 0.0;  // 0 if it is no number
    if (hand.clutched) {
      shift_ = held_ - hand.position;
    } else {
      shift_ += dt * velocity_beyond_the_rim(hand);
      held_ = hand.position + shift_;
    }
    return placement_.world_from_device * Vec3(placement_.workspace_scale * held_);
  }

  /// world_from_handle. A handle whose device tells no orientation is aligned with the device;
  /// clutch and bubble do not change it.
  [[nodiscard]] Rotation orientation_in_world(const HandState& hand) const noexcept {
    const Rotation world_from_device(placement_.world_from_device.linear());
    const Rotation turned(world_from_device *
                          Rotation(hand.orientation.value_or(Eigen::Quaterniond::Identity())));
    return turned.coeffs().allFinite() ? turned : Rotation(Rotation::Identity());
  }

  /// Is the hand clutched, by the device or by the placement's button?
  [[nodiscard]] bool is_clutched(const HandState& hand) const noexcept {
    const auto& button = placement_.clutch_button;
    return hand.clutched || (button && ((hand.buttons.value_or(0U) >> *button) & 1U) != 0);
  }

  [[nodiscard]] Vec3 force_in_device(const Vec3& force_in_world) const noexcept {
    return placement_.world_from_device.linear().transpose() * force_in_world;
  }

  /// Tells which way the surface pushes: the method's force, zero where there is none.
  void feel(const Vec3& force_in_world) noexcept {
    const double size = force_in_world.norm();
    push_ = size > 0.0 && size < std::numeric_limits<double>::max()
                ? force_in_device(Vec3(force_in_world / size))
                : Vec3(Vec3::Zero());
  }

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("shift", self.shift_);
    way("held", self.held_);
    way("push", self.push_);
    way("last_t", self.last_t_);
  }

 private:
  // [m/s, device] of the HIP by itself.
  [[nodiscard]] Vec3 velocity_beyond_the_rim(const HandState& hand) const noexcept {
    constexpr double farthest = 10.0;  // [m, scene] no camera sees farther
    const double distance = hand.position.norm();
    const double beyond = distance - placement_.bubble_radius;
    if (placement_.bubble_radius == 0.0 || !(beyond > 0.0) || !hand.present ||
        hand.fault != DeviceFault::none)
      return Vec3::Zero();
    const double share = std::min(beyond / bubble_rim, 1.0);
    const double speed = share * share * placement_.bubble_speed / placement_.workspace_scale;
    Vec3 velocity = speed / distance * hand.position;
    velocity -= std::min(velocity.dot(push_), 0.0) * push_;
    const bool leaves = placement_.workspace_scale * held_.norm() > farthest;
    return leaves && velocity.dot(held_) > 0.0 ? Vec3(Vec3::Zero()) : velocity;
  }

  Placement placement_;
  Vec3 shift_ = Vec3::Zero();  // [m, device] what clutch and bubble have added to the position
  Vec3 held_ = Vec3::Zero();   // [m, device] the position that counts
  Vec3 push_ = Vec3::Zero();   // [-] device: which way a surface pushes, of length 1 or 0
  double last_t_ = 0.0;        // [s]
};

}  // namespace palpate
