// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/intrinsics_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/files.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

using nlohmann::json;

constexpr std::uintmax_t largest_intrinsics = std::uintmax_t{1} << 20;
constexpr const char* long_distortion = "distortion_brown_conrady_k1_6_p";

// A JSON object; its accessors throw an Error that names the file and the key.
class Object {
 public:
  Object(const json& object, std::string name) : object_(object), name_(std::move(name)) {}

  /// Null counts as absent.
  [[nodiscard]] bool has(const char* key) const {
    const auto found = object_.find(key);
    return found != object_.end() && !found->is_null();
  }

  /// A number from `min` to `max`, which `wanted` describes.
  [[nodiscard]] double number(const char* key, double min, double max, const char* wanted) const {
    if (!has(key)) throw Error(name_, std::string("has no '") + key + "'", needed(key, wanted));
    const json& value = object_.at(key);
    if (!value.is_number()) fail(key, "is not a number", wanted);
    const auto number = value.get<double>();
    if (!(number >= min && number <= max)) fail(key, "is " + value.dump(), wanted);
    return number;
  }

  [[nodiscard]] int whole_number(const char* key, int min, int max, const char* wanted) const {
    const double value = number(key, min, max, wanted);
    if (value != std::floor(value)) fail(key, "is " + object_.at(key).dump(), wanted);
    return static_cast<int>(value);
  }

  [[noreturn]] void fail(const char* key, const std::string& reason, const char* wanted) const {
    throw Error(name_, std::string("'") + key + "' " + reason, needed(key, wanted));
  }

 private:
  static std::string needed(const char* key, const char* wanted) {
    return std::string("give ") + key + " as " + wanted;
  }

  const json& object_;
  std::string name_;
};

// In the order of Intrinsics::distortion.
constexpr std::array<const char*, 8> coefficients{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};

std::array<double, 8> parse_distortion(const json& distortion, const Object& outer, const char* key,
                                       const std::string& name) {
  if (!distortion.is_object()) outer.fail(key, "is not an object", "null or {\"k1\": ...}");
  for (const auto& [found, value] : distortion.items()) {
    const bool centre = found == "codx" || found == "cody";  // of the lens, 0 on any Azure Kinect
    if (centre && value.is_number() && value.get<double>() == 0.0) continue;
    if (std::find(coefficients.begin(), coefficients.end(), found) == coefficients.end())
      outer.fail(key, "has " + json(found).dump() + ", which is not understood",
                 "k1 to k6, p1 and p2, with codx and cody 0 if they are there");
  }
  const Object inner(distortion, name + ": " + key);
  std::array<double, 8> result{};
  for (std::size_t i = 0; i < coefficients.size(); ++i) {
    if (inner.has(coefficients[i]))
      result[i] = inner.number(coefficients[i], -1e6, 1e6, "a finite coefficient");
  }
  return result;
}

}  // namespace

RecordedCamera parse_intrinsics(std::string_view text, const std::string& name) {
  const json root = json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!root.is_object())
    throw Error(name, root.is_discarded() ? "is not valid JSON" : "is not a JSON object",
                "write an object of width, height, fx, fy, cx, cy and depth_units_per_metre");
  const Object object(root, name);
  constexpr int largest = 16384;
  constexpr const char* pixels = "a whole number of pixels from 1 to 16384";
  constexpr const char* focal_length = "the focal length in pixels, more than 0";
  constexpr const char* centre = "the principal point in pixels, usually near the middle";
  constexpr const char* raw_value = "null or a whole number from 0 to 65535";

  RecordedCamera camera;
  Intrinsics& k = camera.intrinsics;
  k.width = object.whole_number("width", 1, largest, pixels);
  k.height = object.whole_number("height", 1, largest, pixels);
  k.fx = object.number("fx", 1e-3, 1e7, focal_length);
  k.fy = object.number("fy", 1e-3, 1e7, focal_length);
  k.cx = object.number("cx", -1e7, 1e7, centre);
  k.cy = object.number("cy", -1e7, 1e7, centre);
  for (const char* key : {"distortion", long_distortion}) {
    if (!object.has(key)) continue;
    if (k.distorted()) object.fail(key, "is a second distortion", "null");
    k.distortion = parse_distortion(root.at(key), object, key, name);
  }
  camera.units_per_metre = object.number("depth_units_per_metre", 1e-3, 1e7,
                                         "1000 for millimetres, 5000 for the TUM benchmark");
  const auto optional_raw = [&](const char* key, std::uint16_t& value) {
    if (object.has(key))
      value = static_cast<std::uint16_t>(object.whole_number(key, 0, 65535, raw_value));
  };
  optional_raw("invalid_value", camera.invalid_value);
  optional_raw("saturated_value", camera.saturated_value);
  if (object.has("fps_nominal"))
    camera.frame_rate =
        object.number("fps_nominal", 1e-3, 1e6, "null or the frames per second, more than 0");
  if (object.has("sensor_kind")) {
    const json& value = root.at("sensor_kind");
    const std::optional<SensorKind> kind =
        value.is_string() ? sensor_named(value.get<std::string>()) : std::nullopt;
    if (!kind)
      object.fail("sensor_kind", "is " + value.dump(-1, ' ', true, json::error_handler_t::replace),
                  "\"stereo\", \"structured light\" or \"time of flight\"");
    camera.sensor = *kind;
  }
  return camera;
}

RecordedCamera read_intrinsics(const std::filesystem::path& path) {
  return parse_intrinsics(read_text(path, largest_intrinsics), path.string());
}

}  // namespace palpate
