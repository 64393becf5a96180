// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/tool/shape_touch.hpp"

namespace palpate::lab {

/// What tools are touched with on the lab's benches: `shape` is ShapeTouch. Its peers are what is
/// published more often: each point of the same shell that is behind the surface pushes by its
/// depth, together as stiff as the coupling: along its inward normal (`penalty`), or out of a field
/// of voxels (`voxels`). They have no proxy: a tick's is where force and torque pull a hand to by
/// the coupling's springs.
inline constexpr std::array<std::string_view, 3> tool_methods{"shape", "penalty", "voxels"};

/// @param name  one of `tool_methods`
std::unique_ptr<Method> make_tool_method(std::string_view name,
                                         std::shared_ptr<const ToolShape> shape);

/// A body of a scene at a place [m], turned by a rotation vector [rad].
Part part(Shape shape, const Vec3& at = Vec3::Zero(), const Vec3& turn = Vec3::Zero());

}  // namespace palpate::lab
