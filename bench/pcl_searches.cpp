// SPDX-License-Identifier: Apache-2.0
#include "bench/pcl_searches.hpp"

#ifdef PALPATE_PCL
#include <limits>
#include <memory>

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/search/octree.h>
#include <pcl/search/organized.h>
#endif

namespace palpate::bench {

#ifdef PALPATE_PCL
namespace {

using Points = pcl::PointCloud<pcl::PointXYZ>;

pcl::PointXYZ point(const Vec3& p) {
  const Eigen::Vector3f f = p.cast<float>();
  return {f.x(), f.y(), f.z()};
}

Points::Ptr unorganised(const std::vector<Vec3>& points) {
  auto cloud = std::make_shared<Points>();
  cloud->reserve(points.size());
  for (const Vec3& p : points) cloud->push_back(point(p));
  return cloud;
}

// All pixels in the camera's frame, those without a measurement as NaN: what PCL calls organised.
Points::Ptr organised(const DepthImage& image) {
  const Intrinsics& k = image.intrinsics();
  const float none = std::numeric_limits<float>::quiet_NaN();
  auto cloud = std::make_shared<Points>(static_cast<std::uint32_t>(k.width),
                                        static_cast<std::uint32_t>(k.height),
                                        pcl::PointXYZ(none, none, none));
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const std::uint16_t raw = image.depth()[static_cast<std::size_t>(v * k.width + u)];
      const Eigen::Vector2d ray = image.rays().ray(u, v);
      if (!is_measured(raw) || !ray.allFinite()) continue;
      const double z = raw / image.units_per_metre();
      cloud->at(u, v) = point(Vec3(z * ray.x(), z * ray.y(), z));
    }
  }
  cloud->is_dense = false;
  return cloud;
}

// @param make       what PCL searches, made of a frame
// @param to_search  from the world to the frame of those points
template <class Search, class Make>
PclSearch made(const std::string& name, const std::shared_ptr<Search>& search, const Make& make,
               const Eigen::Isometry3d& to_search) {
  const auto indices = std::make_shared<pcl::Indices>();
  const auto distances = std::make_shared<std::vector<float>>();
  return {name, [=] { search->setInputCloud(make()); },
          [=](const Ball& ball) {
            return static_cast<std::size_t>(search->radiusSearch(
                point(to_search * ball.centre), ball.radius, *indices, *distances));
          }};
}

}  // namespace

std::vector<PclSearch> pcl_searches(const Cloud& frame, const std::vector<Vec3>& points) {
  std::vector<PclSearch> searches;
  const Eigen::Isometry3d in_world = Eigen::Isometry3d::Identity();
  const Points::ConstPtr all = unorganised(points);
  const auto given = [=] { return all; };  // as nanoflann's, which has them given, too
  constexpr double leaf = 0.01;            // [m] as large as r_3
  constexpr bool sorted = false;
  searches.push_back(made("PCL k-d tree",
                          std::make_shared<pcl::search::KdTree<pcl::PointXYZ>>(sorted), given,
                          in_world));
  searches.push_back(made("PCL octree", std::make_shared<pcl::search::Octree<pcl::PointXYZ>>(leaf),
                          given, in_world));
  if (const DepthImage* image = frame.image())
    searches.push_back(made(
        "PCL organised", std::make_shared<pcl::search::OrganizedNeighbor<pcl::PointXYZ>>(sorted),
        [=] { return organised(*image); }, image->world_from_camera().inverse()));
  return searches;
}
#else
std::vector<PclSearch> pcl_searches(const Cloud& /*frame*/, const std::vector<Vec3>& /*points*/) {
  return {};
}
#endif

}  // namespace palpate::bench
