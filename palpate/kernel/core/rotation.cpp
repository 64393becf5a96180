// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/rotation.hpp"

#include <algorithm>
#include <cmath>

#include "palpate/kernel/core/mathematics.hpp"

namespace palpate {

bool is_rotation(const Rotation& q) noexcept {
  constexpr double digits = 0.01;            // [-] of the length, where somebody wrote few
  return std::abs(q.norm() - 1.0) < digits;  // false if it is no number
}

Rotation unit(const Rotation& q) noexcept {
  const double length = std::sqrt(q.x() * q.x() + q.y() * q.y() + q.z() * q.z() + q.w() * q.w());
  return {q.w() / length, q.x() / length, q.y() / length, q.z() / length};
}

Rotation product(const Rotation& a, const Rotation& b) noexcept {
  return {a.w() * b.w() - a.x() * b.x() - a.y() * b.y() - a.z() * b.z(),
          a.w() * b.x() + a.x() * b.w() + a.y() * b.z() - a.z() * b.y(),
          a.w() * b.y() + a.y() * b.w() + a.z() * b.x() - a.x() * b.z(),
          a.w() * b.z() + a.z() * b.w() + a.x() * b.y() - a.y() * b.x()};
}

Rotation between(const Rotation& a, const Rotation& b) noexcept {
  return product(a, Rotation(b.w(), -b.x(), -b.y(), -b.z()));
}

Vec3 rotation_vector(const Rotation& turn) noexcept {
  const double sign = turn.w() < 0.0 ? -1.0 : 1.0;
  const Vec3 v = sign * turn.vec();
  const double sine = v.norm();
  if (sine < 1e-9) return 2.0 * v;
  // Half the angle from its sine and cosine: that of the smaller is exact.
  const double w = std::min(sign * turn.w(), 1.0);
  const double half = math::acos(w);
  if (sine > 0.1) return 2.0 * half / sine * v;
  const double s2 = sine * sine;  // arcsin by its series, as cosines near 1 say little
  return 2.0 * (1.0 + s2 * (1.0 / 6 + s2 * (3.0 / 40 + s2 * (15.0 / 336)))) * v;
}

Rotation rotation_by(const Vec3& vector) noexcept {
  const double angle = vector.norm();
  const double half = 0.5 * angle;
  const double share = angle > 1e-9 ? math::sin(half) / angle : 0.5;
  return unit({math::cos(half), share * vector.x(), share * vector.y(), share * vector.z()});
}

}  // namespace palpate
