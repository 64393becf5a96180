// SPDX-License-Identifier: Apache-2.0
// Recordings of real cameras, held against what their descriptions say of them.
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"

#include "tests/support/data.hpp"

namespace palpate {
namespace test_recorded_depth {

struct Span {
  double low, high;
};

struct Expected {
  std::size_t frames;
  int width, height;
  Span measured;  // share of the pixels, in every frame
  Span median;    // [m] depth, in every frame
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The depths of the deprojected points in the camera's own frame.
std::vector<double> depths(const DepthImage& image) {
  const Eigen::Isometry3d camera_from_world = image.world_from_camera().inverse();
  std::vector<double> result;
  for (const Vec3& point : image.points()) result.push_back((camera_from_world * point).z());
  return result;
}

void expect_recording(const std::string& uri, const Expected& expected) {
  SCOPED_TRACE(uri);
  const std::unique_ptr<Source> source = open_source(uri);
  EXPECT_EQ(source->info().frames, expected.frames);
  EXPECT_TRUE(source->info().notes.empty());
  std::size_t frames = 0;
  double before = -1.0;
  while (const auto frame = source->next()) {
    EXPECT_GT(frame->stamp, before);
    before = frame->stamp;
    const DepthImage* image = frame->cloud->image();
    ASSERT_NE(image, nullptr);
    EXPECT_EQ(image->intrinsics().width, expected.width);
    EXPECT_EQ(image->intrinsics().height, expected.height);
    const auto measured = static_cast<double>(
        std::count_if(image->depth().begin(), image->depth().end(), is_measured));
    const double share = measured / static_cast<double>(image->depth().size());
    EXPECT_GE(share, expected.measured.low) << frames;
    EXPECT_LE(share, expected.measured.high) << frames;
    if (frames % 10 == 0) {
      const double depth = median(depths(*image));
      EXPECT_GE(depth, expected.median.low) << frames;
      EXPECT_LE(depth, expected.median.high) << frames;
    }
    ++frames;
  }
  EXPECT_EQ(frames, expected.frames);
}

TEST(RecordedDepth, OfTheTumBenchmark) {
  PALPATE_DATA_OR_SKIP(folder, "seq_tum_fr1_xyz");
  expect_recording("tum:" + folder.string(), {120, 640, 480, {0.715, 0.775}, {0.695, 1.785}});
  const auto source = open_source("tum:" + folder.string());
  EXPECT_NEAR(*source->info().frame_rate, 1.0 / 0.0326, 0.2);
  EXPECT_DOUBLE_EQ(source->info().start_time, 1305031102.160407);
}

TEST(RecordedDepth, OfTheTumBenchmarkLiesOnOneDeskFromAllPoses) {
  // The camera rises by 0.32 m while what it looks at rests: with the poses the desk's median
  // height (z is up in the benchmark's world) must not follow it.
  PALPATE_DATA_OR_SKIP(folder, "seq_tum_fr1_xyz");
  const auto source = open_source("tum:" + folder.string());
  std::vector<double> camera_height;
  std::vector<double> scene_height;
  for (std::size_t k = 0; auto frame = source->next(); ++k) {
    if (k % 30 != 0) continue;
    const auto& image = dynamic_cast<const DepthImage&>(*frame->cloud);
    std::vector<double> heights;
    for (const Vec3& point : image.points()) heights.push_back(point.z());
    scene_height.push_back(median(heights));
    camera_height.push_back(image.world_from_camera().translation().z());
  }
  const auto range = [](const std::vector<double>& values) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    return *high - *low;
  };
  EXPECT_LT(range(scene_height), 0.1 * range(camera_height));
}

TEST(RecordedDepth, OfATabletopWithPosesFromTags) {
  PALPATE_DATA_OR_SKIP(folder, "seq_visp_tabletop_known_objects");
  const std::string uri = "depth:" + folder.string();
  expect_recording(uri, {99, 640, 480, {0.885, 0.935}, {0.595, 0.935}});
  expect_recording(uri + "?poses=camera_from_taggrid.json",
                   {99, 640, 480, {0.885, 0.935}, {0.595, 0.935}});
}

TEST(RecordedDepth, OfARobotTakesSaturatedPixelsForHoles) {
  PALPATE_DATA_OR_SKIP(folder, "seq_aims_d435_robot_floor");
  expect_recording("depth:" + folder.string(), {50, 640, 480, {0.5, 1.0}, {0.3, 5.0}});
  EXPECT_EQ(open_source("depth:" + folder.string())->info().frame_rate, 10.0);
}

TEST(RecordedDepth, OfARealSenseBesideItsIntrinsics) {
  PALPATE_DATA_OR_SKIP(folder, "rec_realsense_bag");
  expect_recording("depth:" + (folder / "extracted_depth_000000.png").string(),
                   {1, 640, 480, {0.925, 0.935}, {0.5, 5.0}});
}

TEST(RecordedDepth, OfAnAzureKinectWithDistortion) {
  PALPATE_DATA_OR_SKIP(folder, "rec_azure_kinect_mkv");
  expect_recording("depth:" + folder.string(), {1, 640, 576, {0.2, 1.0}, {0.2, 2.2}});
  const auto frame = open_source("depth:" + folder.string())->next();
  EXPECT_TRUE(dynamic_cast<const DepthImage&>(*frame->cloud).intrinsics().distorted());
}

TEST(RecordedDepth, OfMovingPeopleInPairs) {
  PALPATE_DATA_OR_SKIP(nvblox, "pairs_dynamic_nvblox");
  expect_recording("depth:" + nvblox.string(), {2, 640, 480, {0.90, 0.92}, {2.1, 2.3}});
  PALPATE_DATA_OR_SKIP(pairs, "pairs_dynamic_jointvosf");
  for (const char* scene : {"cleaning_whiteboard", "opening_door", "person_standing", "robot",
                            "two_people_moving", "two_people_walking"}) {
    expect_recording(
        "depth:" + (pairs / scene).string() + "?fx=525&fy=525&cx=319.5&cy=239.5&units=5000",
        {2, 640, 480, {0.80, 0.95}, {0.5, 5.0}});
  }
}

TEST(RecordedDepth, OfAnAzureKinectInPairsWithoutIntrinsics) {
  PALPATE_DATA_OR_SKIP(folder, "pairs_azure_kinect_zdepth");
  expect_recording("depth:" + folder.string() + "?fx=252&fy=252&cx=159.5&cy=143.5&units=1000",
                   {6, 320, 288, {0.3, 1.0}, {0.3, 5.0}});
}

TEST(RecordedDepth, OfASingleBasketWithDistortionGivenAsOptions) {
  PALPATE_DATA_OR_SKIP(folder, "single_boofcv_basket");
  const std::string camera =
      "?fx=529.741&fy=529.572&cx=312.574&cy=257.051&units=1000&k1=0.17889&k2=-0.32301";
  expect_recording("depth:" + (folder / "basket_depth.png").string() + camera,
                   {1, 640, 480, {0.80, 0.82}, {0.3, 3.0}});
}

}  // namespace test_recorded_depth
}  // namespace palpate
