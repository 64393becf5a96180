// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/servo/device.hpp"

namespace palpate::test {

/// A device whose hand is where the test puts it and which keeps what it was told.
class FakeDevice final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return hand; }
  void write(const Vec3& newtons, double /*t*/) noexcept override {
    force = newtons;
    ++writes;
  }

  HandState hand;
  Vec3 force = Vec3::Constant(-1.0);
  int writes = 0;

 private:
  DeviceInfo info_{.uri = "fake:", .kind = "fake", .limits = {}};
};

}  // namespace palpate::test
