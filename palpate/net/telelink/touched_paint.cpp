// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/telelink/touched_paint.hpp"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"

namespace palpate {
namespace {

constexpr std::string_view prefix = "touched ";
// Few materials are enough: the next one is as good within what a touch tells.
constexpr double step = 1.15;          // [-] of stiffness
constexpr double friction_step = 0.1;  // [-]

double rounded(double stiffness) {
  return std::round(std::pow(step, std::round(std::log(stiffness) / std::log(step))));
}

}  // namespace

std::string paint_touched(Paint& paint, const Parameters& parameters, const Touched& touched) {
  if (const std::string_view why = disbelief(touched); !why.empty()) return std::string(why);
  bool painted = false;
  for (const Dab& dab : paint.dabs()) {
    if ((dab.place - touched.place).norm() > std::max(dab.radius, touched_radius)) continue;
    painted = painted || !dab.material.starts_with(prefix);
  }
  if (painted) return "ignored: a user has painted there";

  Material material = material_of(parameters);
  std::string name(prefix);
  const double rendered = std::min(material.stiffness, parameters.coupling.stiffness);
  const bool soft = touched.stiffness && *touched.stiffness < rendered;
  if (soft) {
    material.stiffness = rounded(*touched.stiffness);
    name += shortest(material.stiffness) + " N/m";
  }
  if (touched.friction) {
    material.friction = friction_step * std::round(*touched.friction / friction_step);
    name += (soft ? ", friction " : "friction ") + shortest(material.friction);
  }
  // Newer touches count more; one that slid says nothing of how soft it is.
  if (touched.stiffness) paint.erase(touched.place, touched_radius);
  if (!soft && !touched.friction) return "ignored: it is not softer than the rendered stiffness";
  try {
    paint.define({.name = name, .material = material});
    paint.add({.place = touched.place,
               .radius = touched_radius,
               .normal = touched.normal,
               .material = name});
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

}  // namespace palpate
