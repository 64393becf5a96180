// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/sources/synthetic_camera.hpp"
#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/kernel/tool/shape_touch.hpp"

#include "tests/support/allocations.hpp"
#include "tests/support/sanitized.hpp"

namespace palpate {
namespace {

constexpr double stiffness = 600.0;  // [N/m]
constexpr double frame_time = 1.0 / 30.0;

std::shared_ptr<const ToolShape> tool(const std::string& text) {
  return make_tool(text, {});
}

HandPose pose(const Vec3& at, const Vec3& turn = Vec3::Zero()) {
  return {at, rotation_by(turn)};
}

// A tool before a synthetic camera, tick by tick.
class Stage {
 public:
  explicit Stage(Scene scene, const std::string& shape = "box:40x20x5mm",
                 const std::string& sensor = "ideal", double distance = 0.6, double tilt = 0.4)
      : camera_(std::move(scene), setup(distance, tilt), SensorModel::named(sensor)),
        touch_(tool(shape), Parameters{}) {}

  // From where it is for so long [s]; the last tick.
  Tick run(double duration, const std::function<HandPose(double)>& hand,
           const std::function<void(const Tick&)>& see = {}) {
    Tick tick;
    const double end = t_ + duration;
    for (; t_ < end - 1e-9; t_ += 1e-3) {
      if (streams && t_ >= frames_ * frame_time - 1e-9) {
        frame_ = camera_.capture(frames_ * frame_time, static_cast<std::uint64_t>(frames_));
        ++frames_;
        touch_.observe({*frame_.cloud, frame_.stamp});
      }
      tick = touch_.tick(hand(t_), t_);
      if (see) see(tick);
    }
    return tick;
  }
  // Comes down to a pose from `above` it [m] in a second, and stays for two.
  Tick press(const HandPose& at, double above = 0.03, const Vec3& from = Vec3::UnitZ()) {
    const double begin = t_;
    return run(3.0, [&](double t) {
      const double left = std::max(1.0 - (t - begin), 0.0);
      return HandPose{at.position + left * above * from, at.orientation};
    });
  }
  [[nodiscard]] ShapeTouch& touch() { return touch_; }
  [[nodiscard]] double now() const { return t_; }

  bool streams = true;  // are there new frames?

 private:
  static CameraSetup setup(double distance, double tilt) {
    CameraSetup setup;
    setup.world_from_camera = looking_at_origin(distance, tilt, 0.0);
    return setup;
  }
  SyntheticCamera camera_;
  ShapeTouch touch_;
  Frame frame_;
  int frames_ = 0;
  double t_ = 0.0;
};

Part part(Shape shape) {
  Part part;
  part.shape = std::move(shape);
  return part;
}

Scene plane() {
  return Scene({part(HalfSpace{})});
}

// What a spring pulls and turns that holds a tool with one point `lever` from the hand at a plane:
// the least energy of both springs (docs/tools.md, (2)).
struct Wrench6 {
  Vec3 force, torque;
};
Wrench6 one_point(const Vec3& lever, const Vec3& normal, double depth, double reach) {
  const double length = std::sqrt(ToolShape::usual_turning) * reach;
  const Vec3 arm = lever.cross(normal);
  const double push = stiffness * depth / (1.0 + arm.squaredNorm() / (length * length));
  return {push * normal, push * arm};
}

TEST(ShapeTouch, FeelsNothingInFreeSpace) {
  Stage stage(plane());
  double most = 0.0;
  stage.run(
      1.0,
      [](double t) {
        return pose({0.02 * t, 0, 0.02}, {0.3 * t, 0.2, t});
      },
      [&](const Tick& tick) {
        most = std::max(most, tick.force.norm() + tick.torque.norm());
        EXPECT_EQ(tick.proxy, tick.hip);
      });
  EXPECT_EQ(most, 0.0);
}

TEST(ShapeTouch, RestsFlatOnAPlane) {
  Stage stage(plane());
  const Tick tick = stage.press(pose({0, 0, 2.5e-3 - 5e-3}));
  EXPECT_NEAR(tick.force.z(), stiffness * 5e-3, 0.02 * stiffness * 5e-3);
  EXPECT_LT(tick.force.head<2>().norm(), 0.05);
  EXPECT_LT(tick.torque.norm(), 0.05 * stiffness * 5e-3 * 20e-3);
  EXPECT_NEAR(tick.proxy.z(), 2.5e-3, 1e-4);
  EXPECT_EQ(tick.state, ContactState::contact);
}

TEST(ShapeTouch, StandsOnAnEdgeAndOnACorner) {
  const auto shape = tool("box:40x20x5mm");
  for (const Vec3& turn : {Vec3(0, 0.3, 0), Vec3(0.25, 0.3, 0.0), Vec3(0, -0.5, 0.4)}) {
    const Rotation rotation = rotation_by(turn);
    Vec3 lowest = Vec3::Zero();
    int equal = 0;
    for (const ToolShape::Point& point : shape->points()) {
      const Vec3 lever = rotation * point.at;
      if (lever.z() < lowest.z() - 1e-6) lowest = lever, equal = 0;
      equal += std::abs(lever.z() - lowest.z()) < 1e-6 ? 1 : 0;
    }
    if (equal > 1) lowest.y() = 0.0;  // an edge along y: its middle
    const double depth = 5e-3;
    Stage stage(plane());
    const Tick tick = stage.press(pose({0, 0, -lowest.z() - depth}, turn));
    const Wrench6 truth = one_point(lowest, Vec3::UnitZ(), depth, shape->reach());
    const double scale = 0.05 * stiffness * depth;
    EXPECT_LT((tick.force - truth.force).norm(), scale)
        << tick.force.transpose() << " for " << truth.force.transpose();
    EXPECT_LT((tick.torque - truth.torque).norm(), scale * 20e-3)
        << tick.torque.transpose() << " for " << truth.torque.transpose();
  }
}

TEST(ShapeTouch, LiesInAConcaveCorner) {
  // Two planes at 45 degrees to the vertical; the box's lower edges are pressed into both.
  const double half = std::numbers::pi / 4;
  Part left = part(HalfSpace{}), right = left;
  left.world_from_part.linear() = rotation_by(Vec3(0, half, 0)).toRotationMatrix();
  right.world_from_part.linear() = rotation_by(Vec3(0, -half, 0)).toRotationMatrix();
  Stage stage(Scene({left, right}), "box:40x20x5mm", "ideal", 0.6, 0.0);
  // 20 mm to either side, its lower edges touch at z = 20 mm.
  const Tick tick = stage.press(pose({0, 0, 22.5e-3 - 5e-3}), 0.04);
  EXPECT_NEAR(tick.force.z(), stiffness * 5e-3, 0.05 * stiffness * 5e-3);
  EXPECT_LT(tick.torque.norm(), 0.05 * stiffness * 5e-3 * 20e-3);
}

// Hazard: tool-pushes
TEST(ShapeTouch, BeginsInsideAndFeelsNothingUntilItIsFree) {
  Stage stage(plane());
  const Tick inside = stage.run(0.5, [](double) { return pose({0, 0, -4e-3}); });
  EXPECT_EQ(inside.force.norm() + inside.torque.norm(), 0.0);
  stage.run(0.5, [](double) { return pose({0, 0, 10e-3}); });
  EXPECT_GT(stage.press(pose({0, 0, -2.5e-3})).force.z(), 2.5);
}

// Hazard: tool-pushes
TEST(ShapeTouch, IsNeverBehindASurfaceThatComes) {
  Part rising = part(HalfSpace{});
  rising.motion.start = 1.0;
  rising.motion.speed = 0.5;
  const Scene coming({rising});
  for (const double tilt : {0.0, 0.4}) {
    Stage stage(coming, "box:40x20x5mm", "ideal", 0.7, 0.0);
    double behind = 0.0;
    double most = 0.0;
    stage.run(
        1.4,
        [&](double) {
          return pose({0, 0, 0.03}, {tilt, tilt, 0});
        },
        [&](const Tick& tick) {
          const double height = 0.5 * std::max(tick.t - 1.0, 0.0);
          const double below = height - (tick.proxy.z() + 0.02 * std::sin(tilt) + 2.5e-3);
          behind = below > 5e-3 ? behind + 1e-3 : 0.0;
          most = std::max(most, behind);
        });
    EXPECT_LT(most, 0.1);
  }
}

// Hazard: tool-pushes
TEST(ShapeTouch, IsStoppedByTheSideOfABodyOfWhichTheEdgeAloneIsSeen) {
  // A block 60 mm high beside the tool, seen from straight above.
  Part block_ = part(block(Vec3(0.05, 0.05, 0.03)));
  block_.world_from_part.translation() = Vec3(0.05, 0, 0.03);
  Stage stage(Scene({part(HalfSpace{}), block_}), "box:20x20x20mm", "ideal", 0.5, 0.0);
  stage.run(0.5, [](double) { return pose({-0.04, 0, 0.02}); });
  const double begin = stage.now();
  const Tick tick = stage.run(2.0, [&](double t) {
    return pose({-0.04 + std::min(0.035, 0.05 * (t - begin)), 0, 0.02});
  });
  EXPECT_NEAR(tick.proxy.x(), -0.01, 1.5e-3);
  EXPECT_LT(tick.force.x(), -1.5);
  EXPECT_NEAR(tick.force.z(), 0.0, 0.5);
}

// Hazard: tool-pushes
TEST(ShapeTouch, KeepsThePartsOfOneWrenchAtItsLimit) {
  Parameters soft;
  soft.coupling.max_force = 1.0;
  Stage stage(plane());
  stage.touch().set_parameters(soft);
  const Tick tick = stage.press(pose({0, 0, 2e-3}, {0, 0.3, 0}));
  EXPECT_NEAR(tick.force.norm(), 1.0, 1e-9);
  EXPECT_TRUE((tick.flags & force_saturated) != 0);
  EXPECT_NEAR(tick.torque.norm(), 1.0 * 19e-3, 2e-3);
}

// Hazard: tool-pushes
TEST(ShapeTouch, LetsGoWhereFramesDoNotCome) {
  Stage stage(plane());
  const HandPose at = pose({0, 0, 0}, {0, 0.3, 0});
  const Tick pressed = stage.press(at);
  stage.streams = false;
  const auto hand = [&](double) { return at; };
  EXPECT_LT((stage.run(0.05, hand).force - pressed.force).norm(), 1e-9)
      << "one that is late takes nothing";
  EXPECT_LT(stage.run(0.09, hand).torque.norm(), 0.9 * pressed.torque.norm());
  const Tick gone = stage.run(0.2, hand);
  EXPECT_TRUE(gone.force.isZero(0.0) && gone.torque.isZero(0.0));
}

// Hazard: tool-pushes, not-a-number
TEST(ShapeTouch, FeelsNothingForAHandThatIsNowhere) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Stage stage(plane());
  const HandPose at = pose({0, 0, 0});
  const double pressed = stage.press(at).force.z();
  const double t = stage.now();
  const std::pair<HandPose, double> nowhere[] = {
      {{Vec3(0, nan, 0), at.orientation}, t},     {{Vec3(1e9, 0, 0), at.orientation}, t},
      {{at.position, Rotation(0.4, 0, 0, 0)}, t}, {{at.position, Rotation(2.1, 0, 0, 0)}, t},
      {{at.position, Rotation(nan, 0, 0, 0)}, t}, {at, nan}};
  for (const auto& [hand, when] : nowhere) {
    const Tick tick = stage.touch().tick(hand, when);
    EXPECT_TRUE(tick.force.isZero(0.0) && tick.torque.isZero(0.0));
    EXPECT_TRUE((tick.flags & non_finite_input) != 0);
    EXPECT_TRUE(tick.proxy.allFinite());
  }
  EXPECT_NEAR(stage.run(0.1, [&](double) { return at; }).force.z(), pressed, 0.05);
}

// Hazard: tool-pushes
TEST(ShapeTouch, PushesAndNeverPullsAHandThatIsTakenAway) {
  Parameters damped;
  damped.coupling.damping = 20.0;
  Stage stage(plane());
  stage.touch().set_parameters(damped);
  stage.press(pose({0, 0, 0}, {0, 0.3, 0}));
  const double begin = stage.now();
  stage.run(
      0.1,
      [&](double t) {
        return pose({0, 0, 0.3 * (t - begin)}, {0, 0.3 - 5.0 * (t - begin), 0});
      },
      [](const Tick& tick) { EXPECT_GE(tick.force.z(), -1e-9); });
}

TEST(ShapeTouch, AllocatesNothing) {
  if (!test::memory_is_counted) GTEST_SKIP() << "a sanitizer counts";
  Stage stage(plane());
  stage.press(pose({0, 0, 0}));
  const std::function<HandPose(double)> hand = [](double) { return pose({0, 0, 0}, {0, 0.1, 0}); };
  ShapeTouch& touch = stage.touch();
  const test::MemoryCalls calls;
  double force = 0.0;
  for (int i = 0; i < 20; ++i) force += touch.tick(hand(0), stage.now() + i * 1e-3).force.z();
  EXPECT_EQ(calls.count(), 0u);
  EXPECT_GT(force, 0.0);
}

// What is left of a signal above 20 Hz, rms.
class Rms {
 public:
  void add(const Vec3& value) {
    constexpr double share = 2.0 * std::numbers::pi * 20.0 * 1e-3;
    if (count_++ == 0) slow_ = value;
    slow_ += share / (1.0 + share) * (value - slow_);
    sum_ += (value - slow_).squaredNorm();
  }
  [[nodiscard]] double value() const { return std::sqrt(sum_ / count_); }

 private:
  Vec3 slow_ = Vec3::Zero();
  double sum_ = 0.0;
  int count_ = 0;
};

TEST(ShapeTouch, IsQuietBeforeANoisyCamera) {
  for (const double distance : {0.45, 0.7}) {
    if (test::sanitized && distance > 0.5) continue;
    Stage stage(plane(), "box:40x20x5mm", "d4xx", distance, 0.3);
    stage.press(pose({0, 0, -2.5e-3}));
    Rms force, torque;
    const Tick last = stage.run(
        3.0,
        [](double) {
          return pose({0, 0, -2.5e-3});
        },
        [&](const Tick& tick) {
          force.add(tick.force);
          torque.add(tick.torque);
        });
    EXPECT_NEAR(last.force.z(), 3.0, 0.6);
    EXPECT_LT(force.value(), 10e-3);
    EXPECT_LT(torque.value(), 1.5e-3);  // [N m]
  }
}

// The bits of a path: the image, the path and the tool are made without the mathematical library.
std::uint64_t hash_of_path() {
  Intrinsics k{.width = 160, .height = 120, .fx = 180.0, .fy = 181.0, .cx = 79.3, .cy = 60.1};
  const auto rays = std::make_shared<const ViewingRays>(k);
  ShapeTouch touch(tool("box:40x20x10mm?points=500"), Parameters{});
  std::uint64_t hash = 0xcbf29ce484222325U;
  std::unique_ptr<DepthImage> image;
  double force = 0.0;
  for (int i = 0; i < 600; ++i) {
    const double t = i * 1e-3;
    if (i % 33 == 0) {
      std::vector<std::uint16_t> depth;
      for (int pixel = 0; pixel < k.width * k.height; ++pixel)
        depth.push_back(
            static_cast<std::uint16_t>(500 + (pixel % k.width) / 16 + (pixel * 7 + i) % 3));
      auto next = std::make_unique<DepthImage>(rays, std::move(depth), 1000.0);
      touch.observe({*next, t});
      image = std::move(next);
    }
    const double z = 0.47 + std::min(0.035, 1e-4 * i);
    const Tick tick =
        touch.tick(HandPose{{1e-5 * i, 0, z}, Rotation(1.0, 0.1, 1e-4 * i, 0.05).normalized()}, t);
    force = tick.force.norm();
    for (const Vec3* v : {&tick.proxy, &tick.force, &tick.torque})
      for (int axis = 0; axis < 3; ++axis)
        hash = (hash ^ std::bit_cast<std::uint64_t>((*v)[axis])) * 0x100000001b3U;
  }
  EXPECT_GT(force, 0.5);
  return hash;
}

// No compiler, processor or vector set may change them.
TEST(ShapeTouch, GivesTheSameBitsEverywhere) {
  const std::string usual(vector_set_in_use());
  for (const std::string_view set : vector_sets()) {
    use_vector_set(set);
    EXPECT_EQ(hash_of_path(), 17351193844532323594U) << set;
  }
  use_vector_set(usual);
}

}  // namespace
}  // namespace palpate
