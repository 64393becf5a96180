// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/io/sources/virtual_camera.hpp"

namespace palpate {

/// One Gaussian of a splat.
struct Gaussian {
  Eigen::Vector3f mean;   ///< [m]
  Eigen::Vector3f sigma;  ///< [m] along the axes of `turn`
  Eigen::Quaternionf turn;
  float opacity;                                      ///< [-] 0 to 1, at the mean
  std::array<std::uint8_t, 3> colour{128, 128, 128};  ///< red, green, blue
};

/// A splat: depth is where the opacity gathered along a ray passes one half.
///
/// Each Gaussian counts at the place of the ray where its own response is greatest, not at its
/// centre; of those that lie within 3 mm of one another there, up to where 98 % of the light has
/// ended, the mean by their opacity there. It does not count what hides them, or whatever sticks
/// out of a rough surface would be its place. Where they hide less than a quarter, it is fog, which
/// has no depth.
class SplatBody final : public Body {
 public:
  /// Gaussians that are not finite or hide less than 5 % at their centre are left out, and those
  /// that touch fewer than four others: floaters.
  /// @param name  for messages
  /// @throws Error if none is left that hides half.
  SplatBody(std::vector<Gaussian> gaussians, const std::string& name);

  [[nodiscard]] std::size_t size() const { return gaussians_.size(); }
  [[nodiscard]] std::size_t floaters() const { return floaters_; }
  [[nodiscard]] const Box& bounds() const override { return tree_->bounds(); }
  [[nodiscard]] Vec3 nearest(const Vec3& at) const override;
  void draw(const View& view, std::span<float> depth) const override;
  [[nodiscard]] std::vector<DrawnGaussian> gaussians(
      const Eigen::Isometry3d& world_from_body) const override;

 private:
  void build_tree();
  [[nodiscard]] bool touches_others(const Gaussian& g) const;

  std::vector<Gaussian> gaussians_;  // in the order of the tree
  std::optional<BoxTree> tree_;
  std::size_t floaters_ = 0;
};

}  // namespace palpate
