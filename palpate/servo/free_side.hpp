// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/cloud.hpp"

namespace palpate {

/// Where to seat a proxy again after ticks were missed and the surface may have passed it: the
/// nearest place along the sightline, within 50 mm, from which nothing seen lies farther out.
///
/// What a camera sees it sees through free space, so that place was free when the frame was taken.
/// Without a viewpoint the last normal stands for the direction, and without that the proxy stays.
/// [servo] One gather; O(points within 50 mm), at most Patch::capacity of them.
/// @param proxy   [m] world
/// @param normal  [-] the last contact's, or zero
/// @param r_c     [m] contact radius
/// @param patch   room to work in; its content is lost
Vec3 free_side(const Cloud& cloud, const Vec3& proxy, const Vec3& normal, double r_c,
               Patch& patch) noexcept;

}  // namespace palpate
