// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "palpate/net/teleop/approach_watch.hpp"
#include "palpate/net/teleop/led_hand.hpp"
#include "palpate/net/teleop/set_point.hpp"

namespace palpate {

/// What the cameras at a robot's end see about its tool.
struct Outlook {
  Approach comes;  ///< the fastest of all, with the noise of the noisiest camera
  double clearance = ApproachWatch::reach;  ///< [m] from the tool to the nearest point
  bool is_lost = false;  ///< all of them see a surface between the tool and its proxy
};

/// @param watches  one a camera
/// @param proxy, tool  [m, world]
/// @param radius       [m] of the tool
/// @param now          [s]
Outlook outlook(std::span<ApproachWatch> watches, const Vec3& proxy, const Vec3& tool,
                double radius, double now) noexcept;

/// The step by which a robot's end leads its tool, with or without a network: from a tick of the
/// session there to the next command. Values in, values out: no clock, no thread.
class RobotStep {
 public:
  /// @param hand  the session's device; must outlive this
  RobotStep(LedHand& hand, const SetPointOptions& options)
      : hand_(hand), set_point_(options), radius_(options.tool_radius) {}

  /// @param tick   of the session; without a contact and with the proxy at the tool if it is lost
  /// @param press  [N] world: with which the operator presses
  /// @param at     where the robot is; its force becomes that without the sensor's error
  /// @param now    [s]
  SetPoint::Order next(ServoTick& tick, const Outlook& outlook, const Vec3& press, RobotState& at,
                       double now) noexcept;
  /// Did the last step follow the operator?
  [[nodiscard]] bool is_led() const { return led_; }

 private:
  static constexpr double blind_after = 0.2;  // [s] without a frame nothing is led

  LedHand& hand_;
  SetPoint set_point_;
  ForceZero force_zero_;
  double radius_;  // [m] of the tool
  bool led_ = false;
};

}  // namespace palpate
