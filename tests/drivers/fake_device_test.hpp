// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "palpate/drivers/drivers.hpp"

#include "tests/fakes/workbench.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::test {

/// Tests of a haptic device's driver against a fake library, whose device lies on a workbench.
class FakeDeviceTest : public ::testing::Test {
 protected:
  /// @param driver    its name
  /// @param variable  of the environment that names the library
  /// @param library   below the folder of fakes
  FakeDeviceTest(const std::string& driver, const std::string& variable, const std::string& library)
      : driver_(standard_drivers().find(driver)), library_(variable, PALPATE_FAKES "/" + library) {}

  std::unique_ptr<Device> open(const std::string& uri) const {
    return driver_.open_device(Uri(uri));
  }

  TemporaryFolder folder;
  Workbench& bench = open_workbench((folder.path() / "workbench").c_str());

 private:
  Driver driver_;
  Environment place_{Workbench::variable, (folder.path() / "workbench").string()};
  Environment library_;
};

}  // namespace palpate::test
