// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/methods/methods.hpp"
#include "palpate/session/press.hpp"

#include "tests/support/errors.hpp"

namespace palpate {
namespace test_press {

using test::fails_saying;

constexpr int width = 64;
constexpr int height = 48;

Intrinsics camera() {
  Intrinsics k;
  k.width = width;
  k.height = height;
  k.fx = k.fy = 60.0;
  k.cx = 31.5;
  k.cy = 23.5;
  return k;
}

// Depth in 0.1 mm; 0 is a hole.
DepthImage image_of(const std::function<double(int, int)>& depth,
                    const Eigen::Isometry3d& pose = Eigen::Isometry3d::Identity()) {
  std::vector<std::uint16_t> raw;
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u)
      raw.push_back(static_cast<std::uint16_t>(std::lround(1e4 * depth(u, v))));
  }
  return {std::make_shared<const ViewingRays>(camera()), std::move(raw), 1e4, pose};
}

TEST(SurfaceAt, PressesTheMedianOfANoisySurface) {
  const DepthImage image = image_of([](int u, int v) {
    if (u == 20 && v == 20) return 0.0;   // a hole at the pixel itself
    return (u + v) % 5 == 0 ? 0.9 : 0.5;  // outliers
  });
  EXPECT_NEAR(surface_at(image, {20, 20}).z(), 0.5, 1e-12);
}

// Frames at 30 Hz, then none.
class Frames final : public Source {
 public:
  explicit Frames(std::vector<std::shared_ptr<const Cloud>> clouds, bool live = false)
      : clouds_(std::move(clouds)), info_{.uri = "made:", .kind = "made", .live = live} {}
  std::optional<Frame> next(double /*timeout*/) override {
    if (next_ == clouds_.size()) return std::nullopt;
    const double stamp = static_cast<double>(next_) / 30.0;
    return Frame{stamp, clouds_[next_++]};
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  std::vector<std::shared_ptr<const Cloud>> clouds_;
  std::size_t next_ = 0;
  SourceInfo info_;
};

struct Pressed {
  std::vector<Tick> ticks;
  Pixel pixel;
  [[nodiscard]] int felt() const {
    int count = 0;
    for (const Tick& tick : ticks) count += tick.force.norm() > 1.0 ? 1 : 0;
    return count;
  }
};

Pressed pressed(const std::vector<std::shared_ptr<const Cloud>>& clouds, Pixel at,
                const PressOptions& options = {}, bool live = false) {
  std::vector<std::unique_ptr<Source>> sources;
  sources.push_back(std::make_unique<Frames>(clouds, live));
  FrameSequence frames(std::move(sources));
  Press press(*clouds.front(), at, options);
  const auto method = make_method("sight", Parameters{}, standard_methods());
  Pressed result;
  touch_along(frames, *method, press, 1000.0, [&](const Tick& tick) {
    result.ticks.push_back(tick);
    return true;
  });
  EXPECT_TRUE(press.done());
  result.pixel = press.pixel();
  return result;
}

std::shared_ptr<const Cloud> shared(DepthImage image) {
  return std::make_shared<DepthImage>(std::move(image));
}

TEST(Press, IsFeltInFilesThatEndBeforeItTouches) {
  for (const std::size_t count : {1U, 2U, 10U}) {
    const std::vector<std::shared_ptr<const Cloud>> clouds(
        count, shared(image_of([](int, int) { return 0.3; })));
    const Pressed once = pressed(clouds, {30, 20});
    EXPECT_GE(once.felt(), 100) << count;
    const Pressed again = pressed(clouds, {30, 20});
    ASSERT_EQ(once.ticks.size(), again.ticks.size());
    for (std::size_t i = 0; i < once.ticks.size(); ++i)
      ASSERT_EQ(once.ticks[i].force, again.ticks[i].force) << i;
  }
}

// What a camera saw that stopped grows old: only a recording that ended says that it is valid.
TEST(Press, GetsNoForceOfALiveCameraThatStopped) {
  const std::vector<std::shared_ptr<const Cloud>> clouds(
      10, shared(image_of([](int, int) { return 0.3; })));
  EXPECT_EQ(pressed(clouds, {30, 20}, {.patience = 2.0}, true).felt(), 0);
}

TEST(Press, FollowsWhatThePixelSeesWithBoundedSpeed) {
  std::vector<std::shared_ptr<const Cloud>> clouds;
  for (int k = 0; k < 60; ++k) {
    clouds.push_back(shared(image_of([k](int, int) { return 0.3 + (k < 8 ? 0.0 : 0.05); })));
  }
  const Pressed result = pressed(clouds, {30, 20});
  EXPECT_GE(result.felt(), 100);
  for (std::size_t i = 1; i < result.ticks.size(); ++i)
    ASSERT_LE((result.ticks[i].hip - result.ticks[i - 1].hip).norm(), 1e-3 * Press::travel + 1e-9);
}

TEST(Press, TakesTheNearestSurfaceAtAHole) {
  const auto image = shared(image_of([](int u, int) { return u < 40 ? 0.3 : 0.0; }));
  const Pressed result = pressed({image}, {50, 20});
  EXPECT_LT(result.pixel.u, 40);
  EXPECT_GT(result.pixel.u, 25);
  EXPECT_EQ(result.pixel.v, 20);
  EXPECT_GE(result.felt(), 100);
}

TEST(Press, TakesThePixelOfTheProposedViewOfPoints) {
  std::vector<Vec3> points;
  for (int i = 0; i < 100; ++i) {
    for (int j = 0; j < 100; ++j) points.emplace_back(0.002 * (i - 50), 0.002 * (j - 50), 0.5);
  }
  const auto cloud = std::make_shared<PointCloud>(points);
  const ProposedView view = proposed_view(*cloud);
  EXPECT_TRUE(view.world_from_camera.translation().isZero()) << "the sensor's side";
  for (const Vec3& point : points) {
    const Vec3 p = view.world_from_camera.inverse() * point;
    const Intrinsics& k = view.rays->intrinsics();
    EXPECT_GE(k.fx * p.x() / p.z() + k.cx, 0.0);
    EXPECT_LE(k.fx * p.x() / p.z() + k.cx, 639.0);
    EXPECT_GE(k.fy * p.y() / p.z() + k.cy, 0.0);
    EXPECT_LE(k.fy * p.y() / p.z() + k.cy, 479.0);
  }
  EXPECT_GE(pressed({cloud}, {320, 240}).felt(), 100);
  EXPECT_TRUE(fails_saying([&] { return Press(*cloud, {640, 0}).done(); }, "pixel 640,0", "639"));
}

TEST(Press, SlidesToAnotherPixel) {
  const auto image = shared(image_of([](int, int) { return 0.3; }));
  const Pressed result = pressed({image}, {12, 24}, {.slide_to = Pixel{50, 24}});
  double farthest = 0.0;
  for (const Tick& tick : result.ticks) farthest = std::max(farthest, tick.hip.x());
  EXPECT_NEAR(farthest, 0.308 * (50 - 31.5) / 60.0, 2e-3);
}

TEST(Press, RefusesWhatCannotBePressed) {
  const DepthImage image = image_of([](int u, int) { return u < 20 ? 0.5 : 0.0; });
  EXPECT_TRUE(fails_saying([&] { return Press(image, {64, 0}).done(); }, "pixel 64,0", "outside"));
  EXPECT_TRUE(fails_saying([&] { return Press(image, {-1, 0}).done(); }, "outside"));
  const DepthImage empty = image_of([](int, int) { return 0.0; });
  EXPECT_TRUE(fails_saying([&] { return Press(empty, {1, 1}).done(); }, "nor anywhere else"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return Press(image, {4, 11}, {.depth = 1.0}).done();
      },
      "press depth"));
  EXPECT_TRUE(fails_saying(
      [&] {
        return Press(image, {4, 11}, {.speed = 0.0}).done();
      },
      "press speed"));
}

TEST(ParsePixel, ReadsColumnAndRow) {
  EXPECT_EQ(parse_pixel("320,240", "--at").u, 320);
  EXPECT_EQ(parse_pixel("320,240", "--at").v, 240);
  for (const char* bad : {"", "3", "3,", ",4", "3,4,5", "a,4", "3;4", "3,4 ", "1.5,2"}) {
    EXPECT_TRUE(fails_saying([&] { return parse_pixel(bad, "--at"), 0; }, "--at", "320,240"));
  }
}

}  // namespace test_press
}  // namespace palpate
