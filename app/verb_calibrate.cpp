// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/session_arguments.hpp"
#include "app/verbs.hpp"
#include "palpate/cloud/depth_image.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/pose.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/session/point_capture.hpp"
#include "palpate/session/press_path.hpp"
#include "palpate/session/registration.hpp"
#include "palpate/sources/source.hpp"

namespace palpate::app {
namespace {

struct CalibrateOptions {
  std::optional<std::string> camera, device, config, pairs, points, out;
  std::vector<std::string> pixels;
  std::optional<double> scale;
  bool fit_scale = false;
  double timeout = 300.0;       // [s]
  double max_residual = 0.010;  // [m]
  bool json = false;
};

// A point to touch, and what it is called.
struct Target {
  std::string name;
  Vec3 world;
};

std::string text_of_point(const Vec3& v) {
  return fmt::format("{:+.4f} {:+.4f} {:+.4f} m", v.x(), v.y(), v.z());
}

std::string read_text(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
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

std::vector<Target> targets_at_pixels(const CalibrateOptions& options,
                                      const SessionConfig& config) {
  CameraConfig camera = config.cameras.front();
  if (options.camera && *options.camera != camera.uri) camera = {.uri = *options.camera};
  const std::unique_ptr<Source> source = open_source(camera.uri, all_sources());
  const std::optional<Frame> frame = source->next();
  const auto* image = frame ? dynamic_cast<const DepthImage*>(frame->cloud.get()) : nullptr;
  if (image == nullptr)
    throw Error(camera.uri, frame ? "it has no depth image" : "it has no frames",
                "name a depth camera with --camera, or give points with --points");
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
  const std::string uri = options.device.value_or(config.device);
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
             "rest there for half a second\n");
  ask();
  const std::vector<Vec3> touched =
      capture_points(*device, targets.size(), options.timeout, [&](const Vec3& point) {
        fmt::print(stderr, "palpate: taken at {} of the device\n", text_of_point(point));
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
  throw Error(fmt::format("point {}", worst - fit.residuals.begin() + 1),
              fmt::format("it is off by {:.1f} mm, more than {:.1f} mm", 1e3 * *worst, 1e3 * most),
              "touch the points again, in the order in which they are asked for, or raise "
              "--max-residual");
}

int calibrate(const CalibrateOptions& options) {
  const int ways =
      (options.pairs ? 1 : 0) + (options.points ? 1 : 0) + (options.pixels.empty() ? 0 : 1);
  if (ways != 1)
    throw Error("calibrate", "it needs one of --at, --points and --pairs",
                "give --at U,V three times or more, with --camera and --device");
  if (options.fit_scale && options.scale)
    throw Error("--scale", "the scale cannot be both given and fitted", "leave one out");
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
  const PlacementFit fit =
      fit_placement(pairs, {.fit_scale = options.fit_scale,
                            .scale = options.scale.value_or(config.placement.workspace_scale)});
  if (options.json) {
    const nlohmann::ordered_json json = {
        {"world_from_device", "[" + pose_text(fit.placement.world_from_device) + "]"},
        {"scale", fit.placement.workspace_scale},
        {"rms_m", fit.rms},
        {"residuals_m", fit.residuals}};
    fmt::print("{}\n", json.dump(2));
  } else {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      fmt::print("point {}  device {}  scene {}  off by {:.2f} mm\n", i + 1,
                 text_of_point(pairs[i].device), text_of_point(pairs[i].world),
                 1e3 * fit.residuals[i]);
    }
    fmt::print("world_from_device = [{}]\nscale = {}\nrms = {:.2f} mm\n",
               pose_text(fit.placement.world_from_device), shortest(fit.placement.workspace_scale),
               1e3 * fit.rms);
  }
  std::fflush(stdout);
  check_residuals(fit, options.max_residual);
  if (options.out) {
    const std::string text = exists ? read_text(*options.out) : std::string();
    write_text(*options.out, with_placement(text, *options.out, fit.placement));
    fmt::print(stderr, "palpate: written to {}; use it with palpate run --config {}\n",
               *options.out, *options.out);
  }
  return 0;
}

}  // namespace

Verb add_calibrate(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "calibrate", "find where a device lies in the scene, from points that it touches");
  const auto options = std::make_shared<CalibrateOptions>();
  command->add_option("--device", options->device,
                      "the device that touches the points; it gets no force");
  command->add_option("--camera", options->camera, "the camera that sees them");
  command
      ->add_option("--at", options->pixels,
                   "a pixel of the camera's first frame, U,V; three or more, touched in this order")
      ->allow_extra_args(false);
  command->add_option("--points", options->points,
                      "instead of --at: CSV of points in the scene, x,y,z in m");
  command->add_option("--pairs", options->pairs,
                      "instead of a device: CSV of pairs, dx,dy,dz,wx,wy,wz in m");
  command->add_option("--config", options->config,
                      "take camera, device and scale from a session's TOML file");
  command->add_option("--out", options->out,
                      "write the pose into this TOML file and keep what else is in it");
  command->add_option("--scale", options->scale, "scene metres per device metre (1)");
  command->add_flag("--fit-scale", options->fit_scale, "find the scale from the points as well");
  command->add_option("--max-residual", options->max_residual,
                      "write nothing if a point is off by more [m] (0.01)");
  command->add_option("--timeout", options->timeout, "seconds for all points (300)");
  command->add_flag("--json", options->json, "print the result as a JSON object");
  return {command, [options] { return calibrate(*options); }};
}

}  // namespace palpate::app
