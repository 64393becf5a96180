// SPDX-License-Identifier: Apache-2.0
#include "app/run_recording.hpp"

#include <chrono>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "palpate/core/error.hpp"

namespace palpate::app {

RunRecording::RunRecording(const std::string& folder, SessionInfo info,
                           const ServoSettings& settings, double start) {
  if (folder.empty()) return;
  using std::chrono::nanoseconds;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  info.kind = SessionInfo::Kind::headless;
  info.version = PALPATE_VERSION;
  info.epoch = std::chrono::duration_cast<nanoseconds>(now).count() - std::llround(1e9 * start);
  writer_ = std::make_unique<SessionWriter>(folder, info, start);
  writer_->settings({.number = 0, .settings = settings}, start);
}

template <class Write>
void RunRecording::attempt(const Write& write) {
  if (!writer_) return;
  try {
    write();
  } catch (const Error& error) {
    fmt::print(stderr, "palpate: the recording stops here: {}\n", error.what());
    broken_off_ = true;
    writer_.reset();
  }
}

void RunRecording::frame(double stamp, std::span<const std::shared_ptr<const Cloud>> cameras) {
  stamp_ = stamp;
  attempt([&] { writer_->frame(++frames_, stamp, cameras); });
}

void RunRecording::tick(const Tick& tick) {
  attempt([&] {
    ServoTick record{};
    record.tick = tick;
    record.force = tick.force;
    record.position = tick.hip;
    record.gain = 1.0;
    record.frame_stamp = stamp_;
    record.frame_age = frames_ > 0 ? tick.t - stamp_ : std::numeric_limits<double>::infinity();
    record.number = ticks_++;
    record.frame_number = frames_;
    record.hand = hand_present;
    writer_->tick(record);
    writer_->commit_if_due();
  });
}

bool RunRecording::finish() {
  attempt([&] { writer_->close(); });
  return !broken_off_;
}

}  // namespace palpate::app
