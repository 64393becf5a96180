// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "app/program_robots.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/net/telelink/robots.hpp"

namespace palpate::app {
namespace {

// A tool in a synthetic scene, and the camera that sees it.
Cell open_scene(const std::string& uri) {
  auto camera = open_synthetic_camera(Uri(uri));
  const Vec3 begin(0.0, 0.0, 0.12);  // [m] above what scenes have in the middle
  // Of whoever leads it, and of whoever shows it frames.
  std::shared_ptr<SceneRobot> robot =
      open_scene_robot(std::make_shared<const Scene>(camera->scene()), begin, uri);
  const std::shared_ptr<std::unique_ptr<Source>> source =
      std::make_shared<std::unique_ptr<Source>>(std::move(camera));
  return {
      .robot = [robot] { return robot; },
      .camera = [source] { return std::move(*source); },
      .on_frame =
          [robot](const FedFrame& frame) { robot->relate(frame.frame.stamp, frame.source_stamp); }};
}

}  // namespace

Cell open_standard_cell(const std::string& uri) {
  if (Uri(uri).scheme() == "synthetic") return open_scene(uri);
  return {.robot = [uri] { return open_robot(uri); }, .camera = nullptr, .on_frame = nullptr};
}

std::string standard_robots_help() {
  std::string text = "synthetic:SCENE: a simulated tool in a scene";
  const Registry<RobotScheme> robots = standard_robots();
  for (const RobotScheme& scheme : robots.entries())
    text += "; " + scheme.name + ": " + scheme.summary;
  return text;
}

}  // namespace palpate::app
