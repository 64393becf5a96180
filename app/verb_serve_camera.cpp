// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/signals.hpp"
#include "app/verbs.hpp"
#include "palpate/drivers/ros2_publisher.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"
#include "palpate/session/camera_feed.hpp"

namespace palpate::app {
namespace {

struct ServeOptions {
  std::string camera;
  std::string name = "camera";
  DepthPacking packing = DepthPacking::rvl;
  double duration = 0.0;  // [s]; 0: until a signal comes
};

int serve(const ServeOptions& options) {
  if (options.camera.empty())
    throw Error("serve-camera", "no camera is named", "give --camera URI");
  if (!(options.duration >= 0.0 && options.duration <= 1e6))
    throw Error("--duration", fmt::format("{} s is too short or too long", options.duration),
                "give 0 to 1e6");
  Interruption interruption;
  Ros2CameraPublisher publisher(options.name, options.packing);
  CameraFeed feed(options.camera);
  std::atomic<bool> is_depth{true};
  feed.start([&](const FedFrame& fed) {
    const DepthImage* image = fed.frame.cloud->image();
    if (image == nullptr)
      is_depth = false;
    else
      publisher.publish(*image, 1e-9 * static_cast<double>(since_1970(fed.frame.stamp)));
  });
  fmt::print(stderr,
             "palpate: publishes {} as ros2:{} in domain {}, and for lossy networks as ros2:{}; "
             "Ctrl-C ends it\n",
             options.camera, publisher.topic(), publisher.domain(), publisher.slices_topic());
  const double end = monotonic_now() + options.duration;
  while (interruption.signal() == 0 && is_depth &&
         (options.duration == 0.0 || monotonic_now() < end))
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  feed.stop();
  const CameraStatus status = feed.status();
  if (!is_depth)
    throw Error(options.camera, "it gives points, not depth images", "use a depth camera");
  fmt::print("{} frames published at {:.1f} Hz\n", status.frames, status.rate);
  return interruption.signal() == 0 ? 0 : exit_status_of(interruption.signal());
}

}  // namespace

Verb add_serve_camera(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "serve-camera", "publish a camera's depth images on the ROS 2 network, lossless");
  const auto options = std::make_shared<ServeOptions>();
  command->add_option("--camera", options->camera, "camera to publish, e.g. realsense:");
  command->add_option("--name", options->name, "name in its topics (camera): /NAME/depth/...");
  command
      ->add_option("--packing", options->packing,
                   "rvl: fast (default); png: more delay, for subscribers without RVL")
      ->transform(CLI::CheckedTransformer(std::map<std::string, DepthPacking>{
          {"rvl", DepthPacking::rvl}, {"png", DepthPacking::png}}));
  command->add_option("--duration", options->duration, "[s] after which it ends (0: never)");
  return {command, [options] { return serve(*options); }};
}

}  // namespace palpate::app
