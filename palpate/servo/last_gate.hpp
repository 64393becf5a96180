// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/servo/device.hpp"
#include "palpate/servo/last_gate.h"

namespace palpate {

inline palpate_gate_vector gate_vector(const Vec3& v) noexcept { return {v.x(), v.y(), v.z()}; }
inline Vec3 vector_of(const palpate_gate_vector& v) noexcept { return {v.x, v.y, v.z}; }

/// The last step before a device, and the only one that writes to it (scripts/checks/check.py).
///
/// It sends what was asked for, bit for bit, as long as that keeps the bounds of last_gate.h, and
/// else less of it. Independent of the safety chain, which it takes for anything but right. One
/// thread. [servo] No allocation, lock, system call or exception.
class LastGate {
 public:
  struct Sent {
    Wrench wrench;  ///< device frame: what the device got
    Vec3 force;     ///< [N] device: of it, without what supports the handle's weight
    int verdict;    ///< palpate_gate_cut, palpate_gate_shut, palpate_gate_refused
  };

  /// @param t  [s] as for Device::write
  Sent write(Device& device, const palpate_gate_wish& wish, double t) noexcept {
    const int verdict = palpate_gate_step(&gate_, &wish);
    palpate_gate_wish passed = wish;
    passed.force = gate_.force.last;
    passed.torque = gate_.torque.last;
    passed.held = gate_.held;
    device.announce(passed);
    Sent sent{{vector_of(gate_.sum), vector_of(passed.torque)}, vector_of(passed.force), verdict};
    device.write(sent.wrench, t);
    return sent;
  }
  /// Writes once more what it wrote last.
  void write_again(Device& device, double t) const noexcept {
    device.write(Wrench{vector_of(gate_.sum), vector_of(gate_.torque.last)}, t);
  }
  /// Writes a zero force and starts again: whatever follows has to pass the ramp.
  void release(Device& device, double t) noexcept {
    gate_ = {};
    write_zero(device, t);
  }
  /// The same of a device that nobody writes to afterwards.
  static void write_zero(Device& device, double t) noexcept { device.write(Vec3::Zero(), t); }

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    auto& gate = self.gate_;
    for (auto* channel : {&gate.force, &gate.torque}) {
      way("gate.last_x", channel->last.x);
      way("gate.last_y", channel->last.y);
      way("gate.last_z", channel->last.z);
      way("gate.size", channel->size);
      way("gate.ring", channel->ring);
      way("gate.rest", channel->rest);
      way("gate.ceiling", channel->ceiling);
    }
    way("gate.t", gate.t);
    way("gate.share", gate.share);
    way("gate.held_share", gate.held_share);
    way("gate.started", gate.started);
  }

 private:
  palpate_gate gate_{};
};

}  // namespace palpate
