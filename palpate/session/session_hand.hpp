// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>

#include "palpate/record/recorder.hpp"
#include "palpate/servo/servo_loop.hpp"
#include "palpate/session/summary.hpp"

namespace palpate {

class MouseDevice;

/// One hand of a session: its device, its cycle, in a loop of its own or on the session's clock,
/// its recorder, and the count of its ticks.
class SessionHand {
 public:
  /// @param name       for messages and topics
  /// @param device     must not be null
  /// @param placement  of this device; the session's settings give the rest
  SessionHand(std::string name, std::unique_ptr<Device> device, const Placement& placement);
  /// Leaves loop and device to a thread of their own if a cycle hangs.
  ~SessionHand();

  /// Makes the cycle. @param servo  of a loop in real time; none: `run_at` runs the cycle
  /// @throws Error as Cycle and ServoLoop
  void begin(std::shared_ptr<Method> method, const ServoSettings& settings,
             const std::optional<ServoOptions>& servo);
  /// After `begin` of all, before a tick: no force while another one is in trouble (Cycle::link).
  void link(std::span<const std::unique_ptr<SessionHand>> hands);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] Device& device() const { return *device_; }
  /// The device, if a page moves it; else null.
  [[nodiscard]] MouseDevice* mouse() const { return mouse_; }
  [[nodiscard]] Cycle& cycle() const { return *cycle_; }
  /// Null where no clock drives the cycle.
  [[nodiscard]] ServoLoop* loop() const { return loop_.get(); }

  /// Runs a tick at `t` [s] and returns it. Free-running alone.
  std::optional<ServoTick> run_at(double t);
  /// Reads the ticks that came since the last call and counts them; of the newest one, whether its
  /// proxy is behind what the cameras see. Any thread, one at a time.
  void count(std::span<const std::shared_ptr<const Cloud>> cameras, double r_c);
  [[nodiscard]] Summary summary() const;

 private:
  std::string name_;
  std::unique_ptr<Device> device_;
  MouseDevice* mouse_;
  std::unique_ptr<ServoLoop> loop_;                 // in real time
  std::unique_ptr<Cycle> free_cycle_;               // free-running
  Cycle* cycle_ = nullptr;                          // of one of these
  std::optional<TickRing<ServoTick>::Reader> run_;  // of run_at

  mutable std::mutex mutex_;
  std::optional<TickRing<ServoTick>::Reader> counted_;  // guarded by mutex_
  Summary summary_;                                     // guarded by mutex_

 public:
  // Guarded by the session. The recorder reads the cycle, so it goes first.
  Placement placement;
  std::unique_ptr<Recorder> recorder = {};
};

}  // namespace palpate
