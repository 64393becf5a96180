// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "palpate/io/sources/scene.hpp"
#include "palpate/kernel/core/registry.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/net/teleop/robot.hpp"

namespace palpate {

/// A type of robot, by the scheme of its URI.
struct RobotScheme {
  std::string name;     ///< the scheme
  std::string summary;  ///< one line
  std::function<std::unique_ptr<Robot>(const Uri&)> open;
};

/// The library's:
/// - `ros2:?command=/TOPIC&pose=/TOPIC`: a ROS 2 arm that accepts poses (docs/teleop.md has the
///   options);
/// - `point:`: a ball that follows like an arm with a loop of 4 Hz, without contacts, to test a
///   network without a robot.
Registry<RobotScheme> standard_robots();

/// A robot in a synthetic scene (SimulatedTool), which its camera sees. The scene moves as the
/// camera shows it, and does not yield.
class SceneRobot : public Robot {
 public:
  /// Where the scene stands in time, as the newest frame has it. Any thread.
  /// @param loop  [s] on the servo loop's clock @param scene  [s] the same instant, of the scene
  virtual void relate(double loop, double scene) = 0;
};
/// @param begin  [m] world: where the tool is at first
std::unique_ptr<SceneRobot> open_scene_robot(std::shared_ptr<const Scene> scene, const Vec3& begin,
                                             const std::string& uri);

/// @throws Error for an unknown scheme, or what the scheme throws.
std::unique_ptr<Robot> open_robot(const std::string& uri,
                                  const Registry<RobotScheme>& robots = standard_robots());

}  // namespace palpate
