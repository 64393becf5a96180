// SPDX-License-Identifier: Apache-2.0
// Depth whose scale is unknown, brought to metres by a plane or points whose place is known.
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_scale_reference {

using test::fails_saying;

// [m] by which the middle pixel is off the top of a box at z = 0, above a floor; and whether it was
// said to be in doubt, frame by frame.
struct Seen {
  double height;
  bool unsure;
};
std::vector<Seen> top_of_box(const std::string& options, int frames) {
  const auto camera = open_source(
      "synthetic:box?floor=100mm&tilt=0deg&size=160x120&sensor=learned&seed=3&" + options);
  std::vector<Seen> seen;
  for (int i = 0; i < frames; ++i) {
    const auto cloud = camera->next()->cloud;
    seen.push_back({cloud->image()->deproject(80, 60)->z(), cloud->scale_unsure()});
  }
  return seen;
}
double worst_after(const std::vector<Seen>& seen, std::size_t first) {
  double worst = 0.0;
  for (std::size_t i = first; i < seen.size(); ++i)
    worst = std::max(worst, std::abs(seen[i].height));
  return worst;
}
constexpr const char* floor_plane = "&scale_reference=plane:0,0,2,-0.2";

TEST(ScaleReference, APlaneTakesTheDriftAway) {
  EXPECT_GT(worst_after(top_of_box("noise=0", 900), 30), 0.02);
  const auto seen = top_of_box(std::string("noise=0") + floor_plane, 900);
  EXPECT_LT(worst_after(seen, 30), 2.5e-3) << "the lag behind 2 %/s is 1.4 mm at 0.7 m";
  for (std::size_t i = 0; i < seen.size(); ++i) ASSERT_EQ(seen[i].unsure, i < 15) << i;
}

TEST(ScaleReference, WithNoiseTheErrorIsThatOfTheNoise) {
  double without = 0.0, with = 0.0;  // [m^2] sums
  std::size_t doubts = 0;
  const auto far = top_of_box("drift=5%", 900);
  const auto near = top_of_box(std::string("drift=5%") + floor_plane, 900);
  for (std::size_t i = 30; i < near.size(); ++i) {
    without += far[i].height * far[i].height;
    with += near[i].height * near[i].height;
    doubts += near[i].unsure ? 1 : 0;
  }
  EXPECT_GT(std::sqrt(without / 870.0), 0.02);
  EXPECT_LT(std::sqrt(with / 870.0), 1.5 * 0.01 * 0.7);
  EXPECT_EQ(doubts, 0U);
}

TEST(ScaleReference, PointsDoTheSame) {
  const auto seen = top_of_box(
      "noise=0&scale_reference=points:0.15,0.1,-0.1;-0.15,0.1,-0.1;0.15,-0.1,-0.1;9,9,9", 600);
  EXPECT_LT(worst_after(seen, 30), 2.5e-3);
  EXPECT_FALSE(seen.back().unsure);
}

// The same box in a world that is 1 m higher.
TEST(ScaleReference, IsInTheWorldOfThePose) {
  const auto box = open_source("synthetic:box?floor=100mm&tilt=0deg&size=160x120");
  const auto told = open_source(
      "synthetic:box?floor=100mm&tilt=0deg&size=160x120&sensor=learned&noise=0&drift=5%"
      "&pose=0,0,1.7,1,0,0,0&scale_reference=plane:0,0,1,0.9");
  EXPECT_EQ(told->info().notes.size(), 2U + box->info().notes.size());
  for (int i = 0; i < 100; ++i) {
    const auto cloud = told->next()->cloud;
    if (i <= 30) continue;
    ASSERT_NEAR(cloud->image()->deproject(80, 60)->z(), 1.0, 3e-3) << i;
  }
  EXPECT_NE(told->info().details.find("depth times"), std::string::npos);
}

// A floor 1 m below a camera that looks down along -z, read at `scale`; `covered` of its rows are a
// board 60 mm above it.
class Board final : public Source {
 public:
  std::optional<Frame> next(double /*timeout*/) override {
    constexpr int size = 60;
    const Intrinsics k{
        .width = size, .height = size, .fx = 60.0, .fy = 60.0, .cx = 29.5, .cy = 29.5};
    std::vector<std::uint16_t> readings(std::size_t{size} * size);
    for (std::size_t i = 0; i < readings.size(); ++i) {
      const bool is_board = static_cast<double>(i) < covered * static_cast<double>(readings.size());
      readings[i] = static_cast<std::uint16_t>(std::lround(1e4 * (is_board ? 0.94 : 1.0) / scale));
    }
    Eigen::Isometry3d pose(Eigen::AngleAxisd(3.14159265358979, Vec3::UnitX()));
    pose.translation().z() = 1.0;
    return Frame{stamp += 1.0 / 30.0,
                 std::make_shared<DepthImage>(std::make_shared<const ViewingRays>(k),
                                              std::move(readings), 1e4, pose)};
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

  double scale = 1.1, covered = 0.0, stamp = 0.0;

 private:
  SourceInfo info_;
};

class ScaleOfABoard : public ::testing::Test {
 protected:
  ScaleOfABoard() {
    auto source = std::make_unique<Board>();
    board_ = source.get();
    camera_ = with_scale_reference(std::move(source), "plane:0,0,1,0", "board:");
  }
  // After so many frames: is it in doubt, and where is the last row, of the floor [m]?
  std::pair<bool, double> after(int frames) {
    std::shared_ptr<const Cloud> cloud;
    for (int i = 0; i < frames; ++i) cloud = camera_->next()->cloud;
    return {cloud->scale_unsure(), cloud->image()->deproject(30, 59)->z()};
  }
  Board* board_;
  std::unique_ptr<Source> camera_;
};

TEST_F(ScaleOfABoard, IsInDoubtWhileTheReferenceIsCovered) {
  EXPECT_TRUE(after(15).first);
  EXPECT_FALSE(after(5).first);
  board_->covered = 0.9;
  EXPECT_FALSE(after(60).first) << "a tenth is enough";
  board_->covered = 0.97;
  EXPECT_FALSE(after(5).first) << "for a moment";
  EXPECT_TRUE(after(5).first);
  EXPECT_NEAR(after(1).second, 0.0, 1e-3) << "the last scale is kept";
  EXPECT_TRUE(after(1200).first) << "the board is not taken for it";
  board_->covered = 0.0;
  EXPECT_TRUE(after(15).first);
  EXPECT_FALSE(after(5).first);
}

TEST_F(ScaleOfABoard, FollowsADriftAndNotAJump) {
  board_->scale = 1.0;
  for (int i = 0; i < 300; ++i) {
    board_->scale *= 1.0 + 0.005 / 30.0;
    const auto [unsure, height] = after(1);
    if (i > 30) {
      ASSERT_FALSE(unsure) << i;
      ASSERT_NEAR(height, 0.0, 2e-3) << i;
    }
  }
  board_->scale *= 1.15;
  EXPECT_TRUE(after(30).first);
  EXPECT_TRUE(after(600).first);
  board_->stamp = 0.0;  // as where a recording begins again
  EXPECT_TRUE(after(2).first);
  const auto [unsure, height] = after(20);
  EXPECT_FALSE(unsure);
  EXPECT_NEAR(height, 0.0, 1e-3);
}

TEST(ScaleReference, SaysWhatIsWrong) {
  const auto open = [](const std::string& reference) {
    return [reference] { open_source("synthetic:plane?scale_reference=" + reference); };
  };
  EXPECT_TRUE(fails_saying(open("plane:0,0,1"), "scale_reference", "4 numbers", "plane:NX"));
  EXPECT_TRUE(fails_saying(open("plane:0,0,x,1"), "4 numbers"));
  EXPECT_TRUE(fails_saying(open("plane:0,0,0,1"), "normal is zero"));
  EXPECT_TRUE(fails_saying(open("points:0,0,1;1,0,1"), "too few", "three or more"));
  EXPECT_TRUE(fails_saying(open("points:0,0;1,0,1;1,1,1"), "3 numbers"));
  EXPECT_TRUE(fails_saying(open("floor"), "'floor' is no reference", "points:X"));
  EXPECT_TRUE(fails_saying([] { open_source("synthetic:plane?scale_ref=1"); }, "scale_reference"));
}

}  // namespace test_scale_reference
}  // namespace palpate
