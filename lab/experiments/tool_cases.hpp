// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate::lab {

/// A case of `tool-cases`, before a D4xx: docs/tools.md. World frame.
struct ToolCase {
  std::shared_ptr<const ToolShape> tool;
  std::vector<Part> bodies;  ///< the tool is outside of them, where the camera sees them
  std::vector<Part> arms;    ///< what hides them for a while, and is never touched
  CameraSetup camera;
  std::uint64_t noise_seed = 0;
  double sigma = 0.0;  ///< [m] standard deviation of a reading at the tool
  std::vector<HipPath::Sample> hand;
  double rests = 0.0, ends = 0.0;  ///< [s] from when what moves or is lifted counts
  int lifts = 0;                   ///< how often the hand presses and is drawn away
};

/// A surface comes, a box slides in sideways, an arm passes, the hand is lifted.
inline constexpr std::array<std::string_view, 4> tool_families{"coming", "sliding", "passing",
                                                               "lifting"};

/// All of a case follows from these two.
ToolCase draw_tool_case(std::string_view family, std::uint64_t seed);

/// [m] from the bodies to the nearest of the tool's points, negative inside. Those are looked at
/// that come first: corners, edges, and the faces evenly.
double clearance(const Scene& bodies, const ToolShape& tool, const HandPose& pose, double t);

}  // namespace palpate::lab
