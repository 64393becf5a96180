// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include <gtest/gtest.h>

#include "palpate/drivers/drivers.hpp"

#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_usb {

TEST(Usb, ShowsVendorAndProductAndHowToAllowThem) {
  const test::TemporaryFolder system;
  EXPECT_TRUE(usb_ids(system.path()).empty());
  std::filesystem::create_directories(system.path() / "sys/bus/usb/devices/1-1");
  std::filesystem::create_directories(system.path() / "sys/bus/usb/devices/1-0:1.0");
  system.write("sys/bus/usb/devices/1-1/idVendor", "1451\n");
  system.write("sys/bus/usb/devices/1-1/idProduct", "0301\n");
  const std::vector<std::string> ids = usb_ids(system.path());
  EXPECT_EQ(ids, std::vector<std::string>{"1451:0301"});
  const std::vector<std::string> known = {"0403:cb48", "1451"};
  EXPECT_TRUE(is_usb_of("1451:0301", known));
  EXPECT_FALSE(is_usb_of("0403:0001", known));
  EXPECT_FALSE(is_usb_of("", known));
  EXPECT_NE(usb_permission_remedy(ids[0]).find(
                "SUBSYSTEM==\"usb\", ATTRS{idVendor}==\"1451\", MODE=\"0666\""),
            std::string::npos);
}

}  // namespace test_usb
}  // namespace palpate
