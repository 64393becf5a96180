// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <type_traits>

#include "palpate/io/sources/point_file.hpp"

#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/point_files.hpp"

namespace palpate {
namespace test_ply {

using test::bytes_of;
using test::fails_saying;

PointFile parse(std::string_view text) { return test::parse(parse_ply, text); }

constexpr std::array<const char*, 3> encodings{"ascii", "binary_little_endian",
                                               "binary_big_endian"};

// Values written one after the other in one of the encodings.
class Values {
 public:
  explicit Values(std::string encoding) : encoding_(std::move(encoding)) {}
  template <class T>
  Values& add(T value) {
    if (encoding_ == "ascii") {
      text_ += std::to_string(+value) + " ";
    } else {
      text_ += bytes_of(value,
                        encoding_ == "binary_big_endian" ? std::endian::big : std::endian::little);
    }
    return *this;
  }
  Values& end_row() {
    text_ += encoding_ == "ascii" ? "\n" : "";
    return *this;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string encoding_, text_;
};

std::string header(const std::string& encoding, const std::string& elements) {
  return "ply\nformat " + encoding + " 1.0\n" + elements + "end_header\n";
}

std::string vertices_of(const std::string& type) {
  return "property " + type + " x\nproperty " + type + " y\nproperty " + type + " z\n";
}

const std::string vertices = vertices_of("float");

TEST(Ply, GivesTheColoursInEveryEncodingWithAndWithoutLists) {
  for (const std::string encoding : encodings) {
    for (const bool lists : {false, true}) {
      Values values(encoding);
      for (int k = 0; k < 2; ++k) {
        values.add(static_cast<std::uint8_t>(100 + k)).add(1.0F).add(2.0F).add(3.0F);
        if (lists) values.add(std::uint8_t{1}).add(std::uint8_t{9});
        values.add(static_cast<std::uint8_t>(200 + k)).add(std::uint8_t{0}).add(std::uint8_t{7});
        values.end_row();
      }
      const PointFile cloud = parse(
          header(encoding, "element vertex 2\nproperty uchar blue\n" + vertices +
                               (lists ? "property list uchar uchar more\n" : "") +
                               "property uchar red\nproperty uchar green\nproperty uchar alpha\n") +
          values.text());
      EXPECT_EQ(cloud.colours, (std::vector<std::uint8_t>{200, 0, 100, 201, 0, 101}))
          << encoding << lists;
      EXPECT_EQ(cloud.points[1], Vec3(1, 2, 3));
    }
  }
  const std::string rest = "property int red\nproperty uchar green\nproperty uchar blue\n";
  EXPECT_TRUE(parse(header("ascii", "element vertex 1\n" + vertices + rest) + "1 2 3 0 1 2\n")
                  .colours.empty())
      << "colours of another type are passed over";
}

TEST(Ply, TakesColoursInFloatsForSharesOfTheBrightest) {
  for (const std::string encoding : encodings) {
    for (const bool lists : {false, true}) {
      Values values(encoding);
      values.add(1.0F).add(2.0F).add(3.0F).add(1.0F).add(std::uint8_t{7}).add(0.4);
      if (lists) values.add(std::uint8_t{1}).add(std::uint8_t{9});
      values.end_row();
      values.add(1.0F).add(2.0F).add(3.0F).add(-1.0F).add(std::uint8_t{255}).add(3e9);
      if (lists) values.add(std::uint8_t{0});
      values.end_row();
      const PointFile cloud =
          parse(header(encoding, "element vertex 2\n" + vertices +
                                     "property float red\nproperty uchar green\n"
                                     "property double blue\n" +
                                     (lists ? "property list uchar uchar more\n" : "")) +
                values.text());
      EXPECT_EQ(cloud.colours, (std::vector<std::uint8_t>{255, 7, 102, 0, 255, 255}))
          << encoding << lists;
    }
  }
}

// Three vertices among others' elements, with a list in the middle of each vertex.
std::string valid_file(const std::string& encoding) {
  Values values(encoding);
  values.add(std::uint8_t{2}).add(std::int32_t{0}).add(std::int32_t{1}).end_row();
  values.add(std::uint8_t{0}).end_row();
  for (int k = 0; k < 3; ++k) {
    values.add(std::int16_t{-1}).add(static_cast<float>(3 * k + 1));
    values.add(static_cast<std::uint16_t>(k));
    for (int i = 0; i < k; ++i) {
      values.add(9.5);
    }
    values.add(static_cast<double>(3 * k + 3)).add(static_cast<std::int8_t>(3 * k + 2)).end_row();
  }
  values.add(0.5f).add(0.25f).add(0.125f).add(1.0f).end_row();
  return header(encoding,
                "comment made by a test\nobj_info made by a test\n"
                "element face 2\nproperty list uchar int vertex_indices\n"
                "element vertex 3\nproperty short a\nproperty float x\n"
                "property list ushort double more\nproperty double z\nproperty char y\n"
                "element camera 1\nproperty float view_px\nproperty float view_py\n"
                "property float view_pz\nproperty float focal\n") +
         values.text();
}

TEST(Ply, KnowsEachTypeByBothOfItsNames) {
  for (const auto& [name, known] :
       {std::pair("char", "int8"), std::pair("uchar", "uint8"), std::pair("short", "int16"),
        std::pair("ushort", "uint16"), std::pair("int", "int32"), std::pair("uint", "uint32"),
        std::pair("float", "float32"), std::pair("double", "float64")}) {
    for (const char* type : {name, known}) {
      const PointFile cloud =
          parse(header("ascii", "element vertex 1\n" + vertices_of(type)) + "1 2 3\n");
      EXPECT_EQ(cloud.fields[2].type, known);
      EXPECT_EQ(cloud.points[0], Vec3(1, 2, 3));
    }
  }
}

// A square and a line beside it, five vertices with normals.
std::string faces_file(const std::string& encoding, const std::string& corner_type = "int") {
  Values values(encoding);
  const auto corner = [&](int index) {
    if (corner_type == "int") values.add(std::int32_t{index});
    if (corner_type == "uchar") values.add(static_cast<std::uint8_t>(index));
    if (corner_type == "ushort") values.add(static_cast<std::uint16_t>(index));
  };
  for (const std::vector<int>& face : {std::vector{0, 1, 2, 3}, std::vector{3, 4}}) {
    values.add(static_cast<std::uint8_t>(face.size()));
    for (const int index : face) corner(index);
    values.end_row();
  }
  for (int k = 0; k < 5; ++k) {
    values.add(float(k)).add(float(k * k)).add(0.0F).add(0.5F).add(float(-k)).add(2.0F).end_row();
  }
  return header(encoding, "element face 2\nproperty list uchar " + corner_type +
                              " vertex_index\nelement vertex 5\n" + vertices +
                              "property float nx\nproperty float ny\nproperty float nz\n") +
         values.text();
}

TEST(Ply, ReadsNormalsAndFansFacesInEveryEncoding) {
  using Corners = std::array<std::uint32_t, 3>;
  for (const char* encoding : encodings) {
    for (const char* type : {"int", "uchar", "ushort"}) {
      SCOPED_TRACE(std::string(encoding) + " " + type);
      const PointFile cloud = parse(faces_file(encoding, type));
      EXPECT_EQ(cloud.triangles, (std::vector<Corners>{{0, 1, 2}, {0, 2, 3}}))
          << "a face of two corners is a line";
      ASSERT_EQ(cloud.normals.size(), 5U);
      EXPECT_EQ(cloud.normals[3], Vec3(0.5, -3, 2));
      EXPECT_EQ(cloud.points[3], Vec3(3, 9, 0));
    }
    test::expect_defined_on_damage(parse_ply, faces_file(encoding), 3000);
  }
  EXPECT_TRUE(parse(header("ascii", "element vertex 1\n" + vertices +
                                        "property float nx\nproperty float ny\n") +
                    "1 2 3 0 1\n")
                  .normals.empty())
      << "two of three coordinates are no normal";
}

TEST(Ply, CutsStripsThatTurnWithEachTriangleAndBeginAnew) {
  using Corners = std::array<std::uint32_t, 3>;
  for (const char* encoding : encodings) {
    Values values(encoding);
    for (int k = 0; k < 5; ++k) values.add(float(k)).add(0.0F).add(0.0F).end_row();
    values.add(std::int32_t{8});
    for (const int corner : {0, 1, 2, 3, -1, 2, 3, 4}) values.add(std::int32_t{corner});
    values.end_row();
    const PointFile cloud = parse(header(encoding, "element vertex 5\n" + vertices +
                                                       "element tristrips 1\n"
                                                       "property list int int vertex_indices\n") +
                                  values.text());
    EXPECT_EQ(cloud.triangles, (std::vector<Corners>{{0, 1, 2}, {2, 1, 3}, {2, 3, 4}}));
  }
}

TEST(Ply, SaysWhichFaceNamesAVertexThatIsNotThere) {
  const auto bad = [](const std::string& encoding, int corner, const char* element = "face") {
    Values values(encoding);
    for (int k = 0; k < 3; ++k) values.add(float(k)).add(0.0F).add(0.0F).end_row();
    values.add(std::uint8_t{3}).add(std::int32_t{0}).add(std::int32_t{1});
    values.add(std::int32_t{corner}).end_row();
    return header(encoding, "element vertex 3\n" + vertices + "element " + element +
                                " 1\nproperty list uchar int vertex_indices\n") +
           values.text();
  };
  for (const char* encoding : encodings) {
    EXPECT_EQ(parse(bad(encoding, 2)).triangles.size(), 1U);
    for (const int corner : {3, -1, -2147483647 - 1}) {
      EXPECT_TRUE(fails_saying([&] { return parse(bad(encoding, corner)); },
                               "\"face\": vertex " + std::to_string(corner) + " is named",
                               "but there are 3"));
    }
    EXPECT_TRUE(fails_saying([&] { return parse(bad(encoding, -2, "tristrips")); },
                             "\"tristrips\": vertex -2 is named"));
  }
  EXPECT_TRUE(fails_saying([&] { return parse(bad("ascii", 3)); }, "line 13: "));
  EXPECT_TRUE(fails_saying([&] { return parse(bad("binary_big_endian", 3)); }, "byte "));
  const std::string list = header("ascii", "element vertex 1\n" + vertices +
                                               "element face 1\n"
                                               "property list uchar int vertex_indices\n");
  EXPECT_TRUE(fails_saying([&] { return parse(list + "1 2 3\n3 0 0 0.5\n"); },
                           "line 11: one of vertex_indices is \"0.5\""));
  EXPECT_TRUE(fails_saying([&] { return parse(list + "1 2 3\n3 0 0\n"); }, "line 11: has too few"));
  for (const char* property : {"list uchar float vertex_indices", "int vertex_index"}) {
    EXPECT_TRUE(fails_saying(
        [&] {
          return parse(header("ascii", "element vertex 1\n" + vertices +
                                           "element face 1\nproperty " + property + "\n") +
                       "1 2 3\n1 0\n");
        },
        "is not a list of whole numbers"));
  }
}

TEST(Ply, HasAViewpointIfPclWroteIt) {
  EXPECT_FALSE(parse(header("ascii", "element vertex 0\n" + vertices)).viewpoint.has_value());
  EXPECT_TRUE(fails_saying(
      [] {
        return parse(header("ascii", "element vertex 0\n" + vertices +
                                         "element camera 1\nproperty float view_px\n"
                                         "property float view_py\nproperty float view_pz\n") +
                     "0 nan 0\n");
      },
      "view_py"));
}

TEST(Ply, AcceptsHeadersWithCarriageReturnsBeforeBinaryDataThatBeginsWithALineFeed) {
  std::string head;
  for (const char c : header("binary_little_endian",
                             "element vertex 1\nproperty uchar x\n"
                             "property uchar y\nproperty uchar z\n")) {
    head += c == '\n' ? "\r\n" : std::string(1, c);
  }
  EXPECT_EQ(parse(head + "\n\r ").points.at(0), Vec3(10, 13, 32));
}

TEST(Ply, RejectsAHeaderThatPromisesMoreThanTheFileHolds) {
  for (const std::string encoding : encodings) {
    EXPECT_TRUE(fails_saying(
        [&] {
          return parse(header(encoding, "element vertex 1000000000000\n" + vertices) +
                       "1 2 3 4 5 6\n");
        },
        "test file", "promises 1000000000000 rows of element \"vertex\"", "12 bytes"));
    EXPECT_TRUE(fails_saying(
        [&] {
          return parse(header(encoding, "element vertex 18446744073709551615\n" + vertices +
                                            "property list uchar int more\n") +
                       "1 2 3 4 5 6 7 8\n");
        },
        "promises 18446744073709551615 rows"));
  }
  // A list's length, too, is a promise.
  const std::string lists =
      "element vertex 0\n" + vertices + "element face 1\nproperty list uint double weights\n";
  EXPECT_TRUE(fails_saying(
      [&] {
        return parse(header("binary_little_endian", lists) + bytes_of(std::uint32_t{4000000000}) +
                     std::string(80, '?'));
      },
      "byte 168: ", "promises 4000000000 values, but 80 bytes are left"));
  EXPECT_TRUE(
      fails_saying([&] { return parse(header("ascii", lists) + "18446744073709551615 1 2 3\n"); },
                   "line 10: has too few values"));
  // Rows without properties take no space, so nothing needs to hold them.
  EXPECT_EQ(parse(header("ascii", "element nothing 1000000000000\nelement vertex 1\n" + vertices) +
                  "1 2 3\n")
                .points.size(),
            1u);
}

TEST(Ply, SaysWhatIsWrongWithAHeader) {
  const std::string good = header("ascii", "element vertex 1\n" + vertices) + "1 2 3\n";
  const std::array refusals{
      test::Refusal{"ply\n", "plx\n", "does not begin with `ply`"},
      test::Refusal{"ascii 1.0", "ascii 2.0", "line 2: PLY version \"2.0\""},
      test::Refusal{"ascii", "text", "line 2: format \"text\""},
      test::Refusal{"format ascii 1.0\n", "", "no format line"},
      test::Refusal{"element vertex 1", "element vertex -1", "line 3: an element is"},
      test::Refusal{"element vertex 1", "element vertex 99999999999999999999",
                    "line 3: an element is"},
      test::Refusal{"element vertex 1", "element vertex 1 2", "line 3: an element is"},
      test::Refusal{"element vertex 1", "element point 1", "one element vertex"},
      test::Refusal{"end_header", "element vertex 1\nend_header", "one element vertex"},
      test::Refusal{"element vertex 1\n", "", "line 3: a property before any element"},
      test::Refusal{"float y", "bool y", "line 5: \"bool\" is not a type"},
      test::Refusal{"float y", "float", "line 5: a property is"},
      test::Refusal{"float y", "float y y", "line 5: a property is"},
      test::Refusal{"float y", "list float int y", "length cannot be a float"},
      test::Refusal{"float y", "list uchar float y", "one x, one y and one z that are no lists"},
      test::Refusal{"float y", "float x", "one x, one y and one z"},
      test::Refusal{"float z", "float w", "one x, one y and one z"},
      test::Refusal{"property float z", "proper float z", "line 6: \"proper\" does not begin"},
      test::Refusal{"end_header\n1 2 3\n", "", "no end_header line"},
  };
  test::expect_refusals(parse_ply, good, refusals);
  EXPECT_TRUE(fails_saying([] { return parse(""); }, "does not begin with `ply`"));
}

TEST(Ply, SaysInWhichListItFailed) {
  const std::string list = header(
      "ascii", "element vertex 0\n" + vertices + "element face 1\nproperty list uchar int i\n");
  EXPECT_TRUE(fails_saying([&] { return parse(list + "-1 2 3\n"); }, "line 10: a list's length"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return parse(header("binary_little_endian", "element vertex 0\n" + vertices +
                                                        "element face 1\n"
                                                        "property list char int i\n") +
                     "\xff___________");
      },
      "promises -1 values"));
}

using test::PointFiles;
INSTANTIATE_TEST_SUITE_P(Ply, PointFiles,
                         testing::Values(test::PointFormat{"ply", parse_ply, read_ply, encodings,
                                                           valid_file, " 1.0"}));

}  // namespace test_ply
}  // namespace palpate
