// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/net/teleop/led_hand.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/net/teleop/set_point.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// Options of the robot's end.
struct RobotEndOptions {
  std::string name = "robot";  ///< of its topics: /NAME/...
  DepthPacking packing = DepthPacking::rvl;
  double margin = SetPointOptions{}.margin;  ///< [m] as SetPointOptions
  double press_share = 0.0;                  ///< [-] as SetPointOptions
  /// Forbidden regions of the robot, also sent to operators; null: only its workspace.
  std::shared_ptr<const FixtureSet> fixtures = {};
};

/// The robot's end: publishes the camera, receives commands, moves the robot.
///
/// A session here has the led hand as its device and the robot's cameras; its proxy, which they
/// keep out of what they see, is where the tool goes (SetPoint). Topics, all of ROS's own types: in
/// /NAME/teleop/place (PoseStamped), /NAME/teleop/press (WrenchStamped); out /NAME/teleop/tool
/// (PoseStamped), twist (TwistStamped), contact (WrenchStamped), links
///     (Float64MultiArray: x, y, z of each joint), fault (String), regions (String: fixtures as
///     JSON), /NAME/joint_states (JointState), and the camera's (Ros2CameraPublisher).
class RobotEnd {
 public:
  /// Waits up to 5 s for the robot's first state.
  /// @throws Error if the robot reports nothing, an option is out of range, or DDS is missing.
  RobotEnd(std::unique_ptr<Robot> robot, const RobotEndOptions& options);
  ~RobotEnd();  ///< the robot rests

  /// Adds what the session here needs: its device, radius of the proxy, fixtures. Once.
  void prepare(SessionOptions& options) const;
  /// For SessionOptions::on_frame.
  void on_frame(std::size_t camera, const FedFrame& frame);
  /// Starts to command the robot. The session must outlive this, or `detach` come first.
  void attach(Session& session);
  void detach();

  [[nodiscard]] const RobotInfo& info() const;
  [[nodiscard]] std::uint32_t domain() const;
  /// The robot's last state; `fault` reports a missing command.
  [[nodiscard]] RobotState state() const;
  [[nodiscard]] bool is_led() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate
