// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate {

/// How a tick's movement over the points has gone so far: section 4.3.
struct ProxyMovement {
  Vec3 at;              ///< [m] P_k, world
  bool looked = false;  ///< are `state` and `normal` those at `at`?
  ContactState state = ContactState::free_motion;
  Vec3 normal = Vec3::Zero();  ///< [-] n' of (1), of any length; zero if the sum vanishes
  /// [-] The last one in contact, which may be an earlier tick's; zero if there was none.
  Vec3 contact_normal = Vec3::Zero();
  Vec3 first_step = Vec3::Zero();  ///< [m] s_k of (13)
  int steps = 0;
  int contact_steps = 0;          ///< those of them taken in contact: they scale gamma of (11)
  bool touched = false;           ///< in contact or entrenched at any step
  bool normal_undefined = false;  ///< in contact, the sum of (1) vanished
};

/// Why a movement ended.
enum class MovementEnd {
  at_rest,       ///< converged by (8), or blocked
  budget_spent,  ///< after step_budget steps
  patch_left,    ///< points are needed that the patch does not cover: gather, and continue
};

/// Movement steps 2 to 7 of section 4.3, over and over: moves the proxy until it rests.
///
/// O(steps * points), no allocation.
/// @param hip         [m] world
/// @param cos_theta   [-] cosine of ProxyParameters::theta
/// @param fixed_step  steps of 0.1 r_1, as in the 2011 method [1], instead of (9) to (12)
MovementEnd move_proxy(const Patch& patch, const Vec3& hip, const ProxyParameters& proxy,
                       double cos_theta, bool fixed_step, ProxyMovement& movement) noexcept;

/// gamma of (11) after `contact_steps` such steps in the same tick: constant for the first eight,
/// then falling as 8/k. Section 4.4.3 leaves the schedule open; docs/method.md gives the reason.
double gamma_schedule(double gamma, int contact_steps) noexcept;

}  // namespace palpate
