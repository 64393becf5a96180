// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <utility>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/kernel/fixtures/closed_mesh.hpp"

namespace palpate {
namespace {

// The depth of a triangle where rays (x, y, 1) meet it. A ray is inside where it is on the same
// side of the planes through the camera and each edge; neighbours compute the plane of their edge
// alike, so no ray passes between them.
void draw_triangle(const std::array<Vec3, 3>& p, const Body::View& view, std::span<float> depth) {
  const auto [low, high] = std::minmax({p[0].z(), p[1].z(), p[2].z()});
  if (high < view.nearest || low > view.farthest) return;
  const Intrinsics& k = view.intrinsics;
  ViewingRays::Window range{0, k.width, 0, k.height};
  if (low >= view.nearest) {
    const std::array<Eigen::Array2d, 3> seen{p[0].head<2>() / p[0].z(), p[1].head<2>() / p[1].z(),
                                             p[2].head<2>() / p[2].z()};
    range = pixels_between(k, seen[0].min(seen[1]).min(seen[2]), seen[0].max(seen[1]).max(seen[2]));
  }
  if (range.empty()) return;
  std::array<Vec3, 3> sides{p[1].cross(p[2]), p[2].cross(p[0]), p[0].cross(p[1])};
  double volume = p[0].dot(sides[0]);
  if (volume < 0.0) {
    volume = -volume;
    for (Vec3& side : sides) side = -side;
  }
  if (!(volume > 0.0)) return;
  for (int v = range.v_begin; v < range.v_end; ++v) {
    for (int u = range.u_begin; u < range.u_end; ++u) {
      const Vec3 ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
      const double a = sides[0].dot(ray);
      const double b = sides[1].dot(ray);
      const double c = sides[2].dot(ray);
      if (a < 0.0 || b < 0.0 || c < 0.0) continue;
      const double along = volume / (a + b + c);
      float& seen = depth[static_cast<std::size_t>(v * k.width + u)];
      if (along >= view.nearest && along <= view.farthest && along < seen)
        seen = static_cast<float>(along);
    }
  }
}

}  // namespace

MeshBody::MeshBody(const std::vector<Vec3>& points,
                   const std::vector<std::array<std::uint32_t, 3>>& triangles,
                   const std::string& name) {
  std::vector<Box> boxes;
  for (const auto& triangle : triangles) {
    Corners corners;
    Box box;
    bool is_finite = true;
    for (std::size_t i = 0; i < 3; ++i) {
      if (triangle[i] >= points.size())
        throw Error(name, "a triangle has a corner that is not there", "mend the mesh");
      corners[i] = points[triangle[i]].cast<float>();
      is_finite = is_finite && corners[i].allFinite();
      box.include(corners[i].cast<double>());
    }
    if (!is_finite) continue;
    triangles_.push_back(corners);
    boxes.push_back(box);
  }
  if (triangles_.empty())
    throw Error(name, "it has no triangles", "give a mesh; open points by ply: or splat:");
  tree_.emplace(boxes, triangles_);
}

Vec3 MeshBody::nearest(const Vec3& at) const {
  double least = std::numeric_limits<double>::infinity();
  Vec3 nearest = at;
  tree_->nearest(at, std::numeric_limits<int>::max(), least,
                 [&](std::uint32_t first, std::uint32_t end) {
                   for (std::uint32_t i = first; i < end; ++i) {
                     const Corners& c = triangles_[i];
                     const Vec3 place =
                         nearest_of_triangle(
                             {c[0].cast<double>(), c[1].cast<double>(), c[2].cast<double>()}, at)
                             .first;
                     const double squared = (at - place).squaredNorm();
                     if (!(squared < least)) continue;
                     least = squared;
                     nearest = place;
                   }
                 });
  return nearest;
}

void MeshBody::draw(const View& view, std::span<float> depth) const {
  const SeenSpace seen(view);
  const Eigen::Isometry3d camera_from_body = view.body_from_camera.inverse();
  tree_->walk([&](const Box& box) { return seen.meets(box); },
              [&](std::uint32_t first, std::uint32_t end) {
                for (std::uint32_t i = first; i < end; ++i) {
                  const Corners& c = triangles_[i];
                  draw_triangle({camera_from_body * c[0].cast<double>(),
                                 camera_from_body * c[1].cast<double>(),
                                 camera_from_body * c[2].cast<double>()},
                                view, depth);
                }
              });
}

std::unique_ptr<Source> open_map(const Uri& uri) {
  const std::filesystem::path path = uri.path();
  const std::string ending = lower_case(path.extension().string());
  const bool as_gltf = is_gltf(path);
  const bool as_volume = is_nrrd(path);
  if (!as_gltf && !as_volume && ending != ".ply" && ending != ".stl" && ending != ".obj")
    throw Error(uri.text(), "it is no PLY, STL, OBJ, glTF or NRRD file",
                "give a mesh as FILE.ply, .stl, .obj, .glb or .gltf, a volume as .nrrd");
  const BodyOptions options =
      body_options(as_volume ? uri.without("level") : uri, as_gltf, as_gltf);
  PointFile file = as_gltf     ? read_gltf(path, false)
                   : as_volume ? read_nrrd(path, uri.number_option("level", 0.0, -1e9, 1e9, "px"))
                   : ending == ".ply" ? read_ply(path)
                   : ending == ".stl" ? read_stl(path)
                                      : read_by(parse_obj, path);
  for (Vec3& point : file.points) point = options.scale * (options.turn * point);
  auto body = std::make_shared<const MeshBody>(file.points, file.triangles, path.string());
  return open_body(uri, options, std::move(body),
                   std::string(as_volume ? "the surface of a volume, " : "a mesh of ") +
                       std::to_string(file.triangles.size()) + " triangles");
}

}  // namespace palpate
