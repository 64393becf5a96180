// SPDX-License-Identifier: Apache-2.0
// The paper's method on real depth data: pressing and sliding on what a camera measured.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/cloud/audit.hpp"
#include "palpate/cloud/depth_image.hpp"
#include "palpate/cloud/point_cloud.hpp"
#include "palpate/core/renderer.hpp"
#include "palpate/sources/source.hpp"

#include "tests/support/data.hpp"

namespace palpate {
namespace {

constexpr double r_c = 5e-3;

// A place on a surface, and from where it was seen.
struct Place {
  Vec3 point;
  Vec3 sightline;  // unit, from the camera to the point
};

// How many points a gather finds within r_3 of a place.
std::size_t density(const Cloud& cloud, const Vec3& at) {
  Patch patch;
  gather(cloud, Ball{at, 2 * r_c}, patch);
  return patch.size();
}

// Is the surface about `place` whole, wide and of one layer? Every point within 30 mm has to lie
// within 15 mm of it along the sightline, and points have to be at most about r_c / 2 apart.
bool is_dense_and_smooth(const Cloud& cloud, const Place& place) {
  if (density(cloud, place.point) < 50) return false;
  Patch patch;
  gather(cloud, Ball{place.point, 0.03}, patch);
  double lowest = 0.0;
  double highest = 0.0;
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const double along = place.sightline.dot(Vec3(patch.x()[i], patch.y()[i], patch.z()[i]));
    lowest = std::min(lowest, along);
    highest = std::max(highest, along);
  }
  if (highest - lowest > 0.015) return false;
  for (int i = 0; i < 12; ++i) {  // no hole where the hand will slide
    const Vec3 side = place.sightline.unitOrthogonal();
    const Vec3 around = Eigen::AngleAxisd(i * 0.5236, place.sightline) * side;
    if (density(cloud, place.point + 0.015 * around) < 40) return false;
  }
  return true;
}

std::vector<Place> places_on(const Cloud& cloud, std::size_t most) {
  std::vector<Place> candidates;
  if (const auto* image = dynamic_cast<const DepthImage*>(&cloud)) {
    const Vec3 eye = image->world_from_camera().translation();
    const Intrinsics& k = image->intrinsics();
    for (int v = k.height / 12; v < k.height; v += k.height / 12) {
      for (int u = k.width / 16; u < k.width; u += k.width / 16) {
        if (const auto p = image->deproject(u, v))
          candidates.push_back({*p, (*p - eye).normalized()});
      }
    }
  } else if (const auto* points = dynamic_cast<const PointCloud*>(&cloud)) {
    const Vec3 eye = points->viewpoint().value_or(Vec3::Zero());
    for (std::size_t i = 0; i < points->size(); i += std::max<std::size_t>(points->size() / 300, 1))
      candidates.push_back({points->point(i), (points->point(i) - eye).normalized()});
  }
  std::vector<Place> places;
  for (const Place& place : candidates) {
    if (places.size() < most && is_dense_and_smooth(cloud, place)) places.push_back(place);
  }
  return places;
}

struct Recording {
  const char* scheme;
  const char* path;
  const char* options;
  std::size_t least_places;  // that have to be found: the scene is known to be dense there
};

void PrintTo(const Recording& recording, std::ostream* out) {
  *out << recording.path;
}

class Touching : public ::testing::TestWithParam<Recording> {};

INSTANTIATE_TEST_SUITE_P(
    Recordings, Touching,
    ::testing::Values(
        Recording{"tum:", "seq_tum_fr1_xyz", "", 5},
        Recording{"tum:", "seq_tum_fr1_xyz", "?poses=none", 5},
        Recording{"depth:", "seq_visp_tabletop_known_objects", "", 5},
        Recording{"depth:", "seq_aims_d435_robot_floor", "", 1},
        Recording{"depth:", "pairs_dynamic_nvblox", "", 0},
        Recording{"depth:", "rec_azure_kinect_mkv", "", 5},
        Recording{"depth:", "rec_realsense_bag", "", 0},
        Recording{"depth:", "single_boofcv_basket/basket_depth.png",
                  "?fx=529.74&fy=529.57&cx=312.57&cy=257.05&units=1000", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/mOSD_learn0.pcd", "", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/mOSD_learn33.pcd", "", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/milk_cartoon_all_small_clorox.pcd", "", 5},
        Recording{"pcd:", "single_pcl_kinect_scenes/table_scene_mug_stereo_textured.pcd", "", 5},
        Recording{"pcd:", "seq_pcl_grabber_3frames/pcd", "", 1}));

TEST_P(Touching, PressesAndSlidesOnARestingSurfaceWithoutPoppingThrough) {
  const Recording& recording = GetParam();
  PALPATE_DATA_OR_SKIP(path, recording.path);
  const auto source = open_source(recording.scheme + path.string() + recording.options);
  const auto frame = source->next();
  ASSERT_TRUE(frame);
  const std::vector<Place> places = places_on(*frame->cloud, 40);
  EXPECT_GE(places.size(), recording.least_places);

  for (const Place& place : places) {
    Renderer renderer;
    const Vec3 side = place.sightline.unitOrthogonal();
    renderer.seat(place.point - 0.03 * place.sightline);
    renderer.frame(*frame->cloud, 0.0);
    double largest = 0.0;
    for (int i = 0; i <= 900; ++i) {  // in 8 mm deep within 0.3 s, then 10 mm sideways and back
      const double depth = std::min(-0.03 + i * (0.038 / 300), 0.008);
      const double slide = i < 300 ? 0.0 : 0.010 * std::sin((i - 300) * 0.0104719755);
      if (i % 33 == 32) renderer.frame(*frame->cloud, i * 1e-3);
      const Tick tick =
          renderer.tick(place.point + depth * place.sightline + slide * side, i * 1e-3);
      ASSERT_TRUE(tick.force.allFinite() && tick.proxy.allFinite());
      ASSERT_LE(tick.force.norm(), 20.0);
      largest = std::max(largest, tick.force.norm());
      // The hand is 8 mm behind the surface and the surface 15 mm rough at most: a proxy that came
      // through would be with the hand.
      if (i >= 300) {
        ASSERT_LT((tick.proxy - place.point).dot(place.sightline), 0.008)
            << "popped through at tick " << i;
      }
    }
    EXPECT_GT(largest, 1.0) << "the hand felt nothing";
  }
}

TEST(TouchingTum, HoldsARestingDeskForFourSecondsSeenByAMovingKinect) {
  PALPATE_DATA_OR_SKIP(path, "seq_tum_fr1_xyz");
  const auto source = open_source("tum:" + path.string());
  std::vector<Frame> frames;
  while (auto frame = source->next()) frames.push_back(*frame);
  ASSERT_EQ(frames.size(), 120U);
  const std::vector<Place> places = places_on(*frames.front().cloud, 12);
  ASSERT_GE(places.size(), 5U);
  std::size_t held = 0;
  for (const Place& place : places) {
    Renderer renderer;
    renderer.seat(place.point - 0.02 * place.sightline);
    std::size_t next = 0;
    bool lost = false;
    for (int i = 0; i < 3900; ++i) {
      const double t = i * 1e-3;
      while (next < frames.size() && frames[next].stamp <= t) {
        renderer.frame(*frames[next].cloud, frames[next].stamp);
        ++next;
      }
      const double depth = std::min(-0.02 + i * 1e-4, 0.01);
      const Tick tick = renderer.tick(place.point + depth * place.sightline, t);
      ASSERT_TRUE(tick.force.allFinite());
      ASSERT_LE(tick.force.norm(), 20.0);
      const auto* image = dynamic_cast<const DepthImage*>(frames[next - 1].cloud.get());
      const auto behind = distance_behind(*image, tick.proxy, r_c);
      lost = lost || (i > 300 && behind && *behind > 2 * r_c);
    }
    held += lost ? 0 : 1;
  }
  RecordProperty("places", static_cast<int>(places.size()));
  RecordProperty("held", static_cast<int>(held));
  std::printf("held %zu of %zu places\n", held, places.size());
  EXPECT_GE(held, places.size() / 2);
}

}  // namespace
}  // namespace palpate
