// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <memory>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/pose.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_virtual_camera {

using test::fails_saying;

// A box from 0 to 0.2, 0.2 and 0.1 m, open at the bottom, and a roof 30 mm above half of it.
const std::string& scene() {
  static const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\nproperty float y\n"
      "property float z\nelement face 6\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n0.2 0 0\n0.2 0.2 0\n0 0.2 0\n0 0 0.1\n0.2 0 0.1\n0.2 0.2 0.1\n0 0.2 0.1\n"
      "0 0 0.13\n0.1 0 0.13\n0.1 0.2 0.13\n0 0.2 0.13\n"
      "4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n4 8 9 10 11\n";
  return text;
}

class VirtualCameraTest : public ::testing::Test {
 protected:
  std::unique_ptr<Source> open(const std::string& options = "") {
    return open_source("map:" + file_ + "?" + options);
  }
  static std::shared_ptr<const Cloud> seen(Source& camera, const Vec3& hand) {
    camera.follow(hand);
    return camera.next()->cloud;
  }
  static Vec3 outward(const Cloud& cloud) {
    return -cloud.image()->world_from_camera().linear().col(2);
  }
  // Pixels at which a plane is not where it is to be, within a unit of depth; and those that see
  // it.
  struct Plane {
    std::size_t seen = 0, wrong = 0;
  };
  static Plane plane(const Cloud& cloud, int axis, double at) {
    Plane plane;
    for (const Vec3& point : cloud.image()->points()) {
      const double away = std::abs(point[axis] - at);
      plane.seen += away < 1e-3 ? 1 : 0;
      plane.wrong += away < 1e-3 && away > 1.1e-5 ? 1 : 0;
    }
    return plane;
  }
  test::TemporaryFolder folder_;
  std::string file_ = folder_.write("box.ply", scene()).string();
};

TEST_F(VirtualCameraTest, SeesAFaceWhereItIs) {
  const auto camera = open();
  const auto cloud = seen(*camera, {0.15, 0.1, 0.12});
  EXPECT_GT(outward(*cloud).z(), 0.99);
  const Plane top = plane(*cloud, 2, 0.1);
  EXPECT_GT(top.seen, 8000U);
  EXPECT_EQ(top.wrong, 0U);
  EXPECT_EQ(camera->next()->stamp, 1.0 / 60.0);
}

TEST_F(VirtualCameraTest, KeepsItsPoseForSmallStepsAndGoesRoundAnEdge) {
  const auto camera = open();
  const auto first = seen(*camera, {0.15, 0.15, 0.12});
  EXPECT_EQ(seen(*camera, {0.16, 0.15, 0.11})->image()->depth(), first->image()->depth());
  EXPECT_GT(outward(*seen(*camera, {0.25, 0.15, 0.05})).x(), 0.99);
  EXPECT_GT(outward(*seen(*camera, {0.15, 0.25, 0.05})).y(), 0.99);
}

TEST_F(VirtualCameraTest, StaysOutsideOfWhatAHandIsPressedInto) {
  const auto camera = open();
  for (double z = 0.11; z > 0.05; z -= 0.005) {
    const auto cloud = seen(*camera, {0.185, 0.15, z});
    EXPECT_GT(outward(*cloud).z(), 0.99)
        << z << ": the side is nearer, but it did not come through";
  }
}

TEST_F(VirtualCameraTest, CutsAwayWhatHidesThePlace) {
  const auto camera = open();
  const auto cloud = seen(*camera, {0.03, 0.1, 0.11});
  EXPECT_GT(plane(*cloud, 2, 0.1).seen, 4000U);
  EXPECT_EQ(plane(*cloud, 2, 0.13).seen, 0U);
}

TEST_F(VirtualCameraTest, TakesScaleAxesAndPoseFromTheUri) {
  EXPECT_EQ(open()->info().assumed,
            "its unit is assumed to be 1 m (?scale=), its z axis to be up (?up=)");
  const auto camera = open("scale=10mm&up=y&fps=30Hz&pose=0,0,1,0,0,0,1");
  EXPECT_TRUE(camera->info().assumed.empty());
  // The file's y is up, so its top, at z = 0.1 units, looks along -y.
  const auto cloud = seen(*camera, {0.001, -0.002, 1.001});
  EXPECT_LT(outward(*cloud).y(), -0.9);
  EXPECT_GT(plane(*cloud, 1, -1e-3).seen, 1U);
  EXPECT_EQ(camera->next()->stamp, 1.0 / 30.0);
}

TEST_F(VirtualCameraTest, TurnsAnAxisUpByTheShortestTurnBitForBit) {
  const Vec3 z = Vec3::UnitZ();
  for (const char* up : {"x", "y", "z", "-x", "-y", "-z"}) {
    const Vec3 axis = (*up == '-' ? -1.0 : 1.0) * Vec3::Unit(up[*up == '-' ? 1 : 0] - 'x');
    const Eigen::Matrix3d expected = Eigen::Quaterniond::FromTwoVectors(axis, z).toRotationMatrix();
    EXPECT_EQ(body_options(Uri(std::string("map:a.ply?up=") + up)).turn, expected) << up;
  }
}

TEST_F(VirtualCameraTest, SaysWhatIsWrongWithAFile) {
  EXPECT_TRUE(fails_saying([&] { open("up=w"); }, "'up'", "'w' is no axis", "give x, y, z"));
  EXPECT_TRUE(
      fails_saying([] { open_source("map:a.off"); }, "no PLY, STL, OBJ, glTF or NRRD", "FILE.ply"));
  EXPECT_TRUE(fails_saying([] { open_source("map:none.ply"); }, "none.ply"));
  const std::string points =
      folder_
          .write("points.ply",
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                 "property float y\nproperty float z\nend_header\n0 0 0\n")
          .string();
  EXPECT_TRUE(fails_saying([&] { open_source("map:" + points); }, "points.ply", "no triangles"));
}

}  // namespace test_virtual_camera
}  // namespace palpate
