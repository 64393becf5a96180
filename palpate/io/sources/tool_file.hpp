// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate {

/// A tool as make_tool, whose mesh may be a file in PLY or STL: closed, of at most
/// ClosedMesh::most_triangles triangles. Null for a ball.
/// @throws Error naming the tool or the file
std::shared_ptr<const ToolShape> read_tool(const std::string& text);

}  // namespace palpate
