// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/shared_library.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

#include "tests/support/environment.hpp"

namespace palpate::test {

inline const DepthImage& image_of(const Frame& frame) {
  return dynamic_cast<const DepthImage&>(*frame.cloud);
}

/// Tests of a driver against a fake library, whose cameras do what a text says (fake_camera.hpp).
class FakeCameraTest : public ::testing::Test {
 protected:
  /// @param driver    its name
  /// @param variable  of the environment that names the library
  /// @param file      below the folder of fakes
  FakeCameraTest(const std::string& driver, const std::string& variable, const std::string& file)
      : driver_(standard_drivers().find(driver)),
        file_(PALPATE_FAKES "/" + file),
        variable_(variable, file_),
        camera_(std::make_unique<Environment>("FAKE_CAMERA", "fast")) {}

  void does(const std::string& text) {
    camera_.reset();
    camera_ = std::make_unique<Environment>("FAKE_CAMERA", text);
  }
  [[nodiscard]] std::unique_ptr<Source> open(const std::string& uri) const {
    return driver_.open_camera(Uri(uri));
  }
  [[nodiscard]] auto opening(const std::string& uri) const {
    return [this, uri] { return open(uri); };
  }
  [[nodiscard]] DriverReport look() const { return driver_.look(); }
  /// A function of the fake library's own.
  template <class Result, class... Arguments>
  [[nodiscard]] Result ask(const char* symbol, Arguments... arguments) const {
    Result (*function)(Arguments...) =
        SharedLibrary({.name = "fake", .files = {file_}, .variable = {}, .remedy = {}})
            .find(symbol);
    return function(arguments...);
  }
  /// What was made by the library and not given back.
  [[nodiscard]] int live_objects() const { return ask<int>("fake_live_objects"); }

 private:
  Driver driver_;
  std::string file_;
  Environment variable_;
  std::unique_ptr<Environment> camera_;
};

}  // namespace palpate::test
