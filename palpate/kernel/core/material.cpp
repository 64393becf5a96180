// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/material.hpp"

#include <algorithm>

namespace palpate {
namespace {

constexpr std::string_view material_noun = "property of a material";

// A row that has unit, range, meaning and source of the session's parameter of the same name.
template <auto... path>
MaterialInfo as_parameter(std::string_view name) {
  const ParameterInfo& p = row_by_name(parameter_table(), name, material_noun);
  return row_of<path...>(p.name, p.symbol, p.unit, p.min, p.max, p.meaning, p.source);
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
  using M = Material;
  static const std::array table{
      row_of<&M::stiffness>("stiffness", "", "N/m", 10.0, 1e5,
                            "stiffness of the surface, limited to the session's stiffness",
                            "ours (feel)"),
      as_parameter<&M::cushion>("cushion"),
      as_parameter<&M::friction>("friction"),
      as_parameter<&M::kinetic_share>("kinetic_share"),
      as_parameter<&M::viscosity>("viscosity"),
      as_parameter<&M::tap, &TapParameters::tap>("tap"),
      as_parameter<&M::tap, &TapParameters::tap_frequency>("tap_frequency"),
      as_parameter<&M::tap, &TapParameters::tap_decay>("tap_decay"),
      as_parameter<&M::texture, &TextureParameters::grain>("grain"),
      as_parameter<&M::texture, &TextureParameters::grain_length>("grain_length"),
      as_parameter<&M::texture, &TextureParameters::relief>("relief")};
  return table;
}

void set_parameter(Material& material, std::string_view name, double value) {
  set_by_name(material_table(), material, name, value, material_noun);
}

void validate(const Material& material) { check_ranges(material_table(), material, material_noun); }

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
