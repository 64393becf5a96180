// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Contact parameters of a surface that a robot's tool measured by touching it.
struct Touched {
  Vec3 place = Vec3::Zero();             ///< [m] world, on the surface
  Vec3 normal = Vec3::UnitZ();           ///< [-] unit, outward
  std::optional<double> stiffness = {};  ///< [N/m] empty: not known
  std::optional<double> friction = {};   ///< [-] coefficient of Coulomb; empty: not known

  static constexpr double softest = 20.0;       ///< [N/m]
  static constexpr double hardest = 5000.0;     ///< [N/m] higher values are reported as this
  static constexpr double most_friction = 2.0;  ///< [-]
};

/// Why the measurement is not plausible; empty: it is.
std::string_view disbelief(const Touched& touched) noexcept;

/// Estimates stiffness and friction of the surface that a robot's tool touches, from the measured
/// force and the tool position.
///
/// A touch lasts while the force is above 0.1 N, from 0.2 N on, along the normal that the camera's
/// surface had as it began. Stiffness is K of force = K depth + B speed, while pressing and
/// releasing, for a touch of at least 0.15 s and 0.5 N that stays within 5 mm; a penetration below
/// half a millimetre counts as the highest stiffness. The model must explain 80 % of the force, the
/// spring alone half of its peak, and a quarter of the depth must have recovered when the force is
/// zero: an object that was pushed away does not recover, and is not elastic. Friction is the mean
/// drag over the normal force while the tool slides, over 10 mm at least. [servo]
class TouchLearner {
 public:
  /// @param radius  [m] of the ball at the tool's tip
  explicit TouchLearner(double radius) : radius_(radius) {}

  /// @param t       [s] now, or when the robot measured
  /// @param tool    [m] world: centre of the ball
  /// @param velocity  [m/s] world: of the tool
  /// @param force   [N] world: on the tool
  /// @param normal  [-] world: of the surface that is seen there; zero where none is
  /// @return what a touch that ended has taught, if anything
  std::optional<Touched> next(double t, const Vec3& tool, const Vec3& velocity, const Vec3& force,
                              const Vec3& normal) noexcept;
  /// Why the last touch that ended taught nothing of how soft it is; empty: it did.
  [[nodiscard]] std::string_view why_not() const noexcept { return why_not_; }

 private:
  struct Touch {
    double began = 0.0;  // [s]
    Vec3 start = Vec3::Zero(), normal = Vec3::Zero();
    Vec3 last = Vec3::Zero();           // [m] the tool in the tick before
    double last_t = 0.0;                // [s]
    double peak = 0.0;                  // [N] along the normal
    double aside = 0.0, deepest = 0.0;  // [m] farthest along and into the surface
    double depth = 0.0;                 // [m] in the last tick
    // Sums over ticks of (1, depth, speed) with itself and with the force; and of the force
    // squared.
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    Vec3 with_force = Vec3::Zero();
    double force_2 = 0.0;
    double slid = 0.0, drag = 0.0, drag_2 = 0.0;  // [m], and the sums over it of drag over force
    Vec3 at_peak = Vec3::Zero();
  };
  [[nodiscard]] std::optional<Touched> taught() noexcept;

  double radius_;  // [m]
  Touch touch_;
  bool touching_ = false;
  bool was_free_ = false;  // a touch of which the beginning was not seen says nothing
  std::string_view why_not_;
};

}  // namespace palpate
