// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string_view>

#include <gtest/gtest.h>

#include "palpate/net/teleop/touched.hpp"

namespace palpate {
namespace test_touched {

constexpr double dt = 2e-3;      // [s]
constexpr double radius = 5e-3;  // [m]
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// A tool that goes along `way` [m] for a second and comes back, and feels `force` [N].
class Touching : public ::testing::Test {
 protected:
  std::optional<Touched> press(const std::function<Vec3(double t)>& way,
                               const std::function<Vec3(const Vec3& at, const Vec3& v)>& force) {
    std::optional<Touched> found;
    Vec3 last = way(0.0);
    for (double t = 0.0; t < 2.2; t += dt) {
      const Vec3 at = way(t);
      const Vec3 velocity = (at - last) / dt;
      if (const auto one = learner_.next(t, at, velocity, force(at, velocity), Vec3::UnitZ()))
        found = one;
      last = at;
    }
    return found;
  }
  // 4 mm into z = radius and out again.
  static Vec3 in_and_out(double t) {
    return {0.1, 0.2, radius + 1e-3 - 5e-3 * 0.5 * (1.0 - std::cos(3.14159 * t))};
  }
  static double depth(const Vec3& at) { return radius - at.z(); }

  TouchLearner learner_{radius};
};

TEST_F(Touching, TellsTheStiffnessOfASpringWithADamper) {
  for (const double stiffness : {150.0, 400.0, 1500.0}) {
    const auto found = press(in_and_out, [&](const Vec3& at, const Vec3& v) {
      const double push = std::max(0.0, stiffness * depth(at) - 8.0 * v.z());
      return Vec3(0.0, 0.0, depth(at) > 0.0 ? push : 0.0);
    });
    ASSERT_TRUE(found && found->stiffness) << learner_.why_not();
    EXPECT_NEAR(*found->stiffness, stiffness, 0.05 * stiffness);
    EXPECT_FALSE(found->friction);
    EXPECT_LT((found->place - Vec3(0.1, 0.2, -4e-3)).norm(), 1e-3);
    EXPECT_EQ(disbelief(*found), "");
  }
}

// Hazard: robot-lies
TEST_F(Touching, TakesNoPushedThingForASpring) {
  // It slides with 1.5 N and stays where it was pushed to.
  double farthest = 0.0;
  const auto found = press(in_and_out, [&](const Vec3& at, const Vec3&) {
    const bool pushes = depth(at) > farthest - 1e-4 && depth(at) > 0.0;
    farthest = std::max(farthest, depth(at));
    return Vec3(0.0, 0.0, pushes ? 1.5 : 0.0);
  });
  EXPECT_FALSE(found);
  EXPECT_EQ(learner_.why_not(), "the contact is not elastic");
}

TEST_F(Touching, TellsFrictionOfWhatItSlidesOn) {
  const auto way = [](double t) {
    return Vec3(0.03 * t, 0.0, t > 0.1 && t < 2.0 ? radius : 2.0 * radius);
  };
  const auto found = press(way, [](const Vec3& at, const Vec3& v) {
    return at.z() > radius ? Vec3(0.0, 0.0, 0.0) : Vec3(v.x() > 0.0 ? -0.8 : 0.0, 0.0, 2.0);
  });
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->stiffness);
  EXPECT_NEAR(found->friction.value_or(0.0), 0.4, 0.01);
}

// Hazard: robot-lies
TEST_F(Touching, LearnsNothingFromShortWeakOrWrongForces) {
  const auto told = [&](const std::function<Vec3(const Vec3&, const Vec3&)>& force) {
    return press(in_and_out, force).has_value() ? std::string_view("something")
                                                : learner_.why_not();
  };
  EXPECT_EQ(told([](const Vec3& at, const Vec3&) {
              return Vec3(0.0, 0.0, depth(at) > 3.99e-3 ? 2.0 : 0.0);
            }),
            "it was too short");
  EXPECT_EQ(told([](const Vec3& at, const Vec3&) {
              return Vec3(0.0, 0.0, std::max(0.0, 100.0 * depth(at)));
            }),
            "it was too weak");
  EXPECT_EQ(told([](const Vec3& at, const Vec3&) {
              return Vec3(0.0, 0.0, depth(at) > 3e-3 ? nan : std::max(0.0, 400.0 * depth(at)));
            }),
            "the robot reported a force or a position that is not finite or out of range");
  EXPECT_EQ(told([](const Vec3& at, const Vec3&) {
              return Vec3(0.0, 0.0, depth(at) > 3e-3 ? 1e6 : std::max(0.0, 400.0 * depth(at)));
            }),
            "the robot reported a force or a position that is not finite or out of range");
}

// Hazard: robot-lies
TEST(Disbelief, SaysWhatCannotBe) {
  const auto why = [](const Vec3& place, const Vec3& normal, std::optional<double> stiffness,
                      std::optional<double> friction) {
    return disbelief({place, normal, stiffness, friction});
  };
  const Vec3 here(0.1, 0.0, 0.0);
  const Vec3 up = Vec3::UnitZ();
  EXPECT_EQ(why(here, up, 300.0, 0.5), "");
  EXPECT_EQ(why({nan, 0.0, 0.0}, up, 300.0, {}), "position is not finite");
  EXPECT_EQ(why(here, 3.0 * up, 300.0, {}), "normal is not a unit vector");
  EXPECT_EQ(why(here, Vec3::Constant(nan), 300.0, {}), "normal is not a unit vector");
  for (const double wrong : {-300.0, 0.0, 1e9, nan})
    EXPECT_EQ(why(here, up, wrong, {}), "stiffness is out of range") << wrong;
  for (const double wrong : {-0.1, 50.0, nan})
    EXPECT_EQ(why(here, up, {}, wrong), "friction coefficient is out of range") << wrong;
  EXPECT_EQ(why(here, up, {}, {}), "contains neither stiffness nor friction");
}

}  // namespace test_touched
}  // namespace palpate
