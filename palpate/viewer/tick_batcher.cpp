// SPDX-License-Identifier: Apache-2.0
#include "palpate/viewer/tick_batcher.hpp"

#include <algorithm>
#include <utility>

namespace palpate {

void TickBatcher::add(const ServoTick& record) {
  const Tick& tick = record.tick;
  batch_.t = tick.t;
  batch_.state = static_cast<std::uint8_t>(tick.state);
  batch_.flags |= tick.flags;
  batch_.safety |= record.safety;
  batch_.steps = static_cast<std::uint32_t>(tick.steps);
  batch_.frame = static_cast<std::int32_t>(tick.frame);
  batch_.hip = tick.hip;
  batch_.proxy = tick.proxy;
  batch_.normal = tick.normal;
  batch_.force = record.force;
  batch_.surface_velocity = tick.surface_velocity;
  any_ = true;

  const bool touching = tick.state != ContactState::free_motion;
  const double penetration = touching ? (tick.hip - tick.proxy).norm() : 0.0;
  sample_.t = tick.t;
  sample_.force = std::max(sample_.force, static_cast<float>(record.force.norm()));
  sample_.penetration = std::max(sample_.penetration, static_cast<float>(penetration));
  sample_.steps = std::max(sample_.steps, static_cast<float>(tick.steps));
  sample_.tick_time =
      std::max(sample_.tick_time, 1e-9F * static_cast<float>(record.previous_compute_ns));
  if (++pending_ < ticks_per_sample_) return;
  batch_.samples.push_back(std::exchange(sample_, {}));
  pending_ = 0;
}

std::optional<TickBatch> TickBatcher::take() {
  if (!std::exchange(any_, false)) return std::nullopt;
  return std::exchange(batch_, {});
}

}  // namespace palpate
