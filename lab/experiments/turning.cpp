// SPDX-License-Identifier: Apache-2.0
// Tools on a handle with motors for a torque: how stiff in rotation they may be until they turn to
// and fro.
#include <array>
#include <cmath>
#include <string>

#include "lab/experiment.hpp"
#include "palpate/io/devices/simulated_hand.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/stiffness.hpp"

namespace palpate::lab {
namespace {

constexpr double period = 1e-3;      // [s] of a tick
constexpr double frame_rate = 30.0;  // [Hz]
constexpr int duration = 3000;       // [ticks], of which the last third counts
constexpr double push = 1.0;         // [N] of the hand
constexpr double tilt = 0.15;        // [rad] of the tool: one end meets the plane first
constexpr double at_rest = 0.05;     // [rad/s] rms; what swings does by 0.2 and more
constexpr double softest = 0.05, stiffest = 200.0;  // [N m/rad]
constexpr double precision = 1.05;                  // [-]

constexpr std::array<std::string_view, 3> turning_grips{"none", "light", "firm"};
constexpr std::array<std::string_view, 2> turning_tools{"box:40x20x5mm?points=300",
                                                        "capsule:200x10mm?points=300"};

struct Rested {
  double rate = 0.0;   // [rad/s] of the handle, rms
  double force = 0.0;  // [N] of the motors, mean
  [[nodiscard]] bool rests() const { return rate < at_rest; }
};

// A hand presses a tool onto a plane that an exact camera sees. @param stiffness  [N m/rad] at
// most; 0: any
Rested pressed(std::string_view tool, std::string_view grip, double stiffness) {
  // A spring that presses and adds next to nothing to the loop.
  constexpr Grip nobody{"none", 0.0, 50.0, 0.0, 0.0, 0.0};
  const Grip& hand = grip == "none" ? nobody : grip_preset(grip);
  const Rotation turn = rotation_by({0.0, tilt, 0.0});
  const HipPath path({{0.0, {0.0, 0.0, 0.03}, turn},
                      {0.6, {0.0, 0.0, 0.03}, turn},
                      {1.2, {0.0, 0.0, 2e-3 - push / hand.stiffness}, turn}});
  const DevicePreset& device = device_preset("sigma");
  SimulatedHand held(path, {.mass = hand.mass,
                            .stiffness = hand.stiffness,
                            .damping = hand.damping,
                            .tremor = 0.0,
                            .turn_stiffness = hand.turn_stiffness,
                            .turn_damping = hand.turn_damping,
                            .body = device.body});
  held.set_device(device);
  ServoSettings settings;
  settings.parameters.coupling.turn_stiffness = stiffness;
  Cycle cycle(make_method("sight", settings.parameters, standard_methods(),
                          make_tool(std::string(tool), {})),
              held, settings);
  auto reader = cycle.reader();
  CameraSetup setup;
  setup.world_from_camera = looking_at_origin(0.5, 0.0, 0.0);
  SyntheticCamera camera(Scene({Part{}}), setup, SensorModel::named("ideal"));
  const auto frame = camera.capture(0.0, 0);
  Rested rested;
  std::uint64_t frames = 0;
  for (int i = 0; i < duration; ++i) {
    const double t = i * period;
    if (const double due = static_cast<double>(frames) / frame_rate; t >= due) {
      cycle.put_frame(frame.cloud, due, t);
      ++frames;
    }
    cycle.run({.t = t});
    ServoTick tick{};
    reader.try_pop(tick);
    if (i < duration * 2 / 3) continue;
    rested.rate += std::pow(held.statistics().turn_rate, 2) * 3.0 / duration;
    rested.force += tick.force.norm() * 3.0 / duration;
  }
  rested.rate = std::sqrt(rested.rate);
  return rested;
}

std::string turning_row(std::string_view tool, std::string_view grip) {
  Coupling bounded;
  set_turn_stiffness(device_preset("sigma").limits, bounded);
  double low = softest, high = stiffest;
  if (!pressed(tool, grip, low).rests()) high = low;
  while (high > precision * low) {
    const double middle = std::sqrt(low * high);
    (pressed(tool, grip, middle).rests() ? low : high) = middle;
  }
  const Rested without = pressed(tool, grip, 0.0);
  const Rested with = pressed(tool, grip, bounded.turn_stiffness);
  return csv_row(tool.substr(0, tool.find('?')), grip, without.rate, without.force, with.rate,
                 with.force, low);
}

std::vector<Cell> turning_cells(const Experiment& /*experiment*/,
                                const ExperimentOptions& options) {
  check_families(options, "turning has no such grip", turning_grips);
  std::vector<Cell> cells;
  for (const std::string_view grip : turning_grips)
    for (const std::string_view tool : turning_tools)
      if (options.wants(grip)) cells.emplace_back([=] { return turning_row(tool, grip); });
  return cells;
}

Scores turning_scores(const Table& table) {
  return scores_by(
      table, {"tool", "grip"},
      {shown("without", {"free_rate", "free_force"}, "{:.2f}"),
       shown("bounded", {"rate", "force"}, "{:.2f}"),
       shown("stiffest [N m/rad]", {"stiffest"}, "{:.2g}")},
      "Rate of turning [rad/s, rms] and force [N, mean] in the third of three seconds, without a "
      "bound of the stiffness in rotation and with a session's; and the stiffest with which it "
      "rests. docs/tools.md.");
}

}  // namespace

Experiment turning_experiment() {
  return {.name = "turning",
          .summary = "how stiff in rotation a tool may be on a handle with motors for a torque",
          .header = "tool,grip,free_rate,free_force,rate,force,stiffest",
          .cells = turning_cells,
          .scores = turning_scores};
}

}  // namespace palpate::lab
