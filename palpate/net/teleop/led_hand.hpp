// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <atomic>
#include <optional>
#include <string>

#include <Eigen/Geometry>

#include "palpate/kernel/core/hand.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/servo/device.hpp"
#include "palpate/servo/mailbox.hpp"
#include "palpate/servo/safety.hpp"

namespace palpate {

/// Teleoperation command: all data that the operator's end sends.
///
/// Position and orientation are the operator's proxy's (ServoTick::place), never the HIP's: the
/// robot is never commanded into surfaces and fixtures that stop the proxy at the operator's end.
struct Lead {
  Vec3 place = Vec3::Zero();  ///< [m] world: where the tool is to be
  Vec3 press = Vec3::Zero();  ///< [N] world: with which the operator presses there
  /// World axes: from the orientation in which the tool was found to the one that it is to have.
  Rotation turn = Rotation::Identity();
  /// Is the command valid? Not while the device is released, clutched or faulty, or without frames.
  bool leads = false;
};

/// Of a tick at the operator's end. The tool's turn is that of the proxy from a handle that is
/// aligned with the device: identity where the device tells no orientation.
Lead lead_of(const ServoTick& tick) noexcept;

/// How a robot follows commands.
struct LeadLimits {
  /// [m/s] speed limit of the tool's farthest point, which a turn moves too: the reduced speed of
  /// ISO 10218
  double max_speed = 0.25;
  /// [m/s] speed limit in contact; it rises with the clearance. A tool of 3 kg that hits a surface
  /// of 10 kN/m at 0.029 m/s reaches 5 N, and a tool with lag cuts corners.
  double contact_speed = 0.03;
  double near_time = 0.2;  ///< [s] the clearance over this is the speed that it allows beyond that
  /// [m] from the tool's centre to its farthest point. At least 0.1: a turn about the tip of a tool
  /// moves the hand behind it.
  double lever = 0.1;
  bool turns = true;  ///< as RobotInfo::turns: false: the tool's orientation is not led
  /// [m] world: commands beyond it are followed to its boundary; empty: no limit
  std::optional<Eigen::AlignedBox3d> reach = {};
  /// [s] without a command, after which the tool is stopped where it is. Longer than the network
  /// jitter; with the robot's stopping time less than 100 ms.
  double silence = 0.05;
  double resume_time = 0.5;  ///< [s] in which the speed comes back after a stop
};

/// @throws Error if a limit is not positive and finite, or the reach is empty.
void validate(const LeadLimits& limits);

/// The device at the robot's end: the received commands are the HIP of a session there, so that the
/// camera at the robot keeps its proxy, and with it the robot, out of the visible surface.
///
/// Follows the newest command at a limited speed, turns included. Without commands, operator or
/// frames it rests at the tool and still counts as a hand: a moving surface pushes the proxy, and
/// the robot with it. Afterwards it follows commands again from there, slowly at first.
class LedHand final : public Device {
 public:
  /// @param begin  [m] world: where the tool is
  /// @param found  world_from_tool: how it is turned, for which Lead::turn is the identity
  /// @throws Error as validate().
  explicit LedHand(const Vec3& begin, const LeadLimits& limits = {},
                   const Rotation& found = Rotation::Identity(), std::string uri = "teleop:");

  /// A command has arrived. One thread.
  /// @param now  [s] on the loop's clock
  void lead(const Lead& lead, double now);
  /// Does the robot's end have frames? Without them commands are not followed. Any thread.
  void sees(bool yes) noexcept { sees_.store(yes, std::memory_order_relaxed); }
  /// Distance from the tool to the visible surface at the robot's end [m]; 0 in contact. Any
  /// thread.
  void clearance(double gap) noexcept { gap_.store(gap, std::memory_order_relaxed); }
  /// Reported position [m, world] and orientation (world_from_tool) of the robot's tool. One
  /// thread.
  void tool_is_at(const Vec3& place, const Rotation& turn = Rotation::Identity());
  /// Displacement of the proxy by forbidden regions from its position on the surface [m, world];
  /// zero: none. The HIP is displaced by the same vector, so that the surface is searched where the
  /// tool may be: beyond the border of a region it may be another one. One thread, once a tick.
  void kept_out(const Vec3& way);

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override;
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

  /// Does the tool follow commands? Any thread.
  [[nodiscard]] bool is_led() const noexcept { return led_.load(std::memory_order_relaxed); }

 private:
  struct Heard {
    Lead lead;
    double time = -1e9;  // [s] on the loop's clock
  };

  DeviceInfo info_;
  LeadLimits limits_;
  Mailbox<Heard> leads_;
  Mailbox<HandPose> tools_;
  Mailbox<Vec3> ways_;
  std::atomic<bool> sees_{true}, led_{false};
  std::atomic<double> gap_{1.0};  // [m]
  // The servo's thread
  const Rotation found_;
  HandPose tool_, pose_;
  double last_t_ = 0.0;   // [s]
  double kept_at_ = 0.0;  // [s] when it was last told what keeps it out
  double led_for_ = 0.0;  // [s] since it was taken up
  bool began_ = false;
};

/// The safety chain's limits for frames from a network. The network latency alone does not fade the
/// force: a frame fades once it is `fade_age` older than the typical age on arrival, and is lost
/// 0.3 s later. @param latency [s] typical time from capture to arrival; at most 1 s counts
inline SafetyParameters for_link(SafetyParameters safety, double latency) noexcept {
  constexpr double longest = 1.0;    // [s] nobody leads a robot by older images
  constexpr double fade_time = 0.3;  // [s]
  if (latency > 0.0) safety.fade_age += std::min(latency, longest);
  safety.lost_age = safety.fade_age + fade_time;
  return safety;
}

}  // namespace palpate
