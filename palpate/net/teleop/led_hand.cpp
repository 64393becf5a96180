// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/led_hand.hpp"

#include <cmath>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate {

// Hazard: robot-runaway, robot-collides, link-delay
Lead lead_of(const ServoTick& tick) noexcept {
  constexpr std::uint32_t blind = frame_lost | fault_latched | output_refused;
  constexpr std::uint32_t away = hand_clutched | hand_fault;
  const Rotation world_from_device = between(tick.tick.orientation, tick.handle);
  Lead lead{.place = tick.place,
            .press = -tick.force,
            .turn = between(tick.tick.proxy_orientation, world_from_device)};
  lead.leads = (tick.hand & hand_present) != 0 && (tick.hand & away) == 0 &&
               (tick.safety & blind) == 0 && is_place(lead.place) && lead.press.allFinite() &&
               is_rotation(lead.turn);
  return lead;
}

void validate(const LeadLimits& limits) {
  check_range("teleop", "max_speed", "m/s", 1e-3, 5.0, limits.max_speed);
  check_range("teleop", "contact_speed", "m/s", 1e-3, 5.0, limits.contact_speed);
  check_range("teleop", "near_time", "s", 0.01, 10.0, limits.near_time);
  check_range("teleop", "silence", "s", 0.005, 0.5, limits.silence);
  check_range("teleop", "lever", "m", 0.01, 5.0, limits.lever);
  check_range("teleop", "resume_time", "s", 0.0, 10.0, limits.resume_time);
  if (limits.reach && (limits.reach->isEmpty() || !limits.reach->min().allFinite() ||
                       !limits.reach->max().allFinite()))
    throw Error("teleop, reach", "is no box",
                "give the minimum corner, then the maximum corner, in metres");
}

LedHand::LedHand(const Vec3& begin, const LeadLimits& limits, const Rotation& found,
                 std::string uri)
    : limits_(limits), found_(found), tool_{begin, found}, pose_(tool_) {
  validate(limits);
  if (!is_place(begin) || !is_rotation(found))
    throw Error("teleop", "the start pose of the tool is not finite or beyond 1000 km",
                "set a position in metres, and a unit quaternion");
  info_.uri = std::move(uri);
  info_.kind = "led from afar";
  info_.limits = no_motors;
}

void LedHand::lead(const Lead& lead, double now) { leads_.put({lead, now}); }

void LedHand::tool_is_at(const Vec3& place, const Rotation& turn) {
  if (is_place(place) && is_rotation(turn)) tools_.put({place, unit(turn)});
}

void LedHand::kept_out(const Vec3& way) {
  if (is_place(way)) ways_.put(way);
}

// Hazard: robot-runaway
HandState LedHand::read(double t) noexcept {
  constexpr double longest_step = 0.005;  // [s] after a stall
  constexpr double keep_time = 0.01;      // [s] in which it goes where regions keep it
  const double since = began_ ? t - last_t_ : 0.0;
  const double dt = since > 0.0 ? std::min(since, longest_step) : 0.0;
  began_ = true;
  last_t_ = t;
  leads_.take();
  if (const HandPose* tool = tools_.take()) tool_ = *tool;
  const Vec3* const way_out = ways_.take();
  const double kept_for = std::min(t - kept_at_, longest_step);
  if (way_out != nullptr) kept_at_ = t;
  const Heard& heard = leads_.taken_last();

  const bool led = sees_.load(std::memory_order_relaxed) && heard.lead.leads &&
                   is_place(heard.lead.place) && is_rotation(heard.lead.turn) &&
                   t - heard.time <= limits_.silence;
  const bool was_led = led_.exchange(led, std::memory_order_relaxed);
  const auto state = [this] {
    return HandState{.position = pose_.position,
                     .orientation = Eigen::Quaterniond(pose_.orientation)};
  };
  if (!led) {
    if (was_led) pose_.position = tool_.position;
    if (was_led && limits_.turns) pose_.orientation = tool_.orientation;
    led_for_ = 0.0;
    return state();
  }
  led_for_ += dt;
  const double share =
      limits_.resume_time > 0.0 ? std::min(led_for_ / limits_.resume_time, 1.0) : 1.0;
  Vec3 wanted = heard.lead.place;
  if (limits_.reach) wanted = wanted.cwiseMax(limits_.reach->min()).cwiseMin(limits_.reach->max());
  const Vec3 way = wanted - pose_.position;
  const Rotation turned =
      limits_.turns ? product(unit(heard.lead.turn), found_) : pose_.orientation;
  const Vec3 turn = rotation_vector(between(turned, pose_.orientation));
  // Both arrive at once, and the tool's farthest point keeps to the speed.
  const double distance = way.norm() + limits_.lever * turn.norm();
  const double gap = std::max(0.0, gap_.load(std::memory_order_relaxed));  // 0 if it is no number
  const double speed = std::min(limits_.contact_speed + gap / limits_.near_time, limits_.max_speed);
  const double step = share * speed * dt;
  if (distance <= step) {
    pose_ = {wanted, turned};
  } else {
    pose_.position += step / distance * way;
    pose_.orientation = unit(product(rotation_by(step / distance * turn), pose_.orientation));
  }
  if (way_out != nullptr && kept_for > 0.0)
    pose_.position += (1.0 - std::exp(-kept_for / keep_time)) * *way_out;
  return state();
}

}  // namespace palpate
