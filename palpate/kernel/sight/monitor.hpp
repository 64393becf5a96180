// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bitset>
#include <cstdint>

#include "palpate/kernel/core/cloud.hpp"
#include "palpate/kernel/core/parameters.hpp"

namespace palpate {

/// [detail] What comes nearer by more than this from frame to frame, whatever their interval, is no
/// surface that a hand rests on, but came between it and the camera: a surface at rest struck with
/// 90 m/s^2 moves 50 mm in an interval at 30 Hz. Nor is a proxy brought back that lies deeper.
inline constexpr double farthest_strike = 13.0;
/// [-] Where holes leave too few points, a footprint is widened by this; the monitor's up to twice.
inline constexpr double hole_widening = 3.0;

/// The last word on a contact: checks hand and proxy against what the newest frame itself measures
/// on their lines of sight. It estimates nothing and trusts no fit. docs/sight.md, 7.
///
/// [servo] Nothing here allocates, locks or throws after construction. At most 6 gathers of at most
/// `look_points` points a tick, and none while frame, hand and proxy stay where they are.
class Monitor {
 public:
  /// What has to be done about a contact.
  enum class Action : std::uint8_t {
    none,
    release,          ///< the hand is in space that the frame shows free: no force, proxy to hand
    let_go,           ///< the proxy is farther from the hand than can be: the same
    return_to_front,  ///< the frame shows the proxy behind the surface: to `Verdict::front`
  };
  /// A tick as it would be without the monitor.
  struct Contact {
    Vec3 hip;                     ///< [m] world
    Vec3 proxy;                   ///< [m] world
    Vec3 normal;                  ///< [-] unit, world: where the force points; any if free
    bool touching = false;        ///< is there a force?
    Vec3 carried = Vec3::Zero();  ///< [m] world: how far the surface moved since its frame
    double noise = 0.0;           ///< [m] standard deviation of a footprint's height
    double deepest = 0.0;         ///< [m] penetration at which the coupling saturates
  };
  struct Verdict {
    Action action = Action::none;
    bool again = false;          ///< it was put back before, and passed through again
    bool behind = false;         ///< the newest frame shows the proxy behind its surface
    bool hidden = false;         ///< what the frame shows hides the whole proxy
    Vec3 front = Vec3::Zero();   ///< [m] world: where a proxy before the surface is
    Vec3 normal = Vec3::Zero();  ///< [-] unit: there, towards the camera
  };

  void set(const Parameters& parameters) noexcept;
  /// Forgets on which side of the surface the proxy is.
  void forget() noexcept;
  /// A camera's new frame is in use: looks at the one before are void. What has to be so in several
  /// frames in a row has to be so in as many of each camera.
  void start_frame(std::size_t camera = 0) noexcept {
    hand_.fresh = proxy_.fresh = false;
    if (frame_judged_ && seen_.test(camera)) {
      frame_judged_ = false;
      seen_.reset();
    }
    seen_.set(camera);
  }

  /// Judges a tick. To be called once each tick, in free motion too: the side is learned there.
  Verdict judge(const Cloud& cloud, const Contact& contact) noexcept;

  static constexpr std::size_t look_points = 256;

 private:
  /// On which side of what the camera sees the proxy is, by the frames so far.
  enum class Side : std::uint8_t { unknown, front, behind };
  /// What is measured on the lines of sight through a place.
  struct Look {
    bool fresh = false;            // of the newest frame
    bool seen = false;             // by any camera
    Vec3 place = Vec3::Zero();     // [m] world
    double radius = 0.0;           // [m] of the footprint there
    bool widened = false;          // it is wider than asked for: a narrower one says nothing
    double clear = 0.0;            // [m] by which all that is measured lies behind the place
    double behind = 0.0;           // [m] by which the place lies behind the median, negative before
    Vec3 line = Vec3::UnitZ();     // [-] from the place to the camera of `behind`
    double distance = 0.0;         // [m] to that camera
    double low = 0.0, high = 0.0;  // [m] above the place: 10 and 90 % of its points lie below
  };

  const Look& look_at(const Cloud& cloud, const Vec3& place, double radius, Look& look) noexcept;
  void look(const Cloud& cloud, const Vec3& place, double radius, bool widened,
            Look& look) noexcept;
  bool is_behind(const Cloud& cloud, double margin, double deepest) noexcept;
  [[nodiscard]] double most_margin(double distance) const noexcept;
  bool still_shown(const Cloud& cloud, double margin) noexcept;

  SightParameters parameters_;
  double r_c_ = ProxyParameters().r_c();  // [m]
  Patch patch_;
  Look hand_, proxy_;
  Side side_ = Side::unknown;
  Look last_front_;                     // the last look that showed the proxy in front
  std::bitset<Patch::max_views> seen_;  // cameras whose frame came since the last one was judged
  bool frame_judged_ = false;           // is the newest frame counted in `frames_behind_`?
  int frames_behind_ = 0;               // frames in a row that show the proxy behind its surface
  bool behind_in_frame_ = false;        // did a tick of the newest frame show it there?
  // It was put back in front, and since then no frame went by without showing it behind again.
  bool proved_ = false;
  int frames_past_edge_ = 0;  // frames in a row that show it beyond an edge
};

}  // namespace palpate
