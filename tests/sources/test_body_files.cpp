// SPDX-License-Identifier: Apache-2.0
// OBJ, SPZ and glTF: what map: and splat: read beside PLY and STL.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include <gtest/gtest.h>
#include <zstd.h>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/gzip.hpp"
#include "tests/support/point_file_rules.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_body_files {

using test::fails_saying;
using test::gzip;
using Triangles = std::vector<std::array<std::uint32_t, 3>>;

PointFile obj(const std::string& text) {
  return parse_obj(std::as_bytes(std::span(text)), "test.obj");
}
PointFile spz(const std::string& bytes) {
  return parse_spz(std::as_bytes(std::span(bytes)), "test.spz");
}
PointFile gltf(const std::string& bytes, bool as_splat = false) {
  return parse_gltf(std::as_bytes(std::span(bytes)), "test.glb", "/nowhere", as_splat);
}

template <class T>
void put(std::string& bytes, std::initializer_list<T> values) {
  for (const T value : values) bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// Damage gives an error of one line, or a consistent file.
template <class Parse>
void expect_defined_on_damage(const Parse& parse, const std::string& whole) {
  std::mt19937 random(1);
  for (int run = 0; run < 2000; ++run) {
    std::string bytes = whole.substr(0, run % 2 == 0 ? whole.size() : random() % whole.size());
    for (unsigned i = random() % 4; i-- > 0 && !bytes.empty();)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    try {
      EXPECT_TRUE(test::is_consistent(parse(bytes), bytes.size()));
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find_first_of("\r\n"), std::string::npos);
    }
  }
}

TEST(BodyFiles, ObjHasFacesOfAllForms) {
  const std::string text =
      "# a square and more\nmtllib a.mtl\nv 0 0 0\nv 1 0 0 1 0.5 0.5\r\nv 1 1 0\nvt 0 0\nvn 0 0 1\n"
      "f 1/1 2//1 3/1/1\nv 0 1 0\nusemtl b\nf -4 -3/1 -2/1/1 -1//1\n";
  const PointFile mesh = obj(text);
  ASSERT_EQ(mesh.points.size(), 4U);
  EXPECT_EQ(mesh.points[1], Vec3(1, 0, 0));
  EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}}));
  const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
  EXPECT_TRUE(fails_saying([&] { return obj(square + "f 0 1 2"); }, "line 4", "\"0\"", "from 1"));
  EXPECT_TRUE(fails_saying([&] { return obj(square + "f 1 2 4"); }, "line 4", "\"4\""));
  EXPECT_TRUE(fails_saying([&] { return obj(square + "f 1 2 -4"); }, "line 4", "\"-4\""));
  EXPECT_TRUE(fails_saying([&] { return obj(square + "f 1 2x 3"); }, "line 4", "\"2x\""));
  EXPECT_TRUE(fails_saying([&] { return obj(square + "f 1 2"); }, "line 4", "three corners"));
  EXPECT_TRUE(fails_saying([] { return obj("v 1 2\n"); }, "line 1", "v X Y Z"));
  EXPECT_TRUE(fails_saying([] { return obj("v 1 2 inf\n"); }, "line 1", "not finite"));
  expect_defined_on_damage(obj, text);
}

// One Gaussian at (1.5, -2, 0.25), of deviations e^-4, e^-3, e^-2 and opacity 0.8, turned by 90
// degrees about x.
std::string one_gaussian(std::uint32_t version) {
  std::string bytes;
  put<std::uint32_t>(bytes, {0x5053474e, version, 1});
  put<std::uint8_t>(bytes, {0, 12, 0, 0});
  if (version == 1) {
    put<std::uint16_t>(bytes, {0x3e00, 0xc000, 0x3400});
  } else {
    put<std::uint8_t>(bytes, {0x00, 0x18, 0x00, 0x00, 0xe0, 0xff, 0x00, 0x04, 0x00});
  }
  put<std::uint8_t>(bytes, {204, 150, 128, 1, 96, 112, 128});
  // x = w = sqrt(1/2): x is left out, or w.
  if (version < 3) {
    put<std::uint8_t>(bytes, {218, 128, 127});
  } else {
    put<std::uint32_t>(bytes, {511});
  }
  return bytes;
}

// The arrays of version 4, each packed by zstd.
std::string packed_apart(const std::string& plain) {
  std::string table, packed;
  std::size_t at = 16;
  for (const std::size_t size : {9U, 1U, 3U, 3U, 4U}) {
    std::string one(ZSTD_compressBound(size), '\0');
    one.resize(ZSTD_compress(one.data(), one.size(), &plain[at], size, 1));
    put<std::uint64_t>(table, {one.size(), size});
    packed += one;
    at += size;
  }
  std::string header = plain.substr(0, 15) + '\5';
  put<std::uint32_t>(header, {32, 0, 0, 0});
  return header + table + packed;
}

TEST(BodyFiles, SpzIsReadInAllVersions) {
  for (const std::uint32_t version : {1U, 2U, 3U, 4U}) {
    SCOPED_TRACE(version);
    const auto pack = [&](const std::string& plain) {
      return version == 4 ? packed_apart(plain) : gzip(plain);
    };
    const std::string whole = pack(one_gaussian(version));
    const PointFile file = spz(whole);
    ASSERT_EQ(file.points.size(), 1U);
    EXPECT_EQ(file.points[0], Vec3(1.5, -2.0, 0.25));
    EXPECT_EQ(file.splat->log_scales[0], Vec3(-4.0, -3.0, -2.0));
    EXPECT_NEAR(file.splat->heads[0].x(), std::sqrt(0.5), 5e-3);
    EXPECT_NEAR(file.splat->heads[0].y(), std::log(4.0), 1e-9);
    EXPECT_NEAR((file.splat->rotations[0] - Vec3(std::sqrt(0.5), 0.0, 0.0)).norm(), 0.0, 8e-3);
    EXPECT_EQ(file.colours, (std::vector<std::uint8_t>{170, 128, 0}));
    for (std::size_t size = 0; size + 12 < whole.size(); ++size)
      EXPECT_TRUE(fails_saying([&] { return spz(whole.substr(0, size)); }, "test.spz")) << size;
    expect_defined_on_damage(spz, whole);
    std::string lying = one_gaussian(version);
    lying[10] = '\x7f';
    EXPECT_TRUE(fails_saying([&] { return spz(pack(lying)); }, "promises", "more than"));
  }
  EXPECT_TRUE(fails_saying([] { return spz(gzip(one_gaussian(5))); }, "version 5", "1 to 4"));
  EXPECT_TRUE(fails_saying([] { return spz(gzip(std::string(64, 'x'))); }, "no SPZ"));
  EXPECT_TRUE(fails_saying([] { return spz("PK"); }, "no gzip"));
  EXPECT_TRUE(fails_saying([] { return spz(one_gaussian(4)); }, "ends within"));
}

std::string glb(const std::string& text, const std::string& binary) {
  std::string bytes = "glTF";
  const auto size = [](const std::string& of) { return static_cast<std::uint32_t>(of.size()); };
  put<std::uint32_t>(bytes, {2, 28 + size(text) + size(binary), size(text), 0x4e4f534a});
  bytes += text;
  put<std::uint32_t>(bytes, {size(binary), 0x004e4942});
  return bytes + binary;
}

// A square of two triangles with 16-bit corners, by a node that turns it by 90 degrees about z and
// one below that moves it by 1 along x.
std::string square_of(const std::string& buffer, const std::string& more = "") {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
    "nodes":[{"children":[1],"rotation":[0,0,0.70710678118654752,0.70710678118654752]},
             {"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1,0,0,1]}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
                 {"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}],
    "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],
    "buffers":[{"byteLength":60)" +
         buffer + "}]" + more + "}";
}
std::string square_bytes() {
  std::string bytes;
  put<float>(bytes, {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
  put<std::uint16_t>(bytes, {0, 1, 2, 0, 2, 3});
  return bytes;
}
void expect_square(const PointFile& mesh) {
  ASSERT_EQ(mesh.points.size(), 4U);
  EXPECT_NEAR((mesh.points[0] - Vec3(0, 1, 0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((mesh.points[2] - Vec3(-1, 2, 0)).norm(), 0.0, 1e-12);
  EXPECT_EQ(mesh.triangles, (Triangles{{0, 1, 2}, {0, 2, 3}}));
}

TEST(BodyFiles, GltfHasItsBufferInsideOrBeside) {
  const std::string whole = glb(square_of(""), square_bytes());
  expect_square(gltf(whole));
  expect_square(gltf(square_of(R"(,"uri":"data:application/octet-stream;base64,)"
                               R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAA)"
                               R"(AAABAAIAAAACAAMA")")));
  const test::TemporaryFolder folder;
  folder.write("square.bin", square_bytes());
  const auto file = folder.write("square.gltf", square_of(R"(,"uri":"square.bin")"));
  expect_square(read_gltf(file, false));
  EXPECT_EQ(source_uri(file.string()), "map:" + file.string());
  // The format says metres, and y up: what it calls y is the world's z.
  const auto camera = open_source("map:" + file.string());
  EXPECT_TRUE(camera->info().assumed.empty());
  expect_defined_on_damage([](const std::string& bytes) { return gltf(bytes); }, whole);
}

TEST(BodyFiles, GltfSaysWhatIsWrong) {
  const auto with = [](std::string from, const std::string& to, const std::string& more = "") {
    std::string text = square_of("", more);
    text.replace(text.find(from), from.size(), to);
    return [bytes = glb(text, square_bytes())] { return gltf(bytes); };
  };
  EXPECT_TRUE(fails_saying(with("\"count\":4", "\"count\":5"), "accessor 0", "beyond its buffer"));
  EXPECT_TRUE(fails_saying(with("\"count\":4", "\"count\":3"), "corner that is not there"));
  EXPECT_TRUE(fails_saying(with("\"byteLength\":12", "\"byteLength\":-1"), "accessor 1"));
  EXPECT_TRUE(fails_saying(with("\"mesh\":0", "\"mesh\":0,\"children\":[0]"), "no tree"));
  EXPECT_TRUE(fails_saying(with("\"bufferView\":0,", ""), "accessor 0", "no data"));
  EXPECT_TRUE(fails_saying(with("\"mesh\":0", "\"mesh\":7"), "no glTF"));
  EXPECT_TRUE(
      fails_saying(with("2.0", "2.0", R"(,"extensionsRequired":["KHR_draco_mesh_compression"])"),
                   "KHR_draco_mesh_compression", "without compression"));
  EXPECT_TRUE(fails_saying([] { return gltf(square_of(R"(,"uri":"../a.bin")")); }, "beside"));
  EXPECT_TRUE(fails_saying([] { return gltf("{"); }, "no glTF"));
  EXPECT_TRUE(fails_saying([] { return gltf(glb("{}", "").substr(0, 18)); }, "no glTF"));
  EXPECT_TRUE(fails_saying([&] { return gltf(glb(square_of(""), square_bytes()), true); },
                           "no Gaussians", "map:"));
}

TEST(BodyFiles, GltfHasGaussiansAsRatified) {
  std::string bytes;
  put<float>(bytes, {1, 2, 3, 0.5F, 0.25F, 2, 0, 0, 0, 1});
  put<std::uint16_t>(bytes, {13107, 0});  // 0.2 of 65535
  put<float>(bytes, {0, 1, -5});          // colours
  const std::string text =
      R"({"nodes":[{"mesh":0,"scale":[2,2,2],"rotation":[0.70710678118654752,0,0,0.70710678118654752]}],
    "meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0,
      "KHR_gaussian_splatting:SCALE":1,"KHR_gaussian_splatting:ROTATION":2,
      "KHR_gaussian_splatting:OPACITY":3,"KHR_gaussian_splatting:SH_DEGREE_0_COEF_0":4},"extensions":{"KHR_gaussian_splatting":{}}}]}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":1,"type":"VEC3"},
      {"bufferView":0,"byteOffset":12,"componentType":5126,"count":1,"type":"VEC3"},
      {"bufferView":0,"byteOffset":24,"componentType":5126,"count":1,"type":"VEC4"},
      {"bufferView":0,"byteOffset":40,"componentType":5123,"normalized":true,"count":1,
       "type":"SCALAR"},
      {"bufferView":0,"byteOffset":44,"componentType":5126,"count":1,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":56}],"buffers":[{"byteLength":56}]})";
  const PointFile file = gltf(glb(text, bytes), true);
  ASSERT_EQ(file.points.size(), 1U);
  EXPECT_NEAR((file.points[0] - Vec3(2, -6, 4)).norm(), 0.0, 1e-9);
  EXPECT_NEAR((file.splat->log_scales[0] - Vec3(0.0, std::log(0.5), std::log(4.0))).norm(), 0,
              1e-9);
  EXPECT_NEAR(file.splat->heads[0].x(), std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(file.splat->heads[0].y(), std::log(0.25), 1e-6);
  EXPECT_NEAR(file.splat->rotations[0].x(), std::sqrt(0.5), 1e-9);
  EXPECT_EQ(file.colours, (std::vector<std::uint8_t>{128, 199, 0}));
  std::string uneven = text;
  uneven.replace(uneven.find("[2,2,2]"), 7, "[2,2,1]");
  EXPECT_TRUE(fails_saying([&] { return gltf(glb(uneven, bytes), true); }, "stretches"));
}

}  // namespace test_body_files
}  // namespace palpate
