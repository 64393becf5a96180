// SPDX-License-Identifier: Apache-2.0
// Times a tick of a tool with a shape, frames included: a plate that is pressed into a plane in
// front of a D4xx at 0.45 m, slides and tips for five seconds. Each tick is timed as the least of
// five equal runs, which leaves out what else the computer did. All runs send the same bits.
//
//     tool_time [VECTOR_SET]
//
// Or times a splat of flat Gaussians on balls of 1 and 0.5 m, two million if no number is given:
// opened from a file that it writes, then windows while a hand goes round, in 500 steps, all by the
// time that the processor took.
//
//     tool_time splat [COUNT]
#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <string_view>
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

// [s] that the processor has worked on this process.
double seconds_since(std::clock_t then) {
  return static_cast<double>(std::clock() - then) / CLOCKS_PER_SEC;
}

// [B] of this process: "VmRSS", now, or "VmHWM", at most.
double memory(std::string_view which) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(which)) return 1024.0 * std::atof(line.substr(which.size() + 1).c_str());
  return 0.0;
}

void write_ball(const std::filesystem::path& path, std::size_t count, double radius) {
  std::ofstream file(path, std::ios::binary);
  file << "ply\nformat binary_little_endian 1.0\nelement vertex " << count << '\n';
  for (const char* name : {"x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
                           "rot_1", "rot_2", "rot_3"})
    file << "property float " << name << '\n';
  file << "end_header\n";
  const double n = static_cast<double>(count);
  const double apart = radius * std::sqrt(4.0 * std::numbers::pi / n);
  const auto wide = static_cast<float>(std::log(0.75 * apart));
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / n;
    const double angle = std::numbers::pi * (3.0 - std::sqrt(5.0)) * static_cast<double>(i);
    const double r = std::sqrt(1.0 - z * z);
    const Eigen::Vector3f out(static_cast<float>(r * std::cos(angle)),
                              static_cast<float>(r * std::sin(angle)), static_cast<float>(z));
    const auto turn = Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), out);
    const Eigen::Vector3f at = static_cast<float>(radius) * out;
    const std::array<float, 11> row{at.x(), at.y(),   at.z(),   3.0F,     wide,    wide,
                                    -9.0F,  turn.w(), turn.x(), turn.y(), turn.z()};
    file.write(reinterpret_cast<const char*>(row.data()), sizeof row);
  }
}

void time_splat(std::size_t count, double radius) {
  constexpr int steps = 500;
  const std::filesystem::path path = std::filesystem::temp_directory_path() / "tool_time.ply";
  write_ball(path, count, radius);
  const double before = memory("VmRSS");
  const std::clock_t began = std::clock();
  const auto camera = open_source("splat:" + path.string());
  const double opened = seconds_since(began);
  std::filesystem::remove(path);
  const double n = static_cast<double>(count);
  std::printf("%zu Gaussians on a ball of %g m opened in %.2f s, %.0f B each, %.0f at most\n",
              count, 2.0 * radius, opened, (memory("VmRSS") - before) / n,
              (memory("VmHWM") - before) / n);
  std::vector<double> took;
  std::size_t seen = 0;
  for (int i = 0; i < steps; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / steps;
    camera->follow((radius + 2e-3) * Vec3(std::sin(angle), 0.1, std::cos(angle)));
    const std::clock_t start = std::clock();
    const std::optional<Frame> frame = camera->next();
    took.push_back(1e3 * seconds_since(start));
    for (const std::uint16_t raw : frame->cloud->image()->depth()) seen += is_measured(raw) ? 1 : 0;
  }
  std::sort(took.begin(), took.end());
  std::printf("window: median %.2f, p99 %.2f, most %.2f ms, %.0f pixels\n", took[steps / 2],
              took[steps - 1 - steps / 100], took.back(), static_cast<double>(seen) / steps);
}

}  // namespace

int main(int count, char** arguments) {
  if (count > 1 && std::string_view(arguments[1]) == "splat") {
    for (const double radius : {0.5, 0.25})
      time_splat(count > 2 ? std::strtoull(arguments[2], nullptr, 10) : 2'000'000, radius);
    return 0;
  }
  if (count > 1) use_vector_set(arguments[1]);
  std::printf("%s, microseconds a tick, nanoseconds a point and step\n",
              std::string(vector_set_in_use()).c_str());
  std::puts("points  cameras  width  friction  median    p99.9     most ns/point  bits");
  for (const int points : {500, 2000, 10000}) time(points, 1, 640, 0.0);
  time(10000, 1, 640, 0.5);
  time(10000, 2, 640, 0.0);
  time(10000, 1, 1280, 0.0);
}
