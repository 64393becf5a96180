// SPDX-License-Identifier: Apache-2.0
// The scenes of `feel` with friction: a hand that slides, and hands that are drawn along and stick.
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "lab/closed_loop.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "lab/statistics.hpp"

namespace palpate::lab {
namespace {

void play(const FeelOptions& options, const std::string& camera_uri, double seconds,
          const std::function<HeldDevice()>& held,
          const std::function<void(std::size_t contestant, const Felt&)>& on_tick) {
  const FeelStage stage(camera_uri);
  const Truth truth = truth_of(stage.scene);
  std::vector<std::unique_ptr<TouchLoop>> loops;
  for (const OwnMethod& contestant : options.contestants)
    loops.push_back(straight_loop(contestant.make({options.parameters, truth}), held()));
  play_to(loops, stage.scenario(seconds), on_tick);
}

FeelOptions with_friction(FeelOptions options, double coefficient) {
  options.parameters.friction.friction = coefficient;
  return options;
}

}  // namespace

FeelFigures play_rub(const FeelOptions& options) {
  constexpr double from = 1.2;  // [s] sliding, after the first tenth
  const HipPath hand = sliding_hand();
  FeelRepeats repeats;
  for (const double coefficient : {0.1, 0.3, 0.6, 1.0}) {
    const FeelOptions rough = with_friction(options, coefficient);
    // What the model says of the speed of 0.1 m/s.
    const FrictionParameters& friction = rough.parameters.friction;
    const double faster = 0.1 / friction.stribeck_speed;
    const double kinetic = coefficient * (friction.kinetic_share + (1.0 - friction.kinetic_share) *
                                                                       std::exp(-faster * faster));
    for (int k = 0; k < options.repeats; ++k) {
      std::vector<double> along(options.contestants.size(), 0.0);
      std::vector<double> normal(options.contestants.size(), 0.0);
      play(
          rough,
          fmt::format("synthetic:plane?distance=0.7m&sensor=d4xx&seed={}", options.seed_of(k)), 3.0,
          [&] { return on_path(hand); },
          [&](std::size_t i, const Felt& felt) {
            if (felt.t < from) return;
            along[i] -= felt.asked.x();
            normal[i] += felt.asked.z();
          });
      for (std::size_t i = 0; i < options.contestants.size(); ++i) {
        const double ratio = normal[i] > 0.0 ? along[i] / normal[i] : 0.0;
        repeats.add({options.contestants[i].name, "path"}, "ratio",
                    100.0 * std::abs(ratio / kinetic - 1.0));
      }
    }
  }
  return repeats.figures({{"ratio", largest}});
}

FeelFigures play_stick(const FeelOptions& options, double stroke) {
  constexpr double coefficient = 0.6;
  constexpr double press = 0.025;      // [m] the hand wants to be that far below the surface
  constexpr double seconds = 13.0;     // of which ten are watched
  constexpr double drawn_until = 1.5;  // [s]
  // What a light grip presses with where the surface is lowest, and a spring that draws along with
  // half of what that holds.
  const Grip& grip = grip_preset("light");
  const double stiffness = options.parameters.coupling.stiffness;
  const double softer = grip.stiffness * stiffness / (grip.stiffness + stiffness);
  const double least = softer * (press - 0.5 * stroke);
  const double aside = 0.5 * coefficient * least / grip.stiffness;
  const HipPath hand({{0.0, {0.0, 0.0, 0.060}},
                      {0.5, {0.0, 0.0, -press}},
                      {1.0, {0.0, 0.0, -press}},
                      {drawn_until, {aside, 0.0, -press}},
                      {seconds, {aside, 0.0, -press}}});
  // A device without friction of its own, which would hold the hand too, and as exact as an omega.
  DevicePreset device = device_preset("omega");
  device.body.friction = 0.0;
  const FeelOptions rough = with_friction(options, coefficient);
  FeelRepeats repeats;
  for (int k = 0; k < options.repeats; ++k) {
    const std::uint64_t seed = options.seed_of(k);
    const std::size_t count = options.contestants.size();
    std::vector<std::vector<double>> first(count);  // [m] along, in the first second
    std::vector<std::vector<double>> last(count);
    std::vector<bool> held(count, false);  // does it push to the end?
    play(
        rough,
        fmt::format("synthetic:plane?{}&stroke={}", camera_options(0.7, 0.3, "d4xx", seed), stroke),
        seconds, [&] { return in_hand(hand, grip, device, seed); },
        [&](std::size_t i, const Felt& felt) {
          if (felt.t >= seconds - 1.0) {
            last[i].push_back(felt.hip.x());
            held[i] = held[i] || felt.force.z() > 0.0;
          } else if (felt.t >= seconds - 11.0 && felt.t < seconds - 10.0) {
            first[i].push_back(felt.hip.x());
          }
        });
    for (std::size_t i = 0; i < count; ++i)
      repeats.add({options.contestants[i].name, "light"}, "drift",
                  held[i] ? 1e3 * std::abs(mean(last[i]) - mean(first[i]))
                          : std::numeric_limits<double>::infinity());
  }
  return repeats.figures({{"drift", largest}});
}

}  // namespace palpate::lab
