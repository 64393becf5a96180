// SPDX-License-Identifier: Apache-2.0
// Each camera's adapter end to end: the program, a fake of the vendor's library, a simulated hand.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>

#include "tests/support/sanitized.hpp"
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
  [[nodiscard]] std::string write(const std::string& name, const std::string& text) const {
    return folder_.write(name, text).string();
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
  // Contact with the wall and, after some frames, an unplugged camera that comes back.
  void touches_and_survives(const std::string& before, const std::string& camera,
                            int frames = 20) const {
    const Json json = session(
        before + " FAKE_CAMERA='back_after=1 unplug_after=" + std::to_string(frames) + "'", camera);
    ASSERT_TRUE(json.contains("cameras")) << json;
    EXPECT_GT(json["contact_ticks"], 100) << json;
    EXPECT_GT(json["max_force_asked"], 0.3) << json;
    EXPECT_GT(json["force_ticks"], 0) << json;
    // The wall faces the camera, whose frame is the world's here: x right, y down, z forward.
    const auto force = json["mean_force_sent"].get<std::vector<double>>();
    const double size = std::hypot(force.at(0), force.at(1), force.at(2));
    EXPECT_NEAR(force[0] / size, 0.0, 0.05) << json;
    EXPECT_NEAR(force[1] / size, 0.0, 0.05) << json;
    EXPECT_LT(force[2] / size, -0.99) << json;
    EXPECT_EQ(json["pop_throughs"], 0);
    EXPECT_GT(json["cameras"][0]["frames"], 30) << "also after it was plugged in again";
    EXPECT_GE(json["cameras"][0]["opened_again"], 1);
    EXPECT_EQ(json["cameras"][0]["doubt"], "");
    EXPECT_GT(json["servo"]["wake_up_p50_s"], 0.0) << json;
    EXPECT_GT(json["servo"]["hand_over_p99_s"], 0.0) << json;
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

TEST_F(CameraProgram, TouchesWhatOpenNi2Sees) {
  const std::string library = "PALPATE_OPENNI2=" PALPATE_FAKES "/openni2/libOpenNI2.so.0";
  touches_and_survives(library, "openni2:");
  expect_refusal(library, "openni2:77", {"openni2:77", "cannot open", "KINECT-1"});
  expect_refusal("PALPATE_OPENNI2=/nowhere", "openni2:", {"OpenNI2", "not there", "libopenni2-0"});
}

// The runtime that Debian ships, with a camera of the tests' own.
TEST_F(CameraProgram, TouchesWhatTheStockOpenNi2Sees) {
  const std::string folder = PALPATE_FAKES "/openni2-stock";
  if (!std::filesystem::exists(folder + "/OpenNI2/Drivers/libVirtual.so.0"))
    GTEST_SKIP() << "it needs the package libopenni2-dev";
  const std::string library = "PALPATE_OPENNI2=" + folder;
  touches_and_survives(library, "openni2:", 45);  // it takes longer to begin anew
  expect_refusal(library, "openni2:Dummy", {"openni2:Dummy", "field of view"});
}

TEST_F(CameraProgram, TouchesWhatAKinectSeesByLibfreenect) {
  const std::string library = "PALPATE_LIBFREENECT=" PALPATE_FAKES "/freenect/libfreenect.so.0.5";
  touches_and_survives(library, "freenect:");
  expect_refusal(library, "freenect:77", {"freenect:77", "serial number", "A00361"});
}

// Two drivers at once, one of which never loses its camera.
TEST_F(CameraProgram, TouchesWhatTwoCamerasSee) {
  const Json json = session("PALPATE_OPENNI2=" PALPATE_FAKES
                            "/openni2/libOpenNI2.so.0 "
                            "PALPATE_LIBREALSENSE=" PALPATE_FAKES
                            "/realsense/librealsense2.so "
                            "FAKE_CAMERA=cameras=1",
                            "openni2:' --camera 'realsense:");
  ASSERT_EQ(json["cameras"].size(), 2U) << json;
  for (const Json& camera : json["cameras"]) EXPECT_GT(camera["frames"], 15) << json;
  EXPECT_GT(json["contact_ticks"], 100) << json;
}

TEST_F(CameraProgram, TouchesWhatTheKernelDrives) {
  if (test::sanitized) GTEST_SKIP() << "a sanitizer's library must come first";
  const std::string lens = write("lens.json", R"({"width": 96, "height": 72, "fx": 115.2,
      "fy": 115.2, "cx": 47.5, "cy": 35.5, "depth_units_per_metre": 1000})");
  const std::string other = write("other.json", R"({"width": 64, "height": 48, "fx": 115.2,
      "fy": 115.2, "cx": 47.5, "cy": 35.5, "depth_units_per_metre": 1000})");
  const std::string kernel = "LD_PRELOAD=" PALPATE_FAKES "/v4l2/fake_v4l2.so";
  const std::string uri = "v4l2:/dev/video77?intrinsics=";
  touches_and_survives(kernel, uri + lens);
  expect_refusal(kernel, uri + other, {"96x72", "64x48"});
  expect_refusal(kernel, "v4l2:/dev/video77", {"neither lens nor unit", "intrinsics=FILE.json"});
  expect_refusal(kernel, "v4l2:/dev/video78?intrinsics=" + lens, {"'YUYV'", "Z16"});
  expect_refusal(kernel, "v4l2:/dev/video79?intrinsics=" + lens,
                 {"Permission denied", "usermod -aG video"});
  expect_refusal(kernel + " FAKE_CAMERA=busy", uri + lens, {"busy", "end the other program"});
  expect_refusal("", "v4l2:/dev/video76?intrinsics=" + lens, {"/dev/video76", "plugged in"});
}

// What is plugged in, as `doctor` lists it.
TEST_F(CameraProgram, ListsWhatIsPluggedIn) {
  const Outcome outcome = run("PALPATE_OPENNI2=" PALPATE_FAKES
                              "/openni2/libOpenNI2.so.0 "
                              "PALPATE_LIBFREENECT=/nowhere FAKE_CAMERA=cameras=2 "
                              "PALPATE_LIBREALSENSE=" PALPATE_FAKES "/realsense/librealsense2.so",
                              "doctor --json --seconds 0.1");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  const auto driver = [&](const std::string& name) {
    for (const Json& each : json["drivers"]) {
      if (each["name"] == name) return each;
    }
    return Json();
  };
  ASSERT_EQ(driver("realsense:")["found"].size(), 2U) << json;
  EXPECT_EQ(driver("realsense:")["found"][1]["uri"], "realsense:100000000002");
  EXPECT_EQ(driver("realsense:")["found"][1]["firmware"], "5.16.0.1");
  EXPECT_EQ(driver("openni2:")["version"], "2.2.0.33");
  EXPECT_NE(driver("freenect:")["problem"].get<std::string>().find("libfreenect0.5"),
            std::string::npos);
}

}  // namespace
}  // namespace palpate
