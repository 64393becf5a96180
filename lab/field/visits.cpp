// SPDX-License-Identifier: Apache-2.0
// What comes, goes and moves around a hand: docs/field.md lists the classes.
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "lab/field/field_setting.hpp"
#include "palpate/kernel/core/mathematics.hpp"

namespace palpate::lab::field {
namespace {

Vec3 up(double z) { return {0.0, 0.0, z}; }

double rate_of(Draw& draw) { return draw.by_factor("rate", 5.0, 90.0); }
double latency_of(Draw& draw) { return draw.even("latency", 0.0, 0.12); }

// [m/s] of what comes against the hand, which goes so far while a frame is on its way.
double pushing(Draw& draw) {
  const double most = draw.by_factor("push_in_lag", 0.005, 0.03);  // [m]
  return std::min(draw.by_factor("push", 0.03, 0.4),
                  most / (1.0 / rate_of(draw) + latency_of(draw)));
}

// ---- Hands. ----

// A hand that comes to places, works there and leaves.
struct Hand {
  double depth;  // [m] of the HIP below the surface
  double speed;  // [m/s] the fastest on its way
  double above;  // [m] from where it comes
  Vec3 out;      // [-] the side that it comes from
  Script script;

  [[nodiscard]] double now() const { return script.duration(); }
  Hand& press(const Vec3& on) {
    script.reach(on - depth * out, speed);
    return rest(0.5);
  }
  Hand& lift() {
    script.reach(script.end() + (depth + above) * out, speed);
    return *this;
  }
  Hand& rest(double seconds) {
    script.wait(seconds);
    return *this;
  }
  Hand& until(double t) { return rest(std::max(t - now(), 0.0)); }
};

// Above a place: with a light, a usual or a firm grip.
Hand hand_over(Draw& draw, double start, const Vec3& on = Vec3::Zero(),
               const Vec3& out = Vec3::UnitZ(), double deepest = 1.0) {
  constexpr std::array least = {0.002, 0.004, 0.008};  // [m]: 1.2 to 9 N
  constexpr std::array most = {0.004, 0.008, 0.015};
  const auto grip = static_cast<std::size_t>(draw.whole("grip", least.size()));
  const double depth = least[grip] + (most[grip] - least[grip]) * draw.even("firmness", 0.0, 1.0);
  const double above = draw.even("above", 0.04, 0.09);
  Hand hand{std::min(depth, deepest), draw.by_factor("approach", 0.1, 0.5), above, out,
            Script(on + above * out)};
  hand.rest(start);
  return hand;
}

// It leaves; one hand in four trembles all the time.
void play(Draw& draw, Setting& setting, Hand hand) {
  constexpr double away = 0.10;     // [m]
  constexpr double slowest = 0.25;  // [m/s]
  hand.script
      .reach(hand.script.end() + (hand.depth + away) * hand.out, std::max(hand.speed, slowest))
      .wait(0.4);
  play_script(setting, hand.script);
  if (draw.whole("trembles", 4) != 0) return;
  setting.hip = [script = hand.script, size = draw.by_factor("tremor", 5e-5, 3e-4),
                 beat = 2.0 * pi * draw.even("tremor_rate", 7.0, 12.0)](double t) {
    const double angle = beat * t;
    return Vec3(script.at(t) + size * Vec3(math::sin(angle), math::sin(1.3 * angle + 1.0),
                                           math::sin(0.8 * angle + 2.0)));
  };
}

// ---- Things that move. ----

std::function<Eigen::Isometry3d(double)> along(
    const Script& path, const Eigen::Isometry3d& turn = Eigen::Isometry3d::Identity()) {
  return [=](double t) { return Eigen::Isometry3d(at(path.at(t)) * turn); };
}

struct Thing {
  ShapePtr shape;
  double reach;  // [m] from its middle to its side, along x
};

// A box, a can or a lying bottle, its middle at the origin.
Thing thing_of(Draw& draw, double tall) {
  const double wide = draw.even("wide", 0.03, 0.06);
  const double deep = draw.even("deep", 0.03, 0.06);
  const int kind = draw.whole("thing", 3);
  if (kind == 0) return {box(Vec3(wide, deep, 0.5 * tall)), wide};
  if (kind == 1) return {cylinder(wide, 0.5 * tall), wide};
  return {capsule(deep, 0.5 * tall), deep + 0.5 * tall};
}

// A visitor's arm that puts a thing down and takes it away: they move together or the arm alone.
struct Visitor {
  Script thing, arm;

  Visitor(const Vec3& place, const Vec3& tips) : thing(place), arm(tips) {}
  [[nodiscard]] double now() const { return arm.duration(); }
  void until(double t) {
    arm.wait(std::max(t - now(), 0.0));
    thing.wait(std::max(t - thing.duration(), 0.0));
  }
  void alone(const Vec3& by, double speed) {
    arm.reach(arm.end() + by, speed);
    until(now() + 0.15);
  }
  void carry(const Vec3& by, double speed) {
    thing.reach(thing.end() + by, speed);
    alone(by, speed);
  }
  /// Both come from `away` [m], and the arm goes back there.
  void bring(const Vec3& away, double speed) {
    carry(-away, speed);
    alone(away, speed);
  }
  void fetch(const Vec3& away, double speed) {
    alone(-away, speed);
    carry(away, speed);
  }
  void enter(FieldScene& scene, const ShapePtr& shape, double heading) const {
    constexpr double pitch = 0.8;  // [rad] the elbow is higher than the hand
    const Eigen::Isometry3d turn = turned(heading);
    scene.push_back(moving(shape, along(thing, turn)));
    add_arm(scene, along(arm, turn * turned(pitch, Vec3::UnitY())));
  }
};

double carrying(Draw& draw) { return draw.by_factor("carry", 0.4, 1.2); }

// Where an arm comes from that points along a way.
Vec3 behind(const Vec3& way) { return -0.35 * way + up(0.12); }

// ---- Boxes, sheets and other things. ----

void box_against(Draw& draw, Setting& setting, double start) {
  const double tall = draw.even("tall", 0.02, 0.10);
  const Vec3 half(draw.even("deep", 0.02, 0.06), draw.even("wide", 0.03, 0.08), 0.5 * tall);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const bool floats = draw.whole("floats", 3) == 0;
  Hand hand = hand_over(draw, start);
  hand.press(up(floats ? hand.depth + draw.even("floating", 0.4, 0.8) * tall : 0.0));
  const auto front = [&](double x) {
    return Vec3((x - half.x()) * toward(heading) + up(half.z()));
  };
  Script path(front(-0.2));
  path.wait(hand.now())
      .reach(front(-0.03), 0.4)
      .reach(front(draw.even("beyond", 0.0, 0.03)), pushing(draw))
      .wait(draw.even("there", 1.2, 2.0));
  if (draw.whole("leaves", 2) == 1)
    path.reach(front(-0.2), draw.by_factor("leaving", 0.1, 0.5)).wait(1.2);
  setting.scene = {still(ground()), moving(box(half), along(path, turned(heading)))};
  setting.view = {.azimuth = heading, .azimuth_range = 1.2, .least_tilt = 0.4};  // of its front
  play(draw, setting, hand.until(path.duration()));
}

void sheet_under(Draw& draw, Setting& setting, double start) {
  const double thick = draw.even("thick", 0.001, 0.003);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  Hand hand = hand_over(draw, start, up(0.0), up(1.0), 0.008).press(up(0.0));
  const auto front = [&](double x) { return Vec3(x * toward(heading) + up(0.5 * thick)); };
  Script path(front(-0.12));
  path.wait(hand.now()).reach(front(0.05), pushing(draw)).wait(1.3);
  if (draw.whole("leaves", 2) == 1) path.reach(front(-0.12), 0.3).wait(1.2);
  constexpr double half = 0.08;
  const Eigen::Isometry3d turn = turned(heading);
  setting.scene = {
      still(ground()),
      moving(box(Vec3(half, half, 0.5 * thick)), along(path, turn * at(-half, 0.0, 0.0))),
      moving(capsule(half, 0.5 * thick), along(path, turn * turned(0.5 * pi)))};
  play(draw, setting, hand.until(path.duration()));
}

void box_under(Draw& draw, Setting& setting, double start) {
  const double tall = draw.even("tall", 0.015, 0.08);
  const Vec3 half(draw.even("deep", 0.03, 0.06), draw.even("wide", 0.03, 0.06), 0.5 * tall);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Vec3 away = -0.2 * toward(heading);
  const Vec3 middle = up(-half.z()) + draw.even("off", -0.5, 0.5) * half.x() * toward(heading);
  Hand hand = hand_over(draw, start);
  hand.script.reach(up(draw.even("gap", 0.006, 0.03)), hand.speed);
  Script path(middle + away);
  path.wait(hand.now()).reach(middle, draw.by_factor("slide", 0.1, 0.8));
  hand.until(path.duration() + draw.even("pause", 0.0, 0.5)).press(up(0.0)).rest(1.0);
  if (draw.whole("leaves", 2) == 1) {
    path.wait(hand.now() - path.duration()).reach(middle + away, draw.by_factor("pull", 0.1, 0.8));
    hand.until(path.duration() + 0.8);
  }
  setting.scene = {still(ground(), at(up(-tall))), moving(box(half), along(path, turned(heading)))};
  play(draw, setting, hand);
}

void put_under(Draw& draw, Setting& setting, double start) {
  const double tall = draw.even("tall", 0.03, 0.07);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Thing thing = thing_of(draw, tall);
  const Vec3 away = behind(toward(heading));
  const double speed = carrying(draw);
  Hand hand = hand_over(draw, start, up(0.0), up(1.0), 0.3 * tall);
  const Vec3 middle = up(-0.5 * tall) + away;
  Visitor visitor(middle, middle - thing.reach * toward(heading));
  visitor.until(start);
  visitor.bring(away, speed);
  hand.until(visitor.now() + draw.even("pause", 0.0, 0.4)).press(up(0.0)).rest(1.0).lift();
  visitor.until(hand.now());
  visitor.fetch(away, speed);
  visitor.enter(setting.scene, thing.shape, heading);
  setting.scene.push_back(still(ground(), at(up(-tall))));
  hand.until(visitor.now()).press(up(-tall)).rest(1.0);
  play(draw, setting, hand);
}

void put_beside(Draw& draw, Setting& setting, double start) {
  const double tall = draw.even("tall", 0.02, 0.08);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Thing thing = thing_of(draw, tall);
  const Vec3 away = behind(toward(heading));
  const double speed = carrying(draw);
  Hand hand = hand_over(draw, start).press(up(0.0));
  const Vec3 middle =
      up(0.5 * tall) + away - (draw.even("beside", 0.012, 0.04) + thing.reach) * toward(heading);
  Visitor visitor(middle, middle - thing.reach * toward(heading));
  visitor.until(hand.now());
  visitor.bring(away, speed);
  if (draw.whole("leaves", 2) == 1) visitor.fetch(away, speed);
  visitor.enter(setting.scene, thing.shape, heading);
  setting.scene.push_back(still(ground()));
  // The hand is on the camera's side of the thing.
  setting.view = {.azimuth = heading, .azimuth_range = 1.4};
  play(draw, setting, hand.until(visitor.now() + 1.1));
}

void taken_away(Draw& draw, Setting& setting, double start) {
  const double tall = draw.by_factor("tall", 0.004, 0.04);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Vec3 half(draw.even("wide", 0.03, 0.06), draw.even("deep", 0.03, 0.06), 0.5 * tall);
  const Vec3 away = behind(toward(heading));
  Hand hand = hand_over(draw, start).press(up(0.0));
  Visitor visitor(up(-half.z()), up(0.0) + away - half.x() * toward(heading));
  visitor.until(hand.now());
  visitor.alone(-away, carrying(draw));
  visitor.carry(-0.25 * toward(heading), draw.by_factor("pull", 0.1, 0.8));
  visitor.enter(setting.scene, draw.whole("can", 2) == 1 ? cylinder(half.x(), half.z()) : box(half),
                heading);
  setting.scene.push_back(still(ground(), at(up(-tall))));
  play(draw, setting, hand.until(visitor.now() + 1.2));
}

// ---- Turntables. ----

constexpr double disc_half = 0.01;  // [m]

void turntable_things(Draw& draw, Setting& setting, double start) {
  const double out = draw.even("out", 0.05, 0.09);
  const double angle =
      (draw.whole("back", 2) == 1 ? -1.0 : 1.0) * draw.by_factor("angle", 0.6, 3.0);
  const double seconds = draw.even("turning", 2.0, 3.5);
  Hand hand = hand_over(draw, start).press(up(0.0));
  const Vec3 axis(-out, 0.0, 0.0);
  setting.scene = {still(cylinder(0.16, disc_half), at(axis - up(disc_half))),
                   still(ground(), at(up(-2.0 * disc_half)))};
  Chance chance(draw.seed_of("things"));
  const auto put = [&](ShapePtr shape, double about, const Vec3& place) {
    setting.scene.push_back(moving(
        std::move(shape), turning(axis, angle, hand.now(), seconds, turned(about) * at(place))));
  };
  const int domes = 3 + draw.whole("domes", 3);
  for (int i = 0; i < domes; ++i) {
    const double radius = chance.even(0.03, 0.06);
    const double cap = chance.even(0.002, 0.006);
    const double about = chance.even(0.5, 2.0 * pi - 0.5);  // not where the hand is at first
    put(ball(radius), about, Vec3(out + chance.even(-0.01, 0.01), 0.0, cap - radius));
  }
  for (int i = 0; i < 2; ++i) {
    const double half = chance.even(0.012, 0.02);
    const double tall = chance.even(0.01, 0.03);
    put(i == 0 ? box(Vec3(half, half, tall)) : cylinder(half, tall), chance.even(0.0, 2.0 * pi),
        Vec3(out + 0.05, 0.0, tall));
  }
  play(draw, setting, hand.until(hand.now() + seconds + 1.2));
}

void turntable_wobble(Draw& draw, Setting& setting, double start) {
  const double out = draw.even("out", 0.04, 0.10);
  const double seconds = draw.even("turning", 2.0, 4.0);
  const Eigen::Isometry3d disc = turned(draw.even("about", 0.0, 2.0 * pi)) *
                                 turned(draw.even("askew", 0.03, 0.10), Vec3::UnitY()) *
                                 at(up(-disc_half));
  const Vec3 axis(-out, 0.0, 0.0);
  // Where it is before it turns tells where the hand presses.
  const Place on = below({still(cylinder(0.16, disc_half), at(axis) * disc)}, 0.0, 0.0);
  Hand hand = hand_over(draw, start, on.point).press(on.point);
  setting.scene = {
      still(ground(), at(up(-0.04))),
      moving(cylinder(0.16, disc_half),
             turning(axis, draw.by_factor("angle", 1.0, 6.0), hand.now(), seconds, disc))};
  play(draw, setting, hand.until(hand.now() + seconds + 1.2));
}

// ---- Piles. ----

constexpr double pile_grip = 0.006;  // [m] the deepest

Vec3 any(Chance& chance, double low, double high) {
  Vec3 v;
  for (double& x : v) x = chance.even(low, high);
  return v;
}

// Balls, boxes and rods, higher in the middle.
FieldScene pile_of(Draw& draw) {
  Chance chance(draw.seed_of("pile"));
  FieldScene scene = {still(ground(), at(up(-0.04)))};
  const int count = 12 + draw.whole("pile", 9);
  for (int i = 0; i < count; ++i) {
    Vec3 place = any(chance, -0.07, 0.07);
    const double out = place.head<2>().norm();
    place.z() = chance.even(-0.035, -0.015) - 3.0 * out * out;
    // One by one: compilers differ in the order in which they find a call's arguments.
    const Vec3 axis = any(chance, -1.0, 1.0).normalized();
    const Eigen::Isometry3d pose = at(place) * turned(chance.even(0.0, pi), axis);
    const Vec3 size = any(chance, 0.010, 0.022);
    const double kind = chance.even();
    scene.push_back(still(kind < 0.4   ? ball(size.x())
                          : kind < 0.7 ? box(size)
                                       : capsule(size.x(), 0.6 * size.y()),
                          pose));
  }
  return scene;
}

constexpr double pile_feature = 0.012;  // [m] its thinnest rods

void pile_feel(Draw& draw, Setting& setting, double start) {
  setting.scene = pile_of(draw);
  setting.feature = pile_feature;
  const Vec3 way = toward(draw.even("heading", 0.0, 2.0 * pi));
  const double length = draw.even("stroke", 0.04, 0.10);
  std::vector<Vec3> places;
  constexpr int pieces = 60;
  Hand hand = hand_over(draw, start, up(0.0), up(1.0), pile_grip);
  for (int i = 0; i <= pieces; ++i) {
    const Vec3 over = length * (static_cast<double>(i) / pieces - 0.5) * way;
    places.emplace_back(below(setting.scene, over.x(), over.y()).point - up(hand.depth));
  }
  hand.script = Script(places.front() + up(hand.depth + hand.above)).wait(start);
  hand.press(places.front() + up(hand.depth));
  hand.script.stroke(places, draw.by_factor("stroke_speed", 0.05, 0.25));
  play(draw, setting, hand.rest(1.2));
}

void pile_add(Draw& draw, Setting& setting, double start) {
  setting.scene = pile_of(draw);
  setting.feature = pile_feature;
  const Vec3 on = below(setting.scene, 0.0, 0.0).point;
  const double size = draw.even("size", 0.014, 0.022);
  const Vec3 beside =
      draw.even("beside", 0.032, 0.05) * toward(draw.even("heading", 0.0, 2.0 * pi));
  const Vec3 place = below(setting.scene, beside.x(), beside.y()).point + up(0.6 * size);
  Hand hand = hand_over(draw, start, on, up(1.0), pile_grip).press(on);
  const Vec3 from = 0.1 * beside.normalized() + up(0.12);
  Script path(place + from);
  path.wait(hand.now()).reach(place, draw.by_factor("fall", 0.2, 1.0));
  setting.scene.push_back(
      moving(draw.whole("thing", 2) == 1 ? box(Vec3::Constant(size)) : ball(size), along(path)));
  hand.until(path.duration() + 1.1).lift();
  const Vec3 top = place + up(size);
  hand.script.reach(top + up(hand.above), hand.speed);
  hand.press(top).rest(0.8);
  play(draw, setting, hand);
}

// ---- Doors. ----

// A door or a lid, hinged about its own y: its front has the hand's place at the origin.
struct Door {
  Eigen::Isometry3d base;  // at rest
  double arm;              // [m] from the hinge to the hand
  double thick;            // [m]

  // Open by an angle, away from the hand.
  [[nodiscard]] Eigen::Isometry3d front(double angle) const {
    return base * at(-arm, 0.0, 0.0) * turned(angle, Vec3::UnitY()) * at(arm, 0.0, 0.0);
  }
  // @param angles  [rad] over time, as x
  [[nodiscard]] Body body(const Script& angles) const {
    return moving(box(Vec3(arm, 0.12, 0.5 * thick)), [=, *this](double t) {
      return Eigen::Isometry3d(front(angles.at(t).x()) * at(up(-0.5 * thick)));
    });
  }
};

Door door_of(Draw& draw, Setting& setting) {
  const double facing = draw.even("facing", -pi, pi);
  const double lean = draw.even("lean", 0.4, 1.3);
  setting.view = {facing, 0.6, std::max(lean - 0.3, 0.0)};
  setting.most_tilt = std::min(lean + 0.4, 1.2);
  setting.scene = {still(ground(), at(up(-0.3)))};
  return {turned(facing) * turned(lean, Vec3::UnitY()), draw.even("arm", 0.06, 0.14),
          draw.even("thick", 0.006, 0.03)};
}

void door_ride(Draw& draw, Setting& setting, double start) {
  const Door door = door_of(draw, setting);
  const double turn = pushing(draw) / door.arm;
  Hand hand = hand_over(draw, start, up(0.0), door.base.linear() * up(1.0)).press(up(0.0));
  Script angles(Vec3::Zero());
  angles.wait(hand.now())
      .reach(Vec3(draw.even("open", 0.15, 0.5), 0.0, 0.0), turn)
      .wait(draw.even("there", 0.2, 1.3))
      .reach(Vec3::Zero(), turn)
      .wait(1.2);
  setting.scene.push_back(door.body(angles));
  hand.script.follow(angles.duration() - hand.now(), [=, deep = up(-hand.depth)](double t) {
    return Vec3(door.front(angles.at(t).x()) * deep);
  });
  play(draw, setting, hand);
}

void door_push(Draw& draw, Setting& setting, double start) {
  const Door door = door_of(draw, setting);
  const double turn = pushing(draw) / door.arm;
  Hand hand = hand_over(draw, start, up(0.0), door.base.linear() * up(1.0)).press(up(0.0));
  Script angles(Vec3::Zero());
  angles.wait(hand.now())
      .reach(Vec3(draw.even("open", 0.1, 0.5), 0.0, 0.0), 3.0 * turn)
      .wait(draw.even("there", 0.1, 0.6))
      .reach(Vec3::Zero(), turn)
      .reach(Vec3(-draw.even("beyond", 0.0, 0.02) / door.arm, 0.0, 0.0), turn)
      .wait(1.2)
      .reach(Vec3::Zero(), turn)
      .wait(1.2);
  setting.scene.push_back(door.body(angles));
  play(draw, setting, hand.until(angles.duration()));
}

// ---- Cloths. ----

std::vector<Wave> waves_of(Draw& draw, double begin, double end) {
  Chance chance(draw.seed_of("waves"));
  const int count = 1 + draw.whole("waves", 3);
  std::vector<Wave> waves;
  for (int i = 0; i < count; ++i) {
    Wave wave{};
    wave.length = chance.even(0.06, 0.20);
    wave.height = chance.even(0.015, 0.05) * wave.length / count;
    wave.frequency = chance.even(0.3, 1.2);
    wave.heading = chance.even(0.0, 2.0 * pi);
    wave.phase = chance.even(0.0, 2.0 * pi);
    wave.begin = begin;
    wave.end = end;
    waves.push_back(wave);
  }
  return waves;
}

void cloth_ripples(Draw& draw, Setting& setting, double start) {
  Hand hand = hand_over(draw, start).press(up(0.0)).rest(0.7);
  const double end = hand.now() + draw.even("rippling", 1.5, 3.0);
  setting.scene = {still(cloth(waves_of(draw, hand.now(), end)))};
  play(draw, setting, hand.until(end + swell + 1.2));
}

void cloth_stroke(Draw& draw, Setting& setting, double start) {
  setting.scene = {still(cloth(waves_of(draw, Wave{}.begin, Wave{}.end)))};
  const Vec3 half = draw.even("stroke", 0.02, 0.05) * toward(draw.even("heading", 0.0, 2.0 * pi));
  const double speed = draw.by_factor("stroke_speed", 0.05, 0.3);
  Hand hand = hand_over(draw, start, -half).press(-half);
  hand.script.reach(half - up(hand.depth), speed).reach(-half - up(hand.depth), speed);
  play(draw, setting, hand.rest(1.2));
}

// ---- Visitors. ----

// A hand rests or strokes to and fro until `t` and then rests; then it leaves.
void work_until(Draw& draw, Setting& setting, Hand hand, double t, double rest) {
  const Vec3 side = draw.even("stroke", 0.02, 0.05) * toward(draw.even("way", 0.0, 2.0 * pi));
  const double speed = draw.by_factor("stroke_speed", 0.05, 0.2);
  const bool works = draw.whole("works", 2) == 1;
  while (works && hand.now() < t)
    hand.script.reach(side - up(hand.depth), speed).reach(up(-hand.depth), speed);
  play(draw, setting, hand.until(t).rest(rest));
}

void arm_visits(Draw& draw, Setting& setting, double start) {
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const double speed = carrying(draw);
  const double there = draw.even("there", 0.0, 1.2);
  const double over = draw.even("over", 0.11, 0.15);
  const Vec3 inside = 0.06 * toward(heading);
  const Vec3 outside = -0.40 * toward(heading);
  Hand hand = hand_over(draw, start).press(up(0.0));
  Script arm(outside);
  arm.wait(hand.now() + 0.3);
  const int visits = 1 + draw.whole("again", 2);
  for (int i = 0; i < visits; ++i)
    arm.reach(inside, speed).wait(there).reach(outside, speed).wait(0.4);
  setting.scene = {still(ground())};
  setting.before_camera = [=](FieldScene& scene, const Vec3& eye) {
    const Vec3 between = over / eye.z() * eye;
    add_arm(scene,
            [=](double t) { return Eigen::Isometry3d(at(between + arm.at(t)) * turned(heading)); });
  };
  work_until(draw, setting, hand, arm.duration(), 1.2 + visits * there);
}

void person_passes(Draw& draw, Setting& setting, double start) {
  const double speed = draw.by_factor("walk", 0.5, 1.5);
  const double stop = draw.whole("stops", 2) == 1 ? draw.even("stop", 0.1, 1.0) : 0.0;
  const double share = draw.even("nearer", 0.5, 0.65);  // of the way to the camera
  const double radius = draw.even("body", 0.05, 0.09);
  constexpr double way = 0.5;  // [m] to both sides
  Hand hand = hand_over(draw, start).press(up(0.0));
  Script path(Vec3(-way, 0.0, 0.0));
  path.wait(hand.now() + 0.3)
      .reach(Vec3(draw.even("off", -0.05, 0.05), 0.0, 0.0), speed)
      .wait(stop)
      .reach(Vec3(way, 0.0, 0.0), speed);
  setting.scene = {still(ground())};
  setting.before_camera = [=](FieldScene& scene, const Vec3& eye) {
    // x: the way that the person goes; z: towards the camera; the body stands along y.
    Eigen::Isometry3d view = at(share * eye);
    view.linear().col(2) = eye.normalized();
    view.linear().col(0) = eye.cross(Vec3::UnitX()).normalized();
    view.linear().col(1) = view.linear().col(2).cross(view.linear().col(0));
    scene.push_back(moving(capsule(0.25, radius), [=](double t) {
      return Eigen::Isometry3d(view * at(path.at(t)) * turned(0.5 * pi));
    }));
  };
  work_until(draw, setting, hand, path.duration(), 1.2 + stop);
}

// ---- Corners. ----

// A floor and one or two walls, at 75 to 120 degrees. @return the sum of their normals
Vec3 corner_of(Draw& draw, Setting& setting, int walls) {
  const Eigen::Isometry3d x = turned(0.5 * pi - draw.even("open_x", -0.25, 0.5), Vec3::UnitY());
  const Eigen::Isometry3d y = turned(-0.5 * pi + draw.even("open_y", -0.25, 0.5), Vec3::UnitX());
  setting.scene = {still(ground()), still(ground(), x)};
  Vec3 normals = up(1.0) + x.linear() * up(1.0);
  if (walls == 2) {
    setting.scene.push_back(still(ground(), y));
    normals += y.linear() * up(1.0);
  }
  setting.view = {walls == 2 ? 0.25 * pi : 0.0, walls == 2 ? 0.4 : 0.9, 0.5};
  setting.most_tilt = 0.95;
  return normals;
}

void corner_rest(Draw& draw, Setting& setting, double start) {
  const Vec3 normals = corner_of(draw, setting, 1 + draw.whole("walls", 2));
  Hand hand = hand_over(draw, start, up(0.0), normals.normalized());
  play(draw, setting, hand.press(up(0.0)).rest(2.0));
}

void corner_along(Draw& draw, Setting& setting, double start) {
  const Vec3 normals = corner_of(draw, setting, 2);
  const Vec3 edge(0.0, draw.even("along", 0.03, 0.08), 0.0);
  Hand hand =
      hand_over(draw, start, edge, (normals - 0.8 * Vec3::UnitY()).normalized()).press(edge);
  hand.script.reach(draw.whole("stops", 2) * 0.3 * edge - hand.depth * normals.normalized(),
                    draw.by_factor("slide", 0.03, 0.2));
  play(draw, setting, hand.rest(1.8));
}

constexpr std::array visits = {
    FieldClass{"box-against", "a box pushes a hand aside that presses or waits", box_against, 1.0},
    FieldClass{"sheet-under", "a sheet is pushed in under a resting hand", sheet_under, 0.9},
    FieldClass{"box-under", "a box slides in close under a hand, and away", box_under, 0.9},
    FieldClass{"put-under", "a thing is put down under a hand and taken away", put_under, 0.8},
    FieldClass{"put-beside", "a thing is put down beside a hand and taken away", put_beside, 0.8},
    FieldClass{"taken-away", "the thing is taken away on which a hand rests", taken_away, 0.8},
    FieldClass{"turntable-things", "domes and things pass on a turntable", turntable_things, 0.8},
    FieldClass{"turntable-wobble", "a turntable that is not level", turntable_wobble, 0.8},
    FieldClass{"pile-feel", "a stroke over a pile", pile_feel, 0.7},
    FieldClass{"pile-add", "something falls on a pile", pile_add, 0.7},
    FieldClass{"door-ride", "a hand on a door goes with it", door_ride},
    FieldClass{"door-push", "a door leaves a hand, and pushes it", door_push},
    FieldClass{"cloth-ripples", "a cloth ripples under a hand, and rests", cloth_ripples, 0.9},
    FieldClass{"cloth-stroke", "strokes over a cloth that ripples", cloth_stroke, 0.9},
    FieldClass{"arm-visits", "an arm comes before the camera, stops, leaves", arm_visits, 0.6},
    FieldClass{"person-passes", "a person passes before the camera, or stops", person_passes, 0.6},
    FieldClass{"corner-rest", "a hand rests in a concave corner", corner_rest},
    FieldClass{"corner-along", "a stroke along a concave edge", corner_along}};

// ---- Cameras. ----

// What a camera's values are drawn from, in the units of SensorSetup.
struct Device {
  SensorKind kind;
  double least_focal, most_focal;
  double baseline;
  double quantum;
  double least_noise, most_noise;
  int windows;  // odd windows from 3 px on
  double memory, wiggle, holes, units;
  double nearest, farthest;  // [m] from the hand
};

constexpr std::array devices = {
    // Active stereo with baselines of 50, 95 and 18 mm.
    Device{SensorKind::stereo, 380, 640, 0.050, 0.03125, 0.04, 0.12, 4, 0.9, 0, 0.01, 1e3, 0.4, 1},
    Device{SensorKind::stereo, 420, 640, 0.095, 0.03125, 0.04, 0.1, 4, 0.9, 0, 0.01, 1e3, 0.5, 1.3},
    Device{SensorKind::stereo, 430, 650, 0.018, 0.03125, 0.03, 0.06, 3, 0.8, 0, 0, 1e4, 0.4, 0.45},
    // The first camera for games, and the time of flight cameras that came after it.
    Device{SensorKind::light, 525, 590, 0.075, 0.125, 0.03, 0.07, 3, 0.0, 0, 0.005, 1e3, 0.5, 1.3},
    Device{SensorKind::flight, 360, 370, 0, 0, 0.0012, 0.0025, 1, 0.2, 0.003, 0.002, 1e3, 0.5, 1.3},
    Device{SensorKind::flight, 250, 510, 0, 0, 0.0008, 0.002, 1, 0.2, 0.001, 0, 1e3, 0.4, 1.3},
    // Small chips; and images without noise, coarse and fine.
    Device{SensorKind::coarse, 100, 220, 0, 0, 0.002, 0.006, 1, 0.7, 0, 0.01, 1e3, 0.4, 0.8},
    Device{SensorKind::exact, 200, 900, 0, 0, 0, 0, 1, 0, 0, 0, 1e4, 0.4, 1.2}};

CameraPlan visits_camera(Draw& draw) {
  const Device& device =
      devices[static_cast<std::size_t>(draw.whole("device", static_cast<int>(devices.size())))];
  CameraPlan plan;
  plan.setup.kind = device.kind;
  plan.setup.focal = draw.even("focal", device.least_focal, device.most_focal);
  plan.setup.baseline = device.baseline;
  plan.setup.quantum = device.quantum;
  plan.setup.noise = draw.even("noise", device.least_noise, device.most_noise);
  plan.setup.window = device.windows > 1 ? 3 + 2 * draw.whole("window", device.windows) : 1;
  plan.setup.memory = draw.even("memory", 0.0, device.memory);
  plan.setup.wiggle = draw.even("wiggle", 0.0, device.wiggle);
  plan.setup.holes = device.holes;
  plan.setup.units = device.units;
  plan.setup.seed = draw.seed_of("noise");
  plan.distance = draw.even("distance", device.nearest, device.farthest);
  constexpr double wide = 0.24;     // [m]
  constexpr int most_pixels = 144;  // a coarse image has 9 rays a pixel
  constexpr int most_coarse = 64;
  crop(plan.setup, plan.distance, wide,
       device.kind == SensorKind::coarse ? most_coarse : most_pixels);
  plan.rate = rate_of(draw);
  plan.latency = latency_of(draw);
  plan.dropped = draw.even("dropped", 0.0, 0.15);
  plan.jitter = std::min(draw.even("jitter", 0.0, 0.004), 0.2 / plan.rate);
  return plan;
}

}  // namespace

const CaseSet& visits_set() {
  static constexpr CaseSet set{"visits", 0x766973697473ULL, visits, 4, visits_camera};
  return set;
}

}  // namespace palpate::lab::field
