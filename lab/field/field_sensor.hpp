// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "lab/field/field_scene.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate::lab::field {

/// Random numbers from a seed, the same on every machine: splitmix64.
class Chance {
 public:
  explicit Chance(std::uint64_t seed) : state_(seed) {}

  [[nodiscard]] std::uint64_t bits() {
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
  }
  /// Evenly from [0, 1).
  [[nodiscard]] double even() { return static_cast<double>(bits() >> 11U) * 0x1p-53; }
  [[nodiscard]] double even(double low, double high) { return low + (high - low) * even(); }
  /// From a normal distribution of mean 0 and deviation 1, cut off at 4 deviations.
  [[nodiscard]] double normal();
  /// Fills `out` with such numbers.
  void fill_normal(std::span<double> out);

 private:
  std::uint64_t state_;
};

enum class SensorKind {
  stereo,  ///< two eyes: disparity in steps, noise even over the matching window, shadows
  light,   ///< structured light: 11 bits of disparity in steps of 1/8 px, shadows
  flight,  ///< indirect time of flight: range noise, wiggling, flying pixels at edges
  coarse,  ///< the same with few wide pixels, each the mean over what it spans
  exact,   ///< no noise, 0.1 mm units
};
constexpr int sensor_kinds = 5;
const char* to_string(SensorKind kind);

/// A depth camera. Lengths in metres, along the optical axis unless they are ranges.
struct SensorSetup {
  SensorKind kind = SensorKind::exact;
  int width = 160, height = 160;  ///< [px]
  double focal = 400.0;           ///< [px]
  double baseline = 0.05;         ///< [m] stereo, light: from the first eye to the second, along x
  double quantum = 0.0;           ///< [px] stereo, light: step of the disparity
  /// Deviation of the noise: stereo, light: [px] of disparity; flight, coarse: [m] of the range at
  /// 1 m, seen squarely. It grows with the range and by 1 / sqrt(cos) of the angle of incidence.
  double noise = 0.0;
  int window = 1;         ///< [px] side of the square over which noise is alike, odd
  double memory = 0.0;    ///< [-] correlation of the noise from frame to frame (AR(1))
  double wiggle = 0.0;    ///< [m] flight, coarse: amplitude of the error that swings with the range
  double holes = 0.0;     ///< [-] share of pixels without a reading, at random
  double units = 1000.0;  ///< [1/m] of the depth image
  std::uint64_t seed = 0;
};

/// A depth camera in its place. Captures are taken in the order of time, since noise has a memory.
class Sensor {
 public:
  Sensor(const SensorSetup& setup, const Eigen::Isometry3d& world_from_camera);

  [[nodiscard]] std::shared_ptr<const DepthImage> capture(const FieldScene& scene, double t);

  /// [m] Deviation that is meant for the depth of a surface at depth `z` that faces the camera,
  /// steps of the disparity and of the units counted as even noise.
  [[nodiscard]] double deviation(double z) const;
  /// [m] Width of a pixel at depth `z`.
  [[nodiscard]] double pitch(double z) const { return z / setup_.focal; }
  [[nodiscard]] const SensorSetup& setup() const { return setup_; }
  [[nodiscard]] Vec3 eye() const { return world_from_camera_.translation(); }
  /// [m] Depth of a place.
  [[nodiscard]] double depth_of(const Vec3& place) const;
  /// Is a place inside the image, and no body of `scene` before it but within `margin` [m]?
  [[nodiscard]] bool sees(const Snapshot& scene, const Vec3& place, double margin) const;

 private:
  using Image = std::vector<double>;
  // What a sensor without noise has of each pixel; range 0: nothing there.
  struct Clean {
    Image range;      // [m] along the ray
    Image cosine;     // [-] of the angle of incidence
    Image disparity;  // [px] stereo, light
    std::vector<bool> hole;
  };
  [[nodiscard]] bool triangulates() const {
    return setup_.kind == SensorKind::stereo || setup_.kind == SensorKind::light;
  }
  void trace_rays(const FieldScene& scene, double t);
  void look(const FieldScene& scene, double t);
  void find_shadows();
  void fatten_edges();
  void next_noise();
  [[nodiscard]] double measured_depth(int u, int v);
  [[nodiscard]] std::size_t pixel(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(setup_.width) +
           static_cast<std::size_t>(u);
  }

  SensorSetup setup_;
  Eigen::Isometry3d world_from_camera_;
  std::shared_ptr<const ViewingRays> viewing_rays_;
  int sub_;                 // rays along a pixel's side
  std::vector<Vec3> ways_;  // [-] world, of the rays, row by row
  Image along_;             // [-] depth of a pixel at range 1
  Image still_, ranges_;    // [m] of the rays: what never moves, and all
  bool traced_ = false;     // `still_` is known
  bool looked_ = false;     // `clean_` is of a scene in which nothing moves
  Clean clean_;
  Image noise_, fresh_, padded_, rows_;
  bool remembers_ = false;  // `noise_` is that of the frame before
  Chance chance_;
};

/// The pose of a camera `distance` from `target` [m], off straight above by `tilt` towards
/// `azimuth`, turned about its axis by `roll` [rad].
Eigen::Isometry3d camera_pose(const Vec3& target, double distance, double tilt, double azimuth,
                              double roll);

}  // namespace palpate::lab::field
