// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>
#include <optional>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// [-] From 1 at x = 0 to 0 at 1, with slopes of 0.
inline double ease(double x) noexcept {
  x = std::clamp(x, 0.0, 1.0);
  return 1.0 - x * x * (3.0 - 2.0 * x);
}

/// The force that a hand feels, from what the coupling says: lets it fade and come back with the
/// knowledge of the surface, spreads what frames correct and what jumps between them, and takes
/// what is left of an old force from a hand that leaves. docs/sight.md, 6.
///
/// [servo] Nothing here allocates, locks or throws.
class ForceRenderer {
 public:
  struct Input {
    Vec3 hip;                    ///< [m] world
    double t;                    ///< [s]
    Vec3 force;                  ///< [N] world: the coupling's, from the newest estimate
    std::optional<Vec3> normal;  ///< [-] unit, world: of the surface that is touched
    Vec3 velocity;               ///< [m/s] world: of that surface, as it is rendered
    double blend;                ///< [s] over which a correction is spread
    double known;                ///< [-] 0 to 1: how well the surface is known
    bool returned;               ///< the proxy was put back in front: no more is felt at once
    double return_speed;         ///< [m/s] at which it comes back once it is known again
    double r_c;                  ///< [m] and so much beyond itself
  };

  /// The next force will be a corrected one: until then the surface moved at `velocity` [m/s].
  void correct(const Vec3& velocity) noexcept {
    if (!due_) due_ = velocity;
  }
  /// As `correct`, for a frame: what it says is newer than what was corrected before.
  void start_frame(const Vec3& velocity) noexcept { due_ = velocity; }
  /// The force may end at once.
  void release() noexcept {
    due_.reset();
    offset_ = Vec3::Zero();
    ends_ = true;
  }
  void forget() noexcept {
    release();
    force_ = coupled_ = Vec3::Zero();
    felt_ = fully;
  }
  Vec3 render(const Input& input, const Coupling& coupling) noexcept;

  /// [N] world: of the last tick.
  [[nodiscard]] const Vec3& last() const noexcept { return force_; }
  /// [m] world: the last hand.
  [[nodiscard]] const Vec3& hip() const noexcept { return hip_; }

 private:
  static constexpr double fully = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool jumps(const Input& input, const Vec3& moved, double stiffness) const noexcept;
  [[nodiscard]] Vec3 blend(const Input& input, const Vec3& target, double stiffness) noexcept;
  [[nodiscard]] Vec3 left_behind(Vec3 force, const Input& input, double stiffness) noexcept;
  [[nodiscard]] Vec3 come_back(const Input& input, double stiffness) noexcept;

  std::optional<Vec3> due_;         // [m/s] a correction came since the last force
  bool ends_ = true;                // the force may be another in the next tick
  Vec3 offset_ = Vec3::Zero();      // [N] that it leaves to blend out
  double start_ = 0.0;              // [s] of that
  Vec3 coupled_ = Vec3::Zero();     // [N] what the coupling said last
  Vec3 force_ = Vec3::Zero();       // [N] the last one
  Vec3 hip_ = Vec3::Zero();         // [m] then
  double t_ = 0.0;                  // [s] then
  Vec3 left_at_ = Vec3::Zero();     // [m] the hand in the last tick in which it pressed
  Vec3 left_along_ = Vec3::Zero();  // [-] the last normal there was
  double pressed_ = 0.0;            // [m] how deep the coupling had the hand then
  double felt_ = fully;             // [m] inside the surface that the hand is felt at most
};

}  // namespace palpate
