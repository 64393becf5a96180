// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/drivers/fake_camera_test.hpp"
#include "tests/fakes/fake_camera.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/oni_recording.hpp"
#include "tests/support/sanitized.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_openni2_camera {

using test::fails_saying;
using test::image_of;

class OpenNi2 : public test::FakeCameraTest {
 protected:
  OpenNi2() : FakeCameraTest("openni2", "PALPATE_OPENNI2", "openni2/libOpenNI2.so.0") {}
};

TEST_F(OpenNi2, GivesDepthUnmirroredByItsFieldOfView) {
  {
    const auto source = open("openni2:");
    EXPECT_EQ(source->info().kind, "PrimeSense PS1080");
    EXPECT_EQ(source->info().clock, StampClock::sensor);
    EXPECT_EQ(source->info().frame_rate, 30.0);
    const auto first = source->next(1.0);
    const auto second = source->next(1.0);
    ASSERT_TRUE(second);
    EXPECT_NEAR(second->stamp - first->stamp, 0.033333, 1e-9);
    const DepthImage& image = image_of(*second);
    EXPECT_EQ(image.intrinsics().width, 96);
    EXPECT_EQ(image.units_per_metre(), 1000.0);
    EXPECT_NEAR(image.intrinsics().fx, 115.2, 1e-4);
    EXPECT_NEAR(image.intrinsics().fy, 115.2, 1e-4);
    EXPECT_EQ(image.intrinsics().cx, 48.0);
    EXPECT_FALSE(image.deproject(0, 5)) << "the column of holes is at the left";
    EXPECT_NEAR(image.deproject(95, 71)->z(), 0.6, 2.1e-3);
  }
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(OpenNi2, InTenthsOfMillimetresIsOfTheSameSize) {
  does("fast tenths");
  const auto frame = open("openni2:")->next(1.0);
  EXPECT_EQ(image_of(*frame).units_per_metre(), 10'000.0);
  EXPECT_NEAR(image_of(*frame).deproject(48, 36)->z(), 0.6, 1.6e-3);
}

TEST_F(OpenNi2, TakesSizeAndRateThatItHas) {
  EXPECT_EQ(image_of(*open("openni2:?width=48&height=36")->next(1.0)).intrinsics().width, 48);
  EXPECT_EQ(open("openni2:?fps=60")->info().frame_rate, 60.0);
  EXPECT_TRUE(fails_saying(opening("openni2:?width=50"), "no depth of that size",
                           "48x36 at 30 Hz, 96x72 at 30 Hz, 96x72 at 60 Hz"));
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(OpenNi2, GivesColourRegisteredByTheDevice) {
  const auto frame = open("openni2:?colour")->next(1.0);
  ASSERT_TRUE(frame->colour);
  EXPECT_EQ(frame->colour->width, 96);
  EXPECT_EQ(frame->colour->rgb[0], 200);
  EXPECT_FALSE(frame->colour->camera);
  does("fast no_registration");
  EXPECT_TRUE(fails_saying(opening("openni2:?colour"), "cannot register"));
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(OpenNi2, IsFoundBySerialNumberOrAddress) {
  does("fast cameras=2");
  EXPECT_TRUE(open("openni2:KINECT-2")->next(1.0));
  EXPECT_TRUE(open("openni2:1d27/0601@1/1")->next(1.0));
  EXPECT_TRUE(fails_saying(opening("openni2:KINECT-3"), "openni2:KINECT-3",
                           "KINECT-1 (PS1080), KINECT-2 (PS1080)"));
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(OpenNi2, ThatIsUnpluggedIsThereAgainWhenPluggedIn) {
  does("fast unplug_after=2 back_after=1");
  auto source = open("openni2:");
  EXPECT_TRUE(source->next(1.0));
  EXPECT_TRUE(source->next(1.0));
  EXPECT_FALSE(source->next(0.0));
  source.reset();
  EXPECT_TRUE(fails_saying(opening("openni2:"), "OpenNI2 sees no camera", "udev"));
  EXPECT_TRUE(open("openni2:")->next(1.0));
}

TEST_F(OpenNi2, ThatCannotBeUsedSaysWhatToDoInOneLine) {
  does("denied");
  EXPECT_TRUE(fails_saying(opening("openni2:"), "access denied", "udev rules"));
  does("no_drivers");
  EXPECT_TRUE(fails_saying(opening("openni2:"), "Found no valid drivers", "libopenni2-0"));
  does("fast no_view");
  EXPECT_TRUE(fails_saying(opening("openni2:"), "field of view"));
  does("fast short_frames");
  EXPECT_TRUE(fails_saying([&] { return open("openni2:")->next(1.0); }, "shorter than they say"));
  const test::Environment none("PALPATE_OPENNI2", "/nowhere/libOpenNI2.so.0");
  EXPECT_TRUE(fails_saying(opening("openni2:"), "is not there", "install the package"));
}

TEST_F(OpenNi2, IsReported) {
  does("fast cameras=2");
  const DriverReport report = look();
  EXPECT_EQ(report.version, "2.2.0.33");
  ASSERT_EQ(report.found.size(), 2U);
  EXPECT_EQ(report.found[1].serial, "KINECT-2");
  EXPECT_EQ(report.found[1].firmware, "5.9.2");
  EXPECT_EQ(report.found[1].rate, 60.0);
  does("denied");
  EXPECT_NE(look().found.at(0).note.find("udev"), std::string::npos);
  EXPECT_EQ(live_objects(), 0);
}

// The stock runtime, with a camera of the tests' own.
class StockOpenNi2 : public test::FakeCameraTest {
 protected:
  StockOpenNi2() : FakeCameraTest("openni2", "PALPATE_OPENNI2", "openni2-stock/libOpenNI2.so.0") {}
  void SetUp() override {
    if (!std::filesystem::exists(PALPATE_FAKES "/openni2-stock/OpenNI2/Drivers/libVirtual.so.0"))
      GTEST_SKIP() << "it needs the package libopenni2-dev";
    if (test::sanitized) GTEST_SKIP() << "what the runtime leaks would count as ours";
    does("fps=200");
  }

  static void expect_the_wall(const Frame& frame) {
    const DepthImage& image = image_of(frame);
    EXPECT_EQ(image.intrinsics().width, 96);
    EXPECT_NEAR(image.intrinsics().fx, 115.2, 1e-4);
    EXPECT_FALSE(image.deproject(0, 5)) << "the column of holes is at the left";
    EXPECT_NEAR(image.deproject(95, 71)->z(), 0.6, 2.1e-3);
  }
};

TEST_F(StockOpenNi2, GivesDepthUnmirroredAndIsThereAgainWhenPluggedIn) {
  const DriverReport report = look();
  ASSERT_EQ(report.found.size(), 1U);
  EXPECT_EQ(report.found[0].serial, "VIRTUAL-1");
  EXPECT_EQ(report.found[0].rate, 200.0);
  does("fps=200 unplug_after=3 back_after=1");
  {
    const auto source = open("openni2:VIRTUAL-1");
    EXPECT_EQ(source->info().kind, "Tests Wall");
    const auto lasts = [&] {
      for (int i = 0; i < 10; ++i) {
        if (const auto frame = source->next(2.0)) expect_the_wall(*frame);
      }
      return 0;
    };
    EXPECT_TRUE(test::fails_saying(lasts, "not plugged in any more"));
  }
  EXPECT_TRUE(fails_saying(opening("openni2:"), "OpenNI2 sees no camera"));
  EXPECT_TRUE(open("openni2:")->next(2.0));
}

TEST_F(StockOpenNi2, PlaysWhatItsRecorderRecordedUnchanged) {
  const test::TemporaryFolder folder;
  const std::string file = (folder.path() / "wall.oni").string();
  // All that the camera can have shown by then.
  std::set<std::vector<std::uint16_t>> shown;
  does("fast");
  FakeCamera camera;
  for (camera.begin(); camera.frames() < 500 && camera.wait(0.0);) {
    std::vector<std::uint16_t> depth;
    for (int v = 0; v < camera.height(); ++v) {
      for (int u = 0; u < camera.width(); ++u)
        depth.push_back(static_cast<std::uint16_t>(std::lround(1000.0 * camera.depth(u, v))));
    }
    shown.insert(depth);
  }
  does("fps=200");
  test::record_oni(PALPATE_FAKES "/openni2-stock/libOpenNI2.so.0", file, 6);
  const auto played = open("openni2:" + file);
  for (int i = 0; i < 3; ++i) {
    const auto frame = played->next(2.0);
    ASSERT_TRUE(frame);
    expect_the_wall(*frame);
    EXPECT_TRUE(shown.contains(image_of(*frame).depth().copy()));
  }
}

// Its thread uses the stream for up to 33 ms after that was destroyed: it must not begin.
TEST_F(StockOpenNi2, RefusesItsOwnDummyRatherThanCrashWithIt) {
  EXPECT_TRUE(fails_saying(opening("openni2:Dummy"), "field of view"));
}

}  // namespace test_openni2_camera
}  // namespace palpate
