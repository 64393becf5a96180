// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>

#include <gtest/gtest.h>

#include "palpate/record/recorder.hpp"
#include "palpate/record/replay.hpp"

#include "tests/record/sessions.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::test {

/// The same, recorded.
class LoopSession final : public PressedFloor {
 public:
  using PressedFloor::PressedFloor;

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

  // What a recording in mid-session begins with: the same method made anew.
  void begin_anew() {
    recorder_->commands(cycle_->command([](ServoCommands&) {}, make_method(settings_.method)),
                        now());
  }

  /// Runs for `before` ticks, then records some more into the folder `bag` in `folder`, and replays
  /// them, which has to give the same ticks.
  SessionReader recorded(const TemporaryFolder& folder, int before, int ticks) {
    run(before);
    record(folder.path() / "bag");
    run(ticks);
    recorder_->stop();
    EXPECT_EQ(recorder_->status().trouble, "");
    SessionReader reader(folder.path() / "bag");
    const ReplayReport report = replay(reader);
    EXPECT_TRUE(report.identical()) << text_of(report);
    EXPECT_GE(report.ticks, static_cast<std::uint64_t>(ticks - 100));
    return SessionReader(folder.path() / "bag");
  }

  void hand_no_more_frames() { handing_ = false; }
  [[nodiscard]] Recorder& recorder() { return *recorder_; }

 private:
  void put(std::uint64_t number, double stamp, std::size_t camera,
           const std::shared_ptr<const Cloud>& cloud) override {
    if (recorder_ && handing_) recorder_->frame(number, stamp, camera, cloud);
  }
  void told() override {
    if (recorder_) recorder_->commands(cycle_->commands(), now());
  }
  void flush() override {
    if (recorder_) recorder_->flush();
  }

  bool handing_ = true;
  std::unique_ptr<Recorder> recorder_;  // before the cycle, which it reads
};

}  // namespace palpate::test
