// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <sstream>
#include <type_traits>

#include <lzf.h>

#include "palpate/sources/point_file.hpp"

#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/point_files.hpp"

namespace palpate {
namespace test_pcd {

using test::bytes_of;
using test::fails_saying;
using test::Rejected;

PointFile parse(std::string_view text) {
  return test::parse(parse_pcd, text);
}

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

TEST(Pcd, FindsItsFieldsInAnyOrderBetweenOthersOfAnySize) {
  for (const char* encoding : encodings) {
    const PointFile cloud = parse(valid_file(encoding));
    ASSERT_EQ(cloud.points.size(), 3u) << encoding;
    EXPECT_EQ(cloud.points[0], Vec3(1, 2, 3)) << encoding;
    EXPECT_EQ(cloud.points[1], Vec3(4, 5, 6)) << encoding;
    EXPECT_EQ(cloud.points[2], Vec3(7, 8, 9)) << encoding;
    ASSERT_EQ(cloud.fields.size(), 5u);
    EXPECT_EQ(cloud.fields[0].name, "a");
    EXPECT_EQ(cloud.fields[0].type, "uint16");
    EXPECT_EQ(cloud.fields[2].name, "_");
    EXPECT_EQ(cloud.fields[2].count, 3u);
    EXPECT_EQ(cloud.fields[4].type, "float32");
  }
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

TEST(Pcd, RemembersFromWhereThePointsWereSeenWithoutMovingThem) {
  const PointFile cloud = parse(valid_file("binary"));
  ASSERT_TRUE(cloud.viewpoint.has_value());
  EXPECT_EQ(*cloud.viewpoint, Vec3(0.5, 0.25, 0.125));
  EXPECT_EQ(cloud.points[0], Vec3(1, 2, 3));
  EXPECT_FALSE(parse("FIELDS x y z\nPOINTS 0\nDATA ascii\n").viewpoint.has_value());
}

TEST(Pcd, AcceptsTheSparseHeadersOfOldFiles) {
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

TEST(Pcd, TellsOfBytesThatItsHeaderDoesNotAccountFor) {
  EXPECT_EQ(parse(valid_file("ascii") + "\n \r\n").bytes_unread, 0u);
  EXPECT_EQ(parse(valid_file("ascii") + "\n1 2 3\n").bytes_unread, 6u);
  EXPECT_EQ(parse(valid_file("binary") + std::string(100, '\0')).bytes_unread, 100u);
  EXPECT_EQ(parse(valid_file("binary_compressed") + std::string(9, '\0')).bytes_unread, 9u);
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
  ASSERT_EQ(parse(good).points.size(), 1u);
  struct Case {
    std::string from, to, says;
  };
  const std::array cases{
      Case{"VERSION 0.7", "VERSION .4", "PCD version \".4\""},
      Case{"VERSION 0.7", "VERSION", "VERSION has 0 values"},
      Case{"FIELDS x y z", "FIELDS x y", "SIZE has 3 values for 2 fields"},
      Case{"FIELDS x y z", "FIELDS x y w", "FIELDS must name z"},
      Case{"FIELDS x y z", "FIELDS x x z", "FIELDS must name x"},
      Case{"FIELDS x y z\n", "", "no FIELDS"},
      Case{"SIZE 4 4 4", "SIZE 4 4 3", R"(TYPE "F" and SIZE "3")"},
      Case{"SIZE 4 4 4", "SIZE 4 4 2", R"(TYPE "F" and SIZE "2")"},
      Case{"SIZE 4 4 4\n", "", "one of SIZE and TYPE"},
      Case{"TYPE F F F", "TYPE F F G", "TYPE \"G\""},
      Case{"COUNT 1 1 1", "COUNT 1 1 0", "COUNT \"0\""},
      Case{"COUNT 1 1 1", "COUNT 1 1 -1", "COUNT \"-1\""},
      Case{"COUNT 1 1 1", "COUNT 1 1 2000000", "COUNT \"2000000\""},
      Case{"COUNT 1 1 1", "COUNT 1 1 2", "FIELDS must name z once, with COUNT 1"},
      Case{"WIDTH 1", "WIDTH one", "WIDTH is \"one\""},
      Case{"WIDTH 1", "WIDTH 2", "WIDTH 2 times HEIGHT 1 is not POINTS 1"},
      Case{"WIDTH 1\nHEIGHT 1\n", "HEIGHT 2\n", "no WIDTH"},
      Case{"POINTS 1", "POINTS -1", "POINTS is \"-1\""},
      Case{"POINTS 1", "POINTS 99999999999999999999", "POINTS is \"999"},
      Case{"VIEWPOINT 0 0 0 1 0 0 0", "VIEWPOINT 0 0 0", "VIEWPOINT is not seven"},
      Case{"VIEWPOINT 0", "VIEWPOINT nan", "VIEWPOINT is not seven"},
      Case{"HEIGHT 1", "HEIGHT 1\nHEIGHT 1", "line 8: HEIGHT is given twice"},
      Case{"HEIGHT 1", "DEPTH 1", "line 7: \"DEPTH\" does not begin a line of a PCD header"},
      Case{"DATA ascii\n", "", "line 10: \"1\" does not begin"},
      Case{"DATA ascii\n1 2 3\n", "", "no DATA line"},
      Case{"DATA ascii", "DATA text", "DATA \"text\""},
  };
  for (const Case& c : cases) {
    std::string bad = good;
    const std::size_t at = bad.find(c.from);
    ASSERT_NE(at, std::string::npos) << c.from;
    bad.replace(at, c.from.size(), c.to);
    EXPECT_TRUE(fails_saying([&] { return parse(bad); }, "test file: ", c.says, "; "));
  }
  EXPECT_TRUE(fails_saying([] { return parse(""); }, "no DATA line"));
  EXPECT_TRUE(fails_saying([] { return parse(std::string(5000, '\xff')); }, "line 1"));
}

TEST(Pcd, SaysInWhichLineOfTheDataItFailed) {
  const std::string head = header("2", "ascii");
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1.0 2.0 3.0\n4.0 5.0\n"); },
                           "line 12: has 2 values"));
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1 2 3 4\n4 5 6\n"); }, "line 11: has more"));
  EXPECT_TRUE(
      fails_saying([&] { return parse(head + "1 2 3\n\n4 o 6\n"); }, "line 13: y is \"o\""));
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1 2 1e999\n4 5 6\n"); }, "z is \"1e999\""));
  EXPECT_TRUE(fails_saying([&] { return parse(head + "1 2 3\n        "); }, "after 1 of 2 points"));
}

TEST(Pcd, FailsCleanlyWhereverAFileIsCutShort) {
  for (const std::string encoding : encodings) {
    const std::string whole = valid_file(encoding);
    // What is left of an ascii file may still be a number where its last one ends sooner.
    const std::size_t last = encoding == "ascii" ? whole.rfind(' ') + 1 : whole.size() - 1;
    test::expect_errors_when_cut_short(parse_pcd, whole, last);
  }
}

TEST(Pcd, DoesSomethingDefinedWithDamagedFiles) {
  for (const char* encoding : encodings) {
    test::expect_defined_on_damage(parse_pcd, valid_file(encoding), 3000);
  }
}

TEST(Pcd, SaysWhichFileCannotBeRead) {
  const test::TemporaryFolder folder;
  EXPECT_TRUE(fails_saying([&] { return read_pcd(folder.path() / "no.pcd"); }, "no.pcd: no such"));
  EXPECT_TRUE(fails_saying([&] { return read_pcd(folder.path()); }, "not a file"));
  EXPECT_TRUE(fails_saying([&] { return read_pcd(folder.write("empty.pcd", "")); }, "empty.pcd"));
  EXPECT_EQ(read_pcd(folder.write("good.pcd", valid_file("binary"))).points[2], Vec3(7, 8, 9));
}

// What each file of the shared collection holds, as counted and averaged by an independent reader.
struct Expected {
  const char* file;
  std::size_t width, height, non_finite;
  Vec3 mean;
};

void expect(const std::filesystem::path& folder, const Expected& expected) {
  SCOPED_TRACE(expected.file);
  const PointFile cloud = read_pcd(folder / expected.file);
  EXPECT_EQ(cloud.width, expected.width);
  EXPECT_EQ(cloud.height, expected.height);
  EXPECT_EQ(cloud.points.size(), expected.width * expected.height);
  EXPECT_EQ(cloud.non_finite, expected.non_finite);
  EXPECT_LT((test::mean_of(cloud) - expected.mean).norm(), 1e-6 * (1.0 + expected.mean.norm()));
}

TEST(Pcd, ReadsWhatOtherParsersReadAndRejectsWhatTheyReject) {
  PALPATE_DATA_OR_SKIP(folder, "formats/pcd");
  const std::array accepted{
      Expected{
          "data__object_template_0.pcd", 1397, 1, 0, {-0.106276255, 0.0947920007, 0.734193853}},
      Expected{"nebula__ascii_xyz.pcd", 2, 1, 0, {-1.5, 1.4375, 4.875}},
      Expected{"nebula__binary_xyz_pcl.pcd", 2, 1, 0, {-4.375, 11.25, 13.125}},
      Expected{"pcd-rs__ascii.pcd", 213, 1, 0, {0.00906073761, 0.15169854, 0}},
      Expected{"pcd-rs__binary.pcd", 1809, 16, 0, {3.70952449, 0.360627189, 0.128251944}},
      Expected{"pcd-rs__empty_compressed.pcd", 0, 1, 0, {0, 0, 0}},
      Expected{"pcd-rs__empty_compressed_debug.pcd", 0, 1, 0, {0, 0, 0}},
      Expected{"pcd-rs__highly_compressed.pcd", 1000, 1, 0, {1, 1, 1}},
      Expected{"pcd-rs__highly_uncompressed.pcd", 1000, 1, 0, {1, 1, 1}},
      Expected{"pcd-rs__large_compressed.pcd", 10000, 1, 0, {55.5614372, 166.650409, 277.738968}},
      Expected{"pcd-rs__output_binary.pcd", 3, 1, 0, {4, 5, 6}},
      Expected{"pcd-rs__output_compressed.pcd", 3, 1, 0, {2, 3.16666667, 4.6}},
      Expected{"pcd-rs__single_compressed.pcd", 1, 1, 0, {1, 2, 3}},
      Expected{"pcd-rs__test_v05_ascii.pcd", 2, 1, 0, {2.5, 3.5, 4.5}},
      Expected{"pcd-rs__test_v06_binary.pcd", 1, 1, 0, {1.5, 2.5, 3.5}},
      Expected{"pcl__brisk_keypoints_gt.pcd", 1860, 1, 0, {288.0071, 291.858877, 0}},
      Expected{"pcl__bunny.pcd", 397, 1, 0, {-0.0290809446, 0.102652652, 0.0273019573}},
      Expected{"pcl__colored_cloud.pcd", 1, 1000, 0, {-0.21851276, -0.513777244, 1.21010301}},
      Expected{"pcl__curve_close.pcd", 110, 1, 0, {0.468184734, 0.5, 0}},
      Expected{"pcl__octants.pcd", 8, 1, 0, {-0.125, -6, -6}},
  };
  const std::array rejected{
      Rejected{"pcd-rs__corrupt_compressed.pcd", "promises 100 bytes"},
      Rejected{"pcd-rs__mixed_types_compressed.pcd", "FIELDS must name z"},
      Rejected{"pcd-rs__test_unsupported_version.pcd", "version \".4\""},
      Rejected{"pcd-rs__test_v05_no_viewpoint.pcd", "FIELDS must name y"},
      Rejected{"pcd-rs__test_v06_mixed_types.pcd", "FIELDS must name x"},
      Rejected{"pcd-rs__test_v5_compressed.pcd", "ends before the compressed data"},
      Rejected{"pcd-rs__test_v6_compressed.pcd", "ends before the compressed data"},
  };
  for (const Expected& expected : accepted) {
    expect(folder, expected);
  }
  for (const Rejected& bad : rejected) {
    EXPECT_TRUE(fails_saying([&] { return read_pcd(folder / bad.file); }, bad.file, bad.says));
  }
  const auto files = std::distance(std::filesystem::directory_iterator(folder), {});
  EXPECT_EQ(static_cast<std::size_t>(files), accepted.size() + rejected.size());
}

TEST(Pcd, ReadsRealScenesOfDepthCameras) {
  PALPATE_DATA_OR_SKIP(folder, "single_pcl_kinect_scenes");
  for (const Expected& expected : {
           Expected{"capture0001.pcd", 640, 480, 57553, {-0.0255065098, 0.000946042403, 2.2441175}},
           Expected{"capture0002.pcd", 640, 480, 57269, {-0.0158125988, 0.00291113684, 2.24211109}},
           Expected{
               "mOSD_learn0.pcd", 640, 480, 124908, {-0.0517441395, 0.0956667473, 0.850873603}},
           Expected{
               "mOSD_learn33.pcd", 640, 480, 128069, {-0.0585633874, 0.0747840867, 0.917053525}},
           Expected{"milk.pcd", 13704, 1, 0, {-0.0562101657, -0.136754037, 0.774228645}},
           Expected{"milk_cartoon_all_small_clorox.pcd",
                    640,
                    480,
                    65793,
                    {0.00906856657, -0.088555754, 0.90489248}},
           Expected{"table_scene_mug_stereo_textured.pcd",
                    640,
                    480,
                    97920,
                    {0.0952321572, -0.0468975423, 1.26472742}},
       }) {
    expect(folder, expected);
  }
  PALPATE_DATA_OR_SKIP(grabber, "seq_pcl_grabber_3frames/pcd");
  expect(grabber, {"frame_20121214T142255.814212.pcd",
                   640,
                   480,
                   35625,
                   {-0.0227141383, -0.0466103078, 0.99151716}});
}

}  // namespace test_pcd
}  // namespace palpate
