// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/options.hpp"
#include "app/verbs.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/session/press.hpp"
#include "palpate/session/registration.hpp"

namespace palpate::app {
namespace {

struct CalibrateOptions {
  std::optional<std::string> camera, device, config, pairs, points, out, start;
  std::vector<std::string> pixels, cameras;
  bool of_cameras = false;
  std::optional<double> scale;
  bool fit_scale = false;
  double timeout = 300.0;       // [s]
  double max_residual = 0.010;  // [m]
  bool json = false;
};

struct Target {
  std::string name;
  Vec3 world;
};

std::string text_of_point(const Vec3& v) {
  return fmt::format("{:+.4f} {:+.4f} {:+.4f} m", v.x(), v.y(), v.z());
}

// Replaces a file as a whole, so that a power cut leaves the old or the new one.
void write_text(const std::string& file, const std::string& text) {
  const std::string part = file + ".part";
  {
    std::ofstream out(part, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw Error(part, "it cannot be written", "check the folder and the disk");
  }
  std::error_code error;
  std::filesystem::rename(part, file, error);
  if (error) throw Error(file, "it cannot be written: " + error.message(), "check the folder");
}

// The first image of a camera. @param remedy  where it has none
std::shared_ptr<const DepthImage> first_image(const std::string& uri, const std::string& remedy) {
  const std::unique_ptr<Source> source = open_source(uri, all_sources());
  constexpr double first_frame_time = 10.0;  // [s] a live camera that gives nothing gives up
  const std::optional<Frame> frame = source->next(first_frame_time);
  std::shared_ptr<const DepthImage> image;
  if (frame) image = {frame->cloud, frame->cloud->image()};
  if (!image) throw Error(uri, frame ? "it has no depth image" : "it has no frames", remedy);
  return image;
}

std::vector<Target> targets_at_pixels(const CalibrateOptions& options,
                                      const SessionConfig& config) {
  CameraSpec camera = config.cameras.front();
  if (options.camera && *options.camera != camera.uri) camera = {.uri = *options.camera};
  const std::shared_ptr<const DepthImage> image =
      first_image(camera.uri, "name a depth camera with --camera, or points with --points");
  const Eigen::Isometry3d moved =
      camera.world_from_camera ? *camera.world_from_camera * image->world_from_camera().inverse()
                               : Eigen::Isometry3d::Identity();
  std::vector<Target> targets;
  for (const std::string& text : options.pixels) {
    const Pixel pixel = parse_pixel(text, "--at");
    targets.push_back({"pixel " + text, moved * surface_at(*image, pixel)});
  }
  return targets;
}

std::vector<Target> targets_of(const CalibrateOptions& options, const SessionConfig& config) {
  if (!options.points) return targets_at_pixels(options, config);
  std::vector<Target> targets;
  for (const Vec3& point : read_points(*options.points))
    targets.push_back({"point " + std::to_string(targets.size() + 1), point});
  return targets;
}

std::vector<PointPair> touched_pairs(const CalibrateOptions& options, const SessionConfig& config) {
  const std::string uri = options.device.value_or(config.hands.front().device);
  if (uri.empty())
    throw Error("--device", "no device is named", "name the one to calibrate, or give --pairs");
  const std::vector<Target> targets = targets_of(options, config);
  const std::unique_ptr<Device> device = open_device(uri, std::nullopt, all_devices());
  std::size_t next = 0;
  const auto ask = [&] {
    if (next >= targets.size()) return;
    fmt::print(stderr, "palpate: {} of {}: touch {} at {}\n", next + 1, targets.size(),
               targets[next].name, text_of_point(targets[next].world));
  };
  fmt::print(stderr,
             "palpate: the device gets no force; at each point press a button of the device, or "
             "hold still for half a second\n");
  ask();
  const std::vector<Vec3> touched =
      capture_points(*device, targets.size(), options.timeout, [&](const Vec3& point) {
        fmt::print(stderr, "palpate: captured at {} in the device frame\n", text_of_point(point));
        ++next;
        ask();
      });
  std::vector<PointPair> pairs;
  for (std::size_t i = 0; i < targets.size(); ++i) pairs.push_back({touched[i], targets[i].world});
  return pairs;
}

void check_residuals(const PlacementFit& fit, double most) {
  const auto worst = std::max_element(fit.residuals.begin(), fit.residuals.end());
  if (*worst <= most) return;
  throw Error(
      fmt::format("point {}", worst - fit.residuals.begin() + 1),
      fmt::format("its residual is {:.1f} mm, more than {:.1f} mm", 1e3 * *worst, 1e3 * most),
      "touch the points again, in the requested order, or raise --max-residual");
}

// Where two cameras stand to one another; prints what a session's file says of them.
int calibrate_cameras(const CalibrateOptions& options) {
  std::vector<CameraSpec> cameras;
  if (options.config) cameras = read_session_config(*options.config).cameras;
  if (!options.cameras.empty()) {
    cameras.clear();
    for (const std::string& uri : options.cameras) cameras.push_back({.uri = uri});
  }
  if (cameras.size() != 2)
    throw Error("--cameras", fmt::format("it takes two cameras, not {}", cameras.size()),
                "give --cameras URI URI, or --config with two of them");
  const std::string remedy = "name depth cameras with --cameras";
  const auto first = first_image(cameras[0].uri, remedy);
  const auto second = first_image(cameras[1].uri, remedy);
  const Eigen::Isometry3d world_from_first =
      cameras[0].world_from_camera.value_or(first->world_from_camera());
  Eigen::Isometry3d start = Eigen::Isometry3d::Identity();
  if (options.start) {
    start = parse_pose(*options.start, "--start");
  } else if (cameras[1].world_from_camera) {
    start = world_from_first.inverse() * *cameras[1].world_from_camera;
  } else if (Uri(cameras[1].uri).has("pose")) {
    start = world_from_first.inverse() * second->world_from_camera();
  } else {
    throw Error("--start", "the initial estimate of the second camera's pose is missing",
                "set x,y,z,qx,qy,qz,qw of the second camera in the first's optical frame (x right, "
                "y down, z forward), accurate to 10 cm and 10 degrees");
  }
  const CameraFit fit = register_cameras(*first, *second, start);
  const Eigen::Isometry3d world_from_second = world_from_first * fit.first_from_second;
  if (options.json) {
    const nlohmann::ordered_json json = {
        {"first_from_second", "[" + pose_text(fit.first_from_second) + "]"},
        {"world_from_first", "[" + pose_text(world_from_first) + "]"},
        {"world_from_second", "[" + pose_text(world_from_second) + "]"},
        {"shift_deviation_m", fit.shift_deviation()},
        {"turn_deviation_rad", fit.turn_deviation()},
        {"rms_m", fit.rms},
        {"overlap", fit.overlap}};
    fmt::print("{}\n", json.dump(2));
    return 0;
  }
  constexpr double degrees = 57.29577951308232;
  const double turned =
      Eigen::AngleAxisd(start.linear().transpose() * fit.first_from_second.linear()).angle();
  fmt::print(stderr,
             "palpate: overlap {:.0f} %, residual {:.1f} mm; {:.1f} degrees from the initial "
             "estimate; uncertainty due to noise {:.2f} mm and {:.3f} degrees (standard deviation; "
             "without errors of the intrinsics or the depth unit)\n",
             100.0 * fit.overlap, 1e3 * fit.rms, degrees * turned, 1e3 * fit.shift_deviation(),
             degrees * fit.turn_deviation());
  fmt::print(
      "[[camera]]\nuri = {}\nworld_from_camera = [{}]\n\n[[camera]]\nuri = {}\n"
      "world_from_camera = [{}]\n",
      nlohmann::json(Uri(cameras[0].uri).without("pose").text()).dump(),
      pose_text(world_from_first),
      nlohmann::json(Uri(cameras[1].uri).without("pose").text()).dump(),
      pose_text(world_from_second));
  return 0;
}

int calibrate(const CalibrateOptions& options) {
  if (options.of_cameras) return calibrate_cameras(options);
  const int ways =
      (options.pairs ? 1 : 0) + (options.points ? 1 : 0) + (options.pixels.empty() ? 0 : 1);
  if (ways != 1)
    throw Error("calibrate", "it needs one of --at, --points, --pairs and --cameras",
                "give --at U,V three times or more, with --camera and --device");
  if (options.fit_scale && options.scale)
    throw Error("--scale", "the scale is both given and fitted", "remove one of the two options");
  SessionConfig config;
  std::error_code unused;
  const bool exists = options.out && std::filesystem::exists(*options.out, unused);
  if (options.config) {
    config = read_session_config(*options.config);
  } else if (exists) {
    config = read_session_config(*options.out);
  }
  const std::vector<PointPair> pairs =
      options.pairs ? read_pairs(*options.pairs) : touched_pairs(options, config);
  const PlacementFit fit = fit_placement(
      pairs, {.fit_scale = options.fit_scale,
              .scale = options.scale.value_or(config.hands.front().placement.workspace_scale)});
  if (options.json) {
    const nlohmann::ordered_json json = {
        {"world_from_device", "[" + pose_text(fit.placement.world_from_device) + "]"},
        {"scale", fit.placement.workspace_scale},
        {"rms_m", fit.rms},
        {"residuals_m", fit.residuals}};
    fmt::print("{}\n", json.dump(2));
  } else {
    for (std::size_t i = 0; i < pairs.size(); ++i)
      fmt::print("point {}  device {}  scene {}  residual {:.2f} mm\n", i + 1,
                 text_of_point(pairs[i].device), text_of_point(pairs[i].world),
                 1e3 * fit.residuals[i]);
    fmt::print("world_from_device = [{}]\nscale = {}\nrms = {:.2f} mm\n",
               pose_text(fit.placement.world_from_device), shortest(fit.placement.workspace_scale),
               1e3 * fit.rms);
  }
  std::fflush(stdout);
  check_residuals(fit, options.max_residual);
  if (options.out) {
    constexpr std::uintmax_t largest_file = 1U << 24U;  // [bytes]
    const std::string text = exists ? read_text(*options.out, largest_file) : std::string();
    write_text(*options.out, with_placement(text, *options.out, fit.placement));
    fmt::print(stderr, "palpate: written to {}; use it with palpate run --config {}\n",
               *options.out, *options.out);
  }
  return 0;
}

}  // namespace

Verb add_calibrate(CLI::App& program) {
  CLI::App* command = program.add_subcommand("calibrate",
                                             "estimate the pose of a device in the scene from "
                                             "points that it touches, or of a second camera");
  const auto options = std::make_shared<CalibrateOptions>();
  CLI::Option* const cameras =
      command->add_option("--cameras", options->cameras,
                          "instead of a device pose: estimate the pose of the second camera from "
                          "the common view of a static scene");
  cameras->expected(0, 2);
  command->add_option("--start", options->start,
                      "for --cameras: initial estimate of the second camera's pose in the first's "
                      "optical frame, x,y,z,qx,qy,qz,qw [m] (default: from --config)");
  command->add_option("--device", options->device,
                      "the device that touches the points; it gets no force");
  command->add_option("--camera", options->camera, "the camera that sees them");
  add_repeated(*command, "--at", options->pixels,
               "a pixel of the camera's first frame, U,V; three or more, touched in this order");
  command->add_option("--points", options->points,
                      "instead of --at: CSV of points in the scene, x,y,z in m");
  command->add_option("--pairs", options->pairs,
                      "instead of a device: CSV of pairs, dx,dy,dz,wx,wy,wz in m");
  command->add_option("--config", options->config,
                      "take camera, device and scale from a session's TOML file");
  command->add_option("--out", options->out,
                      "write the pose into this TOML file and keep the rest of the file");
  command->add_option("--scale", options->scale, "scene metres per device metre (1)");
  command->add_flag("--fit-scale", options->fit_scale, "also estimate the scale from the points");
  command->add_option("--max-residual", options->max_residual,
                      "write nothing if a residual is larger [m] (0.01)");
  command->add_option("--timeout", options->timeout, "seconds for all points (300)");
  command->add_flag("--json", options->json, "print the result as a JSON object");
  return {command, [options, cameras] {
            options->of_cameras = cameras->count() > 0;
            return calibrate(*options);
          }};
}

}  // namespace palpate::app
