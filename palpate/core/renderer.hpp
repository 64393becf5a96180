// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "palpate/core/cloud.hpp"
#include "palpate/core/parameters.hpp"
#include "palpate/core/proxy.hpp"
#include "palpate/core/sight.hpp"

namespace palpate {

/// What happened in a tick besides the result; bits of `Tick::flags`.
enum TickFlag : std::uint32_t {
  /// The proxy had not converged after `step_budget` steps: it goes on in the next tick. Raise
  /// step_budget if this is regular and there is time.
  step_budget_hit = 1u << 0,
  /// More points were near than a patch holds; an even part of them was used. Move the camera away
  /// or lower its resolution.
  patch_thinned = 1u << 1,
  /// The coupling asked for more than max_force.
  force_saturated = 1u << 2,
  /// The HIP was not finite: no force, and the proxy stayed.
  non_finite_input = 1u << 3,
  /// There is no frame to touch yet: no force, and the proxy is at the HIP.
  no_frame = 1u << 4,
  /// The stamps of the last two frames do not increase: no velocity was derived from them.
  stamp_not_increasing = 1u << 5,
  /// The newest frame is older than max_extrapolation: the surface is taken to rest where it was
  /// last predicted to be.
  frame_stale = 1u << 6,
  /// The points' directions cancel out, so there is no normal: the last one was used.
  normal_undefined = 1u << 7,
  /// Method `sight`: the surface is out of sight, behind something or in a hole. The proxy rests on
  /// what is remembered of it, and the force fades out if that lasts.
  surface_hidden = 1u << 8,
  /// Method `sight`: the newest frame shows the proxy behind the surface that it is on the free
  /// side of, by more than noise explains. Set for as long as that frame is in use.
  pop_through_suspected = 1u << 9,
};

/// One cycle of haptic rendering: what the hand did, where the proxy went, what the hand feels.
struct Tick {
  double t;                 ///< [s] as given
  Vec3 hip;                 ///< [m] world, as given
  Vec3 proxy;               ///< [m] world, centre of the sphere after the tick's steps
  Vec3 normal;              ///< [-] unit, away from the surface; zero when nothing is within r_3
  Vec3 force;               ///< [N] world, on the hand; finite, at most max_force long
  ContactState state;       ///< after the tick's steps
  int steps;                ///< proxy steps taken
  double surface_velocity;  ///< [m/s] v of (13), towards the proxy
  std::int64_t frame;       ///< number of the frame in use, from 0; -1 before the first
  std::uint32_t flags;      ///< TickFlag bits
};

/// The method: frames and HIPs in, proxy and force out. The only thing that remembers.
///
/// Values in, values out: no thread, clock or file, so the same calls give the same ticks, bit for
/// bit, on the same machine. Not thread-safe; one thread calls `frame` and `tick`.
class Renderer {
 public:
  /// Allocates all it will ever need. @throws Error if the parameters do not validate.
  explicit Renderer(const Parameters& parameters = {});

  /// Puts the proxy at `proxy` [m, world] in free motion and forgets contact and velocity.
  /// Without it the first tick starts the proxy at its HIP.
  void seat(const Vec3& proxy) noexcept;

  /// Takes a new frame into use: movement step 1 of section 4.3, Eq. (3).
  ///
  /// [servo] O(1): no allocation, lock, system call or exception.
  /// @param cloud  must outlive its use, that is, until the next call
  /// @param stamp  [s] when it was captured, on the clock of `tick`
  void frame(const Cloud& cloud, double stamp) noexcept;

  /// Moves the proxy towards the HIP until it converges (section 4.3) and renders the force (4.6).
  ///
  /// [servo] At most step_budget steps over at most Patch::capacity points each; no allocation,
  /// lock, system call or exception.
  /// @param hip  [m] world
  /// @param t    [s] now, on the clock of the frames' stamps
  Tick tick(const Vec3& hip, double t) noexcept;

  /// The patch that the last tick saw, for drawing and measuring.
  [[nodiscard]] const Patch& patch() const noexcept { return patch_; }
  [[nodiscard]] const Parameters& parameters() const noexcept { return parameters_; }

  /// Changes parameters between two ticks; the proxy and its contact stay.
  /// @throws Error if they do not validate, leaving the old ones in place.
  void set_parameters(const Parameters& parameters);

 private:
  struct Movement;

  Movement move_over_points(const Vec3& hip) noexcept;
  Movement move_by_sight(const Vec3& hip, double t) noexcept;
  void frame_by_sight(const Cloud& cloud) noexcept;
  void cover(const Vec3& at, const Vec3& u, const Vec3& contact_normal) noexcept;
  Vec3 render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept;
  Vec3 blend_force(const Vec3& force, const Vec3& hip, double t) noexcept;

  Parameters parameters_;
  double cos_theta_;
  Patch patch_;
  const Cloud* cloud_ = nullptr;

  // The proxy and its contact.
  std::optional<Vec3> proxy_;   // P_k
  std::optional<Vec3> normal_;  // the last n known while in contact
  bool touching_ = false;       // the state after the last tick's steps

  // What the last look at the patch saw, and from where.
  Vec3 looked_at_ = Vec3::Zero();
  ContactState state_ = ContactState::free_motion;
  Vec3 direction_ = Vec3::Zero();  // n' of (1)

  // The surface's motion.
  std::int64_t frame_count_ = 0;
  double stamp_ = 0.0;                // t_j
  double interval_ = 0.0;             // t_j - t_(j-1)
  double velocity_ = 0.0;             // v_j
  bool patch_is_stale_ = true;        // a frame came since the patch was gathered
  bool velocity_update_due_ = false;  // (13) waits for the first step after (3)
  bool stamp_ok_ = true;

  // Method `sight`.
  SightTracker sight_;
  bool on_fit_ = false;               // the proxy rests on the fitted surface, not on points
  Vec3 points_moved_ = Vec3::Zero();  // [m] since their frame, with the surface, at the last tick
  bool behind_ = false;               // the monitor's verdict on the frame in use
  bool blend_due_ = false;            // a frame came since the last force
  Vec3 last_force_ = Vec3::Zero();
  Vec3 last_hip_ = Vec3::Zero();
  double last_blend_t_ = 0.0;
  double carried_rate_ = 0.0;  // [m/s] of the surface, before the newest frame
  Vec3 blend_offset_ = Vec3::Zero();
  double blend_start_ = 0.0;

  // The damper's memory.
  std::optional<double> last_distance_;  // |u_(l-1)|
  double last_t_ = 0.0;
};

}  // namespace palpate
