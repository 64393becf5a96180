// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/robot_step.hpp"

#include <algorithm>

namespace palpate {

Outlook outlook(std::span<ApproachWatch> watches, const Vec3& proxy, const Vec3& tool,
                double radius, double now) noexcept {
  Outlook all;
  all.is_lost = !watches.empty();
  double noise = 0.0;
  for (ApproachWatch& watch : watches) {
    if (watch.newest().speed > all.comes.speed) all.comes = watch.newest();
    noise = std::max(noise, watch.newest().noise);
    all.clearance = std::min(all.clearance, watch.clearance());
    all.is_lost = all.is_lost && watch.is_between(proxy, tool, radius, now);
  }
  all.comes.noise = noise;
  return all;
}

SetPoint::Order RobotStep::next(ServoTick& tick, const Outlook& outlook, const Vec3& press,
                                RobotState& at, double now) noexcept {
  if (outlook.is_lost) tick = with_proxy_at(at.position, tick);
  const bool in_the_open = tick.tick.state == ContactState::free_motion;
  hand_.sees(tick.frame_age <= blind_after && !outlook.is_lost);
  const double clear = outlook.clearance - radius_;
  const double ahead = (tick.place - at.position).norm();
  hand_.clearance(in_the_open ? clear - ahead : 0.0);
  at.force =
      force_zero_.next(now, at.force, in_the_open && !outlook.is_lost && clear > ForceZero::clear);
  hand_.kept_out(tick.place - tick.tick.proxy);
  led_ = hand_.is_led() && !outlook.is_lost;
  return set_point_.next(tick, press, led_, outlook.comes, at.force);
}

}  // namespace palpate
