// SPDX-License-Identifier: Apache-2.0
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "palpate/kernel/core/pose.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_pose {

using test::fails_saying;

Eigen::Isometry3d some_pose() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, -2, 0.5).normalized()).matrix();
  pose.translation() = Eigen::Vector3d(0.1, -2.0, 1e-7);
  return pose;
}

TEST(Pose, IsRigidUnlessItScalesShearsMirrorsOrIsNotFinite) {
  EXPECT_TRUE(is_rigid(some_pose()));
  Eigen::Isometry3d pose = some_pose();
  pose.linear() *= 1.0 + 1e-5;
  EXPECT_FALSE(is_rigid(pose));
  EXPECT_TRUE(is_rigid(pose, 1e-3));
  pose = some_pose();
  pose.linear().col(0) *= -1.0;
  EXPECT_FALSE(is_rigid(pose, 1e-3)) << "mirrored";
  pose = some_pose();
  pose.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_rigid(pose));
  pose = some_pose();
  pose.matrix()(3, 2) = 1.0;
  EXPECT_FALSE(is_rigid(pose)) << "a projection";
  EXPECT_TRUE(fails_saying([&] { return check_rigid(pose, "camera pose"), 0; }, "camera pose",
                           "not a rotation"));
}

TEST(Pose, ComesBackFromItsText) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() = Eigen::Vector3d(normal(random), normal(random), normal(random));
    Eigen::Quaterniond q(normal(random), normal(random), normal(random), normal(random));
    pose.linear() = q.normalized().matrix();
    const Eigen::Isometry3d back = parse_pose(pose_text(pose), "pose");
    EXPECT_EQ(back.translation(), pose.translation());
    EXPECT_TRUE(back.linear().isApprox(pose.linear(), 1e-14));
  }
  EXPECT_EQ(pose_text(Eigen::Isometry3d::Identity()), "0, 0, 0, 0, 0, 0, 1");
}

TEST(Pose, RefusesWhatIsNone) {
  const auto parsing = [](const char* text) {
    return [text] { return parse_pose(text, "--device-pose"), 0; };
  };
  EXPECT_TRUE(fails_saying(parsing("1,2,3"), "--device-pose", "3 numbers", "x,y,z,qx,qy,qz,qw"));
  EXPECT_TRUE(fails_saying(parsing(""), "0 numbers"));
  EXPECT_TRUE(fails_saying(parsing("1,2,3,0,0,0,1,5"), "8 numbers"));
  EXPECT_TRUE(fails_saying(parsing("1,2,x,0,0,0,1"), "'x' is not a finite number"));
  EXPECT_TRUE(fails_saying(parsing("1,2,inf,0,0,0,1"), "'inf'"));
  EXPECT_TRUE(fails_saying(parsing("1,2,3,0,0,0,0"), "length is 0"));
  EXPECT_TRUE(fails_saying(parsing("1,2,3,0,0,0,2"), "length is 2"));
  EXPECT_TRUE(fails_saying(parsing("1,2,3e7,0,0,0,1"), "beyond"));
  EXPECT_EQ(parse_pose("1 2 3 0 0 0 1", "pose").translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(parse_pose("1,2,3,0,0,0,1.001", "pose").linear(), Eigen::Matrix3d::Identity());
}

}  // namespace test_pose
}  // namespace palpate
