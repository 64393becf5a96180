// SPDX-License-Identifier: Apache-2.0
#include "bench/subject.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::bench {
namespace {

constexpr double noise = 1e-3;  // [m]

std::shared_ptr<const Cloud> plane_image(const std::shared_ptr<const ViewingRays>& rays,
                                         double distance, unsigned seed) {
  constexpr double units_per_metre = 1000.0;
  std::mt19937 random(seed);
  std::normal_distribution<double> error(0.0, noise);
  const Intrinsics& k = rays->intrinsics();
  std::vector<std::uint16_t> depth(static_cast<std::size_t>(k.width) *
                                   static_cast<std::size_t>(k.height));
  for (std::uint16_t& raw : depth)
    raw = static_cast<std::uint16_t>(std::lround((distance + error(random)) * units_per_metre));
  return std::make_shared<DepthImage>(rays, std::move(depth), units_per_metre);
}

}  // namespace

Subject noisy_plane(int width, int height, double focal_length, double distance, int cameras) {
  const auto rays = std::make_shared<ViewingRays>(Intrinsics{.width = width,
                                                             .height = height,
                                                             .fx = focal_length,
                                                             .fy = focal_length,
                                                             .cx = 0.5 * (width - 1),
                                                             .cy = 0.5 * (height - 1),
                                                             .distortion = {}});
  Subject subject{.frames = {},
                  .surface = Vec3(0, 0, distance),
                  .into = Vec3::UnitZ(),
                  .along = Vec3(0.8, 0.6, 0)};
  unsigned seed = 0;
  for (int frame = 0; frame < 2; ++frame) {
    std::vector<std::shared_ptr<const Cloud>> views;
    for (int camera = 0; camera < cameras; ++camera)
      views.push_back(plane_image(rays, distance, ++seed));
    subject.frames.push_back(cameras == 1 ? views.front() : std::make_shared<CloudSet>(views));
  }
  return subject;
}

Subject noisy_points(std::size_t points, double spacing) {
  std::mt19937 random(1);
  std::normal_distribution<double> error(0.0, noise);
  const auto side =
      static_cast<std::size_t>(std::max(1.0, std::floor(std::sqrt(static_cast<double>(points)))));
  const double half = 0.5 * spacing * static_cast<double>(side - 1);
  std::vector<Vec3> list;
  list.reserve(side * side);
  for (std::size_t j = 0; j < side; ++j) {
    for (std::size_t i = 0; i < side; ++i)
      list.emplace_back(spacing * static_cast<double>(i) - half,
                        spacing * static_cast<double>(j) - half, error(random));
  }
  std::shuffle(list.begin(), list.end(), random);
  return {.frames = {std::make_shared<PointCloud>(list, Vec3(0, 0, -1))},
          .surface = Vec3::Zero(),
          .into = Vec3::UnitZ(),
          .along = Vec3(0.8, 0.6, 0)};
}

Subject recorded(const std::string& name, std::shared_ptr<const Cloud> frame) {
  const std::vector<Vec3> points = points_of(*frame);
  if (points.empty())
    throw Error(name, "its first frame has no measurement", "give a source that sees a surface");
  Vec3 eye = Vec3::Zero();
  Vec3 surface = points[points.size() / 2];
  if (const DepthImage* image = frame->image()) {
    eye = image->world_from_camera().translation();
    // The measured pixel nearest to the image's middle.
    const Intrinsics& k = image->intrinsics();
    int nearest = k.width * k.width + k.height * k.height;
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const int du = u - k.width / 2;
        const int dv = v - k.height / 2;
        if (du * du + dv * dv >= nearest) continue;
        if (const auto p = image->deproject(u, v)) {
          nearest = du * du + dv * dv;
          surface = *p;
        }
      }
    }
  } else if (const PointCloud* cloud = frame->point_cloud()) {
    eye = cloud->viewpoint().value_or(Vec3::Zero());
  }
  const Vec3 sight = surface - eye;
  const Vec3 into = sight.norm() > 1e-3 ? Vec3(sight.normalized()) : Vec3::UnitZ();
  return {.frames = {std::move(frame)},
          .surface = surface,
          .into = into,
          .along = into.unitOrthogonal()};
}

std::vector<Vec3> points_of(const Cloud& cloud) {
  if (const DepthImage* image = cloud.image()) return image->points();
  std::vector<Vec3> points;
  if (const PointCloud* list = cloud.point_cloud()) {
    points.reserve(list->size());
    for (std::size_t i = 0; i < list->size(); ++i) points.push_back(list->point(i));
    return points;
  }
  for (const Cloud* part : cloud.parts()) {
    const std::vector<Vec3> more = points_of(*part);
    points.insert(points.end(), more.begin(), more.end());
  }
  return points;
}

}  // namespace palpate::bench
