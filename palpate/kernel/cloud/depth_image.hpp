// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/cloud/material_map.hpp"
#include "palpate/kernel/core/cloud.hpp"

namespace palpate {

/// A pinhole camera. Optical frame: x right, y down, z forward; pixel centres at whole numbers.
struct Intrinsics {
  int width = 0;              ///< [px]
  int height = 0;             ///< [px]
  double fx = 0.0, fy = 0.0;  ///< [px] focal lengths, > 0
  double cx = 0.0, cy = 0.0;  ///< [px] principal point
  /// Rational Brown-Conrady distortion (k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's order); all zero: none.
  std::array<double, 8> distortion{};

  bool operator==(const Intrinsics&) const = default;
  [[nodiscard]] bool distorted() const { return distortion != std::array<double, 8>{}; }
};

/// @throws Error if sizes are not in 1..16384 or focal lengths are not positive and finite.
void validate(const Intrinsics& intrinsics);

/// A camera's viewing rays, computed once and shared by all of its frames.
///
/// The ray of pixel (u, v) is (x, y, 1) in the optical frame: x depends on u alone and y on v alone
/// unless the lens is distorted, when both are kept per pixel.
class ViewingRays {
 public:
  /// A pixel outside the lens's field, where the distortion has no inverse, gets no ray: what it
  /// reads is a hole. @throws Error if the intrinsics do not validate.
  explicit ViewingRays(const Intrinsics& intrinsics);

  [[nodiscard]] const Intrinsics& intrinsics() const noexcept { return intrinsics_; }
  /// (x, y) of the ray through pixel (u, v), 0 <= u < width, 0 <= v < height; NaN if it has none.
  [[nodiscard]] Eigen::Vector2d ray(int u, int v) const noexcept;

  /// Pixels [u_begin, u_end) x [v_begin, v_end).
  struct Window {
    int u_begin = 0, u_end = 0, v_begin = 0, v_end = 0;
    [[nodiscard]] bool empty() const noexcept { return u_begin >= u_end || v_begin >= v_end; }
    /// So that no more than `most` are left: every how many pixels and rows to take, on a grid
    /// fixed in the image. 1: all.
    [[nodiscard]] int stride(std::size_t most) const noexcept;
  };

  /// The pixels whose rays can meet a ball at `centre` [m, optical frame]; the whole image where
  /// the ball reaches behind the camera's plane. O(log(width + height)).
  [[nodiscard]] Window window(const Vec3& centre, double radius) const noexcept;

 private:
  friend class DepthImage;
  Intrinsics intrinsics_;
  std::vector<double> x_, y_;  // per column and row; per pixel, row by row, if distorted
  // Bounds of the rays in each column and row, made monotone: where a window can begin and end.
  std::vector<double> column_min_, column_max_, row_min_, row_max_;
};

/// The readings of a depth image, row by row, and what keeps them: a vector of their own, a
/// driver's buffer or another language's array. Copies share the readings. They must not change
/// meanwhile.
class DepthReadings {
 public:
  DepthReadings(std::vector<std::uint16_t> readings)  // NOLINT(google-explicit-constructor)
      : DepthReadings(std::make_shared<const std::vector<std::uint16_t>>(std::move(readings))) {}
  /// @param owner  keeps `readings` alive; released on whichever thread releases the image last
  DepthReadings(std::span<const std::uint16_t> readings, std::shared_ptr<const void> owner)
      : readings_(readings), owner_(std::move(owner)) {}

  [[nodiscard]] const std::uint16_t* data() const noexcept { return readings_.data(); }
  [[nodiscard]] std::size_t size() const noexcept { return readings_.size(); }
  [[nodiscard]] auto begin() const noexcept { return readings_.begin(); }
  [[nodiscard]] auto end() const noexcept { return readings_.end(); }
  [[nodiscard]] std::uint16_t front() const noexcept { return readings_.front(); }
  std::uint16_t operator[](std::size_t i) const noexcept { return readings_[i]; }
  [[nodiscard]] std::vector<std::uint16_t> copy() const { return {begin(), end()}; }
  operator std::span<const std::uint16_t>() const noexcept {  // NOLINT(google-explicit-constructor)
    return readings_;
  }
  friend bool operator==(const DepthReadings& a, std::span<const std::uint16_t> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }
  friend bool operator==(const DepthReadings& a, const DepthReadings& b) {
    return a == b.readings_;
  }

 private:
  explicit DepthReadings(const std::shared_ptr<const std::vector<std::uint16_t>>& readings)
      : DepthReadings(*readings, readings) {}

  std::span<const std::uint16_t> readings_;
  std::shared_ptr<const void> owner_;
};

/// Is this depth reading a measurement? 0 is "none", 65535 "saturated".
constexpr bool is_measured(std::uint16_t raw) noexcept { return raw != 0 && raw != 65535; }

/// One capture of a depth camera: 16-bit depth as it came, touched in place.
///
/// Section 4.2: a depth image already sorts its points by direction, so the points near the proxy
/// are found by projecting the sphere to a pixel window, and only that window is deprojected.
/// Depth 0 and 65535 are holes.
class DepthImage final : public Cloud {
 public:
  /// @param rays               the camera
  /// @param depth              row by row, width*height values; depth along the optical axis
  /// @param units_per_metre    e.g. 1000 for millimetres, 5000 for the TUM benchmark
  /// @param world_from_camera  rigid pose of the optical frame
  /// @param brightness         0 to 255 of each pixel, row by row; empty if it is not known
  /// @throws Error if the size does not match, the units are not positive, or the pose is not
  ///         rigid and finite.
  DepthImage(std::shared_ptr<const ViewingRays> rays, DepthReadings depth, double units_per_metre,
             const Eigen::Isometry3d& world_from_camera = Eigen::Isometry3d::Identity(),
             std::vector<std::uint8_t> brightness = {});

  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override;
  void gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                    Patch& patch) const noexcept override;
  void gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                    Patch& patch) const noexcept override;
  void gather_of(std::string_view material, const Ball& ball, std::size_t max_points,
                 Patch& patch) const noexcept override;
  /// Depth of `place` by the focal length; 0 outside the image (a lens's distortion not counted).
  [[nodiscard]] double spacing(const Vec3& place) const noexcept override;
  [[nodiscard]] bool has_noise() const noexcept override { return noise_ != nullptr; }
  [[nodiscard]] double noise_at(const Vec3& place, double usual) const noexcept override;
  [[nodiscard]] bool has_materials() const noexcept override { return materials_ != nullptr; }
  [[nodiscard]] bool has_brightness() const noexcept override {
    return !brightness_.empty() || (materials_ && materials_->has_brightness());
  }
  void sample(const Vec3& place, const Vec3& normal, double radius,
              SurfaceSample& sample) const noexcept override;

  [[nodiscard]] const DepthImage* image() const noexcept override { return this; }
  /// What its pixels feel like; null: nothing is known. Set before the image is shared.
  [[nodiscard]] const std::shared_ptr<const MaterialMap>& materials() const noexcept {
    return materials_;
  }
  void set_materials(std::shared_ptr<const MaterialMap> materials) noexcept {
    materials_ = std::move(materials);
  }

  /// The noise of each pixel in steps of 1 / noise_steps of a depth unit, row by row; null: it is
  /// not known. Copies of the image share it.
  using Noise = std::shared_ptr<const std::vector<std::uint16_t>>;
  static constexpr double noise_steps = 16.0;  ///< [-] in a unit of depth
  [[nodiscard]] const Noise& noise() const noexcept { return noise_; }
  /// Says how noisy each pixel's reading is. Before the image is shared.
  /// @param deviation  standard deviation along the optical axis, row by row, in the depth's own
  ///                   unit; rounded to noise_steps, and 65535 of these at most
  /// @throws Error if the size does not match, or one is negative or not finite.
  void set_noise(std::span<const float> deviation);
  /// The same of another image of that size. @throws Error if it is not.
  void set_noise(Noise noise);

  [[nodiscard]] bool scale_unsure() const noexcept override { return scale_unsure_; }
  void set_scale_unsure(bool is_unsure) noexcept { scale_unsure_ = is_unsure; }  ///< likewise
  /// Multiplies all depths, its readings staying as they are. Before the image is shared.
  /// @param factor  > 0
  void rescale(double factor) noexcept {
    units_per_metre_ /= factor;
    metres_per_unit_ = 1.0 / units_per_metre_;
  }
  /// The same image of a camera elsewhere. Before the image is shared.
  /// @throws Error if the pose is not rigid and finite.
  void set_world_from_camera(const Eigen::Isometry3d& world_from_camera);

  [[nodiscard]] const Intrinsics& intrinsics() const noexcept { return rays_->intrinsics(); }
  [[nodiscard]] const ViewingRays& rays() const noexcept { return *rays_; }
  /// For other images of the same camera.
  [[nodiscard]] const std::shared_ptr<const ViewingRays>& shared_rays() const noexcept {
    return rays_;
  }
  [[nodiscard]] const DepthReadings& depth() const noexcept { return depth_; }
  /// As given. Where a MaterialMap has a brightness, that is felt instead.
  [[nodiscard]] const std::vector<std::uint8_t>& brightness() const noexcept { return brightness_; }
  [[nodiscard]] double units_per_metre() const noexcept { return units_per_metre_; }
  [[nodiscard]] const Eigen::Isometry3d& world_from_camera() const noexcept {
    return world_from_camera_;
  }

  /// [m] along the optical axis at pixel (u, v), which must be in the image; 0 for a hole.
  [[nodiscard]] double depth_at(int u, int v) const noexcept;
  /// [m] Standard deviation of the reading of pixel (u, v), which must be in the image: what was
  /// set, and no less than rounding to the unit makes; `usual` [m] of a hole, or if none was set.
  [[nodiscard]] double noise_at(int u, int v, double usual) const noexcept;
  /// The point that pixel (u, v) measured [m, world]; none for a hole or outside the image.
  [[nodiscard]] std::optional<Vec3> deproject(int u, int v) const noexcept;
  /// All measured points [m, world], row by row.
  [[nodiscard]] std::vector<Vec3> points() const;

 private:
  void gather(const Ball& ball, const SightCone* sight, std::size_t max_points,
              Patch& patch) const noexcept;
  std::shared_ptr<const ViewingRays> rays_;
  DepthReadings depth_;
  double units_per_metre_;
  double metres_per_unit_;
  bool scale_unsure_ = false;
  Eigen::Isometry3d world_from_camera_;
  std::vector<std::uint8_t> brightness_;
  std::shared_ptr<const MaterialMap> materials_;
  Noise noise_;
};

inline double DepthImage::depth_at(int u, int v) const noexcept {
  const std::uint16_t raw =
      depth_[static_cast<std::size_t>(v) * static_cast<std::size_t>(rays_->intrinsics().width) +
             static_cast<std::size_t>(u)];
  return is_measured(raw) ? raw * metres_per_unit_ : 0.0;
}

inline double DepthImage::noise_at(int u, int v, double usual) const noexcept {
  if (!noise_ || depth_at(u, v) == 0.0) return usual;
  constexpr double rounding = 0.28867513459481287;  // [units] a step's, 1 / sqrt(12)
  const double steps =
      (*noise_)[static_cast<std::size_t>(v) * static_cast<std::size_t>(intrinsics().width) +
                static_cast<std::size_t>(u)];
  return std::max(steps / noise_steps, rounding) * metres_per_unit_;
}

}  // namespace palpate
