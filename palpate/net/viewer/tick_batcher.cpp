// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/viewer/tick_batcher.hpp"

#include <algorithm>
#include <utility>

namespace palpate {
namespace {

// [m] How far the HIP is below the surface, which is one contact radius below the proxy.
double penetration_of(const Tick& tick, double contact_radius) {
  if (tick.state == ContactState::free_motion) return 0.0;
  const Vec3 out = tick.proxy - tick.hip;
  const double below = tick.normal.isZero() ? out.norm() : out.dot(tick.normal);
  return std::max(0.0, below - contact_radius);
}

}  // namespace

void TickBatcher::add(const ServoTick& record, double contact_radius) {
  const Tick& tick = record.tick;
  batch_.tick = record;
  batch_.flags |= tick.flags;
  batch_.safety |= record.safety;
  any_ = true;

  const double penetration = penetration_of(tick, contact_radius);
  sample_.t = tick.t;
  sample_.force = std::max(sample_.force, static_cast<float>(record.force.norm()));
  sample_.penetration = std::max(sample_.penetration, static_cast<float>(penetration));
  sample_.steps = std::max(sample_.steps, static_cast<float>(tick.steps));
  sample_.tick_time =
      std::max(sample_.tick_time, 1e-9F * static_cast<float>(record.previous_compute_ns));
  sample_.relative = static_cast<float>(record.energy.relative.excess);
  sample_.absolute = static_cast<float>(record.energy.absolute.excess);
  if (++pending_ < ticks_per_sample_) return;
  batch_.samples.push_back(std::exchange(sample_, {}));
  pending_ = 0;
}

std::optional<TickBatch> TickBatcher::take() {
  if (!std::exchange(any_, false)) return std::nullopt;
  return std::exchange(batch_, {});
}

}  // namespace palpate
