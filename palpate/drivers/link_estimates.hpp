// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

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

/// How a clock of another machine is related to one of this machine, by questions and answers.
///
/// A question is sent at `asked`, the other machine answers with its own time `answer`, which
/// arrives at `heard`. Wherever the answer's time lies between the two, the clocks' difference is
/// answer - (asked + heard)/2 within half the round trip. An answer counts if it is known better
/// than what is known, which becomes uncertain with time as clocks drift apart. Answers that
/// contradict what is known, three in a row, say that a clock was set: all begins anew.
///
/// The difference that is given follows what is known by 1 ms/s at most, so that intervals
/// between stamps keep what a velocity needs.
///
/// Values in, values out: no clock, no thread.
class ClockRelation {
 public:
  /// @param asked, heard  [s] by this machine's clock  @param answer  [s] by the other one
  void add(double asked, double answer, double heard);

  [[nodiscard]] bool is_known() const { return given_.has_value(); }
  /// [s] other clock less this one, at a time of this one. 0 as long as it is not known.
  [[nodiscard]] double difference() const { return given_.value_or(0.0); }
  /// [s] by which it may be wrong at most, if clocks drift apart by no more than 100 ppm.
  [[nodiscard]] double uncertainty(double now) const;

 private:
  struct Known {
    double difference, uncertainty, time;
  };

  void begin(const Known& first);
  // [s] by which what is known may be wrong
  [[nodiscard]] double doubt(double now) const;

  std::optional<Known> known_;
  std::optional<double> given_;
  double given_at_ = 0.0;   // [s] by this machine's clock
  int contradictions_ = 0;  // in a row
};

}  // namespace palpate
