// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "palpate/kernel/core/cloud.hpp"
#include "palpate/kernel/core/newest_frame.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate {

/// The proxy and the state of its contact from tick to tick.
struct Proxy {
  std::optional<Vec3> at;      ///< [m] P_k, world; none before the first tick
  std::optional<Vec3> normal;  ///< [-] unit: the last n known while in contact
  bool touching = false;       ///< the state after the last tick's steps
};

/// The result of a movement of the proxy.
struct Movement {
  ContactState state = ContactState::free_motion;
  Vec3 normal = Vec3::Zero();      ///< [-] unit; zero where there is none
  Vec3 first_step = Vec3::Zero();  ///< [m] s_k of (13)
  int steps = 0;
  bool touched = false;     ///< in contact or entrenched at any step
  std::uint32_t flags = 0;  ///< TickFlag bits
};

/// Moves a proxy over the points of a cloud, section 4.3: gathers the patch that the movement
/// needs, once for as long as it serves, and steps until the proxy rests.
///
/// [servo] Nothing here allocates, locks or throws after construction.
class PointMover {
 public:
  /// What may be set; all but `proxy` as in the paper by default.
  struct Options {
    ProxyParameters proxy;
    bool fixed_step = false;  ///< steps of 0.1 r_1 [1] instead of (9) to (12)
    double side_depth = 0.0;  ///< [m] sides of bodies, SightParameters::side_depth; 0: none
    double sheet = 0.0;       ///< [m] most between points where pixels are coarser; 0: any
  };

  explicit PointMover(const Options& options) { set(options); }
  void set(const Options& options) noexcept;

  /// The cloud or the proxy has changed: the next motion gathers again.
  void invalidate() noexcept { stale_ = true; }

  /// The proxy position has been set: resets the state.
  void seat() noexcept;

  /// Sets whether the proxy is occluded by the measured surface. While it is, side faces are not
  /// used, until it is visible again and farther than r_3 from them.
  void set_hidden(bool hidden) noexcept;

  /// Moves `proxy`, which must have a place, towards the HIP until it converges.
  ///
  /// At most step_budget steps over at most Patch::capacity points each.
  /// @param hip  [m] world
  Movement move(Proxy& proxy, const Cloud& cloud, const Vec3& hip) noexcept;

  /// The patch that the last movement saw.
  [[nodiscard]] const Patch& patch() const noexcept { return patch_; }

 private:
  void cover(const Proxy& proxy, const Cloud& cloud, const Vec3& at, const Vec3& u,
             const Vec3& contact_normal) noexcept;

  Options options_;
  double cos_theta_ = 1.0;
  Patch patch_;
  bool stale_ = true;
  bool hidden_ = false;
  bool inside_sides_ = false;  // the proxy has been hidden and is not clear of sides yet

  // Normal and state that the last movement ended with, and where.
  Vec3 seen_from_ = Vec3::Zero();
  ContactState state_ = ContactState::free_motion;
  Vec3 direction_ = Vec3::Zero();  // n' of (1)
};

/// Begins a tick in which a proxy is to move. A proxy without a place is put at the hand.
/// @return the tick as far as it is known; if it is complete, because the input is not finite or
/// there
///         is nothing to touch, the second is false and nothing is to be moved
std::pair<Tick, bool> begin_tick(Proxy& proxy, const NewestFrame& frame, const Vec3& hip,
                                 double t) noexcept;

/// Writes where the proxy came to rest into a tick: all but force and surface velocity.
/// @param longest_age  [s] of a frame that is not stale
void write_movement(const Proxy& proxy, const Movement& movement, const Patch& patch,
                    const NewestFrame& frame, double longest_age, Tick& tick) noexcept;

/// Ends a tick's movement: does the proxy touch, and what does it remember?
///
/// The contact shell is 0.02 mm thick, so a proxy that slides on noise leaves it for single steps.
/// What counts is where it came to rest; if it did not come to rest, whether it touched at all.
void finish_movement(Proxy& proxy, const Movement& movement) noexcept;

}  // namespace palpate
