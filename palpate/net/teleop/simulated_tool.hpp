// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <utility>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

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
