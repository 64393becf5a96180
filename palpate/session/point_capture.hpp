// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "palpate/servo/device.hpp"

namespace palpate {

/// Recognises the points that a person touches with a device: where a button goes down, or, on a
/// device without buttons, where the tip rests for half a second after it has moved by 1 cm.
class PointCapture {
 public:
  /// One reading of the device. @param t  [s] increasing
  /// @return the point [m, device], when one has just been taken
  std::optional<Vec3> add(const HandState& hand, double t) noexcept;

 private:
  std::optional<Vec3> reference_;  // the last point, or where the device was first
  bool travelled_ = false;
  std::optional<std::uint32_t> buttons_;  // of the reading before
  std::optional<double> rest_began_;      // [s]
  Vec3 rest_at_ = Vec3::Zero();           // where it began
  Vec3 sum_ = Vec3::Zero();               // of the positions since then
  double count_ = 0.0;
};

/// Reads `count` points from a device. Never enables it, and writes zero forces only.
///
/// A device whose hand is simulated is read on a clock of its own, as fast as possible; others at
/// 1 kHz, or from their own callback.
/// @param timeout   [s] for all of them
/// @param captured  called for each point, on the calling thread
/// @throws Error if the time is over, or the device reports a fault.
std::vector<Vec3> capture_points(Device& device, std::size_t count, double timeout,
                                 const std::function<void(const Vec3&)>& captured = {});

}  // namespace palpate
