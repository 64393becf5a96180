// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate {

/// How many images a second a link carries, from what the readers at its other end report: fewer
/// when images come incomplete or ever later, as they do where a link's queue fills up, and a
/// little more each second when they do not. What is lost by chance, up to 15 % of half a second,
/// does not count.
///
/// Where more than 1 % is lost by chance and there is room for it, each slice is sent twice.
///
/// Values in, values out: no clock, no thread.
class SendRate {
 public:
  /// @param now       [s]
  /// @param received  share of the slices that came, 0 to 1
  /// @param lateness  [s] of all images lately, more than the least that was seen
  /// @param heard     share of the slices, each counted as often as it came
  void report(double now, double received, double lateness, double heard);

  /// May the image that is captured now be sent? Counts it if it may.
  bool allows(double now);

  /// How often each slice is to be sent: 1 or 2.
  [[nodiscard]] int copies() const { return copies_; }

  /// [Hz]
  [[nodiscard]] double limit() const { return limit_; }

 private:
  static constexpr double fastest = 200.0, slowest = 2.0;  // [Hz]

  double limit_ = fastest;
  double sent_ = 0.0;      // [Hz] lately
  double received_ = 1.0;  // share, lately
  double lost_ = 0.0;      // share of what was sent, copies among it, lately
  int copies_ = 1;
  double single_until_ = 0.0;  // [s] since there was no room for copies
  double next_ = 0.0;          // [s] from which on an image may be sent
  double last_sent_ = 0.0;     // [s]
  double last_report_ = 0.0;   // [s]
  double last_cut_ = 0.0;      // [s]
};

}  // namespace palpate
