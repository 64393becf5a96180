// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/session.hpp"
#include "palpate/servo/cycle.hpp"

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

/// Noise of such a floor [units of depth]: zero here and there, and ten times as much on one half.
inline std::vector<float> wavy_noise(int frame) {
  std::vector<float> noise(32 * 24);
  for (std::size_t i = 0; i < noise.size(); ++i)
    noise[i] = i % 7 == 0 ? 0.0F : (i % 32 < 16 ? 1.3F : 13.0F) + static_cast<float>(frame) / 3.0F;
  return noise;
}

/// A loop on a clock of its own: a hand that presses into a floor which rises, parameters that
/// change on the way, a clutch, faults and their reset, a second camera now and then.
class PressedFloor {
 public:
  explicit PressedFloor(const std::string& method,
                        std::shared_ptr<const FixtureSet> fixtures = nullptr) {
    settings_.method = method;
    // Forces that are sent at once.
    settings_.safety.engage_force = 3.0;
    settings_.safety.engage_ticks = 2.0;
    settings_.safety.ramp_time = 0.02;
    settings_.safety.initial_heat = 0.5;
    settings_.fixtures = std::move(fixtures);
    cycle_ = std::make_unique<Cycle>(make_method(method), device_, settings_);
  }
  virtual ~PressedFloor() = default;
  PressedFloor(const PressedFloor&) = delete;
  PressedFloor& operator=(const PressedFloor&) = delete;

  /// What the camera sees at its frame of a number.
  std::function<std::shared_ptr<const Cloud>(int)> floor = [](int frame) {
    return wavy_floor(frame);
  };

  void run(int ticks) {
    for (int i = 0; i < ticks; ++i, ++tick_) {
      if (tick_ % 50 == 0) flush();
      if (tick_ % 33 == 0) {
        cloud_ = floor(tick_ / 33 % 10);
        stamp_ = now() - 1e-4 / 3.0;
        // Another camera is listed now and then, whose pictures come late.
        const std::array<CameraFrame, 2> cameras = {
            {{.camera = 0, .stamp = stamp_}, {.camera = 3, .stamp = stamp_ - 0.02}}};
        const std::size_t count = tick_ % 99 == 0 || has_second ? 2 : 1;
        frame_ = cycle_->put_frame(cloud_, stamp_, std::span(cameras.data(), count), now() - 1e-3);
        put(frame_, stamp_, 0, cloud_);
      }
      if (has_second && tick_ % 22 == 11) put_second();
      if (tick_ % 70 == 69) {
        settings_.parameters.coupling.stiffness += 100.0 / 3.0;  // a few times
        cycle_->set_settings(settings_);
        told();
      }
      device_.hand.position =
          Vec3(0.03 + 1e-5 * tick_, -0.05, -0.02 - 1e-4 * std::min(tick_.load(), 300));
      // It swings with 14 Hz, as a hand on a surface that oscillates does.
      if (tick_ > 100)
        device_.hand.position.z() += 2e-3 * math::sin(2e-3 * std::numbers::pi * 14 * tick_);
      // Now and then the device's clutch, nobody at it, a fault, and its reset.
      device_.hand.clutched = tick_ % 120 >= 110;
      device_.hand.present = tick_ % 170 < 165;
      device_.hand.fault = tick_ % 200 == 199 ? DeviceFault::overheated : DeviceFault::none;
      if (tick_ % 130 == 0) cycle_->reset_faults();
      cycle_->run({.t = now(), .wake_up_ns = static_cast<std::uint32_t>(tick_ % 7)});
    }
  }

  // Now and then in the same tick as the first camera's, with an older stamp.
  void put_second() {
    second_.cloud = floor(tick_ / 22 % 10);
    second_.stamp = now() - 2e-3;
    const std::array<CameraFrame, 2> cameras = {
        {{.camera = second_camera, .stamp = second_.stamp}, {.camera = 0, .stamp = stamp_}}};
    second_.number = cycle_->put_frame(second_.cloud, second_.stamp, cameras, now() - 1e-3);
    put(second_.number, second_.stamp, second_camera, second_.cloud);
  }

  static constexpr std::size_t second_camera = 3;
  bool has_second = false;  ///< the other camera has frames of its own

  [[nodiscard]] TickRing<ServoTick>::Reader ticks() const { return cycle_->reader(); }

 protected:
  /// For who records: each frame that was put, each change of the settings, now and then.
  virtual void put(std::uint64_t /*number*/, double /*stamp*/, std::size_t /*camera*/,
                   const std::shared_ptr<const Cloud>& /*cloud*/) {}
  virtual void told() {}
  virtual void flush() {}

  [[nodiscard]] double now() const {
    return 1000.0 / 3.0 + 1e-3 * tick_ + (tick_ > 150 ? 0.02 : 0);
  }

  FakeDevice device_;
  ServoSettings settings_;
  std::unique_ptr<Cycle> cycle_;
  std::shared_ptr<const Cloud> cloud_;
  double stamp_ = 0.0;
  std::uint64_t frame_ = 0;
  struct {
    std::shared_ptr<const Cloud> cloud;
    double stamp = 0.0;
    std::uint64_t number = 0;
  } second_;
  std::atomic<int> tick_{0};  // a recorder's thread reads it
};

inline constexpr int golden_ticks = 600;

}  // namespace palpate::test
