// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/clock_relation.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
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
