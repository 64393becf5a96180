// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

using Vec2 = Eigen::Vector2d;
using Vec6 = Eigen::Matrix<double, 6, 1>;

constexpr double squared(double x) noexcept { return x * x; }

/// Axes fixed in the world in which a piece of surface is a height z over the plane (x, y).
struct LocalFrame {
  Vec3 origin = Vec3::Zero();  ///< [m] world
  Vec3 x = Vec3::UnitX();      ///< [-] unit
  Vec3 y = Vec3::UnitY();      ///< [-] unit
  Vec3 up = Vec3::UnitZ();     ///< [-] unit, towards the side that the proxy is on

  /// Axes about `up`, which must be a unit vector.
  static LocalFrame about(const Vec3& origin, const Vec3& up) noexcept;

  [[nodiscard]] Vec3 local_from_world(const Vec3& p) const noexcept {
    const Vec3 d = p - origin;
    return {d.dot(x), d.dot(y), d.dot(up)};
  }
  [[nodiscard]] Vec3 world_from_local(const Vec3& p) const noexcept {
    return origin + p.x() * x + p.y() * y + p.z() * up;
  }
  [[nodiscard]] Vec3 direction_in_world(const Vec3& d) const noexcept {
    return d.x() * x + d.y() * y + d.z() * up;
  }
};

/// The basis 1, x, y, x^2, xy, y^2 at a place [m].
inline Vec6 quadric_basis(const Vec2& at) noexcept {
  Vec6 basis;
  basis << 1.0, at.x(), at.y(), at.x() * at.x(), at.x() * at.y(), at.y() * at.y();
  return basis;
}

/// A surface z = c . (1, x, y, x^2, xy, y^2) [m] in a LocalFrame.
struct Quadric {
  Vec6 c = Vec6::Zero();

  [[nodiscard]] double height(const Vec2& at) const noexcept { return c.dot(quadric_basis(at)); }
  [[nodiscard]] Vec2 gradient(const Vec2& at) const noexcept {
    return {c[1] + 2.0 * c[3] * at.x() + c[4] * at.y(), c[2] + c[4] * at.x() + 2.0 * c[5] * at.y()};
  }
  /// [-] unit, upwards.
  [[nodiscard]] Vec3 normal(const Vec2& at) const noexcept {
    const Vec2 g = gradient(at);
    return Vec3(-g.x(), -g.y(), 1.0).normalized();
  }
  /// The largest second derivative in any direction [1/m]: how it curves up towards what is above.
  [[nodiscard]] double strongest_rise() const noexcept {
    return c[3] + c[5] + math::hypot(c[3] - c[5], c[4]);
  }
  /// The same downwards: how it bulges.
  [[nodiscard]] double strongest_fall() const noexcept {
    return math::hypot(c[3] - c[5], c[4]) - c[3] - c[5];
  }
  /// Where the surface is nearest to `point` [m, local], by Newton's method from `start`, no
  /// farther than `reach` [m] from `centre`.
  [[nodiscard]] Vec2 nearest(const Vec3& point, const Vec2& start, const Vec2& centre,
                             double reach) const noexcept;
};

/// A Quadric in floats, for places within some centimetres of the origin.
struct FloatQuadric {
  explicit FloatQuadric(const Quadric& surface) noexcept : c(surface.c.cast<float>()) {}
  [[nodiscard]] float height(float x, float y) const noexcept {
    return c[0] + x * (c[1] + c[3] * x + c[4] * y) + y * (c[2] + c[5] * y);
  }
  Eigen::Matrix<float, 6, 1> c;
};

/// A patch's points in a LocalFrame [m]: converted once, read by several loops. At most `capacity`
/// of them. NaN where a point is no number.
struct LocalPoints {
  static constexpr std::size_t capacity = 2048;

  std::size_t size = 0;
  alignas(64) std::array<float, capacity> x, y, z;

  void take(const Patch& patch, const LocalFrame& frame) noexcept;
};

/// The k-th smallest of `values`, k from 0: what std::nth_element finds, without its branches.
/// Looks at 512 of them at most; all finite.
float kth_smallest(std::span<const float> values, std::size_t k) noexcept;

/// The standard deviation of values about `centre`, by the deviations that 50 and 70 % of them do
/// not exceed: of quantised depth half may well be equal. Leaves their deviations in `values`.
template <class Real>
Real deviation_about(float centre, std::span<float> values) noexcept {
  constexpr auto median =
      static_cast<Real>(1.4826);  // [-] standard deviations over each, of a normal distribution
  constexpr auto wider = static_cast<Real>(0.965);
  for (float& each : values) each = std::abs(each - centre);
  return std::max<Real>(median * kth_smallest(values, values.size() / 2),
                        wider * kth_smallest(values, values.size() * 7 / 10));
}

/// What points say about a quadric, all that a least-squares fit needs: sums of weights times
/// monomials x^a y^b, a + b <= 4, and times z x^a y^b, a + b <= 2. They add up, over points and
/// over frames. Lengths in a unit of the caller's, such that all sums are of one magnitude.
struct Moments {
  std::array<double, 15> xy{};  ///< 1, x, y, xx, xy, yy, xxx, ...
  std::array<double, 6> z{};    ///< z, zx, zy, zxx, zxy, zyy

  void add(const Moments& other) noexcept;
  /// Adds `surface` to every point's height. @param unit  [m]
  void raise(const Quadric& surface, double unit) noexcept;
  /// The same sums about another origin, `shift` [units] from this one.
  [[nodiscard]] Moments moved(const Vec3& shift) const noexcept;
  /// A^T A of the fit, and A^T z; in units.
  [[nodiscard]] Eigen::Matrix<double, 6, 6> normal_matrix() const noexcept;
  [[nodiscard]] Vec6 right_side() const noexcept;
};

/// Which points count, and as what, in `disc_moments`.
struct Disc {
  Vec2 centre;          ///< [m] local
  double inner, outer;  ///< [m] points from `inner` to `outer` away from the centre, across
  double cut;           ///< [m] Tukey's weight is 0 for a residual of this and beyond
};

/// Moments of the residuals of a patch's points over `surface`, Tukey-weighted. O(points).
/// @param unit    [m] of the moments
/// @param weight  [-] of each of the patch's points, and of those that fill its last block; null: 1
Moments disc_moments(const Patch& patch, const LocalFrame& frame, const Quadric& surface,
                     const Disc& disc, double unit, const float* weight = nullptr) noexcept;

/// Quadric from moments with every frame's height free or not, in metres.
/// @param curvature_prior  added to the diagonal of the curvature terms: how many points' worth of
///                         evidence says that a surface is flat [1/unit^4]
/// @param unit  [m] of the moments
Quadric fit_quadric(const Moments& moments, double curvature_prior, double unit) noexcept;

}  // namespace palpate
