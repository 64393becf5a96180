// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "palpate/kernel/sight/surface_fit.hpp"

namespace palpate {

/// Does a quadric describe the points about a contact? Means of their residuals in 16 cells: relief
/// stays from frame to frame, noise does not. docs/sight.md, 5.
///
/// The cells are those of a lattice that stays while the contact slides, so that frames can be
/// compared cell by cell. The noise that was learned stays when a contact ends.
///
/// [servo] Nothing here allocates, locks or throws.
class FitTest {
 public:
  /// Another surface begins.
  void forget() noexcept;
  /// A frame's points.
  struct Look {
    Vec2 foot;              ///< [m] local: of the contact
    double cell;            ///< [m] side of a cell
    double gate;            ///< [m] points farther from the surface are not its own
    bool is_whole = true;   ///< nothing hides a part of it
    bool new_frame = true;  ///< not the newest frame again
  };
  void take(const LocalPoints& points, const Quadric& surface, const Look& look) noexcept;
  /// Up to noise, by the frames so far about one place.
  /// @param so_far  what was the answer until now; it changes only on stronger evidence
  [[nodiscard]] bool judge(bool so_far) noexcept;
  /// The local origin has moved by `step` [cells] and `up` [m].
  void move_origin(const Eigen::Vector2i& step, double up) noexcept;

 private:
  static constexpr int side = 4;  // [cells]
  static constexpr std::size_t cells = std::size_t{side} * side;
  static constexpr std::size_t most_frames = 8;

  struct Frame {
    bool full = false;  // nearly all cells have points, and nothing hid any
    Eigen::Vector2i first = Eigen::Vector2i::Zero();  // of the lattice's cells
    std::array<double, cells> heights{};              // [m] of the cells' middles
    std::array<bool, cells> has_points{};
  };
  void learn_noise(const Frame& newest, const Frame& past) noexcept;

  std::array<Frame, most_frames> frames_;
  std::size_t newest_ = 0;
  double variance_ = 0.0;  // [m^2] of a cell's mean from frame to frame
  double samples_ = 0.0;
};

}  // namespace palpate
