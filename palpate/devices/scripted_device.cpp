// SPDX-License-Identifier: Apache-2.0
#include "palpate/devices/scripted_device.hpp"

#include <cmath>
#include <utility>

namespace palpate {

ScriptedDevice::ScriptedDevice(HipPath path, bool repeat, std::string uri)
    : info_{.uri = std::move(uri), .kind = "scripted path", .limits = no_motors, .simulated = true},
      path_(std::move(path)),
      repeat_(repeat) {}

HandState ScriptedDevice::read(double t) noexcept {
  if (!began_) began_ = t;
  double along = t - *began_;
  const double length = path_.last_time() - path_.first_time();
  if (repeat_ && length > 0.0) along = std::fmod(along, length);
  return {.position = path_.at(path_.first_time() + along)};
}

}  // namespace palpate
