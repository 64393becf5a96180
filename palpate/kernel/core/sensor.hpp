// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "palpate/kernel/core/parameters.hpp"

namespace palpate {

/// How a depth camera measures, which decides how its noise grows with distance.
enum class SensorKind : std::uint8_t {
  unknown,
  stereo,            ///< matches two images, such as a RealSense D4xx
  structured_light,  ///< matches a projected pattern, such as a Kinect v1
  time_of_flight,    ///< times light, such as a Kinect v2, an Azure Kinect, a RealSense L515
};

/// "unknown", "stereo", "structured light", "time of flight".
[[nodiscard]] std::string_view name_of(SensorKind sensor) noexcept;
/// The kind of that name; "structured-light", as options of a URI have it, is good too.
[[nodiscard]] std::optional<SensorKind> sensor_named(std::string_view name) noexcept;

/// Noise model of a type of depth camera, used until the noise has been measured: `at_1m` times the
/// distance [m] to the power of `growth`. docs/cameras.md has the sources of the values.
struct UsualNoise {
  double at_1m;  ///< [m] standard deviation
  int growth;    ///< [-] 2: triangulation; 1: time of flight
};

[[nodiscard]] UsualNoise usual_noise(SensorKind sensor) noexcept;

/// "5 mm at 1 m, growing with the square of distance".
[[nodiscard]] std::string noise_text(SensorKind sensor);

/// Returns `parameters` with the noise model of these cameras: replaces `usual_noise` and
/// `noise_growth`, each if it is 0, by the values of the sensor type with the largest noise at 1 m.
[[nodiscard]] Parameters for_sensors(Parameters parameters, std::span<const SensorKind> sensors);

}  // namespace palpate
