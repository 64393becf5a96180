// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/zwidth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/table.hpp"
#include "palpate/io/devices/device_body.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"

namespace palpate::lab {
namespace {

constexpr double frame_rate = 30.0;   // [Hz]
constexpr double tick_rate = 1000.0;  // [Hz]
constexpr double distance = 0.45;     // [m] of the camera
constexpr double across = 0.12;       // [m] that it sees

// The hand's way: above the surface until the first frames are in use and the chain's ramp is over;
// down, to press with `push`; a poke; and the rest is watched.
constexpr double above = 3e-3;   // [m]
constexpr double down_at = 0.3;  // [s]
constexpr double down_in = 0.1;  // [s] for a hand; a handle that nobody holds is let go
constexpr double push = 1.0;     // [N] a Touch gives 0.88 N continuously
constexpr double poke_at = 0.9;  // [s]
constexpr double poke_for = 0.02;
constexpr double poke_push = 2.0;  // [N] more; 0.04 N s throw 60 g at 0.6 m/s
constexpr double watched = 0.4;    // [s] some time after the poke, and at the end
constexpr double early = 1.9;      // [s] end of the first of these
constexpr double duration = 6.3;   // [s]
// [-] of the speed that is left from the first to the second, where the swing decays: 3 % of a
// Touch's own damping takes that away in the 4.4 s between.
constexpr double left = 0.5;

// [m/s] A handle that moves slower is at rest: a D4xx's noise drives one that nobody holds in a
// corner by up to 22 mm/s at any stiffness; one that swings does by 40 mm/s and more.
constexpr double at_rest_below = 25e-3;
// [N] in the mean. A hand that feels less was never engaged, or has lost the surface.
constexpr double least_force = 0.01;
constexpr double softest = 100.0;                            // [N/m]
constexpr double precision = 1.03;                           // [-]
const std::vector<double> usual_dampings = {0.0, 2.0, 4.0};  // [N s/m]

// A spring that presses and adds next to nothing to the loop, but holds a handle on a sphere.
constexpr Grip nobody{"none", 0.0, 50.0, 0.0, 0.0, 0.0};

constexpr std::array<std::string_view, 4> scenes = {"plane", "sphere", "edge", "corner"};
constexpr std::array<std::string_view, 2> cameras = {"ideal", "d4xx"};

Eigen::Isometry3d turned(double slope, double azimuth) {
  return Eigen::Isometry3d(Eigen::AngleAxisd(azimuth, Vec3::UnitZ()) *
                           Eigen::AngleAxisd(slope, Vec3::UnitY()));
}

std::vector<Part> parts_of(std::string_view name) {
  constexpr double slope = 35.0 * std::numbers::pi / 180.0;  // the camera sees every wall
  constexpr double radius = 0.04;
  std::vector<Part> walls;
  const auto add = [&walls](double azimuth) {
    walls.push_back({HalfSpace{}, turned(slope, azimuth), Motion{}});
  };
  if (name == "plane") return {{HalfSpace{}, Eigen::Isometry3d::Identity(), Motion{}}};
  if (name == "sphere")
    return {{Sphere{radius}, Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, -radius)), Motion{}}};
  if (name == "edge") {
    for (int i = 0; i < 2; ++i) add(i * std::numbers::pi);
  } else {  // corner
    for (int i = 0; i < 3; ++i) add(i * 2.0 * std::numbers::pi / 3.0);
  }
  return walls;
}

// The path whose spring presses with the forces above.
HipPath pressing(const Vec3& touched, const Grip& hand) {
  const auto at = [&](double height) { return Vec3(touched + height * Vec3::UnitZ()); };
  const double pressed = -push / hand.stiffness;
  const double poked = pressed - poke_push / hand.stiffness;
  constexpr double at_once = 1e-3;  // [s]
  const double in = hand.mass > 0.0 ? down_in : at_once;
  return HipPath({{0.0, at(above)},
                  {down_at, at(above)},
                  {down_at + in, at(pressed)},
                  {poke_at, at(pressed)},
                  {poke_at + at_once, at(poked)},
                  {poke_at + poke_for, at(poked)},
                  {poke_at + poke_for + at_once, at(pressed)},
                  {duration + 1.0, at(pressed)}});
}

SampledWall wall_of(const ZHolding& holding, double damping) {
  const DeviceBody& body = holding.device.body;
  return {.handle = {.mass = body.mass + holding.hand.mass,
                     .damping = body.damping + holding.hand.damping,
                     .stiffness = holding.hand.stiffness},
          .damping = damping,
          .period = 1.0 / tick_rate,
          .delay = body.delay};
}

std::string rows_of(std::string_view scene_name, std::string_view camera,
                    const std::vector<ZHolding>& holdings, const std::vector<std::string>& names,
                    const ExperimentOptions& options) {
  const ZScene scene(scene_name, camera, options.seed);
  std::vector<double> dampings = usual_dampings;
  if (const double asked = options.parameters.coupling.damping; asked > 0.0) dampings = {asked};
  std::string rows;
  for (const ZHolding& holding : holdings) {
    for (const double damping : dampings) {
      const SampledWall wall = wall_of(holding, damping);
      const double linear = linear_stiffness(wall, stiffest);
      for (const std::string& method : names) {
        // The true surface has no camera.
        if (method == "ideal" && camera != cameras.front()) continue;
        for (const bool chain : {false, true}) {
          const ZLoop loop{&scene, &holding, method, damping, chain};
          rows +=
              csv_row(holding.name, holding.hand.name, scene_name, camera, method,
                      chain ? "chain" : "straight", damping,
                      largest_stiffness(loop, options.parameters), delayed_stiffness(wall), linear);
        }
      }
    }
  }
  return rows;
}

std::vector<Cell> zwidth_cells(const Experiment& experiment, const ExperimentOptions& options) {
  check_families(options, "zwidth has no such scene", scenes);
  const std::vector<std::string> names = methods_of(experiment, options);
  std::vector<Cell> cells;
  const std::vector<ZHolding> all = z_holdings();
  for (const std::string_view scene : scenes) {
    if (!options.wants(scene)) continue;
    for (const std::string_view camera : cameras) {
      for (auto first = all.begin(); first != all.end();) {
        const auto last = std::find_if(
            first, all.end(), [&](const ZHolding& one) { return one.name != first->name; });
        cells.emplace_back([=, holdings = std::vector<ZHolding>(first, last)] {
          return rows_of(scene, camera, holdings, names, options);
        });
        first = last;
      }
    }
  }
  return cells;
}

std::string stiffness_text(double stiffness) {
  return stiffness >= stiffest ? fmt::format("> {:.0f}", stiffest)
                               : fmt::format("{:.0f}", stiffness);
}

// Theory, and the range over all scenes of each method and way.
Scores zwidth_scores(const Table& table) {
  std::vector<Column> columns = {
      {"k_d", [](const Table& group) { return group.text(0, "damping"); }},
      shown("2(b+k_d)/(T+2t_d)", {"bound"}, "{:.0f}"),
      {"linear", [](const Table& group) { return stiffness_text(group.number(0, "linear")); }}};
  for (const std::string& method : texts_in(table, "method")) {
    for (const std::string_view way : {"straight", "chain"}) {
      columns.push_back(
          {way == "chain" ? method + ", chain" : method, [=](const Table& group) {
             const std::vector<double> values =
                 group.numbers("stiffness", {{"method", method}, {"way", way}});
             if (values.empty()) return std::string("-");
             const auto [least, most] = std::minmax_element(values.begin(), values.end());
             return stiffness_text(*least) + (*most > *least ? " to " + stiffness_text(*most) : "");
           }});
    }
  }
  return scores_of(table.by({"device", "hand", "damping"}), {"device", "hand"}, columns,
                   "Largest stable stiffness [N/m], from the worst to the best of scenes and "
                   "cameras; k_d in N s/m. Measures: docs/feel.md.");
}

}  // namespace

std::vector<ZHolding> z_holdings() {
  std::vector<ZHolding> all;
  const auto add = [&all](const std::string& name, const DevicePreset& device) {
    for (const Grip& hand : {nobody, grip_preset("light"), grip_preset("firm")})
      all.push_back({name, device, hand});
  };
  for (const double friction : {0.26, 0.05, 0.0}) {
    DevicePreset touch = device_preset("touch");
    touch.body.friction = friction;
    add(fmt::format("touch-{}N", friction), touch);
  }
  add("omega", device_preset("omega"));
  return all;
}

ZScene::ZScene(std::string_view name, std::string_view sensor, std::uint64_t seed) {
  const auto scene = std::make_shared<const Scene>(parts_of(name));
  truth_ = truth_of(scene);
  const auto camera = camera_before(*scene, camera_options(distance, across, sensor, seed));
  constexpr std::uint64_t frames = 60;  // then from the first again: nothing moves
  for (std::uint64_t k = 0; k < frames; ++k)
    frames_.push_back(camera->capture(static_cast<double>(k) / frame_rate, k).cloud);
}

Vec3 ZScene::touched_at(double r_c) const {
  // A sphere that comes down from above; the surfaces are symmetric about the z axis. Then the hand
  // continues by its radius before the coupling pushes.
  Vec3 at(0.0, 0.0, 0.1);
  for (int i = 0; i < 200; ++i) at.z() -= truth_(at, 0.0).distance - r_c;
  return at - r_c * Vec3::UnitZ();
}

bool ZTrial::decays() const {
  // A swing that continues is there both times; a single kick, by a frame's noise, is not.
  const bool rests = std::min(speed, speed_before) <= at_rest_below;
  return !cut && force >= least_force && (rests || speed <= left * speed_before);
}

ZTrial poke(const ZLoop& loop, const Parameters& parameters, double stiffness) {
  Parameters stiff = parameters;
  stiff.coupling.stiffness = stiffness;
  stiff.coupling.damping = loop.damping;
  const ZHolding& holding = *loop.holding;
  HeldDevice held = in_hand(pressing(loop.scene->touched_at(stiff.proxy.r_c()), holding.hand),
                            holding.hand, holding.device, 1);
  auto method = make_method(loop.method, {stiff, loop.scene->truth()});
  SafetyParameters safety;
  safety.ramp_time = 0.05;
  std::vector<std::unique_ptr<TouchLoop>> loops;
  loops.push_back(loop.chain ? safe_loop(std::move(method), std::move(held), stiff, safety)
                             : straight_loop(std::move(method), std::move(held)));
  ZTrial trial{};
  double squares_before = 0.0;
  double squares = 0.0;
  double force = 0.0;
  play_to(loops,
          {.frame_rate = frame_rate,
           .tick_rate = tick_rate,
           .duration = duration,
           .cloud = [&](std::uint64_t k, double) { return loop.scene->frame(k); },
           .hip = nullptr},
          [&](std::size_t, const Felt& felt) {
            if ((felt.safety & (energy_cut | oscillation_cut)) != 0) trial.cut = true;
            if (felt.t > early - watched && felt.t <= early)
              squares_before += felt.speed * felt.speed;
            if (felt.t <= duration - watched) return;
            squares += felt.speed * felt.speed;
            force += felt.force.norm();
          });
  trial.speed_before = std::sqrt(squares_before / (watched * tick_rate));
  trial.force = force / (watched * tick_rate);
  trial.speed = std::sqrt(squares / (watched * tick_rate));
  return trial;
}

double largest_stiffness(const ZLoop& loop, const Parameters& parameters) {
  // Upwards, as one step may decay at random where softer ones do not.
  double low = 0.0;
  double high = softest;
  while (poke(loop, parameters, high).decays()) {
    if (high >= stiffest) return stiffest;
    low = high;
    high = std::min(2.0 * high, stiffest);
  }
  if (low == 0.0) return 0.0;
  while (high > precision * low) {
    const double middle = std::sqrt(low * high);
    (poke(loop, parameters, middle).decays() ? low : high) = middle;
  }
  return low;
}

Experiment zwidth_experiment() {
  return {.name = "zwidth",
          .summary =
              "largest stable stiffness: device, hand, scene and method, through the safety chain",
          .header = "device,hand,scene,camera,method,way,damping,stiffness,bound,linear",
          .default_methods = {"paper", "sight", "ideal"},
          .cells = zwidth_cells,
          .scores = zwidth_scores};
}

}  // namespace palpate::lab
