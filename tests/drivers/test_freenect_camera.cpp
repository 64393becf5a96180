// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "palpate/servo/realtime.hpp"

#include "tests/drivers/fake_camera_test.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/errors.hpp"

namespace palpate {
namespace test_freenect_camera {

using test::fails_saying;
using test::image_of;

class Freenect : public test::FakeCameraTest {
 protected:
  Freenect() : FakeCameraTest("freenect", "PALPATE_LIBFREENECT", "freenect/libfreenect.so.0.5") {}
};

TEST_F(Freenect, GivesMillimetresThroughTheLensThatItWasCalibratedFor) {
  {
    const auto source = open("freenect:");
    const double before = monotonic_now();
    const auto frame = source->next(1.0);
    ASSERT_TRUE(frame);
    EXPECT_EQ(source->info().clock, StampClock::monotonic);
    EXPECT_GE(frame->stamp, before);
    EXPECT_LE(frame->stamp, monotonic_now());
    const DepthImage& image = image_of(*frame);
    EXPECT_EQ(image.units_per_metre(), 1000.0);
    EXPECT_NEAR(image.intrinsics().fx, 0.5 * 120.0 / 0.1042, 1e-3);
    EXPECT_EQ(image.intrinsics().cx, 48.0);
    EXPECT_FALSE(image.deproject(0, 5));
    EXPECT_NEAR(image.deproject(95, 71)->z(), 0.6, 2.1e-3);
  }
  EXPECT_EQ(live_objects(), 0);
}

TEST_F(Freenect, MakesDistancesOfTheSensorsSteps) {
  const auto frame = open("freenect:?depth=11bit")->next(1.0);
  const DepthImage& image = image_of(*frame);
  EXPECT_EQ(image.units_per_metre(), 10'000.0);
  EXPECT_FALSE(image.deproject(0, 5)) << "2047 is none";
  // A step at 0.6 m is 1 mm.
  EXPECT_NEAR(image.deproject(48, 36)->z(), 0.6, 1.6e-3 + 0.6e-3);
}

TEST_F(Freenect, WithoutCalibrationSaysWhatIsAssumed) {
  does("fast uncalibrated");
  const auto source = open("freenect:?depth=registered");
  ASSERT_EQ(source->info().notes.size(), 1U);
  EXPECT_EQ(image_of(*source->next(1.0)).intrinsics().fx, 580.0);
}

TEST_F(Freenect, IsFoundBySerialNumberAndTwoAtOnce) {
  does("fast cameras=2");
  const auto first = open("freenect:A00361");
  const auto second = open("freenect:A00362");
  EXPECT_TRUE(first->next(1.0));
  EXPECT_TRUE(second->next(1.0));
  EXPECT_TRUE(fails_saying(opening("freenect:7"), "serial number", "A00361, A00362"));
}

TEST_F(Freenect, ThatIsUnpluggedSaysSoAndIsThereAgain) {
  does("fast unplug_after=2 back_after=1");
  auto source = open("freenect:");
  EXPECT_TRUE(source->next(1.0));
  EXPECT_TRUE(source->next(1.0));
  EXPECT_TRUE(fails_saying([&] { return source->next(1.0); }, "not plugged in any more"));
  source.reset();
  EXPECT_TRUE(fails_saying(opening("freenect:"), "no Kinect v1 is plugged in", "udev"));
  EXPECT_TRUE(open("freenect:")->next(1.0));
}

TEST_F(Freenect, ThatCannotBeUsedSaysWhatToDoInOneLine) {
  does("denied");
  EXPECT_TRUE(fails_saying(opening("freenect:"), "cannot be opened", "udev", "gspca_kinect"));
  does("fast no_mm");
  EXPECT_TRUE(fails_saying(opening("freenect:"), "no depth of that kind", "11bit"));
  EXPECT_TRUE(fails_saying(opening("freenect:?depth=12bit"), "12bit", "registered"));
  EXPECT_EQ(live_objects(), 0);
  const test::Environment none("PALPATE_LIBFREENECT", "/nowhere/libfreenect.so");
  EXPECT_TRUE(fails_saying(opening("freenect:"), "is not there", "install the package"));
}

TEST_F(Freenect, IsReported) {
  does("fast cameras=2");
  const DriverReport report = look();
  ASSERT_EQ(report.found.size(), 2U);
  EXPECT_EQ(report.found[1].uri, "freenect:A00362");
  EXPECT_EQ(report.found[1].rate, 30.0);
  EXPECT_EQ(live_objects(), 0);
}

}  // namespace test_freenect_camera
}  // namespace palpate
