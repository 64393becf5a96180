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
#include "palpate/kernel/sight/render.hpp"
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

  [[nodiscard]] const Patch* patch() const noexcept override { return &contact_.mover.patch(); }
  [[nodiscard]] ContactMode mode() const noexcept { return contact_.tracker.mode(); }

 private:
  static constexpr std::size_t most_fused = 4;  // cameras; those of further ones are not averaged

  /// All that is remembered of one contact: a value.
  struct Contact {
    explicit Contact(const PointMover::Options& options) : mover(options) {}

    Proxy proxy;
    PointMover mover;
    SightTracker tracker;  // with the contact's mode
    Monitor monitor;
    ForceRenderer renderer;
    std::array<FusedImage, most_fused> fused;  // by camera: points that the proxy rests on
    int frames_on_fit = 0;                     // in a row; a few do not end an average
    // [m] displacement of the points since their frame, with the surface, at the last tick
    Vec3 points_moved = Vec3::Zero();
    std::optional<Vec3> last_proxy;  // [m] of the last tick
  };

  Movement move(const Vec3& hip, double t) noexcept;
  [[nodiscard]] bool is_near_fit(const Vec3& place, double t) const noexcept;
  bool rest_on_fit(const Vec3& hip, double t, Movement& movement) noexcept;
  void move_over_points(const Vec3& hip, double t, Movement& movement) noexcept;
  bool supervise(const Vec3& hip, double t, Movement& movement) noexcept;
  void put(const Vec3& place, Movement& movement) noexcept;
  void release(const Vec3& hip, Movement& movement) noexcept;
  void repair_side(const Vec3& points_moved) noexcept;
  Vec3 render_force(const Vec3& hip, double t, std::uint32_t& flags) noexcept;
  [[nodiscard]] double knowledge(double t) const noexcept;
  [[nodiscard]] double interval() const noexcept;
  void fuse(const Observation& seen, SightTracker::Event event) noexcept;
  [[nodiscard]] const FusedImage* fused() const noexcept;
  [[nodiscard]] ObservedClouds points() const noexcept;
  [[nodiscard]] Vec3 displacement(double t) const noexcept;
  [[nodiscard]] Vec3 surface_velocity(double t) const noexcept;

  Parameters parameters_;
  NewestFrame frame_;
  FrameTiming timing_;
  HandVelocity hand_velocity_;
  Contact contact_;
};

}  // namespace palpate
