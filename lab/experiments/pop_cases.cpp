// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/pop_cases.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <tuple>

#include <fmt/format.h>

#include "lab/grid_cloud.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate::lab {
namespace {

constexpr double pi = std::numbers::pi;
using enum PopRange::Draw;

// ---- Clouds of points on a grid, as in section 5. ----

PopStage on_grid(const PopCase& c, const Parameters& parameters, Noise noise,
                 std::function<double(double)> law, double duration,
                 const std::function<double(double, double)>& relief = nullptr) {
  const double r_c = parameters.proxy.r_c();
  GridCloud grid = level_grid(r_c, 12.0 * r_c);
  if (relief) grid.height = relief;
  grid.sigma = c["noise"];
  grid.noise = noise;
  grid.seed = c.seed;
  PopStage stage;
  stage.truth = flat_truth(law);
  const auto shown = stage.shown;
  stage.scenario.duration = duration;
  stage.scenario.cloud = [=](std::uint64_t frame, double t) {
    *shown = t;
    return grid.capture(frame, law(t));
  };
  // 5.2: the hand waits at the origin; once the cloud has passed it, it keeps 6 r_c below the cloud
  // as the newest frame shows it.
  stage.scenario.hip = [=](double) {
    const double height = law(*shown);
    return Vec3(0.0, 0.0, height > 0.0 ? height - 6.0 * r_c : 0.0);
  };
  return stage;
}

// 5.2: from 10 r_c below the origin at 20 r_c/s until it is there, then with an acceleration for 10
// frames.
std::function<double(double)> lift_law(double r_c, double acceleration) {
  return [=](double t) {
    const double after = std::max(t - 0.5, 0.0);
    return -10.0 * r_c + 20.0 * r_c * t + 0.5 * acceleration * after * after;
  };
}
constexpr double lift_duration = 0.5 + 10.0 / f_c;

constexpr std::array lift_white_ranges = {PopRange{"noise", 0.0, 0.0, 0.010, even, 0.1},
                                          PopRange{"acceleration", 0.0, 0.0, 90.0, even, 1000.0}};
PopStage lift_white(const PopCase& c, const Parameters& parameters) {
  return grid_lift(c, parameters, Noise::white);
}

constexpr std::array lift_correlated_ranges = {
    PopRange{"noise", 0.0, 0.0, 0.005, even, 0.1},
    PopRange{"acceleration", 0.0, 0.0, 90.0, even, 1000.0}};
PopStage lift_correlated(const PopCase& c, const Parameters& parameters) {
  return grid_lift(c, parameters, Noise::correlated);
}

// A ball that is lifted, and beyond its rim a plane beneath it.
constexpr std::array lift_sphere_ranges = {PopRange{"noise", 0.0, 0.0, 0.010, even, 0.1},
                                           PopRange{"acceleration", 0.0, 0.0, 7.0, even, 1000.0},
                                           PopRange{"radius", 0.080, 0.040, 0.080, even, 1.0}};
PopStage lift_sphere(const PopCase& c, const Parameters& parameters) {
  const double radius = c["radius"];
  const auto law = lift_law(parameters.proxy.r_c(), c["acceleration"]);
  PopStage stage =
      on_grid(c, parameters, Noise::white, law, lift_duration, [radius](double x, double y) {
        const double squared = radius * radius - x * x - y * y;
        return squared > 0.0 ? std::sqrt(squared) - radius : -radius;
      });
  stage.judged_at_end = true;
  stage.truth = [=](const Vec3& p, double t) {
    const Vec3 offset = p - Vec3(0.0, 0.0, law(t) - radius);
    const double distance = offset.norm();
    return TruePoint{distance - radius,
                     distance > 0.0 ? Vec3(offset / distance) : Vec3(Vec3::UnitZ())};
  };
  return stage;
}

// A plane that comes from 0.3 m or three frames away, whichever is farther.
constexpr std::array first_contact_ranges = {PopRange{"noise", 0.0, 0.0, 0.001, even, 0.1},
                                             PopRange{"speed", 0.05, 0.05, 5.0, by_factor, 100.0}};
PopStage first_contact(const PopCase& c, const Parameters& parameters) {
  const double speed = c["speed"];
  const double phase = Chance(c.seed)();
  const double away = std::max(0.3, 3.0 * speed / f_c) + speed * phase / f_c;
  PopStage stage = on_grid(
      c, parameters, Noise::white, [=](double t) { return -away + speed * t; },
      away / speed + 5.0 / f_c);
  stage.judged_at_end = true;
  return stage;
}

constexpr std::array hold_ranges = {PopRange{"noise", 0.0, 0.0, 0.0025, even, 0.1},
                                    PopRange{"correlated", 0.0, 0.0, 1.0, whole},
                                    PopRange{"seconds", 2.0, 2.0, 2.0, even, 3600.0}};
PopStage hold(const PopCase& c, const Parameters& parameters) {
  const double r_c = parameters.proxy.r_c();
  PopStage stage = on_grid(
      c, parameters, c["correlated"] != 0.0 ? Noise::correlated : Noise::white,
      [](double) { return 0.0; }, c["seconds"]);
  stage.seat = Vec3(0.1 * r_c, 0.1 * r_c, 4.0 * r_c);
  stage.scenario.hip = [=](double) { return Vec3(0.1 * r_c, 0.1 * r_c, -6.0 * r_c); };
  return stage;
}

// ---- What a depth camera sees. ----

constexpr PopRange sensor_range{"sensor", 0.0, 0.0, 2.0, whole};
constexpr PopRange tilt_range{"tilt", 0.0, 0.0, 0.6, even, 1.2};
constexpr PopRange distance_range{"distance", 0.7, 0.45, 0.95, even, 5.0};
constexpr PopRange fps_range{"fps", 30.0, 15.0, 90.0, by_factor, 1000.0};
constexpr PopRange stroke_range{"stroke", 0.0, 0.0, 0.06, even, 1.0};
constexpr PopRange frequency_range{"frequency", 0.5, 0.25, 1.5, by_factor, 50.0};

template <std::size_t Count, class... More>
constexpr auto joined(const std::array<PopRange, Count>& first, const More&... more) {
  return std::apply([&](const auto&... ranges) { return std::array{ranges..., more...}; }, first);
}
constexpr std::array view_ranges = {sensor_range, tilt_range, distance_range, fps_range};
constexpr std::array moved_ranges = joined(view_ranges, stroke_range, frequency_range);

// How a hand touches: from 60 mm above at 0.15 m/s, then `press` below what the newest frame truly
// showed at (x + along t, y), following it at up to 1 m/s.
struct HandPath {
  double x = 0.0;
  double y = 0.0;
  double along = 0.0;    // [m/s]
  double press = 0.008;  // [m]
};
constexpr double contact_time = 0.4;  // [s]
constexpr double hand_speed = 1.0;    // [m/s]

std::function<double(double x, double y, double t)> seen_from_above(
    const std::shared_ptr<const Scene>& scene) {
  return [scene](double x, double y, double t) {
    constexpr double high = 0.3;
    const auto hit = scene->cast(Vec3(x, y, high), -Vec3::UnitZ(), t);
    return hit ? high - *hit : -std::numeric_limits<double>::infinity();
  };
}

PopStage in_sight(const PopCase& c, const std::shared_ptr<const Scene>& scene,
                  const std::function<double(double, double, double)>& height, const HandPath& hand,
                  double duration) {
  const double distance = c["distance"];
  CameraSetup setup;
  constexpr double focal = 589.0;  // [px] as 640 pixels across 57 degrees
  const int pixels = std::clamp(static_cast<int>(0.3 * focal / distance), 120, 400);
  setup.intrinsics = pinhole(pixels, pixels, 2.0 * std::atan(0.5 * pixels / focal));
  setup.world_from_camera = looking_at_origin(distance, c["tilt"], 0.0);
  setup.frame_rate = c["fps"];
  constexpr std::array<std::string_view, 3> sensors = {"ideal", "d4xx", "kinect"};
  SensorModel sensor = SensorModel::named(sensors[static_cast<std::size_t>(c["sensor"])]);
  sensor.seed = c.seed;
  const auto camera = std::make_shared<SyntheticCamera>(*scene, setup, sensor);

  PopStage stage;
  stage.truth = truth_of(scene);
  const auto shown = stage.shown;
  const double first = std::max(height(hand.x, hand.y, 0.0), -0.3);
  const auto z = std::make_shared<double>(first + 0.060);
  stage.seat = Vec3(hand.x, hand.y, *z);
  stage.scenario.frame_rate = setup.frame_rate;
  stage.scenario.duration = duration;
  stage.scenario.cloud = [=](std::uint64_t frame, double t) {
    *shown = t;
    return camera->capture(t, frame).cloud;
  };
  stage.scenario.hip = [=](double t) {
    const double x = hand.x + hand.along * std::max(t - contact_time, 0.0);
    const double surface = height(x, hand.y, *shown);
    const double above = std::max(0.15 * (contact_time - t), -hand.press);
    if (std::isfinite(surface))
      *z += std::clamp(surface + above - *z, -hand_speed * 1e-3, hand_speed * 1e-3);
    return Vec3(x, hand.y, *z);
  };
  return stage;
}

std::shared_ptr<const Scene> scene_of(const std::string& uri) {
  return std::make_shared<const Scene>(make_scene(Uri(uri)));
}

PopStage in_sight(const PopCase& c, const std::string& uri, const HandPath& hand,
                  double duration = 2.4) {
  const auto scene = scene_of(uri);
  return in_sight(c, scene, seen_from_above(scene), hand, duration);
}

std::string motion_of(const PopCase& c) {
  return fmt::format("stroke={}&frequency={}&start=0.5", c["stroke"], c["frequency"]);
}

constexpr std::array lift_real_ranges = {
    PopRange{"acceleration", 0.0, 0.0, 7.0, even, 1000.0},
    PopRange{"distance", 0.95, 0.7, 0.95, even, 5.0}, PopRange{"tilt", 0.0, 0.0, 0.0, even, 1.2},
    PopRange{"sensor", 1.0, 1.0, 1.0, whole}, PopRange{"fps", 30.0, 30.0, 30.0, even, 1000.0}};
PopStage lift_real(const PopCase& c, const Parameters& /*parameters*/) {
  const double a = c["acceleration"];
  constexpr double start = 0.9;
  // Ten frames, or until it is 0.25 m from the camera.
  const double room = c["distance"] - 0.25;
  const double longest = a > 0.0 ? (std::sqrt(0.01 + 2.0 * a * room) - 0.1) / a : room / 0.1;
  const auto scene =
      scene_of(fmt::format("synthetic:plane?speed=0.1&acceleration={}&start={}", a, start));
  PopStage stage = in_sight(
      c, scene,
      [a](double, double, double t) {
        const double after = std::max(t - start, 0.0);
        return after * (0.1 + 0.5 * a * after);
      },
      {}, start + std::min(10.0 / f_c, longest));
  stage.judged_at_end = true;
  return stage;
}

constexpr std::array hold_real_ranges = {PopRange{"sensor", 1.0, 1.0, 1.0, whole, 2.0}, tilt_range,
                                         distance_range, fps_range,
                                         PopRange{"seconds", 2.0, 2.0, 2.0, even, 3600.0}};
PopStage hold_real(const PopCase& c, const Parameters& /*parameters*/) {
  return in_sight(c, "synthetic:plane", {}, contact_time + c["seconds"]);
}

constexpr std::array sine_ranges =
    joined(view_ranges, PopRange{"stroke", 0.0, 0.005, 0.1, even, 1.0},
           PopRange{"frequency", 0.5, 0.25, 3.0, by_factor, 50.0});
PopStage sine(const PopCase& c, const Parameters& /*parameters*/) {
  return in_sight(c, "synthetic:plane?" + motion_of(c), {});
}

constexpr std::array turn_ranges =
    joined(view_ranges, PopRange{"slope", 0.0, -0.5, 0.5, even, 1.2},
           PopRange{"swing", 0.0, 0.05, 0.4, even, 1.5}, PopRange{"x", 0.0, -0.03, 0.03, even, 0.2},
           frequency_range);
PopStage turn(const PopCase& c, const Parameters& /*parameters*/) {
  return in_sight(c,
                  fmt::format("synthetic:tilt?slope={}&swing={}&frequency={}&start=0.5", c["slope"],
                              c["swing"], c["frequency"]),
                  {.x = c["x"]});
}

constexpr std::array sphere_ranges =
    joined(moved_ranges, PopRange{"radius", 0.08, 0.02, 0.1, even, 1.0},
           PopRange{"x", 0.0, -0.3, 0.3, even, 0.9}, PopRange{"y", 0.0, -0.3, 0.3, even, 0.9});
PopStage sphere(const PopCase& c, const Parameters& /*parameters*/) {
  const double radius = c["radius"];
  return in_sight(c, fmt::format("synthetic:sphere?radius={}&floor=0.25&{}", radius, motion_of(c)),
                  {.x = c["x"] * radius, .y = c["y"] * radius});
}

constexpr std::array cylinder_ranges =
    joined(moved_ranges, PopRange{"radius", 0.05, 0.015, 0.06, even, 1.0},
           PopRange{"x", 0.0, -0.3, 0.3, even, 0.9});
PopStage cylinder(const PopCase& c, const Parameters& /*parameters*/) {
  const double radius = c["radius"];
  return in_sight(c,
                  fmt::format("synthetic:cylinder?radius={}&floor=0.25&{}", radius, motion_of(c)),
                  {.x = c["x"] * radius});
}

constexpr std::array edge_ranges =
    joined(moved_ranges, PopRange{"angle", 2.0, 1.0, 2.6, even, 3.1},
           PopRange{"concave", 0.0, 0.0, 1.0, whole}, PopRange{"x", 0.0, -0.010, 0.010, even, 0.1},
           PopRange{"along", 0.0, -0.03, 0.03, even, 1.0});
PopStage edge(const PopCase& c, const Parameters& /*parameters*/) {
  return in_sight(c,
                  fmt::format("synthetic:wedge?angle={}&edge={}&{}", c["angle"],
                              c["concave"] != 0.0 ? "concave" : "convex", motion_of(c)),
                  {.x = c["x"], .along = c["along"]});
}

constexpr std::array finger_ranges =
    joined(moved_ranges, PopRange{"radius", 0.014, 0.008, 0.014, even, 0.1});
PopStage finger(const PopCase& c, const Parameters& /*parameters*/) {
  return in_sight(
      c, fmt::format("synthetic:finger?radius={}&floor=0.15&{}", c["radius"], motion_of(c)), {});
}

// Something passes between the camera and the contact, once to and once fro.
constexpr std::array occluder_ranges = {sensor_range,
                                        tilt_range,
                                        PopRange{"distance", 0.7, 0.6, 0.95, even, 5.0},
                                        fps_range,
                                        PopRange{"radius", 0.035, 0.02, 0.05, even, 0.2},
                                        PopRange{"height", 0.15, 0.1, 0.3, even, 1.0},
                                        PopRange{"frequency", 0.5, 0.2, 1.0, by_factor, 50.0}};
PopStage occluder(const PopCase& c, const Parameters& /*parameters*/) {
  constexpr double start = 1.0;
  const auto scene =
      scene_of(fmt::format("synthetic:occluder?radius={}&height={}&frequency={}&start={}",
                           c["radius"], c["height"], c["frequency"], start));
  PopStage stage = in_sight(
      c, scene, [](double, double, double) { return 0.0; }, {}, start + 1.0 / c["frequency"]);
  stage.steady_from = start;
  stage.undisturbed =
      std::make_shared<const PopStage>(in_sight(c, "synthetic:plane", {}, stage.scenario.duration));
  return stage;
}

// Narrower than the sphere, with room for a pixel: it may not fall in. Whoever reaches through a
// wider hole may touch the plate from beneath, and how thick it is nobody has seen.
constexpr std::array hole_ranges = joined(
    view_ranges, PopRange{"width", 0.003, 0.003, 0.008, even, 0.009},
    PopRange{"along", 0.05, 0.02, 0.08, even, 1.0}, PopRange{"y", 0.0, -0.01, 0.01, even, 0.1});
PopStage hole(const PopCase& c, const Parameters& /*parameters*/) {
  const double along = c["along"];
  return in_sight(c, fmt::format("synthetic:hole?width={}&thickness=0.06&floor=0.2", c["width"]),
                  {.x = -along, .y = c["y"], .along = along});
}

// A terrace over a plane moves up and down; the hand presses on it or beside it. Nothing moves
// sideways over the hand: from above, a body that pushes and one that passes look the same.
constexpr std::array layers_ranges =
    joined(view_ranges, PopRange{"stroke", 0.0, 0.0, 0.04, even, 1.0}, frequency_range,
           PopRange{"separation", 0.04, 0.008, 0.04, even, 0.2},
           PopRange{"x", -0.03, -0.03, 0.03, even, 0.1});
PopStage layers(const PopCase& c, const Parameters& /*parameters*/) {
  Motion motion;
  motion.start = 0.5;
  motion.stroke = c["stroke"];
  motion.frequency = c["frequency"];
  constexpr double half = 0.1;
  const auto at = [](double x, double z) {
    return Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, z));
  };
  const auto scene = std::make_shared<const Scene>(
      std::vector<Part>{{block(Vec3(half, 2.0 * half, half)), at(-half, -half), motion},
                        {HalfSpace{}, at(0.0, -c["separation"]), Motion{}}});
  return in_sight(c, scene, seen_from_above(scene), {.x = c["x"]}, 2.4);
}

// Frames are dropped at random and come late by a time drawn afresh for each.
constexpr std::array stream_ranges = joined(
    view_ranges, PopRange{"stroke", 0.0, 0.0, 0.04, even, 1.0}, frequency_range,
    PopRange{"dropped", 0.0, 0.0, 0.5, even, 0.99}, PopRange{"late", 0.0, 0.0, 0.06, even, 1.0});
PopStage stream(const PopCase& c, const Parameters& /*parameters*/) {
  PopStage stage = in_sight(c, "synthetic:plane?" + motion_of(c), {});
  const double dropped = c["dropped"];
  const double late = c["late"];
  stage.scenario.delay = [=, seed = c.seed](std::uint64_t frame) -> std::optional<double> {
    Chance chance(seed * 1000003ULL + frame);
    if (frame > 0 && chance() < dropped) return std::nullopt;
    return late * chance();
  };
  return stage;
}

// Bodies of any kind and size on a floor go up and down; the first lies under the hand. Either it
// swings too, or the hand slides; both together may bring it over the hand from the side.
constexpr std::array random_ranges = joined(
    view_ranges, PopRange{"parts", 1.0, 1.0, 4.0, whole},
    PopRange{"stroke", 0.0, 0.0, 0.05, even, 1.0}, PopRange{"slides", 0.0, 0.0, 1.0, whole},
    PopRange{"swing", 0.0, 0.0, 0.4, even, 1.5}, PopRange{"along", 0.0, -0.05, 0.05, even, 1.0},
    PopRange{"x", 0.0, -0.3, 0.3, even, 0.9}, PopRange{"y", 0.0, -0.3, 0.3, even, 0.9});
PopStage random_scene(const PopCase& c, const Parameters& /*parameters*/) {
  Chance chance(c.seed);
  const bool slides = c["slides"] != 0.0;
  const auto at = [](const Vec3& place) { return Eigen::Isometry3d(Eigen::Translation3d(place)); };
  std::vector<Part> parts = {{HalfSpace{}, at(Vec3(0.0, 0.0, -0.1)), Motion{}}};
  double width = 0.0;  // [m] half of the first
  for (int i = 0; i < static_cast<int>(c["parts"]); ++i) {
    const double size = chance(0.02, 0.05);
    const double length = chance(0.02, 0.08);
    const auto kind = static_cast<int>(chance(0.0, 4.0));
    Shape shape = Sphere{size};
    if (kind == 1) shape = Capsule{size, length};
    if (kind == 2) shape = Cylinder{size, length};
    if (kind == 3) shape = block(Vec3(size, length, 0.03));
    if (i == 0) width = std::min(size, length);
    const double spread = i == 0 ? 0.0 : 0.07;
    // One by one: compilers differ in the order in which they find a call's arguments.
    const double z = chance(-0.02, 0.02) - (kind == 3 ? 0.03 : size);
    const double y = chance(-spread, spread);
    const Vec3 centre(chance(-spread, spread), y, z);
    const double heading = chance(0.0, 2.0 * pi);
    Motion motion;
    motion.start = 0.5;
    motion.stroke = c["stroke"] * chance(-1.0, 1.0);
    motion.frequency = chance(0.25, 1.5);
    motion.swing = i == 0 && !slides ? c["swing"] : 0.0;
    motion.axis = Vec3(math::cos(heading), math::sin(heading), 0.0);
    motion.pivot = centre;
    const Eigen::Isometry3d pose =
        at(centre) * Eigen::Isometry3d(Eigen::AngleAxisd(chance(0.0, pi), Vec3::UnitZ()));
    parts.push_back({std::move(shape), pose, motion});
  }
  const auto scene = std::make_shared<const Scene>(std::move(parts));
  return in_sight(c, scene, seen_from_above(scene),
                  {.x = c["x"] * width, .y = c["y"] * width, .along = slides ? c["along"] : 0.0},
                  2.4);
}

// A hand comes down, presses, slides and is lifted far away, over a body at rest.
struct Stroke {
  double x = 0.0, y = 0.0;   // [m] where it comes down
  double heading = 0.0;      // [rad]
  double slide = 0.0;        // [m]
  double press = 0.01;       // [m] below the surface
  double speed = 0.3;        // [m/s] down and up
  double slide_speed = 0.1;  // [m/s]
  double wait = 0.1;         // [s] before it comes down
  double hold = 0.2;         // [s] pressed, before and after the slide
};

PopStage press_slide_lift(const PopCase& c, const std::shared_ptr<const Scene>& scene,
                          const Stroke& stroke) {
  constexpr double from = 0.07;  // [m] above the surface
  constexpr double to = 0.09;
  constexpr double free_for = 0.5;  // [s] after it was lifted
  const double down = stroke.wait + (from + stroke.press) / stroke.speed;
  const double slide_from = down + stroke.hold;
  const double slide_to = slide_from + stroke.slide / stroke.slide_speed;
  const double up_from = slide_to + stroke.hold;
  const double up_to = up_from + (to + stroke.press) / stroke.speed;
  const auto height = seen_from_above(scene);
  const auto hip = [=](double t) {
    const double way =
        stroke.slide * std::clamp((t - slide_from) / (slide_to - slide_from + 1e-9), 0.0, 1.0);
    const double x = stroke.x + way * math::cos(stroke.heading);
    const double y = stroke.y + way * math::sin(stroke.heading);
    const double above =
        t < up_from ? std::max(from - stroke.speed * std::max(t - stroke.wait, 0.0), -stroke.press)
                    : std::min(stroke.speed * (t - up_from) - stroke.press, to);
    return Vec3(x, y, height(x, y, 0.0) + above);
  };
  PopStage stage = in_sight(c, scene, height, {.x = stroke.x, .y = stroke.y}, up_to + free_for);
  stage.seat = hip(0.0);
  stage.scenario.hip = hip;
  return stage;
}

// All round: near and far, steep, on bodies of any shape, quick and slow.
constexpr std::array lift_off_ranges = {sensor_range,
                                        PopRange{"tilt", 0.0, 0.0, 1.05, even, 1.2},
                                        PopRange{"distance", 0.7, 0.4, 1.5, even, 5.0},
                                        PopRange{"fps", 30.0, 30.0, 30.0, even, 1000.0},
                                        PopRange{"body", 0.0, 0.0, 3.0, whole},
                                        PopRange{"press", 0.01, 0.004, 0.025, even, 0.1},
                                        PopRange{"speed", 0.3, 0.05, 0.6, by_factor, 5.0},
                                        PopRange{"slide", 0.0, 0.0, 0.03, even, 0.1},
                                        PopRange{"slide_speed", 0.1, 0.02, 0.3, by_factor, 5.0},
                                        PopRange{"heading", 0.0, 0.0, 6.28, even, 6.3},
                                        PopRange{"x", 0.0, -0.008, 0.008, even, 0.1},
                                        PopRange{"y", 0.0, -0.008, 0.008, even, 0.1}};
PopStage lift_off(const PopCase& c, const Parameters& /*parameters*/) {
  constexpr std::array bodies = {"synthetic:plane", "synthetic:sphere?radius=0.06&floor=0.25",
                                 "synthetic:wedge?edge=convex", "synthetic:wedge?edge=concave"};
  return press_slide_lift(c, scene_of(bodies[static_cast<std::size_t>(c["body"])]),
                          {.x = c["x"],
                           .y = c["y"],
                           .heading = c["heading"],
                           .slide = c["slide"],
                           .press = c["press"],
                           .speed = c["speed"],
                           .slide_speed = c["slide_speed"]});
}

// Every frame arrives late by the same time, and the next may be far.
constexpr std::array late_ranges = {sensor_range,
                                    tilt_range,
                                    distance_range,
                                    PopRange{"fps", 30.0, 5.0, 90.0, by_factor, 1000.0},
                                    PopRange{"latency", 0.0, 0.0, 0.5, even, 5.0},
                                    PopRange{"press", 0.01, 0.004, 0.025, even, 0.1}};
PopStage late(const PopCase& c, const Parameters& /*parameters*/) {
  const double latency = c["latency"];
  PopStage stage =
      press_slide_lift(c, scene_of("synthetic:plane"),
                       {.press = c["press"], .wait = latency + 2.0 / c["fps"] + 0.1, .hold = 0.5});
  stage.scenario.delay = [latency](std::uint64_t) -> std::optional<double> { return latency; };
  return stage;
}

constexpr std::array families = {
    PopFamily{"lift-white", "5.2 with up to 18 000 r_c/s^2 and 2 r_c of white noise",
              lift_white_ranges, lift_white},
    PopFamily{"lift-correlated", "the same with up to 1 r_c of noise over five points",
              lift_correlated_ranges, lift_correlated},
    PopFamily{"lift-real", "the same up to 1400 r_c/s^2 with a D4xx", lift_real_ranges, lift_real},
    PopFamily{"lift-sphere", "balls of 40 to 80 mm, up to 1400 r_c/s^2 and 2 r_c of white noise",
              lift_sphere_ranges, lift_sphere},
    PopFamily{"first-contact", "a plane out of free space at up to 5 m/s", first_contact_ranges,
              first_contact},
    PopFamily{"hold", "a plane at rest, up to 2.5 mm of white or correlated noise", hold_ranges,
              hold},
    PopFamily{"hold-real", "a plane at rest with a D4xx", hold_real_ranges, hold_real},
    PopFamily{"sine", "a plane that moves up and down", sine_ranges, sine},
    PopFamily{"turn", "an inclined plane that oscillates", turn_ranges, turn},
    PopFamily{"sphere", "spheres that move up and down", sphere_ranges, sphere},
    PopFamily{"cylinder", "horizontal rods that move up and down", cylinder_ranges, cylinder},
    PopFamily{"edge", "convex and concave edges that move up and down", edge_ranges, edge},
    PopFamily{"finger", "thin rods that move up and down", finger_ranges, finger},
    PopFamily{"occluder", "an arm passes between the camera and a plane at rest", occluder_ranges,
              occluder},
    PopFamily{"hole", "over a hole narrower than the sphere", hole_ranges, hole},
    PopFamily{"layers", "a terrace that moves up and down over a plane", layers_ranges, layers},
    PopFamily{"stream", "a moving plane, frames dropped and late", stream_ranges, stream},
    PopFamily{"random", "one to four moving objects of any shape", random_ranges, random_scene},
    PopFamily{"lift-off", "the HIP presses, slides and is lifted over objects at rest",
              lift_off_ranges, lift_off},
    PopFamily{"late", "slow and late cameras, a plane at rest", late_ranges, late}};

}  // namespace

PopStage grid_lift(const PopCase& c, const Parameters& parameters, Noise noise) {
  PopStage stage = on_grid(c, parameters, noise,
                           lift_law(parameters.proxy.r_c(), c["acceleration"]), lift_duration);
  stage.judged_at_end = true;
  return stage;
}

double rounded(double value) { return std::strtod(fmt::format("{:.3g}", value).c_str(), nullptr); }

Chance chance_of(std::string_view name, std::uint64_t seed, std::uint64_t index) {
  // FNV-1a of the name: a new family changes no other.
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char letter : name)
    hash = (hash ^ static_cast<unsigned char>(letter)) * 1099511628211ULL;
  return Chance((hash ^ seed * 0x9e3779b97f4a7c15ULL) + index * 0xbf58476d1ce4e5b9ULL);
}

double PopCase::operator[](std::string_view key) const {
  const auto found = values.find(key);
  if (found == values.end())
    throw Error("pop:" + std::string(family), "it has no value '" + std::string(key) + "'", "");
  return found->second;
}

std::string PopCase::text() const {
  std::string result = "pop:" + std::string(family) + "?";
  for (const PopRange& range : find_pop_family(family).ranges)
    result += fmt::format("{}={}&", range.key, (*this)[range.key]);
  return result + fmt::format("seed={}", seed);
}

std::span<const PopFamily> pop_families() { return families; }

const PopFamily& find_pop_family(std::string_view name) {
  return find_named(families, name, "family", "there is no such family of cases");
}

PopCase draw_pop_case(const PopFamily& family, std::uint64_t seed, std::uint64_t index) {
  Chance chance = chance_of(family.name, seed, index);
  PopCase c;
  c.family = family.name;
  for (const PopRange& range : family.ranges) {
    double value = 0.0;
    switch (range.draw) {
      case even:
        value = chance(range.low, range.high);
        break;
      case by_factor:
        value = range.low * math::pow(range.high / range.low, chance());
        break;
      case whole:
        value = std::floor(chance(range.low, range.high + 1.0));
        break;
    }
    c.values.emplace(range.key, rounded(value));
  }
  c.seed = static_cast<std::uint64_t>(chance() * 0x1p31);
  return c;
}

PopCase parse_pop_case(const std::string& text) {
  const Uri uri(text);
  if (uri.scheme() != "pop")
    throw Error("--case " + text, "it does not begin with 'pop:'",
                "give one as `palpate eval pop` prints it");
  const PopFamily& family = find_pop_family(uri.path());
  PopCase c;
  c.family = family.name;
  std::vector<std::string_view> keys = {"seed"};
  for (const PopRange& range : family.ranges) {
    keys.push_back(range.key);
    const double low = std::min({range.low, range.simple, -range.wide});
    const double high = std::max({range.high, range.simple, range.wide});
    c.values.emplace(
        range.key,
        uri.number_option(range.key, range.simple,
                          range.low < 0.0 ? low : std::min(range.low, range.simple), high));
  }
  uri.allow_only(keys);
  c.seed = static_cast<std::uint64_t>(uri.number_option("seed", 0.0, 0.0, 0x1p31));
  return c;
}

}  // namespace palpate::lab
