// SPDX-License-Identifier: Apache-2.0
// Each camera's adapter end to end: the program, a fake of the vendor's library, a simulated hand.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace {

using Json = nlohmann::json;

class CameraProgram : public ::testing::Test {
 protected:
  struct Outcome {
    int code;
    std::string out, err;
  };
  // Runs the program where the environment holds `before`, a list of NAME=VALUE for a shell.
  [[nodiscard]] Outcome run(const std::string& before, const std::string& arguments) const {
    const std::string out = (folder_.path() / "out").string();
    const std::string err = (folder_.path() / "err").string();
    const std::string command =
        before + " " PALPATE_PROGRAM " " + arguments + " >" + out + " 2>" + err + " </dev/null";
    const int status = std::system(command.c_str());  // NOLINT(cert-env33-c): a shell is wanted
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read(out), read(err)};
  }
  static std::string read(const std::string& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  }
  // A session of 2.5 s with a simulated hand that strokes what the camera sees.
  [[nodiscard]] Json session(const std::string& before, const std::string& camera) const {
    const Outcome outcome = run(before,
                                "run --headless --json --duration 2.5 --device hand: "
                                "--camera '" +
                                    camera + "'");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  // One line on stderr that holds all `words`, and exit status 2.
  void expect_refusal(const std::string& before, const std::string& camera,
                      const std::vector<std::string>& words) const {
    const Outcome outcome = run(before, "run --headless --duration 1 --camera '" + camera + "'");
    EXPECT_EQ(outcome.code, 2) << camera;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const std::string& word : words)
      EXPECT_NE(outcome.err.find(word), std::string::npos) << word << " is not in " << outcome.err;
  }
  // Contact with the wall and, half-way through, an unplugged camera that comes back.
  void touches_and_survives(const std::string& before, const std::string& camera) const {
    const Json json = session(before + " FAKE_CAMERA='unplug_after=20 back_after=1'", camera);
    ASSERT_TRUE(json.contains("cameras")) << json;
    EXPECT_GT(json["contact_ticks"], 100) << json;
    EXPECT_GT(json["max_force_asked"], 0.3) << json;
    EXPECT_GT(json["force_ticks"], 0) << json;
    EXPECT_EQ(json["pop_throughs"], 0);
    EXPECT_GT(json["cameras"][0]["frames"], 30) << "also after it was plugged in again";
    EXPECT_GE(json["cameras"][0]["opened_again"], 1);
    EXPECT_EQ(json["cameras"][0]["doubt"], "");
    EXPECT_LT(json["cameras"][0]["dropped"], 10) << json;
  }

 private:
  test::TemporaryFolder folder_;
};

TEST_F(CameraProgram, TouchesWhatARealSenseSees) {
  const std::string library = "PALPATE_LIBREALSENSE=" PALPATE_FAKES "/realsense/librealsense2.so";
  touches_and_survives(library, "realsense:");
  expect_refusal(library, "realsense:77", {"realsense:77", "serial number", "100000000001"});
  expect_refusal("PALPATE_LIBREALSENSE=/nowhere",
                 "realsense:", {"librealsense2", "not there", "install"});
}

}  // namespace
}  // namespace palpate
