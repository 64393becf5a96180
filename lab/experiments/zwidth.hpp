// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "lab/closed_loop.hpp"

namespace palpate::lab {

/// A device and what holds it. Hand `none` presses with a soft spring that has neither mass nor
/// damping: the handle lies on the surface as if by its own weight.
struct ZHolding {
  std::string name;
  DevicePreset device;
  Grip hand;
};

/// `touch-0.26N`, `touch-0.05N`, `touch-0N` and `omega` in the hands `none`, `light` and `firm`.
std::vector<ZHolding> z_holdings();

/// What a scene of the Z-width shows, captured once and played to every loop.
class ZScene {
 public:
  /// @param name  `plane`, `sphere` (40 mm), `edge` or `corner` (of two or three walls, from
  /// inside)
  /// @param sensor  as in `synthetic:`
  ZScene(std::string_view name, std::string_view sensor, std::uint64_t seed);

  [[nodiscard]] const Truth& truth() const { return truth_; }
  [[nodiscard]] std::shared_ptr<const Cloud> frame(std::uint64_t number) const {
    return frames_[number % frames_.size()];
  }
  /// [m] where a HIP that goes straight down feels the surface first
  [[nodiscard]] Vec3 touched_at(double r_c) const;

 private:
  Truth truth_;
  std::vector<std::shared_ptr<const Cloud>> frames_;
};

/// One loop of the Z-width: who, with what, by which way.
struct ZLoop {
  const ZScene* scene;
  const ZHolding* holding;
  std::string method;
  double damping;  ///< [N s/m] k_d
  bool chain;      ///< through the safety chain
};

/// What is left of a poke.
struct ZTrial {
  double speed_before;  ///< [m/s] rms of the handle, a second after the poke
  double speed;         ///< [m/s] the same at the end
  double force;         ///< [N] mean magnitude at the end
  bool cut;             ///< the safety chain softened the surface
  [[nodiscard]] bool decays() const;
};
/// A press, a poke and what comes after, at one stiffness [N/m].
ZTrial poke(const ZLoop& loop, const Parameters& parameters, double stiffness);

/// The largest stiffness [N/m] up to which the loop decays, by bisection to 3 %, from 100 N/m to
/// `stiffest`; 0 where the softest does not.
double largest_stiffness(const ZLoop& loop, const Parameters& parameters);
constexpr double stiffest = 8000.0;  ///< [N/m] tried

}  // namespace palpate::lab
