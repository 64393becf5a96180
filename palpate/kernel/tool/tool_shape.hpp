// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/hand.hpp"

namespace palpate {

/// A closed surface of triangles.
struct Triangles {
  std::vector<Vec3> points;                             ///< [m]
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< counter-clockwise from outside
};

/// A tool's surface as a shell of points in the tool's frame: x along its longest side, z along its
/// thickness, the origin at the hand. Immutable.
///
/// Points are in order from coarse to fine: the first n of them lie as evenly as n points can, so
/// any beginning of the list is a level of its own. Each point belongs to one of a few *patches*,
/// the neighbourhoods of the first points: of each patch a method keeps one contact. docs/tools.md.
class ToolShape {
 public:
  static constexpr std::size_t most_points = 10'000;
  static constexpr std::size_t usual_points = 2'000;
  static constexpr std::size_t most_patches = 64;
  static constexpr double usual_turning = 20.0;
  struct Point {
    Vec3 at;              ///< [m]
    Vec3 inward;          ///< [-] unit normal
    std::uint32_t patch;  ///< below most_patches
  };

  /// Samples a surface with at most `count` points: its corners and edges first. O(count^2).
  /// @param text  the specification, as in `text()`
  /// @param turning  as in `turn_length`
  /// @param margin  [m] by which the points lie outside of the surface
  /// @throws Error if the surface has no area, or count is not in 4..most_points
  ToolShape(const Triangles& surface, std::size_t count, std::string text,
            double turning = usual_turning, double margin = 0.0);
  /// The same from points as `points()` gave them; their patches are found again.
  /// @throws Error if there are none or too many, or a number is not finite
  ToolShape(std::vector<Point> points, std::string text, double turning);

  /// The same tool, held in the hand by another side.
  [[nodiscard]] ToolShape turned(const Rotation& turn) const;

  [[nodiscard]] const std::vector<Point>& points() const noexcept { return points_; }
  /// What was sampled, for drawing; empty if it was made from points.
  [[nodiscard]] const Triangles& surface() const noexcept { return surface_; }
  /// [m] The farthest point's distance from the origin.
  [[nodiscard]] double reach() const noexcept { return reach_; }
  /// [-] Stiffness of the coupling in rotation, over k_s times the square of the reach.
  [[nodiscard]] double turning() const noexcept { return turning_; }
  /// [m] The length that a rotation is worth in equation (2): its stiffness is k_s times the
  /// square.
  [[nodiscard]] double turn_length() const noexcept { return turn_length_; }
  /// [m] Between a point and its nearest neighbour, at least.
  [[nodiscard]] double spacing() const noexcept { return spacing_; }
  /// What it was made from, such as `box:40x20x5mm`.
  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  void finish();

  std::vector<Point> points_;
  Triangles surface_ = {};
  double reach_ = 0.0, spacing_ = 0.0, turn_length_ = 0.0;
  std::string text_;
  double turning_;
};

/// Reads a mesh's file, in the unit of its numbers. @throws Error if it is no closed mesh.
using MeshReader = std::function<Triangles(const std::string& file)>;

/// A tool from its specification; null for `ball`, which the library's other methods touch with.
///
///     ball                      a ball, whose radius is the parameter r_c
///     box:AxBxCmm               sides in any order: the longest along x, the shortest along z
///     capsule:LENGTHxDIAMETERmm along x, the round ends included; cylinder: the same
///     cone:LENGTHxDIAMETERmm    along x, the point at +x
///     gripper:LENGTHxOPENINGxTHICKNESSmm   two square fingers along x, OPENING apart along y
///     mesh:FILE?unit=mm         a closed mesh; unit m, cm, mm or in; origin=centre (of its box),
///                               the default, or origin=file
///
/// Lengths have one unit behind the last: mm, cm or m. All take the options
/// points=N, turning=X of 0.01 to 1000 (see ToolShape::turning), and margin=M [m]: it touches with
/// a surface that lies so far outside of its own; and how the hand holds it: first turned by roll,
/// pitch and yaw [rad] about x, y and z of the hand, then moved by x, y and z [m].
/// @throws Error saying what was wrong
std::shared_ptr<const ToolShape> make_tool(std::string_view text, const MeshReader& read);

}  // namespace palpate
