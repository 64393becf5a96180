// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "palpate/session/session.hpp"
#include "palpate/teleop/robot.hpp"
#include "palpate/teleop/touched.hpp"

namespace palpate {

/// What the operator's end of a link is told.
struct OperatorEndOptions {
  std::string name = "robot";  ///< of the robot's topics
  /// The scene is brought to the hand when it begins, so that the hand is where the tool is.
  bool index = true;
  /// What the robot's tool found out by touching becomes the material of the surface there; see
  /// paint_touched.
  bool learn = false;
};

/// The robot as its operator knows it.
struct RobotView {
  std::optional<RobotState> state;  ///< as it last said; its time is that of arrival
  double age = 0.0;                 ///< [s] since then
  bool heard = false;               ///< lately
  bool led = false;                 ///< leads are sent now
  double latency = 0.0;             ///< [s] of what is felt, capture to arrival
  std::optional<Touched> touched;   ///< what it last found out by touching, believed or not
  std::string ignored;              ///< why that changed nothing; empty: it did
};

/// The operator's end of a link: sends where the proxy of a session is to the robot, and what the
/// robot may not do to the session, as fixtures. The session's first camera is the robot's,
/// `ros2:/NAME/depth/image_raw/slices`.
///
/// Nothing is sent while no hand leads (lead_of), so that a robot stops with its operator, whatever
/// ends. What is old by the link alone is no reason for forces to fade: the limits of ages follow
/// the link's latency (for_link), unless somebody else sets them.
class OperatorEnd {
 public:
  /// @param session  must outlive this
  /// @throws Error if the name is none, or DDS is missing.
  OperatorEnd(Session& session, const OperatorEndOptions& options);
  ~OperatorEnd();

  [[nodiscard]] RobotView robot() const;
  [[nodiscard]] std::uint32_t domain() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate
