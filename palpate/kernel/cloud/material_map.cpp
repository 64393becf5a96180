// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/cloud/material_map.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "palpate/kernel/cloud/frame.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/mathematics.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

// sRGB to CIELAB, white D65.
Vec3 lab(double red, double green, double blue) {
  const auto linear = [](double c) {
    return c <= 0.04045 ? c / 12.92 : math::pow((c + 0.055) / 1.055, 2.4);
  };
  const auto root = [](double t) {
    return t > 0.008856 ? math::pow(t, 1.0 / 3.0) : 7.787 * t + 16.0 / 116.0;
  };
  const double r = linear(red / 255.0);
  const double g = linear(green / 255.0);
  const double b = linear(blue / 255.0);
  const double x = root((0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.95047);
  const double y = root(0.2126 * r + 0.7152 * g + 0.0722 * b);
  const double z = root((0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.08883);
  return {116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)};
}

std::uint8_t grey(const std::uint8_t* rgb) {
  return static_cast<std::uint8_t>((77 * rgb[0] + 150 * rgb[1] + 29 * rgb[2]) >> 8);
}

// Orders of magnitude, from the literature that docs/materials.md names: what people call by these
// names differs more than that.
MaterialTable made_standard_materials() {
  const auto made = [](std::string name, double stiffness, double cushion, double friction,
                       double kinetic_share, double viscosity, TapParameters tap,
                       TextureParameters texture) {
    return NamedMaterial{.name = std::move(name),
                         .material = {.stiffness = stiffness,
                                      .cushion = cushion,
                                      .friction = friction,
                                      .kinetic_share = kinetic_share,
                                      .viscosity = viscosity,
                                      .tap = tap,
                                      .texture = texture}};
  };
  return {.materials = {
              made("ice", 1e5, 0.0, 0.05, 0.6, 0.0, {6.0, 250.0, 120.0}, {}),
              made("metal", 1e5, 0.0, 0.2, 0.8, 0.0, {10.0, 300.0, 90.0}, {}),
              made("wood", 1e5, 0.0, 0.4, 0.8, 0.0, {8.0, 100.0, 80.0}, {0.04, 2e-3, 0.0}),
              made("paper", 500.0, 0.0, 0.35, 0.9, 0.0, {}, {0.02, 0.6e-3, 0.0}),
              made("sandpaper", 1e5, 0.0, 0.8, 0.95, 0.0, {4.0, 150.0, 150.0}, {0.15, 0.8e-3, 0.0}),
              made("rubber", 300.0, 1.0, 1.0, 0.85, 0.0, {3.0, 18.0, 60.0}, {}),
              made("foam", 120.0, 2.0, 0.6, 0.9, 0.0, {}, {}),
              made("skin", 200.0, 1.5, 0.5, 0.9, 0.5, {}, {}),
              made("honey", 150.0, 2.0, 0.0, 1.0, 3.0, {}, {}),
          }};
}

}  // namespace

bool MaterialTable::has_colours() const noexcept {
  return std::any_of(materials.begin(), materials.end(),
                     [](const NamedMaterial& m) { return m.colour.has_value(); });
}

bool MaterialTable::has_relief() const noexcept {
  return std::any_of(materials.begin(), materials.end(),
                     [](const NamedMaterial& m) { return m.material.texture.relief != 0.0; });
}

void validate(const MaterialTable& table) {
  if (table.materials.size() > MaterialTable::most) {
    throw Error("materials", std::to_string(table.materials.size()) + " are too many",
                "give at most " + std::to_string(MaterialTable::most));
  }
  std::set<std::string_view> names;
  for (const NamedMaterial& m : table.materials) {
    if (m.name.empty()) throw Error("material", "a material has no name", "give each its name");
    if (!names.insert(m.name).second)
      throw Error("material '" + m.name + "'", "the name is used twice", "use different names");
    if (!(m.tolerance >= 1.0 && m.tolerance <= 100.0))
      throw Error("material '" + m.name + "'", "its tolerance is out of range",
                  "give 1 to 100, such as 15");
    try {
      validate(m.material);
    } catch (const Error& error) {
      throw Error("material '" + m.name + "'", error.what(), "see palpate parameters");
    }
  }
}

const MaterialTable& standard_materials() {
  static const MaterialTable table = made_standard_materials();
  return table;
}

const NamedMaterial& standard_material(std::string_view name) {
  const auto& materials = standard_materials().materials;
  for (const NamedMaterial& m : materials) {
    if (m.name == name) return m;
  }
  throw Error("material '" + std::string(name) + "'", "there is no material of that name",
              did_you_mean(name, names_of(materials)));
}

LabelImage::LabelImage(std::shared_ptr<const MaterialTable> table, std::vector<std::uint8_t> labels,
                       std::vector<std::uint8_t> brightness)
    : MaterialMap(std::move(table)),
      labels_(std::move(labels)),
      brightness_(std::move(brightness)) {
  if (!this->table()) throw Error("material map", "it has no table", "give its materials");
  if (!brightness_.empty() && brightness_.size() != labels_.size())
    throw Error("material map",
                std::to_string(brightness_.size()) + " values of brightness are not of " +
                    std::to_string(labels_.size()) + " pixels",
                "give one for each pixel, or none");
}

std::uint8_t LabelImage::label(std::size_t pixel, const Vec3& /*point*/) const noexcept {
  return pixel < labels_.size() ? labels_[pixel] : std::uint8_t{0};
}

std::uint8_t LabelImage::brightness(std::size_t pixel, const Vec3& /*point*/) const noexcept {
  return pixel < brightness_.size() ? brightness_[pixel] : std::uint8_t{0};
}

ColourKey::ColourKey(const MaterialTable& table) : labels_(std::size_t{1} << 15) {
  std::vector<Vec3> wanted;
  for (const NamedMaterial& m : table.materials)
    wanted.push_back(m.colour ? lab((*m.colour)[0], (*m.colour)[1], (*m.colour)[2])
                              : Vec3(Vec3::Zero()));
  for (std::size_t i = 0; i < labels_.size(); ++i) {
    constexpr double middle = 4.0;  // of the 8 values that are one
    const auto value = [&](unsigned shift) {
      return static_cast<double>((i >> shift & 31U) << 3) + middle;
    };
    const Vec3 here = lab(value(10), value(5), value(0));
    double nearest = 1e9;
    for (std::size_t m = 0; m < table.materials.size(); ++m) {
      const double distance = (here - wanted[m]).norm();
      if (!table.materials[m].colour || distance > table.materials[m].tolerance ||
          !(distance < nearest))
        continue;
      nearest = distance;
      labels_[i] = static_cast<std::uint8_t>(m + 1);
    }
  }
}

ColourMap::ColourMap(std::shared_ptr<const MaterialTable> table,
                     std::shared_ptr<const ColourKey> key, std::shared_ptr<const ColourImage> image)
    : MaterialMap(std::move(table)), key_(std::move(key)), image_(std::move(image)) {
  if (!this->table() || !key_ || !image_)
    throw Error("material map", "it has no table, key or image", "give all three");
}

bool ColourMap::is_by_pixel() const noexcept { return !image_->camera; }

const std::uint8_t* ColourMap::colour(std::size_t pixel, const Vec3& point) const noexcept {
  if (!image_->camera)
    return 3 * pixel + 2 < image_->rgb.size() ? &image_->rgb[3 * pixel] : nullptr;
  const Intrinsics& k = image_->camera->intrinsics;
  const Eigen::Isometry3d& pose = image_->camera->world_from_camera;
  const Vec3 p = pose.linear().transpose() * (point - pose.translation());
  if (!(p.z() > 0.0)) return nullptr;
  // The lens's distortion is left out: some pixels at the rim of the image.
  const double u = k.fx * p.x() / p.z() + k.cx;
  const double v = k.fy * p.y() / p.z() + k.cy;
  if (!(u > -0.5 && v > -0.5 && u < image_->width - 0.5 && v < image_->height - 0.5))
    return nullptr;
  const auto column = static_cast<std::size_t>(std::lround(u));
  const auto row = static_cast<std::size_t>(std::lround(v));
  const std::size_t i = 3 * (row * static_cast<std::size_t>(image_->width) + column);
  return i + 2 < image_->rgb.size() ? &image_->rgb[i] : nullptr;
}

std::uint8_t ColourMap::label(std::size_t pixel, const Vec3& point) const noexcept {
  const std::uint8_t* rgb = colour(pixel, point);
  return rgb == nullptr ? std::uint8_t{0} : key_->label(rgb);
}

std::uint8_t ColourMap::brightness(std::size_t pixel, const Vec3& point) const noexcept {
  const std::uint8_t* rgb = colour(pixel, point);
  return rgb == nullptr ? std::uint8_t{0} : grey(rgb);
}

}  // namespace palpate
