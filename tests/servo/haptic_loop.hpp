// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include "palpate/servo/safety.hpp"

namespace palpate::test {

/// A haptic device, a hand and a rendered surface in closed loop through the safety chain, in one
/// dimension along z and with a tangential motion x that is prescribed.
///
/// The handle is a mass with viscous and Coulomb friction; the hand is a mass, damper and spring
/// that pulls the handle along a path. The surface is a spring that only pushes. Forces act one
/// tick after they were computed. Integrated at 10 steps a tick.
struct HapticLoop {
  // Device
  double mass = 0.06;            // [kg]
  double damping = 0.5;          // [N s/m]
  double coulomb = 0.0;          // [N]
  double resolution = 0.055e-3;  // [m]
  double rate = 1000.0;          // [Hz]
  int delay = 1;                 // [ticks]
  // Hand; without one the handle's own weight pulls it down.
  double hand_mass = 0.0;                                               // [kg]
  double hand_damping = 0.0;                                            // [N s/m]
  double hand_stiffness = 0.0;                                          // [N/m]
  double weight = 0.0;                                                  // [N] constant, downwards
  std::function<double(double)> path = [](double) { return 0.0; };      // [m] of the hand, z(t)
  std::function<double(double)> sideways = [](double) { return 0.0; };  // [m] x(t)
  // Surface
  double stiffness = 600.0;                                                           // [N/m]
  std::function<double(double, double)> height = [](double, double) { return 0.0; };  // z(x, t)
  std::function<double(double)> velocity = [](double) { return 0.0; };  // [m/s] as reported

  int lag = 0;  // [ticks] that the method's force is behind the hand
  std::uint32_t links = SafetyChain::all_links;
  SafetyParameters parameters{.initial_heat = 0.0};

  /// What was seen.
  struct Result {
    double first_cut = -1.0;     // [s] of the energy link; negative: never
    int cuts = 0;                // times its flag was raised
    std::vector<double> swings;  // [m] peak to peak in each half second, relative to the surface
    double lowest_gain = 1.0;
  };

  /// @param start     [m] the handle's height above the surface
  Result run(double seconds, double start) const {
    constexpr int substeps = 10;
    SafetyChain chain({.max_force = 12.0, .continuous_force = 12.0}, parameters, links);
    SafetyInput input{.t = 100.0,
                      .force = Vec3::Zero(),
                      .hip = Vec3::Zero(),
                      .proxy = Vec3::Zero(),
                      .normal = Vec3::UnitZ(),
                      .position = Vec3::Zero(),
                      .hand = true,
                      .frame_age = 0.01,
                      .frame_intervals = 0.3,
                      .surface_velocity = 0.0};
    const double dt = 1.0 / rate;
    double z = height(sideways(0.0), 0.0) + start;
    double v = 0.0;
    // Engaged in the air, the hand held still.
    for (int i = 0; i < static_cast<int>(2.0 / dt); ++i) {
      input.hip = input.position = Vec3(sideways(0.0), 0, z);
      input.proxy = input.hip;
      input.t += dt;
      chain.run(input);
    }
    Result result;
    std::vector<double> pending(static_cast<std::size_t>(delay), 0.0);
    std::vector<double> depths;
    double low = 1e9;
    double high = -1e9;
    double next_half = 0.5;
    std::uint64_t raised = 0;
    for (int i = 0; i < static_cast<int>(seconds / dt); ++i) {
      const double t = i * dt;
      const double x = sideways(t);
      const double surface = height(x, t);
      const double measured = std::round(z / resolution) * resolution;
      const double depth = surface - measured;
      depths.push_back(depth);
      const double felt = depths[depths.size() > static_cast<std::size_t>(lag)
                                     ? depths.size() - 1 - static_cast<std::size_t>(lag)
                                     : 0];
      input.t += dt;
      input.hip = input.position = Vec3(x, 0, measured);
      input.force = Vec3(0, 0, stiffness * std::max(felt, 0.0));
      // Slopes turn the normal and the force with it.
      const double slope = (height(x + 1e-5, t) - height(x - 1e-5, t)) / 2e-5;
      input.normal = Vec3(-slope, 0, 1).normalized();
      input.force = input.force.z() * Vec3(-slope, 0, 1);
      input.proxy = input.hip + std::max(depth, 0.0) * input.normal;
      input.surface_velocity = velocity(t) * input.normal.z();
      const SafetyOutput output = chain.run(input);
      if ((output.flags & energy_cut) != 0) {
        if (result.first_cut < 0.0) result.first_cut = t;
        result.lowest_gain = std::min(result.lowest_gain, output.gain);
      }
      result.cuts += chain.interventions()[energy_flag] > raised ? 1 : 0;
      raised = chain.interventions()[energy_flag];
      pending.push_back(output.force.z());
      const double force = pending.front();
      pending.erase(pending.begin());

      const double h = dt / substeps;
      const double m = mass + hand_mass;
      for (int k = 0; k < substeps; ++k) {
        const double s = t + k * h;
        const double pull = hand_stiffness * (path(s) - z) -
                            hand_damping * (v - (path(s + 1e-4) - path(s - 1e-4)) / 2e-4);
        const double push = force + pull - weight - damping * v;
        double next = v + h * push / m;
        const double friction = h * coulomb / m;  // stops, but never turns round
        next = next > friction ? next - friction : next < -friction ? next + friction : 0.0;
        v = next;
        z += h * v;
      }
      low = std::min(low, z - surface);
      high = std::max(high, z - surface);
      if (t + dt >= next_half) {
        result.swings.push_back(high - low);
        next_half += 0.5;
        low = 1e9;
        high = -1e9;
      }
    }
    return result;
  }

 private:
  static constexpr std::size_t energy_flag = 15;
};

/// Any device of the Touch class and any hand that holds it.
inline HapticLoop somebody(std::mt19937_64& random) {
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  constexpr std::array coulomb{0.0, 0.05, 0.26};
  HapticLoop loop;
  loop.mass = between(0.045, 0.075);
  loop.damping = between(0.5, 1.0);
  loop.coulomb = coulomb[random() % coulomb.size()];
  loop.hand_mass = between(0.05, 0.2);
  loop.hand_damping = between(2.0, 12.0);
  loop.hand_stiffness = between(100.0, 600.0);
  loop.stiffness = between(200.0, 800.0);
  return loop;
}

/// A contact in which nothing oscillates by itself: what people do with what cameras see.
inline HapticLoop honest_contact(std::uint64_t seed) {
  std::mt19937_64 random(seed * 0x9e3779b97f4a7c15u + 1);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  constexpr double pi = std::numbers::pi;
  HapticLoop loop = somebody(random);

  // The hand: presses and holds, taps at up to 7 Hz, slides over ridges; with tremor.
  const std::uint64_t action = random() % 3;
  const double frequency = action == 1 ? between(1.0, 6.4) : between(0.1, 1.0);
  const double depth = between(2e-3, 12e-3);
  const double lift = action == 1 ? between(-0.5, 1.0) * depth : 0.0;
  const double tremor = between(0.05e-3, 0.3e-3);
  const double tremor_frequency = between(8.0, 12.0);
  const double unevenness = between(0.0, 0.05);
  const auto hand = [=](double t) {
    const double beat = frequency * (t + unevenness * std::sin(1.7 * t));
    const double stroke = 0.5 * (1.0 - std::cos(2.0 * pi * beat));
    const double down = action == 1 ? stroke : std::min(4.0 * t, 1.0);
    const double shake = tremor * (0.75 + 0.25 * std::sin(2.0 * pi * 0.9 * t));
    return lift - (depth + lift) * down + shake * std::sin(2.0 * pi * tremor_frequency * t);
  };
  const double speed = action == 2 ? between(0.03, 0.2) : 0.0;
  const double wave = between(3e-3, 15e-3);
  const double ridge = action == 2 ? std::min(between(0.1e-3, 1.5e-3), 0.12 * wave) : 0.0;
  loop.sideways = [=](double t) { return 0.05 * std::sin(speed / 0.05 * t); };

  // The surface: at rest or moving by 20 mm, and what the camera's noise leaves of it, a new error
  // with each frame, blended over a frame's interval. Its velocity is known with an error, late.
  const double swing = random() % 2 == 0 ? 0.0 : 10e-3;
  const double motion = between(0.5, 1.0);
  const double delay = between(0.0, 0.05);
  const double error = between(0.8, 1.2);
  const double noise = random() % 2 == 0 ? 0.0 : between(0.0, 0.5e-3);
  std::vector<double> errors(400);
  for (double& e : errors) {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += between(0.0, 1.0);
    e = noise * sum;
  }
  const auto moving = [=](double t) { return swing * std::sin(2.0 * pi * motion * t); };
  loop.height = [=](double x, double t) {
    const double frame = std::max(30.0 * t, 0.0);
    const auto n = static_cast<std::size_t>(frame);
    const double part = frame - std::floor(frame);
    return moving(t) + ridge * std::sin(2.0 * pi * x / wave) +
           (1.0 - part) * errors[n % errors.size()] + part * errors[(n + 1) % errors.size()];
  };
  loop.velocity = [=](double t) {
    return error * swing * 2.0 * pi * motion * std::cos(2.0 * pi * motion * (t - delay));
  };
  loop.path = [=](double t) { return hand(t) + moving(t); };
  return loop;
}

/// A handle that nobody damps: pulled or barely held against a surface too stiff for it.
inline HapticLoop free_swing(std::uint64_t seed) {
  std::mt19937_64 random(seed * 0x9e3779b97f4a7c15u + 2);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  constexpr double pi = std::numbers::pi;
  HapticLoop loop;
  loop.mass = between(0.045, 0.075);
  loop.damping = between(0.5, 1.0);
  loop.coulomb = random() % 2 == 0 ? 0.0 : 0.05;
  loop.stiffness = between(500.0, 1200.0);
  loop.weight = between(0.3, 2.0);
  const double swing = random() % 2 == 0 ? 0.0 : 10e-3;
  const double motion = between(0.5, 1.0);
  loop.height = [=](double, double t) { return swing * std::sin(2.0 * pi * motion * t); };
  loop.velocity = [=](double t) {
    return swing * 2.0 * pi * motion * std::cos(2.0 * pi * motion * t);
  };
  return loop;
}

}  // namespace palpate::test
