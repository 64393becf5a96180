// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/teleop.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate::lab {
namespace {

constexpr double distance = 0.7;  // [m] of the camera
constexpr double across = 0.2;    // [m] that it sees
constexpr double engaged = 2.5;   // [s] the chain's ramp is over, and frames have come at any delay
constexpr double above = 0.03;    // [m]
constexpr double pressed = 0.02;  // [m] beneath the surface: 2 N at a light grip's 100 N/m
constexpr double way_time = 0.5;  // [s] down and up again: 0.1 m/s
constexpr double hold = 2.0;      // [s]
constexpr double rest = 0.5;      // [s]
constexpr int presses = 3;
constexpr double top_speed = 0.06;   // [m/s] of surfaces
constexpr double bob_rate = 0.5;     // [Hz]
constexpr double settle_time = 1.0;  // [s] of a press, after which it is judged

constexpr std::array<std::string_view, 3> scenes = {"rest", "bob", "come"};
constexpr std::array<std::string_view, 2> sensors = {"ideal", "d4xx"};
constexpr std::array<double, 6> round_trips = {0.0, 0.02, 0.05, 0.1, 0.2, 0.5};  // [s]
constexpr double jitter = 0.03;                                                  // [s]
constexpr double loss = 0.05;                                                    // [-]

Motion motion_of(std::string_view name) {
  Motion motion;
  if (name == "bob") {
    motion.start = engaged;
    motion.frequency = bob_rate;
    motion.stroke = top_speed / (std::numbers::pi * bob_rate);
  } else if (name == "come") {
    motion.start = engaged + 0.5;
    motion.speed = top_speed;
  }
  return motion;
}

HipPath hand_of(std::string_view name, TeleopScene& scene) {
  const auto at = [](double height) { return Vec3(0.0, 0.0, height); };
  std::vector<HipPath::Sample> path = {{0.0, at(above)}, {engaged, at(above)}};
  if (name == "rest") {
    for (int i = 0; i < presses; ++i) {
      const double t = path.back().t;
      path.push_back({t + way_time, at(-pressed)});
      path.push_back({t + way_time + hold, at(-pressed)});
      path.push_back({t + 2.0 * way_time + hold, at(above)});
      path.push_back({t + 2.0 * way_time + hold + rest, at(above)});
      scene.marks.push_back(path.back().t);
    }
  } else {
    // Off the surface, which comes, and leads up to 2 N deep.
    const double height = name == "bob" ? 0.025 : 0.02;
    path.push_back({engaged + 0.4, at(height)});
    path.push_back({engaged + (name == "bob" ? 8.4 : 1.1), at(height)});
  }
  scene.duration = path.back().t;
  return HipPath(std::move(path));
}

LinkQuality link_of(double round_trip, bool poor) {
  const double delay = 0.5 * round_trip;
  if (!poor) return {.delay = delay};
  return {.delay = delay, .jitter = std::min(jitter, delay), .loss = loss};
}

std::string rows_of(std::string_view name, std::string_view sensor, std::string_view way,
                    const ExperimentOptions& options) {
  std::string rows;
  for (const double round_trip : round_trips) {
    for (const bool poor : {false, true}) {
      if (poor && round_trip == 0.0) continue;
      const TeleopCase one{.way = way,
                           .up = link_of(round_trip, poor),
                           .down = link_of(round_trip, poor),
                           .parameters = options.parameters,
                           .seed = options.seed};
      const TeleopFigures figures = play_teleop_case(teleop_scene(name, sensor, options.seed), one);
      rows += csv_row(way, name, sensor, 1e3 * round_trip, poor ? "poor" : "even", figures.force,
                      figures.most_force, 1e3 * figures.shake, 1e3 * figures.energy,
                      1e3 * figures.depth, figures.contact, 1e3 * figures.swing);
    }
  }
  return rows;
}

std::vector<Cell> teleop_cells(const Experiment& experiment, const ExperimentOptions& options) {
  check_families(options, "teleop has no such scene", scenes);
  std::vector<Cell> cells;
  std::vector<std::string> ways = options.methods;
  if (ways.empty())
    ways.assign(experiment.default_methods.begin(), experiment.default_methods.end());
  for (const std::string& way : ways) {
    const auto* const known_way = std::find(teleop_ways.begin(), teleop_ways.end(), way);
    if (known_way == teleop_ways.end())
      throw Error("--methods " + way, "teleop has no such coupling",
                  did_you_mean(way, teleop_ways));
    for (const std::string_view scene : scenes) {
      if (!options.wants(scene)) continue;
      for (const std::string_view sensor : sensors) {
        // Those without a camera have no sensor.
        if (*known_way != "palpate" && sensor != sensors.front()) continue;
        cells.emplace_back([=, way = *known_way] { return rows_of(scene, sensor, way, options); });
      }
    }
  }
  return cells;
}

// The worst over links with and without jitter and loss, by delay.
Scores teleop_scores(const Table& table) {
  // What only says something where the hand presses.
  const auto if_pressed = [](const Column& column) {
    return Column{column.title, [=](const Table& group) {
                    return group.number(0, "force") > 0.0 ? column.text(group) : "-";
                  }};
  };
  const auto most = [](std::string title, std::string_view column, std::string_view format) {
    return shown(std::move(title), {column}, format, 1.0, largest);
  };
  const auto range = [](const Table& group) {
    const std::vector<double> forces = group.numbers("force");
    const auto [low, high] = std::minmax_element(forces.begin(), forces.end());
    return fmt::format("{:.2f} to {:.2f}", *low, *high);
  };
  const auto worst = [](const Table& group) {
    double off = 0.0;
    for (const double force : group.numbers("force"))
      off = std::max(off, std::abs(force / group.number(0, "force") - 1.0));
    return fmt::format("{:.1f}", 100.0 * off);
  };
  return scores_by(
      table, {"way", "scene", "sensor"},
      {if_pressed({"force [N], 0 to 500 ms", range}), if_pressed({"worst, %", worst}),
       most("shake [mm]", "shake", "{:.3f}"), if_pressed(most("made [mJ]", "energy", "{:.2f}")),
       most("depth [mm]", "depth", "{:.2f}"), most("contact [N]", "contact", "{:.1f}"),
       if_pressed(most("tool's swing [mm]", "swing", "{:.2f}"))},
      "The worst of round trips from 0 to 500 ms, with and without jitter of 30 ms and 5 % loss. "
      "Worst, %: of the force against that without delay. Aims: 5 %, 0.05 mm, 0.1 mJ; depth 0.5 mm "
      "(rest), 1 mm (bob, come); 5 N. Measures: docs/teleop.md.");
}

}  // namespace

TeleopScene teleop_scene(std::string_view name, std::string_view sensor, std::uint64_t seed) {
  const auto scene = std::make_shared<const Scene>(
      std::vector<Part>{{HalfSpace{}, Eigen::Isometry3d::Identity(), motion_of(name)}});
  const auto camera = camera_before(*scene, camera_options(distance, across, sensor, seed));
  TeleopScene played{
      .cloud = [camera](std::uint64_t frame, double t) { return camera->capture(t, frame).cloud; },
      .truth = truth_of(scene),
      .hand = HipPath({{0.0, Vec3::Zero()}}),
      .duration = 0.0};
  played.hand = hand_of(name, played);
  return played;
}

TeleopFigures play_teleop_case(const TeleopScene& scene, const TeleopCase& one) {
  TeleopFigures figures;
  std::vector<double> forces;
  std::vector<double> heights;
  std::size_t mark = 0;
  double work = 0.0;
  play_teleop(scene, one, [&](const TeleopTick& tick) {
    figures.depth = std::max(figures.depth, tick.depth);
    figures.contact = std::max(figures.contact, tick.contact);
    if (tick.t < engaged) {
      work = tick.work;
      return;
    }
    figures.shake = std::max(figures.shake, tick.shake);
    figures.most_force = std::max(figures.most_force, tick.force.norm());
    if (mark >= scene.marks.size()) return;
    const double end = scene.marks[mark];
    const double released = end - rest - way_time;
    if (tick.t > released - hold + settle_time && tick.t <= released) {
      forces.push_back(tick.force.norm());
      heights.push_back(tick.tool.z());
    }
    if (tick.t < end) return;
    figures.energy = std::max(figures.energy, tick.work - work);
    work = tick.work;
    ++mark;
  });
  if (forces.empty()) return figures;
  double mean = 0.0;
  for (const double height : heights) mean += height / static_cast<double>(heights.size());
  double squares = 0.0;
  for (const double height : heights) squares += (height - mean) * (height - mean);
  figures.swing = std::sqrt(squares / static_cast<double>(heights.size()));
  figures.force = median(std::move(forces));
  return figures;
}

Experiment teleop_experiment() {
  return {.name = "teleop",
          .summary =
              "teleoperation of a robot, compared with force coupling, by delay, jitter and loss",
          .header =
              "way,scene,sensor,round_trip,link,force,most_force,shake,energy,depth,contact,swing",
          .default_methods = {"palpate", "position-force", "wave", "tdpa"},
          .cells = teleop_cells,
          .scores = teleop_scores};
}

}  // namespace palpate::lab
