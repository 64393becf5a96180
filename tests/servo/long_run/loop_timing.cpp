// SPDX-License-Identifier: Apache-2.0
// loop_timing [SECONDS [HZ]]: a servo loop at work beside one that does nothing, by hand.
//
// A 640x480 camera at 30 Hz shows a noisy plane at 0.8 m; the hand draws circles on it, 5 mm deep.
// Put load on the machine as you like. Prints what both threads were granted, how late they woke up
// and, by the thread's own CPU clock, how long their cycles took.
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/servo_loop.hpp"

namespace palpate {
namespace {

class Circling final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override {
    const double depth = t - began_ < 3.0 ? 0.75 : 0.805;
    return {.position = {0.05 * std::cos(2 * t), 0.05 * std::sin(2 * t), depth}};
  }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  double began_ = monotonic_now();
  DeviceInfo info_{.uri = "circling:", .kind = "circles", .limits = no_motors};
};

void print(const char* name, const RealtimeReport& granted, const Timing& timing) {
  std::printf("%s: fifo %d, locked %d, core %d, awake %d; %llu ticks, %llu late, %llu by compute\n",
              name, granted.priority, granted.locked, granted.core, granted.awake,
              static_cast<unsigned long long>(timing.wake_up.count()),
              static_cast<unsigned long long>(timing.late_ticks.load()),
              static_cast<unsigned long long>(timing.late_by_compute.load()));
  for (const auto* histogram : {&timing.wake_up, &timing.compute}) {
    std::printf("  %s [us]: p50 %.1f  p99 %.1f  p99.9 %.1f  p99.99 %.1f  max %.1f\n",
                histogram == &timing.wake_up ? "wake-up" : "compute",
                1e-3 * static_cast<double>(histogram->quantile(0.5)),
                1e-3 * static_cast<double>(histogram->quantile(0.99)),
                1e-3 * static_cast<double>(histogram->quantile(0.999)),
                1e-3 * static_cast<double>(histogram->quantile(0.9999)),
                1e-3 * static_cast<double>(histogram->max()));
  }
}

void run(double seconds, double rate) {
  const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = 640, .height = 480, .fx = 570, .fy = 570, .cx = 319.5, .cy = 239.5});
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<std::vector<std::uint16_t>> images(10, std::vector<std::uint16_t>(640 * 480));
  for (auto& image : images) {
    for (auto& reading : image) reading = static_cast<std::uint16_t>(800.0 + noise(random));
  }

  Circling device;
  ServoLoop loop(make_method("paper"), device, {}, {.rate = rate});
  loop.start();
  RealtimeRequest anywhere;
  anywhere.pin = false;
  PeriodicThread null_loop(rate, anywhere, [](const Wake&) {});
  const double end = monotonic_now() + seconds;
  for (std::size_t frame = 0; monotonic_now() < end; ++frame) {
    loop.cycle().put_frame(
        std::make_shared<DepthImage>(rays, images[frame % images.size()], 1000.0), monotonic_now(),
        monotonic_now());
    std::this_thread::sleep_for(std::chrono::microseconds(33'333));
  }
  loop.stop();
  null_loop.stop();
  print("loop", loop.realtime(), loop.timing());
  print("null", null_loop.realtime(), null_loop.timing());
  const CycleStatistics& did = loop.statistics();
  std::printf(
      "frames adopted %llu, dropped %llu; "
      "frame to tick [us]: p50 %.0f  p99 %.0f  max %.0f\n",
      static_cast<unsigned long long>(did.frames_adopted.load()),
      static_cast<unsigned long long>(did.frames_dropped.load()),
      1e-3 * static_cast<double>(did.hand_over.quantile(0.5)),
      1e-3 * static_cast<double>(did.hand_over.quantile(0.99)),
      1e-3 * static_cast<double>(did.hand_over.max()));
}

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  palpate::run(argc > 1 ? std::strtod(argv[1], nullptr) : 60.0,
               argc > 2 ? std::strtod(argv[2], nullptr) : 1000.0);
}
