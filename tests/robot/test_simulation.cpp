// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"

#include "robot/models.hpp"
#include "robot/simulation.hpp"

namespace palpate::robot {
namespace test_simulation {

constexpr double pi = std::numbers::pi;
const Vec3 home(0.0, 0.0, 0.15);

// Leads the tip along `at`, with its velocity, 500 times a second; `look` sees every step.
void lead(Simulation& simulation, double seconds, const std::function<Vec3(double)>& at,
          const std::function<void(const Truth&)>& look = {}) {
  const double begin = simulation.truth().t + 1e-3;
  const auto steps = static_cast<int>(std::round(seconds * 1e3));
  for (int i = 0; i < steps; ++i) {
    const double t = i * 1e-3;
    if (i % 2 == 0) simulation.command({at(t)}, (at(t + 1e-6) - at(t - 1e-6)) / 2e-6);
    simulation.advance(begin + t + 1e-3);
    if (look) look(simulation.truth());
  }
}

// Down to a place within a second, from wherever it is.
void go(Simulation& simulation, const Vec3& place, double seconds = 0.7) {
  const Vec3 from = simulation.truth().tip;
  lead(simulation, seconds, [&](double t) {
    const double share = std::clamp(t / (0.8 * seconds), 0.0, 1.0);
    return Vec3(from + (place - from) * (0.5 - 0.5 * std::cos(pi * share)));
  });
}

Eigen::Isometry3d at(double x, double y, double z) {
  return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
}

TEST(Simulation, RestsAtHomeWithoutCommands) {
  Simulation simulation;
  simulation.advance(0.5);
  EXPECT_LT((simulation.state().position - home).norm(), 1e-3);
  EXPECT_LT(simulation.state().velocity.norm(), 1e-3);
  EXPECT_EQ(simulation.state().fault, "");
  EXPECT_EQ(simulation.info().joint_names.size(), 6u);
}

// [m] worst distance from the path after 0.7 s
double worst_error(double seconds, const std::function<Vec3(double)>& path) {
  Simulation simulation;
  double worst = 0.0;
  double t = 0.0;
  lead(simulation, seconds, path, [&](const Truth& truth) {
    if (t > 0.7) worst = std::max(worst, (truth.tip - path(t)).norm());
    t += 1e-3;
  });
  return worst;
}

TEST(Simulation, FollowsALineAtConstantSpeedWithinAMillimetre) {
  const double error =
      worst_error(1.2, [](double t) { return Vec3(home + Vec3(0.05, 0.1, -0.02) * (t - 0.9)); });
  EXPECT_LT(error, 1e-3);
  EXPECT_GT(error, 1e-9);
}

// |H - 1| of the reference is (f / 4 Hz)^2 / (1 + (f / 4 Hz)^2): at 1.2 Hz 8.3 %.
TEST(Simulation, FollowsACircleAsACriticallyDampedSystemDoes) {
  const double error = worst_error(1.6, [](double t) {  // 0.3 m/s
    const double phase = 2.0 * pi * 1.2 * t;
    return Vec3(home + 0.04 * std::min(1.0, 2.0 * t) * Vec3(std::cos(phase), std::sin(phase), 0.0));
  });
  EXPECT_NEAR(error, 0.04 * 0.083, 1e-3);
}

TEST(Simulation, ReachesTheCornersOfItsReachUprightAndFreeOfItsMotorsLimits) {
  Simulation simulation;
  const Vec3 least = simulation.info().reach->min();
  const Vec3 most = simulation.info().reach->max();
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(most.x(), least.y()), Eigen::Vector2d(most.x(), most.y()),
        Eigen::Vector2d(least.x(), most.y()), Eigen::Vector2d(least.x(), 0.0),
        Eigen::Vector2d(least.x(), least.y())}) {
    for (const double z : {0.12, most.z()}) {
      const Vec3 place(corner.x(), corner.y(), z);
      go(simulation, place, z == 0.12 || corner.y() == 0.0 ? 1.8 : 0.8);
      const RobotState state = simulation.state();
      EXPECT_LT((state.position - place).norm(), 2e-3) << place.transpose();
      ASSERT_EQ(state.links.size(), 5u);  // base, shoulder, elbow, wrist, tip
      EXPECT_NEAR((state.links[2] - state.links[1]).norm(), 0.42, 1e-6);
      EXPECT_NEAR((state.links[3] - state.links[2]).norm(), 0.40, 1e-6);
      EXPECT_GT((state.links[3] - state.position).normalized().z(), 0.999);
      EXPECT_LT(simulation.truth().apparent_mass, 10.0) << "near a singularity";
    }
  }
  EXPECT_LT(simulation.max_torque_share(), 0.8);
}

TEST(Simulation, KeepsItsSpeedAndItsReachHoweverFarTheCommandIs) {
  Simulation simulation;
  double fastest = 0.0;
  lead(
      simulation, 1.5, [](double) { return Vec3(10.0, 0.0, 0.15); },
      [&](const Truth& truth) { fastest = std::max(fastest, truth.tip_velocity.norm()); });
  EXPECT_GT(fastest, 0.8 * simulation.info().max_speed);
  EXPECT_LT(fastest, 1.05 * simulation.info().max_speed);
  EXPECT_NEAR(simulation.truth().tip.x(), simulation.info().reach->max().x(), 1e-3);
}

TEST(Simulation, PressesOnATableWithItsSpringAndNeverMoreThanItsForce) {
  Simulation simulation;
  const double radius = simulation.info().tool_radius;
  go(simulation, {-0.05, 0.0, radius + 0.002});
  EXPECT_EQ(simulation.truth().tip_force.norm(), 0.0);
  go(simulation, {-0.05, 0.0, radius - 0.003});  // 3 mm in: 1500 N/m
  EXPECT_NEAR(simulation.truth().tip_force.z(), 4.5, 0.3);
  EXPECT_LT(simulation.truth().penetration, 5e-4);
  go(simulation, {-0.05, 0.0, -0.03});
  const Truth pressed = simulation.truth();
  EXPECT_NEAR(pressed.tip_force.z(), simulation.info().max_force, 0.4);
  EXPECT_LT(pressed.penetration, 1e-3);
  EXPECT_NEAR((simulation.state().force - pressed.tip_force).norm(), 0.0, 0.2);
  // It comes off as soon as the command does: the 35 mm that it was led in too deep need no way
  // back.
  const Vec3 above(-0.05, 0.0, radius + 0.002);
  lead(simulation, 0.12, [&](double) { return above; });
  EXPECT_EQ(simulation.truth().tip_force.norm(), 0.0);
}

TEST(Simulation, StopsATenthOfASecondAfterTheLastCommand) {
  Simulation simulation;
  lead(simulation, 0.6, [](double t) { return Vec3(home + Vec3(0.2 * t, 0.0, 0.0)); });
  const Truth last = simulation.truth();
  EXPECT_NEAR(last.tip_velocity.x(), 0.2, 0.01);
  simulation.advance(last.t + Simulation::command_timeout + 0.4);
  const Truth stopped = simulation.truth();
  EXPECT_LT(stopped.tip_velocity.norm(), 5e-3);
  EXPECT_LT((stopped.tip - last.tip).norm(), 0.2 * 0.1 + 0.2 / (2.0 * pi * 4.0) + 2e-3);
  // Nor does it go on pressing.
  go(simulation, {0.0, 0.0, -0.02});
  EXPECT_GT(simulation.truth().tip_force.z(), 5.0);
  simulation.advance(simulation.truth().t + 0.8);
  EXPECT_LT(simulation.truth().tip_force.norm(), 0.5);
}

TEST(Simulation, PushesTheBoxAndOffTheTable) {
  Simulation simulation;
  simulation.place("box", at(0.15, 0.10, 0.04));
  go(simulation, {0.09, 0.10, 0.03});
  EXPECT_NEAR(simulation.pose("box").translation().x(), 0.15, 1e-3);
  go(simulation, {0.19, 0.10, 0.03}, 1.2);
  const Vec3 pushed = simulation.pose("box").translation();
  EXPECT_NEAR(pushed.x(), 0.19 + 0.005 + 0.03, 0.012);
  EXPECT_NEAR(pushed.z(), 0.04, 2e-3);
  simulation.place("box", at(0.29, 0.10, 0.04));
  go(simulation, {0.25, 0.10, 0.03}, 0.5);
  go(simulation, {0.30, 0.10, 0.05}, 0.7);
  simulation.advance(simulation.truth().t + 0.6);
  EXPECT_LT(simulation.pose("box").translation().z(), -0.3);  // the floor is at -0.75
}

TEST(Simulation, MovesThePlateThatLiftsTheTool) {
  SimulationSetup setup;
  setup.plate = {.height = 0.02, .stroke = 0.03, .frequency = 0.5};
  Simulation simulation(setup);
  double worst = 0.0;
  const Vec3 on_plate(0.10, -0.14, 0.03);
  go(simulation, on_plate);
  const double begin = simulation.truth().t;
  double highest = 0.0;
  lead(
      simulation, 2.0, [&](double) { return on_plate; },
      [&](const Truth& truth) {
        const double true_height = 0.02 + 0.015 * (1.0 - std::cos(pi * truth.t));
        worst = std::max(worst, std::abs(truth.plate_height - true_height));
        highest = std::max(highest, truth.tip.z());
      });
  EXPECT_GT(begin, 0.6);
  EXPECT_LT(worst, 5e-4);
  EXPECT_NEAR(highest, 0.05 + 0.005, 1e-3);
  simulation.set_plate({.height = 0.01});
  go(simulation, home);
  EXPECT_NEAR(simulation.truth().plate_height, 0.01, 1e-4);
}

TEST(Simulation, FitsItsToolIntoTheHole) {
  Simulation simulation;
  const Vec3 hole(-0.13, -0.16, 0.04);
  go(simulation, hole);
  go(simulation, {hole.x(), hole.y(), 0.01});
  EXPECT_NEAR(simulation.truth().tip.z(), 0.01, 1e-3);
  EXPECT_EQ(simulation.truth().tip_force.norm(), 0.0);
  go(simulation, {hole.x() + 0.01, hole.y(), 0.01});
  EXPECT_LT(simulation.truth().tip_force.x(), -3.0);
}

TEST(Simulation, HasAHoleOfTheAskedSize) {
  for (const double hole : {0.015, 0.04}) {
    SimulationSetup setup;
    setup.hole = hole;
    const Simulation simulation(setup);
    for (const double beside : {0.007, 0.019}) {
      for (const Vec3& way : {Vec3(1.0, 0.0, 0.0), Vec3(0.0, -1.0, 0.0)}) {
        const Vec3 eye = Vec3(-0.13, -0.16, 0.05) + beside * way;
        EXPECT_NEAR(*simulation.ray(eye, -Vec3::UnitZ(), false), beside < 0.5 * hole ? 0.05 : 0.02,
                    1e-9);
      }
    }
  }
  SimulationSetup setup;
  setup.hole = 0.01;
  EXPECT_THROW(Simulation{setup}, Error);
}

TEST(Simulation, GivesEqualStatesBitForBit) {
  const auto end = [] {
    Simulation simulation;
    go(simulation, {0.08, 0.05, 0.02});
    go(simulation, {0.12, 0.15, 0.02});
    return std::pair(simulation.state(), simulation.pose("box"));
  };
  const auto [first, first_box] = end();
  const auto [second, second_box] = end();
  EXPECT_EQ(first.t, second.t);
  EXPECT_EQ(first.joints, second.joints);
  EXPECT_EQ(first.position, second.position);
  EXPECT_EQ(first.force, second.force);
  EXPECT_EQ(first_box.matrix(), second_box.matrix());
  EXPECT_GT((first_box.translation() - Vec3(0.10, 0.10, 0.04)).norm(), 0.01);
}

TEST(Simulation, IgnoresACommandThatIsNoPlace) {
  Simulation simulation;
  simulation.command({Vec3(std::nan(""), 0.0, 0.1)}, Vec3::Zero());
  simulation.command({home}, {0.0, std::numeric_limits<double>::infinity(), 0.0});
  simulation.command({home, Rotation(std::nan(""), 0.0, 0.0, 0.0)}, Vec3::Zero());
  simulation.advance(0.3);
  EXPECT_EQ(simulation.state().fault, "");
  EXPECT_LT((simulation.truth().tip - home).norm(), 1e-3);
}

// [rad] from how the tool is turned to how it was to be.
double off(const Simulation& simulation, const Rotation& wanted) {
  return rotation_vector(between(wanted, simulation.state().orientation)).norm();
}

// Holds the tip at home, turned, for so many seconds. [m] how far the tip moved at most.
double turn(Simulation& simulation, const Rotation& wanted, double seconds) {
  double moved = 0.0;
  const double begin = simulation.truth().t + simulation.step_length();
  for (double t = 0.0; t < seconds; t += 2e-3) {
    simulation.command({home, wanted}, Vec3::Zero());
    simulation.advance(begin + t);
    moved = std::max(moved, (simulation.truth().tip - home).norm());
  }
  return moved;
}

TEST(Simulation, TurnsItsToolAboutTheTip) {
  Simulation simulation;
  ASSERT_TRUE(simulation.info().turns);
  for (const Vec3& each : {Vec3(0.4, 0.0, 0.0), Vec3(0.0, -0.4, 0.0), Vec3(0.2, 0.3, 1.0)}) {
    const Rotation wanted = rotation_by(each);
    EXPECT_LT(turn(simulation, wanted, 1.0), 3e-3) << each.transpose();
    EXPECT_LT(off(simulation, wanted), 5e-3) << each.transpose();
  }
  const Rotation rests = simulation.state().orientation;
  simulation.advance(simulation.truth().t + 1.0);
  EXPECT_LT(off(simulation, rests), 5e-3) << "without commands it stays as it is";
}

TEST(Simulation, IsNotTornByAnOrientationThatItsJointsCannotReach) {
  Simulation simulation;
  turn(simulation, rotation_by({2.5, 0.0, 0.0}), 1.0);
  EXPECT_EQ(simulation.state().fault, "");
  EXPECT_GT(off(simulation, Rotation::Identity()), 0.5);
  turn(simulation, Rotation::Identity(), 1.5);
  EXPECT_LT(off(simulation, Rotation::Identity()), 5e-3);
  EXPECT_LT((simulation.truth().tip - home).norm(), 1e-3);
}

std::string message(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(Simulation, SaysWhatIsWrongWithAModel) {
  const auto open = [](const std::string& mjcf) {
    return message([&] { const Simulation simulation(mjcf, {}); });
  };
  EXPECT_NE(open("<mujoco><nonsense/></mujoco>").find("nonsense"), std::string::npos);
  EXPECT_NE(open("").find("empty"), std::string::npos);
  EXPECT_NE(open("<mujoco><worldbody/></mujoco>").find("six motors"), std::string::npos);
  std::string model(desk_model());
  model.replace(model.find("site name=\"tip\""), 15, "site name=\"top\"");
  EXPECT_NE(open(model).find("no site 'tip'"), std::string::npos);
  SimulationSetup setup;
  setup.max_force = 1000.0;
  EXPECT_NE(message([&] { const Simulation simulation(setup); }).find("max_force"),
            std::string::npos);
  Simulation simulation;
  EXPECT_NE(message([&] { simulation.place("table", at(0, 0, 0)); }).find("no body 'table'"),
            std::string::npos);
  EXPECT_NE(message([&] { simulation.place("plate", at(0, 0, 0)); }).find("not free"),
            std::string::npos);
  EXPECT_NE(message([&] { simulation.set_plate({.height = -1.0}); }).find("height"),
            std::string::npos);
}

// Too few contacts fit into the model's memory: MuJoCo warns, and would write MUJOCO_LOG.TXT.
TEST(Simulation, StandsStillWhenMuJoCoFails) {
  std::string model(desk_model());
  const std::string sizes = "nconmax=\"200\"";
  model.replace(model.find(sizes), sizes.size(), "nconmax=\"1\"");
  Simulation simulation(model, {});
  simulation.advance(0.5);
  EXPECT_NE(simulation.state().fault.find("open the robot again"), std::string::npos);
  const double t = simulation.state().t;
  simulation.advance(1.0);
  EXPECT_EQ(simulation.state().t, t);
  EXPECT_FALSE(std::filesystem::exists("MUJOCO_LOG.TXT"));
}

TEST(Simulation, RunsInRealTimeUntilItIsStopped) {
  Simulation simulation;
  simulation.start();
  const double begin = simulation.state().t;
  simulation.stop();
  EXPECT_FALSE(simulation.runs());
  const double end = simulation.state().t;
  EXPECT_GE(end, begin);
  simulation.start();
  EXPECT_GE(simulation.state().t, end);
}

}  // namespace test_simulation
}  // namespace palpate::robot
