// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "palpate/kernel/sight/surface_fit.hpp"

namespace palpate {

/// Does a quadric describe the surface about a contact, up to noise? Structure stays from frame to
/// frame, noise does not: compares means over the cells of a square. docs/sight.md, 5.
///
/// [servo] Nothing here allocates, locks or throws.
class FitTest {
 public:
  /// [m] of a cell's side.
  void set_cell_size(double size) noexcept { cell_size_ = size; }
  [[nodiscard]] double cell_size() const noexcept { return cell_size_; }
  /// Frames so far are another surface's. The noise that was learned is kept.
  void forget() noexcept {
    for (Cells& past : cells_) past.full = false;
  }
  /// Takes the means of a frame's points about `foot` [m, local], those within `gate` [m] of
  /// `surface`.
  /// @param partial    something hides a part of it
  /// @param new_frame  false: the newest frame's again, about another place
  void look(const LocalPoints& points, const Quadric& surface, const Vec2& foot, double gate,
            bool partial, bool new_frame) noexcept;
  /// Does `surface` describe the newest frame? Learns the noise of cells.
  /// @param detail  [m] in multiples of which lengths are given
  /// @param stays   it did before: then less is asked, so that the way to rest does not change from
  ///                frame to frame
  bool describes(const Quadric& surface, double detail, bool stays) noexcept;
  /// The local origin moves by `step` cells, to `shift` [m, local].
  void move_origin(const Eigen::Vector2i& step, const Vec3& shift) noexcept;

 private:
  static constexpr int cells_per_side = 4;
  static constexpr std::size_t cells = cells_per_side * cells_per_side;
  static constexpr std::size_t frames_looked_at = 8;
  using Residuals = std::array<double, cells>;

  /// Means over the points in each cell of a square about a frame's contact. Cells are those of a
  /// lattice through the local origin, so that frames can be compared while the contact slides.
  struct Cells {
    Cells() noexcept {
      heights.fill(0.0);
      means.fill(Vec6::Zero());
    }

    bool full = false;  // nearly all cells have points, and no occluder hid any
    Eigen::Vector2i first = Eigen::Vector2i::Zero();  // of the lattice's cells
    std::array<double, cells> heights;                // [m]
    std::array<Vec6, cells> means;                    // of quadric_basis
  };

  static Residuals residuals_of(const Cells& frame, const Quadric& surface) noexcept;
  static double squared_structure(const Cells& frame, const Residuals& residuals,
                                  double detail) noexcept;
  void learn_noise(const Cells& newest, const Residuals& residuals, const Cells& past,
                   const Residuals& older) noexcept;

  std::array<Cells, frames_looked_at> cells_;
  std::size_t newest_ = 0;
  double cell_size_ = 0.0;
  double variance_ = 0.0;  // [m^2] of a cell's mean from frame to frame
  double samples_ = 0.0;   // of that
};

}  // namespace palpate
