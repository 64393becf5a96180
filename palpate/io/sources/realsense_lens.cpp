// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/realsense_lens.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr double widest = 16384.0;  // [px] as in validate(Intrinsics)

}  // namespace

RealSenseLens parse_realsense_lens(std::string_view text, const std::string& name) {
  const auto wanted = [&](std::string_view key) {
    const auto value = value_of(text, key);
    if (!value)
      throw Error(name, "has no " + std::string(key) + " of the camera", "it may be damaged");
    return *value;
  };
  const auto number = [&](std::string_view key) {
    const auto value = detail::to_number(wanted(key));
    if (!value || !std::isfinite(*value))
      throw Error(name, "its " + std::string(key) + " is no number", "it may be damaged");
    return *value;
  };
  const auto size = [&](std::string_view key) {
    return static_cast<int>(std::clamp(number(key), 0.0, widest + 1.0));
  };
  RealSenseLens lens;
  Intrinsics& k = lens.pinhole;
  k.width = size("width");
  k.height = size("height");
  k.cx = number("ppx");
  k.cy = number("ppy");
  k.fx = number("fx");
  k.fy = number("fy");
  lens.model = wanted("model");
  const auto coeffs = detail::to_numbers(std::string(wanted("coeffs")), lens.coeffs.size());
  if (coeffs.empty()) throw Error(name, "its coeffs are not five numbers", "it may be damaged");
  std::copy(coeffs.begin(), coeffs.end(), lens.coeffs.begin());
  return lens;
}

Intrinsics intrinsics_of(const RealSenseLens& lens, const std::string& name) {
  Intrinsics k = lens.pinhole;
  const bool is_distorted =
      lens.model != "None" &&
      std::any_of(lens.coeffs.begin(), lens.coeffs.end(), [](double c) { return c != 0.0; });
  if (is_distorted) {
    if (lens.model != "Brown Conrady")
      throw Error(name, "has the distortion model '" + lens.model + "'",
                  "choose a stream that is rectified, or give its images with depth:");
    std::copy(lens.coeffs.begin(), lens.coeffs.end(), k.distortion.begin());
  }
  return k;
}

SensorKind realsense_sensor(std::string_view product) noexcept {
  if (product.find("L5") != std::string_view::npos) return SensorKind::time_of_flight;
  if (product.find("SR3") != std::string_view::npos) return SensorKind::structured_light;
  return SensorKind::stereo;
}

}  // namespace palpate
