// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "palpate/kernel/core/tick.hpp"
#include "palpate/kernel/feel/contact_material.hpp"
#include "palpate/kernel/feel/grain.hpp"
#include "palpate/kernel/feel/hardness.hpp"
#include "palpate/kernel/feel/tap.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"

namespace palpate {

/// The materials at the contacts of a tool: stiffness, cushion, viscosity and relief of each; one
/// grain and one ringing, those of the contact that is pressed most. docs/tools.md.
///
/// [servo] Nothing here allocates, locks or throws.
class ToolFeel {
 public:
  /// A contact that pushes.
  struct Pushed {
    std::size_t patch;  ///< of the tool
    Vec3 place;         ///< [m] world
    Vec3 lever;         ///< [m] to it from the tool's origin
    Vec3 normal;        ///< [-]
    Vec3 force;         ///< [N] world, friction included; `press` makes it what is felt
    Vec3 velocity;      ///< [m/s] of the hand's point there, relative to the surface
  };
  /// How the hand has moved since the tick before, relative to the surface.
  struct Movement {
    Vec3 by, velocity;  ///< [m], [m/s] world
    double dt;          ///< [s]
  };

  void set(const Parameters& parameters) noexcept;
  void take(const Observation& seen) noexcept;
  /// Is there anything to add?
  [[nodiscard]] bool feels() const noexcept { return feels_; }
  /// [-] The coefficient of friction at a patch's contact, which slides at `speed` [m/s].
  double friction(std::size_t patch, const Vec3& place, const Vec3& normal, double speed) noexcept;

  /// Turns the coupling's force and torque into those that are felt.
  void press(std::span<Pushed> contacts, const Movement& movement, Tick& tick) noexcept;
  /// Adds the ringing of a surface that is struck. For each tick, behind `press`.
  void ring(const Movement& movement, Tick& tick) noexcept;

 private:
  const Material& look(std::size_t patch, const Vec3& place, const Vec3& normal) noexcept;
  void forget_materials() noexcept;

  ObservedClouds clouds_;
  Material scene_;  // where no other is
  FrictionParameters friction_;
  double stiffness_ = 0.0, max_force_ = 0.0;
  bool feels_ = false;
  std::array<ContactMaterial, ToolShape::most_patches> here_;  // by patch
  TapParameters struck_;          // of the contact that is pressed most
  Vec3 approach_ = Vec3::Zero();  // [m/s] of the hand, smoothed for longer
  Vec3 drag_ = Vec3::Zero();      // [N] of friction in the tick before
  Hardness hardness_;
  Grain grain_;
  Tap tap_;
};

}  // namespace palpate
