// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// What a surface feels like at a place. All of its numbers can be averaged, so that one material
/// turns into another over a border. docs/materials.md.
struct Material {
  double stiffness = 1e5;  ///< [N/m] of the surface; never more than that of the coupling is felt
  double cushion = 0.0;    ///< [s/m] as ContactParameters::cushion
  double friction = 0.0;   ///< [-] as FrictionParameters::friction, as are the next two
  double kinetic_share = 0.8;
  double viscosity = 0.0;  ///< [s/m]
  TapParameters tap;
  TextureParameters texture;
};

/// That of a whole scene, as its parameters have it.
Material material_of(const Parameters& parameters);

using MaterialInfo = ParameterRow<Material>;

/// All numbers of a material, in the order in which they are shown.
std::span<const MaterialInfo> material_table();

/// Sets one number by name.
/// @throws Error for an unknown name (naming the nearest known one) or a value out of its range.
void set_parameter(Material& material, std::string_view name, double value);
/// @throws Error naming the first number that is out of its range.
void validate(const Material& material);

/// What a cloud knows of its surface about a place: which materials, by how much, and how bright.
struct SurfaceSample {
  struct Share {
    const Material* material;  ///< null: that of the scene
    double weight;             ///< [-] above 0
  };
  /// More kinds than that within a few millimetres are not told apart: the rest is left out.
  static constexpr std::size_t most_shares = 8;

  std::array<Share, most_shares> shares{};
  std::size_t count = 0;
  bool has_slope = false;
  /// [1/m] world: by how much brightness, 0 black to 1 white, grows along the surface
  Vec3 slope = Vec3::Zero();

  void add(const Material* material, double weight) noexcept {
    for (std::size_t i = 0; i < count; ++i) {
      if (shares[i].material != material) continue;
      shares[i].weight += weight;
      return;
    }
    if (count < most_shares) shares[count++] = {material, weight};
  }
};

/// The mean of a sample's materials by their weights; `scene` where it has none. [servo]
/// @param hardest  [N/m] what is harder counts as that: no more is felt
Material blend(const SurfaceSample& sample, const Material& scene, double hardest) noexcept;

}  // namespace palpate
