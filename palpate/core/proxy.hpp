// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "palpate/core/patch.hpp"

namespace palpate {

/// Where the proxy stands with respect to the points. Section 4.1.
enum class ContactState {
  free_motion,   ///< no point within r_2
  contact,       ///< points between r_1 and r_2, none within r_1
  entrenchment,  ///< points within r_1
};

/// The field's word for a state, as in the trace: `free`, `contact`, `entrenchment`.
const char* to_string(ContactState state) noexcept;

/// What one look at the patch tells: section 4.1's state and section 4.2's normal.
struct Surroundings {
  ContactState state;
  std::optional<Vec3>
      normal;  ///< [-] unit n of (1), away from the points; none if the sum vanishes
};

/// State and normal of a proxy at `at` [m, world]. Eq. (1), (2). O(points).
Surroundings look_around(const Patch& patch, const Vec3& at, const ProxyParameters& proxy) noexcept;

/// Eq. (8): does the proxy rest where it is?
///
/// In contact, when the angle between -u and n is below theta; in free motion, when it has reached
/// the HIP; never while entrenched.
/// @param u          [m] from the proxy to the HIP
/// @param cos_theta  [-] cosine of ProxyParameters::theta, which every step asks for
bool has_converged(const Surroundings& around, const Vec3& u, double cos_theta) noexcept;

/// One proxy step s_k [m]: movement steps 3 to 6 of section 4.3 with the sizes (9) to (12).
///
/// @param around  what `look_around` said at `at`
/// @param normal  [-] n to use: `around.normal`, or the last one known where that is empty
/// @param u       [m] from the proxy to the HIP
/// @param reach   [m] a step is never longer: what the patch covers
/// @param contact_steps  steps taken in this tick in contact and closer than r_1 to the ideal
///                       position, before this one; scales gamma of (11)
Vec3 proxy_step(const Patch& patch, const Vec3& at, const Surroundings& around, const Vec3& normal,
                const Vec3& u, double reach, int contact_steps,
                const ProxyParameters& proxy) noexcept;

/// The same with the step size of the 2011 method [1]: always 0.1 r_1.
Vec3 fixed_proxy_step(const Surroundings& around, const Vec3& normal, const Vec3& u,
                      const ProxyParameters& proxy) noexcept;

/// gamma of (11) after `contact_steps` such steps in the same tick: constant for the first eight,
/// then falling as 8/k. Section 4.4.3 leaves the schedule open; docs/method.md gives the reason.
double gamma_schedule(double gamma, int contact_steps) noexcept;

}  // namespace palpate
