// SPDX-License-Identifier: Apache-2.0
#include "palpate/cloud/depth_image.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/core/vectorise.hpp"

namespace palpate {
namespace {

constexpr int largest_image = 16384;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Rational Brown-Conrady: where the ray (x, y) appears in normalised image coordinates.
Eigen::Vector2d distort(const std::array<double, 8>& d, const Eigen::Vector2d& ray) {
  const double x = ray.x();
  const double y = ray.y();
  const double r2 = x * x + y * y;
  const double radial =
      (1.0 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1.0 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
  return {x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x),
          y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y};
}

// The ray that appears at `image`, by Newton's method from the undistorted guess; NaN without one.
Eigen::Vector2d undistort(const std::array<double, 8>& d, const Eigen::Vector2d& image) {
  constexpr double small = 1e-6;
  Eigen::Vector2d ray = image;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d error = distort(d, ray) - image;
    if (error.norm() < 1e-12) return ray;
    Eigen::Matrix2d jacobian;
    jacobian.col(0) = (distort(d, ray + Eigen::Vector2d(small, 0.0)) -
                       distort(d, ray - Eigen::Vector2d(small, 0.0))) /
                      (2.0 * small);
    jacobian.col(1) = (distort(d, ray + Eigen::Vector2d(0.0, small)) -
                       distort(d, ray - Eigen::Vector2d(0.0, small))) /
                      (2.0 * small);
    // Beyond the fold of a lens model the determinant turns: those solutions are no rays.
    if (!(jacobian.determinant() > 1e-6)) return {nan, nan};
    ray -= jacobian.inverse() * error;
    if (!ray.allFinite()) return {nan, nan};
  }
  return (distort(d, ray) - image).norm() < 1e-9 ? ray : Eigen::Vector2d(nan, nan);
}

// The slopes x/z between which the tangents from the origin to a circle at (x, z) lie; z > radius.
struct Slopes {
  double low, high;
};

Slopes tangent_slopes(double x, double z, double radius) {
  const double under = z * z - radius * radius;
  const double root = radius * std::sqrt(x * x + under);
  return {(x * z - root) / under, (x * z + root) / under};
}

constexpr int block = 64;

// Points of one row's pixels, relative to the ball's centre in the camera's axes, and |.|^2.
struct Block {
  alignas(64) std::array<float, block> x, y, z, squared;
};

// One row of pixels u0, u0 + stride, ...; a hole gets an infinite distance.
PALPATE_VECTORISED
void deproject_row(const std::uint16_t* depth, const double* ray_x, const double* ray_y,
                   int ray_y_stride, int stride, int count, double metres_per_unit, double centre_x,
                   double centre_y, double centre_z, Block& out) {
  constexpr float hole = std::numeric_limits<float>::infinity();
#pragma omp simd
  for (int i = 0; i < count; ++i) {
    const std::uint16_t raw = depth[i * stride];
    const double z = raw * metres_per_unit;
    const double dx = z * ray_x[i * stride] - centre_x;
    const double dy = z * ray_y[i * ray_y_stride] - centre_y;
    const double dz = z - centre_z;
    const auto squared = static_cast<float>(dx * dx + dy * dy + dz * dz);
    out.x[i] = static_cast<float>(dx);
    out.y[i] = static_cast<float>(dy);
    out.z[i] = static_cast<float>(dz);
    out.squared[i] = ((raw != 0) & (raw != 65535)) ? squared : hole;
  }
}

}  // namespace

void validate(const Intrinsics& k) {
  if (k.width < 1 || k.height < 1 || k.width > largest_image || k.height > largest_image) {
    throw Error("intrinsics",
                "an image of " + std::to_string(k.width) + "x" + std::to_string(k.height) +
                    " pixels is not possible",
                "give a width and height from 1 to " + std::to_string(largest_image));
  }
  const auto positive = [](double f) { return std::isfinite(f) && f > 0.0; };
  if (!positive(k.fx) || !positive(k.fy)) {
    throw Error("intrinsics",
                "focal lengths fx = " + std::to_string(k.fx) + ", fy = " + std::to_string(k.fy) +
                    " px are not positive",
                "give the focal lengths of the depth camera in pixels");
  }
  if (!std::isfinite(k.cx) || !std::isfinite(k.cy)) {
    throw Error("intrinsics", "the principal point (cx, cy) is not finite",
                "give it in pixels, usually near the middle of the image");
  }
  for (const double d : k.distortion) {
    if (!std::isfinite(d)) {
      throw Error("intrinsics", "a distortion coefficient is not finite",
                  "give k1 k2 p1 p2 k3 k4 k5 k6, or none");
    }
  }
}

ViewingRays::ViewingRays(const Intrinsics& intrinsics) : intrinsics_(intrinsics) {
  validate(intrinsics_);
  const auto& k = intrinsics_;
  const auto columns = static_cast<std::size_t>(k.width);
  const auto rows = static_cast<std::size_t>(k.height);
  constexpr double inf = std::numeric_limits<double>::infinity();
  column_min_.assign(columns, inf);
  column_max_.assign(columns, -inf);
  row_min_.assign(rows, inf);
  row_max_.assign(rows, -inf);
  if (k.distorted()) {
    x_.resize(columns * rows);
    y_.resize(columns * rows);
    for (std::size_t v = 0; v < rows; ++v) {
      for (std::size_t u = 0; u < columns; ++u) {
        const Eigen::Vector2d ray = undistort(
            k.distortion,
            {(static_cast<double>(u) - k.cx) / k.fx, (static_cast<double>(v) - k.cy) / k.fy});
        x_[v * columns + u] = ray.x();
        y_[v * columns + u] = ray.y();
        if (!ray.allFinite()) continue;
        column_min_[u] = std::min(column_min_[u], ray.x());
        column_max_[u] = std::max(column_max_[u], ray.x());
        row_min_[v] = std::min(row_min_[v], ray.y());
        row_max_[v] = std::max(row_max_[v], ray.y());
      }
    }
  } else {
    x_.resize(columns);
    y_.resize(rows);
    for (std::size_t u = 0; u < columns; ++u) x_[u] = (static_cast<double>(u) - k.cx) / k.fx;
    for (std::size_t v = 0; v < rows; ++v) y_[v] = (static_cast<double>(v) - k.cy) / k.fy;
    column_min_ = column_max_ = x_;
    row_min_ = row_max_ = y_;
  }
  // A window begins at the first column that reaches its lower slope and ends after the last one
  // that starts below its upper slope; running extremes let a binary search find both.
  for (std::size_t u = 1; u < columns; ++u)
    column_max_[u] = std::max(column_max_[u], column_max_[u - 1]);
  for (std::size_t v = 1; v < rows; ++v) row_max_[v] = std::max(row_max_[v], row_max_[v - 1]);
  for (std::size_t u = columns - 1; u-- > 0;)
    column_min_[u] = std::min(column_min_[u], column_min_[u + 1]);
  for (std::size_t v = rows - 1; v-- > 0;) row_min_[v] = std::min(row_min_[v], row_min_[v + 1]);
}

Eigen::Vector2d ViewingRays::ray(int u, int v) const noexcept {
  if (!intrinsics_.distorted())
    return {x_[static_cast<std::size_t>(u)], y_[static_cast<std::size_t>(v)]};
  const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(intrinsics_.width) +
                        static_cast<std::size_t>(u);
  return {x_[i], y_[i]};
}

ViewingRays::Window ViewingRays::window(const Vec3& centre, double radius) const noexcept {
  if (!(centre.z() > -radius)) return {};  // wholly behind the camera
  // The ball reaches the plane of the pupil, where slopes have no bound.
  if (!(centre.z() > radius)) return {0, intrinsics_.width, 0, intrinsics_.height};
  const Slopes x = tangent_slopes(centre.x(), centre.z(), radius);
  const Slopes y = tangent_slopes(centre.y(), centre.z(), radius);
  const auto first = [](const std::vector<double>& reach, double slope) {
    return static_cast<int>(std::lower_bound(reach.begin(), reach.end(), slope) - reach.begin());
  };
  const auto last = [](const std::vector<double>& start, double slope) {
    return static_cast<int>(std::upper_bound(start.begin(), start.end(), slope) - start.begin());
  };
  return {first(column_max_, x.low), last(column_min_, x.high), first(row_max_, y.low),
          last(row_min_, y.high)};
}

DepthImage::DepthImage(std::shared_ptr<const ViewingRays> rays, std::vector<std::uint16_t> depth,
                       double units_per_metre, const Eigen::Isometry3d& world_from_camera)
    : rays_(std::move(rays)),
      depth_(std::move(depth)),
      units_per_metre_(units_per_metre),
      metres_per_unit_(1.0 / units_per_metre),
      world_from_camera_(world_from_camera) {
  if (!rays_) throw Error("depth image", "it has no camera", "give its viewing rays");
  const Intrinsics& k = rays_->intrinsics();
  if (depth_.size() != static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height)) {
    throw Error("depth image",
                std::to_string(depth_.size()) + " readings do not fill " + std::to_string(k.width) +
                    "x" + std::to_string(k.height) + " pixels",
                "give an image of the size that the intrinsics are for");
  }
  if (!(std::isfinite(units_per_metre_) && units_per_metre_ > 0.0)) {
    throw Error("depth image", "units per metre must be positive",
                "give 1000 for millimetres or 5000 for the TUM benchmark");
  }
  const Eigen::Matrix3d rotation = world_from_camera_.linear();
  const bool rigid = world_from_camera_.matrix().allFinite() &&
                     (rotation * rotation.transpose()).isIdentity(1e-6) &&
                     rotation.determinant() > 0.0;
  if (!rigid) {
    throw Error("camera pose", "it is not a rotation and a translation",
                "give a right-handed rigid transform, with a quaternion of length 1");
  }
}

void DepthImage::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(Vec3(world_from_camera_.translation()));
  const Vec3 centre =
      world_from_camera_.linear().transpose() * (ball.centre - world_from_camera_.translation());
  const ViewingRays::Window window = rays_->window(centre, ball.radius);
  if (window.empty()) return;

  // Too many pixels: take every stride-th of every stride-th row, on a grid fixed in the image.
  int stride = 1;
  const auto in_steps = [&stride](int length) { return (length + stride - 1) / stride; };
  while (static_cast<std::size_t>(in_steps(window.u_end - window.u_begin)) *
             static_cast<std::size_t>(in_steps(window.v_end - window.v_begin)) >
         std::max<std::size_t>(max_points, 1))
    ++stride;
  if (stride > 1) patch.mark_thinned();

  const Eigen::Matrix3f rotation = world_from_camera_.linear().cast<float>();
  const auto squared_radius = static_cast<float>(ball.radius * ball.radius);
  const auto width = static_cast<std::size_t>(rays_->intrinsics().width);
  const bool per_pixel = rays_->intrinsics().distorted();
  Block points;
  for (int v = in_steps(window.v_begin) * stride; v < window.v_end; v += stride) {
    const std::size_t row = static_cast<std::size_t>(v) * width;
    const double* ray_x = rays_->x_.data() + (per_pixel ? row : 0);
    const double* ray_y = rays_->y_.data() + (per_pixel ? row : static_cast<std::size_t>(v));
    for (int u = in_steps(window.u_begin) * stride; u < window.u_end; u += block * stride) {
      const int count = std::min(block, in_steps(window.u_end - u));
      deproject_row(depth_.data() + row + u, ray_x + u, per_pixel ? ray_y + u : ray_y,
                    per_pixel ? stride : 0, stride, count, metres_per_unit_, centre.x(), centre.y(),
                    centre.z(), points);
      for (int i = 0; i < count; ++i) {
        // Written so that a NaN (a pixel without a ray) is outside.
        if (!(points.squared[i] <= squared_radius)) continue;
        const Eigen::Vector3f p = rotation * Eigen::Vector3f(points.x[i], points.y[i], points.z[i]);
        patch.push(p.x(), p.y(), p.z());
      }
    }
  }
}

std::optional<Vec3> DepthImage::deproject(int u, int v) const noexcept {
  const Intrinsics& k = rays_->intrinsics();
  if (u < 0 || v < 0 || u >= k.width || v >= k.height) return std::nullopt;
  const std::uint16_t raw = depth_[static_cast<std::size_t>(v) * static_cast<std::size_t>(k.width) +
                                   static_cast<std::size_t>(u)];
  if (!is_measured(raw)) return std::nullopt;
  const Eigen::Vector2d ray = rays_->ray(u, v);
  if (!ray.allFinite()) return std::nullopt;
  const double z = raw * metres_per_unit_;
  return world_from_camera_ * Vec3(z * ray.x(), z * ray.y(), z);
}

std::vector<Vec3> DepthImage::points() const {
  const Intrinsics& k = rays_->intrinsics();
  std::vector<Vec3> points;
  points.reserve(depth_.size());
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      if (const auto p = deproject(u, v)) points.push_back(*p);
    }
  }
  return points;
}

}  // namespace palpate
