// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>

#include "palpate/io/sources/source.hpp"

namespace palpate {

/// What was wrong with a stamp of capture.
enum class StampProblem : std::uint8_t {
  none,
  jumped,           ///< the camera's clock was reset; the offset was measured again
  drifted,          ///< the clock, or the camera's latency, moved slowly beyond what is followed
  from_the_future,  ///< later than the frame's arrival
  too_old,          ///< older than 1 s at arrival, or older than the frames before explain
  not_increasing,   ///< not later than the frame before
};
constexpr std::size_t stamp_problem_count = 6;

/// When a frame was captured, on the servo loop's clock.
struct PlacedStamp {
  double time = 0.0;  ///< [s, CLOCK_MONOTONIC] never later than the arrival
  StampProblem problem = StampProblem::none;
  /// False for a frame to leave out: its time is not later than that of the frame before.
  bool usable = true;
};

/// Converts capture timestamps of a camera to the servo loop's clock, from the arrival times.
///
/// Model: arrival = timestamp + offset + latency, latency >= 0. The offset is the minimum of
/// arrival - timestamp over the last 10 s; it may fall at once and rise by 200 ppm at most, so that
/// a growing latency is not mistaken for a drift. The minimum latency cannot be observed, so
/// converted timestamps are late by it: some 10 to 70 ms for USB cameras. While the clock is
/// accurate the offset is constant, so that intervals between timestamps stay the same.
///
/// Clocks of this computer (StampClock::monotonic, system) have a known offset, which is used as
/// long as the timestamps agree with it.
///
/// An implausible timestamp (StampProblem) is replaced by the arrival minus the typical latency;
/// after three in a row that are consistent with one another the offset is estimated again
/// (`jumped`). Late frames with regular timestamps, such as those of a queue behind a stall, keep
/// their timestamps, however old they are.
///
/// Values in, values out: no clock, no thread. Used on the camera's thread.
class StampPlacer {
 public:
  explicit StampPlacer(StampClock clock = StampClock::sensor);

  /// @param stamp         [s] of capture, by the camera's clock
  /// @param arrival       [s, CLOCK_MONOTONIC] when the frame reached this machine
  /// @param known_offset  [s] of a clock of this machine: add it to a stamp to get CLOCK_MONOTONIC
  PlacedStamp place(double stamp, double arrival, double known_offset = 0.0);

  /// Begins again, as after the camera was opened again; times continue increasing.
  void restart(StampClock clock);

  /// [s] usual time from capture to arrival, less the least latency where the offset is estimated.
  [[nodiscard]] double latency() const { return latency_; }

 private:
  struct Sample {
    double arrival, difference;
  };

  [[nodiscard]] StampProblem judge(double stamp, double arrival) const;
  [[nodiscard]] bool is_regular(double interval) const;
  [[nodiscard]] double period() const;
  StampProblem suspect(double difference, double arrival, StampProblem problem);
  void begin(double difference, double arrival);
  StampProblem follow(double difference, double arrival);
  PlacedStamp give(double time, double arrival, StampProblem problem);

  bool is_known_;         // the offset is given rather than estimated
  bool is_first_ = true;  // no stamp since the (re)start
  double offset_ = 0.0;   // [s]
  double latency_ = 0.0;  // [s]
  double settled_ = 0.0;  // [s] arrival from which the offset has settled
  double last_stamp_ = 0.0, last_arrival_ = 0.0;
  double last_time_;           // [s] given last, over all passes
  int suspects_ = 0;           // stamps in a row that cannot be true and agree with one another
  double candidate_ = 0.0;     // [s] least difference of those
  int repeated_ = 0;           // stamps in a row that are equal
  std::deque<Sample> window_;  // differences that grow with time: candidates for the least
  std::array<double, 9> intervals_{};  // [s] between stamps, the last ones
  std::size_t interval_count_ = 0;
};

}  // namespace palpate
