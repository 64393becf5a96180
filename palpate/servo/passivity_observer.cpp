// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/passivity_observer.hpp"

#include <cmath>

#include "palpate/kernel/core/tick.hpp"

namespace palpate {
namespace {

void give(PortEnergy& port, double work) noexcept {
  port.excess += work;
  if (port.excess <= port.most) return;
  const bool before = port.generates();
  port.made += port.excess - port.most;
  port.most = port.excess;
  if (port.generates() && !before) ++port.generating;
}

void begin_contact(PortEnergy& port) noexcept { port.excess = port.most = 0.0; }

}  // namespace

const ServoEnergy& PassivityObserver::run(const Input& input) noexcept {
  const bool sound = std::isfinite(input.t) && is_place(input.handle) && is_place(input.hip) &&
                     is_place(input.surface) && is_place(input.sent) && is_place(input.torque) &&
                     is_place(input.turned);
  if (!sound) {
    started_ = false;
    return energy_;
  }
  const double dt = input.t - t_;
  const auto acts = [](const Vec3& force, const Vec3& torque) {
    return !force.isZero(0.0) || !torque.isZero(0.0);
  };
  if (started_ && dt > 0.0 && dt <= longest_gap && acts(sent_, torque_)) {
    const Vec3 moved = input.handle - handle_;
    const Vec3 relative =
        input.jumped ? moved : Vec3((input.hip - hip_ - dt * input.surface) / input.scale);
    const double turning = torque_.dot(input.turned);
    give(energy_.absolute, sent_.dot(moved) + turning);
    give(energy_.relative, sent_.dot(relative) + turning);
  }
  if (acts(input.sent, input.torque)) {
    if (!touching_) {
      touching_ = true;
      ++energy_.contacts;
      begin_contact(energy_.relative);
      begin_contact(energy_.absolute);
    }
    pushed_at_ = input.t;
  } else if (!(std::abs(input.t - pushed_at_) <= apart)) {
    touching_ = false;
  }
  started_ = true;
  t_ = input.t;
  handle_ = input.handle;
  hip_ = input.hip;
  sent_ = input.sent;
  torque_ = input.torque;
  return energy_;
}

}  // namespace palpate
