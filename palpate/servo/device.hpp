// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "palpate/core/patch.hpp"

namespace palpate {

/// What a device's motors can do. Defaults: a Touch-class desktop arm.
struct DeviceLimits {
  double max_force = 3.3;          ///< [N] for moments
  double continuous_force = 0.88;  ///< [N] for ever, without growing hot
};

/// Of a hand that is only simulated: the peak of a Touch, for as long as one likes.
constexpr DeviceLimits no_motors{.max_force = 3.3, .continuous_force = 3.3};

/// What can be said of an open device.
struct DeviceInfo {
  std::string uri;   ///< as it was opened
  std::string kind;  ///< e.g. "scripted path"
  DeviceLimits limits;
};

/// Where the hand is, in the device's own frame.
struct HandState {
  Vec3 position = Vec3::Zero();  ///< [m] device
  bool present = true;           ///< false: nobody holds it, or it cannot be read; no force then
  bool clutched = false;         ///< true: the hand moves and the HIP stays; no force then
};

/// A hand. Three functions; opening is the constructor's, closing (motors off) the destructor's.
///
/// The loop calls `read` and `write` in turn, once each per cycle, from one thread. Neither may
/// wait for longer than the device's own cycle, allocate, or throw: a device that cannot be read
/// reports `present = false`.
class Device {
 public:
  virtual ~Device() = default;

  [[nodiscard]] virtual const DeviceInfo& info() const = 0;
  /// [servo] @param t  [s] now, on the loop's clock
  virtual HandState read(double t) noexcept = 0;
  /// [servo] @param force  [N] device frame, on the hand  @param t  as for `read`
  virtual void write(const Vec3& force, double t) noexcept = 0;
};

}  // namespace palpate
