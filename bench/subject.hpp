// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "palpate/kernel/core/cloud.hpp"

namespace palpate::bench {

/// What is touched in a measurement: frames that alternate, and where and how a hand presses them.
struct Subject {
  std::vector<std::shared_ptr<const Cloud>> frames;
  Vec3 surface;  ///< [m] world: where the hand comes down
  Vec3 into;     ///< [-] unit, into the surface
  Vec3 along;    ///< [-] unit, along it
};

/// Two frames of a plane seen squarely from `distance` metres: noise of 1 mm, readings in
/// millimetres. `cameras` see it from the same place, each with noise of its own.
Subject noisy_plane(int width, int height, double focal_length, double distance, int cameras = 1);

/// The same plane as `points` in no order, in a square grid of `spacing` metres.
Subject noisy_points(std::size_t points, double spacing);

/// A frame of a recording, pressed where its middle measured something.
/// @throws Error if it measured nothing.
Subject recorded(const std::string& name, std::shared_ptr<const Cloud> frame);

/// All points of a cloud [m, world].
std::vector<Vec3> points_of(const Cloud& cloud);

}  // namespace palpate::bench
