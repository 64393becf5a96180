// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// The errors of a depth camera. With the defaults true depth is only rounded.
struct SensorModel {
  double noise = 0.0;  ///< [m] standard deviation along the optical axis
  /// Unless 0, `noise` is that at 1 m and grows with this power of depth: 2 by triangulation, 1 by
  /// time of flight.
  int noise_growth = 0;
  /// [px] distance at which the noise's correlation falls to 1/e, exp(-(du/x)^2 - (dv/y)^2);
  /// 0: white along that axis.
  double correlation_x = 0.0, correlation_y = 0.0;
  /// After so many frames `noise` is another, independent one; in between it changes smoothly with
  /// the same deviation. 1: every frame has fresh noise.
  std::uint64_t noise_frames = 1;
  /// [-] standard deviation of the scale of all depths, which changes likewise over 300 frames.
  double drift = 0.0;
  /// Add the noise of a RealSense D4xx, as measured on a resting table: 1.7, 3.1 and 5.2 mm at
  /// 0.45, 0.7 and 0.9 m, correlated over 10 to 20 pixels.
  bool d4xx_noise = false;
  /// [m] difference between two neighbouring readings at 1 m where the camera counts disparities;
  /// grows with the square of depth. 0: no such steps.
  double disparity_step = 0.0;
  double quantisation = 1e-4;  ///< [m] one unit of the image; 65534 of them is the farthest reading
  double dropouts = 0.0;       ///< [-] share of pixels that are holes at random
  double grazing =
      1.5707963267948966;  ///< [rad] holes where the sightline is this far off the normal
  double flying = 0.0;     ///< [-] share of pixels at depth edges that lie between both depths
  std::uint64_t seed = 1;

  /// An exact camera, a RealSense D4xx, a first Kinect, a camera that times light, or depth that a
  /// network made of colour ("ideal", "d4xx", "kinect", "tof", "learned").
  /// @throws Error for any other name.
  static SensorModel named(std::string_view name);
};

/// @throws Error naming the first field that is not finite or out of range.
void validate(const SensorModel& model);

/// Measures depth images. The reading depends on the model, the true depth and the frame's number
/// alone: not on which frames were measured before.
class Sensor {
 public:
  /// @throws Error if the model or the intrinsics do not validate.
  Sensor(const SensorModel& model, const Intrinsics& intrinsics);

  /// @param depth  [m] true depth row by row, infinite where there is nothing; width*height values
  /// @return       readings in units of model().quantisation, 0 for holes
  [[nodiscard]] std::vector<std::uint16_t> measure(std::span<const float> depth,
                                                   std::uint64_t frame);

  [[nodiscard]] const SensorModel& model() const { return model_; }

 private:
  void add_gaussian_noise(std::uint64_t frame);
  void drift(std::uint64_t frame);
  void add_d4xx_noise(std::uint64_t frame);
  void let_edges_fly(std::span<const float> truth, std::uint64_t frame);
  void blank_grazing(std::span<const float> truth, std::vector<std::uint16_t>& readings) const;

  SensorModel model_;
  Intrinsics camera_;
  std::vector<float> kernel_x_, kernel_y_;  // odd lengths, sum of squares 1
  // Buffers, kept to allocate once.
  std::vector<float> depth_, field_, next_field_, rows_;
  std::vector<double> sums_;
};

/// 5.2: zero-mean Gaussian noise on each coordinate of each point, from the seed and the frame's
/// number alone.
/// @param sigma [m] standard deviation
void add_point_noise(std::span<Vec3> points, double sigma, std::uint64_t seed, std::uint64_t frame);

/// Independent standard normal numbers, determined by the key; exact to about 1e-9.
void fill_normal(std::uint64_t key, std::span<float> out);

}  // namespace palpate
