// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/realsense_lens.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

constexpr double widest = 16384.0;  // [px] as in validate(Intrinsics)

std::optional<double> number_of(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

}  // namespace

RealSenseLens parse_realsense_lens(std::string_view text, const std::string& name) {
  const auto wanted = [&](std::string_view key) {
    const auto value = value_of(text, key);
    if (!value)
      throw Error(name, "has no " + std::string(key) + " of the camera", "it may be damaged");
    return *value;
  };
  const auto number = [&](std::string_view key) {
    const auto value = number_of(wanted(key));
    if (!value) throw Error(name, "its " + std::string(key) + " is no number", "it may be damaged");
    return *value;
  };
  const auto size = [&](std::string_view key) {
    return static_cast<int>(std::clamp(number(key), 0.0, widest + 1.0));
  };
  RealSenseLens lens{.width = size("width"),
                     .height = size("height"),
                     .ppx = number("ppx"),
                     .ppy = number("ppy"),
                     .fx = number("fx"),
                     .fy = number("fy"),
                     .model = std::string(wanted("model")),
                     .coeffs = {}};
  std::string_view coeffs = wanted("coeffs");
  for (double& coeff : lens.coeffs) {
    const std::string_view each = coeffs.substr(0, coeffs.find(','));
    const auto value = number_of(each);
    if (!value) throw Error(name, "its coeffs are not five numbers", "it may be damaged");
    coeff = *value;
    coeffs.remove_prefix(std::min(coeffs.size(), each.size() + 1));
  }
  return lens;
}

Intrinsics intrinsics_of(const RealSenseLens& lens, const std::string& name) {
  Intrinsics k{.width = lens.width,
               .height = lens.height,
               .fx = lens.fx,
               .fy = lens.fy,
               .cx = lens.ppx,
               .cy = lens.ppy};
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
