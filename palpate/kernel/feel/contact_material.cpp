// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/feel/contact_material.hpp"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// [m] that the foot moves before it is looked up again what is there: 1/30 of what is averaged.
constexpr double same_place = 1e-4;
// [-] A cushion takes away no more than all of the force, and adds no more than as much again.
constexpr double hardest_cushion = 2.0;
// [-] of the normal force that a grain's vibration is at most.
constexpr double roughest = 0.5;
// [-] slope of a relief, 27 degrees: steeper, a hand would be stuck in it.
constexpr double steepest = 0.5;

}  // namespace

bool has_feel(const Material& m, double stiffness) noexcept {
  return m.friction > 0.0 || m.viscosity > 0.0 || m.cushion > 0.0 || m.tap.tap > 0.0 ||
         m.texture.grain > 0.0 || m.texture.relief != 0.0 || m.stiffness < stiffness;
}

void ContactMaterial::look(const ObservedClouds& clouds, const Material& scene, double stiffness,
                           const Vec3& foot, const Vec3& normal) noexcept {
  if (looked_ && (foot - looked_at_).squaredNorm() < same_place * same_place) return;
  looked_ = true;
  looked_at_ = foot;
  material = scene;
  slope = Vec3::Zero();
  if (clouds.parts().empty() || normal.isZero() ||
      !(clouds.has_materials() || scene.texture.relief != 0.0))
    return;
  SurfaceSample sample;
  clouds.sample(foot, normal, averaged, sample);
  material = blend(sample, scene, stiffness);
  if (sample.has_slope) slope = sample.slope;
}

double ContactMaterial::cushion(double away) const noexcept {
  return std::clamp(1.0 - material.cushion * away, 0.0, hardest_cushion);
}

Vec3 ContactMaterial::downhill(const Vec3& normal) const noexcept {
  if (material.texture.relief == 0.0) return Vec3::Zero();
  Vec3 rise = material.texture.relief * (slope - slope.dot(normal) * normal);
  if (const double steep = rise.norm(); steep > steepest) rise *= steepest / steep;
  return Vec3::Zero() - rise;
}

double ContactMaterial::vibration(double noise) const noexcept {
  return std::clamp(material.texture.grain * noise, -roughest, roughest);
}

double share_within(double limit, const Vec3& force, const Vec3& more) noexcept {
  const double room = limit * limit - force.squaredNorm();
  const double along = force.dot(more);
  const double size = more.squaredNorm();
  if (!(size > 0.0)) return 0.0;
  // The largest share s of `more` with |force + s more| <= limit.
  const double share = room > 0.0 ? (-along + std::sqrt(along * along + size * room)) / size : 0.0;
  return std::min(share, 1.0);
}

}  // namespace palpate
