// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// What went through the device in one sense of the word motion.
struct PortEnergy {
  double excess = 0.0;           ///< [J] given to the hand in this contact; below 0: taken from it
  double most = 0.0;             ///< [J] largest excess of this contact
  double made = 0.0;             ///< [J] sum of `most` over all contacts
  std::uint64_t generating = 0;  ///< contacts whose `most` was above `least_made`

  /// [J] A contact that made more counts as one that generates energy. A hand on 600 N/m presses
  /// with ten times as much when it presses 2 mm deep.
  static constexpr double least_made = 1e-4;
  /// Has this contact made more than that?
  [[nodiscard]] bool generates() const noexcept { return most > least_made; }
};

/// The energy that a session has given to the hand.
struct ServoEnergy {
  /// Force times motion of the hand relative to the surface. A surface at rest or in motion that
  /// gives back no more than was pressed into it never has an excess.
  PortEnergy relative;
  /// Force times motion of the hand in the room. A surface that lifts a hand does honest work here.
  PortEnergy absolute;
  std::uint64_t contacts = 0;  ///< so far, with the one in progress
};

/// Sums what force and torque that were really sent have done on the hand, tick by tick: a
/// passivity observer. docs/energy.md.
///
/// The force of a tick is taken to act, held, until the next tick, over the real time between them.
/// A contact begins with a force and ends when there was none for `apart`. Knows no clock but the
/// ticks'. One thread. [servo] O(1); no allocation, lock, system call or exception.
class PassivityObserver {
 public:
  struct Input {
    double t;      ///< [s] now
    Vec3 handle;   ///< [m] place of the hand on the device, in the world's axes
    Vec3 hip;      ///< [m] world
    double scale;  ///< [-] scene metres per device metre
    Vec3 surface;  ///< [m/s] world: of the surface at the proxy since the tick before
    bool jumped;   ///< the HIP went elsewhere without the hand: scene or placement have changed
    Vec3 sent;     ///< [N] world: what is sent to the device in this tick
    Vec3 torque = Vec3::Zero();  ///< [N m] world: likewise
    Vec3 turned = Vec3::Zero();  ///< [rad] world: how far the hand has turned since the tick before
  };

  const ServoEnergy& run(const Input& input) noexcept;
  [[nodiscard]] const ServoEnergy& energy() const noexcept { return energy_; }

  /// [s] without a force, after which a contact is over: noise may part hand and surface for less.
  static constexpr double apart = 0.02;
  /// [s] between two ticks. Over more, nobody knows what the device did with the last force.
  static constexpr double longest_gap = 0.05;

  /// Walks over all that is remembered from tick to tick; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    way("passivity.started", self.started_);
    way("passivity.touching", self.touching_);
    way("passivity.t", self.t_);
    way("passivity.pushed_at", self.pushed_at_);
    way("passivity.handle", self.handle_);
    way("passivity.hip", self.hip_);
    way("passivity.sent", self.sent_);
    way("passivity.torque", self.torque_);
    way("passivity.relative.excess", self.energy_.relative.excess);
    way("passivity.relative.most", self.energy_.relative.most);
    way("passivity.relative.made", self.energy_.relative.made);
    way("passivity.relative.generating", self.energy_.relative.generating);
    way("passivity.absolute.excess", self.energy_.absolute.excess);
    way("passivity.absolute.most", self.energy_.absolute.most);
    way("passivity.absolute.made", self.energy_.absolute.made);
    way("passivity.absolute.generating", self.energy_.absolute.generating);
    way("passivity.contacts", self.energy_.contacts);
  }

 private:
  // walk() lists all of these.
  bool started_ = false;    // the place and the force of the tick before are known
  bool touching_ = false;   // in a contact
  double t_ = 0.0;          // [s] of the tick before
  double pushed_at_ = 0.0;  // [s] of the last tick with a force
  Vec3 handle_ = Vec3::Zero();
  Vec3 hip_ = Vec3::Zero();
  Vec3 sent_ = Vec3::Zero();
  Vec3 torque_ = Vec3::Zero();
  ServoEnergy energy_;
};

}  // namespace palpate
