// SPDX-License-Identifier: Apache-2.0
// Two programs on the network of ROS 2: one serves a camera or is a node, the other reads it.
#include <csignal>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <sys/wait.h>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"
#include "palpate/servo/realtime.hpp"

#include "tests/app/program.hpp"
#include "tests/drivers/dds_test.hpp"
#include "tests/drivers/ros_client.hpp"

namespace palpate {
namespace test_ros2 {

// The program, at work until it is told to end.
class Started {
 public:
  explicit Started(std::vector<std::string> words) {
    words.insert(words.begin(), PALPATE_PROGRAM);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (posix_spawn(&pid_, PALPATE_PROGRAM, nullptr, nullptr, arguments.data(), environ) != 0)
      pid_ = -1;
  }
  ~Started() { end(); }
  Started(const Started&) = delete;
  Started& operator=(const Started&) = delete;

  // Its exit status, or -1.
  int end() {
    if (pid_ <= 0) return -1;
    kill(pid_, SIGTERM);
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  pid_t pid_ = -1;
};

class Ros2Program : public test::Program {
  test::OwnNetwork network_;
};

// The hand of the operator's end strokes what the robot's camera sees, and the tool follows it.
TEST_F(Ros2Program, LeadsARobotInAnotherProcess) {
  const Outcome both =
      run("teleop --headless --duration 3 --json --robot 'synthetic:plane?size=160x120&noise=1mm'");
  ASSERT_EQ(both.code, 0) << both.err;
  EXPECT_NE(both.err.find("is teleoperated by /robot"), std::string::npos) << both.err;
  const auto summary = nlohmann::json::parse(both.out);
  EXPECT_GT(summary["ticks"], 0);
  EXPECT_GT(summary["frames"], 0) << "the other process's camera was not seen";
}

TEST_F(Ros2Program, SaysWhatAnEndOfALinkLacks) {
  const auto refuses = [&](const std::string& words, const std::string& what) {
    const Outcome refused = run("teleop robot --headless --duration 1 " + words);
    EXPECT_EQ(refused.code, 2) << words;
    EXPECT_NE(refused.err.find(what), std::string::npos) << refused.err;
  };
  refuses("--robot point:", "has no camera; set the robot's camera");
  refuses("--robot pint: --camera synthetic:plane", "unknown type of robot");
  refuses("--device mouse:", "the haptic device is at the operator's end");
  refuses("--margin -1", "margin");
  refuses("--name 'a b'", "not a valid topic name");
}

TEST_F(Ros2Program, ServesACameraToAnother) {
  Started server({"serve-camera", "--camera", "synthetic:plane?size=64x48", "--name", "robot/eye"});
  const Outcome read =
      run("info --json 'ros2:/robot/eye/depth/image_raw/compressedDepth?wait=60s&reliable'");
  EXPECT_EQ(server.end(), 128 + SIGTERM);
  ASSERT_EQ(read.code, 0) << read.err;
  const auto info = nlohmann::json::parse(read.out);
  const Outcome itself = run("info --json 'synthetic:plane?size=64x48'");
  const auto expected = nlohmann::json::parse(itself.out);
  EXPECT_EQ(info["live"], true);
  for (const char* key : {"image", "focal_length_px", "units_per_metre", "measured_percent"})
    EXPECT_EQ(info["first_frame"][key], expected["first_frame"][key]) << key;
}

TEST_F(Ros2Program, SaysWhatCannotBeServed) {
  expect_refusal("serve-camera", {"no camera", "--camera URI"});
  expect_refusal("serve-camera --camera synthetic:plane --name 'my eye'", {"my eye", "topic"});
}

TEST_F(Ros2Program, IsANodeThatTellsAndAnswers) {
  Started node({"ros", "--camera", "synthetic:plane?size=64x48", "--name", "cell_3/feel",
                "--publish-rate", "50", "--record-folder", path("recordings")});
  dds::Participant other("test:");
  dds::Reader hips(other, "/cell_3/feel/hip", ros::PoseStamped{}, {.reliable = true, .depth = 10});
  std::optional<ros::PoseStamped> hip;
  const double end = monotonic_now() + test::long_enough;
  while (!hip && monotonic_now() < end) {
    other.wait(0.05);
    hip = hips.take<ros::PoseStamped>();
  }
  ASSERT_TRUE(hip);
  EXPECT_EQ(hip->header.frame_id, "world");
  test::RosClient<ros::SetParameters> set(other, "/cell_3/feel/set_parameters");
  const auto answer = set.ask({{},
                               {{"stiffness", ros::ParameterValue::of(250.0)},
                                {"stiffness", ros::ParameterValue::of(std::string("soft"))}}});
  ASSERT_TRUE(answer && answer->content.size() == 2);
  EXPECT_TRUE(answer->content[0].successful) << answer->content[0].reason;
  EXPECT_NE(answer->content[1].reason.find("number"), std::string::npos);
  test::RosClient<ros::Trigger> record(other, "/cell_3/feel/start_recording");
  const auto recording = record.ask({});
  ASSERT_TRUE(recording && recording->content.success);
  EXPECT_EQ(node.end(), 0);
  // What was being recorded when it was told to end is whole, with the parameter that was set.
  const Outcome replayed = run("info --json recording:" + recording->content.message);
  EXPECT_EQ(replayed.code, 0) << replayed.err;
}

TEST_F(Ros2Program, SaysWhatIsNoNode) {
  expect_refusal("ros --camera synthetic:plane --name 'my node'", {"my node", "letters"});
  expect_refusal("ros --camera synthetic:plane --publish-rate 0", {"--publish-rate", "1 to 1000"});
  expect_refusal("ros --camera synthetic:plane --duration 0", {"--duration", "0.1"});
}

}  // namespace test_ros2
}  // namespace palpate
