// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "palpate/servo/device.hpp"

namespace palpate {

/// The mechanics of a haptic device as the hand feels them at the handle.
struct DeviceBody {
  double mass = 0.06;            ///< [kg] apparent mass, 1 g to 10 kg
  double damping = 0.7;          ///< [N s/m] viscous, 0 to 100
  double friction = 0.26;        ///< [N] Coulomb, against the motion, 0 to 10
  double resolution = 0.055e-3;  ///< [m] of the position that is read; 0 to 10 mm, 0: exact
  double delay = 1e-3;           ///< [s] from a write until the motors give the force, 0 to 10 ms
  double inertia = 0.0;       ///< [kg m^2] about any axis, up to 0.1; 0: the handle does not turn
  double turn_damping = 0.0;  ///< [N m s/rad] viscous, 0 to 1
};

/// @throws Error naming the first figure out of its range.
void validate(const DeviceBody& body);

/// A body with what its device says of itself.
struct DevicePreset {
  std::string_view name;
  DeviceBody body;
  DeviceLimits limits;
  double reach;  ///< [m] radius
};

/// The models `touch`, `omega`, `falcon` and, with motors for a torque, `sigma`: the middle of what
/// is known of such devices. Of how a handle turns nothing is published: its inertia is that of a
/// pen of 60 g, its damping as small as that of the positions is in comparison.
/// @throws Error for another name.
const DevicePreset& device_preset(std::string_view name);

/// How a hand holds the handle.
struct Grip {
  std::string_view name;
  double mass;            ///< [kg] of the hand that moves with the handle
  double stiffness;       ///< [N/m]
  double damping;         ///< [N s/m]
  double turn_stiffness;  ///< [N m/rad]
  double turn_damping;    ///< [N m s/rad]
};

/// `light`, `firm`, or `none`: nobody holds it.
/// @throws Error for another name.
const Grip& grip_preset(std::string_view name);

/// A mass on a spring and damper under a constant force, one axis: m y'' = -k y - b y' + g.
struct MassSpringDamper {
  double mass;       ///< [kg] more than 0
  double damping;    ///< [N s/m] b
  double stiffness;  ///< [N/m] k
};

/// The exact solution after a fixed time, as factors for many axes and steps of that time.
class ExactStep {
 public:
  ExactStep() = default;
  ExactStep(const MassSpringDamper& system, double dt) noexcept;

  /// Lets dt pass. @param y  [m] @param v  [m/s] @param g  [N] constant over dt
  void advance(Vec3& y, Vec3& v, const Vec3& g) const noexcept;

 private:
  // y1 = yy y + yv v + yg g, v1 = vy y + vv v + vg g
  double yy_ = 1.0, yv_ = 0.0, yg_ = 0.0, vy_ = 0.0, vv_ = 1.0, vg_ = 0.0;
};

/// A handle on a sampled wall: what moves, and what drives it.
struct SampledWall {
  MassSpringDamper handle;  ///< device and hand; the hand's spring holds it
  double damping = 0.0;     ///< [N s/m] k_d of the wall, on the filtered velocity
  double period = 1e-3;     ///< [s] T: the force is held for that long
  double delay = 1e-3;      ///< [s] t_d, from a write to the force
  double filter = 2e-3;     ///< [s] time constant of the velocity, as HandVelocity's; 0: none
};

/// [N/m] 2 (b + k_d) / (T + 2 t_d): what a slow swing decays with. The hold and the delay of a
/// spring K act on it like a damping of -K (T/2 + t_d).
constexpr double delayed_stiffness(const SampledWall& wall) {
  return 2.0 * (wall.handle.damping + wall.damping) / (wall.period + 2.0 * wall.delay);
}

/// The stiffest spring [N/m], up to `most` and to 0.1 %, with which the linear loop decays: no
/// Coulomb friction, no resolution, no limit of the force, the wall never left. 0: none does.
double linear_stiffness(const SampledWall& wall, double most);

}  // namespace palpate
