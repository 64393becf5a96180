// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include <palpate/kernel/cloud/depth_image.hpp>
#include <palpate/kernel/methods/methods.hpp>

int main() {
  // A camera that looks at a wall one metre away: every pixel reads 1000 mm.
  const auto rays = std::make_shared<palpate::ViewingRays>(
      palpate::Intrinsics{.width = 640, .height = 480, .fx = 525, .fy = 525, .cx = 320, .cy = 240});
  const palpate::DepthImage wall(rays, std::vector<std::uint16_t>(640 * 480, 1000), 1000.0);

  const std::unique_ptr<palpate::Method> touch = palpate::make_method();
  touch->observe({wall, 0.0});
  for (int ms = 0; ms <= 40; ++ms) {  // a hand pushes through the wall at 1 m/s
    const double t = 1e-3 * ms;
    const palpate::Tick tick = touch->tick({0.0, 0.0, 0.98 + t}, t);
    std::printf("hand at %.3f m, proxy at %.3f m, force %.1f N\n", tick.hip.z(), tick.proxy.z(),
                tick.force.norm());
  }
}
