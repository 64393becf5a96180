// SPDX-License-Identifier: Apache-2.0
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/trajectory.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_trajectory {

using test::fails_saying;

Trajectory parse(const std::string& text) { return parse_trajectory(text, "path.txt"); }

TEST(Trajectory, GivesThePosesOfItsLines) {
  // A quarter turn about z: the camera's x axis lies along the world's y.
  const Trajectory path =
      parse("# stamp tx ty tz qx qy qz qw\n\n1305031101.5 1 2 3 0 0 0.7071 0.7071\r\n");
  const auto world_from_camera = path.at(1305031101.5);
  ASSERT_TRUE(world_from_camera);
  EXPECT_TRUE((*world_from_camera * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 3, 3)));
  const Eigen::Matrix3d rotation = world_from_camera->linear();
  EXPECT_TRUE((rotation * rotation.transpose()).isIdentity(1e-12));
}

TEST(Trajectory, InterpolatesAlongTheLineAndTheArc) {
  // From rest to a half turn about z, in 0.1 s: a quarter of the way is an eighth of a full turn.
  const Trajectory path = parse("5.0 0 0 0 0 0 0 1\n5.1 4 0 -8 0 0 0.999999 0.001\n");
  const auto world_from_camera = path.at(5.025);
  ASSERT_TRUE(world_from_camera);
  EXPECT_TRUE(world_from_camera->translation().isApprox(Eigen::Vector3d(1, 0, -2), 1e-9));
  const Eigen::AngleAxisd turn(world_from_camera->linear());
  EXPECT_NEAR(turn.angle(), std::numbers::pi / 4, 1e-3);
  EXPECT_NEAR(turn.axis().z(), 1.0, 1e-9);
}

TEST(Trajectory, TakesTheShorterArcWhereTheQuaternionChangesSign) {
  const Trajectory path = parse("0 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 -0.1 -0.995\n");
  EXPECT_NEAR(Eigen::AngleAxisd(path.at(0.05)->linear()).angle(), 0.1, 1e-3);
}

TEST(Trajectory, KnowsNoPoseInGapsOrOutside) {
  const Trajectory path = parse("1.0 0 0 0 0 0 0 1\n1.1 1 0 0 0 0 0 1\n2.0 2 0 0 0 0 0 1\n");
  EXPECT_FALSE(path.at(0.975));
  EXPECT_EQ(path.at(0.985)->translation().x(), 0.0);
  EXPECT_EQ(path.at(1.0)->translation().x(), 0.0);
  EXPECT_EQ(path.at(1.115)->translation().x(), 1.0);
  EXPECT_FALSE(path.at(1.5));
  EXPECT_EQ(path.at(1.985)->translation().x(), 2.0);
  EXPECT_EQ(path.at(2.015)->translation().x(), 2.0);
  EXPECT_FALSE(path.at(2.025));
  EXPECT_FALSE(path.at(std::numeric_limits<double>::quiet_NaN()));
}

TEST(Trajectory, NamesTheLineThatMakesNoSense) {
  const std::string good = "# comment\n1.0 0 0 0 0 0 0 1\n";
  const auto fails = [&](const std::string& line, const char* saying) {
    return fails_saying([&] { return parse(good + line); }, "path.txt:3", saying);
  };
  EXPECT_TRUE(fails("1.1 0 0 0 0 0 0", "fields: 7 instead of 8"));
  EXPECT_TRUE(fails("1.1 0 0 0 0 0 0 1 9", "fields: 9 instead of 8"));
  EXPECT_TRUE(fails("1.1 0 0 nan 0 0 0 1", "field 4"));
  EXPECT_TRUE(fails("1.1 0 0 0 0 0 0 1,0", "field 8"));
  EXPECT_TRUE(fails("inf 0 0 0 0 0 0 1", "stamp is not"));
  EXPECT_TRUE(fails("1.0 0 0 0 0 0 0 1", "repeats"));
  EXPECT_TRUE(fails("0.9 0 0 0 0 0 0 1", "backwards"));
  EXPECT_TRUE(fails("1.1 0 0 0 0 0 0 0", "length 1"));
  EXPECT_TRUE(fails("1.1 0 0 0 0 0 0 2", "length 1"));
  EXPECT_TRUE(fails_saying([] { return parse("# nothing\n"); }, "path.txt", "no poses"));
}

TEST(ImageList, NamesTheLineThatMakesNoSense) {
  const auto images = parse_image_list("# depth\n1.5 depth/a.png\n\n2.5\tdepth/b.png\n", "l.txt");
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[1].stamp, 2.5);
  EXPECT_EQ(images[1].file, "depth/b.png");
  const auto fails = [](const char* line, const char* saying) {
    return fails_saying(
        [&] { return parse_image_list("1.5 a.png\n" + std::string(line), "l.txt"); }, "l.txt:2",
        saying);
  };
  EXPECT_TRUE(fails("1.6", "fields: 1 instead of 2"));
  EXPECT_TRUE(fails("1.6 my image.png", "fields: 3 instead of 2"));
  EXPECT_TRUE(fails("later b.png", "stamp is not"));
  EXPECT_TRUE(fails("1.5 b.png", "repeats"));
  EXPECT_TRUE(fails("1.4 b.png", "backwards"));
  EXPECT_TRUE(fails_saying([] { return parse_image_list("", "l.txt"); }, "l.txt", "no images"));
}

TEST(PoseMatrices, AreReadAndInverted) {
  const std::string quarter = "[[[0,-1,0,1],[1,0,0,2],[0,0,1,3],[0,0,0,1]]]";
  const Eigen::Vector3d point(1, 0, 0);
  const auto direct = parse_pose_matrices(R"({"world_from_camera": )" + quarter + "}", "p.json");
  ASSERT_EQ(direct.size(), 1u);
  EXPECT_TRUE((direct[0] * point).isApprox(Eigen::Vector3d(1, 3, 3)));
  const auto inverse =
      parse_pose_matrices(R"({"note": 1, "camera_from_grid": )" + quarter + "}", "p.json");
  EXPECT_TRUE((inverse[0] * Eigen::Vector3d(1, 3, 3)).isApprox(point));
}

TEST(PoseMatrices, NameTheOneThatIsNotRigid) {
  const auto fails = [](const std::string& second, const char* saying) {
    const std::string text =
        R"({"camera_from_grid": [[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], )" + second + "]}";
    return fails_saying([&] { return parse_pose_matrices(text, "p.json"); },
                        R"(p.json: "camera_from_grid"[1])", saying);
  };
  EXPECT_TRUE(fails("[[1,0,0,0],[0,1,0,0],[0,0,1,0]]", "4x4"));
  EXPECT_TRUE(fails("[[1,0,0,0],[0,1,0,0],[0,0,1],[0,0,0,1]]", "4x4"));
  EXPECT_TRUE(fails("[[1,0,0,0],[0,1,0,0],[0,0,null,0],[0,0,0,1]]", "4x4"));
  EXPECT_TRUE(fails("7", "4x4"));
  EXPECT_TRUE(fails("[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]", "rigid"));  // mirrored
  EXPECT_TRUE(fails("[[2,0,0,0],[0,2,0,0],[0,0,2,0],[0,0,0,1]]", "rigid"));
  EXPECT_TRUE(fails("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,1,1]]", "rigid"));
  for (const char* text : {"", "[]", "{}", R"({"camera_from_a": 1})",
                           R"({"camera_from_a": [], "world_from_camera": []})"}) {
    EXPECT_TRUE(fails_saying([&] { return parse_pose_matrices(text, "p.json"); }, "p.json"));
  }
}

}  // namespace test_trajectory
}  // namespace palpate
