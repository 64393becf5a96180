// SPDX-License-Identifier: Apache-2.0
// Each camera's adapter end to end: the program, a fake of the vendor's library, a simulated hand.
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/app/program.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/oni_recording.hpp"
#include "tests/support/sanitized.hpp"
#include "tests/support/stall_watch.hpp"

namespace palpate {
namespace test_cameras {

using Json = nlohmann::json;

class CameraProgram : public test::Program {
 protected:
  // A session of 2.5 s with a simulated hand that strokes what the camera sees, where the
  // environment holds `before`, a list of NAME=VALUE for a shell. Again, where the machine stood
  // still and the session is not `whole` by that.
  [[nodiscard]] Json session(const std::string& before, const std::string& camera,
                             const std::function<bool(const Json&)>& whole) const {
    Json json;
    for (int attempt = 0; attempt < 5; ++attempt) {
      const test::StallWatch machine;
      const Outcome outcome =
          run("run --headless --json --duration 2.5 --device hand: --camera '" + camera + "'",
              before + " ");
      EXPECT_EQ(outcome.code, 0) << outcome.err;
      json = Json::parse(outcome.out, nullptr, false);
      if (outcome.code != 0 || whole(json)) break;
      if (json["safety_ticks"]["stalled"] == 0 && machine.longest() < 0.05) break;
    }
    return json;
  }
  void expect_no_session(const std::string& before, const std::string& camera,
                         const std::vector<std::string>& words) const {
    expect_refusal("run --headless --duration 1 --camera '" + camera + "'", words, before + " ");
  }
  // What takes time in a session: a touch, and more than so many frames.
  static bool has_touched(const Json& json, int frames) {
    const Json& camera = json.at("cameras").at(0);
    return json["contact_ticks"] > 100 && json["max_force_asked"] > 0.3 &&
           json["force_ticks"] > 0 && json["pop_throughs"] == 0 && camera["frames"] > frames &&
           camera["dropped"] < camera["frames"];
  }
  // Contact with the wall, before a camera that says how it measures and gave so many frames.
  static void expect_touch(const Json& json, const std::string& sensor, int frames) {
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
    EXPECT_GT(json["cameras"][0]["frames"], frames) << json;
    EXPECT_EQ(json["cameras"][0]["sensor"], sensor);
    EXPECT_EQ(json["cameras"][0]["doubt"], "");
    EXPECT_GT(json["servo"]["wake_up_p50_s"], 0.0) << json;
    EXPECT_GT(json["servo"]["hand_over_p99_s"], 0.0) << json;
    EXPECT_LT(json["cameras"][0]["dropped"], json["cameras"][0]["frames"]) << json;
  }
  // The drivers of cameras, as the doctor lists them, by name.
  [[nodiscard]] std::map<std::string, Json> drivers(const std::string& before) const {
    const Outcome outcome = run("doctor --json --seconds 0.1", before);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    std::map<std::string, Json> drivers;
    const Json report = Json::parse(outcome.out, nullptr, false);
    for (const Json& driver : report["drivers"]) {
      if (driver["kind"] == "camera") drivers[driver["name"]] = driver;
    }
    return drivers;
  }
  // The same and, after some frames, an unplugged camera that comes back.
  void touches_and_survives(const std::string& before, const std::string& camera,
                            const std::string& sensor, int frames = 20) const {
    const Json json =
        session(before + " FAKE_CAMERA='back_after=1 unplug_after=" + std::to_string(frames) + "'",
                camera, [&](const Json& found) {
                  return has_touched(found, frames) && found["cameras"][0]["opened_again"] >= 1;
                });
    expect_touch(json, sensor, frames);  // and more, as it is plugged in again
    if (HasFailure()) return;
    EXPECT_GE(json["cameras"][0]["opened_again"], 1);
  }
};

TEST_F(CameraProgram, TouchesWhatARealSenseSees) {
  const std::string library = "PALPATE_LIBREALSENSE=" PALPATE_FAKES "/realsense/librealsense2.so";
  touches_and_survives(library, "realsense:", "stereo");
  expect_no_session(library, "realsense:77", {"realsense:77", "serial number", "100000000001"});
  expect_no_session("PALPATE_LIBREALSENSE=/nowhere",
                    "realsense:", {"librealsense2", "not there", "install"});
}

TEST_F(CameraProgram, TouchesWhatOpenNi2Sees) {
  const std::string library = "PALPATE_OPENNI2=" PALPATE_FAKES "/openni2/libOpenNI2.so.0";
  touches_and_survives(library, "openni2:", "structured light");
  expect_no_session(library, "openni2:77", {"openni2:77", "cannot open", "KINECT-1"});
  expect_no_session("PALPATE_OPENNI2=/nowhere",
                    "openni2:", {"OpenNI2", "not there", "libopenni2-0"});
}

// The runtime that Debian ships, with a camera of the tests' own.
TEST_F(CameraProgram, TouchesWhatTheStockOpenNi2Sees) {
  const std::string folder = PALPATE_FAKES "/openni2-stock";
  if (!std::filesystem::exists(folder + "/OpenNI2/Drivers/libVirtual.so.0"))
    GTEST_SKIP() << "it needs the package libopenni2-dev";
  const std::string library = "PALPATE_OPENNI2=" + folder;
  touches_and_survives(library, "openni2:", "structured light",
                       45);  // it takes longer to begin anew
  expect_no_session(library, "openni2:Dummy", {"openni2:Dummy", "field of view"});
}

// What OpenNI2's own recorder wrote of that camera, begun anew at its end.
TEST_F(CameraProgram, TouchesWhatTheStockOpenNi2Recorded) {
  const std::string library = PALPATE_FAKES "/openni2-stock/libOpenNI2.so.0";
  if (!std::filesystem::exists(library)) GTEST_SKIP() << "it needs the package libopenni2-dev";
  const std::string file = path("wall.oni");
  {
    const test::Environment runtime("PALPATE_OPENNI2", library);
    const test::Environment camera("FAKE_CAMERA", "fps=30");
    test::record_oni(library, file, 45);
  }
  const std::string before = "PALPATE_OPENNI2=" + library;
  expect_touch(session(before, "openni2:" + file + "?sensor=stereo",
                       [](const Json& found) { return has_touched(found, 30); }),
               "stereo", 30);
  expect_no_session(before, "openni2:" + path("none.oni"), {"none.oni", "cannot open"});
}

TEST_F(CameraProgram, TouchesWhatAKinectSeesByLibfreenect) {
  const std::string library = "PALPATE_LIBFREENECT=" PALPATE_FAKES "/freenect/libfreenect.so.0.5";
  touches_and_survives(library, "freenect:", "structured light");
  expect_no_session(library, "freenect:77", {"freenect:77", "serial number", "A00361"});
}

// Two drivers at once, one of which never loses its camera.
TEST_F(CameraProgram, TouchesWhatTwoCamerasSee) {
  const Json json = session("PALPATE_OPENNI2=" PALPATE_FAKES
                            "/openni2/libOpenNI2.so.0 "
                            "PALPATE_LIBREALSENSE=" PALPATE_FAKES
                            "/realsense/librealsense2.so "
                            "FAKE_CAMERA=cameras=1",
                            "openni2:' --camera 'realsense:", [](const Json& found) {
                              return has_touched(found, 15) && found["cameras"][1]["frames"] > 15;
                            });
  ASSERT_EQ(json["cameras"].size(), 2U) << json;
  for (const Json& camera : json["cameras"]) EXPECT_GT(camera["frames"], 15) << json;
  EXPECT_GT(json["contact_ticks"], 100) << json;
}

TEST_F(CameraProgram, TouchesWhatTheKernelDrives) {
  if (test::sanitized) GTEST_SKIP() << "a sanitizer's library must come first";
  const std::string lens = write("lens.json", R"({"width": 96, "height": 72, "fx": 115.2,
      "fy": 115.2, "cx": 47.5, "cy": 35.5, "depth_units_per_metre": 1000,
      "sensor_kind": "time of flight"})");
  const std::string other = write("other.json", R"({"width": 64, "height": 48, "fx": 115.2,
      "fy": 115.2, "cx": 47.5, "cy": 35.5, "depth_units_per_metre": 1000})");
  const std::string kernel = "LD_PRELOAD=" PALPATE_FAKES "/v4l2/fake_v4l2.so";
  const std::string uri = "v4l2:/dev/video77?intrinsics=";
  touches_and_survives(kernel, uri + lens, "time of flight");
  expect_no_session(kernel, uri + other, {"96x72", "64x48"});
  expect_no_session(kernel, "v4l2:/dev/video77", {"neither lens nor unit", "intrinsics=FILE.json"});
  expect_no_session(kernel, "v4l2:/dev/video78?intrinsics=" + lens, {"'YUYV'", "Z16"});
  expect_no_session(kernel, "v4l2:/dev/video79?intrinsics=" + lens,
                    {"Permission denied", "usermod -aG video"});
  expect_no_session(kernel + " FAKE_CAMERA=busy", uri + lens, {"busy", "end the other program"});
  expect_no_session("", "v4l2:/dev/video76?intrinsics=" + lens, {"/dev/video76", "plugged in"});
}

// What is plugged in, as `doctor` lists it.
TEST_F(CameraProgram, ListsWhatIsPluggedIn) {
  std::map<std::string, Json> full =
      drivers("FAKE_CAMERA=cameras=2 PALPATE_OPENNI2=" PALPATE_FAKES
              "/openni2/libOpenNI2.so.0 "
              "PALPATE_LIBFREENECT=" PALPATE_FAKES
              "/freenect/libfreenect.so.0.5 "
              "PALPATE_LIBREALSENSE=" PALPATE_FAKES "/realsense/librealsense2.so ");
  ASSERT_EQ(full["realsense:"]["found"].size(), 2U);
  EXPECT_EQ(full["realsense:"]["found"][1]["uri"], "realsense:100000000002");
  EXPECT_EQ(full["realsense:"]["found"][1]["firmware"], "5.16.0.1");
  EXPECT_EQ(full["realsense:"]["found"][1]["noise"],
            "stereo (assumed noise: 5 mm at 1 m, growing with the square of distance)");
  EXPECT_EQ(full["openni2:"]["version"], "2.2.0.33");
  for (const char* name : {"openni2:", "freenect:"}) {
    ASSERT_EQ(full[name]["found"].size(), 2U) << name;
    EXPECT_GE(full[name]["found"][0]["rate_hz"], 30.0) << name;
    EXPECT_EQ(full[name]["found"][0]["noise"].get<std::string>().substr(0, 16), "structured light");
  }
}

TEST_F(CameraProgram, SaysWhatToInstallOnAnEmptyMachine) {
  std::map<std::string, Json> empty = drivers(
      "PALPATE_OPENNI2=/nowhere PALPATE_LIBFREENECT=/nowhere PALPATE_LIBREALSENSE=/nowhere ");
  for (const auto& [name, remedy] : {std::pair("realsense:", "install"),
                                     {"openni2:", "libopenni2-0"},
                                     {"freenect:", "libfreenect0.5"}}) {
    EXPECT_TRUE(empty[name]["found"].empty()) << name;
    EXPECT_NE(empty[name]["problem"].get<std::string>().find(remedy), std::string::npos)
        << empty[name];
  }
  EXPECT_EQ(empty["v4l2:"]["problem"], "") << "it needs no library";
}

}  // namespace test_cameras
}  // namespace palpate
