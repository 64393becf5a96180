// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

#include "palpate/bag/robot_messages.hpp"
#include "palpate/teleop/touched.hpp"

namespace palpate {

/// x, y, z [m], normal's x, y, z, stiffness [N/m], friction; NaN: unknown.
inline ros::Float64MultiArray message_of(const Touched& touched) {
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  const Vec3& place = touched.place;
  const Vec3& normal = touched.normal;
  ros::Float64MultiArray message;
  message.data = {place.x(),
                  place.y(),
                  place.z(),
                  normal.x(),
                  normal.y(),
                  normal.z(),
                  touched.stiffness.value_or(unknown),
                  touched.friction.value_or(unknown)};
  return message;
}

/// The same back; a message that is too short says nothing.
inline Touched touched_of(const ros::Float64MultiArray& message) {
  Touched touched;
  if (message.data.size() < 8) return touched;
  const double* const data = message.data.data();
  touched.place = Vec3(data[0], data[1], data[2]);
  touched.normal = Vec3(data[3], data[4], data[5]);
  if (data[6] == data[6]) touched.stiffness = data[6];
  if (data[7] == data[7]) touched.friction = data[7];
  return touched;
}

}  // namespace palpate
