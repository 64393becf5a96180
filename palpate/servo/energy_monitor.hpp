// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// Finds oscillations that the rendered surface itself keeps up, by the energy that went through
/// the device.
///
/// A passive surface gives back at most the energy that the hand put in: over a cycle of pressing
/// and letting go, the work of the force on the hand, relative to the surface's own motion, is not
/// positive. A sampled surface gives back more, by K (T/2 + t_d) times the integral of the squared
/// velocity, and a device and hand that damp less than that swing without end, at the frequency of
/// their mass on the surface's stiffness: 10 to 25 Hz on a desktop arm, less with a heavy one.
///
/// Cycles are found in the hand's motion along the surface's normal, relative to the surface. Many
/// in a row that are sustained, regular, at the same place, and in each of which energy was
/// generated, are an oscillation. A hand that taps or slides over ridges is not: it decides itself
/// when to return, or goes somewhere else. Knows no clock but the ticks'. One thread. [servo]
class EnergyMonitor {
 public:
  /// What counts as an oscillation; SafetyParameters has them for people.
  struct Limits {
    double distance;  ///< [m] a smaller swing of the hand is no cycle
    double count;     ///< [-] generating cycles in a row that are an oscillation
    bool suspected;   ///< there was one not long ago: less energy is evidence enough
  };

  /// One tick. @return true if it completed an oscillation's last cycle
  /// @param dt        [s] since the tick before
  /// @param sent      [N] world: the force that was sent in the tick before
  /// @param hip       [m] world
  /// @param normal    [-] of the surface, away from it; zero if not known
  /// @param velocity  [m/s] of the surface along the normal
  bool run(double dt, const Vec3& sent, const Vec3& hip, const Vec3& normal, double velocity,
           const Limits& limits) noexcept;

  /// Forgets everything: after a gap in what was measured.
  void restart() noexcept { *this = {}; }

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("energy.started", self.started_);
    way("energy.t", self.t_);
    way("energy.height", self.height_);
    way("energy.energy", self.energy_);
    way("energy.last_hip", self.last_hip_);
    way("energy.normal", self.normal_);
    way("energy.delayed_force", self.delayed_force_);
    way("energy.rising", self.rising_);
    for (auto* top : {&self.top_, &self.began_}) {
      way("energy.top.t", top->t);
      way("energy.top.height", top->height);
      way("energy.top.energy", top->energy);
      way("energy.top.force", top->force);
      way("energy.top.hip", top->hip);
    }
    way("energy.lowest", self.lowest_);
    way("energy.has_began", self.has_began_);
    way("energy.bottom", self.bottom_);
    way("energy.ticks", self.ticks_);
    way("energy.least_energy", self.least_energy_);
    way("energy.least_force", self.least_force_);
    way("energy.most_force", self.most_force_);
    way("energy.last_duration", self.last_cycle_.duration);
    way("energy.last_swing", self.last_cycle_.swing);
    way("energy.generating", self.generating_);
  }

 private:
  // walk() lists all of these.
  // Where the hand turned back towards the surface.
  struct Top {
    double t = 0.0;        // [s]
    double height = 0.0;   // [m] along the normal, relative to the surface
    double energy = 0.0;   // [J] delivered to the hand until then
    double force = 0.0;    // [N]
    Vec3 hip = {0, 0, 0};  // [m]
  };
  struct Cycle {
    double duration = 0.0;  // [s]
    double swing = 0.0;     // [m]
  };

  [[nodiscard]] bool generates(const Top& top, bool suspected) const noexcept;
  bool close_cycle(const Limits& limits) noexcept;

  bool started_ = false;
  double t_ = 0.0;       // [s] own time
  double height_ = 0.0;  // [m] of the hand, along the normal, relative to the surface
  double energy_ = 0.0;  // [J] delivered to the hand, relative to the surface
  Vec3 last_hip_ = Vec3::Zero();
  Vec3 normal_ = Vec3::Zero();         // the last one known
  Vec3 delayed_force_ = Vec3::Zero();  // [N] sent in the tick before the last

  bool rising_ = true;
  Top top_;              // highest place since the hand began to rise
  double lowest_ = 0.0;  // [m] since it began to fall
  // Of the cycle in progress, from the last top on:
  Top began_;
  bool has_began_ = false;
  double bottom_ = 0.0;  // [m]
  double ticks_ = 0.0;
  double least_energy_ = 0.0;  // [J]
  double least_force_ = 0.0;   // [N]
  double most_force_ = 0.0;    // [N]
  Cycle last_cycle_;
  double generating_ = 0.0;  // [-] cycles in a row
};

}  // namespace palpate
