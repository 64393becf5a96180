// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "palpate/kernel/core/hand_velocity.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/kernel/core/newest_frame.hpp"
#include "palpate/kernel/paper/coupling.hpp"
#include "palpate/kernel/paper/point_mover.hpp"
#include "palpate/kernel/sight/frame_timing.hpp"
#include "palpate/kernel/sight/fused_image.hpp"
#include "palpate/kernel/sight/monitor.hpp"
#include "palpate/kernel/sight/tracker.hpp"

namespace palpate {

/// Sightline tracking: follows the surface along the camera's lines of sight, before contact and in
/// it, and lets the proxy rest on a fit averaged over space and time. docs/sight.md.
///
/// Where the fit does not describe the points, the proxy moves over them as the paper's does.
class Sight final : public Method {
 public:
  /// Allocates all it will ever need. @throws Error if the parameters do not validate.
  explicit Sight(const Parameters& parameters = {});

  void seat(const Vec3& proxy) noexcept override;
  void observe(const Observation& seen) noexcept override;
  Tick tick(const Vec3& hip, double t) noexcept override;
  void set_parameters(const Parameters& parameters) noexcept override;

  [[nodiscard]] const Patch* patch() const noexcept override { return &mover_.patch(); }

 private:
  Movement move(const Vec3& hip, double t) noexcept;
  void supervise(const Vec3& hip, double t, Movement& movement) noexcept;
  void release(const Vec3& hip, Movement& movement) noexcept;
  Vec3 render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept;
  Vec3 blend_force(const Vec3& force, const Vec3& hip, double t) noexcept;
  [[nodiscard]] double interval() const noexcept;
  void fuse(const Observation& seen, SightTracker::Event event) noexcept;
  [[nodiscard]] const FusedImage* fused() const noexcept;
  [[nodiscard]] ObservedClouds points() const noexcept;
  [[nodiscard]] Vec3 displacement(double t) const noexcept;
  [[nodiscard]] Vec3 surface_velocity(double t) const noexcept;

  Parameters parameters_;
  PointMover mover_;
  NewestFrame frame_;
  FrameTiming timing_;
  Proxy proxy_;
  SightTracker tracker_;
  bool on_fit_ = false;  // the proxy rests on the fitted surface, not on points
  // [m] displacement of the points since their frame, with the surface, at the last tick
  Vec3 points_moved_ = Vec3::Zero();
  static constexpr std::size_t most_fused = 4;  // cameras; those of further ones are not averaged
  std::array<FusedImage, most_fused> fused_;    // by camera: points that the proxy rests on
  int frames_on_fit_ = 0;                       // in a row; a few do not end an average
  Monitor monitor_;
  std::optional<Vec3> last_proxy_;  // [m] of the last tick
  bool returning_ = false;          // the surface was hidden or lost and comes back
  double most_felt_ = 0.0;          // [m] inside it that the hand may be felt, then
  bool returns_ = false;            // it begins to come back in this tick

  // From which the force goes on when a frame arrives.
  bool blend_due_ = false;  // a frame came since the last force
  Vec3 last_force_ = Vec3::Zero();
  Vec3 last_hip_ = Vec3::Zero();
  Vec3 left_at_ = Vec3::Zero();     // [m] the hand in the last tick in which it pressed
  Vec3 left_along_ = Vec3::Zero();  // [-] the last normal there was
  double last_blend_t_ = 0.0;
  Vec3 carried_velocity_ = Vec3::Zero();  // [m/s] of the surface, before the newest frame
  Vec3 blend_offset_ = Vec3::Zero();
  double blend_start_ = 0.0;

  HandVelocity hand_velocity_;
};

}  // namespace palpate
