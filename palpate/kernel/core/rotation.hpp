// SPDX-License-Identifier: Apache-2.0
// Rotations in one order of operations on every processor: Eigen's is that of its vectors.
#pragma once

#include "palpate/kernel/core/hand.hpp"

namespace palpate {

/// Can it be a rotation? It is finite, and of length 1 to within 1 %.
bool is_rotation(const Rotation& q) noexcept;
/// The same, of length 1.
Rotation unit(const Rotation& q) noexcept;
/// The rotation by b, and then by a.
Rotation product(const Rotation& a, const Rotation& b) noexcept;
/// The rotation from b to a.
Rotation between(const Rotation& a, const Rotation& b) noexcept;
/// The rotation vector [rad] of a rotation: its axis times its angle of at most pi.
Vec3 rotation_vector(const Rotation& turn) noexcept;
/// The rotation by a rotation vector [rad].
Rotation rotation_by(const Vec3& vector) noexcept;

}  // namespace palpate
