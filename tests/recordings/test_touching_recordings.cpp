// SPDX-License-Identifier: Apache-2.0
// The paper's method on real depth data: pressing and sliding on what a camera measured.
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/linear.hpp"
#include "palpate/kernel/methods/methods.hpp"

#include "tests/support/data.hpp"

namespace palpate {
namespace test_touching_recordings {

constexpr double r_c = 5e-3;

// A place on a surface and the surface's normal there, towards the camera.
struct Place {
  Vec3 point;
  Vec3 normal;
};

// How many points a gather finds within r_3 of a place.
std::size_t density(const Cloud& cloud, const Vec3& at) {
  Patch patch;
  gather(cloud, Ball{at, 2 * r_c}, patch);
  return patch.size();
}

// The surface about `point`, if it is one: points at most about 2.8 mm apart (a proxy needs that
// many under it to rest on noise) and within 5 mm of a
// plane, as far as the hand will slide, seen at less than 65 degrees from its normal.
std::optional<Place> smooth_place(const Cloud& cloud, const Vec3& point, const Vec3& eye) {
  Patch patch;
  gather(cloud, Ball{point, 0.035}, patch);
  if (patch.size() < 300) return std::nullopt;
  Eigen::Matrix3Xd points(3, patch.size());
  for (std::size_t i = 0; i < patch.size(); ++i)
    points.col(static_cast<Eigen::Index>(i)) = Vec3(patch.x()[i], patch.y()[i], patch.z()[i]);
  const Vec3 mean = points.rowwise().mean();
  const Eigen::Matrix3Xd centred = points.colwise() - mean;
  Vec3 normal = axes_of(centred * centred.transpose()).vectors.col(0);
  const Vec3 sightline = (point - eye).normalized();
  if (normal.dot(sightline) > 0.0) normal = -normal;
  if (normal.dot(sightline) > -0.42) return std::nullopt;
  if ((normal.transpose() * centred).cwiseAbs().maxCoeff() > r_c) return std::nullopt;
  const Vec3 middle = point + normal * normal.dot(mean);
  const Vec3 side = normal.unitOrthogonal();
  for (int i = 0; i < 12; ++i) {  // no hole or edge where the hand will slide
    for (const double radius : {0.012, 0.025}) {
      if (density(cloud, middle + radius * (Eigen::AngleAxisd(i * 0.5236, normal) * side)) < 40)
        return std::nullopt;
    }
  }
  return Place{middle, normal};
}

std::vector<Place> places_on(const Cloud& cloud, std::size_t most) {
  std::vector<Vec3> candidates;
  Vec3 eye = Vec3::Zero();
  if (const DepthImage* image = cloud.image()) {
    eye = image->world_from_camera().translation();
    const Intrinsics& k = image->intrinsics();
    for (int v = k.height / 24; v < k.height; v += k.height / 24) {
      for (int u = k.width / 32; u < k.width; u += k.width / 32) {
        if (const auto p = image->deproject(u, v)) candidates.push_back(*p);
      }
    }
  } else if (const auto* points = dynamic_cast<const PointCloud*>(&cloud)) {
    eye = points->viewpoint().value_or(eye);
    for (std::size_t i = 0; i < points->size(); i += std::max<std::size_t>(points->size() / 700, 1))
      candidates.push_back(points->point(i));
  }
  std::vector<Place> places;
  for (const Vec3& point : candidates) {
    if (places.size() == most) break;
    if (const auto place = smooth_place(cloud, point, eye)) places.push_back(*place);
  }
  return places;
}

struct Recording {
  const char* scheme;
  const char* path;
  const char* options;
  std::size_t least_places;  // that have to be found: the scene is known to be dense there
};

void PrintTo(const Recording& recording, std::ostream* out) { *out << recording.path; }

class Touching : public ::testing::TestWithParam<Recording> {};

INSTANTIATE_TEST_SUITE_P(
    Recordings, Touching,
    ::testing::Values(
        Recording{"tum:", "seq_tum_fr1_xyz", "", 5},
        Recording{"tum:", "seq_tum_fr1_xyz", "?poses=none", 5},
        Recording{"depth:", "seq_visp_tabletop_known_objects", "", 5},
        Recording{"depth:", "seq_aims_d435_robot_floor", "", 5},
        Recording{"depth:", "pairs_dynamic_nvblox", "", 5},
        Recording{"depth:", "rec_azure_kinect_mkv", "", 5},
        Recording{"depth:", "rec_realsense_bag", "", 5},
        Recording{"depth:", "single_boofcv_basket/basket_depth.png",
                  "?fx=529.74&fy=529.57&cx=312.57&cy=257.05&units=1000", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/mOSD_learn0.pcd", "", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/mOSD_learn33.pcd", "", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/milk_cartoon_all_small_clorox.pcd", "", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/table_scene_mug_stereo_textured.pcd", "", 5},
        Recording{"pcd:", "seq_pcl_grabber_3frames/pcd", "", 5}));

TEST_P(Touching, PressesAndSlidesOnARestingSurfaceWithoutPoppingThrough) {
  const Recording& recording = GetParam();
  PALPATE_DATA_OR_SKIP(path, recording.path);
  const auto source = open_source(recording.scheme + path.string() + recording.options);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  const std::vector<Place> places = places_on(*frame->cloud, 40);
  EXPECT_GE(places.size(), recording.least_places);

  for (const Place& place : places) {
    const auto method = make_method("paper");
    const Vec3 side = place.normal.unitOrthogonal();
    method->seat(place.point + 0.03 * place.normal);
    method->observe({*frame->cloud, 0.0});
    double largest = 0.0;
    for (int i = 0; i <= 900; ++i) {  // 10 mm deep within 0.3 s, then 10 mm sideways and back
      const double height = std::max(0.03 - i * (0.04 / 300), -0.01);
      const double slide = i < 300 ? 0.0 : 0.010 * std::sin((i - 300) * 0.0104719755);
      if (i % 33 == 32) method->observe({*frame->cloud, i * 1e-3});
      const Tick tick = method->tick(place.point + height * place.normal + slide * side, i * 1e-3);
      ASSERT_TRUE(tick.force.allFinite() && tick.proxy.allFinite());
      ASSERT_LE(tick.force.norm(), 20.0);
      largest = std::max(largest, tick.force.norm());
      // Points lie within 5 mm of the plane, so a resting proxy is at most that far below r_c, and
      // one that came through is with the hand.
      ASSERT_GT((tick.proxy - place.point).dot(place.normal), -1e-3)
          << "popped through at tick " << i;
    }
    EXPECT_GT(largest, 3.0) << "the hand felt too little, 10 mm deep";
  }
}

// Presses 10 mm into a place and stays there while `frames` come by; when the proxy was lost.
struct Hold {
  bool touched = false;
  std::optional<double> lost_at;  // [s]
};

Hold hold(const std::vector<Frame>& frames, const Place& place, std::string_view name = "paper") {
  Hold result;
  const auto method = make_method(name);
  method->seat(place.point + 0.02 * place.normal);
  std::size_t next = 0;
  const auto ticks = static_cast<int>(frames.back().stamp * 1000.0);
  for (int i = 0; i <= ticks; ++i) {
    const double t = i * 1e-3;
    for (; next < frames.size() && frames[next].stamp <= t; ++next)
      method->observe({*frames[next].cloud, frames[next].stamp});
    const double height = std::max(0.02 - i * 2e-4, -0.01);
    const Tick tick = method->tick(place.point + height * place.normal, t);
    EXPECT_TRUE(tick.force.allFinite() && tick.proxy.allFinite());
    EXPECT_LE(tick.force.norm(), 20.0);
    result.touched = result.touched || tick.force.norm() > 0.5;
    if (!result.lost_at && i > 200 && (tick.proxy - place.point).dot(place.normal) < -r_c)
      result.lost_at = t;
  }
  return result;
}

std::vector<Frame> frames_of(const std::string& uri, std::size_t most) {
  const auto source = open_source(uri);
  std::vector<Frame> frames;
  while (frames.size() < most) {
    auto frame = source->next();
    if (!frame) break;
    frames.push_back(std::move(*frame));
  }
  return frames;
}

TEST(TouchingNoise, HoldsWhatARestingRealSenseShowsForItsEightFramesAtRest) {
  PALPATE_DATA_OR_SKIP(path, "seq_visp_tabletop_known_objects");
  const std::vector<Frame> frames = frames_of("depth:" + path.string() + "?fps=30", 8);
  const std::vector<Place> places = places_on(*frames.front().cloud, 40);
  ASSERT_GE(places.size(), 5U);
  std::size_t held = 0;
  for (const Place& place : places) {
    const Hold result = hold(frames, place);
    EXPECT_TRUE(result.touched);
    held += result.lost_at ? 0 : 1;
  }
  EXPECT_GE(10 * held, 9 * places.size());
}

// A hand-held Kinect's poses and noise move the desk by millimetres from frame to frame; the
// paper's method makes contact everywhere and loses it within seconds (docs/method.md).
TEST(TouchingNoise, StaysFiniteAndBoundedWhileAHandHeldKinectMovesAboutADesk) {
  PALPATE_DATA_OR_SKIP(path, "seq_tum_fr1_xyz");
  const std::vector<Frame> frames = frames_of("tum:" + path.string(), 120);
  ASSERT_EQ(frames.size(), 120U);
  const std::vector<Place> places = places_on(*frames.front().cloud, 12);
  ASSERT_GE(places.size(), 5U);
  for (const Place& place : places) {
    const Hold result = hold(frames, place);
    EXPECT_TRUE(result.touched);
  }
}

// Some places are on a screen, which a Kinect loses and finds again centimetres away.
TEST(TouchingNoise, SightHoldsMostOfWhatAHandHeldKinectShowsAndThePapersMethodLoses) {
  PALPATE_DATA_OR_SKIP(path, "seq_tum_fr1_xyz");
  const std::vector<Frame> frames = frames_of("tum:" + path.string(), 120);
  const std::vector<Place> places = places_on(*frames.front().cloud, 12);
  ASSERT_GE(places.size(), 5U);
  std::size_t held = 0;
  std::size_t held_by_paper = 0;
  for (const Place& place : places) {
    held += hold(frames, place, "sight").lost_at ? 0 : 1;
    held_by_paper += hold(frames, place, "paper").lost_at ? 0 : 1;
  }
  EXPECT_GE(3 * held, 2 * places.size());
  EXPECT_EQ(held_by_paper, 0U);
}

}  // namespace test_touching_recordings
}  // namespace palpate
