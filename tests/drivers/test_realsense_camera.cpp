// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "palpate/servo/realtime.hpp"

#include "tests/drivers/fake_camera_test.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_realsense_camera {

using test::fails_saying;
using test::image_of;

double system_now() {
  using std::chrono::duration;
  return duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

class RealSense : public test::FakeCameraTest {
 protected:
  RealSense() : FakeCameraTest("realsense", "PALPATE_LIBREALSENSE", "realsense/librealsense2.so") {}

  [[nodiscard]] float option(int which) const { return ask<float>("fake_option", which); }
};

TEST_F(RealSense, GivesDepthInTheUnitOfTheFrameThroughItsLens) {
  does("fast unit=0.0001");
  {
    const auto source = open("realsense:");
    EXPECT_TRUE(source->info().live);
    EXPECT_EQ(source->info().kind, "Intel RealSense D435");
    EXPECT_EQ(source->info().sensor, SensorKind::stereo);
    const auto frame = source->next(1.0);
    ASSERT_TRUE(frame);
    const DepthImage& image = image_of(*frame);
    EXPECT_EQ(image.units_per_metre(), 10'000.0);
    EXPECT_EQ(image.intrinsics().width, 96);
    EXPECT_FLOAT_EQ(static_cast<float>(image.intrinsics().fx), 115.2F);
    EXPECT_FALSE(image.deproject(0, 5)) << "the column of holes, where rows begin";
    // The ray of a pixel through the lens, to the wall
    const auto point = image.deproject(90, 70);
    ASSERT_TRUE(point);
    EXPECT_NEAR(point->z(), 0.6, 1.6e-3);
    EXPECT_NEAR(point->x(), point->z() * (90 - 47.5) / 115.2, 1e-6);
    EXPECT_NEAR(point->y(), point->z() * (70 - 35.5) / 115.2, 1e-6);
    EXPECT_EQ(source->info().frame_rate, 30.0);
    EXPECT_FALSE(frame->colour);
  }
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(RealSense, StampsWithTheGlobalTimeAndUsesArrivalBeforeThereIsOne) {
  does("fast ");
  const auto source = open("realsense:");
  EXPECT_EQ(source->info().clock, StampClock::system);
  for (int k = 1; k <= 4; ++k) {
    const double before = system_now();
    const auto frame = source->next(1.0);
    const double after = system_now();
    ASSERT_TRUE(frame);
    const double latency = k <= 2 ? 0.0 : 0.020;  // as the fake has it
    EXPECT_GE(frame->stamp, before - latency - 0.0011) << "a whole millisecond";
    EXPECT_LE(frame->stamp, after - latency);
    EXPECT_LE(*frame->arrival, monotonic_now());
    EXPECT_GE(*frame->arrival, monotonic_now() - (system_now() - before) - 0.0011);
  }
}

TEST_F(RealSense, WithoutGlobalTimeIsFollowedByItsOwnClock) {
  does("fast no_global_time");
  const auto source = open("realsense:");
  EXPECT_EQ(source->info().clock, StampClock::sensor);
  EXPECT_NEAR(source->next(1.0)->stamp, 0.033333, 1e-9);
  EXPECT_NEAR(source->next(1.0)->stamp, 0.066666, 1e-9);
}

TEST_F(RealSense, OpensTheCameraOfASerialNumberAndTwoAtOnce) {
  does("fast cameras=2");
  const auto first = open("realsense:100000000001");
  const auto second = open("realsense:100000000002");
  EXPECT_TRUE(first->next(1.0));
  EXPECT_TRUE(second->next(1.0));
  EXPECT_TRUE(fails_saying(opening("realsense:7"), "realsense:7: there is no RealSense of that",
                           "100000000001 (Intel RealSense D435), 100000000002"));
}

TEST_F(RealSense, TakesSizeAndOptions) {
  const auto source =
      open("realsense:?width=192&height=144&fps=60&laser=150&exposure=8ms&preset=high-accuracy");
  EXPECT_EQ(image_of(*source->next(1.0)).intrinsics().width, 192);
  EXPECT_EQ(source->info().frame_rate, 60.0);
  EXPECT_EQ(option(18), 1.0F) << "emitter";
  EXPECT_EQ(option(13), 150.0F) << "laser [mW]";
  EXPECT_EQ(option(10), 0.0F) << "automatic exposure";
  EXPECT_EQ(option(3), 8000.0F) << "exposure [us]";
  EXPECT_EQ(option(12), 3.0F) << "preset";
  EXPECT_TRUE(open("realsense:?laser=0"));
  EXPECT_EQ(option(18), 0.0F);
}

TEST_F(RealSense, RefusesOptionsInOneLine) {
  EXPECT_TRUE(fails_saying(opening("realsense:?width=123&height=45"), "Couldn't resolve",
                           "leave width, height and fps out"));
  EXPECT_TRUE(fails_saying(opening("realsense:?fps=999"), "Couldn't resolve"));
  EXPECT_TRUE(fails_saying(opening("realsense:?laser=500"), "laser is refused", "out of range"));
  EXPECT_TRUE(fails_saying(opening("realsense:?laser=5mm"), "does not fit", "plain number"));
  EXPECT_TRUE(fails_saying(opening("realsense:?preset=best"), "no preset 'best'", "hand"));
  EXPECT_TRUE(fails_saying(opening("realsense:?widht=4"), "widht", "width"));
  EXPECT_TRUE(fails_saying(opening("realsense:?exposure=5"), "exposure"));
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(RealSense, GivesColourFromACameraBesideIt) {
  {
    const auto source = open("realsense:?colour");
    for (int k = 0; k < 2; ++k) {
      const auto frame = source->next(1.0);
      ASSERT_TRUE(frame->colour);
      EXPECT_EQ(frame->colour->width, 8);
      EXPECT_EQ(frame->colour->rgb[3], 200);
      EXPECT_EQ(frame->colour->rgb[5], 50);
      ASSERT_TRUE(frame->colour->camera);
      const Eigen::Isometry3d& pose = frame->colour->camera->world_from_camera;
      // The colour camera's x is the depth camera's y.
      EXPECT_TRUE((pose * Vec3(1.0, 0.0, 0.0)).isApprox(Vec3(0.015, 1.0, 0.0), 1e-6));
      EXPECT_FALSE(frame->colour->camera->intrinsics.distorted());
    }
  }
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(RealSense, ThatIsUnpluggedGivesNothingAndIsThereAgainWhenPluggedIn) {
  does("fast unplug_after=3 back_after=1");
  auto source = open("realsense:");
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(source->next(1.0));
  EXPECT_FALSE(source->next(0.0));
  source.reset();
  EXPECT_EQ(live_objects(), 0);
  EXPECT_TRUE(fails_saying(opening("realsense:"), "no RealSense is plugged in", "udev"));
  EXPECT_TRUE(open("realsense:")->next(1.0));
}

TEST_F(RealSense, ThatIsSilentIsCancelledAndWaitsNoLongerThanAsked) {
  does("fast silent");
  const auto source = open("realsense:");
  EXPECT_FALSE(source->next(0.0));
  source->cancel();
  EXPECT_FALSE(source->next());  // would be for ever
}

TEST_F(RealSense, ThatCannotBeOpenedSaysWhatToDo) {
  does("denied");
  EXPECT_TRUE(fails_saying(opening("realsense:"), "RS2_USB_STATUS_ACCESS", "udev rules"));
  does("busy");
  EXPECT_TRUE(fails_saying(opening("realsense:"), "busy", "end the other program"));
  does("cameras=0");
  EXPECT_TRUE(fails_saying(opening("realsense:"), "no RealSense is plugged in", "udev rules"));
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(RealSense, ThatGivesNonsenseIsAnErrorOfOneLine) {
  does("fast lens_wider=2");
  EXPECT_TRUE(fails_saying([&] { return open("realsense:")->next(1.0); }, "96x72", "98x72"));
  does("fast unit=0");
  EXPECT_TRUE(fails_saying([&] { return open("realsense:")->next(1.0); }, "unit of depth"));
  does("fast model=2 distorted");
  EXPECT_TRUE(fails_saying([&] { return open("realsense:")->next(1.0); }, "Inverse Brown Conrady"));
  does("fast distorted");
  EXPECT_TRUE(image_of(*open("realsense:")->next(1.0)).intrinsics().distorted());
}

TEST_F(RealSense, OfAnotherLibraryIsRefused) {
  does("version=11203");
  EXPECT_TRUE(fails_saying(opening("realsense:"), "librealsense2.so is of version 1.12.3"));
  does("version=25900");
  EXPECT_TRUE(fails_saying(opening("realsense:"), "API version mismatch"));
  const test::Environment old("PALPATE_LIBREALSENSE",
                              PALPATE_FAKES "/realsense-old/librealsense2.so");
  does("fast");
  EXPECT_TRUE(
      fails_saying(opening("realsense:"), "has no function rs2_depth_frame_get_units", "install"));
  const test::Environment none("PALPATE_LIBREALSENSE", "/nowhere/librealsense2.so");
  EXPECT_TRUE(fails_saying(opening("realsense:"), "is not there", "install librealsense2"));
}

TEST_F(RealSense, IsReportedWithFirmwareAndRemedy) {
  does("fast cameras=2 usb=2.1");
  const DriverReport report = look();
  EXPECT_EQ(report.version, "2.58.2");
  EXPECT_EQ(report.problem, "");
  ASSERT_EQ(report.found.size(), 2U);
  EXPECT_EQ(report.found[1].uri, "realsense:100000000002");
  EXPECT_EQ(report.found[1].firmware, "5.16.0.1");
  EXPECT_NE(report.found[1].note.find("USB 2.1"), std::string::npos);
  does("denied");
  const DriverReport denied = look();
  ASSERT_EQ(denied.found.size(), 1U);
  EXPECT_NE(denied.found[0].note.find("udev"), std::string::npos);
  EXPECT_EQ(live_objects(), 0);
}

}  // namespace test_realsense_camera
}  // namespace palpate
