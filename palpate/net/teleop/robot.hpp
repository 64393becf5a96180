// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/core/hand.hpp"

namespace palpate {

/// Properties of a teleoperated robot.
struct RobotInfo {
  std::string uri;   ///< as it was opened
  std::string kind;  ///< e.g. "simulated arm"
  /// [m] world: the box in which the tool may be; empty: not known
  std::optional<Eigen::AlignedBox3d> reach = {};
  double max_speed = 0.5;  ///< [m/s] of the tool that it can follow
  /// [s] lag of the tool behind a command at constant speed: 2 / w for a loop with the poles -w, -w
  double lag = 0.08;
  /// [N/m] stiffness of the tool against displacement; empty: unknown
  std::optional<double> stiffness = {};
  double max_force = 5.0;      ///< [N] with which the tool may press
  double tool_radius = 0.005;  ///< [m] of the ball at the tool's tip that touches
  std::vector<std::string> joint_names = {};
  bool turns = false;  ///< it follows orientations; else its tool keeps the one that it has
};

/// State that a robot reports.
struct RobotState {
  double t = 0.0;                ///< [s] time of this state, on the servo loop's clock
  Vec3 position = Vec3::Zero();  ///< [m] world: the centre of the ball at the tool's tip
  Rotation orientation = Rotation::Identity();  ///< world_from_tool, if it turns
  Vec3 velocity = Vec3::Zero();                 ///< [m/s] world
  Vec3 force = Vec3::Zero();                    ///< [N] world: contact force on the tool
  std::vector<double> joints = {};              ///< [rad], as RobotInfo::joint_names
  std::vector<Vec3> links = {};  ///< [m] world: the arm as a line from base to tip; may be empty
  std::string fault = {};        ///< why it does not move, with the remedy; empty: it moves
};

/// A robot that follows poses of its tool tip: an arm, simulated or real.
///
/// Functions may be called by one thread at a time.
class Robot {
 public:
  Robot() = default;
  virtual ~Robot() = default;  ///< leaves it at rest
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  [[nodiscard]] virtual const RobotInfo& info() const = 0;
  /// Commanded pose of the tool tip. Called several hundred times a second. A robot must stop
  /// by itself after 100 ms without a command.
  /// @param pose  [m] world, finite; the orientation is for robots that turn
  /// @param velocity [m/s] world, of the position: for feed-forward
  virtual void command(const HandPose& pose, const Vec3& velocity, double t) noexcept = 0;
  /// The newest state. Empty before the robot has reported one.
  [[nodiscard]] virtual std::optional<RobotState> state() = 0;
};

/// How a simulated tool turns: a critically damped loop of 4 Hz, which nothing touches.
struct SimulatedTurn {
  Rotation orientation = Rotation::Identity();  ///< world_from_tool
  Vec3 spin = Vec3::Zero();                     ///< [rad/s] world
  /// @param dt  [s] at most some milliseconds
  void follow(const Rotation& wanted, double dt) noexcept;
};

/// Model of a robot's tool: a ball with the moving mass, pulled by a critically damped spring, in
/// contact with surfaces that are stiff springs. Deterministic.
class SimulatedTool {
 public:
  struct Surface {
    double distance;  ///< [m] from it to the asked place; negative inside
    Vec3 normal;      ///< [-] unit, outward
  };
  /// The surface nearest to a place [m, world] at a time [s].
  using Surfaces = std::function<Surface(const Vec3& place, double t)>;

  static constexpr double mass = 3.0;               ///< [kg]
  static constexpr double radius = 5e-3;            ///< [m]
  static constexpr double surface_stiffness = 1e4;  ///< [N/m] of what it touches
  static double stiffness();                        ///< [N/m] of its own loop of 4 Hz
  static double damping();                          ///< [N s/m] of the same, critical
  /// [s] behind what moves steadily
  static double lag() { return damping() / stiffness(); }

  SimulatedTool(const Vec3& begin, Surfaces surfaces) : surfaces_(std::move(surfaces)), x_(begin) {}

  /// Led to a place for dt, its end at t [s].
  void lead_to(const Vec3& place, double t, double dt);
  /// Moved by a force [N].
  void push(const Vec3& force, double t, double dt);

  [[nodiscard]] const Vec3& place() const { return x_; }
  [[nodiscard]] const Vec3& velocity() const { return v_; }
  [[nodiscard]] const Vec3& contact() const { return contact_; }  ///< [N] of the surface on it
  [[nodiscard]] double depth() const { return depth_; }           ///< [m] in the surface

 private:
  template <class Force>
  void advance(const Force& force, double t, double dt);

  Surfaces surfaces_;
  Vec3 x_, v_ = Vec3::Zero(), contact_ = Vec3::Zero();
  double depth_ = 0.0;
};

}  // namespace palpate
