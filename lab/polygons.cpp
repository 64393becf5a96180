// SPDX-License-Identifier: Apache-2.0
#include "lab/polygons.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "lab/local_points.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/fixtures/closed_mesh.hpp"

namespace palpate::lab {
namespace {

using Box = Eigen::AlignedBox3d;

// Neighbours in an image whose distance from the camera differs by more than this share of it are
// not joined: an edge of an object.
constexpr double jump = 0.02;
constexpr double touch = 1e-7;  // [m] nearer than this is contact

template <class Visit>
struct InBox {
  const Box& box;
  const std::vector<Box>& boxes;
  const Visit& visit;
  bool intersectVolume(const Box& volume) const { return volume.intersects(box); }
  bool intersectObject(std::uint32_t triangle) const {
    if (boxes[triangle].intersects(box)) visit(triangle);
    return false;
  }
};

// When a ball first touches the line a + s e, 0 <= s <= 1 (a point where e is zero): the share of
// its way, none if it doesn't or moves away.
std::optional<double> meets_line(const Vec3& from, const Vec3& way, double radius, const Vec3& a,
                                 const Vec3& e) {
  const double length = e.squaredNorm();
  const auto across = [&](const Vec3& v) {
    return length > 0.0 ? Vec3(v - v.dot(e) / length * e) : v;
  };
  const Vec3 m = across(from - a);
  const Vec3 d = across(way);
  const double closing = m.dot(d);
  if (closing >= 0.0) return std::nullopt;
  const double c = m.squaredNorm() - radius * radius;
  double share = 0.0;
  if (c > 2.0 * radius * touch) {
    const double discriminant = closing * closing - d.squaredNorm() * c;
    if (discriminant < 0.0) return std::nullopt;
    share = (-closing - std::sqrt(discriminant)) / d.squaredNorm();
    if (share > 1.0) return std::nullopt;
  }
  if (length > 0.0) {
    const double s = (from + share * way - a).dot(e) / length;
    if (s < 0.0 || s > 1.0) return std::nullopt;
  }
  return share;
}

}  // namespace

void Polygons::check(const Cloud& cloud) {
  if (!cloud.parts().empty()) {
    for (const Cloud* part : cloud.parts()) check(*part);
  } else if (const PointCloud* points = cloud.point_cloud();
             points != nullptr && points->size() > 0) {
    const Surface* surface = points->surface();
    if (surface != nullptr && (!surface->triangles.empty() || surface->columns > 0)) return;
    throw Error("frame", "it has only points, and the method needs polygons",
                "use a PLY with faces, an organised PCD or a depth camera");
  }
}

void Polygons::frame(const Cloud& cloud) noexcept {
  cloud_ = &cloud;
  stale_ = true;
}

template <class Visit>
void Polygons::for_each_in(const Box& box, const Visit& visit) const {
  InBox<Visit> query{box, boxes_, visit};
  Eigen::BVIntersect(tree_, query);
}

void Polygons::add_grid(const std::vector<Vec3>& points, int columns, int rows,
                        const std::optional<Vec3>& viewpoint) {
  const auto first = static_cast<std::uint32_t>(vertices_.size());
  vertices_.insert(vertices_.end(), points.begin(), points.end());
  viewpoint_ = viewpoint;
  const auto join = [&](int a, int b, int c) {
    const Vec3& p = points[static_cast<std::size_t>(a)];
    const Vec3& q = points[static_cast<std::size_t>(b)];
    const Vec3& r = points[static_cast<std::size_t>(c)];
    if (!p.allFinite() || !q.allFinite() || !r.allFinite()) return;
    if (viewpoint) {
      const std::array<double, 3> far = {(p - *viewpoint).norm(), (q - *viewpoint).norm(),
                                         (r - *viewpoint).norm()};
      const auto [low, high] = std::minmax_element(far.begin(), far.end());
      if (*high - *low > jump * *low) return;
    }
    const Vec3 across = (q - p).cross(r - p);
    const bool faces = across.dot(towards_viewer(viewpoint, p)) > 0.0;
    triangles_.push_back({first + static_cast<std::uint32_t>(a),
                          first + static_cast<std::uint32_t>(faces ? b : c),
                          first + static_cast<std::uint32_t>(faces ? c : b)});
  };
  for (int v = 0; v + 1 < rows; ++v) {
    for (int u = 0; u + 1 < columns; ++u) {
      const int a = v * columns + u;
      join(a, a + 1, a + columns);
      join(a + 1, a + columns + 1, a + columns);
    }
  }
}

void Polygons::add_mesh(const Surface& mesh) {
  const auto first = static_cast<std::uint32_t>(vertices_.size());
  vertices_.insert(vertices_.end(), mesh.points.begin(), mesh.points.end());
  vertex_normals_.resize(first, Vec3::Zero());
  vertex_normals_.insert(vertex_normals_.end(), mesh.normals.begin(), mesh.normals.end());
  for (const Corners& t : mesh.triangles)
    triangles_.push_back({first + t[0], first + t[1], first + t[2]});
}

void Polygons::add(const Cloud& cloud, const Vec3& place) {
  const Vec3 hole = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  if (!cloud.parts().empty()) {
    for (const Cloud* part : cloud.parts()) add(*part, place);
  } else if (const DepthImage* image = cloud.image()) {
    const Eigen::Isometry3d& world_from_camera = image->world_from_camera();
    const auto window = image->rays().window(world_from_camera.inverse() * place, reach_);
    std::vector<Vec3> points;
    for (int v = window.v_begin; v < window.v_end; ++v) {
      for (int u = window.u_begin; u < window.u_end; ++u) {
        const auto point = image->deproject(u, v);
        // What is far before or behind the place is no more a neighbour than a hole is.
        points.push_back(point && (*point - place).norm() < 2.0 * reach_ ? *point : hole);
      }
    }
    if (!window.empty())
      add_grid(points, window.u_end - window.u_begin, window.v_end - window.v_begin,
               world_from_camera.translation());
  } else if (const PointCloud* points = cloud.point_cloud()) {
    if (points->surface() == nullptr) return;
    const Surface& surface = *points->surface();
    if (!surface.triangles.empty()) return add_mesh(surface);
    int u_low = surface.columns;
    int u_high = -1;
    int v_low = surface.rows;
    int v_high = -1;
    for (int i = 0; i < surface.columns * surface.rows; ++i) {
      if (!((surface.points[static_cast<std::size_t>(i)] - place).norm() < reach_)) continue;
      u_low = std::min(u_low, i % surface.columns);
      u_high = std::max(u_high, i % surface.columns);
      v_low = std::min(v_low, i / surface.columns);
      v_high = std::max(v_high, i / surface.columns);
    }
    std::vector<Vec3> near;
    for (int v = v_low; v <= v_high; ++v) {
      for (int u = u_low; u <= u_high; ++u)
        near.push_back(surface.points[static_cast<std::size_t>(v * surface.columns + u)]);
    }
    if (u_high >= u_low)
      add_grid(near, u_high - u_low + 1, v_high - v_low + 1, points->viewpoint());
  }
}

void Polygons::cover(const Vec3& place) {
  if (cloud_ == nullptr) return;
  if (!stale_ && (place - centre_).norm() <= reach_ / 3.0) return;
  const PointCloud* points = cloud_->point_cloud();
  const bool is_mesh =
      points != nullptr && points->surface() != nullptr && !points->surface()->triangles.empty();
  if (!stale_ && is_mesh) return;  // all of it is here
  stale_ = false;
  centre_ = place;
  vertices_.clear();
  vertex_normals_.clear();
  triangles_.clear();
  viewpoint_.reset();
  add(*cloud_, place);
  vertex_normals_.resize(vertices_.size(), Vec3::Zero());

  normals_.clear();
  boxes_.clear();
  std::vector<std::uint32_t> indices;
  std::vector<Vec3> sums(vertices_.size(), Vec3::Zero());
  std::erase_if(triangles_, [&](const Corners& t) {
    const Vec3 across =
        (vertices_[t[1]] - vertices_[t[0]]).cross(vertices_[t[2]] - vertices_[t[0]]);
    // A line faces nowhere, and what has a corner that is not finite is no triangle.
    if (!(across.norm() > 1e-14) || !across.allFinite()) return true;
    Box box(vertices_[t[0]]);
    for (const std::uint32_t corner : t) {
      sums[corner] += across;
      box.extend(vertices_[corner]);
    }
    indices.push_back(static_cast<std::uint32_t>(indices.size()));
    normals_.emplace_back(across.normalized());
    boxes_.push_back(box);
    return false;
  });
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (vertex_normals_[i].isZero()) vertex_normals_[i] = sums[i].normalized();
  }
  tree_.init(indices.begin(), indices.end(), boxes_.begin(), boxes_.end());
}

std::optional<Vec3> Polygons::towards_camera(const Vec3& at) const {
  if (!viewpoint_) return std::nullopt;
  return (*viewpoint_ - at).normalized();
}

Vec3 Polygons::shaded_normal(std::uint32_t triangle, const Vec3& at) const {
  const Corners& t = triangles_[triangle];
  const Vec3& flat = normal(triangle);
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < 3; ++i) {
    // The share of a corner is the area of the triangle opposite to it.
    const Vec3& b = vertices_[t[(i + 1) % 3]];
    const Vec3& c = vertices_[t[(i + 2) % 3]];
    sum += std::max(flat.dot((b - at).cross(c - at)), 0.0) * vertex_normals_[t[i]];
  }
  return sum.norm() > 1e-15 ? Vec3(sum.normalized()) : flat;
}

std::optional<Polygons::Hit> Polygons::sweep(const Vec3& from, const Vec3& way,
                                             double radius) const {
  Box box(from);
  box.extend(Vec3(from + way));
  box.min().array() -= radius + touch;
  box.max().array() += radius + touch;
  std::optional<Hit> first;
  for_each_in(box, [&](std::uint32_t index) {
    const Corners& t = triangles_[index];
    const Vec3& a = vertices_[t[0]];
    const Vec3& n = normal(index);
    const double height = n.dot(from - a);
    if (height < -touch) return;  // from behind it may pass
    const double speed = n.dot(way);
    // Of the way, at least this lies before the ball touches the triangle's plane.
    const double before = height - radius - touch;
    if (before > (first ? first->share : 1.0) * std::max(0.0, -speed)) return;
    // The ball cuts a disc out of that plane at most; does its path there come near the triangle?
    const Vec3 along = way - speed * n;
    Vec3 off = boxes_[index].center() - from;
    off -= off.dot(n) * n;
    if (along.squaredNorm() > 0.0)
      off -= std::clamp(off.dot(along) / along.squaredNorm(), 0.0, 1.0) * along;
    const double lowest = std::max(0.0, std::min(height, height + speed));
    const double disc = (radius + touch) * (radius + touch) - lowest * lowest;
    const double near = std::sqrt(std::max(0.0, disc)) + 0.5 * boxes_[index].diagonal().norm();
    if (off.squaredNorm() > (near + touch) * (near + touch)) return;
    const auto consider = [&](double share, const Vec3& direction) {
      if (!first || share < first->share) first = Hit{share, direction, index};
    };
    if (speed < 0.0) {
      const double share = std::max(0.0, (height - radius) / -speed);
      if (share <= 1.0) {
        const Vec3 foot = from + share * way - n.dot(from + share * way - a) * n;
        bool inside = true;
        for (std::size_t i = 0; i < 3 && inside; ++i) {
          const Vec3& b = vertices_[t[i]];
          const Vec3 edge = vertices_[t[(i + 1) % 3]] - b;
          inside = n.dot(edge.cross(foot - b)) >= -1e-9 * edge.norm();
        }
        if (inside) return consider(share, n);
      }
    }
    if (radius == 0.0) return;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& b = vertices_[t[i]];
      const Vec3 edge = vertices_[t[(i + 1) % 3]] - b;
      if (const auto share = meets_line(from, way, radius, b, edge)) {
        const Vec3 m = from + *share * way - b;
        consider(*share, (m - m.dot(edge) / edge.squaredNorm() * edge).normalized());
      }
      if (const auto share = meets_line(from, way, radius, b, Vec3::Zero()))
        consider(*share, (from + *share * way - b).normalized());
    }
  });
  return first;
}

std::optional<Vec3> Polygons::nearest(const Vec3& at, double within) const {
  std::optional<Vec3> best;
  const Box box(Vec3(at.array() - within), Vec3(at.array() + within));
  for_each_in(box, [&](std::uint32_t index) {
    const Corners& t = triangles_[index];
    if (normal(index).dot(at - vertices_[t[0]]) < 0.0) return;
    const Vec3 place =
        nearest_of_triangle({vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]}, at).first;
    if ((at - place).norm() > (best ? (at - *best).norm() : within)) return;
    best = place;
  });
  return best;
}

}  // namespace palpate::lab
