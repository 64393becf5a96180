// SPDX-License-Identifier: Apache-2.0
// Two programs on the network of ROS 2: one serves a camera, the other reads it.
#include <array>
#include <csignal>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <sys/wait.h>

#include "tests/app/program.hpp"
#include "tests/drivers/dds_test.hpp"

namespace palpate {
namespace {

class Ros2Program : public test::Program {
  test::OwnNetwork network_;
};

TEST_F(Ros2Program, ServesACameraToAnother) {
  std::array<std::string, 6> words{PALPATE_PROGRAM, "serve-camera",
                                   "--camera",      "synthetic:plane?size=64x48",
                                   "--name",        "robot/eye"};
  std::array<char*, 7> arguments{};
  for (std::size_t i = 0; i < words.size(); ++i) arguments[i] = words[i].data();
  pid_t server = -1;
  ASSERT_EQ(posix_spawn(&server, PALPATE_PROGRAM, nullptr, nullptr, arguments.data(), environ), 0);
  const Outcome read =
      run("info --json 'ros2:/robot/eye/depth/image_raw/compressedDepth?wait=60s&reliable'");
  kill(server, SIGTERM);
  int status = 0;
  waitpid(server, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 128 + SIGTERM) << status;
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

}  // namespace
}  // namespace palpate
