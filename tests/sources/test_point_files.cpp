// SPDX-License-Identifier: Apache-2.0
// What holds of PCD and of PLY files alike.
#include <filesystem>
#include <iterator>
#include <set>
#include <sstream>
#include <string>

#include "palpate/io/sources/point_file.hpp"

#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/point_files.hpp"

namespace palpate::test {

TEST_P(PointFiles, GiveTheirPointsBetweenValuesOfOtherSizes) {
  for (const std::string encoding : GetParam().encodings) {
    SCOPED_TRACE(encoding);
    const std::string text = GetParam().valid_file(encoding);
    const PointFile cloud = parse(GetParam().parser, text);
    EXPECT_EQ(cloud.points, (std::vector{Vec3(1, 2, 3), Vec3(4, 5, 6), Vec3(7, 8, 9)}));
    EXPECT_EQ(cloud.viewpoint, Vec3(0.5, 0.25, 0.125));
    ASSERT_EQ(cloud.fields.size(), 5U);
    EXPECT_EQ(cloud.fields[0].name, "a");
    EXPECT_EQ(cloud.non_finite, 0U);
    EXPECT_EQ(parse(GetParam().parser, text + "\n \r\n").bytes_unread, 0U);
    EXPECT_EQ(parse(GetParam().parser, text + "\n1 2 3").bytes_unread, 5U);
    EXPECT_EQ(parse(GetParam().parser, text + std::string(100, '\0')).bytes_unread, 100U);
  }
}

TEST_P(PointFiles, FailCleanlyWhereverTheyAreCutShort) {
  for (const std::string encoding : GetParam().encodings) {
    const std::string whole = GetParam().valid_file(encoding);
    // What is left of an ascii file may still be a number where its last one ends sooner.
    const std::size_t last =
        encoding == "ascii" ? whole.rfind(GetParam().before_last) + 1 : whole.size() - 1;
    const std::size_t points = parse(GetParam().parser, whole).points.size();
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const auto part = [&] { return parse(GetParam().parser, whole.substr(0, size)); };
      if (size <= last)
        EXPECT_TRUE(fails_saying(part, "test file")) << size;
      else
        EXPECT_EQ(part().points.size(), points) << size;
    }
  }
}

TEST_P(PointFiles, AreErrorsOrConsistentWhenTheyAreDamaged) {
  for (const char* encoding : GetParam().encodings)
    expect_defined_on_damage(GetParam().parser, GetParam().valid_file(encoding), 3000);
}

TEST_P(PointFiles, SayWhichOfThemCannotBeRead) {
  const TemporaryFolder folder;
  const auto read = GetParam().read;
  const std::string end = std::string(".") + GetParam().name;
  EXPECT_TRUE(
      fails_saying([&] { return read(folder.path() / ("no" + end)); }, "no" + end, ": no such"));
  EXPECT_TRUE(fails_saying([&] { return read(folder.path()); }, "not a file"));
  EXPECT_TRUE(fails_saying([&] { return read(folder.write("empty" + end, "")); }, "empty" + end));
  const std::string valid = GetParam().valid_file(GetParam().encodings[1]);
  EXPECT_EQ(read(folder.write("good" + end, valid)).points[2], Vec3(7, 8, 9));
}

// What each file of others holds, as counted and averaged by an independent reader: width, height,
// points that are not finite, triangles, are there normals, and the mean; or what the error says.
constexpr const char* others = R"(
formats/pcd/data__object_template_0.pcd 1397 1 0 0 0 -0.106276255 0.0947920007 0.734193853
formats/pcd/nebula__ascii_xyz.pcd 2 1 0 0 0 -1.5 1.4375 4.875
formats/pcd/nebula__binary_xyz_pcl.pcd 2 1 0 0 0 -4.375 11.25 13.125
formats/pcd/pcd-rs__ascii.pcd 213 1 0 0 0 0.00906073761 0.15169854 0
formats/pcd/pcd-rs__binary.pcd 1809 16 0 0 0 3.70952449 0.360627189 0.128251944
formats/pcd/pcd-rs__empty_compressed.pcd 0 1 0 0 0 0 0 0
formats/pcd/pcd-rs__empty_compressed_debug.pcd 0 1 0 0 0 0 0 0
formats/pcd/pcd-rs__highly_compressed.pcd 1000 1 0 0 0 1 1 1
formats/pcd/pcd-rs__highly_uncompressed.pcd 1000 1 0 0 0 1 1 1
formats/pcd/pcd-rs__large_compressed.pcd 10000 1 0 0 0 55.5614372 166.650409 277.738968
formats/pcd/pcd-rs__output_binary.pcd 3 1 0 0 0 4 5 6
formats/pcd/pcd-rs__output_compressed.pcd 3 1 0 0 0 2 3.16666667 4.6
formats/pcd/pcd-rs__single_compressed.pcd 1 1 0 0 0 1 2 3
formats/pcd/pcd-rs__test_v05_ascii.pcd 2 1 0 0 0 2.5 3.5 4.5
formats/pcd/pcd-rs__test_v06_binary.pcd 1 1 0 0 0 1.5 2.5 3.5
formats/pcd/pcl__brisk_keypoints_gt.pcd 1860 1 0 0 0 288.0071 291.858877 0
formats/pcd/pcl__bunny.pcd 397 1 0 0 0 -0.0290809446 0.102652652 0.0273019573
formats/pcd/pcl__colored_cloud.pcd 1 1000 0 0 0 -0.21851276 -0.513777244 1.21010301
formats/pcd/pcl__curve_close.pcd 110 1 0 0 0 0.468184734 0.5 0
formats/pcd/pcl__octants.pcd 8 1 0 0 0 -0.125 -6 -6
formats/pcd/pcd-rs__corrupt_compressed.pcd : promises 100 bytes
formats/pcd/pcd-rs__mixed_types_compressed.pcd : FIELDS must name z
formats/pcd/pcd-rs__test_unsupported_version.pcd : version ".4"
formats/pcd/pcd-rs__test_v05_no_viewpoint.pcd : FIELDS must name y
formats/pcd/pcd-rs__test_v06_mixed_types.pcd : FIELDS must name x
formats/pcd/pcd-rs__test_v5_compressed.pcd : ends before the compressed data
formats/pcd/pcd-rs__test_v6_compressed.pcd : ends before the compressed data
single_pcl_kinect_scenes/capture0001.pcd 640 480 57553 0 0 -0.0255065098 0.000946042403 2.2441175
single_pcl_kinect_scenes/capture0002.pcd 640 480 57269 0 0 -0.0158125988 0.00291113684 2.24211109
single_pcl_kinect_scenes/mOSD_learn0.pcd 640 480 124908 0 0 -0.0517441395 0.0956667473 0.850873603
single_pcl_kinect_scenes/mOSD_learn33.pcd 640 480 128069 0 0 -0.0585633874 0.0747840867 0.917053525
single_pcl_kinect_scenes/milk.pcd 13704 1 0 0 0 -0.0562101657 -0.136754037 0.774228645
single_pcl_kinect_scenes/milk_cartoon_all_small_clorox.pcd
  640 480 65793 0 0 0.009068567 -0.08855575 0.9048925
single_pcl_kinect_scenes/table_scene_mug_stereo_textured.pcd
  640 480 97920 0 0 0.09523216 -0.04689754 1.264727
seq_pcl_grabber_3frames/pcd/frame_20121214T142255.814212.pcd
  640 480 35625 0 0 -0.02271414 -0.04661031 0.9915172
formats/ply/assimp__cube_binary.ply 8 1 0 12 0 0.5 0.5 0.5
formats/ply/assimp__cube_binary_header_with_RN_newline.ply 8 1 0 12 0 0.5 0.5 0.5
formats/ply/assimp__cube_binary_starts_with_nl.ply 8 1 0 12 0 6.46753407 0.5 0.5
formats/ply/assimp__float-color.ply 3 1 0 1 0 100 66.6666667 0
formats/ply/assimp__points.ply 4 1 0 0 1 0 0.5 0.5
formats/ply/happly__platonic_shelf.ply 50 1 0 80 0 1.81372228 -0.02773278 0.00956212
formats/ply/happly__platonic_shelf_ascii.ply 50 1 0 80 0 1.81372228 -0.02773278 0.00956212
formats/ply/happly__platonic_shelf_big_endian.ply 50 1 0 80 0 1.81372228 -0.02773278 0.00956212
formats/ply/pcl__cube.ply 24 1 0 12 0 0 0 0
formats/ply/pyntcloud__diamond.ply 6 1 0 8 1 0.5 0.5 0.5
formats/ply/pyntcloud__diamond_ascii.ply 6 1 0 8 1 0.5 0.5 0.5
formats/ply/pyntcloud__voxelgrid.ply 6 1 0 0 0 0.449999997 0.449999997 0.449999997
formats/ply/tinyply__elephant.ply 19753 1 0 39290 0 -0.00612780005 -3.40451721 4.9738905
formats/ply/tinyply__icosahedron.ply 12 1 0 20 1 0 0 0
formats/ply/tinyply__icosahedron_ascii.ply 12 1 0 20 1 0 0 0
formats/ply/trimesh__cube_blender_uv_meshlab.ply 24 1 0 12 0 0 0 0
formats/ply/trimesh__empty.ply 0 1 0 0 1 0 0 0
formats/ply/trimesh__metadata.ply 4 1 0 2 0 0 0 0
formats/ply/trimesh__multi.ply 4 1 0 2 0 0 0 0
formats/ply/trimesh__ply_empty_bin.ply 0 1 0 0 1 0 0 0
formats/ply/trimesh__ply_points_ascii.ply 8 1 0 0 0 0 0 0
formats/ply/trimesh__ply_points_bin.ply 8 1 0 0 1 0 0 0
formats/ply/trimesh__points_ascii.ply 5 1 0 0 0 -0.0636 0.03637442 0.04180716
formats/ply/trimesh__points_ascii_with_lists.ply 5 1 0 0 0 -0.0636 0.03637442 0.04180716
formats/ply/trimesh__points_bin.ply 5 1 0 0 0 -0.0635999992 0.0363744199 0.0418071605
formats/ply/trimesh__points_emptyascii.ply 12 1 0 0 0 -0.0100495833 -0.0138001667 0.0382333333
formats/ply/trimesh__tet.ply 4 1 0 4 0 0 0 0
formats/ply/assimp__crash-30d6d0f7c529b3b66b4131700b7a4580cd7082df.ply : line 7
formats/ply/pyntcloud__diamond_with_bool.ply : "bool" is not a type
formats/ply/trimesh__ply_empty_header.ply : one element vertex
)";

class OthersPointFiles : public testing::TestWithParam<std::string> {};

TEST_P(OthersPointFiles, GiveWhatOtherReadersFindInThem) {
  PALPATE_DATA_OR_SKIP(folder, GetParam());
  std::istringstream rows(others);
  std::set<std::string> known;
  for (std::string path; rows >> path;) {
    std::string row;
    std::getline(rows >> std::ws, row);
    const std::filesystem::path file = data_path(path);
    if (file.parent_path() != folder) continue;
    SCOPED_TRACE(path);
    known.insert(path);
    const auto read = [&] { return file.extension() == ".pcd" ? read_pcd(file) : read_ply(file); };
    if (row.front() == ':') {
      EXPECT_TRUE(fails_saying(read, file.filename().string(), row.substr(2)));
      continue;
    }
    std::size_t width = 0, height = 0, non_finite = 0, triangles = 0;
    bool normals = false;
    Vec3 mean;
    std::istringstream(row) >> width >> height >> non_finite >> triangles >> normals >> mean.x() >>
        mean.y() >> mean.z();
    const PointFile cloud = read();
    EXPECT_EQ(cloud.points.size(), width * height);
    if (file.extension() == ".pcd") {
      EXPECT_EQ(cloud.width, width);
    }
    EXPECT_EQ(cloud.non_finite, non_finite);
    EXPECT_EQ(cloud.triangles.size(), triangles);
    EXPECT_EQ(cloud.normals.size(), normals ? width : 0U);
    EXPECT_LT((mean_of(cloud) - mean).norm(), 1e-6 * (1.0 + mean.norm()));
  }
  if (GetParam().rfind("formats/", 0) == 0) {
    const auto files = std::distance(std::filesystem::directory_iterator(folder), {});
    EXPECT_EQ(known.size(), static_cast<std::size_t>(files)) << "each is in the table";
  }
}

INSTANTIATE_TEST_SUITE_P(Folders, OthersPointFiles,
                         testing::Values("formats/pcd", "formats/ply", "single_pcl_kinect_scenes",
                                         "seq_pcl_grabber_3frames/pcd"));

}  // namespace palpate::test
