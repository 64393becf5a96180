// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "lab/experiment.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/experiments/teleop.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"

namespace palpate::lab {
namespace {

constexpr std::array<std::string_view, 5> faults = {"none", "link", "camera", "operator", "robot"};
constexpr int usual_cases = 20;  // of each fault
constexpr int cases_a_cell = 20;
constexpr double begins = 2.0;            // [s] frames have come at any delay
constexpr double episode_duration = 7.0;  // [s]
constexpr double across = 0.24;           // [m] that the camera sees
constexpr double aside = 0.06;            // [m] to which the hand goes
constexpr double fastest = 0.3;           // [m/s] of the hand
constexpr double moving = 0.02;           // [m/s] of a tool that has to stop
constexpr double at_rest = 0.01;          // [m/s] of a tool that has stopped, or nearly
constexpr double after = 0.5;             // [s] after what failed is back

// A plane or a ball on it, tilted at random; one in two moves by up to 60 mm/s.
std::vector<Part> parts_of(Chance& chance) {
  const double slope = chance(0.0, 0.3);  // [rad]
  const Eigen::Isometry3d pose(
      Eigen::AngleAxisd(chance(0.0, 2.0 * std::numbers::pi), Vec3::UnitZ()) *
      Eigen::AngleAxisd(slope, Vec3::UnitY()));
  Motion motion;
  if (chance() < 0.5) {
    motion.start = begins;
    motion.frequency = chance(0.2, 0.6);
    motion.stroke = chance(0.2, 1.0) * 0.06 / (std::numbers::pi * motion.frequency);
  }
  std::vector<Part> parts{{HalfSpace{}, pose, motion}};
  if (chance() < 0.5) {
    const double radius = chance(0.02, 0.05);
    const double y = chance(-0.03, 0.03);  // first, as in `wander`
    const Vec3 place(chance(-0.03, 0.03), y, -0.3 * radius);
    parts.push_back({Sphere{radius}, Eigen::Isometry3d(Eigen::Translation3d(place)), motion});
  }
  return parts;
}

HipPath wander(Chance& chance) {
  Vec3 place(0.0, 0.0, 0.07);
  std::vector<HipPath::Sample> path = {{0.0, place}, {begins, place}};
  while (path.back().t < episode_duration) {
    // One by one: compilers differ in the order in which they find a call's arguments.
    const double z = chance(-0.02, 0.06);
    const double y = chance(-aside, aside);
    const Vec3 to(chance(-aside, aside), y, z);
    const double speed = chance(0.03, fastest);
    path.push_back({path.back().t + std::max((to - place).norm() / speed, 1e-3), to});
    path.push_back({path.back().t + chance(0.05, 0.6), to});
    place = to;
  }
  return HipPath(std::move(path));
}

std::vector<Cell> episode_cells(const Experiment& /*experiment*/,
                                const ExperimentOptions& options) {
  check_families(options, "teleop-faults has no such fault", faults);
  std::vector<Cell> cells;
  const int cases = options.cases.value_or(usual_cases);
  for (const std::string_view fault : faults) {
    if (!options.wants(fault)) continue;
    for (int first = 0; first < cases; first += cases_a_cell)
      cells.emplace_back([=, seed = options.seed, last = std::min(first + cases_a_cell, cases)] {
        std::string rows;
        for (int i = first; i < last; ++i) {
          const std::uint64_t number = seed * 1000000 + static_cast<std::uint64_t>(i);
          const TeleopEpisode episode = teleop_episode(fault, number);
          const EpisodeFigures figures = play_episode(episode);
          rows += csv_row(fault, episode.moves ? "moves" : "rests", episode.sensor, number,
                          1e3 * figures.breach, figures.contact, figures.unseen, figures.rise,
                          figures.force, 1e3 * figures.stop.value_or(0.0));
        }
        return rows;
      });
  }
  return cells;
}

Scores episode_scores(const Table& table) {
  std::vector<Table> groups;
  for (const std::string_view fault : faults)
    for (const std::string_view scene : {"rests", "moves"})
      groups.push_back(table.where({{"fault", fault}, {"scene", scene}}));
  std::erase_if(groups, [](const Table& group) { return group.rows() == 0; });
  const auto above = [](std::string title, std::string_view column, double limit) {
    return Column{std::move(title), [=](const Table& group) {
                    const std::vector<double> values = group.numbers(column);
                    return std::to_string(std::count_if(
                        values.begin(), values.end(), [=](double value) { return value > limit; }));
                  }};
  };
  return scores_of(
      groups, {"fault", "scene"},
      {{"episodes", [](const Table& group) { return std::to_string(group.rows()); }},
       above("breach > 0.5 mm", "breach", 0.5),
       shown("worst [mm]", {"breach"}, "{:.2f}", 1.0, largest),
       above("contact > 5 N", "contact", 5.0),
       shown("worst [N]", {"contact"}, "{:.1f}", 1.0, largest),
       above("unseen > 5 N", "unseen", 5.0),
       shown("rise [N/ms]", {"rise"}, "{:.3f}", 1.0, largest),
       shown("stops within [ms]", {"stop"}, "{:.0f}", 1.0, largest)},
      "Stops within: until the tool is slower than 10 mm/s. Unseen: a surface that moves while the "
      "camera sends no frames. Measures: docs/teleop.md.");
}

}  // namespace

TeleopEpisode teleop_episode(std::string_view fault, std::uint64_t seed) {
  Chance chance(seed * 1000003U + 17U);
  std::vector<Part> parts = parts_of(chance);
  const bool moves = !parts.front().motion.rests();
  const auto scene = std::make_shared<const Scene>(std::move(parts));
  const double distance = chance(0.45, 0.8);
  const std::string_view sensor = 3.0 * chance() < 1.0 ? "ideal" : "d4xx";
  const auto camera = camera_before(*scene, camera_options(distance, across, sensor, seed));
  TeleopEpisode episode{
      .scene = {.cloud = [camera](std::uint64_t frame,
                                  double t) { return camera->capture(t, frame).cloud; },
                .truth = truth_of(scene),
                .hand = wander(chance),
                .duration = episode_duration},
      .one = {.way = "palpate", .seed = seed},
      .region = {},
      .moves = moves,
      .sensor = sensor};

  LinkQuality link{.delay = chance(0.0, 0.25), .loss = chance(0.0, 0.2)};
  link.jitter = std::min(chance(0.0, 0.03), link.delay);
  const double at = chance(begins + 0.5, episode_duration - 2.0);
  const double until = at + chance(0.2, 1.5);
  if (fault == "link") {
    link.down_from = at;
    link.down_until = until;
    episode.failed = at + link.delay + link.jitter;  // the last that was sent arrives
    episode.back = until + link.delay + link.jitter;
  } else if (fault == "camera") {
    episode.scene.dark_from = at;
    episode.scene.dark_until = until;
    episode.dark = true;
  } else if (fault == "operator") {
    episode.one.operator_dies = at;
    episode.failed = at + link.delay + link.jitter;
  } else if (fault == "robot") {
    episode.one.robot_dies = at;
  }
  episode.one.up = episode.one.down = link;

  // Beyond a wall that stands upright, on one side.
  const double turn = chance(0.0, 2.0 * std::numbers::pi);
  const Vec3 outward(std::cos(turn), std::sin(turn), 0.0);
  episode.region = half_space("wall", outward, -chance(0.0, 0.03) * outward);
  episode.one.fixtures = std::make_shared<const FixtureSet>(std::vector{episode.region});
  return episode;
}

EpisodeFigures play_episode(const TeleopEpisode& episode) {
  EpisodeFigures figures;
  const Eigen::Isometry3d region_from_world = episode.region.world_from_fixture.inverse();
  double speed_at_failure = 0.0;
  double slow_since = -1.0;
  Vec3 last_force = Vec3::Zero();
  play_teleop(episode.scene, episode.one, [&](const TeleopTick& tick) {
    // The tool starts where it is not wanted, now and then.
    if (tick.t >= begins)
      figures.breach = std::max(figures.breach, -(region_from_world * tick.tool).z());
    const bool unseen = episode.dark && tick.t >= episode.scene.dark_from &&
                        tick.t < episode.scene.dark_until + 0.3;
    (unseen ? figures.unseen : figures.contact) =
        std::max(unseen ? figures.unseen : figures.contact, tick.contact);
    figures.force = std::max(figures.force, tick.force.norm());
    if (episode.back && tick.t >= *episode.back && tick.t < *episode.back + after)
      figures.rise = std::max(figures.rise, (tick.force - last_force).norm());
    last_force = tick.force;
    if (!episode.failed || tick.t < *episode.failed || figures.stop) return;
    const double speed = tick.tool_velocity.norm();
    if (speed_at_failure == 0.0) speed_at_failure = speed;
    if (slow_since < 0.0 && speed <= std::max(0.1 * speed_at_failure, at_rest)) {
      slow_since = tick.t;
      if (speed_at_failure >= moving) figures.stop = tick.t - *episode.failed;
    }
  });
  return figures;
}

Experiment teleop_faults_experiment() {
  return {
      .name = "teleop-faults",
      .summary = "teleoperation while network, camera or a process fails: fixtures, force, stops",
      .header = "fault,scene,sensor,number,breach,contact,unseen,rise,force,stop",
      .cells = episode_cells,
      .scores = episode_scores};
}

}  // namespace palpate::lab
