// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/sources/fixture_file.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/toml_table.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t largest_fixture_file = std::uintmax_t{1} << 20;
constexpr const char* fixture_remedy = "write [[fixture]] tables; docs/fixtures.md has an example";
constexpr double longest = 100.0;  // [m]

// Of a kind or a shape, by its name.
template <class Choice>
Choice choice_of(std::string_view name, std::span<const std::string_view> names,
                 const std::string& what) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<Choice>(found - names.begin());
  throw Error(what, "there is no '" + std::string(name) + "'", did_you_mean(name, names));
}

template <class Choice>
void read_choice(const TomlTable& table, std::string_view key,
                 std::span<const std::string_view> names, Choice& choice) {
  std::string name;
  table.read(key, name);
  if (name.empty()) return;
  choice = choice_of<Choice>(
      name, names,
      at_line(table.file(), table.find(key)->source().begin.line) + ": " + TomlTable::quoted(key));
}

Vec3 read_triple(const TomlTable& table, const toml::node& node, std::string_view key) {
  const toml::array* array = node.as_array();
  if (array == nullptr || array->size() != 3)
    table.fail(node, TomlTable::quoted(key) + " is not three numbers", "write [x, y, z] in metres");
  Vec3 v;
  for (int axis = 0; axis < 3; ++axis)
    v[axis] = table.number_of(*array->get(static_cast<std::size_t>(axis)),
                              "an element of " + TomlTable::quoted(key));
  return v;
}

void read_mesh(const TomlTable& table, const toml::node& node, const fs::path& folder,
               Fixture& fixture) {
  std::string name;
  table.read("file", name);
  const fs::path path = folder / name;
  const std::string extension = lower_case(path.extension().string());
  if (extension != ".ply" && extension != ".stl")
    table.fail(node, "'file' is '" + name + "'", "give a closed mesh as .ply or .stl");
  PointFile mesh = extension == ".ply" ? read_ply(path) : read_stl(path);
  if (mesh.triangles.empty())
    table.fail(node, "'" + name + "' has points but no faces", "give a closed mesh");
  fixture.points = std::move(mesh.points);
  fixture.triangles = std::move(mesh.triangles);
}

Fixture read_fixture(const TomlTable& root, const toml::node& node, const fs::path& folder) {
  if (!node.is_table()) root.fail(node, "a fixture is not a table", fixture_remedy);
  std::vector<std::string_view> keys{"name",    "kind",    "shape",     "pose", "size",
                                     "radius",  "length",  "points",    "file", "material",
                                     "one_way", "consent", "on_surface"};
  for (const FixtureInfo& row : fixture_table()) keys.push_back(row.name);
  const TomlTable table(*node.as_table(), root.file(), "[[fixture]]", keys);
  Fixture fixture;
  table.read("name", fixture.name);
  if (fixture.name.empty()) root.fail(node, "a fixture has no 'name'", "write name = \"...\"");
  if (table.find("shape") == nullptr)
    root.fail(node, "fixture '" + fixture.name + "' has no 'shape'", "write shape = \"box\"");
  read_choice(table, "kind", fixture_kind_names(), fixture.kind);
  read_choice(table, "shape", fixture_shape_names(), fixture.shape);
  if (const auto pose = table.pose("pose")) fixture.world_from_fixture = *pose;
  if (const toml::node* size = table.find("size")) fixture.size = read_triple(table, *size, "size");
  table.read(key_of("radius", "", "m", 0.0, longest, ""), fixture.radius);
  table.read(key_of("length", "", "m", 0.0, longest, ""), fixture.length);
  if (const toml::node* points = table.find("points")) {
    if (!points->is_array())
      table.fail(*points, "'points' is not a list", "write [[x, y, z], [x, y, z]] in metres");
    for (const toml::node& point : *points->as_array())
      fixture.points.push_back(read_triple(table, point, "points"));
  }
  if (const toml::node* file = table.find("file")) read_mesh(table, *file, folder, fixture);
  table.read("material", fixture.material);
  table.read("one_way", fixture.one_way);
  table.read("consent", fixture.consent);
  table.read("on_surface", fixture.on_surface);
  set_rows(table, fixture_table(), fixture.numbers);
  root.at(node, [&] { validate(fixture); });
  return fixture;
}

nlohmann::ordered_json triple(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

Vec3 triple_of(const nlohmann::json& array) {
  return {array.at(0).get<double>(), array.at(1).get<double>(), array.at(2).get<double>()};
}

}  // namespace

FixtureSet parse_fixtures(std::string_view text, const std::string& name, const fs::path& folder) {
  const toml::table tree = parse_toml(text, name, fixture_remedy);
  constexpr std::array<std::string_view, 1> keys{"fixture"};
  const TomlTable root(tree, name, "", keys);
  const toml::node* node = root.find("fixture");
  const toml::array* list = node == nullptr ? nullptr : node->as_array();
  if (list == nullptr || list->empty()) throw Error(name, "it has no fixtures", fixture_remedy);
  std::vector<Fixture> fixtures;
  for (const toml::node& element : *list) fixtures.push_back(read_fixture(root, element, folder));
  try {
    return FixtureSet(fixtures);
  } catch (const Error& error) {
    throw Error(name, error.what());
  }
}

FixtureSet read_fixtures(const fs::path& file) {
  return parse_fixtures(read_text(file, largest_fixture_file), file.string(), file.parent_path());
}

std::string fixtures_json(const FixtureSet& set) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const FixtureSet::Item& item : set.items()) {
    const Fixture& f = item.fixture;
    nlohmann::ordered_json entry{
        {"name", f.name},
        {"kind", fixture_kind_names()[static_cast<std::size_t>(f.kind)]},
        {"shape", fixture_shape_names()[static_cast<std::size_t>(f.shape)]},
        {"size", triple(f.size)},
        {"radius", f.radius},
        {"length", f.length},
        {"one_way", f.one_way},
        {"consent", f.consent},
        {"on_surface", f.on_surface}};
    if (!f.material.empty()) entry["material"] = f.material;
    for (int i = 0; i < 12; ++i)
      entry["world_from_fixture"].push_back(f.world_from_fixture(i / 4, i % 4));
    for (const Vec3& point : f.points) entry["points"].push_back(triple(point));
    for (const auto& triangle : f.triangles) entry["triangles"].push_back(triangle);
    for (const FixtureInfo& row : fixture_table())
      entry[std::string(row.name)] = row.get(f.numbers);
    list.push_back(std::move(entry));
  }
  return list.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::shared_ptr<const FixtureSet> fixtures_from_json(std::string_view text,
                                                     const std::string& what) {
  std::vector<Fixture> fixtures;
  try {
    for (const auto& entry : nlohmann::json::parse(text)) {
      Fixture f{.name = entry.at("name").get<std::string>()};
      f.kind = choice_of<FixtureKind>(entry.at("kind").get<std::string>(), fixture_kind_names(),
                                      what + ": kind");
      f.shape = choice_of<FixtureShape>(entry.at("shape").get<std::string>(), fixture_shape_names(),
                                        what + ": shape");
      if (entry.contains("size")) f.size = triple_of(entry.at("size"));
      f.radius = entry.value("radius", f.radius);
      f.length = entry.value("length", f.length);
      f.material = entry.value("material", f.material);
      f.one_way = entry.value("one_way", f.one_way);
      f.consent = entry.value("consent", f.consent);
      f.on_surface = entry.value("on_surface", f.on_surface);
      if (entry.contains("world_from_fixture")) {
        const auto& pose = entry.at("world_from_fixture");
        for (int i = 0; i < 12; ++i)
          f.world_from_fixture(i / 4, i % 4) = pose.at(static_cast<std::size_t>(i)).get<double>();
      }
      for (const auto& point : entry.value("points", nlohmann::json::array()))
        f.points.push_back(triple_of(point));
      f.triangles = entry.value("triangles", f.triangles);
      for (const FixtureInfo& row : fixture_table()) {
        if (entry.contains(row.name))
          set_parameter(f.numbers, row.name, entry.at(std::string(row.name)).get<double>());
      }
      fixtures.push_back(std::move(f));
    }
  } catch (const nlohmann::json::exception& error) {
    throw Error(what, std::string("its fixtures cannot be read: ") + error.what(),
                "it may be damaged, or of another version of palpate");
  }
  return std::make_shared<const FixtureSet>(fixtures);
}

}  // namespace palpate
