// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/tool_file.hpp"

#include <utility>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/kernel/fixtures/closed_mesh.hpp"

namespace palpate {

std::shared_ptr<const ToolShape> read_tool(const std::string& text) {
  return make_tool(text, [](const std::string& file) {
    const std::string name = lower_case(file);
    const bool is_ply = name.ends_with(".ply");
    if (!is_ply && !name.ends_with(".stl"))
      throw Error(file, "is no mesh that can be read", "give a closed mesh as .ply or .stl");
    PointFile mesh = is_ply ? read_ply(file) : read_stl(file);
    if (mesh.triangles.empty()) throw Error(file, "has points but no faces", "give a closed mesh");
    static_cast<void>(ClosedMesh(mesh.points, mesh.triangles, file));  // throws where it is open
    return Triangles{std::move(mesh.points), std::move(mesh.triangles)};
  });
}

}  // namespace palpate
