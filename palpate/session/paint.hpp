// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"

namespace palpate {

/// A dab of a brush: the visible surface within `radius` of a place is of a material.
struct Dab {
  Vec3 place = Vec3::Zero();   ///< [m] world, on a surface
  double radius = 0.01;        ///< [m] across the line of sight
  Vec3 normal = Vec3::Zero();  ///< [-] away from the surface, for drawing it
  std::string material = {};   ///< of the camera's materials or of the standard ones
};

/// Materials that somebody paints on what cameras see, while touching it.
///
/// A dab stays on its surface: with each frame of the first camera it goes to where its pixels are
/// seen along their lines of sight, up to `followed` a frame. What moves sideways leaves it behind.
/// Any thread.
class Paint {
 public:
  static constexpr std::size_t most = 500;  ///< dabs
  static constexpr double smallest = 1e-3;  ///< [m] radius
  static constexpr double largest = 0.1;    ///< [m] radius
  static constexpr double followed = 0.04;  ///< [m] that a surface moves from frame to frame

  /// Makes a material that dabs can have beside the camera's and the standard ones, by its name.
  /// One of that name that is there already stays.
  /// @throws Error if it does not validate, or there are as many as a table can have.
  void define(const NamedMaterial& material);
  /// A dab on another one, nearer than a third of its radius and as large, takes its place.
  /// @throws Error for a place or radius that cannot be, an unknown material, or one too many.
  void add(const Dab& dab);
  /// Takes away the dabs that are within `radius` of a place.
  void erase(const Vec3& place, double radius);
  void clear();
  [[nodiscard]] std::vector<Dab> dabs() const;

  /// A camera's frame with the paint on it; the same if there is none, or it is no depth image.
  /// The dabs move on with the frames of camera 0.
  [[nodiscard]] std::shared_ptr<const Cloud> on(const std::shared_ptr<const Cloud>& cloud,
                                                std::size_t camera);
  /// The names that dabs can have before a frame: those of its table and the standard ones.
  [[nodiscard]] static std::vector<std::string> names(const Cloud& cloud);

 private:
  mutable std::mutex mutex_;
  std::vector<Dab> dabs_;                              // guarded by mutex_, as is the table
  std::shared_ptr<const MaterialTable> base_, table_;  // the camera's, and the same with all others
  std::vector<NamedMaterial> defined_;
};

}  // namespace palpate
