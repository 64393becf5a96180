// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/depth_image.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "palpate/kernel/cloud/implied_points.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/vectorise.hpp"

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

// The pixel window is read in strips of at most so many columns, and the rows of a strip are laid
// end to end in chunks of at most so many pixels: long loops, whatever the window's shape.
constexpr std::size_t strip_width = 128;
constexpr std::size_t chunk_size = 512;

constexpr std::size_t whole_blocks(std::size_t size) {
  return (size + Patch::block - 1) / Patch::block * Patch::block;
}

template <class T, std::size_t size>
struct alignas(64) Lanes : std::array<T, size + Patch::block> {};

struct Pixels {
  Lanes<std::int32_t, chunk_size> raw;
  Lanes<float, chunk_size> slope_x, slope_y;  // relative to the reference ray
};

struct Points {
  Lanes<float, chunk_size> x, y, z;
  Lanes<std::int32_t, chunk_size> inside;  // 1 or 0
};

// What turns pixels into points relative to the ball's centre, in world axes:
//
//   p = z * (slope_x * axis_x + slope_y * axis_y) + (z - z_0) * ray + offset
//
// with slopes relative to a reference ray and depths relative to a reference z_0, both near the
// ball. Every term is about as long as the ball's radius, so floats hold it to a few 1e-7 of that:
// some nanometres for a ball of 11 mm. The plain z * (x, y, 1) - centre would lose a micrometre.
struct Reference {
  double slope_x, slope_y;
  std::int32_t raw;
  float z, metres_per_unit, squared_radius;
  Eigen::Vector3f axis_x, axis_y, ray, offset;
};

PALPATE_VECTORISED
void deproject_pixels(const Pixels& pixels, std::size_t size, const Reference& reference,
                      Points& points) {
  const std::int32_t raw_0 = reference.raw;
  const float z_0 = reference.z;
  const float metres = reference.metres_per_unit;
  const float squared_radius = reference.squared_radius;
  const Eigen::Vector3f a = reference.axis_x;
  const Eigen::Vector3f b = reference.axis_y;
  const Eigen::Vector3f c = reference.ray;
  const Eigen::Vector3f d = reference.offset;
  const std::size_t end = whole_blocks(size);
#pragma omp simd
  for (std::size_t i = 0; i < end; ++i) {
    const std::int32_t raw = pixels.raw[i];
    const float dz = static_cast<float>(raw - raw_0) * metres;
    const float u = (z_0 + dz) * pixels.slope_x[i];
    const float v = (z_0 + dz) * pixels.slope_y[i];
    const float x = u * a.x() + (v * b.x() + (dz * c.x() + d.x()));
    const float y = u * a.y() + (v * b.y() + (dz * c.y() + d.y()));
    const float z = u * a.z() + (v * b.z() + (dz * c.z() + d.z()));
    points.x[i] = x;
    points.y[i] = y;
    points.z[i] = z;
    // Written so that a NaN (a pixel without a ray) is outside.
    const bool near = x * x + y * y + z * z <= squared_radius;
    points.inside[i] = (near & (raw != 0) & (raw != 65535)) ? 1 : 0;
  }
}

// A SightCone in floats.
struct Cone {
  Eigen::Vector3f axis;
  float reach, radius, widening;  // radius + widening * along
};

PALPATE_VECTORISED
void keep_inside(const Cone& cone, std::size_t size, Points& points) {
  const Eigen::Vector3f axis = cone.axis;
  const float reach = cone.reach;
  const float radius = cone.radius;
  const float widening = cone.widening;
  const std::size_t end = whole_blocks(size);
#pragma omp simd
  for (std::size_t i = 0; i < end; ++i) {
    const float x = points.x[i];
    const float y = points.y[i];
    const float z = points.z[i];
    const float along = x * axis.x() + (y * axis.y() + z * axis.z());
    const float r = radius + widening * along;
    const bool near = x * x + y * y + z * z - along * along <= r * r;
    const bool keep = near & (r > 0.0F) & (along <= reach) & (-along <= reach);
    points.inside[i] = keep ? points.inside[i] : 0;
  }
}

// Part of a pixel window: `rows` of `columns`, every stride-th of each.
struct Strip {
  const std::uint16_t* depth;  // its first pixel
  std::size_t readable;        // pixels from there to the image's end
  std::size_t row_length;
  const double* ray_x;  // of the first pixel; with a block to spare after the last
  const double* ray_y;
  bool ray_per_pixel;  // else ray_x is per column and ray_y per row
  std::size_t stride, columns, rows;
};

// The ways to read a row, all of whole blocks where that is possible: what lies beyond the last
// column is overwritten by the next row.
void read_slopes(const double* rays, const Strip& strip, double reference, float* slopes) noexcept {
  if (strip.stride == 1) {
    for (std::size_t i = 0; i < whole_blocks(strip.columns); ++i)
      slopes[i] = static_cast<float>(rays[i] - reference);
  } else {
    for (std::size_t i = 0; i < strip.columns; ++i)
      slopes[i] = static_cast<float>(rays[i * strip.stride] - reference);
  }
}

PALPATE_VECTORISED
void gather_strip(const Strip& strip, const Reference& reference, const Cone* cone, Patch& patch) {
  Pixels pixels;
  Points points;
  std::size_t size = 0;
  const std::size_t lanes = whole_blocks(strip.columns);
  const auto flush = [&] {
    for (std::size_t i = size; i < size + Patch::block; ++i) {
      pixels.raw[i] = 0;
      pixels.slope_x[i] = pixels.slope_y[i] = 0.0F;
    }
    vectorised<deproject_pixels>(pixels, size, reference, points);
    if (cone != nullptr) vectorised<keep_inside>(*cone, size, points);
    patch.append(points.x.data(), points.y.data(), points.z.data(), points.inside.data(),
                 whole_blocks(size));
    size = 0;
  };
  Lanes<float, strip_width> column_slopes;
  if (!strip.ray_per_pixel)
    read_slopes(strip.ray_x, strip, reference.slope_x, column_slopes.data());

  for (std::size_t row = 0; row < strip.rows; ++row) {
    if (size + lanes > chunk_size) flush();
    float* slope_x = pixels.slope_x.data() + size;
    float* slope_y = pixels.slope_y.data() + size;
    std::int32_t* raw = pixels.raw.data() + size;
    const std::size_t first = row * strip.stride * strip.row_length;
    if (strip.ray_per_pixel) {
      read_slopes(strip.ray_x + first, strip, reference.slope_x, slope_x);
      read_slopes(strip.ray_y + first, strip, reference.slope_y, slope_y);
    } else {
      const auto slope = static_cast<float>(strip.ray_y[row * strip.stride] - reference.slope_y);
      for (std::size_t i = 0; i < lanes; ++i) {
        slope_x[i] = column_slopes[i];
        slope_y[i] = slope;
      }
    }
    const std::uint16_t* depth = strip.depth + first;
    if (strip.stride == 1 && first + lanes <= strip.readable) {
      for (std::size_t i = 0; i < lanes; ++i) raw[i] = depth[i];
    } else {
      for (std::size_t i = 0; i < strip.columns; ++i) raw[i] = depth[i * strip.stride];
    }
    size += strip.columns;
  }
  flush();
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
  x_.resize(x_.size() + Patch::block);  // so that a row can be read in whole blocks
  y_.resize(y_.size() + Patch::block);
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

int ViewingRays::Window::stride(std::size_t most) const noexcept {
  int stride = 1;
  const auto in_steps = [&stride](int length) {
    return static_cast<std::size_t>((length + stride - 1) / stride);
  };
  while (in_steps(u_end - u_begin) * in_steps(v_end - v_begin) > std::max<std::size_t>(most, 1))
    ++stride;
  return stride;
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

DepthImage::DepthImage(std::shared_ptr<const ViewingRays> rays, DepthReadings depth,
                       double units_per_metre, const Eigen::Isometry3d& world_from_camera,
                       std::vector<std::uint8_t> brightness)
    : rays_(std::move(rays)),
      depth_(std::move(depth)),
      units_per_metre_(units_per_metre),
      metres_per_unit_(1.0 / units_per_metre),
      brightness_(std::move(brightness)) {
  if (!rays_) throw Error("depth image", "it has no camera", "give its viewing rays");
  const Intrinsics& k = rays_->intrinsics();
  if (depth_.size() != static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height)) {
    throw Error("depth image",
                std::to_string(depth_.size()) + " readings do not fill " + std::to_string(k.width) +
                    "x" + std::to_string(k.height) + " pixels",
                "give an image of the size that the intrinsics are for");
  }
  if (!brightness_.empty() && brightness_.size() != depth_.size()) {
    throw Error("depth image",
                std::to_string(brightness_.size()) + " values of brightness for " +
                    std::to_string(depth_.size()) + " pixels",
                "give one for each pixel, or none");
  }
  if (!(std::isfinite(units_per_metre_) && units_per_metre_ > 0.0)) {
    throw Error("depth image", "units per metre must be positive",
                "give 1000 for millimetres or 5000 for the TUM benchmark");
  }
  set_world_from_camera(world_from_camera);
}

void DepthImage::set_world_from_camera(const Eigen::Isometry3d& world_from_camera) {
  check_rigid(world_from_camera, "camera pose");
  world_from_camera_ = world_from_camera;
}

void DepthImage::set_noise(std::span<const float> deviation) {
  std::vector<std::uint16_t> steps(deviation.size());
  for (std::size_t i = 0; i < deviation.size(); ++i) {
    if (!(std::isfinite(deviation[i]) && deviation[i] >= 0.0F)) {
      const auto width = static_cast<std::size_t>(intrinsics().width);
      throw Error(
          "noise",
          "it is " + std::to_string(deviation[i]) + " at row " + std::to_string(i / width) +
              ", column " + std::to_string(i % width),
          "give a standard deviation, 0 or more, for each pixel, also where depth has holes");
    }
    constexpr float most = 65535.0F;
    steps[i] = static_cast<std::uint16_t>(
        std::lround(std::min(static_cast<float>(noise_steps) * deviation[i], most)));
  }
  set_noise(std::make_shared<const std::vector<std::uint16_t>>(std::move(steps)));
}

void DepthImage::set_noise(Noise noise) {
  if (noise && noise->size() != depth_.size())
    throw Error(
        "noise",
        std::to_string(noise->size()) + " values for " + std::to_string(depth_.size()) + " pixels",
        "give one for each pixel, or none");
  noise_ = std::move(noise);
}

void DepthImage::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  patch.start_view(Vec3(world_from_camera_.translation()));
  gather(ball, nullptr, max_points, patch);
}

void DepthImage::gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept {
  const Vec3 viewpoint = world_from_camera_.translation();
  patch.start_view(viewpoint);
  const SightCone cone(beam, viewpoint);
  gather(Ball{beam.through, beam.radius}, &cone, max_points, patch);
}

// The points within the ball; with a cone, those that the ball's pixels see within that.
void DepthImage::gather(const Ball& ball, const SightCone* sight, std::size_t max_points,
                        Patch& patch) const noexcept {
  const Vec3 centre =
      world_from_camera_.linear().transpose() * (ball.centre - world_from_camera_.translation());
  const ViewingRays::Window window = rays_->window(centre, ball.radius);
  if (window.empty()) return;

  const int stride = window.stride(max_points);
  const auto in_steps = [stride](int length) { return (length + stride - 1) / stride; };
  if (stride > 1) patch.mark_thinned(1.0 / (stride * stride));

  // What the points are reckoned from: the reading and the ray nearest to the ball's centre; the
  // camera itself where the ball reaches behind it.
  const bool in_front = centre.z() > ball.radius;
  const Vec3 ray = in_front ? Vec3(centre / centre.z()) : Vec3::UnitZ();
  const double raw =
      in_front ? std::clamp(std::round(centre.z() * units_per_metre_), 0.0, 65535.0) : 0.0;
  const double z = raw * metres_per_unit_;
  const Eigen::Matrix3d rotation = world_from_camera_.linear();
  const Reference reference{.slope_x = ray.x(),
                            .slope_y = ray.y(),
                            .raw = static_cast<std::int32_t>(raw),
                            .z = static_cast<float>(z),
                            .metres_per_unit = static_cast<float>(metres_per_unit_),
                            .squared_radius = sight == nullptr
                                                  ? static_cast<float>(ball.radius * ball.radius)
                                                  : std::numeric_limits<float>::max(),
                            .axis_x = rotation.col(0).cast<float>(),
                            .axis_y = rotation.col(1).cast<float>(),
                            .ray = (rotation * ray).cast<float>(),
                            .offset = (rotation * (z * ray - centre)).cast<float>()};

  Cone cone{};
  if (sight != nullptr) {
    cone = {.axis = sight->axis().cast<float>(),
            .reach = static_cast<float>(sight->reach()),
            .radius = static_cast<float>(sight->radius_at(0.0)),
            .widening = static_cast<float>(sight->radius_at(1.0) - sight->radius_at(0.0))};
  }

  const bool per_pixel = rays_->intrinsics().distorted();
  const auto width = static_cast<std::size_t>(rays_->intrinsics().width);
  const int first_v = in_steps(window.v_begin) * stride;
  const int strip_pixels = static_cast<int>(strip_width) * stride;
  for (int u = in_steps(window.u_begin) * stride; u < window.u_end; u += strip_pixels) {
    const auto column = static_cast<std::size_t>(u);
    const auto row = static_cast<std::size_t>(first_v);
    const std::size_t pixel = row * width + column;
    vectorised<gather_strip>(
        {.depth = depth_.data() + pixel,
         .readable = depth_.size() - pixel,
         .row_length = width,
         .ray_x = rays_->x_.data() + (per_pixel ? pixel : column),
         .ray_y = rays_->y_.data() + (per_pixel ? pixel : row),
         .ray_per_pixel = per_pixel,
         .stride = static_cast<std::size_t>(stride),
         .columns = std::min(strip_width, static_cast<std::size_t>(in_steps(window.u_end - u))),
         .rows = static_cast<std::size_t>(in_steps(window.v_end - first_v))},
        reference, sight == nullptr ? nullptr : &cone, patch);
  }
}

void DepthImage::gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                              Patch& patch) const noexcept {
  palpate::gather_sides(
      *this, [this](int u, int v) { return depth_at(u, v); }, ball, sides, max_points, patch);
}

void DepthImage::gather_of(std::string_view material, const Ball& ball, std::size_t max_points,
                           Patch& patch) const noexcept {
  patch.start_view(Vec3(world_from_camera_.translation()));
  const std::uint8_t label = materials_ == nullptr ? 0 : materials_->table()->label(material);
  if (label == 0) return;
  const Eigen::Matrix3d rotation = world_from_camera_.linear();
  const Vec3 centre = rotation.transpose() * (ball.centre - world_from_camera_.translation());
  const ViewingRays::Window window = rays_->window(centre, ball.radius);
  if (window.empty()) return;
  const int stride = window.stride(max_points);
  if (stride > 1) patch.mark_thinned(1.0 / (stride * stride));
  const auto on_grid = [stride](int first) { return (first + stride - 1) / stride * stride; };
  const auto width = static_cast<std::size_t>(intrinsics().width);
  for (int v = on_grid(window.v_begin); v < window.v_end; v += stride) {
    for (int u = on_grid(window.u_begin); u < window.u_end; u += stride) {
      const std::size_t pixel = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
      const double z = depth_[pixel] * metres_per_unit_;
      const Eigen::Vector2d ray = rays_->ray(u, v);
      if (!is_measured(depth_[pixel]) || !ray.allFinite()) continue;
      const Vec3 p = Vec3(z * ray.x(), z * ray.y(), z) - centre;
      if (p.squaredNorm() > ball.radius * ball.radius) continue;
      const Vec3 q = rotation * p;
      if (materials_->label(pixel, Vec3(ball.centre + q)) != label) continue;
      patch.push(static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z()));
    }
  }
}

void DepthImage::gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                              Patch& patch) const noexcept {
  palpate::gather_sheet(
      *this, [this](int u, int v) { return depth_at(u, v); }, ball, sheet, max_points, patch);
}

double DepthImage::spacing(const Vec3& place) const noexcept {
  const Intrinsics& camera = intrinsics();
  const Vec3 p =
      world_from_camera_.linear().transpose() * (place - world_from_camera_.translation());
  const double u = camera.fx * p.x() / p.z() + camera.cx;
  const double v = camera.fy * p.y() / p.z() + camera.cy;
  const bool inside =
      p.z() > 0.0 && u > -0.5 && v > -0.5 && u < camera.width - 0.5 && v < camera.height - 0.5;
  return inside ? p.z() / std::min(camera.fx, camera.fy) : 0.0;
}

double DepthImage::noise_at(const Vec3& place, double usual) const noexcept {
  const Intrinsics& k = intrinsics();
  const Vec3 p =
      world_from_camera_.linear().transpose() * (place - world_from_camera_.translation());
  if (!(noise_ && p.z() > 0.0)) return usual;
  Eigen::Vector2d ray(p.x() / p.z(), p.y() / p.z());
  if (k.distorted()) ray = distort(k.distortion, ray);
  const double u = std::floor(k.fx * ray.x() + k.cx + 0.5);
  const double v = std::floor(k.fy * ray.y() + k.cy + 0.5);
  if (!(u >= 0.0 && v >= 0.0 && u < k.width && v < k.height)) return usual;
  return noise_at(static_cast<int>(u), static_cast<int>(v), usual);
}

void DepthImage::sample(const Vec3& place, const Vec3& normal, double radius,
                        SurfaceSample& sample) const noexcept {
  constexpr std::size_t most_pixels = 400;
  // [pixels] so that a sample holds several however coarse they are
  constexpr double fewest_pixels = 1.5;
  // [m] of the layer that counts as this surface: noise is less, and what is behind it farther.
  constexpr double thickness = 10e-3;
  // [-] share of the weights' spread that their centre may be off, or the slope is a guess.
  constexpr double least_spread = 0.02;
  if ((!has_materials() && !has_brightness()) || !place.allFinite()) return;
  const Eigen::Matrix3d rotation = world_from_camera_.linear();
  const Vec3 centre = rotation.transpose() * (place - world_from_camera_.translation());
  const Vec3 up = rotation.transpose() * normal;
  const Intrinsics& k = intrinsics();
  if (!(centre.z() > radius)) return;
  const double reach = std::max(radius, fewest_pixels * centre.z() / std::min(k.fx, k.fy));
  const ViewingRays::Window window = rays_->window(centre, reach);
  if (window.empty()) return;
  const int stride = window.stride(most_pixels);
  const Vec3 along = up.unitOrthogonal();
  const Vec3 across = up.cross(along);
  const bool by_map = materials_ && materials_->has_brightness();
  const bool by_point = materials_ && !materials_->is_by_pixel();
  const bool slopes = has_brightness() && !sample.has_slope;

  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();  // weighted, of (1, x, y) in `reach`
  Vec3 products = Vec3::Zero();                       // of the same with the brightness
  for (int v = window.v_begin; v < window.v_end; v += stride) {
    for (int u = window.u_begin; u < window.u_end; u += stride) {
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(k.width) +
                            static_cast<std::size_t>(u);
      const std::uint16_t raw = depth_[i];
      if (!is_measured(raw)) continue;
      const double z = raw * metres_per_unit_;
      const Eigen::Vector2d ray = rays_->ray(u, v);
      const Vec3 p = Vec3(z * ray.x(), z * ray.y(), z) - centre;
      const double x = p.dot(along) / reach;
      const double y = p.dot(across) / reach;
      const double left = 1.0 - x * x - y * y;
      // Written so that a NaN (a pixel without a ray) is outside.
      if (!(left > 0.0 && std::abs(p.dot(up)) <= thickness)) continue;
      const double weight = left * left;
      const Vec3 point = by_point ? Vec3(world_from_camera_ * Vec3(p + centre)) : Vec3::Zero();
      if (materials_) sample.add(materials_->material(i, point), weight);
      if (!slopes) continue;
      const double bright = (by_map ? materials_->brightness(i, point) : brightness_[i]) / 255.0;
      const Vec3 row(1.0, x, y);
      squares += weight * row * row.transpose();
      products += weight * bright * row;
    }
  }
  if (!slopes || !(squares(0, 0) > 0.0)) return;
  const double variance =
      std::min(squares(1, 1), squares(2, 2)) / squares(0, 0);  // of x and y about the place
  const double determinant = squares.determinant();
  if (!(variance > least_spread) ||
      !(determinant > least_spread * squares(0, 0) * squares(1, 1) * squares(2, 2)))
    return;
  const Vec3 plane = squares.inverse() * products;
  sample.slope = rotation * Vec3((plane.y() * along + plane.z() * across) / reach);
  sample.has_slope = true;
}

std::optional<Vec3> DepthImage::deproject(int u, int v) const noexcept {
  const Intrinsics& k = rays_->intrinsics();
  if (u < 0 || v < 0 || u >= k.width || v >= k.height) return std::nullopt;
  const double z = depth_at(u, v);
  const Eigen::Vector2d ray = rays_->ray(u, v);
  if (!(z > 0.0 && ray.allFinite())) return std::nullopt;
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
