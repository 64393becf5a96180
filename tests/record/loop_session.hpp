// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <numbers>
#include <span>
#include <string>

#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/recorder.hpp"

#include "tests/record/sessions.hpp"

namespace palpate::test {

/// A loop on a clock of its own: a hand that presses into a floor which rises, parameters that
/// change on the way, a clutch, faults and their reset, a second camera now and then.
class LoopSession {
 public:
  explicit LoopSession(const std::string& method,
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

  /// What the camera sees at its frame of a number.
  std::function<std::shared_ptr<const Cloud>(int)> floor = [](int frame) {
    return wavy_floor(frame);
  };

  void record(const std::filesystem::path& folder, const RecorderOptions& options = {}) {
    const bool is_on = tick_ > 0;
    recorder_ = std::make_unique<Recorder>(
        folder, SessionInfo{.version = "test"}, cycle_->full_reader(),
        is_on ? [this] { begin_anew(); } : std::function<void()>{}, options);
    recorder_->commands(cycle_->commands(), now());
    if (frame_ > 0) recorder_->frame(frame_, stamp_, 0, cloud_);
    if (second_.number > 0)
      recorder_->frame(second_.number, second_.stamp, second_camera, second_.cloud);
  }

  void run(int ticks) {
    for (int i = 0; i < ticks; ++i, ++tick_) {
      if (recorder_ && tick_ % 50 == 0) recorder_->flush();
      if (tick_ % 33 == 0) {
        cloud_ = floor(tick_ / 33 % 10);
        stamp_ = now() - 1e-4 / 3.0;
        // Another camera is listed now and then, whose pictures come late.
        const std::array<CameraFrame, 2> cameras = {
            {{.camera = 0, .stamp = stamp_}, {.camera = 3, .stamp = stamp_ - 0.02}}};
        const std::size_t count = tick_ % 99 == 0 || has_second ? 2 : 1;
        frame_ = cycle_->put_frame(cloud_, stamp_, std::span(cameras.data(), count), now() - 1e-3);
        if (recorder_ && handing_) recorder_->frame(frame_, stamp_, 0, cloud_);
      }
      if (has_second && tick_ % 22 == 11) put_second();
      if (tick_ % 70 == 69) {
        settings_.parameters.coupling.stiffness += 100.0 / 3.0;  // a few times
        cycle_->set_settings(settings_);
        if (recorder_) recorder_->commands(cycle_->commands(), now());
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
    if (recorder_ && handing_)
      recorder_->frame(second_.number, second_.stamp, second_camera, second_.cloud);
  }

  // What a recording in mid-session begins with: the same method made anew.
  void begin_anew() {
    recorder_->commands(cycle_->command([](ServoCommands&) {}, make_method(settings_.method)),
                        now());
  }

  static constexpr std::size_t second_camera = 3;
  bool has_second = false;  ///< the other camera has frames of its own

  void hand_no_more_frames() { handing_ = false; }
  [[nodiscard]] Recorder& recorder() { return *recorder_; }

 private:
  [[nodiscard]] double now() const {
    return 1000.0 / 3.0 + 1e-3 * tick_ + (tick_ > 150 ? 0.02 : 0);
  }

  FakeDevice device_;
  ServoSettings settings_;
  std::uint64_t settings_number_ = 0;
  std::unique_ptr<Cycle> cycle_;
  std::shared_ptr<const Cloud> cloud_;
  double stamp_ = 0.0;
  std::uint64_t frame_ = 0;
  struct {
    std::shared_ptr<const Cloud> cloud;
    double stamp = 0.0;
    std::uint64_t number = 0;
  } second_;
  std::atomic<int> tick_{0};  // begin_anew() runs on the recorder's thread
  bool handing_ = true;
  std::unique_ptr<Recorder> recorder_;  // before the cycle, which it reads
};

}  // namespace palpate::test
