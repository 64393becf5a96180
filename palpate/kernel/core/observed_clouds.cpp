// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/observed_clouds.hpp"

#include <algorithm>

namespace palpate {

void ObservedClouds::take(std::size_t camera, const Cloud& cloud) noexcept {
  if (camera >= of_.size()) return;
  of_[camera] = &cloud;
  count_ = 0;
  for (const Cloud* each : of_) {
    if (each != nullptr) parts_[count_++] = each;
  }
}

void ObservedClouds::gather(const Ball& ball, std::size_t max_points, Patch& patch) const noexcept {
  for (const Cloud* part : parts()) part->gather(ball, max_points / count_, patch);
}

void ObservedClouds::gather(const Beam& beam, std::size_t max_points, Patch& patch) const noexcept {
  for (const Cloud* part : parts()) part->gather(beam, max_points / count_, patch);
}

void ObservedClouds::gather_sides(const Ball& ball, const Sides& sides, std::size_t max_points,
                                  Patch& patch) const noexcept {
  for (const Cloud* part : parts()) part->gather_sides(ball, sides, max_points / count_, patch);
}

void ObservedClouds::gather_sheet(const Ball& ball, const Sheet& sheet, std::size_t max_points,
                                  Patch& patch) const noexcept {
  for (const Cloud* part : parts()) part->gather_sheet(ball, sheet, max_points / count_, patch);
}

void ObservedClouds::gather_of(std::string_view material, const Ball& ball, std::size_t max_points,
                               Patch& patch) const noexcept {
  for (const Cloud* part : parts()) part->gather_of(material, ball, max_points / count_, patch);
}

bool ObservedClouds::has_materials() const noexcept {
  return std::any_of(parts().begin(), parts().end(),
                     [](const Cloud* part) { return part->has_materials(); });
}

bool ObservedClouds::has_brightness() const noexcept {
  return std::any_of(parts().begin(), parts().end(),
                     [](const Cloud* part) { return part->has_brightness(); });
}

bool ObservedClouds::scale_unsure() const noexcept {
  return std::any_of(parts().begin(), parts().end(),
                     [](const Cloud* part) { return part->scale_unsure(); });
}

void ObservedClouds::sample(const Vec3& place, const Vec3& normal, double radius,
                            SurfaceSample& sample) const noexcept {
  for (const Cloud* part : parts()) part->sample(place, normal, radius, sample);
}

double ObservedClouds::spacing(const Vec3& place) const noexcept {
  double least = 0.0;
  for (const Cloud* part : parts()) {
    const double spacing = part->spacing(place);
    if (spacing > 0.0 && (least == 0.0 || spacing < least)) least = spacing;
  }
  return least;
}

}  // namespace palpate
