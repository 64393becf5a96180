// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/kernel/core/material.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

struct ColourImage;

/// A colour: red, green and blue, 0 to 255 each.
using Colour = std::array<std::uint8_t, 3>;

/// A material with a name, and how a camera tells it.
struct NamedMaterial {
  std::string name;
  Material material;
  /// Where the image has about this colour it is this material; none: only labels and brushes are.
  std::optional<Colour> colour = {};
  /// How far a pixel's colour may be off, in CIELAB's unit, of which 100 are black to white.
  double tolerance = 15.0;
};

/// The materials of a scene. Label 0 is none of them; label i is `materials[i - 1]`.
struct MaterialTable {
  static constexpr std::size_t most = 255;
  std::vector<NamedMaterial> materials;

  /// The label of the first one of that name; 0 if there is none. [servo]
  [[nodiscard]] std::uint8_t label(std::string_view name) const noexcept {
    for (std::size_t i = 0; i < materials.size() && i < 255; ++i) {
      if (materials[i].name == name) return static_cast<std::uint8_t>(i + 1);
    }
    return 0;
  }
  /// Null for label 0, and for labels that nothing has.
  [[nodiscard]] const Material* find(std::uint8_t label) const noexcept {
    return label == 0 || label > materials.size() ? nullptr : &materials[label - 1].material;
  }
  [[nodiscard]] bool has_colours() const noexcept;
  /// Is there one by which brightness is felt?
  [[nodiscard]] bool has_relief() const noexcept;
};

/// @throws Error if there are more than MaterialTable::most, two have one name, a name is empty, a
///         tolerance is not in 1 to 100, or a number is out of its range.
void validate(const MaterialTable& table);

/// Materials that come with palpate, by name: such as "ice", "rubber", "wood". For tables of one's
/// own, brushes, and whole scenes.
const MaterialTable& standard_materials();
/// @throws Error for an unknown name, naming the nearest.
const NamedMaterial& standard_material(std::string_view name);

/// Which material each pixel of a depth image is, and how bright. Immutable.
class MaterialMap {
 public:
  explicit MaterialMap(std::shared_ptr<const MaterialTable> table) : table_(std::move(table)) {}
  virtual ~MaterialMap() = default;
  MaterialMap(const MaterialMap&) = delete;
  MaterialMap& operator=(const MaterialMap&) = delete;

  [[nodiscard]] const std::shared_ptr<const MaterialTable>& table() const noexcept {
    return table_;
  }
  /// The label of a pixel, row by row. [servo]
  /// @param point  [m] world: what the pixel measured
  [[nodiscard]] virtual std::uint8_t label(std::size_t pixel, const Vec3& point) const noexcept = 0;
  /// 0 to 255. Only if `has_brightness`. [servo]
  [[nodiscard]] virtual std::uint8_t brightness(std::size_t pixel,
                                                const Vec3& point) const noexcept = 0;
  [[nodiscard]] virtual bool has_brightness() const noexcept = 0;
  /// Are labels and brightness the same wherever the point is? Then it need not be known.
  [[nodiscard]] virtual bool is_by_pixel() const noexcept { return true; }

  [[nodiscard]] const Material* material(std::size_t pixel, const Vec3& point) const noexcept {
    return table_->find(label(pixel, point));
  }

 private:
  std::shared_ptr<const MaterialTable> table_;
};

/// An image of labels, beside the depth image: of a segmentation, a recording, a callback.
class LabelImage final : public MaterialMap {
 public:
  /// @param labels      of each pixel, row by row
  /// @param brightness  of each pixel; empty if it is not known
  /// @throws Error if there is no table, or brightness has another size than labels.
  LabelImage(std::shared_ptr<const MaterialTable> table, std::vector<std::uint8_t> labels,
             std::vector<std::uint8_t> brightness = {});

  [[nodiscard]] std::uint8_t label(std::size_t pixel, const Vec3& point) const noexcept override;
  [[nodiscard]] std::uint8_t brightness(std::size_t pixel,
                                        const Vec3& point) const noexcept override;
  [[nodiscard]] bool has_brightness() const noexcept override { return !brightness_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return labels_.size(); }

 private:
  std::vector<std::uint8_t> labels_, brightness_;
};

/// Which material a colour is: the nearest that is within its tolerance. Made once for a table.
class ColourKey {
 public:
  explicit ColourKey(const MaterialTable& table);
  [[nodiscard]] std::uint8_t label(const std::uint8_t* rgb) const noexcept {
    return labels_[static_cast<std::size_t>((rgb[0] >> 3) << 10 | (rgb[1] >> 3) << 5 |
                                            (rgb[2] >> 3))];
  }

 private:
  std::vector<std::uint8_t> labels_;  // of 5 bits of each colour
};

/// Materials by the colours of an image, which lies on the depth image or is of a camera beside it.
class ColourMap final : public MaterialMap {
 public:
  /// @throws Error if one is null
  ColourMap(std::shared_ptr<const MaterialTable> table, std::shared_ptr<const ColourKey> key,
            std::shared_ptr<const ColourImage> image);

  [[nodiscard]] std::uint8_t label(std::size_t pixel, const Vec3& point) const noexcept override;
  [[nodiscard]] std::uint8_t brightness(std::size_t pixel,
                                        const Vec3& point) const noexcept override;
  /// Only where a material is felt by its brightness: it would be recorded for nothing.
  [[nodiscard]] bool has_brightness() const noexcept override { return table()->has_relief(); }
  [[nodiscard]] bool is_by_pixel() const noexcept override;

 private:
  // Null where the image does not show it.
  [[nodiscard]] const std::uint8_t* colour(std::size_t pixel, const Vec3& point) const noexcept;

  std::shared_ptr<const ColourKey> key_;
  std::shared_ptr<const ColourImage> image_;
};

}  // namespace palpate
