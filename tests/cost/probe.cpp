// SPDX-License-Identifier: Apache-2.0
#include "tests/cost/probe.hpp"

#include <cmath>
#include <random>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/paper/proxy.hpp"

namespace palpate {

Probe probe() {
  Probe result;
  std::mt19937 random(7);
  const auto uniform = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (const bool distorted : {false, true}) {
    Intrinsics k{.width = 160,
                 .height = 120,
                 .fx = 400,
                 .fy = 410,
                 .cx = 81.3,
                 .cy = 58.9,
                 .distortion = {}};
    if (distorted) k.distortion = {0.1, -0.05, 1e-3, -1e-3, 0.01, 0, 0, 0};
    std::vector<std::uint16_t> depth;
    for (int i = 0; i < k.width * k.height; ++i) {
      const bool hole = i % 53 == 0;
      depth.push_back(
          hole ? std::uint16_t{0}
               : static_cast<std::uint16_t>(2500 + 40 * std::sin(i * 0.03) + uniform(-5, 5)));
    }
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() =
        Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
    const DepthImage image(std::make_shared<ViewingRays>(k), depth, 5000.0, pose);
    ProxyParameters proxy;
    proxy.step_budget = 0;  // one look
    Patch patch;
    for (int i = 0; i < 40; ++i) {
      // At the surface, at the image's borders, and a ball so large that it is thinned.
      const Ball ball{pose * Vec3(uniform(-0.11, 0.11), uniform(-0.08, 0.08), uniform(0.49, 0.51)),
                      i == 39 ? 0.2 : uniform(0.004, 0.03)};
      patch.start(ball);
      image.gather(ball, i == 39 ? 2000 : Patch::capacity, patch);
      result.points.push_back(patch.size());
      Vec3 mean = Vec3::Zero();
      for (std::size_t p = 0; p < patch.size(); ++p)
        mean += Vec3(patch.x()[p], patch.y()[p], patch.z()[p]) / static_cast<double>(patch.size());
      const Vec3 at = ball.centre + 0.3 * ball.radius * Vec3(0.5, -0.3, 0.2);
      const Vec3 direction = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized();
      proxy.r_1 = 0.2 * ball.radius;  // so that the patch covers r_3 about `at`
      proxy.r_2 = 0.21 * ball.radius;
      proxy.r_3 = 0.8 * ball.radius;
      ProxyMovement look{.at = at};
      move_proxy(patch, at, proxy, 1.0, false, look);
      const double clear = clear_travel(patch, at, direction, proxy.r_c());
      const double escape = escape_travel(patch, at, direction, proxy);
      for (const double value :
           {mean.x(), mean.y(), mean.z(), look.normal.x(), look.normal.y(), look.normal.z(),
            static_cast<double>(look.state), std::min(clear, 1.0), escape})
        result.sums.push_back(value);
    }
  }
  return result;
}

}  // namespace palpate
