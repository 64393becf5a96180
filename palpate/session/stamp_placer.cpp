// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/stamp_placer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

constexpr double max_drift =
    200e-6;  // [-] how fast the offset may grow: crystals differ by 100 ppm
constexpr double window_time = 10.0;  // [s] of arrivals, whose least latency counts
constexpr double least_jump =
    0.005;                       // [s] a stamp this much too late cannot be jitter of the estimate
constexpr double max_age = 1.0;  // [s] a stamp older than this at arrival is not believed
constexpr double departure = 0.05;  // [s] between estimate and window beyond which it is a drift
constexpr double settling = 1.0;    // [s] after a (re)start in which the offset may fall freely
constexpr int needed_suspects = 3;  // in a row, to believe that the clock was reset
constexpr double agreement = 0.02;  // [s] within which such stamps agree: jitter of a latency
constexpr double deepest_settling = 0.25;  // [s] first frames of a camera come at most this late
constexpr double regular = 0.25;           // [-] of a period, by which an interval may be off
constexpr double queue_periods = 2.5;      // a queue gives frames in sequence, one may be missing
constexpr double latency_weight = 0.05;    // of a new frame in the usual latency

bool is_of_this_machine(StampClock clock) {
  return clock == StampClock::monotonic || clock == StampClock::system;
}

}  // namespace

StampPlacer::StampPlacer(StampClock clock)
    : is_known_(is_of_this_machine(clock)), last_time_(-std::numeric_limits<double>::infinity()) {}

void StampPlacer::restart(StampClock clock) {
  const double last_time = last_time_;
  *this = StampPlacer(clock);
  last_time_ = last_time;
}

PlacedStamp StampPlacer::place(double stamp, double arrival, double known_offset) {
  if (!std::isfinite(stamp)) return give(arrival - latency_, arrival, StampProblem::not_increasing);
  const double difference = arrival - stamp;
  if (is_known_) offset_ = known_offset;
  if (is_first_ && !is_known_) begin(difference, arrival);

  repeated_ = !is_first_ && stamp == last_stamp_ ? repeated_ + 1 : 0;
  StampProblem problem = judge(stamp, arrival);
  if (!is_first_ && stamp > last_stamp_)
    intervals_[interval_count_++ % intervals_.size()] = stamp - last_stamp_;
  is_first_ = false;
  last_stamp_ = stamp;
  last_arrival_ = arrival;

  if (repeated_ > 0 && repeated_ < needed_suspects) {
    // The same capture once more. Only a clock that stands still gives more of them.
    return {arrival - latency_, StampProblem::not_increasing, false};
  }
  // After a stamp that cannot be true the next ones are believed only if they agree with the
  // offset.
  const bool is_doubted = suspects_ > 0 && std::abs(difference - offset_) > 2.0 * least_jump;
  if (is_doubted && problem == StampProblem::none) problem = StampProblem::too_old;
  const bool is_queue =
      !is_doubted && problem == StampProblem::too_old && difference - offset_ > max_age &&
      interval_count_ > 3 &&
      intervals_[(interval_count_ - 1) % intervals_.size()] <= queue_periods * period();
  if (problem != StampProblem::none && !is_queue) {
    problem = suspect(difference, arrival, problem);
    if (problem != StampProblem::jumped) return give(arrival - latency_, arrival, problem);
    return give(stamp + offset_, arrival, problem);
  }
  suspects_ = 0;
  if (!is_known_) {
    const StampProblem drift = follow(difference, arrival);
    if (drift != StampProblem::none) problem = drift;
  }
  const double age = std::clamp(difference - offset_, 0.0, max_age);
  latency_ += latency_weight * (age - latency_);
  return give(stamp + offset_, arrival, problem);
}

// What is wrong with a stamp by itself, given the offset and the frame before.
StampProblem StampPlacer::judge(double stamp, double arrival) const {
  const double age = arrival - stamp - offset_;
  if (!is_first_ && stamp <= last_stamp_) return StampProblem::not_increasing;
  const bool settles = !is_known_ && arrival < settled_ && age > -deepest_settling;
  if (age < -least_jump && !settles) return StampProblem::from_the_future;
  if (age > max_age) return StampProblem::too_old;
  // A clock set back by less than a period: the stamps' interval is off, the arrivals' is not.
  // Where the clock is known it is a link that lost images and held others up.
  if (is_known_) return StampProblem::none;
  const double interval = stamp - last_stamp_;
  const double lost = arrival - last_arrival_ - interval;
  if (!is_first_ && lost > 2.0 * least_jump && !is_regular(interval)) return StampProblem::too_old;
  return StampProblem::none;
}

// Median interval between stamps [s]; 0 if too few are known.
double StampPlacer::period() const {
  const std::size_t count = std::min(interval_count_, intervals_.size());
  if (count < 3) return 0.0;
  std::array<double, 9> sorted = intervals_;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(sorted.begin(), middle, sorted.begin() + static_cast<std::ptrdiff_t>(count));
  return *middle;
}

// Is an interval between stamps a multiple of the camera's period, as if frames were missing?
bool StampPlacer::is_regular(double interval) const {
  const double usual = period();
  if (!(usual > 0.0)) return true;
  const double periods = std::max(std::round(interval / usual), 1.0);
  return std::abs(interval - periods * usual) <= regular * usual;
}

// A stamp that cannot be true. Several that agree with one another are a clock that was reset.
StampProblem StampPlacer::suspect(double difference, double arrival, StampProblem problem) {
  const bool agrees = suspects_ > 0 && std::abs(difference - candidate_) <= agreement;
  candidate_ = agrees ? std::min(candidate_, difference) : difference;
  suspects_ = agrees ? suspects_ + 1 : 1;
  if (suspects_ < needed_suspects) return problem;
  const double usual = latency_;
  is_known_ = false;
  begin(candidate_, arrival);
  latency_ = usual;
  return StampProblem::jumped;
}

void StampPlacer::begin(double difference, double arrival) {
  offset_ = difference;
  latency_ = 0.0;
  settled_ = arrival + settling;
  suspects_ = 0;
  window_.clear();
  window_.push_back({arrival, difference});
}

// The lower envelope of arrival - stamp.
StampProblem StampPlacer::follow(double difference, double arrival) {
  const double since = window_.empty() ? 0.0 : arrival - window_.back().arrival;
  while (!window_.empty() && window_.back().difference >= difference) window_.pop_back();
  window_.push_back({arrival, difference});
  while (window_.front().arrival < arrival - window_time) window_.pop_front();
  const double least = window_.front().difference;
  if (least - offset_ > departure) {
    offset_ = least;
    return StampProblem::drifted;
  }
  const double growth = max_drift * std::max(since, 0.0);
  offset_ = std::min(least, offset_ + growth);
  return StampProblem::none;
}

PlacedStamp StampPlacer::give(double time, double arrival, StampProblem problem) {
  const bool settles = !is_known_ && arrival < settled_;
  PlacedStamp placed{std::min(time, arrival), problem, true};
  if (!(placed.time > last_time_)) {
    placed.usable = false;
    if (problem == StampProblem::none && !settles) placed.problem = StampProblem::not_increasing;
    return placed;
  }
  last_time_ = placed.time;
  return placed;
}

}  // namespace palpate
