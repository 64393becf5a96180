// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "palpate/io/sources/virtual_camera.hpp"

namespace palpate {

/// Triangles, closed or not, seen from both sides. Of any number: depth is drawn of those alone
/// that are in sight, found by a tree of boxes.
class MeshBody final : public Body {
 public:
  /// Triangles with a corner that is not finite are left out.
  /// @param points  [m]
  /// @param name    for messages
  /// @throws Error if no triangle is left, or an index is out of range.
  MeshBody(const std::vector<Vec3>& points,
           const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::string& name);

  [[nodiscard]] const Box& bounds() const override { return tree_->bounds(); }
  [[nodiscard]] Vec3 nearest(const Vec3& at) const override;
  void draw(const View& view, std::span<float> depth) const override;

 private:
  using Corners = std::array<Eigen::Vector3f, 3>;
  std::vector<Corners> triangles_;  // in the order of the tree
  std::optional<BoxTree> tree_;
};

}  // namespace palpate
