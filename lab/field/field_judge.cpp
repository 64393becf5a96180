// SPDX-License-Identifier: Apache-2.0
#include "lab/field/field_judge.hpp"

#include <algorithm>
#include <array>
#include <memory>

#include "lab/method.hpp"

namespace palpate::lab::field {
namespace {

constexpr double tick_rate = 1000.0;   // [Hz]
constexpr double patience = 0.5;       // [s] that being behind, numb or out of sight may last
constexpr double quick = 0.2;          // [s] within which a proxy should be back in front
constexpr double free_space = 0.020;   // [m] from every body, and what the sensor blurs
constexpr double felt = 0.02;          // [N] a force that counts in free space
constexpr double firm = 1.0;           // [N] both rulers' force from which a hand must feel some
constexpr double least_share = 0.25;   // [-] of it
constexpr double has_side = 0.5;       // [N] a ruler's force that has a side
constexpr double opposite = -0.5;      // [-] cosine
constexpr double jump = 0.015;         // [m] that may lie between what is and the visible surface
constexpr double settling = 0.5;       // [s] that hand and surface rest before shake counts,
constexpr double long_rest = 0.5;      // [s] and that they rest on for it to count
constexpr double moves = 1e-7;         // [m] in a tick: what moves by less rests
constexpr double just_before = 0.002;  // [m] from the sphere: what is met there is what it touches

bool inside(const Snapshot& scene, const Vec3& place) { return scene.distance(place) < 0.0; }

// Through a thin body there is no inside: on its far side a proxy is hidden from the camera, and
// the straight way from the ruler's proxy leads through the body.
bool is_behind(const Vec3& proxy, const Ruling& ruling, const Snapshot& now, const Snapshot& shown,
               const Sensor& sensor, double r_c) {
  if (inside(shown, ruling.seen.proxy)) return false;
  if (inside(now, proxy) && inside(shown, proxy)) return true;
  return (proxy - ruling.seen.proxy).norm() > 2.0 * r_c &&
         shown.between(sensor.eye(), proxy, just_before) &&
         !shown.between(sensor.eye(), ruling.seen.proxy, r_c + just_before) &&
         shown.between(ruling.seen.proxy, proxy, 0.0) && now.between(ruling.now.proxy, proxy, 0.0);
}

class Judge {
 public:
  // @param interval  [s] from one frame to the next
  explicit Judge(double interval) : interval_(interval) {}

  // @param behind  the proxy is inside or behind a body, and the rulers' are not
  void add(const Tick& tick, const Ruling& ruling, bool behind) {
    const double force = tick.force.norm();
    const double now = ruling.now.force.norm();
    const double seen = ruling.seen.force.norm();
    const auto lasted = [](int& ticks, bool goes_on) {
      ticks = goes_on ? ticks + 1 : 0;
      return ticks / tick_rate;
    };
    const double behind_for = lasted(behind_for_, behind && ruling.known);
    verdict_.behind = std::max(verdict_.behind, behind_for);
    verdict_.lost = verdict_.lost || behind_for > patience;

    const double tick_time = 1.0 / tick_rate;
    const bool alarm = (tick.flags & pop_through_suspected) != 0;
    verdict_.time += tick_time;
    if (behind_for > 0.0) {
      verdict_.time_behind += tick_time;
      verdict_.alarmed += alarm ? tick_time : 0.0;
      verdict_.times_behind += back_for_ == 0.0 ? 1 : 0;
    } else {
      verdict_.false_alarm += alarm && !behind ? tick_time : 0.0;
      verdict_.quick_returns += back_for_ > 0.0 && back_for_ <= quick ? 1 : 0;
    }
    back_for_ = behind_for;

    const bool nothing = std::min(now, seen) > firm && force < least_share * std::min(now, seen);
    verdict_.numb = lasted(numb_for_, nothing && ruling.known) > patience || verdict_.numb;

    const auto against = [&](const Tick& ruler, double its) {
      return tick.force.dot(ruler.force) < opposite * force * its;
    };
    const bool wrong = force > firm * least_share && std::min(now, seen) > has_side &&
                       against(ruling.now, now) && against(ruling.seen, seen);
    verdict_.wrong_side =
        lasted(wrong_for_, wrong && ruling.known) > 0.05 + 1.5 * interval_ || verdict_.wrong_side;

    if (ruling.free_in_sight && force > felt)
      verdict_.worst_ghost = std::max(verdict_.worst_ghost, force);

    const bool touching = now > 0.0 && seen > 0.0;
    const double rested =
        lasted(resting_for_, touching && ruling.rests && ruling.known && !behind) - settling;
    if (rested > 0.0) {
      rested_in_.extend(tick.proxy);
      if (rested > long_rest)
        verdict_.shake = std::max(verdict_.shake, rested_in_.diagonal().norm());
    } else {
      rested_in_.setEmpty();
    }
    if (touching && touched_)
      verdict_.worst_step = std::max(verdict_.worst_step, (tick.force - last_force_).norm());
    touched_ = touching;
    last_force_ = tick.force;
  }

  [[nodiscard]] const Verdict& verdict() const { return verdict_; }

 private:
  double interval_;
  Verdict verdict_;
  int behind_for_ = 0;  // ticks in a row, as the others
  int numb_for_ = 0;
  int wrong_for_ = 0;
  double back_for_ = 0.0;  // [s] that being behind has lasted
  int resting_for_ = 0;
  Eigen::AlignedBox3d rested_in_;
  bool touched_ = false;
  Vec3 last_force_ = Vec3::Zero();
};

}  // namespace

Outcome play_field(Stage& stage, const std::vector<Method*>& methods, const Parameters& parameters,
                   const std::function<void(const Tick&, const Ruling&, bool)>& tick) {
  Outcome outcome;
  Sensor& sensor = *stage.sensor;
  const double r_c = parameters.proxy.r_c();
  const double depth = sensor.depth_of(Vec3::Zero());
  if (stage.feature < 2.0 * sensor.pitch(depth)) {
    outcome.unknown = "thin";
    return outcome;
  }
  const double blur = 2.0 * sensor.pitch(depth) + 4.0 * sensor.deviation(depth);

  Snapshot now(stage.scene, 0.0);
  Snapshot shown(stage.scene, stage.shots.front().captured);
  const bool still = std::all_of(stage.scene.begin(), stage.scene.end(),
                                 [](const Body& body) { return body.still(); });
  const auto ruler_now =
      make_method("ideal", {parameters, [&now](const Vec3& p, double) { return now.nearest(p); }});
  const auto ruler_seen = make_method(
      "ideal", {parameters, [&shown](const Vec3& p, double) { return shown.nearest(p); }});
  const Vec3 seat = stage.hip(0.0);
  ruler_now->seat(seat);
  ruler_seen->seat(seat);
  for (Method* method : methods) method->seat(seat);

  std::vector<Judge> judges(methods.size(), Judge(stage.interval));
  std::shared_ptr<const DepthImage> in_use;
  std::size_t next = 0;
  double last_known = 0.0;
  Vec3 ruler_proxy = seat;
  std::array<Vec3, 3> before{seat, seat, seat};
  bool contact = false;
  int touching = 0;
  int in_sight = 0;
  int apart = 0;
  const auto ticks = static_cast<int>(stage.duration * tick_rate);
  for (int i = 0; i <= ticks; ++i) {
    const double t = i / tick_rate;
    for (; next < stage.shots.size() && stage.shots[next].arrives <= t + 1e-9; ++next) {
      const Shot& shot = stage.shots[next];
      std::shared_ptr<const DepthImage> frame = sensor.capture(stage.scene, shot.captured);
      for (Method* method : methods) method->observe({*frame, shot.stamp});
      in_use = std::move(frame);  // only now may the frame before go
      if (!still) shown = Snapshot(stage.scene, shot.captured);
      if (contact && shown.distance(ruler_proxy) < r_c - jump) outcome.unknown = "fast";
    }
    if (!still) now = Snapshot(stage.scene, t);
    const Vec3 hip = stage.hip(t);
    Ruling ruling;
    ruling.now = ruler_now->tick(hip, t);
    ruling.seen = ruler_seen->tick(hip, t);
    const std::array places{hip, ruling.now.proxy, ruling.seen.proxy};
    ruling.rests = std::equal(places.begin(), places.end(), before.begin(),
                              [](const Vec3& a, const Vec3& b) { return (a - b).norm() < moves; });
    before = places;
    ruler_proxy = ruling.seen.proxy;
    contact = ruling.seen.force.norm() > 0.0;
    const bool sees = sensor.sees(shown, ruler_proxy, r_c + just_before);
    const bool agree = (ruling.now.proxy - ruling.seen.proxy).norm() <= jump;
    touching += contact ? 1 : 0;
    in_sight += contact && sees ? 1 : 0;
    apart += contact && !agree ? 1 : 0;
    if (!contact || (sees && agree)) last_known = t;
    ruling.known = t - last_known <= patience;
    ruling.free_in_sight = !contact && ruling.now.force.norm() == 0.0 &&
                           std::min(now.distance(hip), shown.distance(hip)) > free_space + blur &&
                           sensor.sees(shown, hip, 0.0);
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const Tick its = methods[m]->tick(hip, t);
      const bool behind = is_behind(its.proxy, ruling, now, shown, sensor, r_c);
      judges[m].add(its, ruling, behind);
      if (m == 0 && tick) tick(its, ruling, behind);
    }
  }
  if (2 * apart > touching) outcome.unknown = "fast";
  if (outcome.unknown.empty() && 2 * in_sight < touching) outcome.unknown = "hidden";
  for (const Judge& judge : judges) outcome.verdicts.push_back(judge.verdict());
  return outcome;
}

}  // namespace palpate::lab::field
