// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// The lens of a RealSense camera as librealsense describes it, live and in its recordings.
struct RealSenseLens {
  Intrinsics pinhole;              ///< without the distortion
  std::string model = "None";      ///< of the distortion: "Brown Conrady", ...
  std::array<double, 5> coeffs{};  ///< k1 k2 p1 p2 k3
};

/// Reads `width=848;height=480;fx=...;ppx=...;fy=...;ppy=...;model=Brown Conrady;coeffs=a,b,c,d,e`.
/// @param name  of the message, for errors
/// @throws Error naming the key that is missing or is no number.
RealSenseLens parse_realsense_lens(std::string_view text, const std::string& name);

/// Coefficients that are all zero mean no distortion, whatever the model: so it is with the depth
/// of the D400 series. Others are taken where the model is that of Brown and Conrady; the modified
/// and inverse ones, F-Theta and Kannala-Brandt have no equal here.
/// @throws Error if the distortion cannot be taken; sizes and focal lengths are not looked at.
Intrinsics intrinsics_of(const RealSenseLens& lens, const std::string& name);

/// How a camera of that product name measures: the L500 series times light, the SR300 series
/// projects a pattern, all others are stereo.
SensorKind realsense_sensor(std::string_view product) noexcept;

}  // namespace palpate
