// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <span>

#include "palpate/kernel/core/patch.hpp"
#include "palpate/kernel/fixtures/fixture_stage.hpp"
#include "palpate/net/teleop/approach_watch.hpp"
#include "palpate/net/teleop/led_hand.hpp"
#include "palpate/net/teleop/robot.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// Options of the robot's set-point.
struct SetPointOptions {
  double tool_radius = 5e-3;  ///< [m] as RobotInfo::tool_radius
  /// [m] from the centre to the farthest point of a tool with a shape; 0: a ball
  double tool_reach = 0.0;
  bool turns = true;                  ///< as RobotInfo::turns
  double lever = LeadLimits{}.lever;  ///< [m] as LeadLimits::lever
  /// [m] by which the tool stays away from the visible surface: the proxy's radius at the robot's
  /// end is larger by it
  double margin = 2e-3;
  double lag = 0.08;  ///< [s] as RobotInfo::lag: time by which approaching surfaces are anticipated
  /// [N/m] as RobotInfo::stiffness; empty: it does not press
  std::optional<double> stiffness = {};
  double max_force = 5.0;       ///< [N] with which the tool may press, wanted or not
  double unwanted_force = 1.0;  ///< [N] tolerated above the wanted force: the sensor's error
  double press_share = 0.0;     ///< [-] of the operator's force with which the tool presses, 0 to 1
  double max_speed = 0.5;       ///< [m/s] of the set-point itself
  double contact_speed = 0.05;  ///< [m/s] the same along and into what is touched
  /// The robot is never sent into these; see robot_fixtures(). Null: none
  std::shared_ptr<const FixtureSet> fixtures = {};
};

/// The forbidden regions of a set for a robot: they never yield. Guides, viscous regions and the
/// visible surface are left out; the proxy keeps out of the visible surface.
std::shared_ptr<const FixtureSet> robot_fixtures(const FixtureSet& fixtures);

/// @throws Error if one of them is out of range.
void validate(const SetPointOptions& options);

/// A tick at the robot's end for a lost proxy (ApproachWatch::is_between): no contact, and the
/// proxy is at the tool.
/// @param tool  [m, world] @param turn  world_from_tool
ServoTick with_proxy_at(const Vec3& tool, ServoTick tick,
                        const Rotation& turn = Rotation::Identity());

/// The commanded pose of the robot's tool: the proxy at the robot's end, which its camera keeps
/// out of the visible surface,
/// - plus a distance from the touched surface: twice the noise of the image, the speed of recent
///   motion times the robot's lag, and 0.2 s of the surface's recent speed, in which a reversal
///   goes unnoticed; 20 mm at most;
/// - away from approaching objects, touched or not, by their speed times the robot's lag
///   (ApproachWatch, and the method's velocity);
/// - into the surface by the operator's force over the robot's stiffness, if the robot is to press;
/// - away from any contact, visible or not, with more than `unwanted_force` above that, or more
///   than `max_force`.
/// Forbidden regions have priority over all that. An approaching object moves it at once; a proxy
/// that drops, perhaps because of image noise, moves it only at `contact_speed`. The orientation is
/// the proxy's, at the same speeds of the tool's farthest point.
/// Values in, values out: no clock, no thread. [servo]
class SetPoint {
 public:
  explicit SetPoint(const SetPointOptions& options = {});

  struct Order {
    Vec3 position = Vec3::Zero();                 ///< [m] world
    Vec3 velocity = Vec3::Zero();                 ///< [m/s] world
    Rotation orientation = Rotation::Identity();  ///< world_from_tool
  };

  /// @param tick   at the robot's end
  /// @param press  [N] world: with which the operator presses
  /// @param led false: no command, and the set-point may return to the tool at once
  /// @param comes the object that approaches the tool
  /// @param force  [N] world: of what the tool touches, on the tool; zero where it is not known
  Order next(const ServoTick& tick, const Vec3& press, bool led, const Approach& comes,
             const Vec3& force) noexcept;

 private:
  void look(const Tick& tick, bool touches, const Approach& comes, double dt) noexcept;
  double press_by(const Vec3& press, bool touches, bool led, double dt) noexcept;
  void retreat(const Vec3& pushed, double newtons, double dt) noexcept;
  void evade(Vec3 out, double dt) noexcept;
  void follow(const HandPose& held, bool touches, const Vec3& force, double dt) noexcept;
  [[nodiscard]] Vec3 way_out(const Vec3& place, const Approach& comes, double t) const noexcept;

  SetPointOptions options_;
  FixtureStage fixtures_;
  bool began_ = false;
  bool led_ = false;
  double last_t_ = 0.0;          // [s]
  Vec3 normal_ = Vec3::UnitZ();  // of the last contact
  Vec3 usual_ = Vec3::Zero();    // the same, over `turn_time`
  bool touched_ = false;
  HandPose held_;                // [m] world: the proxy as it is followed
  double speed_ = 0.0;           // [m/s] at which it is followed at most
  double lately_ = 0.0;          // [m/s] of what is touched or comes, in the last seconds
  double touched_lately_ = 0.0;  // [m/s] of what is touched alone
  double clear_ = 0.0;           // [m] that it stays farther away for noise and motion
  double approach_ = 0.0;        // [m/s] of the surface, towards the tool
  double depth_ = 0.0;           // [m] by which it presses
  Vec3 out_ = Vec3::Zero();      // [m] out of the way of what comes
  Vec3 retreat_ = Vec3::Zero();  // [m] from what pushes too hard
  Vec3 sent_ = Vec3::Zero();     // [m] world
};

/// Removes the bias of a robot's force sensor in free space: otherwise the robot would treat its
/// drift and the weight of the tool as a contact and retreat.
///
/// The force in free space is averaged over 2 s and subtracted: all of it in the first half second,
/// then only values within 1 N of it. A sudden force in free space is a contact with an object that
/// the camera does not see, not drift. [one thread]
class ForceZero {
 public:
  static constexpr double clear = 0.03;     ///< [m] nothing is nearer to a tool in free space
  static constexpr double largest = 20.0;   ///< [N] more is no error of a sensor
  static constexpr double drift = 1.0;      ///< [N] more is a contact
  static constexpr double first = 0.5;      ///< [s]
  static constexpr double averaging = 2.0;  ///< [s]

  /// @param t      [s] later than before
  /// @param force  [N] world: as it is measured
  /// @param free   the proxy is in free space, and nothing that is seen is nearer than `clear`
  /// @return [N] world: without what is measured in free space
  Vec3 next(double t, const Vec3& force, bool free) noexcept {
    const double dt = began_ ? std::clamp(t - last_t_, 0.0, 0.02) : 0.0;
    began_ = true;
    last_t_ = t;
    if (!force.allFinite()) return force;
    const bool is_error = known_ < first ? force.norm() < largest : (force - zero_).norm() < drift;
    if (free && is_error && dt > 0.0) {
      known_ = std::min(known_ + dt, averaging);
      zero_ += std::min(dt / known_, 1.0) * (force - zero_);
    }
    return force - zero_;
  }

 private:
  Vec3 zero_ = Vec3::Zero();  // [N]
  double known_ = 0.0;        // [s] that are in it
  double last_t_ = 0.0;       // [s]
  bool began_ = false;
};

/// What the cameras at a robot's end see about its tool.
struct Outlook {
  Approach comes;  ///< the fastest of all, with the noise of the noisiest camera
  double clearance = ApproachWatch::reach;  ///< [m] from the tool to the nearest point
  bool is_lost = false;  ///< all of them see a surface between the tool and its proxy
};

/// @param watches  one a camera
/// @param proxy, tool  [m, world]
/// @param radius       [m] of the tool
/// @param now          [s]
Outlook outlook(std::span<ApproachWatch> watches, const Vec3& proxy, const Vec3& tool,
                double radius, double now) noexcept;

/// The step by which a robot's end leads its tool, with or without a network: from a tick of the
/// session there to the next command. Values in, values out: no clock, no thread.
class RobotStep {
 public:
  /// @param hand  the session's device; must outlive this
  RobotStep(LedHand& hand, const SetPointOptions& options)
      : hand_(hand), set_point_(options), options_(options) {}

  /// @param tick   of the session; without a contact and with the proxy at the tool if it is lost
  /// @param press  [N] world: with which the operator presses
  /// @param at     where the robot is; its force becomes that without the sensor's error
  /// @param now    [s]
  SetPoint::Order next(ServoTick& tick, const Outlook& outlook, const Vec3& press, RobotState& at,
                       double now) noexcept;
  /// Did the last step follow the operator?
  [[nodiscard]] bool is_led() const { return led_; }
  /// Why the tool's shape is not kept out of what is seen, so that nothing is followed; empty: it
  /// is.
  [[nodiscard]] const char* trouble() const { return trouble_; }

 private:
  static constexpr double blind_after = 0.2;  // [s] without a frame nothing is led

  // [rad] A tool that lags by more does not follow: 0.2 at 0.25 m/s over 0.1 m, and a lag of 0.08 s
  static constexpr double most_behind = 0.3;

  [[nodiscard]] const char* unguarded(const ServoTick& tick, const RobotState& at) const noexcept;

  LedHand& hand_;
  SetPoint set_point_;
  ForceZero force_zero_;
  SetPointOptions options_;
  Rotation ordered_ = Rotation::Identity();  // the last order's
  bool began_ = false;
  bool led_ = false;
  const char* trouble_ = "";
};

}  // namespace palpate
