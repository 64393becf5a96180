// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

using Vec2 = Eigen::Vector2d;

constexpr double pi = std::numbers::pi;
constexpr double endless = std::numeric_limits<double>::infinity();
constexpr double far_away = 10.0;  // [m] stands for infinity where an outline needs corners

Eigen::Isometry3d place(double x, double y, double z) {
  return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
}

Part resting(Shape shape, const Eigen::Isometry3d& world_from_part) {
  return {std::move(shape), world_from_part, Motion{}};
}

double length(const Uri& uri, std::string_view key, double fallback, double min = 1e-4,
              double max = 5.0) {
  return uri.number_option(key, fallback, min, max, "m");
}

double angle(const Uri& uri, std::string_view key, double fallback, double min, double max) {
  return uri.number_option(key, fallback, min, max, "rad");
}

constexpr std::array<std::string_view, 7> common_options{
    "start", "speed", "acceleration", "stroke", "frequency", "swing", "floor"};

// The part that the options move.
Part moving(const Uri& uri, Shape shape,
            const Eigen::Isometry3d& world_from_part = Eigen::Isometry3d::Identity(),
            Motion motion = {}) {
  motion.start = uri.number_option("start", motion.start, 0.0, 1e6, "s");
  motion.speed = uri.number_option("speed", motion.speed, -100.0, 100.0, "m/s");
  motion.acceleration = uri.number_option("acceleration", motion.acceleration, -1e4, 1e4, "m/s2");
  motion.stroke = uri.number_option("stroke", motion.stroke, -5.0, 5.0, "m");
  motion.frequency = uri.number_option("frequency", motion.frequency, 0.0, 1000.0, "Hz");
  motion.swing = angle(uri, "swing", motion.swing, -pi, pi);
  return {std::move(shape), world_from_part, motion};
}

Prism ground_profile(std::vector<Vec2> surface_from_right_to_left) {
  std::vector<Vec2> outline{Vec2(-far_away, -far_away), Vec2(far_away, -far_away)};
  outline.insert(outline.end(), surface_from_right_to_left.begin(),
                 surface_from_right_to_left.end());
  return {std::move(outline), endless};
}

std::vector<Part> plane(const Uri& uri) { return {moving(uri, HalfSpace{})}; }

std::vector<Part> tilt(const Uri& uri) {
  const double slope = angle(uri, "slope", pi / 9.0, -1.4, 1.4);
  return {moving(uri, HalfSpace{}, Eigen::Isometry3d(Eigen::AngleAxisd(-slope, Vec3::UnitY())))};
}

std::vector<Part> sphere(const Uri& uri) {
  const double radius = length(uri, "radius", 0.040);
  return {moving(uri, Sphere{radius}, place(0.0, 0.0, -radius))};
}

std::vector<Part> cylinder(const Uri& uri) {
  const double radius = length(uri, "radius", 0.020);
  return {
      moving(uri, Cylinder{radius, 0.5 * length(uri, "length", 0.200)}, place(0.0, 0.0, -radius))};
}

std::vector<Part> finger(const Uri& uri) {
  const double radius = length(uri, "radius", 0.008);
  return {
      moving(uri, Capsule{radius, 0.5 * length(uri, "length", 0.080)}, place(0.0, 0.0, -radius))};
}

std::vector<Part> box(const Uri& uri) {
  const double half = 0.5 * length(uri, "edge", 0.080);
  return {moving(uri, block(Vec3::Constant(half)), place(0.0, 0.0, -half))};
}

std::vector<Part> thin_plate(const Uri& uri) {
  const double half = 0.5 * length(uri, "edge", 0.120);
  const double half_thickness = 0.5 * length(uri, "thickness", 0.002);
  return {moving(uri, block(Vec3(half, half, half_thickness)), place(0.0, 0.0, -half_thickness))};
}

std::vector<Part> wedge(const Uri& uri) {
  const double opening = angle(uri, "angle", pi / 2.0, 0.1, pi - 0.01);
  const std::string edge = uri.text_option("edge", "convex");
  if (edge != "convex" && edge != "concave")
    throw Error(uri.text() + ": option 'edge'", "'" + edge + "' is not a type of edge",
                "give convex or concave");
  const double rise = std::cos(0.5 * opening) * (edge == "convex" ? -1.0 : 1.0) * 2.0;
  const double run = std::sin(0.5 * opening) * 2.0;
  return {moving(uri, ground_profile({Vec2(run, rise), Vec2(0.0, 0.0), Vec2(-run, rise)}))};
}

std::vector<Part> triangle_wave(const Uri& uri) {
  const double period = length(uri, "period", 0.030, 1e-3);
  const double extent = length(uri, "extent", 0.450);
  const double height = length(uri, "height", 0.030, 0.0);
  const double corners = std::floor(extent / (0.5 * period));
  if (corners < 2.0 || corners > 10000.0)
    throw Error(uri.text() + ": option 'period'", "the wave would have no or too many corners",
                "give a period from extent/5000 to extent");
  const int count = static_cast<int>(corners);
  std::vector<Vec2> surface{Vec2(far_away, 0.0)};
  for (int i = count; i >= 0; --i) {
    const double amplitude = 0.5 * height * i / count;
    surface.emplace_back(-0.5 * extent + 0.5 * period * i, i % 2 == 0 ? -amplitude : amplitude);
  }
  surface.emplace_back(-far_away, 0.0);
  return {moving(uri, ground_profile(std::move(surface)))};
}

std::vector<Part> relief(const Uri& uri) {
  return {moving(uri, Wave{length(uri, "height", 0.003), length(uri, "length", 0.010)})};
}

std::vector<Part> gap(const Uri& uri) {
  const double half_gap = 0.5 * length(uri, "width", 0.006);
  const double half_plate = 0.150;
  const double half_thickness = 0.5 * length(uri, "thickness", 0.020);
  const Prism plate = block(Vec3(half_plate, 0.150, half_thickness));
  const double x = half_gap + half_plate;
  return {moving(uri, plate, place(-x, 0.0, -half_thickness)),
          moving(uri, plate, place(x, 0.0, -half_thickness))};
}

std::vector<Part> hole(const Uri& uri) {
  const double half_hole = 0.5 * length(uri, "width", 0.020, 1e-4, 0.2);
  const double half_thickness = 0.5 * length(uri, "thickness", 0.020);
  const double half_plate = 0.150;
  const double half_bar = 0.5 * (half_plate - half_hole);
  const double at = half_hole + half_bar;
  // The four bars overlap at the corners: a seam would look like a surface from inside.
  const Prism along_y = block(Vec3(half_bar, half_plate, half_thickness));
  const Prism along_x = block(Vec3(half_plate, half_bar, half_thickness));
  return {moving(uri, along_y, place(-at, 0.0, -half_thickness)),
          moving(uri, along_y, place(at, 0.0, -half_thickness)),
          moving(uri, along_x, place(0.0, -at, -half_thickness)),
          moving(uri, along_x, place(0.0, at, -half_thickness))};
}

std::vector<Part> layers(const Uri& uri) {
  const double half_thickness = 0.001;
  return {
      moving(uri, block(Vec3(0.060, 0.150, half_thickness)), place(-0.060, 0.0, -half_thickness)),
      resting(HalfSpace{}, place(0.0, 0.0, -length(uri, "separation", 0.020)))};
}

std::vector<Part> occluder(const Uri& uri) {
  Motion sweep;
  sweep.direction = Vec3::UnitX();
  sweep.stroke = 0.6;
  sweep.frequency = 0.5;
  return {resting(HalfSpace{}, Eigen::Isometry3d::Identity()),
          moving(uri, Capsule{length(uri, "radius", 0.035), 0.150},
                 place(-0.3, 0.0, length(uri, "height", 0.150)), sweep)};
}

// A table on the floor; its top is z = 0. What stands on it reaches a little into it: a seam would
// look like a surface from inside.
constexpr double sunk = 0.020;

std::vector<Part> table() {
  return {resting(block(Vec3(0.60, 0.45, 0.02)), place(0.0, 0.0, -0.02)),
          resting(HalfSpace{}, place(0.0, 0.0, -0.72))};
}

// The ramp and the box of Fig. 15.
void add_ramp_and_box(std::vector<Part>& parts) {
  parts.push_back(
      resting(Prism{{Vec2(0.0, -sunk), Vec2(0.20, -sunk), Vec2(0.20, 0.08), Vec2(0.0, 0.0)}, 0.06},
              place(-0.24, 0.08, 0.0)));
  parts.push_back(resting(block(Vec3(0.05, 0.05, 0.5 * (0.07 + sunk))),
                          place(0.08, 0.08, 0.5 * (0.07 - sunk))));
}

std::vector<Part> desk(const Uri& uri) {
  std::vector<Part> parts = table();
  add_ramp_and_box(parts);
  const double radius = 0.035;
  parts.push_back(moving(uri, Sphere{radius}, place(0.02, -0.08, radius)));
  const Eigen::Isometry3d upright(Eigen::AngleAxisd(pi / 2.0, Vec3::UnitX()));
  parts.push_back(resting(Cylinder{0.03, 0.5 * (0.06 + sunk)},
                          place(0.22, 0.03, 0.5 * (0.06 - sunk)) * upright));
  // A washboard: ridges 4 mm high, 12 mm apart.
  const int ridges = 9;
  const double pitch = 0.012;
  std::vector<Vec2> outline{Vec2(0.0, -sunk), Vec2(ridges * pitch, -sunk)};
  for (int i = ridges; i >= 0; --i) {
    outline.emplace_back(i * pitch, 0.008);
    if (i > 0) outline.emplace_back((i - 0.5) * pitch, 0.012);
  }
  parts.push_back(resting(Prism{std::move(outline), 0.04}, place(-0.20, -0.10, 0.0)));
  return parts;
}

std::vector<Part> moving_desk(const Uri& uri) {
  std::vector<Part> parts = table();
  add_ramp_and_box(parts);
  Motion bob;
  bob.stroke = 0.020;
  parts.push_back(moving(uri, block(Vec3(0.08, 0.06, 0.04)), place(0.0, -0.08, 0.0), bob));
  return parts;
}

struct Row {
  SceneInfo info;
  std::array<std::string_view, 3> options;  // its own, besides those of every scene
  std::vector<Part> (*build)(const Uri&);
};

constexpr std::array rows{
    Row{{"plane", "the plane z = 0"}, {}, plane},
    Row{{"tilt", "a plane through the origin that rises along x"}, {"slope"}, tilt},
    Row{{"sphere", "a ball whose top is the origin"}, {"radius"}, sphere},
    Row{{"cylinder", "a lying rod along y whose top passes the origin"},
        {"radius", "length"},
        cylinder},
    Row{{"finger", "a thin lying rod with round ends"}, {"radius", "length"}, finger},
    Row{{"box", "a cube, its top face about the origin"}, {"edge"}, box},
    Row{{"thin-plate", "a plate of 2 mm"}, {"edge", "thickness"}, thin_plate},
    Row{{"wedge", "a convex or concave edge along y through the origin"}, {"angle", "edge"}, wedge},
    Row{{"triangle-wave", "ridges along y, higher and higher along x (5.3)"},
        {"period", "extent", "height"},
        triangle_wave},
    Row{{"relief", "sine waves along x, 3 mm high and 10 mm long"}, {"height", "length"}, relief},
    Row{{"gap", "two plates with a slit along y between them"}, {"width", "thickness"}, gap},
    Row{{"hole", "a plate with a square hole"}, {"width", "thickness"}, hole},
    Row{{"layers", "the edge of a plate above a resting plane"}, {"separation"}, layers},
    Row{{"occluder", "an arm that sweeps along x above a resting plane"},
        {"radius", "height"},
        occluder},
    Row{{"desk", "a ramp and a box as in Fig. 15, a ball (which can move), a can, a washboard"},
        {},
        desk},
    Row{{"moving", "a desk with a slab that bobs at 1 Hz, 20 mm from end to end"}, {}, moving_desk},
};

const Row& find_row(std::string_view name) {
  std::vector<std::string_view> names;
  for (const Row& row : rows) {
    if (row.info.name == name) return row;
    names.push_back(row.info.name);
  }
  throw Error("synthetic:" + std::string(name), "there is no such scene",
              did_you_mean(name, names));
}

}  // namespace

bool Motion::rests() const {
  return speed == 0.0 && acceleration == 0.0 &&
         (frequency == 0.0 || (stroke == 0.0 && swing == 0.0));
}

Eigen::Isometry3d Motion::at(double t) const {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const double elapsed = t - start;
  if (!(elapsed > 0.0) || rests()) return pose;
  const double phase = 2.0 * std::numbers::pi * frequency * elapsed;
  const double shift =
      elapsed * (speed + 0.5 * acceleration * elapsed) + 0.5 * stroke * (1.0 - std::cos(phase));
  if (swing != 0.0)
    pose.linear() = Eigen::AngleAxisd(swing * std::sin(phase), axis).toRotationMatrix();
  pose.translation() = pivot - pose.linear() * pivot + shift * direction;
  return pose;
}

Vec3 Motion::velocity(const Vec3& point, double t) const {
  const double elapsed = t - start;
  if (!(elapsed > 0.0) || rests()) return Vec3::Zero();
  const double rate = 2.0 * std::numbers::pi * frequency;
  const double phase = rate * elapsed;
  const double shift_rate = speed + acceleration * elapsed + 0.5 * stroke * rate * std::sin(phase);
  const Vec3 turn_rate = swing * rate * std::cos(phase) * axis;
  const Vec3 pivot_now = at(t) * pivot;
  return shift_rate * direction + turn_rate.cross(point - pivot_now);
}

Scene::Scene(std::vector<Part> parts) : parts_(std::move(parts)) {
  if (parts_.empty()) throw Error("scene", "it has no part", "give at least one");
}

std::optional<double> Scene::cast(const Vec3& origin, const Vec3& direction, double t) const {
  std::array<double, 1> along{std::numeric_limits<double>::infinity()};
  for (const Part& part : parts_) {
    const Eigen::Isometry3d part_from_world = part.pose(t).inverse();
    const std::array<Vec3, 1> turned{part_from_world.linear() * direction};
    palpate::cast(part.shape, part_from_world * origin, turned, along);
  }
  if (!std::isfinite(along[0])) return std::nullopt;
  return along[0];
}

SurfacePoint Scene::nearest(const Vec3& point, double t) const {
  SurfacePoint best{};
  best.distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Eigen::Isometry3d world_from_part = parts_[i].pose(t);
    const Nearest local = palpate::nearest(parts_[i].shape, world_from_part.inverse() * point);
    if (local.distance < best.distance)
      best = {local.distance, world_from_part * local.point,
              world_from_part.linear() * local.normal, Vec3::Zero(), i};
  }
  best.velocity = parts_[best.part].motion.velocity(best.point, t);
  return best;
}

Scene make_scene(const Uri& uri) {
  std::vector<Part> parts = find_row(uri.path()).build(uri);
  if (uri.has("floor"))
    parts.push_back(resting(HalfSpace{}, place(0.0, 0.0, -length(uri, "floor", 0.0))));
  return Scene(std::move(parts));
}

std::span<const SceneInfo> known_scenes() {
  static const auto infos = [] {
    std::array<SceneInfo, rows.size()> copy{};
    std::transform(rows.begin(), rows.end(), copy.begin(), [](const Row& row) { return row.info; });
    return copy;
  }();
  return infos;
}

std::vector<std::string_view> scene_options(std::string_view name) {
  std::vector<std::string_view> options;
  for (const std::string_view own : find_row(name).options)
    if (!own.empty()) options.push_back(own);
  options.insert(options.end(), common_options.begin(), common_options.end());
  return options;
}

}  // namespace palpate
