// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/replay.hpp"
#include "palpate/record/session_reader.hpp"
#include "palpate/record/session_writer.hpp"

#include "tests/servo/fake_device.hpp"

namespace palpate::test {

/// A small camera that looks down on a wavy floor which rises from frame to frame, with doubles
/// that no short decimal number holds.
inline std::shared_ptr<const DepthImage> wavy_floor(int frame, bool distorted = false) {
  Intrinsics k{.width = 32, .height = 24, .fx = 1000.0 / 9.0, .fy = 110.1, .cx = 15.7, .cy = 11.3};
  if (distorted) k.distortion = {0.1 / 3.0, -0.01, 1e-3 / 7.0, 0, 0, 0, 0, 1e-5};
  static const auto plain = std::make_shared<const ViewingRays>(k);
  const auto rays = distorted ? std::make_shared<const ViewingRays>(k) : plain;
  std::mt19937 random(static_cast<unsigned>(frame));
  std::vector<std::uint16_t> depth;
  for (int i = 0; i < k.width * k.height; ++i) {
    const double wave = 20.0 * math::sin(0.3 * (i % k.width));
    const auto noise = static_cast<double>(random() % 5);
    depth.push_back(static_cast<std::uint16_t>(1000.0 + wave + noise - 3.0 * frame));
  }
  depth[5] = 0;
  depth[6] = 65535;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const double tilt = 0.5 * (std::numbers::pi - 0.1 / 3.0);
  pose.rotate(Eigen::Quaterniond(math::cos(tilt), math::sin(tilt), 0.0, 0.0));
  pose.translation() = Vec3(0.1, -0.2, 1.0) / 3.0;
  return std::make_shared<DepthImage>(rays, std::move(depth), 3000.0 / 1.1, pose);
}

/// Runs a hand through the floor and records it. @return the ticks as they were
inline std::vector<ServoTick> record_press(SessionWriter& writer, const Parameters& parameters,
                                           int ticks, bool close = true,
                                           const std::string& method = "sight") {
  const auto place = [](int i) { return Vec3(0.03 + 1e-5 * i, -0.05, -0.01 - 4e-4 * i); };
  FakeDevice device;
  Cycle cycle(make_method(method, parameters), device, {method, parameters, {}, {}});
  CycleReader reader = cycle.full_reader();
  writer.commands(cycle.commands(), 0.0);
  std::vector<ServoTick> recorded;
  for (int i = 0; i < ticks; ++i) {
    const double t = i * 1e-3;
    if (i % 33 == 0) {
      const auto cloud = wavy_floor(i / 33);
      const double stamp = t - 1e-4 / 3.0;
      writer.frame(cycle.put_frame(cloud, stamp, t), stamp, 0, cloud);
    }
    device.hand.position = place(i);
    device.hand.orientation = Eigen::Quaterniond(1.0, 0.1 / 3.0, 1e-3 * i, -0.2).normalized();
    cycle.run({.t = t});
    for (AdoptedFrame frame; reader.frames.try_pop(frame);) writer.adopted(frame);
    reader.ticks.try_pop(recorded.emplace_back());
    writer.tick(recorded.back());
  }
  if (close) writer.close();
  return recorded;
}

/// What a replay found, for messages.
inline std::string text_of(const ReplayReport& report) {
  std::string text = report.broken_off + report.check.damage;
  for (const ReplayDifferences* each : {&report.asked, &report.sent}) {
    if (each->first)
      text += " tick " + std::to_string(each->first->tick) + " " + each->first->field + " was " +
              std::to_string(each->first->recorded) + ", is " +
              std::to_string(each->first->replayed);
  }
  return text;
}

inline SessionInfo press_info() {
  return {.version = "test",
          .cameras = {"synthetic:floor"},
          .device = "script:",
          .epoch = 1'700'000'000'000'000'000};
}

}  // namespace palpate::test
