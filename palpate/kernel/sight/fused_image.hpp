// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/sight/height_track.hpp"

namespace palpate {

/// A camera's newest depth image, in which the pixels about a contact have their averages over the
/// frames so far. docs/sight.md, 5.
///
/// A pixel's depth is modelled as level + relief + noise: all pixels share the level, which moves;
/// each has a relief of its own, which stays. The level is estimated as a fit's height is
/// (`track_height`). The relief is a mean, which begins again where new frames contradict it. When
/// the camera moves, all begins again.
///
/// [servo] Nothing here allocates, locks or throws after construction.
class FusedImage final : public Cloud {
 public:
  /// A new frame at a contact.
  struct Look {
    Vec3 place;       ///< [m] world, on the surface
    double radius;    ///< [m] about it: the pixels that measure the level
    double stamp;     ///< [s]
    double interval;  ///< [s] until the next frame
    double sd;        ///< [m] standard deviation of one frame's level
  };

  FusedImage() : window_(1) {}

  /// @param image  must live until the next call, or until `forget`
  void observe(const DepthImage& image, const Look& look,
               const SightParameters& parameters) noexcept;
  void forget() noexcept { frames_ = 0; }
  /// Is there an average? That of the first frame is that frame.
  [[nodiscard]] bool active() const noexcept { return frames_ > 1; }
  /// How far the newest frame has moved the surface from where the one before had it [m, world].
  [[nodiscard]] Vec3 correction() const noexcept { return correction_ * ray_; }
  /// How far the surface has moved at time t [s] since the newest frame [m, world].
  [[nodiscard]] Vec3 displacement(double t) const noexcept {
    return moved_since(velocity_, t - stamp_, interval_) * ray_;
  }
  /// Is a place [m, world] in front of the average of the pixel that sees it? Only while active.
  [[nodiscard]] bool is_in_front(const Vec3& place) const noexcept;

  // As Cloud; only after `observe`. Points beside the window are the newest frame's.
  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept override;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept override {
    image_->gather(beam, max_points, patch);
  }
  void gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                    Patch& patch) const noexcept override;
  void gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                    Patch& patch) const noexcept override;
  [[nodiscard]] double spacing(const Vec3& place) const noexcept override {
    return image_->spacing(place);
  }

 private:
  static constexpr int side = 64;  // [px] of the window, a power of two
  static constexpr std::size_t pixels = std::size_t{side} * side;
  /// What is known of each pixel.
  struct Window {
    std::array<float, pixels> relief;  // [m] depth at level 0
    std::array<float, pixels> drift;   // [m] mean of the newest deviations from it
    std::array<float, pixels> frames;  // [-] in the relief; 0: unknown
    std::array<float, pixels> missed;  // [-] frames in a row without a measurement
  };

  void restart(const DepthImage& image, int u, int v) noexcept;
  void move_to(int u, int v) noexcept;
  bool find_level(int u, int v, double radius) noexcept;
  void update() noexcept;
  void update(std::size_t i, float z, float spread) noexcept;
  /// Of a pixel of the image in the window, which it keeps while the window moves.
  [[nodiscard]] static std::size_t index(int u, int v) noexcept {
    return static_cast<std::size_t>((v & (side - 1)) * side + (u & (side - 1)));
  }
  [[nodiscard]] bool holds(int u, int v) const noexcept {
    return u >= u_ && v >= v_ && u < u_ + side && v < v_ + side;
  }
  /// [m] at a pixel of the image: the average, or as measured where there is none; 0: nothing.
  [[nodiscard]] double depth(int u, int v) const noexcept {
    return holds(u, v) && window_[0].frames[index(u, v)] > 0.0F
               ? double{window_[0].relief[index(u, v)]} + level_
               : image_->depth_at(u, v);
  }

  std::vector<Window> window_;  // one, on the heap
  int u_ = 0, v_ = 0;           // [px] its first pixel, in the image
  const DepthImage* image_ = nullptr;
  Intrinsics camera_;  // of the frames so far
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  std::size_t frames_ = 0;
  std::array<HeightSample, most_heights> levels_{};  // the newest first
  float newest_ = 0.0F;                              // [m] the newest frame's level
  float spread_ = 0.0F;                              // [m] of pixels about level and relief
  double mean_noise_ = 1.0;                          // [m] that the image says of these pixels
  double level_ = 0.0;                               // [m] as estimated
  double correction_ = 0.0;                          // [m]
  double velocity_ = 0.0;                            // [m/s]
  double stamp_ = 0.0, interval_ = 0.0;              // [s]
  Vec3 ray_ = Vec3::UnitZ();                         // world, one metre deep
};

}  // namespace palpate
