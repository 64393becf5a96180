// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <string>

#include "palpate/servo/device.hpp"
#include "palpate/servo/last_gate.h"

namespace palpate::test {

/// A device whose hand is where the test puts it and which keeps what it was told.
class FakeDevice : public Device {
 public:
  explicit FakeDevice(const DeviceLimits& limits = {}) { info_.limits = limits; }
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override { return hand; }
  void write(const Vec3& newtons, double /*t*/) noexcept override {
    force = newtons;
    ++writes;
  }
  void write(const Wrench& wrench, double t) noexcept override {
    torque = wrench.torque;
    write(wrench.force, t);
  }

  void announce(const palpate_gate_wish& told) noexcept override { wish = told; }
  void enable() override { ++enables; }
  void disable() noexcept override { ++disables; }
  [[nodiscard]] std::string fault_text() const override { return text; }

  HandState hand;
  std::string text;
  std::atomic<int> enables{0};
  std::atomic<int> disables{0};
  Vec3 force = Vec3::Constant(-1.0);
  Vec3 torque = Vec3::Zero();
  palpate_gate_wish wish{};
  int writes = 0;

 private:
  DeviceInfo info_{.uri = "fake:", .kind = "fake", .limits = {}};
};

}  // namespace palpate::test
