// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "palpate/drivers/ros2_publisher.hpp"
#include "palpate/net/telelink/topics.hpp"
#include "palpate/net/teleop/approach_watch.hpp"
#include "palpate/net/teleop/led_hand.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/net/teleop/set_point.hpp"
#include "palpate/net/teleop/touched.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// Options of the robot's end.
struct RobotEndOptions {
  std::string name = "robot";  ///< of its topics: /NAME/...
  DepthPacking packing = DepthPacking::rvl;
  double margin = SetPointOptions{}.margin;  ///< [m] as SetPointOptions
  double press_share = 0.0;                  ///< [-] as SetPointOptions
  /// What the robot touches with, as SessionSpec::tool, in the frame of its reported poses; the
  /// session at the robot keeps all of it out of what is seen. Empty: a ball.
  std::string tool = {};
  /// Forbidden regions of the robot, also sent to operators; null: only its workspace.
  std::shared_ptr<const FixtureSet> fixtures = {};
};

/// The robot's end: publishes the camera, receives commands, moves the robot.
///
/// A session here has the led hand as its device and the robot's cameras; its proxy, which they
/// keep out of what they see, is where the tool goes (SetPoint). Topics, all of ROS's own types: in
/// /NAME/teleop/place (PoseStamped, whose orientation is Lead::turn), /NAME/teleop/press
/// (WrenchStamped); out /NAME/teleop/tool and found (PoseStamped: now, and at first), twist
/// (TwistStamped), contact (WrenchStamped), links
///     (Float64MultiArray: x, y, z of each joint), fault (String), regions (String: fixtures as
///     JSON), /NAME/joint_states (JointState), and the camera's (Ros2CameraPublisher).
class RobotEnd {
 public:
  /// Waits up to 5 s for the robot's first state.
  /// @throws Error if the robot reports nothing, an option is out of range, a tool with a shape is
  ///         of a robot that does not turn, or DDS is missing.
  RobotEnd(std::shared_ptr<Robot> robot, const RobotEndOptions& options);
  ~RobotEnd();  ///< the robot rests

  /// Adds what the session here needs: its device, radius of the proxy, fixtures. Once.
  void prepare(SessionOptions& options) const;
  /// For SessionOptions::on_frame.
  void on_frame(std::size_t camera, const FedFrame& frame);
  /// Starts to command the robot. The session must outlive this, or `detach` come first.
  void attach(Session& session);
  void detach();

  [[nodiscard]] const RobotInfo& info() const { return robot_->info(); }
  [[nodiscard]] std::uint32_t domain() const { return participant_.domain(); }
  /// The robot's last state; `fault` reports a missing command.
  [[nodiscard]] RobotState state() const;
  [[nodiscard]] bool is_led() const { return hand_->is_led(); }

 private:
  void lead();  // the leading thread
  void hear(double now);
  void order(double now);
  void report(double now);
  void say(const std::string& fault);

  std::shared_ptr<Robot> robot_;
  mutable std::mutex mutex_;  // of state_ and watches_
  RobotState state_;
  std::vector<ApproachWatch> watches_;  // one a camera
  const std::shared_ptr<const FixtureSet> regions_;
  const RobotEndOptions options_;
  const double tool_reach_;  // [m] of a tool with a shape; 0: a ball
  std::shared_ptr<LedHand> hand_;
  RobotStep step_;  // of the leading thread
  Ros2CameraPublisher publisher_;
  dds::Participant participant_;
  dds::Reader places_, presses_;
  FromRobot<dds::Writer> says_;
  // Of the leading thread
  TouchLearner learner_;
  Vec3 contact_ = Vec3::Zero();  // [N] without what the sensor shows in free space
  Lead lead_;
  std::int64_t heard_ = 0;  // [ns] stamp of the newest place
  std::string said_;
  std::optional<TickRing<ServoTick>::Reader> ticks_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace palpate
