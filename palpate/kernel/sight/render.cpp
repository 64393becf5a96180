// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/sight/render.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/kernel/core/hand.hpp"

namespace palpate {

// Spreads what a frame corrects: the force goes on as it would have without the frame, then turns
// to what the frame says.
Vec3 ForceRenderer::blend(const Input& input, const Coupling& coupling) noexcept {
  if (due_) {
    Vec3 carried = force_;
    const double push = force_.norm();
    if (push > undirected_force) {
      const Vec3 outwards = force_ / push;
      const double deeper = (*due_ * (input.t - t_) - (input.hip - hip_)).dot(outwards);
      carried += coupling.stiffness * deeper * outwards;
    }
    offset_ = carried - input.force;
    start_ = input.t;
    due_.reset();
  }
  return input.force + ease((input.t - start_) / input.blend) * offset_;
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

// The force falls at once with the knowledge of the surface. It rises as if the surface came back
// to the hand at `return_speed`: a handle that nobody holds moves along with it, and swings about
// that speed by no more than that speed. A force that is ramped up in time throws it. Until the
// surface is back and r_c farther, what frames correct does not make it come faster: only as far as
// hand and surface move in a tick may the hand get deeper or less deep.
Vec3 ForceRenderer::come_back(Vec3 force, const Input& input, double stiffness) noexcept {
  const double push = force.norm();
  const double depth = push / stiffness;
  const double elapsed = std::max(input.t - t_, 0.0);
  const Vec3 moved = input.hip - hip_;
  const double out = push > 0.0 ? moved.dot(force) / push : 0.0;
  const double aside =
      std::sqrt(std::max(moved.squaredNorm() - out * out, 0.0)) + elapsed * input.velocity.norm();
  const double pressed = std::exchange(pressed_, input.force.norm() / stiffness);
  const double deeper =
      std::clamp(pressed_ - pressed, -aside - std::max(out, 0.0), aside + std::max(-out, 0.0));
  const double back = input.return_speed * elapsed;
  felt_ = std::max(felt_ + back + deeper, 0.0);
  if (input.returned && push > 0.0)
    felt_ = std::min(felt_, std::max(rendered_.dot(force), 0.0) / (push * stiffness));
  if (input.known < 1.0)
    felt_ = std::min(felt_, input.known * depth);
  else if (felt_ >= depth + input.r_c)
    felt_ = fully;
  if (felt_ < depth) force *= felt_ / depth;
  return force;
}

Vec3 ForceRenderer::render(const Input& input, const Coupling& coupling) noexcept {
  const double stiffness = std::max(coupling.stiffness, 1e-9);
  Vec3 force = left_behind(blend(input, coupling), input, stiffness);
  if (const double length = force.norm(); length > coupling.max_force)
    force *= (1.0 - 1e-15) * coupling.max_force / length;  // after rounding, too
  force_ = force;
  rendered_ = force = come_back(force, input, stiffness);
  hip_ = input.hip;
  t_ = input.t;
  return force;
}

}  // namespace palpate
