// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>

#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/ros2.hpp"
#include "palpate/io/devices/device_guard.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/realtime.hpp"

#include "tests/drivers/dds_test.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/push.hpp"

namespace palpate {
namespace test_ros2_device {

using Xyz = std::array<double, 3>;
constexpr Xyz pose_in_topic{0.1, 0.2, 0.3};

// Waits up to a minute, which is for tests that hang.
template <class Condition>
bool wait_for(const Condition& condition) {
  for (int i = 0; i < 60'000 && !condition(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return condition();
}

std::string with_name(std::string_view topic) {
  std::string text(topic);
  if (const std::size_t at = text.find("NAME"); at != std::string::npos) text.replace(at, 4, "arm");
  return text;
}

// A haptic node that tells one pose, and holds the force that came last, as those out there do.
class Node {
 public:
  explicit Node(const Ros2Hand& hand) {
    thread_ = std::thread([this, hand] { run(hand); });
  }
  ~Node() {
    ends_ = true;
    thread_.join();
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  struct Held {
    Xyz force{};
    double since = 0.0;  // [s, monotonic] when that force first came
    int forces = 0;      // that came
  };
  [[nodiscard]] Held held() const {
    const std::lock_guard lock(mutex_);
    return held_;
  }
  void be_silent() { silent_ = true; }

 private:
  template <class Message>
  using Force = std::function<Xyz(const Message&)>;

  // Reads forces of a type: what is taken is called with each.
  template <class Message>
  static std::function<void(const std::function<void(Xyz)>&)> reading(dds::Participant& participant,
                                                                      const std::string& topic,
                                                                      const Force<Message>& force) {
    const auto reader = std::make_shared<dds::Reader>(
        participant, topic, Message{}, dds::Quality{.reliable = true, .depth = 1000});
    return [reader, force](const std::function<void(Xyz)>& use) {
      while (const auto message = reader->template take<Message>()) use(force(*message));
    };
  }

  void run(const Ros2Hand& hand) {
    dds::Participant participant("node:");
    const std::string topic = with_name(hand.force);
    std::function<void(const std::function<void(Xyz)>&)> read;
    if (hand.force_type == "WrenchStamped")
      read = reading<ros::WrenchStamped>(participant, topic, [](const auto& m) { return m.force; });
    else if (hand.force_type == "Wrench")
      read = reading<ros::Wrench>(participant, topic, [](const auto& m) { return m.force; });
    else if (hand.force_type == "Vector3")
      read = reading<ros::Vector3>(participant, topic, [](const auto& m) { return m.data; });
    else if (hand.force_type == "OmniFeedback")
      read = reading<ros::OmniFeedback>(participant, topic, [](const auto& m) { return m.force; });
    else
      read = reading<ros::Float64MultiArray>(participant, topic, [](const auto& m) {
        return Xyz{m.data.at(0), m.data.at(1), m.data.at(2)};
      });
    constexpr dds::Quality best_effort{};
    std::optional<dds::Writer> poses, points;
    if (hand.pose_type == "Point")
      points.emplace(participant, with_name(hand.pose), ros::Point{}, best_effort);
    else
      poses.emplace(participant, with_name(hand.pose), ros::PoseStamped{}, best_effort);
    while (!ends_) {
      if (!silent_ && poses)
        poses->write(ros::PoseStamped{{{5, 0}, "base"}, pose_in_topic, {0.0, 0.0, 0.0, 1.0}});
      if (!silent_ && points) points->write(ros::Point{pose_in_topic});
      read([this](const Xyz& force) {
        const std::lock_guard lock(mutex_);
        if (held_.force != force || held_.forces == 0) held_.since = monotonic_now();
        held_.force = force;
        ++held_.forces;
      });
      participant.wait(0.001);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  std::atomic<bool> ends_{false}, silent_{false};
  mutable std::mutex mutex_;
  Held held_;
  std::thread thread_;
};

Ros2Hand plain() { return {.pose = "/hand/pose", .force = "/hand/force"}; }

class Ros2Device : public ::testing::Test {
 protected:
  static std::unique_ptr<Device> open(const std::string& uri) { return open_ros2_device(Uri(uri)); }
  // Pushes until the node holds what `is_there` looks for.
  template <class Condition>
  static bool push_until(Device& device, const Vec3& force, const Condition& is_there) {
    return wait_for([&] {
      device.write(force, monotonic_now());
      return is_there();
    });
  }

  test::OwnNetwork network_;
};

TEST_F(Ros2Device, TurnsPosesAndForcesOfEachKnownNode) {
  ASSERT_GE(ros2_hands().size(), 4U);
  for (const Ros2Hand& hand : ros2_hands()) {
    SCOPED_TRACE(hand.name);
    const Node node(hand);
    const auto device = open("ros2:" + hand.name + "?max_force=10&silence=1s");
    EXPECT_TRUE(device->info().limits.motors);
    device->enable();
    const Vec3 force(1.0, 2.0, -3.0);
    HandState state;
    EXPECT_TRUE(wait_for([&] { return (state = device->read(0.0)).present; }));
    const bool is_turned = hand.axes != "x,y,z";
    ASSERT_TRUE(!is_turned || hand.axes == "y,-x,z");
    EXPECT_TRUE(state.position.isApprox(is_turned ? Vec3(0.2, -0.1, 0.3) : Vec3(0.1, 0.2, 0.3)));
    const Xyz expected = is_turned ? Xyz{-2.0, 1.0, -3.0} : Xyz{1.0, 2.0, -3.0};
    EXPECT_TRUE(push_until(*device, force, [&] { return node.held().force == expected; }));
  }
}

TEST_F(Ros2Device, TakesTopicsTypesAndAxesOfOnesOwn) {
  Ros2Hand hand = plain();
  hand.force_type = "Wrench";
  const Node node(hand);
  const auto device =
      open("ros2:?pose=/hand/pose&force=/hand/force&force_type=Wrench&axes=x,-z,y&silence=1s");
  device->enable();
  HandState state;
  EXPECT_TRUE(wait_for([&] { return (state = device->read(0.0)).present; }));
  EXPECT_TRUE(state.position.isApprox(Vec3(0.1, -0.3, 0.2)));
  const Xyz expected{1.0, 0.5, -2.0};
  EXPECT_TRUE(
      push_until(*device, Vec3(1.0, 2.0, 0.5), [&] { return node.held().force == expected; }));
  // No more than its limit, whatever is asked for
  EXPECT_TRUE(push_until(*device, Vec3(0.0, 0.0, 50.0),
                         [&] { return std::abs(node.held().force[1] - 3.3) < 1e-9; }));
}

TEST_F(Ros2Device, LeavesNoForceBehind) {
  const Node node(plain());
  const auto pushing = [&] { return node.held().force == Xyz{0.0, 0.0, 2.0}; };
  const auto at_rest = [&] { return node.held().force == Xyz{}; };
  auto device = open("ros2:?pose=/hand/pose&force=/hand/force&silence=1s");
  const Vec3 force(0.0, 0.0, 2.0);
  device->enable();
  EXPECT_TRUE(push_until(*device, force, pushing));
  device->disable();
  EXPECT_TRUE(push_until(*device, force, at_rest));
  device->enable();
  EXPECT_TRUE(push_until(*device, force, pushing));
  EXPECT_TRUE(wait_for(at_rest));  // the servo has stopped to write
  EXPECT_TRUE(push_until(*device, force, pushing));
  device->write(Vec3(0.0, std::nan(""), 2.0), 0.0);
  EXPECT_TRUE(wait_for(at_rest));
  EXPECT_TRUE(push_until(*device, force, pushing));
  device.reset();
  EXPECT_TRUE(wait_for(at_rest));
}

TEST_F(Ros2Device, HasNoHandWhenNoPoseComes) {
  Node node(plain());
  const auto device = open("ros2:?pose=/hand/pose&force=/hand/force&silence=0.5s");
  EXPECT_TRUE(wait_for([&] { return device->read(0.0).present; }));
  node.be_silent();
  HandState state;
  EXPECT_TRUE(wait_for([&] { return !(state = device->read(0.0)).present; }));
  EXPECT_EQ(state.fault, DeviceFault::disconnected);
  EXPECT_TRUE(wait_for([&] {
    return device->fault_text().find("no pose comes on /hand/pose") != std::string::npos;
  }));
}

TEST_F(Ros2Device, SaysWhatIsMissingOrWrong) {
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:fd?wait=0.1s"); },
                                 "no pose comes as PoseStamped on /fd/ee_pose", "domain"));
  EXPECT_TRUE(
      test::fails_saying([] { return open("ros2:delta"); }, "delta", "ros2:fd", "ros2:crtk"));
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:?pose=/p"); }, "names no topic"));
  EXPECT_TRUE(
      test::fails_saying([] { return open("ros2:fd?axes=x,y,-z"); }, "axes=x,y,-z", "no rotation"));
  EXPECT_TRUE(
      test::fails_saying([] { return open("ros2:fd?axes=x,x,z"); }, "axes=x,x,z", "no rotation"));
  EXPECT_TRUE(test::fails_saying([] { return open("ros2:fd?force_type=Twist"); }, "Twist",
                                 "WrenchStamped"));
  EXPECT_TRUE(
      test::fails_saying([] { return open("ros2:fd?pose_type=Twist"); }, "Twist", "PoseStamped"));
  Node node(plain());
  EXPECT_TRUE(
      test::fails_saying([] { return open("ros2:?pose=/hand/pose&force=/hand/push&wait=1s"); },
                         "no node subscribes to forces of type WrenchStamped on /hand/push"));
}

// What the test below starts as a process of its own: a session that pushes.
TEST(Ros2Session, DISABLED_PushesUntilItIsKilled) {
  const auto device = open_guarded([] {
    return open_ros2_device(Uri("ros2:?pose=/hand/pose&force=/hand/force&silence=1s&wait=25s"));
  });
  device->enable();
  for (;;) {
    const bool pushes = device->read(monotonic_now()).present;
    test::push(*device, pushes ? 2.0 : 0.0, monotonic_now());
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

// Nodes hold their last force for ever: the guard sends zero when nothing else can.
TEST_F(Ros2Device, LeavesNoForceBehindWhenItsSessionIsKilled) {
  const Node node(plain());
  std::string program = "/proc/self/exe";
  std::string filter = "--gtest_filter=Ros2Session.*";
  std::string all = "--gtest_also_run_disabled_tests";
  std::array<char*, 4> arguments{program.data(), filter.data(), all.data(), nullptr};
  pid_t session = -1;
  ASSERT_EQ(posix_spawn(&session, program.c_str(), nullptr, nullptr, arguments.data(), environ), 0);
  EXPECT_TRUE(wait_for([&] { return node.held().force == Xyz{0.0, 0.0, 2.0}; }));
  const double killed = monotonic_now();
  kill(session, SIGKILL);
  waitpid(session, nullptr, 0);
  EXPECT_TRUE(wait_for([&] { return node.held().force == Xyz{}; }));
  RecordProperty("milliseconds_to_zero", std::to_string(1e3 * (node.held().since - killed)));
}

}  // namespace test_ros2_device
}  // namespace palpate
