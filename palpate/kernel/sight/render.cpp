// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/render.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/kernel/core/hand.hpp"

namespace palpate {

// Has what the coupling says changed in a tick by more than hand and surface moved, and than the
// normal turns where the proxy rolls over an edge?
bool ForceRenderer::jumps(const Input& input, const Vec3& moved, double stiffness) const noexcept {
  constexpr double least_jump = 0.05;  // [r_c] times the stiffness
  const double way = moved.norm();
  return (input.force - coupled_).norm() > stiffness * (way + least_jump * input.r_c) +
                                               coupled_.norm() * std::min(way / input.r_c, 1.0);
}

// Spreads what a frame corrects, and what jumps between frames: the force goes on as it would have
// without that, then turns to `target`, which is what is felt of the coupling's force.
Vec3 ForceRenderer::blend(const Input& input, const Vec3& target, double stiffness) noexcept {
  const Vec3 moved = due_.value_or(input.velocity) * (input.t - t_) - (input.hip - hip_);
  if (due_ || (!ends_ && jumps(input, moved, stiffness))) {
    Vec3 carried = force_;
    const double push = force_.norm();
    if (push > undirected_force) {
      const Vec3 outwards = force_ / push;
      carried += stiffness * moved.dot(outwards) * outwards;
    }
    offset_ = carried - target;
    start_ = input.t;
    due_.reset();
  }
  ends_ = false;
  coupled_ = input.force;
  return target + ease((input.t - start_) / input.blend) * offset_;
}

// The rest of an old force may push on, but nothing pulls, nor in free motion after it. Nor does it
// follow a hand that leaves: what is left of it ends like a spring's push.
Vec3 ForceRenderer::left_behind(Vec3 force, const Input& input, double stiffness) noexcept {
  if (input.normal) left_along_ = *input.normal;
  if (!input.force.isZero()) left_at_ = input.hip;
  const double pull = force.dot(left_along_);
  if (pull < 0.0) force -= pull * left_along_;
  if (const double gap = (input.hip - left_at_).dot(left_along_); gap > 0.0) {
    const double rest = force.norm();
    if (rest > 0.0) force *= std::max(rest - stiffness * gap, 0.0) / rest;
  }
  return force;
}

// What is felt of the coupling's force falls at once with the knowledge of the surface. It rises as
// if the surface came back to the hand at `return_speed`: a handle that nobody holds moves along
// with it, and swings about that speed by no more than that speed. A force that is ramped up in
// time throws it. Until the surface is back and r_c farther, what frames correct does not make it
// come faster: only as far as hand and surface move in a tick may the hand get deeper or less deep.
Vec3 ForceRenderer::come_back(const Input& input, double stiffness) noexcept {
  const double push = input.force.norm();
  const double depth = push / stiffness;
  const Vec3 outwards = push > 0.0 ? Vec3(input.force / push) : Vec3(Vec3::Zero());
  const double elapsed = std::max(input.t - t_, 0.0);
  const Vec3 moved = input.hip - hip_;
  const double out = moved.dot(outwards);
  const double aside =
      std::sqrt(std::max(moved.squaredNorm() - out * out, 0.0)) + elapsed * input.velocity.norm();
  const double deeper = std::clamp(depth - std::exchange(pressed_, depth),
                                   -aside - std::max(out, 0.0), aside + std::max(-out, 0.0));
  felt_ = std::max(felt_ + input.return_speed * elapsed + deeper, 0.0);
  if (input.returned && push > 0.0)
    felt_ = std::min(felt_, std::max(force_.dot(outwards), 0.0) / stiffness);
  if (input.known < 1.0)
    felt_ = std::min(felt_, input.known * depth);
  else if (felt_ >= depth + input.r_c)
    felt_ = fully;
  return felt_ < depth ? Vec3(felt_ / depth * input.force) : input.force;
}

Vec3 ForceRenderer::render(const Input& input, const Coupling& coupling) noexcept {
  const double stiffness = std::max(coupling.stiffness, 1e-9);
  force_ = left_behind(blend(input, come_back(input, stiffness), stiffness), input, stiffness);
  if (const double length = force_.norm(); length > coupling.max_force)
    force_ *= (1.0 - 1e-15) * coupling.max_force / length;  // after rounding, too
  hip_ = input.hip;
  t_ = input.t;
  return force_;
}

}  // namespace palpate
