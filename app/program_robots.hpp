// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "palpate/io/sources/source.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/session/camera_feed.hpp"

namespace palpate::app {

/// A robot, and its camera where it has one of its own.
struct Cell {
  std::function<std::shared_ptr<Robot>()> robot;    ///< once
  std::function<std::unique_ptr<Source>()> camera;  ///< once; empty: none
  /// Sees the camera's frames; empty: it need not.
  std::function<void(const FedFrame&)> on_frame;
};

/// What this program can lead; each program has its own.
/// @param uri  of a robot
/// @throws Error for an unknown kind, or if it cannot be opened.
Cell open_cell(const std::string& uri);

/// The help of --robot.
std::string robots_help();

/// What is led where nothing is named: a scene with a robot in it, and its camera.
std::string usual_cell();

/// What every program can lead: the library's robots, and a tool in a synthetic scene.
/// @throws Error as open_cell.
Cell open_standard_cell(const std::string& uri);

/// What those are, as one part of the help of --robot.
std::string standard_robots_help();

}  // namespace palpate::app
