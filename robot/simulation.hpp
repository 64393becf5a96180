// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/io/sources/shapes.hpp"
#include "palpate/net/teleop/robot.hpp"

namespace palpate::robot {

/// How the plate moves: its top is at height + stroke/2 (1 - cos(2 pi frequency t)).
struct PlateMotion {
  double height = 0.03;    ///< [m] of its top, lowest
  double stroke = 0.0;     ///< [m] from lowest to highest
  double frequency = 0.5;  ///< [Hz]
};

/// @throws Error naming the first number that is out of range.
void validate(const PlateMotion& plate);

/// Limits of the arm and how the cell begins.
struct SimulationSetup {
  PlateMotion plate;
  double max_force = 8.0;  ///< [N] with which the resting tool presses at most
  double max_speed = 0.5;  ///< [m/s] of the tool's tip
  double hole = 0.015;     ///< [m] side of the square hole in the board
  /// [N/m] of the plate's skin, into which the tip sinks: no camera sees that. Empty: hard
  std::optional<double> plate_stiffness = {};
};

/// A body's geometry as a camera sees it.
struct VisibleGeom {
  Shape shape;
  std::size_t body;                   ///< index into BodyPoses::world_from_body
  Eigen::Isometry3d body_from_shape;  ///< rests in the body
  bool of_arm;
  bool rests;  ///< never moves
};

/// Where all bodies are, at one time.
struct BodyPoses {
  double t = 0.0;  ///< [s] on the simulation's clock
  std::vector<Eigen::Isometry3d> world_from_body;
};

/// What the simulation knows and a real cell would not tell.
struct Truth {
  double t = 0.0;                    ///< [s] on the simulation's clock
  Vec3 tip = Vec3::Zero();           ///< [m] world: centre of the ball at the tool's tip
  Vec3 tip_velocity = Vec3::Zero();  ///< [m/s] world
  Vec3 tip_force = Vec3::Zero();     ///< [N] world: on the tip's ball, unfiltered
  double penetration = 0.0;          ///< [m] deepest overlap of the tip's ball with anything, >= 0
  double plate_height = 0.0;         ///< [m] of its top
  /// [kg] with which the tip moves where it is heaviest; without bound where the arm is singular
  double apparent_mass = 0.0;
};

/// A robot cell in MuJoCo: an arm that follows positions, and things that it can touch and push.
///
/// Advances in steps of 1 ms: by a thread of its own in real time (`start`), when its clock is
/// monotonic_now(), or by its caller (`advance`), when its clock begins at 0 and equal calls give
/// equal states bit for bit. Functions may be called by any thread. Should MuJoCo fail, the cell
/// stands still from then on and the robot's state says why.
///
/// The arm is led by an impedance: its tip is drawn to a reference that follows the commands as a
/// critically damped second-order system does, limited in speed, and that never leads the tip by
/// more than what makes `max_force`; its orientation follows in the same way, at 2 rad/s at most.
/// 100 ms after the last command the tip stops, and is held by a soft spring.
class Simulation {
 public:
  static constexpr double command_timeout = 0.1;  ///< [s]
  static constexpr double history = 0.5;          ///< [s] for which past poses are kept

  /// @param mjcf  the model; see robot/models/desk.xml for what it has to name
  /// @throws Error if the model cannot be compiled or lacks a part, or a number is out of range.
  Simulation(std::string_view mjcf, const SimulationSetup& setup);
  explicit Simulation(const SimulationSetup& setup = {});
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  /// Runs in real time until `stop`. A machine that is too slow drops time beyond 50 ms.
  void start();
  void stop();
  [[nodiscard]] bool runs() const;

  /// Steps until the clock has reached t. Not while it runs in real time.
  void advance(double t);
  [[nodiscard]] double step_length() const;  ///< [s]

  [[nodiscard]] const RobotInfo& info() const;
  /// The tip's pose from the next step on; without effect unless it is one. One thread at a time;
  /// wait-free.
  void command(const HandPose& pose, const Vec3& velocity) noexcept;
  [[nodiscard]] RobotState state() const;

  [[nodiscard]] Truth truth() const;
  /// @throws Error if the model has no body of that name.
  [[nodiscard]] Eigen::Isometry3d pose(std::string_view body) const;
  /// Puts a free body somewhere, at rest. @throws Error if there is no free body of that name.
  void place(std::string_view body, const Eigen::Isometry3d& world_from_body);
  void set_plate(const PlateMotion& plate);       ///< @throws Error as validate
  [[nodiscard]] double max_torque_share() const;  ///< [-] largest share of a motor's limit so far

  [[nodiscard]] const std::vector<VisibleGeom>& geoms() const;
  /// The newest poses at or before t, or the oldest that are kept.
  [[nodiscard]] BodyPoses poses(double t) const;
  /// [m] along a ray of length-1 direction to the first thing, by MuJoCo itself; none if it meets
  /// nothing.
  [[nodiscard]] std::optional<double> ray(const Vec3& origin, const Vec3& direction,
                                          bool arm) const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace palpate::robot
