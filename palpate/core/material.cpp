// SPDX-License-Identifier: Apache-2.0
#include "palpate/core/material.hpp"

#include <algorithm>

namespace palpate {
namespace {

constexpr std::string_view material_noun = "property of a material";

// A row that has unit, range, meaning and source of the session's parameter of the same name.
template <double& (*member)(Material&)>
MaterialInfo as_parameter(std::string_view name) {
  const ParameterInfo& p = row_by_name(parameter_table(), name, material_noun);
  return {p.name,
          p.symbol,
          p.unit,
          p.default_value,
          p.min,
          p.max,
          p.meaning,
          p.source,
          [](const Material& m) {
            Material copy = m;
            return member(copy);
          },
          [](Material& m, double v) { member(m) = v; }};
}

double& cushion_of(Material& m) {
  return m.cushion;
}
double& friction_of(Material& m) {
  return m.friction;
}
double& kinetic_share_of(Material& m) {
  return m.kinetic_share;
}
double& viscosity_of(Material& m) {
  return m.viscosity;
}
double& tap_of(Material& m) {
  return m.tap.tap;
}
double& tap_frequency_of(Material& m) {
  return m.tap.tap_frequency;
}
double& tap_decay_of(Material& m) {
  return m.tap.tap_decay;
}
double& grain_of(Material& m) {
  return m.texture.grain;
}
double& grain_length_of(Material& m) {
  return m.texture.grain_length;
}
double& relief_of(Material& m) {
  return m.texture.relief;
}

}  // namespace

Material material_of(const Parameters& p) {
  Material material;
  material.cushion = p.contact.cushion;
  material.friction = p.friction.friction;
  material.kinetic_share = p.friction.kinetic_share;
  material.viscosity = p.friction.viscosity;
  material.tap = p.tap;
  material.texture = p.texture;
  return material;
}

std::span<const MaterialInfo> material_table() {
  static const std::array table{
      MaterialInfo{"stiffness", "", "N/m", 1e5, 10.0, 1e5,
                   "stiffness of the surface, limited to the session's stiffness", "ours (feel)",
                   [](const Material& m) { return m.stiffness; },
                   [](Material& m, double v) { m.stiffness = v; }},
      as_parameter<cushion_of>("cushion"),
      as_parameter<friction_of>("friction"),
      as_parameter<kinetic_share_of>("kinetic_share"),
      as_parameter<viscosity_of>("viscosity"),
      as_parameter<tap_of>("tap"),
      as_parameter<tap_frequency_of>("tap_frequency"),
      as_parameter<tap_decay_of>("tap_decay"),
      as_parameter<grain_of>("grain"),
      as_parameter<grain_length_of>("grain_length"),
      as_parameter<relief_of>("relief")};
  return table;
}

void set_parameter(Material& material, std::string_view name, double value) {
  set_by_name(material_table(), material, name, value, material_noun);
}

void validate(const Material& material) {
  check_ranges(material_table(), material, material_noun);
}

Material blend(const SurfaceSample& sample, const Material& scene, double hardest) noexcept {
  if (sample.count == 0) return scene;
  if (sample.count == 1)
    return sample.shares[0].material == nullptr ? scene : *sample.shares[0].material;
  double total = 0.0;
  for (std::size_t i = 0; i < sample.count; ++i) total += sample.shares[i].weight;
  Material sum{.stiffness = 0.0,
               .kinetic_share = 0.0,
               .tap = {.tap = 0.0, .tap_frequency = 0.0, .tap_decay = 0.0},
               .texture = {.grain = 0.0, .grain_length = 0.0, .relief = 0.0}};
  for (std::size_t i = 0; i < sample.count; ++i) {
    const Material& m = sample.shares[i].material == nullptr ? scene : *sample.shares[i].material;
    const double share = sample.shares[i].weight / total;
    sum.stiffness += share * std::min(m.stiffness, hardest);
    sum.cushion += share * m.cushion;
    sum.friction += share * m.friction;
    sum.kinetic_share += share * m.kinetic_share;
    sum.viscosity += share * m.viscosity;
    sum.tap.tap += share * m.tap.tap;
    sum.tap.tap_frequency += share * m.tap.tap_frequency;
    sum.tap.tap_decay += share * m.tap.tap_decay;
    sum.texture.grain += share * m.texture.grain;
    sum.texture.grain_length += share * m.texture.grain_length;
    sum.texture.relief += share * m.texture.relief;
  }
  return sum;
}

}  // namespace palpate
