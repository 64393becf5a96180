// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <string_view>
#include <thread>

#include "palpate/kernel/core/uri.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/mailbox.hpp"

namespace palpate {

/// How sticks or a puck stand.
struct StickState {
  /// [-] -1 to 1 along each axis: to the right, away from the user, up
  Vec3 deflection = Vec3::Zero();
  std::uint32_t buttons = 0;
  bool plugged_in = true;
};

/// Something with sticks. Used by one thread.
class Sticks {
 public:
  virtual ~Sticks() = default;
  /// Waits for up to some 20 ms. @return how it stands then
  virtual StickState wait() noexcept = 0;
  /// Lets the user feel a contact. @param share  [-] of the largest force, 0: none
  /// @param begins  the contact has just begun
  virtual void feel(double /*share*/, bool /*begins*/) noexcept {}
};

/// How a rate hand moves.
struct RateOptions {
  Vec3 start = Vec3(0.0, 0.0, 0.05);  ///< [m] device frame
  double speed = 0.1;                 ///< [m/s] at full deflection, 0.01 to 1
  double dead_zone = 0.08;            ///< [-] of the deflection, 0 to 0.5
};
/// The options of a URI that `rate_options` reads.
inline constexpr std::array<std::string_view, 5> rate_option_names{"x", "y", "z", "speed",
                                                                   "dead_zone"};
/// @throws Error for a value out of range
RateOptions rate_options(const Uri& uri);

/// A hand whose place is the sum of what sticks say: deflection is speed (rate control), growing
/// with its square beyond the dead zone. It has no motors. Sticks are read on a thread of their
/// own.
class RateHand final : public Device {
 public:
  RateHand(std::unique_ptr<Sticks> sticks, DeviceInfo info, const RateOptions& options);
  ~RateHand() override;

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override;
  void write(const Vec3& force, double t) noexcept override;

 private:
  void run();

  std::unique_ptr<Sticks> sticks_;
  DeviceInfo info_;
  RateOptions options_;
  Mailbox<StickState> states_;
  std::atomic<double> force_{0.0};  // [N]
  std::atomic<bool> ending_{false};
  // Of the servo's thread:
  Vec3 position_;
  double last_t_ = -1.0;  // [s]
  std::thread thread_;
};

}  // namespace palpate
