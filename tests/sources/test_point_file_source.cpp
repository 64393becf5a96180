// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/files.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/point_files.hpp"

namespace palpate {
namespace test_point_file_source {

using test::fails_saying;
using test::TemporaryFolder;

// A cloud of the one point (x, 0, 0).
std::string pcd(int x) {
  return "FIELDS x y z\nVIEWPOINT 100 200 300 1 0 0 0\nPOINTS 1\nDATA ascii\n" + std::to_string(x) +
         " 0 0\n";
}

std::string ply(int x) {
  return "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nproperty int y\nproperty int z\n"
         "end_header\n" +
         std::to_string(x) + " 0 0\n";
}

const PointCloud& cloud_of(const Frame& frame) {
  return dynamic_cast<const PointCloud&>(*frame.cloud);
}

TEST(PointFiles, OfAFolderAreFramesInNaturalOrderStampedByTheirNumber) {
  const TemporaryFolder folder;
  for (const int k : {10, 9, 1, 100}) {
    folder.write("cloud_" + std::to_string(k) + ".pcd", pcd(k));
  }
  folder.write("cloud_50.PCD", pcd(50));
  folder.write("cloud_2.ply", ply(2));
  folder.write("readme.txt", "not a cloud");
  std::filesystem::create_directory(folder.path() / "cloud_3.pcd");

  const auto source = open_source("pcd:" + folder.path().string() + "?fps=4");
  EXPECT_EQ(source->info().frames, 5u);
  EXPECT_EQ(source->info().frame_rate, 4.0);
  EXPECT_EQ(source->info().kind, "PCD files");
  double stamp = 0.0;
  for (const double x : {1.0, 9.0, 10.0, 50.0, 100.0}) {
    const auto frame = source->next();
    ASSERT_TRUE(frame.has_value());
    EXPECT_EQ(frame->stamp, stamp);
    ASSERT_EQ(cloud_of(*frame).size(), 1u);
    EXPECT_EQ(cloud_of(*frame).point(0), Vec3(x, 0, 0));
    stamp += 0.25;
  }
  EXPECT_FALSE(source->next().has_value());
  EXPECT_FALSE(source->next().has_value());
}

TEST(PointFiles, CanBeASingleFileOfAnyName) {
  const TemporaryFolder folder;
  const auto source = open_source("ply:" + folder.write("mesh.data", ply(3)).string());
  EXPECT_EQ(source->info().frames, 1u);
  const auto frame = source->next();
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->stamp, 0.0);
  EXPECT_EQ(cloud_of(*frame).point(0), Vec3(3, 0, 0));
  EXPECT_FALSE(cloud_of(*frame).viewpoint().has_value());
  EXPECT_FALSE(source->next().has_value());
}

TEST(PointFiles, SayWhatTheFileReadLastHolds) {
  const TemporaryFolder folder;
  folder.write("0.pcd",
               "FIELDS _ x y z\nSIZE 1 8 4 2\nTYPE U F F I\nCOUNT 2 1 1 1\nPOINTS 1\nDATA ascii\n"
               "0 0 1 2 3\nmore\n");
  folder.write("1.pcd", "nonsense");
  const auto source = open_source("pcd:" + folder.path().string());
  EXPECT_EQ(source->info().details, "");
  source->next();
  EXPECT_EQ(source->info().details,
            "1x1 points, ascii, _ uint8 x 2, x float64, y float32, z int16; "
            "5 bytes after them not read");
  EXPECT_TRUE(fails_saying([&] { return source->next(); }, "1.pcd"));
  EXPECT_EQ(source->info().details, "");
}

TEST(PointFiles, AreScaledToMetresTogetherWithTheirViewpoint) {
  const TemporaryFolder folder;
  const std::string uri = "pcd:" + folder.write("mm.pcd", pcd(500)).string();
  for (const char* scale : {"?scale=1mm", "?scale=0.001"}) {
    const auto frame = open_source(uri + scale)->next();
    ASSERT_TRUE(frame.has_value());
    EXPECT_TRUE(cloud_of(*frame).point(0).isApprox(Vec3(0.5, 0, 0)));
    ASSERT_TRUE(cloud_of(*frame).viewpoint().has_value());
    EXPECT_TRUE(cloud_of(*frame).viewpoint()->isApprox(Vec3(0.1, 0.2, 0.3)));
  }
}

TEST(PointFiles, KeepFacesAndNormalsOfUnitLengthBesideThePoints) {
  const TemporaryFolder folder;
  const std::string file =
      "ply\nformat ascii 1.0\nelement vertex 3\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0 0 0 -2\n1000 0 0 nan 0 0\n0 1000 0 0 0 0\n3 0 2 1\n";
  const auto source = open_source("ply:" + folder.write("mesh.ply", file).string() + "?scale=1mm");
  const auto frame = source->next();
  const Surface* surface = cloud_of(*frame).surface();
  ASSERT_NE(surface, nullptr);
  ASSERT_EQ(surface->triangles.size(), 1U);
  EXPECT_EQ(surface->triangles[0], (std::array<std::uint32_t, 3>{0, 2, 1}));
  EXPECT_TRUE(surface->points[1].isApprox(Vec3(1, 0, 0)));
  EXPECT_EQ(surface->normals, (std::vector<Vec3>{-Vec3::UnitZ(), Vec3::Zero(), Vec3::Zero()}))
      << "what is no direction is not known";
  EXPECT_GT(cloud_of(*frame).size(), 200'000U) << "half a square metre of faces is touched, too";
  EXPECT_NE(source->info().details.find("; 1 triangles"), std::string::npos);
}

TEST(PointFiles, HaveUrisOfTheSameAtAnotherLength) {
  EXPECT_EQ(rescaled("pcd:a/b.pcd", 1e-3), "pcd:a/b.pcd?scale=0.001");
  EXPECT_EQ(rescaled("ply:b.ply?fps=5", 0.01), "ply:b.ply?fps=5&scale=0.01");
  EXPECT_EQ(rescaled("ply:b.ply?scale=1mm&fps=5", 0.1), "ply:b.ply?fps=5&scale=0.0001");
  EXPECT_EQ(rescaled("ply:b.ply?fps=5&scale=2", 0.1), "ply:b.ply?fps=5&scale=0.2");
  EXPECT_EQ(rescaled("ply:what?.ply?", 10.0), "ply:what?.ply?scale=10");
  EXPECT_EQ(rescaled("recording:bag", 0.1), "") << "it has no such option";
}

TEST(PointFiles, KeepTheImageOfAnOrganisedCloudWithItsHoles) {
  const TemporaryFolder folder;
  const auto source = open_source("pcd:" + folder
                                               .write("0.pcd",
                                                      "FIELDS x y z\nWIDTH 2\nHEIGHT 2\n"
                                                      "POINTS 4\nDATA ascii\n"
                                                      "0 0 1\nnan nan nan\n0 1 1\n1 1 1\n")
                                               .string());
  const auto frame = source->next();
  const Surface* surface = cloud_of(*frame).surface();
  ASSERT_NE(surface, nullptr);
  EXPECT_EQ(surface->columns, 2);
  EXPECT_EQ(surface->rows, 2);
  EXPECT_EQ(surface->points[3], Vec3(1, 1, 1));
  EXPECT_EQ(cloud_of(*frame).size(), 3U);
}

TEST(PointFiles, CarryTheColours) {
  const TemporaryFolder folder;
  const std::string image =
      "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nWIDTH 2\nHEIGHT 2\nPOINTS 4\nDATA ascii\n"
      "0 0 1 1\nnan nan nan 2\n0 1 1 3\n1 1 1 4\n";
  const auto frame = open_source("pcd:" + folder.write("0.pcd", image).string())->next();
  ASSERT_NE(frame->colour, nullptr);
  EXPECT_EQ(frame->colour->width, 2);
  EXPECT_EQ(frame->colour->height, 2);
  EXPECT_EQ(frame->colour->rgb, (std::vector<std::uint8_t>{0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0, 4}));
  const std::string mesh =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0 1 2 3\n1 0 0 4 5 6\n0 1 0 7 8 9\n3 0 1 2\n";
  const auto coloured = open_source("ply:" + folder.write("0.ply", mesh).string())->next();
  ASSERT_NE(coloured->colour, nullptr);
  EXPECT_EQ(coloured->colour->width, 3);
  EXPECT_EQ(coloured->colour->height, 1);
  EXPECT_EQ(coloured->colour->rgb, (std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  // Of points alone, too: each beside its own.
  const std::string loose =
      "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n"
      "9 0 1 1\nnan nan nan 2\n0 1 1 3\n";
  const auto points = open_source("pcd:" + folder.write("1.pcd", loose).string())->next();
  ASSERT_NE(points->colour, nullptr);
  EXPECT_EQ(points->colour->rgb, (std::vector<std::uint8_t>{0, 0, 1, 0, 0, 2, 0, 0, 3}));
  ASSERT_NE(cloud_of(*points).surface(), nullptr);
  EXPECT_EQ(cloud_of(*points).surface()->points[2], Vec3(0, 1, 1));
}

TEST(PointFiles, OfADepthCameraAreDepthImagesInColourThatShareTheCamera) {
  const TemporaryFolder folder;
  for (const char* name : {"0.pcd", "1.pcd"}) {
    std::string file =
        "FIELDS x y z rgb\nSIZE 8 8 8 4\nTYPE F F F U\nWIDTH 32\nHEIGHT 24\nPOINTS 768\n"
        "DATA ascii\n";
    for (int v = 0; v < 24; ++v) {
      for (int u = 0; u < 32; ++u) {
        const double z = 900.0 + 10.0 * ((u * v) % 17);  // [mm]
        file += u == v ? "nan nan nan"
                       : std::to_string((u - 15.5) / 40.0 * z) + " " +
                             std::to_string((v - 11.5) / 40.0 * z) + " " + std::to_string(z);
        file += " " + std::to_string(u) + "\n";
      }
    }
    folder.write(name, file);
  }
  const auto source = open_source("pcd:" + folder.path().string() + "?scale=1mm");
  const auto first = source->next();
  const auto second = source->next();
  const DepthImage* image = first->cloud->image();
  ASSERT_NE(image, nullptr);
  EXPECT_NEAR(image->intrinsics().fx, 40.0, 1e-4);
  EXPECT_NEAR(image->intrinsics().cy, 11.5, 1e-4);
  EXPECT_FALSE(image->deproject(5, 5).has_value());
  EXPECT_NEAR(image->deproject(6, 5)->z(), 1.03, 1e-5);
  ASSERT_NE(first->colour, nullptr);
  EXPECT_EQ(first->colour->rgb[3 * (5 * 32 + 6) + 2], 6);
  EXPECT_EQ(&image->rays(), &dynamic_cast<const DepthImage&>(*second->cloud).rays());
}

TEST(PointFiles, OfKinectsAreDepthImagesThatLoseNoPoint) {
  PALPATE_DATA_OR_SKIP(scenes, "single_pcl_kinect_scenes");
  for (const char* name :
       {"capture0001.pcd", "mOSD_learn0.pcd", "mOSD_learn33.pcd",
        "milk_cartoon_all_small_clorox.pcd", "table_scene_mug_stereo_textured.pcd"}) {
    const std::string path = (scenes / name).string();
    const auto frame = open_source("pcd:" + path)->next();
    const DepthImage* image = frame->cloud->image();
    ASSERT_NE(image, nullptr) << name;
    const PointFile file = read_pcd(path);
    for (std::size_t i = 0; i < file.points.size(); ++i) {
      const auto point =
          image->deproject(static_cast<int>(i % file.width), static_cast<int>(i / file.width));
      ASSERT_EQ(point.has_value(), file.points[i].allFinite()) << name << ", point " << i;
      if (!point) continue;
      ASSERT_LT((*point - file.points[i]).norm(), 1e-4) << name << ", point " << i;
    }
  }
}

TEST(PointFiles, GoOnAfterAFileThatCannotBeUsed) {
  const TemporaryFolder folder;
  folder.write("0.pcd", pcd(0));
  folder.write("1.pcd", "nonsense");
  folder.write("2.pcd", pcd(2));
  const auto source = open_source("pcd:" + folder.path().string() + "?fps=1");
  EXPECT_EQ(source->next()->stamp, 0.0);
  EXPECT_TRUE(fails_saying([&] { return source->next(); }, "1.pcd: line 1"));
  const auto frame = source->next();
  ASSERT_TRUE(frame.has_value());
  EXPECT_EQ(frame->stamp, 2.0);
  EXPECT_EQ(cloud_of(*frame).point(0), Vec3(2, 0, 0));
}

TEST(PointFiles, ThatDoNotExistAreAnError) {
  const TemporaryFolder folder;
  const std::string path = folder.path().string();
  EXPECT_TRUE(fails_saying([&] { return open_source("pcd:" + path); }, path, "holds no .pcd file"));
  EXPECT_TRUE(
      fails_saying([&] { return open_source("ply:" + path + "/no"); }, "no such file or folder"));
  EXPECT_TRUE(fails_saying([] { return open_source("pcd:"); }, "pcd:", "no file"));
}

TEST(PointFiles, TakeOnlyOptionsThatTheyKnow) {
  const TemporaryFolder folder;
  const std::string uri = "pcd:" + folder.write("a.pcd", pcd(1)).string();
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?fsp=30"); }, "fsp", "fps"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?fps=0"); }, "fps"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?fps=30mm"); }, "fps"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?scale=0"); }, "scale"));
  EXPECT_TRUE(fails_saying([&] { return open_source(uri + "?scale=-1"); }, "scale"));
  EXPECT_TRUE(open_source(uri + "?fps=30hz&scale=1mm")->next().has_value());
}

}  // namespace test_point_file_source
}  // namespace palpate
