// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "palpate/io/sources/scene.hpp"
#include "palpate/io/sources/sensor_model.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate {

/// A pinhole camera without distortion, the principal point in the middle of the image.
/// @param field_of_view [rad] across the image's width
Intrinsics pinhole(int width, int height, double field_of_view);

/// A camera that looks at the world's origin.
/// @param distance  [m] from the origin
/// @param tilt      [rad] between the sightline and straight down; the camera stands towards -y
/// @param azimuth   [rad] by which it then walks around the z axis, to its right
Eigen::Isometry3d looking_at_origin(double distance, double tilt, double azimuth);

/// Draws the depth [m] of a shape where it is nearer than what an image has, row by row.
void draw(const Shape& shape, const Eigen::Isometry3d& shape_from_camera, const ViewingRays& rays,
          std::span<float> depth);

/// Pose, rate and images of a synthetic camera.
struct CameraSetup {
  Intrinsics intrinsics = pinhole(640, 480, 0.995);  // 57 degrees, as the first Kinect
  Eigen::Isometry3d world_from_camera = looking_at_origin(0.7, 0.6, 0.0);
  double frame_rate = 30.0;           ///< [Hz]
  double brightness = 0.0;            ///< [m] length of its waves along x; 0: no brightness
  double colour = 0.0;                ///< [m] length of its waves; 0: no colour
  std::optional<std::size_t> frames;  ///< how many; none: it never ends
};

/// A depth camera that looks at an analytic scene, so that the true surface of each frame is known.
class SyntheticCamera final : public NumberedSource {
 public:
  /// @throws Error if the set-up or the sensor does not validate.
  SyntheticCamera(Scene scene, const CameraSetup& setup, const SensorModel& sensor,
                  SourceInfo info = {});

  /// Frame k is captured in the instant k / frame_rate, without motion blur.
  std::optional<Frame> next(double timeout = no_timeout) override;

  /// Frame number `frame` as it is at time t [s]; its noise depends on the seed and the number.
  [[nodiscard]] Frame capture(double t, std::uint64_t frame);
  /// [m] true depth row by row at time t, infinite where there is nothing; until the next call.
  [[nodiscard]] std::span<const float> true_depth(double t);

  [[nodiscard]] const Scene& scene() const { return scene_; }
  [[nodiscard]] const CameraSetup& setup() const { return setup_; }
  [[nodiscard]] const Sensor& sensor() const { return sensor_; }

 private:
  [[nodiscard]] std::vector<std::uint8_t> brightness(std::span<const float> depth) const;
  [[nodiscard]] std::shared_ptr<const ColourImage> colour(std::span<const float> depth) const;
  /// A wave of light at a place along an axis [m]: 0 to 255.
  [[nodiscard]] static std::uint8_t wave(double along, double length);
  /// [m, world] true point of pixel i; none where there is nothing.
  [[nodiscard]] std::optional<Vec3> true_point(std::span<const float> depth, std::size_t i) const;

  Scene scene_;
  CameraSetup setup_;
  Sensor sensor_;
  std::shared_ptr<const ViewingRays> rays_;
  std::vector<float> resting_, depth_;  // the parts at rest, drawn once; and the newest image
};

/// What a URI's options say of a camera as open_synthetic_camera takes them, for cameras that see
/// other scenes. Options that are not of the camera are ignored.
/// @throws Error for a value out of range.
CameraSetup camera_setup(const Uri& uri);
SensorModel camera_sensor(const Uri& uri);
SensorKind camera_kind(const Uri& uri);

/// `synthetic:SCENE?KEY=VALUE&...`: docs/synthetic.md has the options. Without a scene's name it is
/// the desk.
/// @throws Error for an unknown scene or option, or a value out of range.
std::unique_ptr<SyntheticCamera> open_synthetic_camera(const Uri& uri);

}  // namespace palpate
