// SPDX-License-Identifier: Apache-2.0
// Times a tick of a tool with a shape, frames included: a plate that is pressed into a plane in
// front of a D4xx at 0.45 m, slides and tips for five seconds. Each tick is timed as the least of
// five equal runs, which leaves out what else the computer did. All runs send the same bits.
//
//     tool_time [VECTOR_SET]
#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <vector>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace {

using namespace palpate;
using Clock = std::chrono::steady_clock;
constexpr std::size_t runs = 5, ticks = 5000, ticks_of_frame = 33;

HandPose hand_at(double t) {
  const double height = 0.03 * std::max(1.0 - t, 0.0);
  const double turn = t > 2.0 ? 0.15 * std::sin(5.0 * t) : 0.0;
  const Vec3 at(0.03 * std::sin(2.0 * t), 0.03 * std::cos(2.0 * t), height - 2e-3);
  return {at, rotation_by({turn, 0.5 * turn, 0.3 * std::sin(t)})};
}

void time(int points, std::size_t cameras, int width, double friction) {
  const auto shape = make_tool("box:40x20x5mm?points=" + std::to_string(points), {});
  std::vector<std::vector<Frame>> frames(cameras);
  for (std::size_t c = 0; c < cameras; ++c) {
    CameraSetup setup;
    setup.intrinsics = pinhole(width, width * 3 / 4, 0.995);
    setup.world_from_camera = looking_at_origin(0.45, 0.3, 1.5 * static_cast<double>(c));
    Part ground;
    ground.shape = HalfSpace{};
    SyntheticCamera camera(Scene({ground}), setup, SensorModel::named("d4xx"));
    for (std::uint64_t k = 0; k * ticks_of_frame < ticks; ++k)
      frames[c].push_back(camera.capture(static_cast<double>(k * ticks_of_frame) * 1e-3, k));
  }
  Parameters parameters;
  parameters.friction.friction = friction;
  std::vector<double> took(ticks, 1e9);
  std::uint64_t bits = 0;
  std::size_t steps = 0;
  for (std::size_t run = 0; run < runs; ++run) {
    const auto method = make_method("sight", parameters, standard_methods(), shape);
    bits = steps = 0;
    for (std::size_t i = 0; i < ticks; ++i) {
      const double t = static_cast<double>(i) * 1e-3;
      const HandPose hand = hand_at(t);
      const auto began = Clock::now();
      for (std::size_t c = 0; c < cameras && i % ticks_of_frame == 0; ++c) {
        const Frame& frame = frames[c][i / ticks_of_frame];
        method->observe({*frame.cloud, frame.stamp, c});
      }
      const Tick tick = method->tick(hand, t);
      const std::chrono::duration<double, std::micro> elapsed = Clock::now() - began;
      took[i] = std::min(took[i], elapsed.count());
      steps += static_cast<std::size_t>(tick.steps);
      for (int axis = 0; axis < 3; ++axis)
        bits = 31 * (31 * bits + std::bit_cast<std::uint64_t>(tick.force[axis])) +
               std::bit_cast<std::uint64_t>(tick.torque[axis]);
    }
  }
  double sum = 0.0;
  for (const double each : took) sum += each;
  std::sort(took.begin(), took.end());
  std::printf("%6d %8zu %6d %9.1f %7.1f %8.1f %8.1f %7.1f  %016llx\n", points, cameras, width,
              friction, took[ticks / 2], took[ticks - 1 - ticks / 1000], took.back(),
              1e3 * sum / (static_cast<double>(steps) * points),
              static_cast<unsigned long long>(bits));
}

}  // namespace

int main(int count, char** arguments) {
  if (count > 1) use_vector_set(arguments[1]);
  std::printf("%s, microseconds a tick, nanoseconds a point and step\n",
              std::string(vector_set_in_use()).c_str());
  std::puts("points  cameras  width  friction  median    p99.9     most ns/point  bits");
  for (const int points : {500, 2000, 10000}) time(points, 1, 640, 0.0);
  time(10000, 1, 640, 0.5);
  time(10000, 2, 640, 0.0);
  time(10000, 1, 1280, 0.0);
}
