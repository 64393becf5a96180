// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "palpate/kernel/core/cloud.hpp"

namespace palpate {

/// What one camera saw: one image, given once, with the time at which it was captured.
struct Observation {
  const Cloud& cloud;      ///< lives until the next observation of this camera has been taken in
  double stamp;            ///< [s] of capture
  std::size_t camera = 0;  ///< its number in the session, below Patch::max_views
};

/// The newest cloud of each camera, touched as one: for methods that remember no older ones. Holds
/// pointers alone, so clouds must live as long as Observation says.
///
/// [servo] Nothing here allocates, locks or throws.
class ObservedClouds : public Cloud {
 public:
  /// Replaces what that camera saw before. A camera's number beyond Patch::max_views is ignored.
  void take(std::size_t camera, const Cloud& cloud) noexcept;
  /// What a camera saw; null before its first cloud.
  [[nodiscard]] const Cloud* of(std::size_t camera) const noexcept { return of_[camera]; }

  /// Each cloud may fill an equal share of the patch.
  void gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept final;
  void gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept final;
  void gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                    Patch& patch) const noexcept final;
  void gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                    Patch& patch) const noexcept final;
  void gather_of(std::string_view material, const Ball& ball, std::size_t max_points,
                 Patch& patch) const noexcept final;
  /// That of the cloud that knows the smallest.
  [[nodiscard]] double spacing(const Vec3& place) const noexcept final;
  [[nodiscard]] bool has_materials() const noexcept final;
  [[nodiscard]] bool has_brightness() const noexcept final;
  [[nodiscard]] bool scale_unsure() const noexcept final;
  /// All clouds that know something there. The brightness is that of the first.
  void sample(const Vec3& place, const Vec3& normal, double radius,
              SurfaceSample& sample) const noexcept final;
  [[nodiscard]] const DepthImage* image() const noexcept final {
    return count_ == 1 ? parts_[0]->image() : nullptr;
  }
  [[nodiscard]] const PointCloud* point_cloud() const noexcept final {
    return count_ == 1 ? parts_[0]->point_cloud() : nullptr;
  }
  /// In the order of the cameras.
  [[nodiscard]] std::span<const Cloud* const> parts() const noexcept final {
    return {parts_.data(), count_};
  }

 private:
  std::array<const Cloud*, Patch::max_views> of_{};     // by camera
  std::array<const Cloud*, Patch::max_views> parts_{};  // those of them that are there
  std::size_t count_ = 0;
};

}  // namespace palpate
