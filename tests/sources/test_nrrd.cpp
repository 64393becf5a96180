// SPDX-License-Identifier: Apache-2.0
// Volumes as map: reads them: where the surface is, what is unseen, what is wrong with a file.
#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/gzip.hpp"
#include "tests/support/point_file_rules.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_nrrd {

using test::fails_saying;
using test::gzip;

constexpr int side = 24;            // [voxels]
constexpr double step = 4e-3;       // [m]
constexpr double radius = 0.03;     // [m] of the ball in the middle
const Vec3 first(-0.05, 0.1, 0.0);  // [m] the first voxel
const Vec3 middle = first + 0.5 * step * (side - 1) * Vec3::Ones();

template <class T>
std::string voxels(const std::function<double(const Vec3&)>& value,
                   std::endian order = std::endian::native) {
  std::string bytes;
  for (int z = 0; z < side; ++z) {
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        const auto one = static_cast<T>(value(first + step * Vec3(x, y, z)));
        std::string text(reinterpret_cast<const char*>(&one), sizeof one);
        if (order != std::endian::native) std::reverse(text.begin(), text.end());
        bytes += text;
      }
    }
  }
  return bytes;
}
double to_ball(const Vec3& at) { return (at - middle).norm() - radius; }
std::string header(const std::string& type, const std::string& more = "encoding: raw\n") {
  return "NRRD0005\n# made by a test\ntype: " + type +
         "\ndimension: 3\nspace: left-posterior-superior\nsizes: 24 24 24\n"
         "space directions: (0.004,0,0) (0,0.004,0) (0,0,0.004)\nspace origin: (-0.05, 0.1, 0)\n"
         "kinds: domain domain domain\nendian: little\n" +
         more;
}
PointFile nrrd(const std::string& bytes, double level = 0.0) {
  return parse_nrrd(std::as_bytes(std::span(bytes)), "test.nrrd", "/nowhere", level);
}
std::string ball() { return header("float") + "\n" + voxels<float>(to_ball); }

TEST(Nrrd, ABallIsClosedAndWhereItIs) {
  const PointFile mesh = nrrd(ball());
  double worst = 0.0;  // [m]
  for (const Vec3& point : mesh.points) worst = std::max(worst, std::abs(to_ball(point)));
  EXPECT_LT(worst, 2e-4) << "4 mm voxels";
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> sides;
  double volume = 0.0;  // [m^3]
  for (const auto& t : mesh.triangles) {
    for (std::size_t i = 0; i < 3; ++i) ++sides[{t[i], t[(i + 1) % 3]}];
    volume += (mesh.points[t[0]] - middle)
                  .dot((mesh.points[t[1]] - middle).cross(mesh.points[t[2]] - middle)) /
              6.0;
  }
  for (const auto& [edge, count] : sides) {
    ASSERT_EQ(count, 1);
    ASSERT_TRUE(sides.contains({edge.second, edge.first}));
  }
  EXPECT_NEAR(volume / (4.0 / 3.0 * 3.14159265 * std::pow(radius, 3)), 0.98, 0.01)
      << "faces look outwards";
}

TEST(Nrrd, AllTypesOrdersAndEncodingsAreTheSame) {
  const PointFile whole = nrrd(ball());
  const auto expect_alike = [&](const PointFile& mesh, double within) {
    ASSERT_EQ(mesh.triangles, whole.triangles);
    for (std::size_t i = 0; i < mesh.points.size(); ++i)
      ASSERT_LT((mesh.points[i] - whole.points[i]).norm(), within);
  };
  const auto scaled = [](double by, double add = 0.0) {
    return [by, add](const Vec3& at) { return std::floor(by * to_ball(at)) + add; };
  };
  expect_alike(nrrd(header("double", "encoding: gzip\n") + "\n" + gzip(voxels<double>(to_ball))),
               1e-8);
  std::string big = header("float") + "\n" + voxels<float>(to_ball, std::endian::big);
  big.replace(big.find("little"), 6, "big");
  expect_alike(nrrd(big), 1e-15);
  expect_alike(nrrd(header("short") + "\n" + voxels<std::int16_t>(scaled(1e5))), 1e-4);
  expect_alike(nrrd(header("signed int") + "\n" + voxels<std::int32_t>(scaled(1e8))), 1e-6);
  expect_alike(
      nrrd(header("unsigned short int") + "\n" + voxels<std::uint16_t>(scaled(1e5, 20'000.0)),
           20'000.0),
      1e-4);
  expect_alike(nrrd(header("uint8_t") + "\n" + voxels<std::uint8_t>(scaled(1e3, 100.0)), 100.0),
               2e-3);
  const auto spaced = header("float", "encoding: raw\nspacings: 0.002 0.004 0.004\n") + "\n" +
                      voxels<float>(to_ball);
  EXPECT_NEAR(nrrd(spaced).points[0].x() - first.x(), 0.5 * (whole.points[0].x() - first.x()),
              1e-12);
}

// Of a floor at the middle's height, cut off at three voxels; a part of it nobody has seen.
TEST(Nrrd, NoSurfaceIsBetweenUnseenAndInside) {
  const double end = 3.0 * step;
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  for (const double unseen : {end, -end, nothing}) {
    SCOPED_TRACE(unseen);
    const PointFile mesh = nrrd(header("float") + "\n" + voxels<float>([&](const Vec3& at) {
                                  if (at.x() > middle.x()) return unseen;
                                  return std::clamp(at.z() - middle.z(), -end, end);
                                }));
    ASSERT_GT(mesh.triangles.size(), 200U);
    for (const Vec3& point : mesh.points) {
      EXPECT_NEAR(point.z(), middle.z(), 1e-8) << "no wall at the border";
      EXPECT_LT(point.x(), middle.x() + step);
    }
  }
  // A mask has no end.
  const auto mask = [](const Vec3& at) { return to_ball(at) < 0.0 ? 1.0 : 0.0; };
  EXPECT_GT(nrrd(header("uchar") + "\n" + voxels<std::uint8_t>(mask), 0.5).triangles.size(), 500U);
}

TEST(Nrrd, IsOpenedFromOneFileOrTwo) {
  const test::TemporaryFolder folder;
  const auto file = folder.write("ball.nrrd", ball());
  EXPECT_EQ(source_uri(file.string()), "map:" + file.string());
  folder.write("ball.raw", voxels<float>(to_ball));
  const auto two =
      folder.write("ball.nhdr", header("float", "encoding: raw\ndata file: ball.raw\n"));
  for (const std::string& uri : {file.string(), two.string()}) {
    const auto camera = open_source("map:" + uri + "?scale=100cm&level=0.01");
    EXPECT_NE(camera->info().kind.find("surface of a volume"), std::string::npos);
    camera->follow(middle + Vec3(0.0, 0.0, 0.06));
    const auto image = camera->next()->cloud;
    const auto top = image->image()->deproject(48, 48);
    ASSERT_TRUE(top);
    EXPECT_NEAR(top->z(), middle.z() + radius + 0.01, 5e-4);
  }
  EXPECT_TRUE(fails_saying([&] { open_source("map:" + file.string() + "?level=0.5"); }, "ball.nrrd",
                           "do not pass 0.5", "?level="));
  const auto part = folder.write("part.ply", "ply\n");
  EXPECT_TRUE(fails_saying([&] { open_source("map:" + part.string() + "?level=1"); }, "level"));
}

TEST(Nrrd, SaysWhatIsWrong) {
  const std::string whole = ball();
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = whole;
    text.replace(text.find(from), from.size(), to);
    return [text] { return nrrd(text); };
  };
  EXPECT_TRUE(fails_saying(with("NRRD", "NRRB"), "test.nrrd", "no NRRD", "FILE.nrrd"));
  EXPECT_TRUE(fails_saying(with("type: float", "type: block"), "line 3", "block", "raw or gzip"));
  EXPECT_TRUE(fails_saying(with("dimension: 3", "dimension: 4"), "\"4\"", "3 axes"));
  EXPECT_TRUE(fails_saying(with("24 24 24", "24 24"), "line 6", "3 numbers"));
  EXPECT_TRUE(fails_saying(with("24 24 24", "24 24 1"), "2 to 1048576 voxels"));
  EXPECT_TRUE(fails_saying(with("24 24 24", "24 24 2.5"), "voxels"));
  EXPECT_TRUE(fails_saying(with("24 24 24", "1048576 1048576 1048576"), "promises", "can hold"));
  EXPECT_TRUE(fails_saying(with("24 24 24", "24 24 25"), "promises 57600", "55296", "copy"));
  EXPECT_TRUE(fails_saying(with("encoding: raw", "encoding: hex"), "raw and gzip"));
  EXPECT_TRUE(fails_saying(with("encoding: raw", "encoding: gzip"), "no gzip"));
  EXPECT_TRUE(fails_saying(with("(0,0.004,0)", "none"), "9 numbers"));
  EXPECT_TRUE(fails_saying(with("(0,0.004,0)", "(0.008,0,0)"), "do not span", "spacings"));
  EXPECT_TRUE(fails_saying(with("kinds: domain domain domain", "byte skip: 7"), "byte skip"));
  EXPECT_TRUE(fails_saying(with("kinds: domain domain domain", "data file: /etc/passwd"),
                           "/etc/passwd", "beside"));
  EXPECT_TRUE(fails_saying(with("type: float\n", ""), "lacks 'type'"));
  const std::string packed =
      header("float", "encoding: gz\n") + "\n" + gzip(voxels<float>(to_ball));
  EXPECT_TRUE(fails_saying([&] { nrrd(packed.substr(0, packed.size() - 900)); }, "too early"));
  std::string longer = packed;
  longer.replace(longer.find("24 24 24"), 8, "24 24 26");
  EXPECT_TRUE(fails_saying([&] { nrrd(longer); }, "ends within its voxels"));
  longer.replace(longer.find("24 24 26"), 8, "24 24 23");
  EXPECT_TRUE(fails_saying([&] { nrrd(longer); }, "more than 52992 bytes"));
  std::mt19937 random(1);
  for (int run = 0; run < 500; ++run) {
    std::string bytes = run % 2 == 0 ? packed : whole.substr(0, random() % 1000);
    for (unsigned i = 1 + random() % 4; i-- > 0 && !bytes.empty();)
      bytes[random() % std::min<std::size_t>(bytes.size(), 400)] = static_cast<char>(random());
    try {
      EXPECT_TRUE(test::is_consistent(nrrd(bytes), bytes.size()));
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find_first_of("\r\n"), std::string::npos);
    }
  }
}

}  // namespace test_nrrd
}  // namespace palpate
