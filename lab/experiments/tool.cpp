// SPDX-License-Identifier: Apache-2.0
// Tools with a shape at places where the truth is known, beside penalties of the same points.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/tool_bench.hpp"
#include "lab/statistics.hpp"

namespace palpate::lab {
namespace {

constexpr double period = 1e-3;      // [s] of a tick
constexpr double come_down = 1.5;    // [s] above the surface and down
constexpr double rest_from = 3.5;    // [s] from when force and noise are measured
constexpr double rested_time = 6.0;  // [s] a case lasts
constexpr double above = 0.03;       // [m] where a hand begins
constexpr double pressed = 5e-3;     // [m]
constexpr double is_behind = 5e-3;   // [m] behind the true surface: no noise is so large
constexpr double usual_tilt = 0.3;   // [rad] of the camera
constexpr double quarter = std::numbers::pi / 4;

struct PressCase {
  std::string name, tool;
  std::vector<Part> parts;
  HandPose end;       // where the hand presses the tool to
  double half;        // [m] half of the tool's length
  double tilt = 0.0;  // [rad] of the camera
  [[nodiscard]] bool is_peg() const { return name.starts_with("peg"); }
};

PressCase box_case(const std::string& name, const Vec3& turn) {
  const std::string box = "box:40x20x5mm";
  double lowest = 0.0;
  const auto shape = make_tool(box, {});
  for (const auto& point : shape->points())
    lowest = std::min(lowest, (rotation_by(turn) * point.at).z());
  const HandPose end{{0, 0, -lowest - pressed}, rotation_by(turn)};
  return {name, box, {part(HalfSpace{})}, end, 20e-3, usual_tilt};
}

// A plate with a round hole: a ring of blocks, which a camera above sees as one.
std::vector<Part> hole(double radius) {
  constexpr int blocks = 24;
  constexpr double thick = 0.04;  // [m]
  const double half = 0.15 * std::tan(std::numbers::pi / blocks);
  std::vector<Part> parts{part(HalfSpace{})};
  for (int i = 0; i < blocks; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / blocks;
    const Vec3 middle = (radius + 0.07) * Vec3(std::cos(angle), std::sin(angle), 0);
    parts.push_back(part(block({0.07, half, 0.5 * thick}), middle + 0.5 * thick * Vec3::UnitZ(),
                         {0, 0, angle}));
  }
  return parts;
}

std::vector<PressCase> press_cases() {
  std::vector<PressCase> cases{box_case("flat", {0, 0, 0}), box_case("edge", {0, 0.3, 0}),
                               box_case("corner", {0.25, 0.3, 0})};
  // Two planes of 90 degrees, across a box and along a capsule; each lies on both at its height.
  const auto valley = [](const Vec3& axis) {
    return std::vector<Part>{part(HalfSpace{}, Vec3::Zero(), quarter * axis),
                             part(HalfSpace{}, Vec3::Zero(), -quarter * axis)};
  };
  const auto down_to = [](double height) {
    return HandPose{{0, 0, height - pressed}, Rotation::Identity()};
  };
  cases.push_back({"concave", "box:40x20x5mm", valley(Vec3::UnitY()), down_to(22.5e-3), 20e-3});
  cases.push_back({"groove", "capsule:60x12mm", valley(Vec3::UnitX()),
                   down_to(6e-3 * std::numbers::sqrt2), 30e-3});
  for (const int clearance : {1, 2, 5}) {  // [mm] of the diameter
    // 15 mm deep in the middle of the hole, then to the side and `pressed` farther than it gives.
    const double room = 0.5e-3 * clearance;
    const HandPose end{{room + pressed, 0, 0.055}, rotation_by({0, 2.0 * quarter, 0})};
    cases.push_back(
        {fmt::format("peg-{}mm", clearance), "cylinder:60x20mm", hole(10e-3 + room), end, 30e-3});
  }
  return cases;
}

HandPose hand_at(const PressCase& one, double t) {
  HandPose hand = one.end;
  hand.position.z() += above * std::clamp(2.0 * (1.0 - t / come_down), 0.0, 1.0);
  if (one.is_peg()) hand.position.x() *= std::clamp((t - come_down - 0.3) / 0.5, 0.0, 1.0);
  return hand;
}

// The pose of least energy outside the true bodies, found in another way than the method's: all
// points of the shell push on the true surfaces in turn, again and again (Hildreth 1957).
HandPose rested(const Scene& scene, const ToolShape& shape, const HandPose& hand, HandPose pose) {
  const double length = shape.turn_length();
  constexpr double stride = 2e-3;  // [m] so that surfaces are straight over a step
  struct Push {
    Motion6 way;
    double least, push;
  };
  for (int round = 0; round < 40; ++round) {
    std::vector<Push> pushes;
    for (const auto& point : shape.points()) {
      const Vec3 lever = pose.orientation * point.at;
      const SurfacePoint near = scene.nearest(pose.position + lever, 0.0);
      if (near.distance > stride) continue;
      Motion6 way = Motion6::Zero();
      way << near.normal, lever.cross(near.normal) / length;
      pushes.push_back({way, -near.distance, 0.0});
    }
    Motion6 x;
    x << hand.position - pose.position,
        length * rotation_vector(hand.orientation * pose.orientation.conjugate());
    for (int sweep = 0; sweep < 400; ++sweep) {
      for (Push& each : pushes) {
        const double missing = (each.least - each.way.dot(x)) / each.way.squaredNorm();
        const double more = std::max(missing, -each.push);
        each.push += more;
        x += more * each.way;
      }
    }
    const double size = x.norm();
    if (size > stride) x *= stride / size;
    pose.position += x.head<3>();
    pose.orientation = rotation_by(x.tail<3>() / length) * pose.orientation;
    if (size < 1e-8) break;
  }
  return pose;
}

// What was felt while the hand rested, and how long the tool was behind in one go.
struct Felt {
  std::vector<double> force, torque;  // [N] upwards, [N m] its size
  Wrench sum;
  double longest = 0.0;  // [s]
};

Felt play(const PressCase& one, const ToolShape& shape, SyntheticCamera& camera, Method& method) {
  Felt felt;
  double behind = 0.0;  // [s]
  std::uint64_t frames = 0;
  Frame frame;
  for (int i = 0; i < static_cast<int>(std::lround(rested_time / period)); ++i) {
    const double t = i * period;
    const HandPose hand = hand_at(one, t);
    const double due = static_cast<double>(frames) / camera.setup().frame_rate;
    if (t >= due - 1e-9) {
      frame = camera.capture(due, frames++);
      method.observe({*frame.cloud, frame.stamp});
    }
    const Tick tick = method.tick(hand, t);
    bool inside = false;
    for (std::size_t k = 0; k < shape.points().size() && t >= 1.0 && !inside; k += 10) {
      const Vec3 at = tick.proxy + tick.proxy_orientation * shape.points()[k].at;
      inside = camera.scene().signed_distance(at, t) < -is_behind;
    }
    behind = inside ? behind + period : 0.0;
    felt.longest = std::max(felt.longest, behind);
    if (t < rest_from) continue;
    felt.force.push_back(tick.force.z());
    felt.torque.push_back(tick.torque.norm());
    felt.sum.force += tick.force;
    felt.sum.torque += tick.torque;
  }
  return felt;
}

std::string row_of(const PressCase& one, const std::string& sensor, std::string_view method,
                   std::uint64_t seed) {
  const Scene scene(one.parts);
  CameraSetup setup;
  setup.world_from_camera = looking_at_origin(0.45, one.tilt, 0.0);
  SensorModel model = SensorModel::named(sensor);
  model.seed = seed;
  SyntheticCamera camera(scene, setup, model);
  const auto shape = make_tool(one.tool, {});
  const Felt felt = play(one, *shape, camera, *make_tool_method(method, shape));
  const HandPose hand = hand_at(one, rested_time);
  HandPose start = hand;
  if (one.is_peg())
    start.position.x() = 0.0;
  else
    start.position.z() += above;
  const HandPose truth = rested(scene, *shape, hand, start);
  const double k = Coupling{}.stiffness;
  const Vec3 force = k * (truth.position - hand.position);
  const Vec3 torque = k * shape->turn_length() * shape->turn_length() *
                      rotation_vector(truth.orientation * hand.orientation.conjugate());
  const auto count = static_cast<double>(felt.force.size());
  return csv_row(one.name, sensor, method, seed, force.norm(), torque.norm(),
                 (felt.sum.force / count - force).norm() / (k * pressed),
                 (felt.sum.torque / count - torque).norm() / (k * pressed * one.half),
                 felt_rms(felt.force), felt_rms(felt.torque), felt.longest);
}

std::vector<Cell> tool_cells(const Experiment& /*experiment*/, const ExperimentOptions& options) {
  const std::vector<PressCase> cases = press_cases();
  check_families(options, "tool has no such case", names_of(cases));
  std::vector<Cell> cells;
  for (const PressCase& one : cases) {
    if (!options.wants(one.name)) continue;
    for (const char* sensor : {"ideal", "d4xx"}) {
      const bool repeats = std::string_view(sensor) != "ideal";
      for (int i = 0; i < (repeats ? options.cases.value_or(3) : 1); ++i)
        for (const std::string_view method : tool_methods)
          cells.emplace_back([=, seed = options.seed + static_cast<std::uint64_t>(i)] {
            return row_of(one, sensor, method, seed);
          });
    }
  }
  return cells;
}

Scores tool_scores(const Table& table) {
  return scores_by(
      table, {"case", "camera", "method"},
      {shown("force error [%]", {"force_error"}, "{:.2f}", 100.0, mean),
       shown("torque error [%]", {"torque_error"}, "{:.2f}", 100.0, mean),
       shown("force noise [mN]", {"force_noise"}, "{:.2f}", 1e3, mean),
       shown("torque noise [mN m]", {"torque_noise"}, "{:.2f}", 1e3, mean),
       shown("longest behind [ms]", {"behind"}, "{:.0f}", 1e3, largest)},
      "Means over seeds; of the last column the largest. Errors in percent of stiffness times "
      "depth, and of that times half of the tool's length. docs/tools.md.");
}

}  // namespace

Experiment tool_experiment() {
  return {
      .name = "tool",
      .summary = "tools with a shape against the truth: force, torque, noise; beside penalties",
      .header =
          "case,camera,method,seed,force,torque,force_error,torque_error,force_noise,torque_noise,"
          "behind",
      .cells = tool_cells,
      .scores = tool_scores};
}

}  // namespace palpate::lab
