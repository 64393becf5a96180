// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// A tick as it moved a handle that nobody holds.
struct HandleSample {
  double t;       ///< [s] of the read, and of the write that follows
  Vec3 position;  ///< [m] device, as read
  Vec3 force;     ///< [N] device, as written
};

/// A measured figure with its uncertainty.
struct Measured {
  double value = 0.0;
  double error = 0.0;  ///< two standard deviations, by what the fit leaves over
};

/// What moves along one axis of a device.
struct AxisFit {
  Measured mass;        ///< [kg] apparent mass at the handle
  Measured damping;     ///< [N s/m] viscous
  Measured friction;    ///< [N] Coulomb
  Measured load;        ///< [N] constant force along the axis that acts on the handle: its weight
  Measured spring;      ///< [N/m] of whatever holds the handle; about 0 where nobody does
  int swings = 0;       ///< movements that the fit is made from
  double misfit = 0.0;  ///< [-] of the force, the share that the model does not explain, rms
};

/// The mechanics of a device by its own motors.
struct HandleFit {
  std::array<std::optional<AxisFit>, 3> axes;  ///< empty where it hardly moved
  std::optional<Measured> delay;               ///< [s] from a write until the motors give the force
};

/// Fits m x'' = F(t - t_d) - b x' - f sign(x') + g to movements along the axes, by weighted
/// integrals over each (the weak form), so that positions are never differentiated. Only stretches
/// count in which the handle goes 2 mm or more one way along one axis.
///
/// The delay is what leaves the least over, from 0 to 10 ms, common to all axes. Allocates. Not for
/// a tick.
HandleFit fit_handle(std::span<const HandleSample> samples);

}  // namespace palpate
