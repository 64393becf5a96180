// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/feel/feel.hpp"
#include "palpate/kernel/methods/methods.hpp"

#include "tests/support/allocations.hpp"

namespace palpate {
namespace test_feel {

constexpr double dt = 1e-3;

// A camera that looks at a resting plane, and a hand that presses, slides along x and lifts.
class Plane {
 public:
  explicit Plane(const std::string& sensor)
      : camera_(open_synthetic_camera(
            Uri("synthetic:plane?distance=0.5m&size=160x120&sensor=" + sensor + "&seed=4"))) {}

  // Plays it to a method. @param on_tick  (tick)
  template <class OnTick>
  void play(Method& method, const OnTick& on_tick) {
    std::shared_ptr<const Cloud> in_use;
    method.seat(Vec3(0, 0, 0.03));
    for (int frame = 0; frame < 45; ++frame) {
      const double stamp = frame / 30.0;
      std::shared_ptr<const Cloud> cloud =
          camera_->capture(stamp, static_cast<std::uint64_t>(frame)).cloud;
      method.observe({*cloud, stamp});
      in_use = std::move(cloud);
      for (int i = 0; i < 33; ++i) {
        const double t = stamp + i * dt;
        const double x = 0.05 * std::clamp(t - 0.5, 0.0, 0.5);
        const double z = t < 1.2 ? std::max(0.03 - 0.2 * t, -0.005) : -0.005 + 0.2 * (t - 1.2);
        on_tick(method.tick(Vec3(x, 0, z), t));
      }
    }
  }

 private:
  std::unique_ptr<SyntheticCamera> camera_;
};

Parameters with_friction(double coefficient) {
  Parameters parameters;
  parameters.friction.friction = coefficient;
  return parameters;
}

TEST(Feel, WithoutFrictionPassesTheMethodsTicksOn) {
  Plane plane("d4xx");
  const auto bare = standard_methods().find("sight").make({});
  const auto whole = make_method("sight");
  std::vector<Tick> expected;
  plane.play(*bare, [&](const Tick& tick) { expected.push_back(tick); });
  std::size_t i = 0;
  plane.play(*whole, [&](const Tick& tick) {
    ASSERT_EQ(tick.force, expected[i].force) << i;
    ASSERT_EQ(tick.proxy, expected[i].proxy) << i;
    ASSERT_EQ(tick.flags, expected[i].flags) << i;
    ++i;
  });
}

TEST(Feel, AddsFrictionToEachMethodsForce) {
  for (const std::string name : {"paper", "sight"}) {
    Plane plane("ideal");
    const auto bare = standard_methods().find(name).make({});
    const auto whole = make_method(name, with_friction(0.5));
    std::vector<Tick> expected;
    plane.play(*bare, [&](const Tick& tick) { expected.push_back(tick); });
    std::size_t i = 0;
    plane.play(*whole, [&](const Tick& tick) {
      const Tick& without = expected[i++];
      EXPECT_EQ(tick.proxy, without.proxy);
      const Vec3 added = tick.force - without.force;
      const double push = without.force.norm();
      EXPECT_NEAR(added.dot(without.force), 0.0, 1e-9);
      EXPECT_LE(added.norm(), 0.5 * push + 1e-9) << tick.t;
      if (tick.t > 0.6 && tick.t < 1.0) {
        EXPECT_NEAR(-added.x(), 0.4 * push, 0.04 * push) << name << ' ' << tick.t;
      }
      if (push == 0.0) {
        EXPECT_EQ(tick.force, Vec3(Vec3::Zero())) << tick.t;
      }
    });
  }
}

// Hazard: material-force
// Presses along z, on a surface whose motion as estimated leans off z.
class Leaning final : public Method {
 public:
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    return {.t = t,
            .hip = hip,
            .normal = Vec3::UnitZ(),
            .force = 3.0 * Vec3::UnitZ(),
            .surface_motion = 0.06 * Vec3(0.03, 0.0, 1.0)};
  }
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}
};

TEST(Feel, DragsNoHandAsideThatASurfaceLifts) {
  Feel feel(std::make_unique<Leaning>(), with_friction(0.6));
  for (int i = 0; i < 1000; ++i) {
    const double t = i * dt;
    const Tick tick = feel.tick(Vec3(0, 0, 0.06 * t), t);
    ASSERT_NEAR(tick.force.head<2>().norm(), 0.0, 1e-12) << t;  // [N]
  }
}

TEST(Feel, KeepsWithinTheLimitOfTheForce) {
  Plane plane("ideal");
  Parameters parameters = with_friction(2.0);
  parameters.coupling.max_force = 2.0;
  const auto whole = make_method("sight", parameters);
  double most = 0.0;
  plane.play(*whole, [&](const Tick& tick) {
    EXPECT_LE(tick.force.norm(), 2.0);
    most = std::max(most, tick.force.norm());
  });
  EXPECT_GT(most, 1.9);
}

TEST(Feel, TakesWhateverHandsSend) {
  std::mt19937 random(8);
  std::normal_distribution<double> noise(0.0, 1.0);
  Parameters parameters = with_friction(1.5);
  parameters.friction.viscosity = 5.0;
  const auto whole = make_method("sight", parameters);
  const auto camera = open_synthetic_camera(Uri("synthetic:plane?size=80x60&sensor=ideal"));
  const std::shared_ptr<const Cloud> cloud = camera->capture(0.0, 0).cloud;
  constexpr double infinite = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 20000; ++i) {
    if (i % 33 == 0) whole->observe({*cloud, i * dt});
    Vec3 hip = 0.02 * Vec3(noise(random), noise(random), noise(random));
    double t = i * dt;
    if (i % 97 == 0) hip.x() = std::nan("");
    if (i % 101 == 0) hip.y() = infinite;
    if (i % 103 == 0) hip *= 1e5;
    if (i % 107 == 0) t -= 5.0;  // back in time
    if (i % 109 == 0) whole->seat(hip);
    const Tick tick = whole->tick(hip, t);
    ASSERT_TRUE(tick.force.allFinite()) << i;
    ASSERT_LE(tick.force.norm(), parameters.coupling.max_force) << i;
  }
}

TEST(Feel, TurnsFrictionOnAndOffBetweenTicks) {
  Plane plane("ideal");
  const auto whole = make_method("sight", with_friction(0.5));
  int ticks = 0;
  plane.play(*whole, [&](const Tick& tick) {
    const bool on = (ticks / 50) % 2 == 0;
    if (ticks > 600 && ticks < 1000 && ticks % 50 != 0) {
      EXPECT_EQ(std::abs(tick.force.x()) > 0.01 * tick.force.z(), on) << ticks;
    }
    ++ticks;
    if (ticks % 50 == 0) whole->set_parameters(with_friction((ticks / 50) % 2 == 0 ? 0.5 : 0.0));
  });
}

TEST(Feel, AllocatesNothingInATick) {
  const auto whole = make_method("sight", with_friction(0.5));
  const auto camera = open_synthetic_camera(Uri("synthetic:plane?size=160x120&sensor=ideal"));
  const std::shared_ptr<const Cloud> cloud = camera->capture(0.0, 0).cloud;
  whole->seat(Vec3(0, 0, 0.03));
  whole->observe({*cloud, 0.0});
  if (!test::memory_is_counted) GTEST_SKIP() << "the sanitizer has its own operator new";
  const test::MemoryCalls calls;
  Vec3 sum = Vec3::Zero();
  for (int i = 0; i < 200; ++i)
    sum += whole->tick(Vec3(1e-4 * i, 0, 0.015 - 1e-4 * i), i * dt).force;
  EXPECT_EQ(calls.count(), 0U);
  EXPECT_LT(sum.x(), 0.0);
}

}  // namespace test_feel
}  // namespace palpate
