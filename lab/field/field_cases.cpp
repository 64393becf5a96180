// SPDX-License-Identifier: Apache-2.0
#include "lab/field/field_cases.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "lab/field/field_setting.hpp"
#include "palpate/kernel/core/mathematics.hpp"

namespace palpate::lab::field {
namespace {

double cotangent(double x) { return math::cos(x) / math::sin(x); }

constexpr double edge_feature = 0.010;  // [m] the sphere on an edge: two r_c

// ---- Hands. ----

// Along the surface, from `begin` [m] past the origin on: `depth` under it along its own normals.
std::vector<Vec3> under_surface(const FieldScene& scene, double heading, double begin,
                                double length, double depth) {
  std::vector<Vec3> places;
  constexpr int pieces = 60;
  for (int i = 0; i <= pieces; ++i) {
    const double way = length * i / pieces;
    const Place place = below(scene, begin * math::cos(heading) + way * math::cos(heading),
                              begin * math::sin(heading) + way * math::sin(heading));
    places.emplace_back(place.point - depth * place.normal);
  }
  return places;
}

// How a hand presses, by the values of a case.
struct Pressing {
  Vec3 out;       // [-] the way that it comes from
  double depth;   // [m] below the surface
  double speed;   // [m/s] the fastest on the way down and up
  double hold;    // [s]
  double hover;   // [m] above the surface before
  double height;  // [m] and after
};

Pressing pressing(Draw& draw, const Vec3& normal) {
  const double lean = draw.even("lean", 0.0, 0.4);
  const double heading = draw.even("lean_heading", 0.0, 2.0 * pi);
  const Vec3 side =
      (std::abs(normal.z()) < 0.9 ? normal.cross(Vec3::UnitZ()) : normal.cross(Vec3::UnitX()))
          .normalized();
  const Vec3 axis = Eigen::AngleAxisd(heading, normal) * side;
  return {Eigen::AngleAxisd(lean, axis) * normal, draw.even("press", 0.004, 0.014),
          draw.by_factor("speed", 0.2, 0.6),      draw.even("hold", 0.9, 1.5),
          draw.even("hover", 0.06, 0.09),         draw.even("height", 0.10, 0.14)};
}

// The same for a hand that comes straight down and then rests while something happens.
constexpr double before_it = 0.4;  // [s] of contact
constexpr double after_it = 1.0;
Pressing resting(Draw& draw, double seconds) {
  Pressing p = pressing(draw, Vec3::UnitZ());
  p.out = Vec3::UnitZ();
  p.hold = before_it + seconds + after_it;
  return p;
}
// [s] from when it begins to come down until that happens.
double settled(const Pressing& p) { return seconds_for(p.hover + p.depth, p.speed) + before_it; }

// Down on a place, pressed for a while, and away again.
Script press_and_lift(const Place& place, const Pressing& p, double start) {
  Script script(place.point + p.hover * p.out);
  script.wait(start)
      .reach(place.point - p.depth * p.out, p.speed)
      .wait(p.hold)
      .reach(place.point + p.height * p.out, p.speed)
      .wait(0.5);
  return script;
}

// Down, along the places, and away again.
// @param from, to  [m] off the first and the last place, before and after
Script stroke_and_lift(const std::vector<Vec3>& places, const Vec3& from, const Vec3& to,
                       const Pressing& p, double start, double speed) {
  Script script(places.front() + from);
  script.wait(start)
      .reach(places.front(), p.speed)
      .wait(0.3)
      .stroke(places, speed)
      .wait(p.hold)
      .reach(places.back() + to, p.speed)
      .wait(0.5);
  return script;
}
Script stroke_and_lift(const std::vector<Vec3>& places, const Vec3& out, const Pressing& p,
                       double start, double speed) {
  return stroke_and_lift(places, (p.depth + p.hover) * out, (p.depth + p.height) * out, p, start,
                         speed);
}

// ---- Things that come. ----

// From one place to another with the least jerk, between two times.
std::function<Eigen::Isometry3d(double)> from_to(
    const Vec3& from, const Vec3& to, double begin, double seconds,
    const Eigen::Isometry3d& turn = Eigen::Isometry3d::Identity()) {
  return [=](double t) {
    return Eigen::Isometry3d(at(from + ease((t - begin) / seconds) * (to - from)) * turn);
  };
}

// In from outside, there for a while, and out again unless it stays.
std::function<Eigen::Isometry3d(double)> arm_motion(const Vec3& fingertips, double heading,
                                                    double begin, double seconds, double there,
                                                    bool stays) {
  constexpr double away = 0.40;  // [m]
  return [=](double t) {
    const double in = ease((t - begin) / seconds);
    const double out = stays ? 0.0 : ease((t - begin - seconds - there) / seconds);
    return Eigen::Isometry3d(at(fingertips - (1.0 - in + out) * away * toward(heading)) *
                             turned(heading));
  };
}

// ---- Geometries. ----

FieldScene plane_scene(Draw& /*draw*/) { return {still(ground())}; }

FieldScene bowl_scene(Draw& draw) {
  const double inner = draw.even("bowl", 0.035, 0.08);
  const double wall = draw.even("wall", 0.004, 0.006);
  return {still(bowl(inner, wall, draw.even("rim", -0.3, 0.3) * inner)),
          still(ground(), at(0.0, 0.0, -inner - wall))};
}

FieldScene torus_scene(Draw& draw) {
  const double tube = draw.even("tube", 0.014, 0.025);
  return {still(torus(draw.even("ring", 0.04, 0.06), tube), at(0.0, 0.0, -tube)),
          still(ground(), at(0.0, 0.0, -2.0 * tube))};
}

FieldScene terrain_scene(Draw& draw) {
  Chance chance(draw.seed_of("terrain"));
  std::vector<Bump> bumps;
  const int count = 8 + draw.whole("bumps", 9);
  for (int i = 0; i < count; ++i) {
    const double x = chance.even(-0.15, 0.15);
    const double y = chance.even(-0.15, 0.15);
    const double width = chance.even(0.02, 0.045);
    bumps.push_back({x, y, chance.even(-0.35, 0.6) * width, width});
  }
  return {still(terrain(std::move(bumps)))};
}

// One of several.
FieldScene any_scene(Draw& draw, const std::vector<FieldScene (*)(Draw&)>& scenes) {
  const int kind = draw.whole("geometry", static_cast<int>(scenes.size()));
  return scenes[static_cast<std::size_t>(kind)](draw);
}

// ---- The classes. ----

void plane_press(Draw& draw, Setting& setting, double start) {
  setting.scene = plane_scene(draw);
  const Place place = below(setting.scene, 0.0, 0.0);
  play_script(setting, press_and_lift(place, pressing(draw, place.normal), start));
}

template <FieldScene (*scene)(Draw&)>
void slide(Draw& draw, Setting& setting, double start) {
  setting.scene = scene(draw);
  const Pressing p = pressing(draw, Vec3::UnitZ());
  constexpr double longest = 0.12;  // [m]
  const double length = draw.even("slide", 0.4 * longest, longest);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  play_script(setting,
              stroke_and_lift(under_surface(setting.scene, heading, -0.5 * length, length, p.depth),
                              p.out, p, start, draw.by_factor("slide_speed", 0.08, 0.5)));
}

void plane_tap(Draw& draw, Setting& setting, double start) {
  setting.scene = plane_scene(draw);
  const Place place = below(setting.scene, 0.0, 0.0);
  const Pressing p = pressing(draw, place.normal);
  const double speed = draw.even("tap_speed", 0.2, 0.5);
  const double dwell = draw.even("dwell", 0.02, 0.1);
  Script script(place.point + p.hover * p.out);
  script.wait(start);
  const int taps = 2 + draw.whole("taps", 3);
  for (int i = 0; i < taps; ++i)
    script.reach(place.point - p.depth * p.out, speed)
        .wait(dwell)
        .reach(place.point + 0.03 * p.out, speed)
        .wait(dwell);
  script.reach(place.point - p.depth * p.out, speed)
      .wait(p.hold)
      .reach(place.point + p.height * p.out, p.speed)
      .wait(0.5);
  play_script(setting, script);
}

void bowl_press(Draw& draw, Setting& setting, double start) {
  setting.scene = bowl_scene(draw);
  const double off = draw.even("off", 0.0, 0.5) * draw.even("bowl", 0.035, 0.08);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Place place =
      below(setting.scene, off * math::cos(heading), off * math::sin(heading), 0.0, 0.02);
  Pressing p = pressing(draw, place.normal);
  p.out = Vec3::UnitZ();  // straight in and out: the rim is all round
  play_script(setting, press_and_lift(place, p, start));
}

void bowl_slide(Draw& draw, Setting& setting, double start) {
  setting.scene = bowl_scene(draw);
  Pressing p = pressing(draw, Vec3::UnitZ());
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const double far = 0.7 * draw.even("bowl", 0.035, 0.08);
  const std::vector<Vec3> places =
      under_surface(setting.scene, heading, -0.4 * far, 1.4 * far, std::min(p.depth, 0.008));
  play_script(setting, stroke_and_lift(places, Vec3::UnitZ(), p, start,
                                       draw.by_factor("slide_speed", 0.05, 0.2)));
}

void corner_slide(Draw& draw, Setting& setting, double start) {
  const double open_x = draw.even("open_x", 0.0, 0.25);
  const double open_y = draw.even("open_y", 0.0, 0.25);
  setting.scene = {still(ground()), still(ground(), turned(0.5 * pi - open_x, Vec3::UnitY())),
                   still(ground(), turned(-0.5 * pi + open_y, Vec3::UnitX()))};
  setting.view = {.azimuth = 0.25 * pi, .azimuth_range = 0.5, .least_tilt = 0.3};
  const Pressing p = pressing(draw, Vec3::UnitZ());
  const double from_x = draw.even("from_x", 0.03, 0.07);
  const double from_y = draw.even("from_y", 0.03, 0.07);
  const double into = std::min(p.depth, 0.008);
  const int wall = draw.whole("wall", 3);  // one, the other, or the corner
  const Vec3 from(from_x, from_y, -into);
  const Vec3 to(wall == 1 ? from_x : -into, wall == 0 ? from_y : -into, -into);
  const Vec3 out = Vec3(1.0, 1.0, 1.2).normalized();
  play_script(setting, stroke_and_lift({from, to}, p.hover * Vec3::UnitZ(), p.height * out, p,
                                       start, draw.by_factor("slide_speed", 0.05, 0.3)));
}

// Up: along a tread into the riser. Down: along a tread and down on the next.
void stairs(Draw& draw, Setting& setting, double start) {
  const double rise = draw.even("rise", 0.01, 0.03);
  const double run = draw.even("run", 0.045, 0.07);
  constexpr double deep = 0.2;  // [m] of each block
  for (int i = -3; i <= 3; ++i) {
    // Tread i reaches from i run to (i + 1) run, at the height i rise, and below all above it.
    const double end = 5.0 * run;
    const double begin = i * run;
    setting.scene.push_back(still(box(Vec3(0.5 * (end - begin), 0.3, 0.5 * deep)),
                                  at(0.5 * (begin + end), 0.0, i * rise - 0.5 * deep)));
  }
  setting.view = {.azimuth = pi, .azimuth_range = 1.0};  // it sees the risers
  setting.feature = edge_feature;
  const Pressing p = pressing(draw, Vec3::UnitZ());
  const double into = std::min(p.depth, 0.008);
  const double y = draw.even("y", -0.03, 0.03);
  const bool up = draw.whole("up", 2) == 1;
  const std::vector<Vec3> places =
      up ? std::vector<Vec3>{{0.3 * run, y, -into}, {run + into, y, -into}}
         : std::vector<Vec3>{{0.6 * run, y, -into},
                             {-into - 0.006, y, -into},
                             {-into - 0.008, y, -rise - into},
                             {-0.5 * run, y, -rise - into}};
  const Vec3 out = Vec3(-0.3, 0.0, 1.0).normalized();
  play_script(setting, stroke_and_lift(places, p.hover * Vec3::UnitZ(), p.height * out, p, start,
                                       draw.by_factor("slide_speed", 0.05, 0.3)));
}

void torus_press(Draw& draw, Setting& setting, double start) {
  setting.scene = torus_scene(draw);
  const double about = draw.even("about", 0.0, 2.0 * pi);
  const double off = draw.even("off", -0.3, 0.3) * draw.even("tube", 0.014, 0.025);
  const Vec3 top = (draw.even("ring", 0.04, 0.06) + off) * toward(about);
  const Place place = below(setting.scene, top.x(), top.y());
  Pressing p = pressing(draw, place.normal);
  p.out = place.normal;
  p.depth = std::min(p.depth, 0.010);
  play_script(setting, press_and_lift(place, p, start));
}

void torus_slide(Draw& draw, Setting& setting, double start) {
  setting.scene = torus_scene(draw);
  const double about = draw.even("about", 0.0, 2.0 * pi);
  const double turn = draw.even("turn", 0.5, 2.0);
  Pressing p = pressing(draw, Vec3::UnitZ());
  p.depth = std::min(p.depth, 0.008);
  std::vector<Vec3> places;
  for (int i = 0; i <= 60; ++i) {
    const Vec3 on = draw.even("ring", 0.04, 0.06) * toward(about + turn * i / 60.0);
    places.emplace_back(on - p.depth * Vec3::UnitZ());
  }
  play_script(setting, stroke_and_lift(places, Vec3::UnitZ(), p, start,
                                       draw.by_factor("slide_speed", 0.08, 0.3)));
}

// A rod or a cable over a table, its top at z = 0, along x.
void rod_press(Draw& draw, Setting& setting, double start) {
  const double radius = 0.5 * draw.even("rod", 0.006, 0.010);
  const double gap = draw.even("gap", 0.0, 0.06);
  setting.scene = {still(capsule(0.25, radius), at(0.0, 0.0, -radius)),
                   still(ground(), at(0.0, 0.0, -2.0 * radius - gap))};
  setting.feature = 2.0 * radius;
  const Place place = below(setting.scene, draw.even("along", -0.04, 0.04), 0.0);
  Pressing p = pressing(draw, place.normal);
  p.out = Vec3::UnitZ();
  p.depth = 0.75 * radius;  // less than to the axis, where a sphere would slip off
  play_script(setting, press_and_lift(place, p, start));
}

// A thin wall; the camera sees its front, on which the hand pushes through to behind its back.
void sheet_press(Draw& draw, Setting& setting, double start) {
  constexpr double thick = 0.003;
  const double lean = draw.even("upright", 0.2, 1.25);  // [rad] its normal off straight up
  const Eigen::Isometry3d pose = turned(lean, Vec3::UnitY());
  const Vec3 front = pose.linear() * Vec3::UnitZ();
  setting.scene = {still(box(Vec3(0.11, 0.11, 0.5 * thick)), pose * at(0.0, 0.0, -0.5 * thick)),
                   still(ground(), at(0.0, 0.0, -0.16))};
  setting.view = {.azimuth_range = 0.6, .least_tilt = std::max(lean - 0.9, 0.0)};
  setting.most_tilt = std::min(lean + 0.9, setting.most_tilt);
  const Vec3 on = pose.linear() * Vec3(draw.even("u", -0.05, 0.05), draw.even("v", -0.05, 0.05), 0);
  Pressing p = pressing(draw, front);
  p.out = front;
  play_script(setting, press_and_lift({on, front}, p, start));
}

FieldScene cloth_scene(Draw& draw) {
  Chance chance(draw.seed_of("cloth"));
  std::vector<Wave> waves;
  const int count = 1 + draw.whole("waves", 3);
  const double height = draw.even("waves_height", 0.004, 0.010) / count;
  for (int i = 0; i < count; ++i) {
    const double length = chance.even(0.09, 0.25);
    const double frequency = chance.even(0.2, 0.8);
    const double heading = chance.even(0.0, 2.0 * pi);
    waves.push_back({height, length, frequency, heading, chance.even(0.0, 2.0 * pi)});
  }
  return {still(cloth(std::move(waves)))};
}

void cloth_rest(Draw& draw, Setting& setting, double start) {
  setting.scene = cloth_scene(draw);
  Pressing p = pressing(draw, Vec3::UnitZ());
  p.hold += 1.0;
  play_script(setting, press_and_lift({Vec3::Zero(), Vec3::UnitZ()}, p, start));
}

void cloth_slide(Draw& draw, Setting& setting, double start) {
  setting.scene = cloth_scene(draw);
  const Pressing p = pressing(draw, Vec3::UnitZ());
  const double length = draw.even("slide", 0.05, 0.12);
  const Vec3 way = toward(draw.even("heading", 0.0, 2.0 * pi));
  const Vec3 deep = -p.depth * Vec3::UnitZ();
  play_script(setting, stroke_and_lift({deep - 0.5 * length * way, deep + 0.5 * length * way},
                                       p.out, p, start, draw.by_factor("slide_speed", 0.08, 0.3)));
}

FieldScene torso_scene(Draw& draw) {
  const Vec3 half(draw.even("torso_x", 0.13, 0.18), draw.even("torso_y", 0.2, 0.26),
                  draw.even("torso_z", 0.09, 0.12));
  const Vec3 breath(0.002, 0.001, draw.even("breath", 0.004, 0.012));
  // Its top at rest is at z = 0.
  return {still(torso(half, breath, draw.even("breaths", 0.2, 0.5)), at(0.0, 0.0, -half.z())),
          still(ground(), at(0.0, 0.0, -1.6 * half.z()))};
}

void torso_rest(Draw& draw, Setting& setting, double start) {
  setting.scene = torso_scene(draw);
  const Place place =
      below(setting.scene, draw.even("x", -0.05, 0.05), draw.even("y", -0.07, 0.07));
  Pressing p = pressing(draw, place.normal);
  p.hold += 1.5;
  play_script(setting, press_and_lift(place, p, start));
}

void torso_palpate(Draw& draw, Setting& setting, double start) {
  setting.scene = torso_scene(draw);
  const Pressing p = pressing(draw, Vec3::UnitZ());
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const double length = draw.even("slide", 0.04, 0.09);
  const std::vector<Vec3> places =
      under_surface(setting.scene, heading, -0.5 * length, length, p.depth);
  Script script(places.front() + (p.depth + p.hover) * Vec3::UnitZ());
  script.wait(start)
      .reach(places.front(), p.speed)
      .wait(0.2)
      .reach(places.front() + 0.03 * Vec3::UnitZ(), p.speed)
      .reach(places.front(), p.speed)
      .wait(0.3)
      .stroke(places, draw.by_factor("slide_speed", 0.08, 0.3))
      .wait(p.hold)
      .reach(places.back() + p.height * Vec3::UnitZ(), p.speed)
      .wait(0.5);
  play_script(setting, script);
}

void belt_under(Draw& draw, Setting& setting, double start) {
  const double height = draw.even("box", 0.02, 0.06);
  const Vec3 half(draw.even("box_x", 0.035, 0.06), draw.even("box_y", 0.035, 0.06), 0.5 * height);
  const Vec3 way = toward(draw.even("heading", 0.0, 2.0 * pi));
  constexpr double from = 0.28;
  const double seconds = seconds_for(from, draw.by_factor("belt", 0.15, 0.6));
  const double begin = start + 0.2;
  const Vec3 to(0.0, 0.0, -0.5 * height);
  setting.scene = {still(ground(), at(0.0, 0.0, -height)),
                   moving(box(half), from_to(to - from * way, to, begin, seconds,
                                             turned(draw.even("turn", 0.0, pi))))};
  Pressing p = pressing(draw, Vec3::UnitZ());
  p.hover = draw.even("above", 0.03, 0.06);
  const Place place{Vec3(draw.even("x", -0.02, 0.02), draw.even("y", -0.02, 0.02), 0.0),
                    Vec3::UnitZ()};
  play_script(setting, press_and_lift(place, p, begin + seconds + draw.even("pause", 0.0, 0.6)));
}

void belt_beside(Draw& draw, Setting& setting, double start) {
  const double height = draw.even("box", 0.02, 0.08);
  const Vec3 half(draw.even("box_x", 0.03, 0.05), draw.even("box_y", 0.03, 0.06), 0.5 * height);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Vec3 way = toward(heading);
  // Its front stops so far from the hand.
  const Vec3 to =
      -(half.x() + draw.even("beside", 0.025, 0.05)) * way + 0.5 * height * Vec3::UnitZ();
  constexpr double from = 0.25;
  const double seconds = seconds_for(from, draw.by_factor("belt", 0.15, 0.6));
  const Pressing p = resting(draw, seconds);
  setting.scene = {still(ground()),
                   moving(box(half), from_to(to - from * way, to, start + settled(p), seconds,
                                             turned(heading)))};
  play_script(setting, press_and_lift({Vec3::Zero(), Vec3::UnitZ()}, p, start));
}

void belt_ride(Draw& draw, Setting& setting, double start) {
  const double height = draw.even("box", 0.02, 0.06);
  const double way = draw.even("way", 0.08, 0.14);
  const double margin = draw.even("margin", 0.02, 0.05);  // [m] of it left beside the hand
  const Vec3 half(0.5 * way + margin, draw.even("box_y", 0.035, 0.06), 0.5 * height);
  const double seconds = seconds_for(way, draw.by_factor("belt", 0.1, 0.4));
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Vec3 middle = -0.5 * height * Vec3::UnitZ();
  const Vec3 half_way = 0.5 * way * toward(heading);
  const Pressing p = resting(draw, seconds);
  setting.scene = {still(ground(), at(0.0, 0.0, -height)),
                   moving(box(half), from_to(middle - half_way, middle + half_way,
                                             start + settled(p), seconds, turned(heading)))};
  play_script(setting, press_and_lift({Vec3::Zero(), Vec3::UnitZ()}, p, start));
}

void wedge_under(Draw& draw, Setting& setting, double start) {
  const double slope = draw.even("slope", 0.12, 0.35);
  const double lift = draw.even("lift", 0.010, 0.025);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  constexpr double long_half = 0.15;
  constexpr double thick_half = 0.03;
  // Its upper face begins at the origin and rises towards -x at first, before it comes.
  const Eigen::Isometry3d tilted = turned(slope, Vec3::UnitY()) * at(-long_half, 0.0, -thick_half);
  const double before = 0.10;
  const double after = lift * cotangent(slope);
  const Vec3 way = toward(heading);
  const double seconds = seconds_for(before + after, draw.by_factor("push", 0.1, 0.3));
  const Eigen::Isometry3d turn = turned(heading) * tilted;
  const Pressing p = resting(draw, seconds);
  setting.scene = {still(ground()),
                   moving(box(Vec3(long_half, 0.07, thick_half)),
                          from_to(-before * way, after * way, start + settled(p), seconds, turn))};
  play_script(setting, press_and_lift({Vec3::Zero(), Vec3::UnitZ()}, p, start));
}

void table_dome(Draw& draw, Setting& setting, double start) {
  const double out = draw.even("out", 0.06, 0.09);  // [m] of the hand and the dome from the axis
  const double cap = draw.even("cap", 0.008, 0.016);
  const double radius = draw.even("dome", 0.05, 0.09);
  const double before = 1.2;  // [rad] of the dome before it is under the hand
  const double after = draw.whole("stops", 2) == 1 ? 0.0 : 1.2;
  const double fastest = draw.by_factor("turn_speed", 0.6, 1.8);
  const double seconds = seconds_for(before + after, fastest);
  const Vec3 axis = -out * Vec3::UnitX();
  const Eigen::Isometry3d dome = turned(-before) * at(out, 0.0, cap - radius);
  const Pressing p = resting(draw, seconds);
  setting.scene = {
      still(cylinder(0.16, 0.015), at(axis - 0.015 * Vec3::UnitZ())),
      still(ground(), at(0.0, 0.0, -0.03)),
      moving(ball(radius), turning(axis, before + after, start + settled(p), seconds, dome))};
  play_script(setting, press_and_lift({Vec3::Zero(), Vec3::UnitZ()}, p, start));
}

void table_follow(Draw& draw, Setting& setting, double start) {
  const double out = draw.even("out", 0.03, 0.07);
  const double height = draw.even("thing", 0.02, 0.05);
  const double wide = draw.even("wide", 0.02, 0.03);
  const double angle = (draw.whole("back", 2) == 1 ? -1.0 : 1.0) * draw.even("angle", 0.6, 1.8);
  const double seconds = seconds_for(std::abs(angle), draw.by_factor("turn_speed", 0.4, 1.5));
  const Pressing p = resting(draw, seconds);
  const double begin = start + settled(p);
  const int can = draw.whole("can", 2);
  const Eigen::Isometry3d thing = turned(-0.5 * angle) * at(out, 0, -0.5 * height);
  setting.scene = {
      still(cylinder(0.16, 0.015), at(0.0, 0.0, -height - 0.015)),
      still(ground(), at(0.0, 0.0, -height - 0.03)),
      moving(can == 1 ? cylinder(wide, 0.5 * height) : box(Vec3(wide, wide, 0.5 * height)),
             turning(Vec3::Zero(), angle, begin, seconds, thing))};
  const Vec3 first = out * toward(-0.5 * angle);
  const Vec3 deep = p.depth * Vec3::UnitZ();
  Script script(first + p.hover * Vec3::UnitZ());
  script.wait(start).reach(first - deep, p.speed);
  script.wait(std::max(begin - script.duration(), 0.0));
  script.follow(seconds, [=, since = script.duration()](double t) {
    return Vec3(out * toward(-0.5 * angle + angle * ease((t - since) / seconds)) - deep);
  });
  script.wait(0.6).reach(out * toward(0.5 * angle) + p.height * Vec3::UnitZ(), p.speed).wait(0.5);
  play_script(setting, script);
}

void arm_over(Draw& draw, Setting& setting, double start) {
  setting.scene = plane_scene(draw);
  const Vec3 over(0.0, 0.0, draw.even("over", 0.12, 0.2));
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const double seconds = seconds_for(0.4, draw.by_factor("arm", 0.5, 1.5));
  const double there = draw.even("there", 0.0, 0.3);
  const bool stays = draw.whole("stays", 3) == 0;
  Pressing p = resting(draw, 2.0 * seconds + there);
  p.depth = std::max(p.depth, 0.006);
  p.height = std::min(p.height, over.z() - 0.06);
  add_arm(setting.scene, arm_motion(over + 0.06 * toward(heading), heading, start + settled(p),
                                    seconds, there, stays));
  play_script(setting, press_and_lift({Vec3::Zero(), Vec3::UnitZ()}, p, start));
}

void arm_under(Draw& draw, Setting& setting, double start) {
  setting.scene = {still(ground(), at(0.0, 0.0, -0.038))};
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const double seconds = seconds_for(0.4, draw.by_factor("arm", 0.4, 1.2));
  // The back of the hand comes to lie under the origin: its top is 27 mm above the axis.
  const Vec3 tips = 0.135 * toward(heading);
  add_arm(setting.scene, arm_motion(tips, heading, start + 0.2, seconds, 0.0, true));
  const double back = draw.even("along", -0.02, 0.02);
  const Vec3 on = back * toward(heading);
  const double then = start + 0.2 + seconds + draw.even("pause", 0.0, 0.5);
  const Place place = below(setting.scene, on.x(), on.y(), then);
  Pressing p = pressing(draw, Vec3::UnitZ());
  p.out = Vec3::UnitZ();
  p.depth = std::min(p.depth, 0.010);
  p.hover = draw.even("above", 0.03, 0.06);
  play_script(setting, press_and_lift(place, p, then));
}

// A hand in free space over anything, while an arm comes and goes on the table's other side.
void hover(Draw& draw, Setting& setting, double start) {
  setting.scene =
      any_scene(draw, {plane_scene, bowl_scene, torus_scene, terrain_scene, cloth_scene});
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const Vec3 beside(0.0, 0.0, 0.10);
  add_arm(setting.scene, arm_motion(beside - 0.10 * toward(heading), heading, start + 0.5,
                                    seconds_for(0.4, draw.by_factor("arm", 0.4, 1.2)),
                                    draw.even("there", 0.0, 0.5), false));
  Chance chance(draw.seed_of("hover"));
  Script script(Vec3(0.0, 0.0, 0.12));
  script.wait(start);
  while (script.duration() < start + 2.5) {
    const double along = chance.even(0.0, 0.05);
    const double across = chance.even(-0.05, 0.05);
    const Vec3 to = along * toward(heading) + across * toward(heading + 0.5 * pi) +
                    chance.even(0.09, 0.14) * Vec3::UnitZ();
    script.reach(to, chance.even(0.05, 0.5)).wait(chance.even(0.0, 0.3));
  }
  play_script(setting, script);
}

void lift_off(Draw& draw, Setting& setting, double start) {
  setting.scene = any_scene(draw, {plane_scene, torso_scene, terrain_scene, cloth_scene});
  Pressing p = pressing(draw, Vec3::UnitZ());
  p.hold = draw.even("rest", 0.1, 0.4);
  p.height = draw.even("away", 0.12, 0.16);
  const double length = draw.even("slide", 0.0, 0.06);
  const double heading = draw.even("heading", 0.0, 2.0 * pi);
  const std::vector<Vec3> places =
      under_surface(setting.scene, heading, -0.5 * length, length, p.depth);
  Script script(places.front() + (p.depth + p.hover) * p.out);
  script.wait(start)
      .reach(places.front(), p.speed)
      .wait(0.3)
      .stroke(places, draw.by_factor("slide_speed", 0.08, 0.5))
      .wait(p.hold)
      .reach(places.back() + p.height * p.out, 0.5)
      .wait(1.0);
  play_script(setting, script);
}

constexpr std::array classes = {
    FieldClass{"plane-press", "a plane seen at 0 to 70 degrees, pressed and left", plane_press},
    FieldClass{"plane-slide", "the same, strokes of up to 0.5 m/s", slide<plane_scene>},
    FieldClass{"plane-tap", "the same, quick taps and a press", plane_tap},
    FieldClass{"bowl-press", "the inside of a cup or a bowl", bowl_press, 0.5},
    FieldClass{"bowl-slide", "along the inside of a bowl, up its wall", bowl_slide, 0.5},
    FieldClass{"corner-slide", "three planes that meet: from the floor to the walls", corner_slide,
               0.9},
    FieldClass{"stairs", "up into a riser, or down on the next tread", stairs, 0.9},
    FieldClass{"torus-press", "on a ring", torus_press},
    FieldClass{"torus-slide", "along a ring", torus_slide},
    FieldClass{"rod-press", "a rod or a cable of 6 to 10 mm over a table", rod_press, 0.6},
    FieldClass{"sheet-press", "the front of a wall 3 mm thick", sheet_press},
    FieldClass{"cloth-rest", "a cloth that undulates under a resting hand", cloth_rest, 0.9},
    FieldClass{"cloth-slide", "a stroke over such a cloth", cloth_slide, 0.9},
    FieldClass{"torso-rest", "a resting hand on a torso that breathes", torso_rest},
    FieldClass{"torso-palpate", "taps and strokes on it", torso_palpate},
    FieldClass{"terrain-slide", "a stroke over bumps and hollows", slide<terrain_scene>, 0.9},
    FieldClass{"belt-under", "a box arrives sideways under the hand, which then presses on it",
               belt_under, 0.8},
    FieldClass{"belt-beside", "a box arrives beside the pressing hand and stays", belt_beside, 0.8},
    FieldClass{"belt-ride", "a long box moves on under the hand that rests on it", belt_ride, 0.8},
    FieldClass{"wedge-under", "an inclined board is pushed under the HIP at rest and stays",
               wedge_under, 0.8},
    FieldClass{"table-dome", "a dome on a turntable passes under the resting hand, or stops there",
               table_dome, 0.8},
    FieldClass{"table-follow", "the HIP moves in a circle with an object on a turntable",
               table_follow, 0.8},
    FieldClass{"arm-over", "an arm reaches in over the pressing hand, and leaves or stays",
               arm_over, 0.6},
    FieldClass{"arm-under", "a visitor's hand is laid under the waiting hand, which presses on it",
               arm_under, 0.7},
    FieldClass{"hover", "a hand in free space, an arm beside it", hover, 0.8},
    FieldClass{"lift-off", "pressed, slid, and away at 0.5 m/s", lift_off, 1.0}};

// ---- Cameras. ----

CameraPlan camera_of(Draw& draw) {
  CameraPlan plan;
  SensorSetup& setup = plan.setup;
  setup.kind = static_cast<SensorKind>(draw.whole("sensor", sensor_kinds));
  setup.seed = draw.seed_of("noise");
  double least = 0.4;  // [m]
  double most = 1.5;
  switch (setup.kind) {
    case SensorKind::stereo:  // as active stereo cameras of 50 to 95 mm baseline
      setup.focal = draw.even("focal", 380.0, 640.0);
      setup.baseline = draw.even("baseline", 0.05, 0.095);
      setup.quantum = 1.0 / (8 << draw.whole("subpixel", 3));
      setup.noise = draw.even("disparity_noise", 0.04, 0.10);
      setup.window = 5 + 2 * draw.whole("window", 3);
      setup.memory = draw.even("memory", 0.0, 0.85);
      setup.holes = 0.005;
      break;
    case SensorKind::light:  // as the first camera for games
      setup.focal = 580.0;
      setup.baseline = 0.075;
      setup.quantum = 0.125;
      setup.noise = draw.even("disparity_noise", 0.04, 0.08);
      setup.window = 3;
      setup.holes = 0.005;
      least = 0.5;
      break;
    case SensorKind::flight:  // as megapixel and half-megapixel chips
      setup.focal = draw.even("focal", 360.0, 510.0);
      setup.noise = draw.even("range_noise", 0.001, 0.003);
      setup.wiggle = draw.even("wiggle", 0.0, 0.002);
      break;
    case SensorKind::coarse:
      setup.width = draw.whole("pixels", 2) == 1 ? 100 : 80;
      setup.height = setup.width * 4 / 5 - (setup.width == 80 ? 4 : 0);
      setup.focal = 0.5 * setup.width * cotangent(0.5 * draw.even("field_of_view", 0.95, 1.25));
      setup.noise = draw.even("range_noise", 0.003, 0.008);
      setup.memory = draw.even("memory", 0.0, 0.7);
      most = 1.0;
      break;
    case SensorKind::exact:
      setup.focal = 600.0;
      setup.units = 10000.0;
      break;
  }
  plan.distance = draw.even("distance", least, most);
  constexpr double wide = 0.28;  // [m]
  constexpr int most_pixels = 168;
  if (setup.kind != SensorKind::coarse) crop(setup, plan.distance, wide, most_pixels);
  plan.rate = draw.by_factor("rate", 5.0, 90.0);
  plan.latency = draw.even("latency", 0.0, 0.15);
  plan.dropped = draw.even("dropped", 0.0, 0.1);
  plan.jitter = std::min(draw.even("jitter", 0.0, 0.003), 0.2 / plan.rate);
  return plan;
}

}  // namespace

const CaseSet& field_set() {
  // Another stream than every other experiment's, also for the same seed.
  static constexpr CaseSet set{"field", 0x6669656c64736574ULL, classes, 5, camera_of};
  return set;
}

}  // namespace palpate::lab::field
