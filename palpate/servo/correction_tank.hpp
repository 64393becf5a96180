// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Passivity controller for corrections of the surface estimate.
///
/// A force F on a spring K stores F^2 / 2K. If this energy grows by more than the work of the hand
/// relative to the surface, a correction (new frame, fit, stiffness, method or rising gain) has
/// generated the difference. Each frame may add a little; more is taken from an energy tank, filled
/// by corrections away from the hand, damping and friction in the same contact. If the tank is
/// empty, the force is reduced to what the hand's own work allows: to the hand, the surface stays
/// where it was. The force is only reduced, without a step, and a surface that moves as it is
/// tracked lifts a hand with its full force.
///
/// Work counts in the scene's metres. One thread. [servo] O(1); no allocation, lock, system call or
/// exception.
class CorrectionTank {
 public:
  struct Input {
    double dt;          ///< [s] since the tick before
    Vec3 hip;           ///< [m] world
    Vec3 surface;       ///< [m/s] world: of the surface at the proxy
    Vec3 force;         ///< [N] world: what is to be sent
    Vec3 last;          ///< [N] world: what was sent in the tick before
    double stiffness;   ///< [N/m] of the surface; 0: nothing is limited
    bool new_frame;     ///< the first tick with a frame
    double frame_work;  ///< [J] that a frame may put in
  };

  /// @return the share of the force that may be sent, 0 to 1
  double run(const Input& input) noexcept;

  /// Forgets the contact: after a gap in what was measured.
  void restart() noexcept { *this = {}; }

  [[nodiscard]] double level() const noexcept { return level_; }  ///< [J] in the tank

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("tank.started", self.started_);
    way("tank.hip", self.hip_);
    way("tank.stiffness", self.stiffness_);
    way("tank.level", self.level_);
    way("tank.of_frame", self.of_frame_);
    way("tank.apart", self.apart_);
  }

 private:
  // walk() lists all of these.
  bool started_ = false;
  Vec3 hip_ = Vec3::Zero();  // [m] of the tick before
  double stiffness_ = 0.0;   // [N/m] of the tick before
  double level_ = 0.0;       // [J]
  double of_frame_ = 0.0;    // [J] left of what the newest frame may put in
  double apart_ = 0.0;       // [s] without a force
};

}  // namespace palpate
