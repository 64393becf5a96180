// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "palpate/kernel/core/cloud.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate {

/// How far the proxy is behind what was measured [m], by the camera that sees it least so; none if
/// no camera with a depth image shows the place.
std::optional<double> least_behind(std::span<const std::shared_ptr<const Cloud>> cameras,
                                   const Vec3& proxy, double r_c);

/// What a session amounted to, counted tick by tick.
class Summary {
 public:
  /// Counts a cycle of a session.
  /// @param behind  as `least_behind`, or none where it was not looked at
  void count(const ServoTick& record, const std::optional<double>& behind, double r_c);
  /// Counts a tick without device and safety chain: what is asked for is sent.
  void count(const Tick& tick, const std::optional<double>& behind, double r_c);

  std::size_t ticks = 0;
  std::size_t contact_ticks = 0;
  std::size_t steps = 0;  ///< of the proxy
  std::size_t frames = 0;
  std::size_t late_ticks = 0;    ///< of a real-time loop; set by whoever knows its timing
  double largest_asked = 0.0;    ///< [N] what the method asked for
  double largest_sent = 0.0;     ///< [N] what the device got, behind the safety chain
  ServoEnergy energy;            ///< as of the last tick
  double worst_relative = 0.0;   ///< [J] that a contact made, relative to the surface
  double worst_absolute = 0.0;   ///< [J] that a contact made, with the surface's own motion
  std::size_t force_ticks = 0;   ///< in which any force was sent
  Vec3 sum_sent = Vec3::Zero();  ///< [N, world] of the forces sent, tick by tick
  std::size_t pop_throughs = 0;  ///< suspected, see below
  double first_t = 0.0;          ///< [s]
  double last_t = 0.0;           ///< [s]
  std::array<std::uint64_t, tick_flag_count> flag_ticks{};      ///< with each TickFlag
  std::array<std::uint64_t, safety_flag_count> safety_ticks{};  ///< with each SafetyFlag

  [[nodiscard]] double duration() const { return last_t - first_t; }  ///< [s]

 private:
  void count_tick(const Tick& tick, const Vec3& sent, const std::optional<double>& behind,
                  double r_c);

  // Pop-throughs: the proxy was in front, and is then more than its own radius behind what every
  // camera that sees it measured, for longer than one frame.
  bool was_in_front_ = false;
  std::int64_t behind_since_frame_ = -1;
};

}  // namespace palpate
