// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/material_map.hpp"
#include "palpate/kernel/feel/feel.hpp"
#include "palpate/kernel/methods/methods.hpp"

namespace palpate {
namespace test_materials {

constexpr double pi = std::numbers::pi;

// A plane at z = 0 without any camera: the coupling's spring alone.
class Flat : public Method {
 public:
  explicit Flat(const Parameters& parameters) : parameters_(parameters) {}
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override {}
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick;
    tick.t = t;
    tick.hip = hip;
    if (!is_place(hip)) {
      tick.flags = non_finite_input;
      return tick;
    }
    const double r_c = parameters_.proxy.r_c();
    tick.proxy = Vec3(hip.x(), hip.y(), std::max(hip.z(), r_c));
    tick.normal = Vec3::UnitZ();
    tick.force = std::min(parameters_.coupling.stiffness * std::max(-hip.z(), 0.0),
                          parameters_.coupling.max_force) *
                 Vec3::UnitZ();
    tick.state = hip.z() < r_c ? ContactState::contact : ContactState::free_motion;
    return tick;
  }
  void set_parameters(const Parameters& parameters) noexcept override { parameters_ = parameters; }

 private:
  Parameters parameters_;
};

std::unique_ptr<Feel> around_flat(const Parameters& parameters) {
  return std::make_unique<Feel>(std::make_unique<Flat>(parameters), parameters);
}

// The HIP of a hand that is pressed in by `depth` [m] at `x`, `y`.
Vec3 pressed(double depth, double x = 0.0, double y = 0.0) { return {x, y, -depth}; }

// A wall of pixels at z = 0 seen from 0.4 m above, 0.5 mm apart, whose pixels are labelled by the
// place that they see.
std::shared_ptr<const DepthImage> labelled_wall(
    const MaterialTable& table, const std::function<std::uint8_t(const Vec3&)>& label,
    const std::function<double(const Vec3&)>& brightness = {}) {
  constexpr int width = 240;
  constexpr int height = 120;
  const auto rays = std::make_shared<const ViewingRays>(
      Intrinsics{.width = width, .height = height, .fx = 800, .fy = 800, .cx = 119.5, .cy = 59.5});
  Eigen::Isometry3d down = Eigen::Isometry3d::Identity();
  down.linear() = Eigen::AngleAxisd(pi, Vec3::UnitX()).toRotationMatrix();
  down.translation() = Vec3(0, 0, 0.4);
  auto image = std::make_shared<DepthImage>(
      rays, std::vector<std::uint16_t>(std::size_t{width} * height, std::uint16_t{4000}), 10000.0,
      down);
  std::vector<std::uint8_t> labels;
  std::vector<std::uint8_t> bright;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const Vec3 place = *image->deproject(u, v);
      labels.push_back(label(place));
      if (brightness)
        bright.push_back(static_cast<std::uint8_t>(std::lround(255.0 * brightness(place))));
    }
  }
  image->set_materials(std::make_shared<LabelImage>(std::make_shared<MaterialTable>(table),
                                                    std::move(labels), std::move(bright)));
  return image;
}

MaterialTable soft_and_hard() {
  MaterialTable table{
      .materials = {{.name = "soft", .material = {}}, {.name = "hard", .material = {}}}};
  table.materials[0].material.stiffness = 150.0;
  return table;
}

TEST(Materials, AreAsHardAsTheMapSays) {
  for (const std::string name : {"paper", "sight"}) {
    const auto camera =
        open_synthetic_camera(Uri("synthetic:plane?distance=0.5m&size=160x120&sensor=ideal"));
    MaterialTable table = soft_and_hard();
    table.materials[1].material.stiffness = 400.0;
    const auto shared = std::make_shared<const MaterialTable>(table);
    const auto method = make_method(name);
    const auto bare = standard_methods().find(name).make({});
    bare->seat(Vec3(-0.02, 0, 0.03));
    method->seat(Vec3(-0.02, 0, 0.03));
    double softest = 0.0;
    double hardest = 0.0;
    std::shared_ptr<const Cloud> in_use;
    for (int frame = 0; frame < 60; ++frame) {
      const double stamp = frame / 30.0;
      const Frame captured = camera->capture(stamp, static_cast<std::uint64_t>(frame));
      auto image = std::make_shared<DepthImage>(dynamic_cast<const DepthImage&>(*captured.cloud));
      std::vector<std::uint8_t> labels;
      for (int v = 0; v < 120; ++v) {
        for (int u = 0; u < 160; ++u) {
          const auto place = image->deproject(u, v);
          labels.push_back(place && place->x() > 0.0 ? 2 : 1);
        }
      }
      image->set_materials(std::make_shared<LabelImage>(shared, std::move(labels)));
      method->observe({*image, stamp});
      bare->observe({*image, stamp});
      in_use = image;
      for (int i = 0; i < 33; ++i) {
        const double t = stamp + i * 1e-3;
        // Down on the soft half, up, over, down on the hard one.
        const double x = t < 1.0 ? -0.02 : 0.02;
        const double in = std::fmod(t, 1.0);
        const double depth = in < 0.5 ? 0.02 * in - 0.006 : 0.004 - 0.04 * (in - 0.5);
        const Tick tick = method->tick(pressed(depth, x), t);
        const Tick full = bare->tick(pressed(depth, x), t);
        if (std::abs(in - 0.5) > 0.02) continue;
        const double spring = 600.0 * tick.force.norm() / full.force.norm();
        (x < 0.0 ? softest : hardest) = spring;
      }
    }
    EXPECT_NEAR(softest, 150.0, 15.0) << name;
    EXPECT_NEAR(hardest, 400.0, 40.0) << name;
  }
}

// Sweeps from soft to hard and back at 0.1 m/s, pressed in by 4 mm. Returns what the force did on
// the hand [J] at most since the beginning, and the largest change of the force in a tick [N].
struct Sweep {
  double most = 0.0, step = 0.0, hardest = 0.0;
};

Sweep sweep(double friction, double speed) {
  Parameters parameters;
  parameters.friction.friction = friction;
  const MaterialTable table = [&] {
    MaterialTable t = soft_and_hard();
    for (NamedMaterial& m : t.materials) m.material.friction = friction;
    return t;
  }();
  const auto wall =
      labelled_wall(table, [](const Vec3& p) -> std::uint8_t { return p.x() < 0.0 ? 1 : 2; });
  const auto feel = around_flat(parameters);
  feel->observe({*wall, 0.0});
  Sweep sweep;
  Vec3 last_force = Vec3::Zero();
  Vec3 last_hip = pressed(-0.01, -0.03);
  double done = 0.0;
  double t = 0.0;
  const auto go = [&](const Vec3& to) {
    const Vec3 from = last_hip;
    const int ticks = std::max(1, static_cast<int>((to - from).norm() / speed / 1e-3));
    for (int i = 1; i <= ticks; ++i) {
      const Vec3 hip = from + static_cast<double>(i) / ticks * (to - from);
      const Tick tick = feel->tick(hip, t += 1e-3);
      done += last_force.dot(hip - last_hip);
      sweep.most = std::max(sweep.most, done);
      if (hip.z() == from.z() && std::abs(hip.x()) < 0.02)
        sweep.step = std::max(sweep.step, (tick.force - last_force).norm());
      sweep.hardest = std::max(sweep.hardest, tick.hardness);
      last_force = tick.force;
      last_hip = hip;
    }
  };
  for (int i = 0; i < 3; ++i) {
    go(pressed(0.004, -0.03));
    go(pressed(0.004, 0.03));
    go(pressed(0.004, -0.03));
    go(pressed(-0.002, -0.03));
  }
  return sweep;
}

// Hazard: material-energy
TEST(Materials, GiveBackNoMoreThanTheyTookOverABorder) {
  for (const double speed : {0.02, 0.1, 0.3}) {
    for (const double friction : {0.0, 0.3}) {
      // What a spring that is held over each tick makes at most, pressed in and let out: K v T u.
      const double of_hold = 600.0 * speed * 1e-3 * 0.004;
      const Sweep done = sweep(friction, speed);
      EXPECT_LE(done.most, of_hold + 1e-4) << speed << ' ' << friction;
      EXPECT_GT(done.hardest, 0.9) << "it must get hard, too";
      // 1.8 N over 3 mm, and the brake's own coming and going.
      EXPECT_LE(done.step, speed > 0.2 ? 0.3 : 0.15) << speed << ' ' << friction;
    }
  }
}

// Hazard: material-energy
TEST(Hardness, WaitsUnderAHandAtRestAndChangesWhenItComesOff) {
  Hardness hardness;
  const Vec3 push(0, 0, 2.0);
  const auto rest = [&](double wanted, const Vec3& force) {
    return hardness.update(wanted, force, 600.0, 0.0, Vec3::Zero(), Vec3::Zero()).share;
  };
  EXPECT_EQ(rest(0.2, push), 0.2);
  for (int i = 0; i < 1000; ++i) EXPECT_LT(rest(1.0, push), 0.21);
  EXPECT_EQ(rest(0.1, push), 0.1) << "softer at once";
  EXPECT_NEAR(rest(0.2, push), 0.2, 0.01) << "and back with what that gave";
  EXPECT_EQ(rest(1.0, Vec3::Zero()), 1.0);
  EXPECT_EQ(rest(1.0, push), 1.0);
}

// Hazard: material-energy
TEST(Hardness, NeverMakesEnergyWhateverTheMapAndTheHandDo) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0.05, 1.0);
  std::normal_distribution<double> step(0.0, 2e-4);
  constexpr double k = 800.0;
  for (int run = 0; run < 50; ++run) {
    Hardness hardness;
    Vec3 hip(0, 0, 1e-3);
    double wanted = 1.0;
    double done = 0.0;
    double allowed = 0.0;  // of the hold: half a step of the spring each tick, and each contact's
    Vec3 force = Vec3::Zero();
    for (int i = 0; i < 3000; ++i) {
      const Vec3 moved(step(random), step(random), step(random));
      hip += moved;
      hip.z() = std::clamp(hip.z(), -6e-3, 1e-3);
      const Vec3 by = hip - (hip - moved);
      done += force.dot(by);
      if (i % 40 == 0) wanted = share(random);
      const Vec3 push = k * std::max(-hip.z(), 0.0) * Vec3::UnitZ();
      const bool began = force.isZero() && !push.isZero();
      const Hardness::Felt felt = hardness.update(wanted, push, k, 0.0, by, by / 1e-3);
      allowed += 0.5 * k * by.z() * by.z() + (began ? 1e-5 : 0.0);
      // A damper that is held is passive up to 2 m / dt of a hand's mass; here its hold counts.
      allowed += felt.brake.norm() * 4.0 * 2e-4;
      force = felt.share * push + felt.brake;
    }
    EXPECT_LE(done, allowed) << run;
  }
}

TEST(Tap, RingsFromTheFirstTickInProportionToTheSpeed) {
  Parameters parameters;
  parameters.tap = {.tap = 3.0, .tap_frequency = 200.0, .tap_decay = 90.0};
  for (const double speed : {0.05, 0.1, 0.2, 0.3}) {
    // As a device reads positions: to 0.055 mm.
    for (const double count : {0.0, 0.055e-3}) {
      const auto feel = around_flat(parameters);
      std::vector<double> rings;
      double touched_at = -1.0;
      for (int i = 0; i < 400; ++i) {
        double z = 0.3 * speed - speed * i * 1e-3;
        if (count > 0.0) z = count * std::floor(z / count);
        const Tick tick = feel->tick(Vec3(0, 0, z), i * 1e-3);
        if (!tick.force.isZero() && touched_at < 0.0) touched_at = tick.t;
        if (touched_at >= 0.0) rings.push_back(tick.transient.z());
        EXPECT_LE(tick.transient.norm(), Tap::largest);
        EXPECT_LE(tick.force.norm(), parameters.coupling.max_force);
      }
      ASSERT_FALSE(rings.empty());
      EXPECT_NEAR(rings.front(), 3.0 * speed, 0.1 * 3.0 * speed) << speed << ' ' << count;
      const std::size_t half = 3;  // ticks: 2.5 ms are half a period
      EXPECT_LT(rings[half], 0.0);
      for (std::size_t i = 60; i < rings.size(); ++i) EXPECT_EQ(rings[i], 0.0);
    }
  }
}

// The same with rounding errors of 1e-8 N along the plane.
class Rounded final : public Flat {
 public:
  using Flat::Flat;
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = Flat::tick(hip, t);
    if (!tick.force.isZero(0.0)) tick.force.x() += 1e-8;
    return tick;
  }
};

TEST(Tap, RingsAlongTheNormalWhereTheForceIsOfRoundingErrors) {
  Parameters parameters;
  parameters.tap = {.tap = 2.0, .tap_frequency = 100.0, .tap_decay = 80.0};
  Feel feel(std::make_unique<Rounded>(parameters), parameters);
  double largest = 0.0;  // [N]
  for (int i = 0; i < 200; ++i) {
    // At 0.1 m/s to the plane, and 0.01 nm into it.
    const double depth = std::min(1e-4 * i - 0.01, 1e-11);
    const Vec3 ringing = feel.tick(pressed(depth), 1e-3 * i).transient;
    EXPECT_LE(ringing.head<2>().norm(), 1e-9) << i;
    largest = std::max(largest, ringing.norm());
  }
  EXPECT_GT(largest, 0.1);
}

// Hazard: material-force
TEST(Tap, IsOneForEachImpactBeforeANoisyCamera) {
  Parameters parameters;
  parameters.tap = {.tap = 5.0, .tap_frequency = 150.0, .tap_decay = 80.0};
  int strikes = 0;
  for (int seed = 1; seed <= 10; ++seed) {
    const auto camera = open_synthetic_camera(
        Uri("synthetic:plane?distance=0.7m&size=160x120&sensor=d4xx&seed=" + std::to_string(seed)));
    const auto method = make_method("sight", parameters);
    method->seat(Vec3(0, 0, 0.04));
    std::shared_ptr<const Cloud> in_use;
    double last = -1.0;
    for (int frame = 0; frame < 60; ++frame) {
      const double stamp = frame / 30.0;
      std::shared_ptr<const Cloud> cloud =
          camera->capture(stamp, static_cast<std::uint64_t>(frame)).cloud;
      method->observe({*cloud, stamp});
      in_use = cloud;
      for (int i = 0; i < 33; ++i) {
        const double t = stamp + i * 1e-3;
        // Down at 0.15 m/s, and gently to the very surface, where noise parts hand and surface
        // again and again.
        const double z =
            std::max({0.04 - 0.15 * t, -0.004, std::min(-0.0005, -0.004 + 0.02 * (t - 0.5))});
        const Tick tick = method->tick(Vec3(0, 0, z), t);
        if (tick.transient.isZero()) continue;
        if (t - last > 0.07) ++strikes;
        last = t;
      }
    }
  }
  EXPECT_GE(strikes, 8);
  EXPECT_LE(strikes, 10);
}

// Power [1/Hz] of a signal of `rate` [Hz] about `frequency`, by Hann windows of `size`.
double power_at(const std::vector<double>& signal, double rate, double frequency,
                std::size_t size) {
  double sum = 0.0;
  int windows = 0;
  for (std::size_t begin = 0; begin + size <= signal.size(); begin += size / 2) {
    std::complex<double> at = 0.0;
    double weights = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      const double w =
          0.5 - 0.5 * std::cos(2.0 * pi * static_cast<double>(i) / static_cast<double>(size));
      at += w * signal[begin + i] *
            std::polar(1.0, -2.0 * pi * frequency * static_cast<double>(i) / rate);
      weights += w * w;
    }
    sum += std::norm(at) / (weights * rate);
    ++windows;
  }
  return 2.0 * sum / windows;
}

TEST(Grain, HasTheSpectrumOfItsSpeedWhateverTheRate) {
  for (const double rate : {1000.0, 4000.0}) {
    for (const double centre : {80.0, 150.0, 300.0}) {
      Grain grain;
      std::vector<double> signal;
      constexpr double length = 1e-3;
      for (int i = 0; i < static_cast<int>(60.0 * rate); ++i)
        signal.push_back(grain.update(length, centre * length, 1.0 / rate));
      for (double f = 40.0; f <= 400.0; f *= 1.25) {
        // Two resonances, at both signs of the frequency, and what is folded over half of the rate.
        const double g = Grain::half_width * centre;
        const auto resonance = [&](double at) {
          return 2.0 * (g / pi) / (2.0 * ((at - centre) * (at - centre) + g * g)) +
                 2.0 * (g / pi) / (2.0 * ((at + centre) * (at + centre) + g * g));
        };
        double expected = 0.0;
        for (int fold = -4; fold <= 4; ++fold) expected += resonance(f + fold * rate);
        const double measured = power_at(signal, rate, f, static_cast<std::size_t>(rate / 4.0));
        EXPECT_NEAR(10.0 * std::log10(measured / expected), 0.0, 3.0)
            << rate << ' ' << centre << ' ' << f;
      }
    }
  }
}

// Hazard: material-force
TEST(Grain, IsSilentAtRest) {
  Parameters parameters;
  parameters.texture.grain = 0.2;
  const auto feel = around_flat(parameters);
  std::mt19937 random(3);
  std::uniform_int_distribution<int> count(0, 1);
  double most = 0.0;
  double moving = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const bool slides = i >= 2000;
    // A hand at rest, as an encoder reads it: one count of 0.055 mm to and fro now and then.
    const double x =
        slides ? 0.1 * (i - 2000) * 1e-3 : (i % 50 == 0 ? 0.055e-3 * count(random) : 0);
    const Tick tick = feel->tick(pressed(0.003, x), i * 1e-3);
    const double off = std::abs(tick.force.norm() - 1.8);
    if (!slides && i > 5) most = std::max(most, off);
    if (slides) moving = std::max(moving, off);
  }
  EXPECT_LT(most, 0.03);
  EXPECT_GT(moving, 0.2);
}

TEST(Relief, LeansAgainstWhatGetsBrighter) {
  Parameters parameters;
  MaterialTable table{.materials = {{.name = "print", .material = {}}}};
  table.materials[0].material.texture.relief = 1e-3;
  constexpr double wave = 20e-3;  // [m]
  const auto wall = labelled_wall(
      table, [](const Vec3&) -> std::uint8_t { return 1; },
      [](const Vec3& p) { return 0.5 + 0.4 * std::sin(2.0 * pi * p.x() / wave); });
  const auto feel = around_flat(parameters);
  feel->observe({*wall, 0.0});
  for (int i = 0; i < 400; ++i) {
    const double x = -0.02 + i * 1e-4;
    const Tick tick = feel->tick(pressed(0.003, x), i * 1e-3);
    if (i < 10) continue;
    const double rise = 1e-3 * 0.4 * 2.0 * pi / wave * std::cos(2.0 * pi * x / wave);
    EXPECT_NEAR(tick.force.x(), -1.8 * rise, 0.03) << x;
    EXPECT_NEAR(tick.force.y(), 0.0, 0.01);
    EXPECT_NEAR(tick.force.z(), 1.8, 1e-9);
  }
}

// Hazard: material-force
TEST(Materials, AreFeltWithinTheLimitWhateverTheHandDoes) {
  MaterialTable table;
  for (const NamedMaterial& m : standard_materials().materials) table.materials.push_back(m);
  table.materials.front().material.texture.relief = 4e-3;
  std::mt19937 random(9);
  const auto wall = labelled_wall(
      table, [&](const Vec3&) { return static_cast<std::uint8_t>(random() % 12); },
      [&](const Vec3&) { return static_cast<double>(random() % 256) / 255.0; });
  Parameters parameters;
  parameters.coupling.max_force = 2.5;
  const auto feel = around_flat(parameters);
  std::normal_distribution<double> noise(0.0, 1.0);
  Vec3 hip = pressed(0.002);
  for (int i = 0; i < 20000; ++i) {
    if (i % 33 == 0) feel->observe({*wall, i * 1e-3});
    hip += 3e-4 * Vec3(noise(random), noise(random), noise(random));
    hip = hip.cwiseMax(Vec3(-0.05, -0.03, -0.01)).cwiseMin(Vec3(0.05, 0.03, 0.012));
    Vec3 given = hip;
    if (i % 997 == 0) given *= 1e7;
    if (i % 991 == 0) given.x() = std::nan("");
    const Tick tick = feel->tick(given, (i % 983 == 0 ? -1.0 : 1.0) * i * 1e-3);
    if (!given.allFinite()) continue;
    ASSERT_TRUE(tick.force.allFinite()) << i;
    ASSERT_LE(tick.force.norm(), 2.5) << i;
    ASSERT_LE(tick.transient.norm(), 2.5) << i;
    ASSERT_GE(tick.hardness, 0.0);
    ASSERT_LE(tick.hardness, 1.0);
  }
}

TEST(Materials, OfASceneAreThoseOfItsParametersWhereTheMapHasNone) {
  Parameters parameters;
  parameters.friction.friction = 0.5;
  const auto wall = labelled_wall(
      soft_and_hard(), [](const Vec3& p) -> std::uint8_t { return p.x() < 0.0 ? 1 : 0; });
  const auto feel = around_flat(parameters);
  feel->observe({*wall, 0.0});
  EXPECT_NEAR(feel->tick(pressed(0.002, -0.02), 0.0).hardness, 0.25, 1e-9);
  feel->tick(pressed(-0.02, 0.02), 0.1);
  Tick tick;
  for (int i = 0; i < 300; ++i) tick = feel->tick(pressed(0.002, 0.02 + i * 1e-4), 0.2 + i * 1e-3);
  EXPECT_EQ(tick.hardness, 1.0);
  EXPECT_NEAR(-tick.force.x() / tick.force.z(), 0.4, 0.02);
}

}  // namespace test_materials
}  // namespace palpate
