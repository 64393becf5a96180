// SPDX-License-Identifier: Apache-2.0
// Two RealSense D4xx, 40 degrees apart, above a plane at rest, and a hand 8 mm in it: what each
// camera alone makes of it, and both together.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/sensor.hpp"

namespace palpate::lab {
namespace {

constexpr double radians = std::numbers::pi / 180.0;  // of a degree
constexpr double interval = 1.0 / 30.0;               // [s] between a camera's frames
constexpr double half_angle = 20.0 * radians;         // of a camera from the plane's normal
constexpr double begin_height = 0.02;                 // [m] of the hand
constexpr double speed = 0.05;                        // [m/s] of the hand
constexpr double down = 0.5;                          // [s] when it begins to press
constexpr double depth = 8e-3;                        // [m] of the hand in the plane
constexpr double settled = 2.5;                       // [s] when every camera's memory is full
constexpr double blind = 3.0;                         // [s] when a camera is covered, if it is
constexpr double cover = 0.2;                         // [m] from the plane to what covers it
constexpr double duration = 4.5;                      // [s]
constexpr int usual_seeds = 10;

struct Rig {
  std::string_view name;
  std::array<double, 2> distance = {0.7, 0.7};  // [m]
  double late = 0.5 * interval;                 // [s] of the second camera's frames
  double pose_error = 0.0;                      // [m] the second camera is taken to be higher
  bool is_blinded = false;                      // the first camera, after a while
};
constexpr std::array<Rig, 5> rigs{{{.name = "in-turn"},
                                   {.name = "at-once", .late = 0.0},
                                   {.name = "near-far", .distance = {0.7, 0.95}},
                                   {.name = "3mm-apart", .pose_error = 3e-3},
                                   {.name = "one-blinded", .is_blinded = true}}};

struct Rest {
  double sum = 0.0, squares = 0.0, count = 0.0;  // of the force [N]
  double step = 0.0;                             // [N] largest from tick to tick
  double last = 0.0;                             // [N]
  bool is_hidden = false;                        // at some time

  void add(const Tick& tick, bool at_rest) {
    const double force = tick.force.norm();
    if (at_rest) {
      sum += force;
      squares += force * force;
      ++count;
      step = std::max(step, std::abs(force - last));
      is_hidden |= (tick.flags & surface_hidden) != 0;
    }
    last = force;
  }
  [[nodiscard]] double mean() const { return sum / count; }
  [[nodiscard]] double rms() const {
    return std::sqrt(std::max(squares / count - mean() * mean(), 0.0));
  }
};

// Pixels as a D4xx has them, around the contact.
SyntheticCamera camera_of(const Rig& rig, std::size_t number, std::uint64_t seed) {
  CameraSetup setup;
  setup.intrinsics = pinhole(200, 200, 2.0 * std::atan(100.0 / 589.0));
  setup.world_from_camera =
      looking_at_origin(rig.distance[number], half_angle, number == 0 ? 0.0 : std::numbers::pi);
  SensorModel sensor = SensorModel::named("d4xx");
  sensor.seed = seed;
  return {make_scene(Uri("synthetic:plane")), setup, sensor};
}

std::shared_ptr<const Cloud> raised(const DepthImage& image, double height) {
  auto higher = std::make_shared<DepthImage>(image);
  Eigen::Isometry3d pose = image.world_from_camera();
  pose.translation().z() += height;
  higher->set_world_from_camera(pose);
  return higher;
}

std::string rig_row(const Rig& rig, const std::string& name, const ExperimentOptions& options) {
  constexpr std::array<SensorKind, 1> kinds{SensorKind::stereo};
  const Parameters parameters = for_sensors(options.parameters, kinds);
  std::array<Rest, 3> felt;  // the first camera alone, the second alone, both
  for (int i = 0; i < options.cases.value_or(usual_seeds); ++i) {
    const std::uint64_t seed = 2 * (options.seed + static_cast<std::uint64_t>(i));
    std::array<SyntheticCamera, 2> cameras = {camera_of(rig, 0, seed), camera_of(rig, 1, seed + 1)};
    std::array<std::unique_ptr<Method>, 3> methods;
    for (auto& method : methods) {
      method = make_method(name, {parameters, flat_truth()});
      method->seat({0.0, 0.0, begin_height});
    }
    std::array<std::shared_ptr<const Cloud>, 2> in_use;  // each camera's newest, which must live
    std::array<std::uint64_t, 2> next{};
    for (int tick = 0; tick * 1e-3 < duration; ++tick) {
      const double t = tick * 1e-3;
      for (std::size_t c = 0; c < 2; ++c) {
        const double stamp = static_cast<double>(next[c]) * interval + (c == 1 ? rig.late : 0.0);
        if (stamp > t) continue;
        std::shared_ptr<const Cloud> cloud = cameras[c].capture(stamp, next[c]++).cloud;
        if (c == 1 && rig.pose_error != 0.0) cloud = raised(*cloud->image(), rig.pose_error);
        if (c == 0 && rig.is_blinded && stamp >= blind) cloud = raised(*cloud->image(), cover);
        methods[c]->observe({*cloud, stamp});
        methods[2]->observe({*cloud, stamp, c});
        in_use[c] = cloud;
      }
      const Vec3 hip(0.0, 0.0, std::clamp(begin_height - speed * (t - down), -depth, begin_height));
      for (std::size_t m = 0; m < methods.size(); ++m)
        felt[m].add(methods[m]->tick(hip, t), t >= settled);
    }
  }
  // Of two independent estimates, weighed by their variances.
  const double weighed = 1.0 / std::hypot(1.0 / felt[0].rms(), 1.0 / felt[1].rms());
  return csv_row(name, rig.name, felt[0].rms(), felt[1].rms(), felt[2].rms(), weighed, felt[0].step,
                 felt[1].step, felt[2].step, felt[2].mean(), felt[0].is_hidden, felt[2].is_hidden);
}

std::vector<Cell> cameras_cells(const Experiment& experiment, const ExperimentOptions& options) {
  check_families(options, "cameras has no such rig", names_of(rigs));
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options))
    for (const Rig& rig : rigs)
      if (options.wants(rig.name)) cells.emplace_back([=] { return rig_row(rig, name, options); });
  return cells;
}

Scores cameras_scores(const Table& table) {
  return scores_by(
      table, {"rig", "method"},
      {shown("first", {"first"}, "{:.4f}"), shown("second", {"second"}, "{:.4f}"),
       shown("both [N rms]", {"both"}, "{:.4f}"), shown("weighed", {"weighed"}, "{:.4f}"),
       shown("steps", {"first_step", "second_step", "both_step"}, "{:.3f}")},
      "Force of a hand at rest with each of two cameras alone and with both; what two independent "
      "estimates have, weighed by their variances; the largest steps from tick to tick [N]. Pooled "
      "over the seeds.");
}

}  // namespace

Experiment cameras_experiment() {
  return {.name = "cameras",
          .summary = "a hand at rest before two cameras, compared with each of them alone",
          .header =
              "method,rig,first,second,both,weighed,first_step,second_step,both_step,mean,"
              "first_hidden,hidden",
          .default_methods = {"direct", "sight"},
          .cells = cameras_cells,
          .scores = cameras_scores};
}

}  // namespace palpate::lab
