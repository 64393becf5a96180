// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/teleop/led_hand.hpp"

#include <cmath>
#include <utility>

#include "palpate/kernel/core/error.hpp"

namespace palpate {

// Hazard: robot-runaway, robot-collides, link-delay
Lead lead_of(const ServoTick& tick) noexcept {
  constexpr std::uint32_t blind = frame_lost | fault_latched | output_refused;
  constexpr std::uint32_t away = hand_clutched | hand_fault;
  Lead lead{.place = tick.place, .press = -tick.force};
  lead.leads = (tick.hand & hand_present) != 0 && (tick.hand & away) == 0 &&
               (tick.safety & blind) == 0 && is_place(lead.place) && lead.press.allFinite();
  return lead;
}

void validate(const LeadLimits& limits) {
  check_range("teleop", "max_speed", "m/s", 1e-3, 5.0, limits.max_speed);
  check_range("teleop", "contact_speed", "m/s", 1e-3, 5.0, limits.contact_speed);
  check_range("teleop", "near_time", "s", 0.01, 10.0, limits.near_time);
  check_range("teleop", "silence", "s", 0.005, 0.5, limits.silence);
  check_range("teleop", "resume_time", "s", 0.0, 10.0, limits.resume_time);
  if (limits.reach && (limits.reach->isEmpty() || !limits.reach->min().allFinite() ||
                       !limits.reach->max().allFinite()))
    throw Error("teleop, reach", "is no box",
                "give the minimum corner, then the maximum corner, in metres");
}

LedHand::LedHand(const Vec3& begin, const LeadLimits& limits, std::string uri)
    : limits_(limits), tool_(begin), place_(begin) {
  validate(limits);
  if (!is_place(begin))
    throw Error("teleop", "the start position of the tool is not finite or beyond 1000 km",
                "set a position in metres");
  info_.uri = std::move(uri);
  info_.kind = "led from afar";
  info_.limits = no_motors;
}

void LedHand::lead(const Lead& lead, double now) { leads_.put({lead, now}); }

void LedHand::tool_is_at(const Vec3& place) {
  if (is_place(place)) tools_.put(place);
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
  if (const Vec3* tool = tools_.take()) tool_ = *tool;
  const Vec3* const way_out = ways_.take();
  const double kept_for = std::min(t - kept_at_, longest_step);
  if (way_out != nullptr) kept_at_ = t;
  const Heard& heard = leads_.taken_last();

  const bool led = sees_.load(std::memory_order_relaxed) && heard.lead.leads &&
                   is_place(heard.lead.place) && t - heard.time <= limits_.silence;
  const bool was_led = led_.exchange(led, std::memory_order_relaxed);
  if (!led) {
    if (was_led) place_ = tool_;
    led_for_ = 0.0;
    return {.position = place_};
  }
  led_for_ += dt;
  const double share =
      limits_.resume_time > 0.0 ? std::min(led_for_ / limits_.resume_time, 1.0) : 1.0;
  Vec3 wanted = heard.lead.place;
  if (limits_.reach) wanted = wanted.cwiseMax(limits_.reach->min()).cwiseMin(limits_.reach->max());
  const Vec3 way = wanted - place_;
  const double distance = way.norm();
  const double gap = std::max(0.0, gap_.load(std::memory_order_relaxed));  // 0 if it is no number
  const double speed = std::min(limits_.contact_speed + gap / limits_.near_time, limits_.max_speed);
  const double step = share * speed * dt;
  place_ = distance <= step ? wanted : Vec3(place_ + step / distance * way);
  if (way_out != nullptr && kept_for > 0.0)
    place_ += (1.0 - std::exp(-kept_for / keep_time)) * *way_out;
  return {.position = place_};
}

}  // namespace palpate
