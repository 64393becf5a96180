// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/summary.hpp"

#include <algorithm>

#include "palpate/kernel/cloud/audit.hpp"

namespace palpate {

std::optional<double> least_behind(std::span<const std::shared_ptr<const Cloud>> cameras,
                                   const Vec3& proxy, double r_c) {
  std::optional<double> least;
  for (const auto& cloud : cameras) {
    const DepthImage* image = cloud ? cloud->image() : nullptr;
    if (image == nullptr) continue;
    const std::optional<double> behind = distance_behind(*image, proxy, r_c);
    if (behind && (!least || *behind < *least)) least = behind;
  }
  return least;
}

void Summary::count(const ServoTick& record, const std::optional<double>& behind, double r_c) {
  count_tick(record.tick, record.force, behind, r_c);
  energy = record.energy;
  worst_relative = std::max(worst_relative, energy.relative.most);
  worst_absolute = std::max(worst_absolute, energy.absolute.most);
  for (std::size_t i = 0; i < safety_flag_count; ++i) safety_ticks[i] += record.safety >> i & 1U;
}

void Summary::count(const Tick& tick, const std::optional<double>& behind, double r_c) {
  count_tick(tick, tick.force, behind, r_c);
}

void Summary::count_tick(const Tick& tick, const Vec3& sent, const std::optional<double>& behind,
                         double r_c) {
  if (ticks == 0) first_t = tick.t;
  last_t = tick.t;
  ++ticks;
  steps += static_cast<std::size_t>(std::max(tick.steps, 0));
  contact_ticks += tick.state != ContactState::free_motion ? 1 : 0;
  largest_asked = std::max(largest_asked, tick.force.norm());
  largest_sent = std::max(largest_sent, sent.norm());
  sum_sent += sent;
  force_ticks += sent.isZero(0.0) ? 0 : 1;
  for (std::size_t i = 0; i < tick_flag_count; ++i) flag_ticks[i] += tick.flags >> i & 1U;

  if (!behind) return;
  if (*behind < 0.0) {
    was_in_front_ = true;
    behind_since_frame_ = -1;
  } else if (was_in_front_ && *behind > r_c) {
    if (behind_since_frame_ < 0) behind_since_frame_ = tick.frame;
    if (tick.frame > behind_since_frame_ + 1) {
      ++pop_throughs;
      was_in_front_ = false;
    }
  }
}

}  // namespace palpate
