// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

namespace palpate {

/// How many images a second a link carries, from what the readers at its other end report: fewer
/// when images come incomplete or ever later, as where a link's queue fills up, and a little more
/// each second when they do not. What is lost by chance, up to 15 % of half a second, does not
/// count; where it is more than 1 % and there is room for it, each slice is sent twice.
class SendRate {
 public:
  /// @param now       [s]
  /// @param received  share of the slices that came, 0 to 1
  /// @param lateness  [s] of all images lately, more than the least that was seen
  /// @param heard     share of the slices, each counted as often as it came
  void report(double now, double received, double lateness, double heard) {
    const double passed = std::clamp(now - last_report_, 0.0, 0.2);
    last_report_ = now;
    if (!std::isfinite(received + lateness + heard)) return;
    received_ += report_weight * (std::clamp(received, 0.0, 1.0) - received_);
    lost_ += report_weight * (std::clamp(1.0 - heard / copies_, 0.0, 1.0) - lost_);
    if (received_ >= least_received && lateness <= most_lateness) {
      limit_ = std::min(limit_ + growth * passed, fastest);
      if (copies_ == 2 ? lost_ < copies_to
                       : lost_ > copies_from && now > single_until_ && limit_ > room * sent_)
        copies_ = 3 - copies_;
    } else if (copies_ == 2) {
      copies_ = 1;
      single_until_ = now + no_room_for;
      last_cut_ = now;
      received_ = 1.0;
    } else if (now - last_cut_ > settling) {
      const double usual = sent_ > 0.0 ? std::min(limit_, sent_) : limit_;
      limit_ = std::max(cut * usual, slowest);
      last_cut_ = now;
      received_ = 1.0;
    }
  }

  /// May the image that is captured now be sent? Counts it if it may.
  bool allows(double now) {
    // A quarter of an interval early is on time, so that a camera at the limit is not halved.
    if (now < next_ - 0.25 / limit_) return false;
    if (last_sent_ > 0.0 && now > last_sent_) {
      const double rate = 1.0 / (now - last_sent_);
      sent_ = sent_ > 0.0 ? sent_ + rate_weight * (rate - sent_) : rate;
    }
    last_sent_ = now;
    next_ = std::max(next_, now - 0.5 / limit_) + 1.0 / limit_;
    return true;
  }

  /// How often each slice is to be sent: 1 or 2.
  [[nodiscard]] int copies() const { return copies_; }

  /// [Hz]
  [[nodiscard]] double limit() const { return limit_; }

 private:
  static constexpr double fastest = 200.0, slowest = 2.0;  // [Hz]
  static constexpr double least_received = 0.85;           // [-] below which a queue overflows
  // [s] beyond it a queue fills: above Wi-Fi's jitter
  static constexpr double most_lateness = 0.06;
  static constexpr double cut = 0.7;       // [-] what is left of the rate
  static constexpr double growth = 2.0;    // [Hz/s]
  static constexpr double settling = 0.5;  // [s] until a cut shows: a queue's 0.25 s and a way back
  // of a new report in the usual share: images that a link held up come at once, and some are lost
  // then where nothing is too many in the long run
  static constexpr double report_weight = 0.15;
  static constexpr double copies_from = 0.01, copies_to = 0.004;  // lost by chance
  static constexpr double room = 2.5;                             // of the rate, for copies
  static constexpr double no_room_for = 30.0;  // [s] after copies were too much for a link
  static constexpr double rate_weight = 0.1;   // of a new interval in the usual rate

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
class ClockRelation {
 public:
  /// @param asked, heard  [s] by this machine's clock  @param answer  [s] by the other one
  void add(double asked, double answer, double heard) {
    if (!(std::isfinite(asked) && std::isfinite(answer) && heard >= asked)) return;
    const Known next{answer - 0.5 * (asked + heard), 0.5 * (heard - asked), heard};
    if (!known_) return begin(next);
    const double uncertain = doubt(heard);
    if (std::abs(next.difference - known_->difference) > next.uncertainty + uncertain) {
      if (++contradictions_ >= enough_contradictions) begin(next);
      return;
    }
    contradictions_ = 0;
    if (next.uncertainty < uncertain) known_ = next;
    const double most = slew * std::max(heard - given_at_, 0.0);
    given_ = *given_ + std::clamp(known_->difference - *given_, -most, most);
    given_at_ = heard;
  }

  [[nodiscard]] bool is_known() const { return given_.has_value(); }
  /// [s] other clock less this one, at a time of this one. 0 as long as it is not known.
  [[nodiscard]] double difference() const { return given_.value_or(0.0); }
  /// [s] by which it may be wrong at most, if clocks drift apart by no more than 100 ppm.
  [[nodiscard]] double uncertainty(double now) const {
    return known_ ? doubt(now) + std::abs(known_->difference - *given_) : 0.0;
  }

 private:
  static constexpr double drift = 100e-6;  // [-] by which two crystals differ at most
  // [-] of 33 ms between two frames 0.1 %: less than a velocity is known by
  static constexpr double slew = 1e-3;
  static constexpr int enough_contradictions = 3;

  struct Known {
    double difference, uncertainty, time;
  };

  void begin(const Known& first) {
    known_ = first;
    given_ = first.difference;
    given_at_ = first.time;
    contradictions_ = 0;
  }
  // [s] by which what is known may be wrong
  [[nodiscard]] double doubt(double now) const {
    return known_->uncertainty + drift * std::max(now - known_->time, 0.0);
  }

  std::optional<Known> known_;
  std::optional<double> given_;
  double given_at_ = 0.0;   // [s] by this machine's clock
  int contradictions_ = 0;  // in a row
};

}  // namespace palpate
