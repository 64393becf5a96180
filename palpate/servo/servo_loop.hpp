// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "palpate/servo/cycle.hpp"
#include "palpate/servo/periodic_thread.hpp"

namespace palpate {

/// How the loop runs.
struct ServoOptions {
  double rate = 1000.0;  ///< [Hz] 500 to 10 000; a clean wall grows stiffer with it
  RealtimeRequest realtime{};
};

/// The live loop: cycles on a real-time thread of their own, from `start` to `stop`.
///
/// Time is monotonic_now(): frames must be stamped on that clock.
class ServoLoop {
 public:
  /// @throws Error if the rate is out of range or the settings do not validate.
  ServoLoop(std::unique_ptr<Rendering> rendering, Device& device,
            const ServoSettings& settings = {}, const ServoOptions& options = {});
  /// Stops.
  ~ServoLoop();
  ServoLoop(const ServoLoop&) = delete;
  ServoLoop& operator=(const ServoLoop&) = delete;

  /// Starts the thread, once; returns when it has its rights.
  void start();
  /// Lets the cycle in progress end, then takes the force off the device.
  void stop();

  /// As Cycle's.
  std::uint64_t put_frame(std::shared_ptr<const Cloud> cloud, double stamp) {
    return cycle_.put_frame(std::move(cloud), stamp, monotonic_now());
  }
  std::uint64_t set_settings(const ServoSettings& settings) {
    return cycle_.set_settings(settings);
  }
  void renew(std::shared_ptr<Rendering> rendering) { cycle_.renew(std::move(rendering)); }
  [[nodiscard]] TickRing<ServoTick>::Reader reader() const { return cycle_.reader(); }
  [[nodiscard]] const CycleStatistics& statistics() const { return cycle_.statistics(); }

  /// Of the thread; from `start` on, also after `stop`.
  [[nodiscard]] const Timing& timing() const { return thread_->timing(); }
  [[nodiscard]] const RealtimeReport& realtime() const { return thread_->realtime(); }

 private:
  Device& device_;
  ServoOptions options_;
  Cycle cycle_;
  std::unique_ptr<PeriodicThread> thread_;
};

}  // namespace palpate
