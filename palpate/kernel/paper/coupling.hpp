// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Eq. (15): the vector from the proxy to the HIP, were the proxy moved on with the surface [m].
///
/// The surface moves along +n, so the proxy will be at P + (t - t_j) v n and u = HIP - P *loses*
/// that much. The print adds it (docs/method.md, erratum 1); `as_printed` keeps the print's sign.
/// @param u        [m] from the proxy to the HIP
/// @param elapsed  [s] t - t_j, since the newest frame
inline Vec3 extrapolated_u(const Vec3& u, double velocity, const Vec3& normal, double elapsed,
                           bool as_printed) noexcept {
  const Vec3 displacement = elapsed * velocity * normal;
  return as_printed ? Vec3(u + displacement) : Vec3(u - displacement);  // Eq. (15)
}

/// The force on the HIP and whether it was cut.
struct CouplingForce {
  Vec3 force;      ///< [N] world
  bool saturated;  ///< the force asked for was longer than max_force
};

/// Eq. (16): the virtual spring-damper between HIP and proxy. Pushes only, and never harder than
/// `coupling.max_force`.
///
/// The damper opposes the rate of change of the distance, so a HIP that moves away from the proxy
/// feels more force; the print's minus before k_d feeds energy in (docs/method.md, erratum 2).
/// @param u              [m] from the proxy to the HIP, extrapolated by (15)
/// @param distance_rate  [m/s] d|u|/dt, the one-sided difference of (16)
CouplingForce coupling_force(const Coupling& coupling, const Vec3& u, double distance_rate,
                             double r_c, bool as_printed) noexcept;

/// The rate of change in (16): remembers the distance of the tick before.
class DistanceRate {
 public:
  /// [m/s] d|u|/dt by the difference from the last tick; 0 at the first. [servo]
  double update(double distance, double t) noexcept {
    const double dt = t - last_t_;
    const double rate = last_distance_ && dt > 0.0 ? (distance - *last_distance_) / dt : 0.0;
    last_distance_ = distance;
    last_t_ = t;
    return rate;
  }
  /// Without contact there is no distance: the next one is the first.
  void reset() noexcept { last_distance_.reset(); }
  [[nodiscard]] double last_t() const noexcept { return last_t_; }  ///< [s] of the last update

 private:
  std::optional<double> last_distance_;  // [m] |u_(l-1)|
  double last_t_ = 0.0;
};

}  // namespace palpate
