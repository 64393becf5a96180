// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

namespace palpate {

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
