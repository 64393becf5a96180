// SPDX-License-Identifier: Apache-2.0
#include "robot/simulated_camera.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <variant>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate::robot {
namespace {

constexpr float nothing = std::numeric_limits<float>::infinity();

// The same shape with its surface moved out by `margin` (a block's corners stay sharp).
Shape thickened(const Shape& shape, double margin) {
  if (const auto* ball = std::get_if<Sphere>(&shape)) return Sphere{ball->radius + margin};
  if (const auto* rod = std::get_if<Capsule>(&shape))
    return Capsule{rod->radius + margin, rod->half_length};
  if (const auto* rod = std::get_if<Cylinder>(&shape))
    return Cylinder{rod->radius + margin, rod->half_length + margin};
  if (const auto* prism = std::get_if<Prism>(&shape)) {
    // Of an arm, always a block.
    const Eigen::Vector2d half = prism->outline.front().cwiseAbs();
    return block({half.x() + margin, prism->half_length + margin, half.y() + margin});
  }
  return shape;
}

}  // namespace

SimulatedCamera::SimulatedCamera(std::shared_ptr<Simulation> simulation,
                                 const SimulatedCameraSetup& setup, SourceInfo info)
    : simulation_(std::move(simulation)),
      setup_(setup),
      sensor_(setup.sensor, setup.camera.intrinsics),
      info_(std::move(info)),
      rays_(std::make_shared<const ViewingRays>(setup.camera.intrinsics)) {
  check_range("simulated camera", "frame rate", "Hz", 0.1, 1000.0, setup.camera.frame_rate);
  check_range("simulated camera", "latency", "s", 0.0, 0.4, setup.latency);
  check_range("simulated camera", "margin", "m", 0.0, 0.1, setup.margin);
  for (const VisibleGeom& geom : simulation_->geoms())
    thick_.push_back(thickened(geom.shape, geom.of_arm ? setup.margin : 0.0));
  if (setup.arm == ArmView::remembered)
    behind_arm_.emplace(setup.camera.intrinsics.width, setup.camera.intrinsics.height);
  info_.frame_rate = setup.camera.frame_rate;
  info_.live = simulation_->runs();
  info_.clock = info_.live ? StampClock::monotonic : StampClock::recording;
  if (info_.kind.empty()) info_.kind = "simulated depth camera of a robot's cell";
}

std::size_t SimulatedCamera::skip(std::size_t count) {
  if (info_.live) return 0;
  next_frame_ += count;
  return count;
}

std::optional<Frame> SimulatedCamera::next(double timeout) {
  if (info_.live) return live(timeout);
  const std::uint64_t frame = next_frame_++;
  const double due = static_cast<double>(frame) / setup_.camera.frame_rate;
  // What is told of a time is told by the step that begins then.
  simulation_->advance(due + simulation_->step_length());
  return capture(simulation_->poses(due), frame);
}

std::optional<Frame> SimulatedCamera::live(double timeout) {
  const double now = monotonic_now();
  const double period = 1.0 / setup_.camera.frame_rate;
  if (!first_) first_ = now;
  // The newest frame that can be given by now, unless it was given; else the one to come.
  const double newest = std::floor((now - setup_.latency - *first_) / period);
  if (newest > static_cast<double>(next_frame_)) next_frame_ = static_cast<std::uint64_t>(newest);
  const double captured = *first_ + static_cast<double>(next_frame_) * period;
  const double wait = captured + setup_.latency - now;
  const double longest = std::clamp(std::min(wait, timeout), 0.0, 3600.0);
  if (cancelled_.rest(std::chrono::duration<double>(longest)) || wait > std::max(timeout, 0.0))
    return std::nullopt;
  return capture(simulation_->poses(captured), next_frame_++);
}

Frame SimulatedCamera::capture(const BodyPoses& poses, std::uint64_t frame) {
  const std::vector<VisibleGeom>& geoms = simulation_->geoms();
  const Intrinsics& image = setup_.camera.intrinsics;
  const auto draw = [&](const VisibleGeom& geom, const Shape& shape, std::vector<float>& depth) {
    palpate::draw(shape,
                  (poses.world_from_body[geom.body] * geom.body_from_shape).inverse() *
                      setup_.camera.world_from_camera,
                  *rays_, depth);
  };
  if (resting_.empty()) {
    resting_.assign(static_cast<std::size_t>(image.width) * image.height, nothing);
    for (const VisibleGeom& geom : geoms) {
      if (geom.rests && !geom.of_arm) draw(geom, geom.shape, resting_);
    }
  }
  depth_ = resting_;
  for (const VisibleGeom& geom : geoms) {
    const bool drawn = geom.of_arm ? setup_.arm == ArmView::seen : !geom.rests;
    if (drawn) draw(geom, geom.shape, depth_);
  }
  std::vector<std::uint16_t> readings = sensor_.measure(depth_, frame);
  if (setup_.arm != ArmView::seen) {
    // Starting from the scene's depth, so that what is before the arm stays.
    arm_ = depth_;
    for (std::size_t i = 0; i < geoms.size(); ++i) {
      if (geoms[i].of_arm) draw(geoms[i], thick_[i], arm_);
    }
    for (std::size_t i = 0; i < readings.size(); ++i) {
      if (arm_[i] < depth_[i])
        readings[i] = 0;
      else
        arm_[i] = nothing;
    }
    if (behind_arm_) behind_arm_->fill(readings, arm_, 1.0 / sensor_.model().quantisation, poses.t);
  }
  return {poses.t, std::make_shared<const DepthImage>(rays_, std::move(readings),
                                                      1.0 / sensor_.model().quantisation,
                                                      setup_.camera.world_from_camera)};
}

}  // namespace palpate::robot
