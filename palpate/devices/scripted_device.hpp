// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "palpate/devices/hip_path.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// A hand that follows a path and does not care for forces.
///
/// The path begins at the first `read`; after its end the hand rests, or begins again.
class ScriptedDevice final : public Device {
 public:
  /// @param path    [m] device frame
  /// @param repeat  begin again after the end
  ScriptedDevice(HipPath path, bool repeat, std::string uri = "script:");

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override;
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  DeviceInfo info_;
  HipPath path_;
  bool repeat_;
  std::optional<double> began_;  // [s] on the loop's clock
};

}  // namespace palpate
