// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <optional>
#include <string>

#include "palpate/servo/device.hpp"
#include "palpate/servo/mailbox.hpp"

namespace palpate {

/// Where a person at a screen wants the hand.
struct MouseTarget {
  Vec3 position = Vec3::Zero();  ///< [m] device frame
  /// device_from_handle
  std::optional<Eigen::Quaterniond> orientation = {};
  bool present = true;    ///< false releases: no force until it is back
  bool clutched = false;  ///< true: the hand moves and the HIP stays
};

/// A hand led by few, coarse places a second (a mouse, a touch screen), made smooth.
///
/// Between targets the hand follows a critically damped spring, x'' = w^2 (target - x) - 2 w x',
/// integrated exactly, and is never faster than `max_speed`: a jump of the mouse is a glide. It
/// turns by the share 1 - exp(-w dt) of what is left, at 4 rad/s at most. Nobody holds it before
/// the first target, nor when none has come for `silence`: a page repeats its target.
class MouseDevice final : public Device {
 public:
  /// @param start      [m] device frame: where the hand is before the first target
  /// @param response   [s] 2 / w: by which the hand lags behind a steady move
  /// @param max_speed  [m/s]
  /// @param silence    [s] without a target after which the hand is let go
  /// @throws Error if `start` is not a place, response is not in 1 ms to 1 s, max_speed not in
  ///         0.01 to 10 m/s or silence not in 0.2 to 60 s.
  explicit MouseDevice(const Vec3& start = Vec3::Zero(), double response = 0.025,
                       double max_speed = 1.0, std::string uri = "mouse:", double silence = 0.5);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override;
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  /// Where to go from now on. Any thread but the servo's; never holds the servo up.
  /// @throws Error if the place is not finite or farther than 1000 km.
  void aim(const MouseTarget& target);
  /// [m] device frame: where the hand was before the first target.
  [[nodiscard]] const Vec3& start_position() const { return start_; }

 private:
  DeviceInfo info_;
  Vec3 start_;
  double frequency_;  // [1/s] w
  double max_speed_;
  double silence_;     // [s]
  std::mutex aimers_;  // keeps several of them apart; the servo never takes it
  Mailbox<MouseTarget> targets_;
  MouseTarget target_;
  std::optional<double> last_t_;
  std::optional<double> aimed_t_;  // [s] when the newest target was first read
  Vec3 position_;
  Vec3 velocity_ = Vec3::Zero();
  std::optional<Eigen::Quaterniond> orientation_;
};

}  // namespace palpate
