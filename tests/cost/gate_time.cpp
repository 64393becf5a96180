// SPDX-License-Identifier: Apache-2.0
// Times the last gate: nanoseconds a tick, the median of 200 runs of 20,000 ticks, for what
// sessions ask of it. The sum of the bits that it sent tells whether two gates send the same.
#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <random>
#include <vector>

#include "palpate/servo/last_gate.h"

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::size_t ticks = 20'000, runs = 200;

std::vector<palpate_gate_wish> session(double torque, double force, bool faults) {
  std::vector<palpate_gate_wish> wishes(ticks);
  std::mt19937_64 random(1);
  double t = 1.0;
  for (std::size_t i = 0; i < ticks; ++i) {
    palpate_gate_wish& wish = wishes[i];
    const double press = force * (0.55 + 0.45 * std::sin(6e-3 * static_cast<double>(i)));
    t += faults && random() % 997 == 0 ? 0.1 : 1e-3;
    wish = {.t = t,
            .force = {0.1 * press, 0.02 * press, press},
            .torque = {torque * press, 0.0, -0.5 * torque * press},
            .held = {},
            .ring = 0.0,
            .frame_age = 0.03,
            .lost_age = 0.5,
            .frame_intervals = faults && random() % 101 < 5 ? 4.0 : 0.9,
            .late_intervals = 3.0,
            .force_bounds = {3.3, 500.0, 2000.0},
            .torque_bounds = {0.1, 15.0, 60.0},
            .ramp_time = 1.5,
            .longest_gap = 5e-3,
            .longest_time = 1e-3,
            .engaged = 1,
            .hand = !faults || random() % 499 != 0,
            .latched = 0,
            .may_hold = 0};
  }
  return wishes;
}

std::uint64_t bits_sent(const std::vector<palpate_gate_wish>& wishes) {
  std::uint64_t sum = 0;
  palpate_gate gate{};
  for (const palpate_gate_wish& wish : wishes) {
    palpate_gate_step(&gate, &wish);
    for (const double sent : {gate.sum.x, gate.sum.y, gate.sum.z, gate.torque.last.x,
                              gate.torque.last.y, gate.torque.last.z})
      sum = 31 * sum + std::bit_cast<std::uint64_t>(sent);
  }
  return sum;
}

void time(const char* name, const std::vector<palpate_gate_wish>& wishes) {
  std::array<double, runs> took{};
  for (double& ns : took) {
    palpate_gate gate{};
    const auto began = Clock::now();
    for (const palpate_gate_wish& wish : wishes) palpate_gate_step(&gate, &wish);
    const std::chrono::duration<double, std::nano> elapsed = Clock::now() - began;
    ns = elapsed.count() / static_cast<double>(ticks);
  }
  std::nth_element(took.begin(), took.begin() + runs / 2, took.end());
  std::printf("%-22s %6.1f ns  bits %016llx\n", name, took[runs / 2],
              static_cast<unsigned long long>(bits_sent(wishes)));
}

}  // namespace

int main() {
  time("nothing", session(0.0, 0.0, false));
  time("force", session(0.0, 3.0, false));
  time("force and torque", session(0.02, 3.0, false));
  time("force above the limit", session(0.02, 5.0, false));
  time("faults", session(0.02, 5.0, true));
}
