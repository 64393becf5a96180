// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

#include "robot/simulated_camera.hpp"
#include "robot/simulated_cell.hpp"

namespace palpate::robot {
namespace test_simulated_camera {

const DepthImage& image_of(const Frame& frame) {
  return dynamic_cast<const DepthImage&>(*frame.cloud);
}

SimulatedCell stepped(const std::string& options) {
  return SimulatedCell(Uri("mujoco:desk?size=320x240" + options), Pace::stepped);
}

TEST(SimulatedCamera, MeasuresWhatMuJoCosRaysMeet) {
  const SimulatedCell cell = stepped("&arm=seen&quantisation=0.05mm");
  const auto camera = cell.camera();
  cell.simulation()->command({Vec3(0.05, 0.08, 0.05)}, Vec3::Zero());
  ASSERT_EQ(camera->skip(15), 15u);
  const Frame frame = *camera->next();
  EXPECT_NEAR(frame.stamp, 0.5, 1e-9);
  const DepthImage& image = image_of(frame);
  const Vec3 eye = image.world_from_camera().translation();
  std::mt19937 random(3);
  int compared = 0;
  int of_arm = 0;
  for (int i = 0; i < 2000; ++i) {
    const int u = std::uniform_int_distribution<int>(0, 319)(random);
    const int v = std::uniform_int_distribution<int>(0, 239)(random);
    const Vec3 ray = image.rays().ray(u, v).homogeneous();
    const Vec3 direction = (image.world_from_camera().linear() * ray).normalized();
    const auto truth = cell.simulation()->ray(eye, direction, true);
    const auto point = image.deproject(u, v);
    ASSERT_EQ(truth.has_value(), point.has_value()) << u << " " << v;
    if (!truth) continue;
    EXPECT_NEAR((*point - eye).norm(), *truth, 1e-4) << u << " " << v;
    ++compared;
    const auto scene = cell.simulation()->ray(eye, direction, false);
    of_arm += !scene || *scene > *truth + 1e-3;
  }
  EXPECT_GT(compared, 1500);
  EXPECT_GT(of_arm, 25);
}

TEST(SimulatedCamera, LeavesOutTheArmAndNothingElse) {
  const SimulatedCell cell = stepped("");
  const auto hidden = cell.camera();
  const auto seen = cell.source_scheme().open(Uri("mujoco:desk?size=320x240&arm=seen&margin=0m"));
  const Frame without = *hidden->next();
  const Frame with = *seen->next();
  const DepthImage& image = image_of(without);
  const Vec3 eye = image.world_from_camera().translation();
  int left_out = 0, around = 0;
  for (int v = 0; v < 240; v += 3) {
    for (int u = 0; u < 320; u += 3) {
      const Vec3 direction =
          (image.world_from_camera().linear() * image.rays().ray(u, v).homogeneous()).normalized();
      const auto first = cell.simulation()->ray(eye, direction, true);
      const auto scene = cell.simulation()->ray(eye, direction, false);
      const bool arm = first && (!scene || *first < *scene);
      const auto point = image.deproject(u, v);
      if (arm) {
        EXPECT_FALSE(point) << u << " " << v;
        EXPECT_TRUE(image_of(with).deproject(u, v));
        ++left_out;
      } else if (point) {
        EXPECT_NEAR((*point - eye).norm(), *scene, 2e-4);
      } else {
        ++around;
      }
    }
  }
  EXPECT_GT(left_out, 100);
  EXPECT_LT(around, left_out);
  EXPECT_GT(around, 0);  // the margin
}

TEST(SimulatedCamera, SeesTheSameEveryTimeWithTheNoiseOfItsSensor) {
  const auto third = [](const std::string& options) {
    const SimulatedCell cell = stepped("&sensor=d4xx&plate_stroke=3cm" + options);
    const auto camera = cell.camera();
    EXPECT_EQ(camera->info().sensor, SensorKind::stereo);
    EXPECT_EQ(camera->skip(2), 2u);
    return *camera->next();
  };
  const Frame one = third("&seed=4");
  EXPECT_EQ(image_of(one).depth(), image_of(third("&seed=4")).depth());
  EXPECT_FALSE(image_of(one).depth() == image_of(third("&seed=5")).depth());
  EXPECT_NEAR(one.stamp, 2.0 / 30.0, 1e-3);
}

TEST(SimulatedCamera, IsLiveWhileTheCellRuns) {
  const SimulatedCell cell(Uri("mujoco:desk?size=64x48&fps=100&latency=20ms"));
  const auto camera = cell.camera();
  EXPECT_TRUE(camera->info().live);
  EXPECT_EQ(camera->info().clock, StampClock::monotonic);
  double last = 0.0;
  for (int i = 0; i < 3; ++i) {
    const auto frame = camera->next(10.0);
    ASSERT_TRUE(frame);
    EXPECT_GT(frame->stamp, last);
    EXPECT_LT(frame->stamp, monotonic_now());
    last = frame->stamp;
  }
  camera->cancel();
  EXPECT_FALSE(camera->next());
}

TEST(SimulatedCell, GivesARobotAndACameraOfOneSimulation) {
  const SimulatedCell cell = stepped("");
  const auto robot = cell.robot();
  EXPECT_EQ(robot->info().uri, "mujoco:desk?size=320x240");
  EXPECT_EQ(robot->info().kind, "simulated arm");
  robot->command({Vec3(0.0, 0.0, 0.10)}, Vec3::Zero(), 0.0);
  const auto camera = cell.camera();
  ASSERT_TRUE(camera->next());
  ASSERT_TRUE(camera->next());  // advances to 1/30 s
  const RobotState state = *robot->state();
  EXPECT_NEAR(state.t, 0.033, 2e-3);
  EXPECT_LT(state.velocity.z(), -0.05);
  EXPECT_EQ(state.joints.size(), robot->info().joint_names.size());
  EXPECT_EQ(state.links.back(), state.position);
}

TEST(SimulatedCell, SaysWhatIsWrongWithAUri) {
  const auto message = [](const std::string& uri) -> std::string {
    try {
      const SimulatedCell cell(Uri(uri), Pace::stepped);
      (void)cell.camera();
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_NE(message("mujoco:kitchen").find("mujoco:desk"), std::string::npos);
  EXPECT_NE(message("mujoco:desk?plates=1").find("plate"), std::string::npos);
  EXPECT_NE(message("mujoco:desk?arm=none").find("arm=hidden"), std::string::npos);
  EXPECT_NE(message("mujoco:desk?plate=20cm&plate_stroke=20cm").find("together"),
            std::string::npos);
  EXPECT_NE(message("mujoco:desk?latency=1s").find("latency"), std::string::npos);
}

}  // namespace test_simulated_camera
}  // namespace palpate::robot
