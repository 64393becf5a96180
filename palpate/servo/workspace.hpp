// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <optional>

#include <Eigen/Geometry>

#include "palpate/servo/device.hpp"

namespace palpate {

/// How a device's workspace lies in the scene.
struct Placement {
  Eigen::Isometry3d world_from_device = Eigen::Isometry3d::Identity();
  /// [-] scene metres per device metre. Forces are not scaled, so the hand feels the coupling's
  /// stiffness times this: scale up and the limit of stability comes nearer.
  double workspace_scale = 1.0;
  /// Button of the device that clutches while it is pressed, 0 to 31; none: only the device's own
  /// clutch does.
  std::optional<int> clutch_button = {};

  bool operator==(const Placement& other) const {
    return world_from_device.matrix() == other.world_from_device.matrix() &&
           workspace_scale == other.workspace_scale && clutch_button == other.clutch_button;
  }
};

/// @throws Error if the pose is not rigid and finite, the scale is not in 0.001 to 1000 or the
///         button not in 0 to 31.
void validate(const Placement& placement);

/// Brings hands into the world and forces back, and remembers what the clutch has shifted. [servo]
class Workspace {
 public:
  explicit Workspace(const Placement& placement = {}) : placement_(placement) {}

  void place(const Placement& placement) noexcept { placement_ = placement; }
  [[nodiscard]] const Placement& placement() const noexcept { return placement_; }

  /// The HIP [m, world]. While the hand is clutched the HIP stays, and goes on from there after.
  /// A position that is not finite, or absurd, gives a HIP that is not finite and leaves no trace.
  Vec3 hip_in_world(const HandState& hand) noexcept {
    constexpr double farthest = 1e6;  // [m]
    if (!(hand.position.cwiseAbs().maxCoeff() <= farthest && hand.position.allFinite()))
      return Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
    if (hand.clutched) {
      shift_ = held_ - hand.position;
    } else {
      held_ = hand.position + shift_;
    }
    return placement_.world_from_device * Vec3(placement_.workspace_scale * held_);
  }

  /// Is the hand clutched, by the device or by the placement's button?
  [[nodiscard]] bool is_clutched(const HandState& hand) const noexcept {
    const auto& button = placement_.clutch_button;
    return hand.clutched || (button && ((hand.buttons.value_or(0U) >> *button) & 1U) != 0);
  }

  [[nodiscard]] Vec3 force_in_device(const Vec3& force_in_world) const noexcept {
    return placement_.world_from_device.linear().transpose() * force_in_world;
  }

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("shift", self.shift_);
    way("held", self.held_);
  }

 private:
  Placement placement_;
  Vec3 shift_ = Vec3::Zero();  // [m, device] what clutching has added to the hand's position
  Vec3 held_ = Vec3::Zero();   // [m, device] the position that counts
};

}  // namespace palpate
