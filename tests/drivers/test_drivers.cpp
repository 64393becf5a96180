// SPDX-License-Identifier: Apache-2.0
#include <stdexcept>

#include <gtest/gtest.h>

#include "palpate/drivers/drivers.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/environment.hpp"
#include "tests/support/errors.hpp"

namespace palpate {

namespace test_drivers {

TEST(Drivers, AreKindsOfSourceAndDeviceLikeAnyOther) {
  Registry<Driver> drivers = standard_drivers();
  drivers.add({.name = "my-arm",
               .summary = "an arm",
               .tried = "nothing",
               .open_device = [](const Uri& uri) -> std::unique_ptr<Device> {
                 throw Error(uri.text(), "it is a test");
               }});
  drivers.add({.name = "my-camera",
               .summary = "a camera",
               .tried = "nothing",
               .open_camera = [](const Uri& uri) -> std::unique_ptr<Source> {
                 throw Error(uri.text(), "it is a test");
               }});
  EXPECT_TRUE(test::fails_saying(
      [&] { return open_device("my-arm:7", std::nullopt, all_devices(drivers)); },
      "my-arm:7: it is a test"));
  EXPECT_TRUE(test::fails_saying([&] { return open_source("my-camera:7", all_sources(drivers)); },
                                 "my-camera:7: it is a test"));
  EXPECT_EQ(all_devices(drivers).try_find("my-camera"), nullptr);
  EXPECT_EQ(all_sources(drivers).try_find("my-arm"), nullptr);
  EXPECT_NE(all_devices().try_find("hand"), nullptr);
  EXPECT_NE(all_sources().try_find("synthetic"), nullptr);
}

TEST(Drivers, ReportWhatTheirLookMeets) {
  const auto look = reporting([]() -> DriverReport { throw std::runtime_error("no library"); });
  EXPECT_EQ(look().problem, "no library");
}

TEST(Drivers, AreCompleteAndLookWithoutThrowing) {
  const test::NoVendorsUnderASanitizer ours_alone;
  const Registry<Driver> drivers = standard_drivers();
  for (const Driver& driver : drivers.entries()) {
    EXPECT_NE(driver.summary, "") << driver.name;
    EXPECT_NE(driver.tried, "") << driver.name;
    EXPECT_TRUE(driver.open_camera != nullptr || driver.open_device != nullptr) << driver.name;
    ASSERT_NE(driver.look, nullptr) << driver.name;
    const DriverReport report = driver.look();
    EXPECT_TRUE(!report.problem.empty() || !report.library.empty()) << driver.name;
  }
}

}  // namespace test_drivers
}  // namespace palpate
