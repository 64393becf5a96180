// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/paint.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/tick.hpp"

namespace palpate {
namespace {

// [-] of a dab's pixels that must show its surface for it to follow.
constexpr double least_seen = 0.3;
// [-] of a radius within which dabs are one.
constexpr double apart = 1.0 / 3.0;

// A camera's materials, and of the standard ones and those that are defined what has another name.
MaterialTable all_materials(const MaterialTable* base,
                            const std::vector<NamedMaterial>& defined = {}) {
  MaterialTable table = base == nullptr ? MaterialTable{} : *base;
  for (const auto* others : {&standard_materials().materials, &defined}) {
    for (const NamedMaterial& other : *others) {
      if (table.label(other.name) == 0 && table.materials.size() < MaterialTable::most)
        table.materials.push_back(other);
    }
  }
  return table;
}

// Calls `visit(pixel, point, ahead)` for each measured pixel of a dab: `point` in the camera's axes
// and how far it is behind the dab's place along the line of sight [m]. Returns how many pixels
// there are, holes too.
template <class Visit>
std::size_t for_each_pixel(const DepthImage& image, const Vec3& place, double radius,
                           const Visit& visit) {
  const Intrinsics& k = image.intrinsics();
  const Eigen::Isometry3d& pose = image.world_from_camera();
  const Vec3 centre = pose.linear().transpose() * (place - pose.translation());
  if (!(centre.z() > radius)) return 0;
  const double distance = centre.norm();
  const Vec3 axis = centre / distance;
  const ViewingRays::Window window = image.rays().window(centre, radius);
  std::size_t pixels = 0;
  for (int v = window.v_begin; v < window.v_end; ++v) {
    for (int u = window.u_begin; u < window.u_end; ++u) {
      const Eigen::Vector2d slope = image.rays().ray(u, v);
      const Vec3 ray = Vec3(slope.x(), slope.y(), 1.0);
      const double along = ray.dot(axis);
      // How far the ray passes by, where the dab is.
      if (!((ray / along * distance - centre).squaredNorm() <= radius * radius)) continue;
      ++pixels;
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(k.width) +
                            static_cast<std::size_t>(u);
      const std::uint16_t raw = image.depth()[i];
      if (!is_measured(raw)) continue;
      const Vec3 point = raw / image.units_per_metre() * ray;
      visit(i, point, point.dot(axis) - distance);
    }
  }
  return pixels;
}

}  // namespace

void Paint::define(const NamedMaterial& material) {
  validate(MaterialTable{{material}});
  const std::lock_guard lock(mutex_);
  if (MaterialTable{defined_}.label(material.name) != 0) return;
  if (all_materials(base_.get(), defined_).materials.size() >= MaterialTable::most)
    throw Error("brush", "there are " + std::to_string(MaterialTable::most) + " materials already",
                "name fewer in the camera's file");
  defined_.push_back(material);
  table_.reset();  // made again with the next frame
}

void Paint::add(const Dab& dab) {
  if (!is_place(dab.place) || !(dab.radius >= smallest && dab.radius <= largest))
    throw Error("brush",
                "the position is not finite or beyond 1000 km, or the radius is out of range",
                "use a point on the surface and a radius from 1 mm to 100 mm");
  const std::lock_guard lock(mutex_);
  if ((table_ ? *table_ : all_materials(base_.get(), defined_)).label(dab.material) == 0)
    static_cast<void>(standard_material(dab.material));  // throws, naming the nearest
  const auto same = std::find_if(dabs_.begin(), dabs_.end(), [&](const Dab& other) {
    return (other.place - dab.place).norm() <= apart * dab.radius && other.radius <= dab.radius;
  });
  if (same != dabs_.end()) dabs_.erase(same);
  if (dabs_.size() >= most)
    throw Error("brush", "there are " + std::to_string(most) + " painted spots already",
                "clear the paint, or use a wider brush");
  dabs_.push_back(dab);
}

void Paint::erase(const Vec3& place, double radius) {
  const std::lock_guard lock(mutex_);
  std::erase_if(dabs_, [&](const Dab& dab) { return (dab.place - place).norm() <= radius; });
}

void Paint::clear() {
  const std::lock_guard lock(mutex_);
  dabs_.clear();
}

std::vector<Dab> Paint::dabs() const {
  const std::lock_guard lock(mutex_);
  return dabs_;
}

std::vector<std::string> Paint::names(const Cloud& cloud) {
  const DepthImage* image = cloud.image();
  const MaterialMap* map = image == nullptr ? nullptr : image->materials().get();
  std::vector<std::string> names;
  for (const NamedMaterial& m :
       all_materials(map == nullptr ? nullptr : map->table().get()).materials)
    names.push_back(m.name);
  return names;
}

std::shared_ptr<const Cloud> Paint::on(const std::shared_ptr<const Cloud>& cloud,
                                       std::size_t camera) {
  const std::lock_guard lock(mutex_);
  const DepthImage* image = cloud->image();
  if (image == nullptr) return cloud;
  const MaterialMap* map = image->materials().get();
  const auto base = map == nullptr ? nullptr : map->table();
  if (!table_ || base != base_) {
    base_ = base;
    table_ = std::make_shared<const MaterialTable>(all_materials(base.get(), defined_));
  }
  if (dabs_.empty()) return cloud;

  std::vector<std::uint8_t> labels(image->depth().size());
  std::vector<std::uint8_t> brightness;
  if (map != nullptr) {
    if (map->has_brightness()) brightness.resize(labels.size());
    const int width = image->intrinsics().width;
    for (std::size_t i = 0; i < labels.size(); ++i) {
      const auto pixel = static_cast<int>(i);
      const Vec3 point =
          map->is_by_pixel()
              ? Vec3(Vec3::Zero())
              : image->deproject(pixel % width, pixel / width).value_or(Vec3::Zero());
      labels[i] = map->label(i, point);
      if (!brightness.empty()) brightness[i] = map->brightness(i, point);
    }
  }
  for (Dab& dab : dabs_) {
    const double layer = std::max(dab.radius, followed);
    if (camera == 0) {
      double sum = 0.0;
      std::size_t seen = 0;
      const std::size_t pixels = for_each_pixel(*image, dab.place, dab.radius,
                                                [&](std::size_t, const Vec3&, double ahead) {
                                                  if (!(std::abs(ahead) <= layer)) return;
                                                  sum += ahead;
                                                  ++seen;
                                                });
      if (seen > 0 && static_cast<double>(seen) >= least_seen * static_cast<double>(pixels)) {
        const Vec3 eye = image->world_from_camera().translation();
        dab.place += sum / static_cast<double>(seen) * (dab.place - eye).normalized();
      }
    }
    const std::uint8_t label = table_->label(dab.material);
    for_each_pixel(*image, dab.place, dab.radius, [&](std::size_t i, const Vec3&, double ahead) {
      if (std::abs(ahead) <= layer) labels[i] = label;
    });
  }
  auto painted = std::make_shared<DepthImage>(*image);
  painted->set_materials(
      std::make_shared<LabelImage>(table_, std::move(labels), std::move(brightness)));
  return painted;
}

}  // namespace palpate
