// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <sstream>
#include <type_traits>

#include <lzf.h>

#include "palpate/io/sources/point_file.hpp"

#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/point_files.hpp"

namespace palpate {
namespace test_pcd {

using test::bytes_of;
using test::fails_saying;

PointFile parse(std::string_view text) { return test::parse(parse_pcd, text); }

constexpr std::array<const char*, 3> encodings{"ascii", "binary", "binary_compressed"};

std::string compressed(const std::string& data) {
  std::string packed(2 * data.size() + 16, '\0');
  packed.resize(lzf_compress(data.data(), static_cast<unsigned>(data.size()), packed.data(),
                             static_cast<unsigned>(packed.size())));
  return bytes_of(static_cast<std::uint32_t>(packed.size())) +
         bytes_of(static_cast<std::uint32_t>(data.size())) + packed;
}

// A header of `size` points with float fields x y z.
std::string header(const std::string& size, const std::string& encoding) {
  return "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + size +
         "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + size + "\nDATA " + encoding + "\n";
}

// Three points with 16-bit values around their float coordinates, in every encoding.
std::string valid_file(const std::string& encoding) {
  const std::array<std::array<float, 3>, 3> points{{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}};
  std::string text =
      "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS a z _ x y\n"
      "SIZE 2 4 1 4 4\nTYPE U F U F F\nCOUNT 1 1 3 1 1\nWIDTH 3\nHEIGHT 1\n"
      "VIEWPOINT 0.5 0.25 0.125 1 0 0 0\nPOINTS 3\nDATA " +
      encoding + "\n";
  std::string a, x, y, z, interleaved;
  for (const auto& p : points) {
    a += bytes_of(std::uint16_t{7});
    x += bytes_of(p[0]);
    y += bytes_of(p[1]);
    z += bytes_of(p[2]);
    interleaved +=
        bytes_of(std::uint16_t{7}) + bytes_of(p[2]) + "___" + bytes_of(p[0]) + bytes_of(p[1]);
    if (encoding == "ascii") {
      text += "7 " + std::to_string(p[2]) + " 0 0 0 " + std::to_string(p[0]) + " " +
              std::to_string(p[1]) + "\n";
    }
  }
  if (encoding == "binary") {
    text += interleaved;
  } else if (encoding == "binary_compressed") {
    text += compressed(a + z + std::string(9, '_') + x + y);
  }
  return text;
}

TEST(Pcd, GivesThePackedColoursInEveryEncoding) {
  constexpr std::uint32_t packed = 0x80102030;  // alpha, red, green, blue
  constexpr std::uint32_t other = 0x00ffee01;
  for (const std::string encoding : encodings) {
    for (const std::string type : {"U", "I", "F"}) {
      std::string text = "FIELDS x rgb y z\nSIZE 4 4 4 4\nTYPE F " + type +
                         " F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA " + encoding + "\n";
      std::string data;
      for (const std::uint32_t colour : {packed, other}) {
        if (encoding == "ascii") {
          std::ostringstream written;
          written.precision(9);
          if (type == "F") written << std::bit_cast<float>(colour);
          if (type == "I") written << std::bit_cast<std::int32_t>(colour);
          if (type == "U") written << colour;
          data += "1 " + written.str() + " 2 3\n";
        } else if (encoding == "binary") {
          data += bytes_of(1.0F) + bytes_of(colour) + bytes_of(2.0F) + bytes_of(3.0F);
        }
      }
      const auto twice = [](float value) { return bytes_of(value) + bytes_of(value); };
      if (encoding == "binary_compressed")
        data = compressed(twice(1) + bytes_of(packed) + bytes_of(other) + twice(2) + twice(3));
      const PointFile cloud = parse(text + data);
      EXPECT_EQ(cloud.colours, (std::vector<std::uint8_t>{0x10, 0x20, 0x30, 0xff, 0xee, 0x01}))
          << encoding << ' ' << type;
      EXPECT_EQ(cloud.points[1], Vec3(1, 2, 3));
    }
  }
  EXPECT_TRUE(parse(valid_file("ascii")).colours.empty());
  const PointFile odd = parse(
      "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nPOINTS 2\nDATA ascii\n"
      "1 2 3 none\n1 2 3 1e300\n");
  EXPECT_EQ(odd.colours, std::vector<std::uint8_t>(6, 0)) << "black where it is no number";
}

template <class T>
class PcdOfType : public testing::Test {};
using Types = testing::Types<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t, std::int32_t,
                             std::uint32_t, std::int64_t, std::uint64_t, float, double>;
TYPED_TEST_SUITE(PcdOfType, Types);

TYPED_TEST(PcdOfType, GivesBackTheCoordinatesThatWereWrittenInEveryEncoding) {
  using T = TypeParam;
  const std::string type = std::is_floating_point_v<T> ? "F" : std::is_signed_v<T> ? "I" : "U";
  const std::string size = std::to_string(sizeof(T));
  const auto coordinate = [](int k, int axis) {
    const int value = std::is_signed_v<T> ? 10 * axis - 7 * k : 10 * axis + 7 * k;
    return static_cast<T>(value);
  };
  constexpr int count = 12;
  std::string ascii, binary, columns;
  for (int k = 0; k < count; ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      const T value = coordinate(k, axis);
      ascii += std::to_string(+value) + (axis == 2 ? "\n" : " ");
      binary += bytes_of(value);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (int k = 0; k < count; ++k) {
      columns += bytes_of(coordinate(k, axis));
    }
  }
  const std::string head = "VERSION .7\nFIELDS x y z\nSIZE " + size + " " + size + " " + size +
                           "\nTYPE " + type + " " + type + " " + type +
                           "\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 3\nPOINTS 12\nDATA ";
  const std::array files{head + "ascii\n" + ascii, head + "binary\n" + binary,
                         head + "binary_compressed\n" + compressed(columns)};
  for (std::size_t i = 0; i < files.size(); ++i) {
    const PointFile cloud = parse(files[i]);
    EXPECT_EQ(cloud.encoding, encodings[i]);
    EXPECT_EQ(cloud.width, 4u);
    EXPECT_EQ(cloud.height, 3u);
    ASSERT_EQ(cloud.points.size(), 12u);
    for (int k = 0; k < count; ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(cloud.points[k][axis], static_cast<double>(coordinate(k, axis)));
      }
    }
  }
}

TEST(Pcd, SaysOfWhatItsPaddingIs) {
  const PointFile cloud = parse(valid_file("binary"));
  EXPECT_EQ(cloud.fields[2].name, "_");
  EXPECT_EQ(cloud.fields[2].count, 3U);
  EXPECT_EQ(cloud.fields[4].type, "float32");
}

TEST(Pcd, AcceptsCompressedDataWithoutThePaddingThatItsHeaderDeclares) {
  const std::string with = valid_file("binary_compressed");
  const std::string head = with.substr(0, with.find("compressed\n") + 11);
  const std::string data = std::string(6, 'a') + bytes_of(3.f) + bytes_of(6.f) + bytes_of(9.f) +
                           bytes_of(1.f) + bytes_of(4.f) + bytes_of(7.f) + bytes_of(2.f) +
                           bytes_of(5.f) + bytes_of(8.f);
  EXPECT_EQ(parse(head + compressed(data)).points[1], Vec3(4, 5, 6));
  EXPECT_TRUE(fails_saying([&] { return parse(head + compressed(data + "?")); }, "test file",
                           "3 points", "43 bytes"));
}

TEST(Pcd, KeepsTheHolesOfAnOrganisedCloudAndCountsThem) {
  const PointFile cloud = parse(
      "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA ascii\n"
      "1 2 3\nnan nan nan\n1 -inf 3\n+4 5e0 6.\n");
  ASSERT_EQ(cloud.points.size(), 4u);
  EXPECT_EQ(cloud.non_finite, 2u);
  EXPECT_TRUE(std::isnan(cloud.points[1].x()));
  EXPECT_EQ(cloud.points[2].y(), -std::numeric_limits<double>::infinity());
  EXPECT_EQ(cloud.points[3], Vec3(4, 5, 6));
}

TEST(Pcd, AcceptsTheSparseHeadersOfOldFiles) {
  EXPECT_FALSE(parse("FIELDS x y z\nPOINTS 0\nDATA ascii\n").viewpoint.has_value());
  EXPECT_EQ(parse("COLUMNS x y z\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6").points[1], Vec3(4, 5, 6));
  EXPECT_EQ(parse("# .PCD v.5\n\nVERSION .5\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\n"
                  "DATA ascii\n1 2 3\n")
                .points[0],
            Vec3(1, 2, 3));
}

TEST(Pcd, AcceptsLinesThatEndInCarriageReturnToo) {
  std::string ascii = "VERSION 0.7\nFIELDS x y z\nPOINTS 2\nDATA ascii\n1 2 3\n\n4 5 6\n";
  std::string crlf;
  for (const char c : ascii) {
    crlf += c == '\n' ? "\r\n" : std::string(1, c);
  }
  EXPECT_EQ(parse(crlf).points[1], Vec3(4, 5, 6));
  const std::string binary = "FIELDS x y z\r\nPOINTS 1\r\nDATA binary\r\n";
  EXPECT_EQ(parse(binary + bytes_of(1.f) + bytes_of(2.f) + bytes_of(3.f)).points[0], Vec3(1, 2, 3));
}

TEST(Pcd, TakesACloudWithoutPointsForWhatItIs) {
  for (const std::string encoding : encodings) {
    const PointFile cloud =
        parse(header("0", encoding) +
              (encoding == "binary_compressed" ? std::string(8, '\0') : std::string()));
    EXPECT_TRUE(cloud.points.empty());
    EXPECT_EQ(cloud.non_finite, 0u);
  }
}

TEST(Pcd, RejectsAHeaderThatPromisesMoreThanTheFileHolds) {
  for (const std::string encoding : {"ascii", "binary"}) {
    EXPECT_TRUE(
        fails_saying([&] { return parse(header("1000000000000", encoding) + "1 2 3 4 5 6\n"); },
                     "test file", "promises 1000000000000 points", "12 bytes"));
  }
  EXPECT_TRUE(fails_saying(
      [] { return parse(header("1000000000000", "binary_compressed") + compressed("abcabc")); },
      "1000000000000 points", "6 bytes"));
  const std::string head = header("100000000", "binary_compressed");
  EXPECT_TRUE(fails_saying(
      [&] {
        return parse(head + bytes_of(std::uint32_t{4}) + bytes_of(std::uint32_t{1'200'000'000}) +
                     "\x01zz?");
      },
      "cannot hold 1200000000"));
  EXPECT_TRUE(fails_saying(
      [] {
        return parse("FIELDS x y z\nWIDTH 4294967296\nHEIGHT 4294967296\nPOINTS 0\nDATA ascii\n");
      },
      "WIDTH times HEIGHT"));
  EXPECT_TRUE(fails_saying(
      [] {
        return parse(
            "FIELDS x y z a\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 1000000\n"
            "POINTS 18446744073709551615\nDATA binary\n1234");
      },
      "promises 18446744073709551615 points"));
}

TEST(Pcd, RejectsCompressedDataThatIsNotLzf) {
  const std::string head = header("1", "binary_compressed");
  const auto file = [&](std::uint32_t packed, std::uint32_t size, const std::string& data) {
    return head + bytes_of(packed) + bytes_of(size) + data;
  };
  EXPECT_TRUE(fails_saying([&] { return parse(file(9, 12, "12345678")); }, "promises 9 bytes"));
  EXPECT_TRUE(fails_saying([&] { return parse(file(0, 12, "")); }, "cannot hold 12"));
  // A back reference to before the beginning, runs past either end, an early end.
  EXPECT_TRUE(fails_saying([&] { return parse(file(3, 12, "\xe0\x03\x05")); }, "corrupt"));
  EXPECT_TRUE(fails_saying([&] { return parse(file(3, 12, "\x1f??")); }, "corrupt"));
  EXPECT_TRUE(fails_saying([&] { return parse(file(3, 12, "\x0b??")); }, "corrupt"));
  EXPECT_TRUE(fails_saying([&] { return parse(file(3, 12, "\x01??")); }, "corrupt"));
}

TEST(Pcd, SaysWhatIsWrongWithAHeader) {
  const std::string good = header("1", "ascii") + "1 2 3\n";
  const std::array refusals{
      test::Refusal{"VERSION 0.7", "VERSION .4", "PCD version \".4\""},
      test::Refusal{"VERSION 0.7", "VERSION", "VERSION has 0 values"},
      test::Refusal{"FIELDS x y z", "FIELDS x y", "SIZE has 3 values for 2 fields"},
      test::Refusal{"FIELDS x y z", "FIELDS x y w", "FIELDS must name z"},
      test::Refusal{"FIELDS x y z", "FIELDS x x z", "FIELDS must name x"},
      test::Refusal{"FIELDS x y z\n", "", "no FIELDS"},
      test::Refusal{"SIZE 4 4 4", "SIZE 4 4 3", R"(TYPE "F" and SIZE "3")"},
      test::Refusal{"SIZE 4 4 4", "SIZE 4 4 2", R"(TYPE "F" and SIZE "2")"},
      test::Refusal{"SIZE 4 4 4\n", "", "one of SIZE and TYPE"},
      test::Refusal{"TYPE F F F", "TYPE F F G", "TYPE \"G\""},
      test::Refusal{"COUNT 1 1 1", "COUNT 1 1 0", "COUNT \"0\""},
      test::Refusal{"COUNT 1 1 1", "COUNT 1 1 -1", "COUNT \"-1\""},
      test::Refusal{"COUNT 1 1 1", "COUNT 1 1 2000000", "COUNT \"2000000\""},
      test::Refusal{"COUNT 1 1 1", "COUNT 1 1 2", "FIELDS must name z once, with COUNT 1"},
      test::Refusal{"WIDTH 1", "WIDTH one", "WIDTH is \"one\""},
      test::Refusal{"WIDTH 1", "WIDTH 2", "WIDTH 2 times HEIGHT 1 is not POINTS 1"},
      test::Refusal{"WIDTH 1\nHEIGHT 1\n", "HEIGHT 2\n", "no WIDTH"},
      test::Refusal{"POINTS 1", "POINTS -1", "POINTS is \"-1\""},
      test::Refusal{"POINTS 1", "POINTS 99999999999999999999", "POINTS is \"999"},
      test::Refusal{"VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0", "VIEWPOINT is not seven"},
      test::Refusal{"VIEWPOINT 0", "VIEWPOINT nan", "VIEWPOINT is not seven"},
      test::Refusal{"HEIGHT 1", "HEIGHT 1\nHEIGHT 1", "line 8: HEIGHT is given twice"},
      test::Refusal{"HEIGHT 1", "DEPTH 1",
                    "line 7: \"DEPTH\" does not begin a line of a PCD header"},
      test::Refusal{"DATA ascii\n", "", "line 10: \"1\" does not begin"},
      test::Refusal{"DATA ascii\n1 2 3\n", "", "no DATA line"},
      test::Refusal{"DATA ascii", "DATA text", "DATA \"text\""},
  };
  test::expect_refusals(parse_pcd, good, refusals);
  EXPECT_TRUE(fails_saying([] { return parse(""); }, "no DATA line"));
  EXPECT_TRUE(fails_saying([] { return parse(std::string(5000, '\xff')); }, "line 1"));
}

TEST(Pcd, SaysInWhichLineOfTheDataItFailed) {
  const std::string head = header("2", "ascii");
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1.0 2.0 3.0\n4.0 5.0\n"); },
                           "line 12: has too few values"));
  EXPECT_TRUE(
      fails_saying([&] { return parse(head + "1 2 3 4\n4 5 6\n"); }, "line 11: has too many"));
  EXPECT_TRUE(
      fails_saying([&] { return parse(head + "1 2 3\n\n4 o 6\n"); }, "line 13: y is \"o\""));
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1 2 1e999\n4 5 6\n"); }, "z is \"1e999\""));
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1 2 3\n        "); }, "after 1 of 2 points"));
}

using test::PointFiles;
INSTANTIATE_TEST_SUITE_P(Pcd, PointFiles,
                         testing::Values(test::PointFormat{"pcd", parse_pcd, read_pcd, encodings,
                                                           valid_file, " "}));

}  // namespace test_pcd
}  // namespace palpate
