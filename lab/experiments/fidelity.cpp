// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/pop.hpp"
#include "lab/grid_cloud.hpp"
#include "lab/method.hpp"
#include "lab/play.hpp"
#include "lab/statistics.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"

namespace palpate::lab {
namespace {

constexpr double press = 0.010;  // [m] the hand is that far below the true surface

// How often a scene is repeated with other noise: --grid NxM, white and the camera's.
std::pair<int, int> repeats_of(const ExperimentOptions& options) {
  return options.grid.value_or(std::pair{20, 20});
}

// Measures, their scenes and their aims (upper bounds).
using Measure = FidelityMeasure;
constexpr std::array measures = {
    Measure{"white-1mm", "rms", "mm", 0.05},
    Measure{"white-1mm", "bias", "mm", 0.02},
    Measure{"white-1mm", "normal", "deg", 0.5},
    Measure{"white-1mm", "lost", "%", 0.0},
    Measure{"correlated-1mm", "rms", "mm", 0.15},
    Measure{"correlated-1mm", "lost", "%", 0.0},
    Measure{"real-0.45m", "rms", "mm", 0.15},
    Measure{"real-0.45m", "felt", "N", 0.02},
    Measure{"real-0.45m", "lost", "%", 0.0},
    Measure{"real-0.7m", "rms", "mm", 0.3},
    Measure{"real-0.7m", "felt", "N", 0.02},
    Measure{"real-0.7m", "lost", "%", 0.0},
    Measure{"real-0.95m", "rms", "mm", 0.6},
    Measure{"real-0.95m", "felt", "N", 0.02},
    Measure{"real-0.95m", "lost", "%", 0.0},
    Measure{"moving-0.95m", "rms", "mm", 6.0},
    Measure{"moving-0.95m", "lag", "frames", 2.0},
    Measure{"moving-0.95m", "lost", "%", 0.0},
    Measure{"sphere-0.45m", "rms", "mm", std::nullopt},
    Measure{"sphere-0.45m", "lost", "%", 0.0},
    Measure{"sphere-0.7m", "rms", "mm", std::nullopt},
    Measure{"sphere-0.7m", "lost", "%", 0.0},
    Measure{"quiet-plane", "largest", "mm", 0.005},
    Measure{"quiet-relief", "rms", "mm", 0.1},
    Measure{"sine", "rms", "N", 0.05},
    Measure{"sine", "step", "N/ms", 0.03},
};

std::string rows_of(std::string_view method, std::string_view scene,
                    const std::vector<std::pair<std::string_view, double>>& values) {
  std::string rows;
  for (const Measure& measure : measures) {
    if (measure.scene != scene) continue;
    for (const auto& [name, value] : values) {
      if (name != measure.name) continue;
      rows += csv_row(method, scene, measure.name, measure.unit,
                      measure.aim ? csv_field(*measure.aim) : "-", value);
    }
  }
  return rows;
}

struct Watched {
  std::vector<double> error;   // [m] from the true surface to the contact, along its normal
  std::vector<double> normal;  // [rad] between the tick's normal and the true one
  double felt = 0.0;           // [N] sum over the repeats
  int lost = 0;
  int repeats = 0;
};

// Plays a scenario to a method from free space into contact and watches the seconds from `from` on.
// A surface is lost where the proxy's centre stays behind it; that ends the repeat, and what was
// seen of it before it went behind counts.
// @param seat  of the proxy, if not where the hand is
void watch(const std::string& name, const ExperimentOptions& options, const Scenario& scenario,
           const Truth& truth, double from, Watched& watched,
           const std::optional<Vec3>& seat = std::nullopt) {
  const double r_c = options.parameters.proxy.r_c();
  const auto method = make_method(name, {options.parameters, truth}, options.own_methods);
  if (seat) method->seat(*seat);
  std::vector<double> force;
  int behind = 0;
  std::size_t before = watched.error.size();  // samples when it was last in front
  bool lost = false;
  play(*method, scenario, [&](const Tick& tick) {
    const TruePoint under = truth(tick.proxy, tick.t);
    behind = under.distance < 0.0 ? behind + 1 : 0;
    if (behind == 0) before = watched.error.size();
    lost = behind > patience * scenario.tick_rate;
    if (lost) return false;
    if (tick.t < from) return true;
    watched.error.push_back(under.distance - r_c);
    if (tick.normal.norm() > 0.5)
      watched.normal.push_back(std::acos(std::clamp(tick.normal.dot(under.normal), -1.0, 1.0)));
    force.push_back(tick.force.dot(under.normal));
    return true;
  });
  ++watched.repeats;
  if (lost) {
    ++watched.lost;
    watched.error.resize(before);
  } else {
    watched.felt += felt_rms(force);
  }
}

// A case that was lost in every repeat has no other figure.
std::vector<std::pair<std::string_view, double>> summary(const Watched& watched) {
  const int held = watched.repeats - watched.lost;
  std::vector<std::pair<std::string_view, double>> values = {
      {"lost", 100.0 * watched.lost / watched.repeats}};
  if (held == 0) return values;
  values.emplace_back("rms", 1e3 * rms(watched.error));
  values.emplace_back("bias", 1e3 * std::abs(mean(watched.error)));
  values.emplace_back("normal", mean(watched.normal) * 180.0 / std::numbers::pi);
  values.emplace_back("felt", watched.felt / held);
  return values;
}

// A resting plane of points under 1 mm of noise, watched for a second after 0.2 s.
std::string rest_on_grid(const std::string& name, const ExperimentOptions& options,
                         std::string_view scene, Noise noise) {
  const int repeats = repeats_of(options).first;
  const double r_c = options.parameters.proxy.r_c();
  Watched watched;
  for (int k = 0; k < repeats; ++k) {
    GridCloud grid = level_grid(r_c, 0.06);
    grid.sigma = 1e-3;
    grid.noise = noise;
    grid.seed = options.seed * 1000 + static_cast<std::uint64_t>(k);
    const Vec3 hip(0.1 * r_c, 0.1 * r_c, -press);
    watch(name, options, over_grid(grid, 1.2, [&](double) { return hip; }), flat_truth(), 0.2,
          watched, Vec3(hip.x(), hip.y(), 4.0 * r_c));
  }
  return rows_of(name, scene, summary(watched));
}

// A D4xx straight above the surface, with its focal length but only the pixels near the contact.
SyntheticCamera look_at(const Scene& scene, double distance, std::uint64_t seed) {
  CameraSetup setup;
  const int pixels = std::min(320, static_cast<int>(0.3 * 589.0 / distance));
  setup.intrinsics = pinhole(pixels, pixels, 2.0 * std::atan(0.5 * pixels / 589.0));
  setup.world_from_camera = looking_at_origin(distance, 0.0, 0.0);
  setup.frame_rate = f_c;
  SensorModel sensor = SensorModel::named("d4xx");
  sensor.seed = seed;
  return {scene, setup, sensor};
}

Scenario seen_by(SyntheticCamera& camera, double duration, std::function<double(double t)> height) {
  return {.duration = duration,
          .cloud = [&](std::uint64_t frame, double t) { return camera.capture(t, frame).cloud; },
          .hip = [height = std::move(height)](double t) { return Vec3(0.0, 0.0, height(t)); }};
}

// How far above the surface a hand is that comes down to it at 0.15 m/s: in contact after 0.4 s.
constexpr double contact_time = 0.4;  // [s]
double coming_down(double t) { return std::max(0.15 * (contact_time - t), -press); }

// Something at rest under a real camera's noise, watched for a second after a second of contact.
std::string rest_in_sight(const std::string& name, const ExperimentOptions& options,
                          std::string_view scene_name, const std::string& uri, double distance) {
  const int repeats = repeats_of(options).second;
  const auto scene = std::make_shared<const Scene>(make_scene(Uri(uri)));
  const Truth truth = truth_of(scene);
  Watched watched;
  for (int k = 0; k < repeats; ++k) {
    SyntheticCamera camera =
        look_at(*scene, distance, options.seed * 1000 + static_cast<std::uint64_t>(k));
    watch(name, options, seen_by(camera, contact_time + 2.0, coming_down), truth,
          contact_time + 1.0, watched);
  }
  return rows_of(name, scene_name, summary(watched));
}

// A plane at 0.95 m that rests for 1.5 s and then comes or goes at 0.1 m/s; half of the repeats
// each.
std::string move_in_sight(const std::string& name, const ExperimentOptions& options,
                          std::string_view scene_name) {
  const int repeats = 2 * repeats_of(options).second;
  constexpr double duration = 2.2;
  Watched watched;
  const auto ticks = static_cast<std::size_t>(duration * 1000.0);
  std::vector<double> lag(ticks, 0.0);  // [frames] summed, by time since the onset
  std::vector<int> counted(ticks, 0);
  for (int k = 0; k < repeats; ++k) {
    const double speed = k % 2 == 0 ? 0.1 : -0.1;
    const double start = 1.5 + k / (repeats * f_c);
    const auto scene = std::make_shared<const Scene>(
        make_scene(Uri(fmt::format("synthetic:plane?start={}&speed={}", start, speed))));
    const auto hand = [=](double t) { return speed * std::max(t - start, 0.0) + coming_down(t); };
    SyntheticCamera camera =
        look_at(*scene, 0.95, options.seed * 1000 + static_cast<std::uint64_t>(k));
    const std::size_t before = watched.error.size();
    watch(name, options, seen_by(camera, duration, hand), truth_of(scene), start, watched);
    for (std::size_t i = before; i < watched.error.size(); ++i) {
      lag[i - before] -= watched.error[i] / speed * f_c;
      ++counted[i - before];
    }
  }
  // The noise of single repeats does not count as lag: means over all, and over a frame.
  std::vector<double> means;
  for (std::size_t i = 0; i < ticks && counted[i] == repeats - watched.lost && counted[i] > 0; ++i)
    means.push_back(lag[i] / counted[i]);
  const auto frame = static_cast<std::size_t>(std::lround(1000.0 / f_c));
  double largest = 0.0;
  for (std::size_t i = 0; i + frame <= means.size(); i += frame) {
    double sum = 0.0;
    for (std::size_t j = i; j < i + frame; ++j) sum += means[j];
    largest = std::max(largest, sum / static_cast<double>(frame));
  }
  std::vector<std::pair<std::string_view, double>> values = summary(watched);
  // Nothing held, nothing known of its lag.
  if (!means.empty()) values.emplace_back("lag", largest);
  return rows_of(name, scene_name, values);
}

// Along a plane without noise, at 0.05 m/s for two seconds, askew to its grid.
std::string slide_on_plane(const std::string& name, const ExperimentOptions& options,
                           std::string_view scene) {
  const double r_c = options.parameters.proxy.r_c();
  GridCloud grid = level_grid(r_c, 0.12);
  const auto hip = [&](double t) {
    const double x = 0.05 * (t - 1.0);
    return Vec3(x, 0.1 * x + 0.1 * r_c, -press);
  };
  Watched watched;
  watch(name, options, over_grid(grid, 2.0, hip), flat_truth(), 0.5, watched,
        hip(0.0) + Vec3(0.0, 0.0, press + 4.0 * r_c));
  for (double& error : watched.error) error = std::abs(error);
  return rows_of(name, scene, {{"largest", 1e3 * largest(watched.error)}});
}

// Over sine waves 3 mm high and 10 mm long without noise, across them at 0.02 m/s.
std::string slide_on_relief(const std::string& name, const ExperimentOptions& options,
                            std::string_view scene_name) {
  const double r_c = options.parameters.proxy.r_c();
  const auto scene = std::make_shared<const Scene>(make_scene(Uri("synthetic:relief")));
  GridCloud grid = level_grid(r_c, 0.08);
  grid.height = [](double x, double) { return 1.5e-3 * std::sin(200.0 * std::numbers::pi * x); };
  const auto hip = [&](double t) { return Vec3(0.02 * (t - 1.5), 0.1 * r_c, -press); };
  Watched watched;
  watch(name, options, over_grid(grid, 3.0, hip), truth_of(scene), 0.5, watched,
        hip(0.0) + Vec3(0.0, 0.0, press + 4.0 * r_c));
  return rows_of(name, scene_name, summary(watched));
}

// The largest step is that of the force's error: the true force itself changes by up to 0.038 N/ms.
std::string push_by_sine(const std::string& name, const ExperimentOptions& options,
                         std::string_view scene) {
  std::vector<double> error;
  double largest = 0.0;
  push_by_sine(name, options, [&](const Tick& tick, double /*height*/, double ideal) {
    error.push_back(tick.force.z() - ideal);
    if (error.size() > 1)
      largest = std::max(largest, std::abs(error.back() - error[error.size() - 2]));
  });
  return rows_of(name, scene, {{"rms", rms(error)}, {"step", largest}});
}

std::vector<Cell> fidelity_cells(const Experiment& experiment, const ExperimentOptions& options) {
  check_families(options, "fidelity has no such scene", fidelity_scenes());
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options)) {
    // What plays a scene gets the method, the options, the scene's name and more.
    const auto add = [&](const char* scene, auto play, auto... more) {
      if (options.wants(scene))
        cells.emplace_back([=] { return play(name, options, scene, more...); });
    };
    const std::string plane = "synthetic:plane";
    const std::string sphere = "synthetic:sphere?radius=40mm&floor=80mm";
    add("white-1mm", rest_on_grid, Noise::white);
    add("correlated-1mm", rest_on_grid, Noise::correlated);
    add("real-0.45m", rest_in_sight, plane, 0.45);
    add("real-0.7m", rest_in_sight, plane, 0.7);
    add("real-0.95m", rest_in_sight, plane, 0.95);
    add("moving-0.95m", move_in_sight);
    add("sphere-0.45m", rest_in_sight, sphere, 0.45);
    add("sphere-0.7m", rest_in_sight, sphere, 0.7);
    add("quiet-plane", slide_on_plane);
    add("quiet-relief", slide_on_relief);
    add("sine", push_by_sine);
  }
  return cells;
}

Scores fidelity_scores(const Table& table) {
  std::vector<AimLine> lines;
  for (const Measure& measure : measures)
    lines.push_back(
        {{{"scene", measure.scene}, {"measure", measure.name}}, measure.unit, measure.aim});
  return aim_scores(table, lines,
                    "* misses the aim; - popped through in every repeat. Measures: docs/pop.md.");
}

}  // namespace

std::span<const FidelityMeasure> fidelity_measures() { return measures; }

std::vector<std::string_view> fidelity_scenes() {
  std::vector<std::string_view> scenes;
  for (const Measure& measure : measures)
    if (scenes.empty() || scenes.back() != measure.scene) scenes.push_back(measure.scene);
  return scenes;
}

bool is_without_chance(std::string_view scene) {
  return scene == "quiet-plane" || scene == "quiet-relief" || scene == "sine";
}

Experiment fidelity_experiment() {
  return {.name = "fidelity",
          .summary = "accuracy of contact and force, compared with the aims",
          .header = "method,scene,measure,unit,aim,value",
          .default_methods = {"paper", "sight"},
          .cells = fidelity_cells,
          .scores = fidelity_scores,
          .has_grid = true,
          .plays_programs = true};
}

}  // namespace palpate::lab
