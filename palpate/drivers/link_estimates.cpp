// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/link_estimates.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

constexpr double least_received = 0.85;  // [-] below which a queue overflows
constexpr double most_lateness = 0.06;   // [s] beyond which a queue fills: more than Wi-Fi's jitter
constexpr double cut = 0.7;              // [-] what is left of the rate
constexpr double growth = 2.0;           // [Hz/s]
constexpr double settling = 0.5;         // [s] until a cut shows: a queue's 0.25 s and a way back
// of a new report in the usual share: images that a link held up come at once, and some are lost
// then where nothing is too many in the long run
constexpr double report_weight = 0.15;
constexpr double copies_from = 0.01, copies_to = 0.004;  // lost by chance
constexpr double room = 2.5;                             // of the rate, for copies
constexpr double no_room_for = 30.0;  // [s] after copies were too much for a link
constexpr double rate_weight = 0.1;   // of a new interval in the usual rate

}  // namespace

void SendRate::report(double now, double received, double lateness, double heard) {
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

bool SendRate::allows(double now) {
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
namespace {

constexpr double drift = 100e-6;  // [-] by which two crystals differ at most
// [-] of 33 ms between two frames 0.1 %: less than a velocity is known by
constexpr double slew = 1e-3;
constexpr int enough_contradictions = 3;

}  // namespace

void ClockRelation::add(double asked, double answer, double heard) {
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

void ClockRelation::begin(const Known& first) {
  known_ = first;
  given_ = first.difference;
  given_at_ = first.time;
  contradictions_ = 0;
}

double ClockRelation::doubt(double now) const {
  return known_->uncertainty + drift * std::max(now - known_->time, 0.0);
}

double ClockRelation::uncertainty(double now) const {
  return known_ ? doubt(now) + std::abs(known_->difference - *given_) : 0.0;
}

}  // namespace palpate
