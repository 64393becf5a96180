// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// The depth camera of a recording: the content of an `intrinsics.json`, whose keys docs/sources.md
/// describes.
struct RecordedCamera {
  Intrinsics intrinsics;
  double units_per_metre = 1000.0;
  /// Raw values that mean no measurement, besides 0 and 65535.
  std::uint16_t invalid_value = 0;
  std::uint16_t saturated_value = 65535;
  std::optional<double> frame_rate{};  ///< [Hz] nominal
  SensorKind sensor = SensorKind::unknown;
};

/// @param name  of the file, for messages
/// @throws Error naming the file and the key that is missing or makes no sense.
RecordedCamera parse_intrinsics(std::string_view json, const std::string& name);

/// @throws Error as parse_intrinsics, or if the file cannot be read.
RecordedCamera read_intrinsics(const std::filesystem::path& path);

}  // namespace palpate
