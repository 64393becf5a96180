// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "palpate/net/telelink/topics.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/net/teleop/touched.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// Options of the operator's end.
struct OperatorEndOptions {
  std::string name = "robot";  ///< of the robot's topics
  /// The scene is shifted at the start, so that the device starts at the tool, whatever its
  /// handle's orientation is.
  bool index = true;
  /// Stiffness and friction measured by the robot become the material of the surface there; see
  /// paint_touched.
  bool learn = false;
};

/// The robot's state at the operator's end.
struct RobotView {
  std::optional<RobotState> state;  ///< last received; its time is that of arrival
  double age = 0.0;                 ///< [s] since then
  bool heard = false;               ///< lately
  bool led = false;                 ///< commands are being sent
  double latency = 0.0;             ///< [s] of the rendered frame, capture to arrival
  std::optional<Touched> touched;   ///< its last contact measurement, accepted or not
  std::string ignored;              ///< why the measurement was ignored; empty: it was used
};

/// The operator's end: sends the proxy's pose in a session to the robot, and adds the robot's
/// limits to the session as fixtures. The session's first camera is the robot's,
/// `ros2:/NAME/depth/image_raw/slices`. A tool with a shape is given as the robot's end has it, and
/// is held in the hand so that it is turned as the robot's.
///
/// Nothing is sent without a valid command (lead_of), so that a robot stops with its operator in
/// any failure. The network latency alone does not fade the force: the age limits follow it
/// (for_link), unless the user sets them.
class OperatorEnd {
 public:
  /// @param session  must outlive this
  /// @throws Error if the name is not valid, or DDS is missing.
  OperatorEnd(Session& session, const OperatorEndOptions& options);
  ~OperatorEnd();

  [[nodiscard]] RobotView robot() const;
  [[nodiscard]] std::uint32_t domain() const { return participant_.domain(); }

 private:
  void run();  // the thread
  void send(double now);
  void bring_to_hand();
  void hear(double now);
  void use_regions(const std::string& json);
  void follow_latency();
  void turn_shape();

  Session& session_;
  const std::string name_;
  bool index_;  // still to be done
  const bool learns_;
  TickRing<ServoTick>::Reader ticks_;
  ServoTick tick_;
  const SafetyParameters given_;
  // From the handle to what the tool is to turn by: of the thread.
  Rotation begin_ = Rotation::Identity();
  std::optional<Rotation> found_;  // world_from_tool, when the robot's end began
  std::shared_ptr<const ToolShape> given_tool_, turned_tool_;
  Rotation device_from_tool_ = Rotation::Identity();  // by which that was turned
  double followed_ = 0.0;  // [s] the latency that the session's limits are for
  mutable std::mutex mutex_;
  RobotView view_;  // guarded by it
  dds::Participant participant_;
  dds::Writer places_, presses_;
  FromRobot<dds::Reader> hears_;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace palpate
