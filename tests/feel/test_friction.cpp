// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/feel/friction.hpp"

namespace palpate {
namespace test_friction {

constexpr double dt = 1e-3;
constexpr double push = 3.0;  // [N]

FrictionParameters rubber() {
  FrictionParameters p;
  p.friction = 0.6;
  return p;
}

Friction friction_of(const FrictionParameters& p) {
  Friction friction;
  friction.set(p);
  return friction;
}

// The tangential force after each millisecond of sliding on a level plane along x.
std::vector<Vec3> slide(Friction& friction, double speed, double seconds) {
  std::vector<Vec3> forces;
  for (int i = 0; i < static_cast<int>(seconds / dt); ++i)
    forces.push_back(
        friction.update(Vec3(0, 0, push), Vec3(speed * dt, 0, 0), Vec3(speed, 0, 0), dt));
  return forces;
}

TEST(Friction, OfFastSlidingIsTheKineticCoefficientTimesTheNormalForce) {
  for (const double mu : {0.1, 0.5, 1.0}) {
    for (const double speed : {0.08, 0.15, 0.3}) {
      FrictionParameters p = rubber();
      p.friction = mu;
      Friction friction = friction_of(p);
      const Vec3 force = slide(friction, speed, 0.5).back();
      EXPECT_NEAR(-force.x() / push, 0.8 * mu, 1e-3 * mu) << mu << ' ' << speed;
      EXPECT_EQ(force.y(), 0.0);
      EXPECT_EQ(force.z(), 0.0);
    }
  }
}

TEST(Friction, BreaksLooseAtTheStaticCoefficient) {
  // A hand that is pulled along slowly: the force rises with the bristle's stiffness to mu_s N.
  FrictionParameters p = rubber();
  p.bristle_damping = 0.0;
  Friction friction = friction_of(p);
  double most = 0.0;
  const std::vector<Vec3> forces = slide(friction, 1e-3, 6.0);
  for (const Vec3& force : forces) most = std::max(most, force.norm());
  EXPECT_NEAR(std::atan(most / push), std::atan(p.friction), std::numbers::pi / 180.0);
  EXPECT_NEAR(-forces[999].x(), p.bristle_stiffness * 1e-3, 1e-9);
}

TEST(Friction, IsNeverMoreThanTheStaticCoefficientAllows) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 1.0);
  Friction friction = friction_of(rubber());
  for (int i = 0; i < 20000; ++i) {
    const Vec3 normal = Vec3(noise(random), noise(random), noise(random) + 3.0).normalized();
    const double size = std::abs(noise(random)) * 2.0;
    const Vec3 moved = 1e-3 * Vec3(noise(random), noise(random), noise(random));
    const Vec3 force = friction.update(size * normal, moved, moved / dt, dt);
    EXPECT_LE(force.norm(), 0.6 * size * (1.0 + 1e-12));
    EXPECT_NEAR(force.dot(normal), 0.0, 1e-9);
  }
}

TEST(Friction, HoldsAHandForEverInNoise) {
  // Half of what breaks loose, a normal force that dips, a hand that trembles: LuGre's bristle
  // creeps here.
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 1.0);
  FrictionParameters p = rubber();
  p.bristle_damping = 0.0;
  Friction friction = friction_of(p);
  const double pull = 0.5 * p.friction * push;
  const double start = pull / p.bristle_stiffness;
  friction.update(Vec3(0, 0, push), Vec3::Zero(), Vec3::Zero(), dt);
  double x = 0.0;
  double dip = 0.0;
  Vec3 force = Vec3::Zero();
  for (int i = 0; i < 60000; ++i) {
    const double to = start + 20e-6 * noise(random);
    // Noise that is another in each frame, 33 ms long, by up to 40 %.
    if (i % 33 == 0) dip = std::min(std::abs(noise(random)), 2.0) / 5.0;
    const double steady = push * (1.0 - dip);
    force = friction.update(Vec3(0, 0, steady), Vec3(to - x, 0, 0), Vec3((to - x) / dt, 0, 0), dt);
    x = to;
  }
  // The anchor is where the force says: it has not moved.
  force = friction.update(Vec3(0, 0, push), Vec3::Zero(), Vec3::Zero(), dt);
  EXPECT_NEAR(x + force.x() / p.bristle_stiffness, 0.0, 1e-9);
}

// Hazard: material-energy
TEST(Friction, MakesNoEnergyGoingToAndFro) {
  for (const double stroke : {0.2e-3, 1e-3, 10e-3}) {
    FrictionParameters p = rubber();
    Friction friction = friction_of(p);
    double work = 0.0;  // [J] done on the hand
    double most = -1.0;
    Vec3 last = Vec3::Zero();
    double x = 0.0;
    for (int i = 0; i < 20000; ++i) {
      const double t = i * dt;
      const double to = stroke * std::sin(2.0 * std::numbers::pi * 2.0 * t);
      work += last.x() * (to - x);
      most = std::max(most, work);
      last = friction.update(Vec3(0, 0, push), Vec3(to - x, 0, 0), Vec3((to - x) / dt, 0, 0), dt);
      x = to;
    }
    EXPECT_LT(most, 0.1e-3) << stroke;
    EXPECT_LT(work, 0.0) << stroke;
  }
}

TEST(Friction, SticksAndSlipsAsAMassOnABeltDoes) {
  // A mass on a spring, drawn along at constant speed, against the solution by pieces: it sticks
  // until the spring pulls with mu_s N, then swings against mu_k N until it stops.
  const double mass = 0.2, spring = 100.0, speed = 0.01;
  FrictionParameters p = rubber();
  p.stribeck_speed = 1e-3;
  p.bristle_stiffness = 20000.0;
  p.bristle_damping = 5.0;
  const double fine = 1e-5;
  Friction friction = friction_of(p);
  double x = 0.0, v = 0.0, drawn = 0.0;
  double last_slip = -1.0;
  std::vector<double> periods;
  bool slipping = false;
  for (int i = 0; i < 1200000; ++i) {
    drawn += speed * fine;
    const Vec3 drag = friction.update(Vec3(0, 0, push), Vec3(v * fine, 0, 0), Vec3(v, 0, 0), fine);
    v += (spring * (drawn - x) + drag.x()) / mass * fine;
    x += v * fine;
    const bool fast = v > 5.0 * speed;
    if (fast && !slipping) {
      if (last_slip > 4.0) periods.push_back(i * fine - last_slip);
      last_slip = i * fine;
    }
    slipping = fast;
  }
  const double omega = std::sqrt(spring / mass);
  const double drop = (1.0 - p.kinetic_share) * p.friction * push;  // [N]
  // Relative to the drawn end the mass slips by 2 drop / spring and more, as the end goes on.
  const double r = drop * omega / (spring * speed);
  const double slip = (std::numbers::pi + 2.0 * (std::numbers::pi / 2 - std::atan(r))) / omega;
  const double stick = 2.0 * drop / (spring * speed);
  ASSERT_GT(periods.size(), 5U);
  for (const double period : periods) EXPECT_NEAR(period, stick + slip, 0.05 * (stick + slip));
}

TEST(Friction, BeginsAndEndsWithoutAStep) {
  // Pressed and lifted within 20 ms while the hand slides.
  Friction friction = friction_of(rubber());
  Vec3 last = Vec3::Zero();
  for (int i = 0; i <= 40; ++i) {
    const double pressed = push * std::max(1.0 - std::abs(i - 20) / 20.0, 0.0);
    const Vec3 force = friction.update(Vec3(0, 0, pressed), Vec3(1e-4, 0, 0), Vec3(0.1, 0, 0), dt);
    // What the pressure and the bristle change in a millisecond.
    EXPECT_LE((force - last).norm(), 0.6 * push / 20.0 + 600.0 * 1e-4 + 1e-9) << i;
    last = force;
  }
  EXPECT_EQ(last.norm(), 0.0);
}

TEST(Friction, OfHoneyGrowsWithTheSpeed) {
  FrictionParameters p;
  p.viscosity = 2.0;
  Friction friction = friction_of(p);
  EXPECT_NEAR(slide(friction, 0.1, 0.1).back().x(), -2.0 * push * 0.1, 1e-12);
}

}  // namespace test_friction
}  // namespace palpate
