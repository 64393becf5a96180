// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/synthetic_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "palpate/io/sources/point_file_detail.hpp"
#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr float no_surface = std::numeric_limits<float>::infinity();
constexpr double deg = std::numbers::pi / 180.0;

struct Pair {
  double first, second;
};

// "640x480", or with `one_is_enough` "5" for both.
Pair pair_option(const Uri& uri, std::string_view key, Pair fallback, double min, double max,
                 bool one_is_enough) {
  if (!uri.has(key)) return fallback;
  const std::string text = uri.text_option(key, "");
  const std::size_t cross = std::min(text.find('x'), text.size());
  const auto first = detail::to_number(text.substr(0, cross));
  const auto second = one_is_enough && cross == text.size()
                          ? first
                          : detail::to_number(text.substr(std::min(cross + 1, text.size())));
  const auto fits = [&](const auto& value) { return value && *value >= min && *value <= max; };
  if (fits(first) && fits(second)) return {*first, *second};
  const auto number = [](double value) { return std::to_string(static_cast<int>(value)); };
  throw Error(
      uri.text() + ": option '" + std::string(key) + "'",
      "'" + text + "' is not two numbers of pixels from " + number(min) + " to " + number(max),
      "write such as " + std::string(key) + "=" + number(fallback.first) + "x" +
          number(fallback.second));
}

std::uint64_t whole_option(const Uri& uri, std::string_view key, std::uint64_t fallback,
                           double min) {
  constexpr double largest = 9007199254740992.0;  // 2^53: every whole number below is exact
  const double value = uri.number_option(key, static_cast<double>(fallback), min, largest, "px");
  if (value != std::floor(value))
    throw Error(uri.text() + ": option '" + std::string(key) + "'",
                "'" + uri.text_option(key, "") + "' is not a whole number", "give a whole number");
  return static_cast<std::uint64_t>(value);
}

// The pixels that can show a shape: where all of its block's corners are before the camera, those
// between them, and else those of a ball about it.
ViewingRays::Window window_of(const Shape& shape, const Eigen::Isometry3d& camera_from_shape,
                              const ViewingRays& rays) {
  constexpr double rounding = 1e-9;
  const Intrinsics& image = rays.intrinsics();
  const Vec3 half = bounding_half(shape);
  if (!half.allFinite()) return {0, image.width, 0, image.height};
  Eigen::Array2d low = Eigen::Array2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const auto side = [&](unsigned axis) { return (corner >> axis & 1U) != 0 ? 1.0 : -1.0; };
    const Vec3 at = camera_from_shape * half.cwiseProduct(Vec3(side(0), side(1), side(2)));
    if (!(at.z() > rounding)) return rays.window(camera_from_shape.translation(), half.norm());
    low = low.min(at.head<2>().array() / at.z() - rounding);
    high = high.max(at.head<2>().array() / at.z() + rounding);
  }
  return pixels_between(image, low, high);
}

}  // namespace

// Rays are (x, y, 1) in the camera's frame, so that the length along a ray is the depth.
void draw(const Shape& shape, const Eigen::Isometry3d& shape_from_camera, const ViewingRays& rays,
          std::span<float> depth) {
  const Intrinsics& image = rays.intrinsics();
  const ViewingRays::Window window = window_of(shape, shape_from_camera.inverse(), rays);
  if (window.empty()) return;
  const Eigen::Matrix3d turn = shape_from_camera.linear();
  const std::size_t count = window.u_end - window.u_begin;
  std::vector<Vec3> directions(count);
  std::vector<double> along(count);
  for (int v = window.v_begin; v < window.v_end; ++v) {
    float* row = depth.data() + static_cast<std::ptrdiff_t>(v) * image.width + window.u_begin;
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector2d ray = rays.ray(window.u_begin + static_cast<int>(i), v);
      directions[i] = turn.col(0) * ray.x() + turn.col(1) * ray.y() + turn.col(2);
      along[i] = row[i];
    }
    cast(shape, shape_from_camera.translation(), directions, along);
    for (std::size_t i = 0; i < count; ++i) row[i] = static_cast<float>(along[i]);
  }
}

Intrinsics pinhole(int width, int height, double field_of_view) {
  Intrinsics intrinsics;
  intrinsics.width = width;
  intrinsics.height = height;
  intrinsics.fx = intrinsics.fy = 0.5 * width / std::tan(0.5 * field_of_view);
  intrinsics.cx = 0.5 * (width - 1);
  intrinsics.cy = 0.5 * (height - 1);
  return intrinsics;
}

Eigen::Isometry3d looking_at_origin(double distance, double tilt, double azimuth) {
  // Straight above, the image's right is the world's x and its top the world's y.
  return Eigen::Isometry3d(Eigen::AngleAxisd(azimuth, Vec3::UnitZ()) *
                           Eigen::AngleAxisd(tilt, Vec3::UnitX()) *
                           Eigen::Translation3d(0.0, 0.0, distance) *
                           Eigen::AngleAxisd(std::numbers::pi, Vec3::UnitX()));
}

SyntheticCamera::SyntheticCamera(Scene scene, const CameraSetup& setup, const SensorModel& sensor,
                                 SourceInfo info)
    : NumberedSource(std::move(info)),
      scene_(std::move(scene)),
      setup_(setup),
      sensor_(sensor, setup.intrinsics),
      rays_(std::make_shared<const ViewingRays>(setup.intrinsics)) {
  if (!(setup.frame_rate > 0.0 && std::isfinite(setup.frame_rate)))
    throw Error("synthetic camera: frame_rate", "it is not positive", "give a rate in Hz");
  info_.frames = setup.frames;
  info_.frame_rate = setup.frame_rate;
  if (info_.kind.empty()) info_.kind = "synthetic depth camera";
}

std::optional<Frame> SyntheticCamera::next(double /*timeout*/) {
  if (setup_.frames && next_ >= *setup_.frames) return std::nullopt;
  const std::uint64_t frame = next_++;
  return capture(static_cast<double>(frame) / setup_.frame_rate, frame);
}

Frame SyntheticCamera::capture(double t, std::uint64_t frame) {
  const std::span<const float> depth = true_depth(t);
  return {t,
          std::make_shared<const DepthImage>(rays_, sensor_.measure(depth, frame),
                                             1.0 / sensor_.model().quantisation,
                                             setup_.world_from_camera, brightness(depth)),
          colour(depth)};
}

std::uint8_t SyntheticCamera::wave(double along, double length) {
  const double value = 0.5 + 0.5 * std::sin(2.0 * std::numbers::pi * along / length);
  return static_cast<std::uint8_t>(std::lround(255.0 * value));
}

std::optional<Vec3> SyntheticCamera::true_point(std::span<const float> depth, std::size_t i) const {
  if (!std::isfinite(depth[i])) return std::nullopt;
  const int width = setup_.intrinsics.width;
  const Eigen::Vector2d ray = rays_->ray(static_cast<int>(i) % width, static_cast<int>(i) / width);
  return setup_.world_from_camera * Vec3(double{depth[i]} * ray.homogeneous());
}

std::vector<std::uint8_t> SyntheticCamera::brightness(std::span<const float> depth) const {
  if (!(setup_.brightness > 0.0)) return {};
  std::vector<std::uint8_t> values(depth.size(), 0);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (const auto point = true_point(depth, i)) values[i] = wave(point->x(), setup_.brightness);
  }
  return values;
}

std::shared_ptr<const ColourImage> SyntheticCamera::colour(std::span<const float> depth) const {
  if (!(setup_.colour > 0.0)) return nullptr;
  auto image = std::make_shared<ColourImage>();
  image->width = setup_.intrinsics.width;
  image->height = setup_.intrinsics.height;
  image->rgb.resize(3 * depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const auto point = true_point(depth, i);
    for (std::size_t axis = 0; point && axis < 3; ++axis)
      image->rgb[3 * i + axis] = wave((*point)[static_cast<Eigen::Index>(axis)], setup_.colour);
  }
  return image;
}

std::span<const float> SyntheticCamera::true_depth(double t) {
  const auto draw = [&](const Part& part, std::vector<float>& depth) {
    palpate::draw(part.shape, part.pose(t).inverse() * setup_.world_from_camera, *rays_, depth);
  };
  if (resting_.empty()) {
    resting_.assign(static_cast<std::size_t>(setup_.intrinsics.width) * setup_.intrinsics.height,
                    no_surface);
    for (const Part& part : scene_.parts()) {
      if (part.motion.rests()) draw(part, resting_);
    }
  }
  depth_ = resting_;
  for (const Part& part : scene_.parts()) {
    if (!part.motion.rests()) draw(part, depth_);
  }
  return depth_;
}

CameraSetup camera_setup(const Uri& uri) {
  CameraSetup setup;
  const Pair size = pair_option(uri, "size", {640, 480}, 1, 16384, false);
  if (size.first != std::floor(size.first) || size.second != std::floor(size.second))
    throw Error(uri.text() + ": option 'size'", "a number of pixels must be whole",
                "write such as size=640x480");
  setup.intrinsics = pinhole(static_cast<int>(size.first), static_cast<int>(size.second),
                             uri.number_option("fov", 57.0 * deg, deg, 170.0 * deg, "rad"));
  setup.world_from_camera = looking_at_origin(
      uri.number_option("distance", 0.7, 0.01, 100.0, "m"),
      uri.number_option("tilt", 34.0 * deg, -std::numbers::pi, std::numbers::pi, "rad"),
      uri.number_option("azimuth", 0.0, -2.0 * std::numbers::pi, 2.0 * std::numbers::pi, "rad"));
  setup.frame_rate = uri.number_option("fps", 30.0, 1e-3, 10000.0, "Hz");
  setup.brightness = uri.number_option("brightness", 0.0, 1e-4, 100.0, "m");
  setup.colour = uri.number_option("colour", 0.0, 1e-4, 100.0, "m");
  if (uri.has("frames")) setup.frames = whole_option(uri, "frames", 0, 1.0);
  return setup;
}

SensorModel camera_sensor(const Uri& uri) {
  SensorModel model = SensorModel::named(uri.text_option("sensor", "ideal"));
  model.noise = uri.number_option("noise", model.noise, 0.0, 1.0, "m");
  if (uri.has("noise_grows"))
    model.noise_growth = uri.number_option("noise_grows", 0.0, 0.0, 1.0, "px") != 0.0 ? 2 : 0;
  const Pair correlation =
      pair_option(uri, "correlation", {model.correlation_x, model.correlation_y}, 0.0, 100.0, true);
  model.correlation_x = correlation.first;
  model.correlation_y = correlation.second;
  model.noise_frames = whole_option(uri, "noise_frames", model.noise_frames, 1.0);
  model.drift = uri.number_option("drift", model.drift, 0.0, 0.2, "1");
  model.quantisation = uri.number_option("quantisation", model.quantisation, 1e-6, 0.1, "m");
  model.disparity_step = uri.number_option("disparity_step", model.disparity_step, 0.0, 0.1, "m");
  model.dropouts = uri.number_option("dropouts", model.dropouts, 0.0, 1.0, "1");
  model.grazing = uri.number_option("grazing", model.grazing, 0.0, 0.5 * std::numbers::pi, "rad");
  model.flying = uri.number_option("flying", model.flying, 0.0, 1.0, "1");
  model.seed = whole_option(uri, "seed", model.seed, 0.0);
  return model;
}

SensorKind camera_kind(const Uri& uri) {
  const std::string sensor = uri.text_option("sensor", "ideal");
  if (sensor == "d4xx") return SensorKind::stereo;
  if (sensor == "kinect") return SensorKind::structured_light;
  if (sensor == "tof") return SensorKind::time_of_flight;
  return SensorKind::unknown;
}

std::unique_ptr<SyntheticCamera> open_synthetic_camera(const Uri& text) {
  const Uri uri = text.path().empty() ? Uri("synthetic:desk" + text.text().substr(10)) : text;
  std::vector<std::string_view> options = scene_options(uri.path());
  constexpr std::array<std::string_view, 21> camera_options{
      "size",           "fps",      "frames",      "fov",         "distance",
      "tilt",           "colour",   "azimuth",     "seed",        "brightness",
      "sensor",         "noise",    "noise_grows", "correlation", "quantisation",
      "disparity_step", "dropouts", "grazing",     "flying",      "noise_frames",
      "drift"};
  options.insert(options.end(), camera_options.begin(), camera_options.end());
  uri.allow_only(options);
  SourceInfo info;
  info.uri = text.text();
  info.kind = "synthetic depth camera, scene " + uri.path();
  info.sensor = camera_kind(uri);
  return std::make_unique<SyntheticCamera>(make_scene(uri), camera_setup(uri), camera_sensor(uri),
                                           std::move(info));
}

std::unique_ptr<Source> open_synthetic(const Uri& uri) { return open_synthetic_camera(uri); }

}  // namespace palpate
