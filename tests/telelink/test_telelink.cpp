// SPDX-License-Identifier: Apache-2.0
// Both ends of a link in one process, on a network of their own.
#include <algorithm>
#include <chrono>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/net/telelink/operator_end.hpp"
#include "palpate/net/telelink/robot_end.hpp"
#include "palpate/net/telelink/robots.hpp"

#include "tests/drivers/dds_test.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_telelink {

using test::comes_true;

constexpr const char* scene = "synthetic:plane?size=160x120&noise=0.5mm";

// A robot whose reach and fault a test decides.
class TestRobot final : public Robot {
 public:
  TestRobot() {
    info_.uri = "test:";
    info_.kind = "of a test";
    info_.reach.emplace(Vec3(-0.2, -0.2, -0.05), Vec3(0.2, 0.2, 0.2));
  }
  [[nodiscard]] const RobotInfo& info() const override { return info_; }
  void command(const Vec3& position, const Vec3& /*velocity*/, double t) noexcept override {
    const std::lock_guard lock(*mutex_);
    shared_->now.position = position;
    shared_->now.t = t;
    shared_->lowest = std::min(shared_->lowest, position.z());
  }
  [[nodiscard]] std::optional<RobotState> state() override {
    const std::lock_guard lock(*mutex_);
    ++shared_->looks;
    RobotState state = shared_->now;
    state.t = monotonic_now();
    return state;
  }
  // What a test sees and sets beside the link.
  struct Shared {
    RobotState now;
    int looks = 0;                                            // at the state, one each cycle
    double lowest = std::numeric_limits<double>::infinity();  // [m] that the tool was sent to
  };
  std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
  std::shared_ptr<std::mutex> mutex_ = std::make_shared<std::mutex>();

 private:
  RobotInfo info_;
};

class Telelink : public ::testing::Test {
 public:
  ~Telelink() override {
    operator_end_.reset();
    operator_.reset();
    robot_end_->detach();
    robot_.reset();
  }

  Telelink(const Telelink&) = delete;
  Telelink& operator=(const Telelink&) = delete;

 protected:
  Telelink() {
    auto robot = std::make_unique<TestRobot>();
    state_ = robot->shared_;
    mutex_ = robot->mutex_;
    state_->now.position = Vec3(0.0, 0.0, 0.1);
    robot_end_ = std::make_unique<RobotEnd>(std::move(robot), RobotEndOptions{.name = "arm"});
    SessionOptions options;
    options.cameras.push_back({.uri = scene});
    robot_end_->prepare(options);
    options.on_frame = [this](std::size_t camera, const FedFrame& frame) {
      robot_end_->on_frame(camera, frame);
    };
    robot_ = std::make_unique<Session>(std::move(options));
    robot_->start();
    robot_end_->attach(*robot_);
  }
  // An operator whose hand rests at a place.
  void operate(const Vec3& hand) {
    SessionOptions options;
    options.cameras.push_back({.uri = "ros2:/arm/depth/image_raw/slices?wait=25s"});
    options.open_devices[0] = std::make_unique<ScriptedDevice>(HipPath({{0.0, hand}}), false);
    operator_ = std::make_unique<Session>(std::move(options));
    operator_end_ = std::make_unique<OperatorEnd>(
        *operator_, OperatorEndOptions{.name = "arm", .index = false, .learn = true});
    operator_->start();
  }
  // [N] upwards, that the tool touches with
  void push_back(double force) {
    const std::lock_guard lock(*mutex_);
    state_->now.force = Vec3(0.0, 0.0, force);
  }
  // Lets the robot's end go on for so many cycles, however long a busy machine takes for them.
  void pass(int cycles) {
    const auto looks = [&] {
      const std::lock_guard lock(*mutex_);
      return state_->looks;
    };
    const int begin = looks();
    ASSERT_TRUE(comes_true([&] { return looks() - begin >= cycles; }));
  }
  Vec3 tool() {
    const std::lock_guard lock(*mutex_);
    return state_->now.position;
  }

  test::OwnNetwork network_;
  std::shared_ptr<TestRobot::Shared> state_;
  std::shared_ptr<std::mutex> mutex_;
  std::unique_ptr<RobotEnd> robot_end_;
  std::unique_ptr<Session> robot_, operator_;
  std::unique_ptr<OperatorEnd> operator_end_;
};

// Hazard: robot-collides
TEST_F(Telelink, LeadsTheRobotToTheHandAndNotThroughWhatIsSeen) {
  // 10 mm below the plane: the tool stays on it.
  operate({0.05, 0.0, -0.01});
  const double radius = RobotInfo{}.tool_radius;
  EXPECT_TRUE(comes_true([&] { return std::abs(tool().x() - 0.05) < 2e-3 && tool().z() < 0.012; }));
  pass(300);
  {
    const std::lock_guard lock(*mutex_);
    EXPECT_GT(state_->lowest, radius - 1e-3);
  }
  EXPECT_TRUE(robot_end_->is_led());
  EXPECT_TRUE(comes_true([&] {
    const RobotView view = operator_end_->robot();
    return view.heard && view.led && view.state && (view.state->position - tool()).norm() < 2e-3;
  }));
  // What it touches there does not give way.
  push_back(2.0);
  pass(300);
  push_back(0.0);
  EXPECT_TRUE(comes_true([&] { return operator_end_->robot().touched.has_value(); }));
  const RobotView view = operator_end_->robot();
  EXPECT_NEAR(view.touched->place.x(), 0.05, 5e-3);
  EXPECT_EQ(view.touched->stiffness, Touched::hardest);
  EXPECT_EQ(view.ignored, "ignored: it is not softer than the rendered stiffness");
}

// Hazard: robot-runaway
TEST_F(Telelink, StopsTheRobotWithItsOperator) {
  operate({0.15, 0.0, 0.1});
  ASSERT_TRUE(comes_true([&] { return tool().x() > 0.02; }));
  operator_->stop();
  EXPECT_TRUE(comes_true([&] { return !robot_end_->is_led(); }));
  const Vec3 stopped = tool();
  pass(300);
  EXPECT_LT((tool() - stopped).norm(), 2e-3);
  EXPECT_LT(tool().x(), 0.14);
}

TEST_F(Telelink, TellsTheOperatorWhatTheRobotMayNotDo) {
  operate({0.0, 0.0, 0.1});
  const auto regions = [&] {
    std::size_t count = 0;
    if (const auto fixtures = operator_->settings().fixtures) {
      for (const Fixture& one : fixtures->fixtures()) count += one.name.starts_with("robot: reach");
    }
    return count;
  };
  EXPECT_TRUE(comes_true([&] { return regions() == 6; }));
  {
    const std::lock_guard lock(*mutex_);
    state_->now.fault = "its emergency stop is open";
  }
  EXPECT_TRUE(comes_true([&] {
    const RobotView view = operator_end_->robot();
    return view.state && view.state->fault == "its emergency stop is open";
  }));
}

TEST(Robots, SayWhatTheyNeed) {
  EXPECT_TRUE(
      test::fails_saying([] { open_robot("pint:"); }, "pint", "unknown type of robot", "point:"));
  EXPECT_TRUE(test::fails_saying([] { open_robot("point:?lag=9"); }, "lag", "9", ""));
  const test::OwnNetwork network;
  EXPECT_TRUE(test::fails_saying([] { open_robot("ros2:?pose=/arm/pose"); },
                                 "ros2:", "names no topic", "command="));
  EXPECT_TRUE(
      test::fails_saying([] { open_robot("ros2:?pose=/arm/pose&command=/arm/go&wait=0.2"); },
                         "ros2:", "no PoseStamped messages", "pose="));
}

// Hazard: robot-runaway
TEST(Robots, APointFollowsAndStopsByItself) {
  const auto robot = open_robot("point:?x=0.1");
  ASSERT_TRUE(robot->state());
  EXPECT_NEAR(robot->state()->position.x(), 0.1, 1e-9);
  // Led for 0.1 s that are a second ago, and then no more: it comes to rest on its way.
  const Vec3 to(0.2, 0.0, 0.1);
  const double begin = monotonic_now() - 1.0;
  for (int i = 0; i < 50; ++i) robot->command(to, Vec3::Zero(), begin + 2e-3 * i);
  EXPECT_TRUE(comes_true([&] { return robot->state()->velocity.norm() < 1e-6; }));
  const double x = robot->state()->position.x();
  EXPECT_GT(x, 0.12);
  EXPECT_LT(x, 0.19);
  EXPECT_NEAR(robot->state()->position.x(), x, 1e-6);
  // A tool in a scene does not go through what it touches.
  const auto camera = open_synthetic_camera(Uri("synthetic:plane?size=64x48"));
  const auto tool = open_scene_robot(std::make_shared<const Scene>(camera->scene()),
                                     {0.0, 0.0, 0.02}, "synthetic:plane");
  for (int i = 0; i < 200; ++i) {
    tool->command({0.0, 0.0, 0.0}, Vec3::Zero(), monotonic_now());
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ASSERT_GT(tool->state()->position.z(), 3e-3) << i;
  }
}

}  // namespace test_telelink
}  // namespace palpate
