// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <optional>
#include <string>

#include <Eigen/Geometry>

#include "palpate/servo/device.hpp"
#include "palpate/servo/mailbox.hpp"
#include "palpate/teleop/lead.hpp"

namespace palpate {

/// How a robot follows leads.
struct LeadLimits {
  double max_speed = 0.25;  ///< [m/s] in which a lead is followed: the reduced speed of ISO 10218
  /// [m/s] the same while something is touched, and so much more for each metre that nothing is
  /// near. A tool of 3 kg meets 10 kN/m with 5 N at 0.029 m/s, and one that is late cuts corners.
  double contact_speed = 0.03;
  double near_time = 0.2;  ///< [s] the clearance over this is the speed that it allows beyond that
  /// [m] world: leads beyond it are followed to its boundary; empty: no limit
  std::optional<Eigen::AlignedBox3d> reach = {};
  /// [s] without a lead, after which the tool is stopped where it is. Longer than the link's
  /// jitter; with the robot's own time to stop less than 100 ms.
  double silence = 0.05;
  double resume_time = 0.5;  ///< [s] in which the speed comes back after a stop
};

/// @throws Error if a limit is not positive and finite, or the reach is empty.
void validate(const LeadLimits& limits);

/// The hand at the robot's end of a link: what was led goes into a session there as any hand does,
/// so that a camera beside the robot keeps its proxy, and with it the robot, out of the visible
/// surface.
///
/// Follows the newest lead at a limited speed. Where none comes, nobody leads any more, or nothing
/// is seen, it rests where the tool is, and stays a hand: a surface that moves still pushes the
/// proxy, and the robot with it. Afterwards it takes up the lead from there, slowly at first.
class LedHand final : public Device {
 public:
  /// @param begin  [m] world: where the tool is
  /// @throws Error as validate().
  explicit LedHand(const Vec3& begin, const LeadLimits& limits = {}, std::string uri = "teleop:");

  /// A lead has come. One thread.
  /// @param now  [s] on the loop's clock
  void lead(const Lead& lead, double now);
  /// Does the robot's end see what is there? Who does not is not led. Any thread.
  void sees(bool yes) noexcept { sees_.store(yes, std::memory_order_relaxed); }
  /// How far the tool is from what the robot's end sees [m]; 0 where its proxy touches. Any thread.
  void clearance(double gap) noexcept { gap_.store(gap, std::memory_order_relaxed); }
  /// Where the robot's tool is [m, world], as it says. One thread.
  void tool_is_at(const Vec3& place);
  /// By how much forbidden regions keep the proxy from where the surface alone would have it
  /// [m, world]; zero: they do not. The hand goes that way, so that the surface is looked for where
  /// the tool may be: beyond a region's border it is another one. One thread, once a tick.
  void kept_out(const Vec3& way);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override;
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  /// Is the tool being led? Any thread.
  [[nodiscard]] bool is_led() const noexcept { return led_.load(std::memory_order_relaxed); }

 private:
  struct Heard {
    Lead lead;
    double time = -1e9;  // [s] on the loop's clock
  };

  DeviceInfo info_;
  LeadLimits limits_;
  Mailbox<Heard> leads_;
  Mailbox<Vec3> tools_, ways_;
  std::atomic<bool> sees_{true}, led_{false};
  std::atomic<double> gap_{1.0};  // [m]
  // The servo's thread
  Vec3 tool_;
  Vec3 place_;
  double last_t_ = 0.0;   // [s]
  double kept_at_ = 0.0;  // [s] when it was last told what keeps it out
  double led_for_ = 0.0;  // [s] since it was taken up
  bool began_ = false;
};

}  // namespace palpate
