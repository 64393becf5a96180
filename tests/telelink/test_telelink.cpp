// SPDX-License-Identifier: Apache-2.0
// Both ends of a link in one process, on a network of their own.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"
#include "palpate/net/telelink/operator_end.hpp"
#include "palpate/net/telelink/robot_end.hpp"
#include "palpate/net/telelink/robots.hpp"

#include "tests/drivers/dds_test.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/patient.hpp"
#include "tests/support/stall_watch.hpp"

namespace palpate {
namespace test_telelink {

using test::comes_true;

constexpr const char* scene = "synthetic:plane?size=160x120&noise=0.5mm";
constexpr const char* box = "box:40x20x5mm";
const Rotation found = rotation_by({0.3, 0.0, 1.2});  // how the robot's tool is turned at first
const Rotation turn = rotation_by({0.0, 0.5, 0.0});

double angle(const Rotation& a, const Rotation& b) { return rotation_vector(between(a, b)).norm(); }

// A robot whose reach and fault a test decides.
class TestRobot final : public Robot {
 public:
  explicit TestRobot(bool turns = true) {
    info_.turns = turns;
    info_.uri = "test:";
    info_.kind = "of a test";
    info_.reach.emplace(Vec3(-0.2, -0.2, -0.05), Vec3(0.2, 0.2, 0.2));
  }
  [[nodiscard]] const RobotInfo& info() const override { return info_; }
  void command(const HandPose& pose, const Vec3& /*velocity*/, double t) noexcept override {
    const std::lock_guard lock(*mutex_);
    shared_->now.position = pose.position;
    shared_->now.orientation = pose.orientation;
    shared_->now.t = t;
    shared_->lowest = std::min(shared_->lowest, pose.position.z());
    for (const ToolShape::Point& point : shape_->points())
      shared_->lowest_corner =
          std::min(shared_->lowest_corner, (pose.position + pose.orientation * point.at).z());
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
    double lowest_corner = std::numeric_limits<double>::infinity();  // [m] if it is a box
  };
  std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
  std::shared_ptr<std::mutex> mutex_ = std::make_shared<std::mutex>();

 private:
  RobotInfo info_;
  std::shared_ptr<const ToolShape> shape_ = make_tool("box:40x20x5mm?points=8", {});
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
  explicit Telelink(const std::string& tool = {}) {
    auto robot = std::make_unique<TestRobot>();
    state_ = robot->shared_;
    mutex_ = robot->mutex_;
    state_->now.position = Vec3(0.0, 0.0, 0.1);
    state_->now.orientation = found;
    robot_end_ =
        std::make_unique<RobotEnd>(std::move(robot), RobotEndOptions{.name = "arm", .tool = tool});
    SessionOptions options;
    options.cameras.push_back({.uri = scene});
    options.safety = test::patient();
    robot_end_->prepare(options);
    options.on_frame = [this](std::size_t camera, const FedFrame& frame) {
      robot_end_->on_frame(camera, frame);
    };
    robot_ = std::make_unique<Session>(std::move(options));
    robot_->start();
    robot_end_->attach(*robot_);
  }
  // An operator whose hand rests at a place.
  void operate(const Vec3& hand, const Rotation& handle = Rotation::Identity(), bool index = false,
               const std::string& tool = {}) {
    SessionOptions options;
    options.cameras.push_back({.uri = "ros2:/arm/depth/image_raw/slices?wait=25s"});
    options.open_devices[0] =
        std::make_unique<ScriptedDevice>(HipPath({{0.0, hand, handle}}), false);
    options.tool = tool;
    options.safety = test::patient();
    operator_ = std::make_unique<Session>(std::move(options));
    operator_end_ = std::make_unique<OperatorEnd>(
        *operator_, OperatorEndOptions{.name = "arm", .index = index, .learn = true});
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
  Rotation orientation() {
    const std::lock_guard lock(*mutex_);
    return state_->now.orientation;
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
  EXPECT_TRUE(comes_true([&] { return robot_end_->is_led(); }));
  EXPECT_LT(angle(orientation(), found), 1e-6) << "no handle turned it";
  EXPECT_TRUE(comes_true([&] {
    const RobotView view = operator_end_->robot();
    return view.heard && view.led && view.state && (view.state->position - tool()).norm() < 2e-3;
  }));
  // What it touches there does not give way.
  push_back(2.0);
  pass(300);
  push_back(0.0);
  ASSERT_TRUE(comes_true([&] { return operator_end_->robot().touched.has_value(); }));
  const RobotView view = operator_end_->robot();
  EXPECT_NEAR(view.touched->place.x(), 0.05, 5e-3);
  EXPECT_EQ(view.touched->stiffness, Touched::hardest);
  EXPECT_EQ(view.ignored, "ignored: it is not softer than the rendered stiffness");
}

// Hazard: robot-runaway
TEST_F(Telelink, StopsTheRobotWithItsOperator) {
  for (int attempt = 0; attempt < 6; ++attempt) {
    const test::StallWatch machine;
    const double to = attempt % 2 == 0 ? 0.15 : -0.15;
    const double from = tool().x();
    operate({to, 0.0, 0.1});
    ASSERT_TRUE(comes_true([&] { return std::abs(tool().x() - from) > 0.02; }));
    operator_->stop();
    EXPECT_TRUE(comes_true([&] { return !robot_end_->is_led(); }));
    const Vec3 stopped = tool();
    pass(300);
    EXPECT_LT((tool() - stopped).norm(), 2e-3);
    if (std::abs(tool().x() - to) > 0.01) return;
    ASSERT_GT(machine.longest(), 0.1) << "it was not stopped on its way";
    operator_end_.reset();
    operator_.reset();
  }
  FAIL() << "the machine stood still in each attempt";
}

TEST_F(Telelink, TurnsTheToolAsTheHandle) {
  operate({0.05, 0.0, 0.1}, turn, false, box);
  EXPECT_TRUE(comes_true([&] { return angle(orientation(), product(turn, found)) < 1e-3; }));
  EXPECT_TRUE(comes_true([&] {
    const RobotView view = operator_end_->robot();
    return view.state && angle(view.state->orientation, product(turn, found)) < 1e-3;
  }));
  // What the operator touches with is turned as the robot's tool.
  const Vec3 corner = make_tool(box, {})->points().front().at;
  EXPECT_TRUE(comes_true([&] {
    const auto tool = operator_->settings().tool;
    return tool && (tool->points().front().at - found * corner).norm() < 1e-9;
  }));
}

// An operator that sends what it likes.
class Other {
 public:
  void lead(const std::array<double, 4>& q) {
    places_.write(ros::PoseStamped{{dds::stamp_of(monotonic_now()), "world"}, {0.1, 0.0, 0.1}, q});
  }
  static constexpr std::array<double, 4> half{0.0, 0.0, 0.6, 0.8};  // a turn

 private:
  dds::Participant participant_{"other"};
  dds::Writer places_{participant_, "/arm/teleop/place", ros::PoseStamped{}, {}};
};

TEST_F(Telelink, BeginsWithTheToolAsAnOperatorBeforeHasTurnedIt) {
  Other before;
  ASSERT_TRUE(comes_true([&] {
    before.lead(Other::half);
    return angle(orientation(), found) > 0.3;
  }));
  ASSERT_TRUE(comes_true([&] { return !robot_end_->is_led(); }));
  pass(100);
  const Rotation now = orientation();
  const Vec3 at = tool();
  operate({0.05, 0.0, 0.02}, turn, true);
  ASSERT_TRUE(comes_true([&] { return robot_end_->is_led(); }));
  pass(300);
  EXPECT_LT(angle(orientation(), now), 1e-3);
  EXPECT_LT((tool() - at).norm(), 2e-3);
}

// Hazard: robot-runaway
TEST_F(Telelink, RestsWhereAMessageHasNoOrientation) {
  Other other;
  for (const auto& bad : {std::array<double, 4>{}, std::array<double, 4>{NAN, 0.0, 0.0, 1.0},
                          std::array<double, 4>{0.0, 0.0, 1.0, 1.0}}) {
    EXPECT_TRUE(comes_true([&] {
      other.lead(Other::half);
      return robot_end_->is_led();
    }));
    EXPECT_TRUE(comes_true([&] {
      other.lead(bad);
      return !robot_end_->is_led();
    }));
    EXPECT_TRUE(is_rotation(orientation()));
  }
}

class ShapedTelelink : public Telelink {
 protected:
  ShapedTelelink() : Telelink(box) {}
};

// Hazard: robot-collides
TEST_F(ShapedTelelink, KeepsTheWholeToolOutOfWhatIsSeen) {
  operate({0.02, 0.0, -0.01}, turn);
  EXPECT_TRUE(comes_true([&] {
    return angle(orientation(), product(turn, found)) < 0.2 && std::abs(tool().x() - 0.02) < 2e-3 &&
           tool().z() < 0.03;
  }));
  pass(300);
  EXPECT_TRUE(comes_true([&] { return robot_end_->is_led(); }));
  const std::lock_guard lock(*mutex_);
  EXPECT_GT(state_->lowest_corner, -1e-3);
  EXPECT_LT(state_->lowest_corner, 6e-3);
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

TEST(Robots, TurnAsTheyAreToldOrSayThatTheyDoNot) {
  const test::OwnNetwork network;
  EXPECT_TRUE(test::fails_saying(
      [] { RobotEnd(std::make_unique<TestRobot>(false), {.name = "arm", .tool = box}); }, "box",
      "does not turn", "turns"));
  dds::Participant arm("arm");
  dds::Writer poses(arm, "/arm/pose", ros::PoseStamped{}, {});
  dds::Reader commands(arm, "/arm/go", ros::PoseStamped{}, {.reliable = true});
  std::atomic<bool> ends{false};
  std::thread says([&] {
    while (!ends) {
      poses.write(pose_of({ros::Time::now(), "world"}, {0.1, 0.2, 0.3}, found));
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  for (const bool turns : {true, false}) {
    const auto robot =
        open_robot(std::string("ros2:?command=/arm/go&pose=/arm/pose") + (turns ? "&turns" : ""));
    EXPECT_EQ(robot->info().turns, turns);
    EXPECT_LT(angle(robot->state()->orientation, found), 1e-9);
    Rotation sent(0.0, 0.0, 0.0, 0.0);
    EXPECT_TRUE(comes_true([&] {
      const double nan = std::numeric_limits<double>::quiet_NaN();
      robot->command({Vec3::Zero(), Rotation(nan, 0.0, 0.0, 0.0)}, Vec3::Zero(), 0.0);
      robot->command({Vec3::Zero(), turn}, Vec3::Zero(), 0.0);
      const auto command = commands.take_whole<ros::PoseStamped>();
      if (command) sent = orientation_of(*command);
      return command && angle(sent, turns ? turn : found) < 1e-9;
    }));
    EXPECT_TRUE(is_rotation(sent));
  }
  ends = true;
  says.join();
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
  for (int i = 0; i < 50; ++i) robot->command({to}, Vec3::Zero(), begin + 2e-3 * i);
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
    tool->command({}, Vec3::Zero(), monotonic_now());
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
    ASSERT_GT(tool->state()->position.z(), 3e-3) << i;
  }
}

}  // namespace test_telelink
}  // namespace palpate
