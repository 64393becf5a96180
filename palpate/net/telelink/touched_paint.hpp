// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <string>

#include "palpate/io/bag/messages.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/net/teleop/touched.hpp"
#include "palpate/session/paint.hpp"

namespace palpate {

constexpr double touched_radius = 0.02;  ///< [m] around the contact that gets the same material

/// Assigns the stiffness and friction measured by a robot's tool to the surface there, if the
/// stiffness is lower than the rendered one, or if friction is known. Surfaces that were measured
/// stiffer, or painted by a user, are not changed. Materials change as with the brush: never in a
/// step, and stiffer only with energy from the tank (docs/materials.md). @param parameters of the
/// session: used for all but stiffness and friction
/// @return why nothing was done; empty: it was
std::string paint_touched(Paint& paint, const Parameters& parameters, const Touched& touched);

/// x, y, z [m], normal's x, y, z, stiffness [N/m], friction; what is not known is no number.
inline ros::Float64MultiArray message_of(const Touched& touched) {
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  Eigen::Matrix<double, 8, 1> row;
  row << touched.place, touched.normal, touched.stiffness.value_or(unknown),
      touched.friction.value_or(unknown);
  ros::Float64MultiArray message;
  message.data.assign(row.data(), row.data() + row.size());
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
