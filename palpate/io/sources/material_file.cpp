// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/material_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/toml_table.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t largest_material_file = std::uintmax_t{1} << 20;
constexpr const char* material_remedy =
    "write [[material]] tables; docs/materials.md has an example";

std::optional<Colour> colour_of(std::string_view text) {
  if (text.size() != 7 || text[0] != '#') return std::nullopt;
  Colour colour{};
  for (std::size_t i = 0; i < 3; ++i) {
    const char* begin = text.data() + 1 + 2 * i;
    const auto [end, error] = std::from_chars(begin, begin + 2, colour[i], 16);
    if (error != std::errc() || end != begin + 2) return std::nullopt;
  }
  return colour;
}

std::string colour_text(const Colour& colour) {
  std::array<char, 8> text{};
  std::snprintf(text.data(), text.size(), "#%02x%02x%02x", colour[0], colour[1], colour[2]);
  return text.data();
}

NamedMaterial read_material(const TomlTable& root, const toml::node& node,
                            const MaterialTable& above) {
  if (!node.is_table()) root.fail(node, "a material is not a table", material_remedy);
  std::vector<std::string_view> keys{"name", "like", "colour", "tolerance"};
  for (const MaterialInfo& row : material_table()) keys.push_back(row.name);
  const TomlTable table(*node.as_table(), root.file(), "[[material]]", keys);
  NamedMaterial material;
  std::string name;
  std::string like;
  std::string colour;
  table.read("name", name);
  if (name.empty()) root.fail(node, "a material has no 'name'", "write name = \"...\"");
  table.read("like", like);
  if (!like.empty()) {
    const auto known = std::find_if(above.materials.begin(), above.materials.end(),
                                    [&](const NamedMaterial& m) { return m.name == like; });
    table.at(*table.find("like"),
             [&] { material = known != above.materials.end() ? *known : standard_material(like); });
    material.colour.reset();
  }
  material.name = name;
  table.read("colour", colour);
  if (!colour.empty()) {
    material.colour = colour_of(colour);
    if (!material.colour)
      table.fail(*table.find("colour"), "'colour' is '" + colour + "'",
                 "write it as \"#rrggbb\", such as \"#a0522d\"");
  }
  table.read(key_of("tolerance", "", "of CIELAB", 1.0, 100.0, ""), material.tolerance);
  set_rows(table, material_table(), material.material);
  return material;
}

class SourceWithMaterials final : public Source {
 public:
  SourceWithMaterials(std::unique_ptr<Source> source, Materials materials)
      : source_(std::move(source)), materials_(std::move(materials)) {
    validate(*materials_.table);
    if (materials_.table->has_colours()) key_ = std::make_shared<ColourKey>(*materials_.table);
  }

  std::optional<Frame> next(double timeout) override {
    std::optional<Frame> frame = source_->next(timeout);
    if (!frame) return frame;
    const DepthImage* image = frame->cloud->image();
    if (image == nullptr) return frame;
    auto felt = std::make_shared<DepthImage>(*image);
    felt->set_materials(map_of(*frame, image->depth().size()));
    frame->cloud = std::move(felt);
    return frame;
  }
  std::size_t skip(std::size_t count) override { return source_->skip(count); }
  void cancel() noexcept override { source_->cancel(); }
  void follow(const Vec3& hand) override { source_->follow(hand); }
  [[nodiscard]] const SourceInfo& info() const override { return source_->info(); }

 private:
  std::shared_ptr<const MaterialMap> map_of(const Frame& frame, std::size_t pixels) {
    if (frame.labels) {
      if (frame.labels->size() != pixels)
        throw Error(info().uri,
                    "its labels are of " + std::to_string(frame.labels->size()) +
                        " pixels, its depth image is of " + std::to_string(pixels),
                    "give labels of the same size");
      return std::make_shared<LabelImage>(materials_.table, *frame.labels);
    }
    if (key_) {
      if (!frame.colour)
        throw Error(
            info().uri, "materials are assigned by colour, but its frames have no colour",
            "enable colour, such as by colour=rgb.txt for a recording, or remove the materials");
      return std::make_shared<ColourMap>(materials_.table, key_, frame.colour);
    }
    const auto label = static_cast<std::uint8_t>(materials_.everywhere ? 1 : 0);
    if (!everywhere_ || everywhere_->size() != pixels)
      everywhere_ =
          std::make_shared<LabelImage>(materials_.table, std::vector<std::uint8_t>(pixels, label));
    return everywhere_;
  }

  std::unique_ptr<Source> source_;
  Materials materials_;
  std::shared_ptr<const ColourKey> key_;          // null: no colours
  std::shared_ptr<const LabelImage> everywhere_;  // the same label for all pixels
};

}  // namespace

MaterialTable parse_materials(std::string_view text, const std::string& name) {
  const toml::table tree = parse_toml(text, name, material_remedy);
  constexpr std::array<std::string_view, 1> keys{"material"};
  const TomlTable root(tree, name, "", keys);
  const toml::node* node = root.find("material");
  const toml::array* list = node == nullptr ? nullptr : node->as_array();
  if (list == nullptr || list->empty()) throw Error(name, "it has no materials", material_remedy);
  MaterialTable table;
  for (const toml::node& element : *list)
    table.materials.push_back(read_material(root, element, table));
  try {
    validate(table);
  } catch (const Error& error) {
    throw Error(name, error.what());
  }
  return table;
}

MaterialTable read_materials(const fs::path& file) {
  return parse_materials(read_text(file, largest_material_file), file.string());
}

Materials materials_of(const std::string& name_or_file) {
  std::error_code error;
  if (fs::is_regular_file(name_or_file, error))
    return {.table = std::make_shared<MaterialTable>(read_materials(name_or_file)),
            .everywhere = false};
  if (name_or_file.find_first_of("/.") != std::string::npos)
    throw Error(name_or_file, "there is no such file of materials", "check the path");
  return {.table = std::make_shared<MaterialTable>(
              MaterialTable{.materials = {standard_material(name_or_file)}}),
          .everywhere = true};
}

std::string materials_json(const MaterialTable& table) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const NamedMaterial& m : table.materials) {
    nlohmann::ordered_json entry{{"name", m.name}};
    if (m.colour) {
      entry["colour"] = colour_text(*m.colour);
      entry["tolerance"] = m.tolerance;
    }
    for (const MaterialInfo& row : material_table())
      entry[std::string(row.name)] = row.get(m.material);
    list.push_back(std::move(entry));
  }
  return list.dump();
}

MaterialTable materials_from_json(std::string_view text, const std::string& what) {
  MaterialTable table;
  try {
    for (const auto& entry : nlohmann::json::parse(text)) {
      NamedMaterial material{.name = entry.at("name").get<std::string>(), .material = {}};
      if (entry.contains("colour")) {
        material.colour = colour_of(entry.at("colour").get<std::string>());
        material.tolerance = entry.at("tolerance").get<double>();
      }
      for (const MaterialInfo& row : material_table()) {
        const std::string name(row.name);
        if (entry.contains(name))
          set_parameter(material.material, row.name, entry.at(name).get<double>());
      }
      table.materials.push_back(std::move(material));
    }
  } catch (const nlohmann::json::exception& error) {
    throw Error(what, std::string("its materials cannot be read: ") + error.what(),
                "it may be damaged, or of another version of palpate");
  }
  validate(table);
  return table;
}

std::unique_ptr<Source> with_materials(std::unique_ptr<Source> source, Materials materials) {
  return std::make_unique<SourceWithMaterials>(std::move(source), std::move(materials));
}

}  // namespace palpate
