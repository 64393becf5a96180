// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <utility>

#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/core/hand.hpp"

namespace palpate {

/// As messages have a vector.
inline std::array<double, 3> components(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

inline ros::PoseStamped pose_of(ros::Header header, const Vec3& position, const Rotation& q) {
  return {std::move(header), components(position), {q.x(), q.y(), q.z(), q.w()}};
}

}  // namespace palpate
