// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <chrono>
#include <cmath>
#include <future>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/session/camera_feed.hpp"
#include "palpate/session/frame_sequence.hpp"
#include "palpate/session/session.hpp"

namespace palpate {
namespace test_follow {

constexpr double radius = 0.05;   // [m] of the ball
constexpr double pressed = 5e-3;  // [m] into it
constexpr double pi = std::numbers::pi;

struct Mesh {
  std::vector<Vec3> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

// An octahedron whose triangles are cut in four, with all corners on the ball: 32,768 triangles.
Mesh ball() {
  Mesh mesh{
      {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
      {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
  for (int level = 0; level < 6; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      const auto [at, is_new] =
          middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.points.size()));
      if (is_new) mesh.points.push_back((mesh.points[a] + mesh.points[b]).normalized());
      return at->second;
    };
    std::vector<std::array<std::uint32_t, 3>> finer;
    for (const auto& [a, b, c] : mesh.triangles) {
      const std::uint32_t ab = middle(a, b);
      const std::uint32_t bc = middle(b, c);
      const std::uint32_t ca = middle(c, a);
      for (const auto& t : {std::array{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}})
        finer.push_back(t);
    }
    mesh.triangles = std::move(finer);
  }
  for (Vec3& point : mesh.points) point *= radius;
  return mesh;
}

std::unique_ptr<Source> camera(const Mesh& mesh) {
  return std::make_unique<VirtualCamera>(
      std::make_unique<MeshBody>(mesh.points, mesh.triangles, "a ball"), 60.0, SourceInfo{});
}

// Down onto the ball from above, then all round it.
HipPath round_path(const Vec3& sideways) {
  std::vector<HipPath::Sample> samples;
  double t = 0.0;
  const auto add = [&](double height, double angle) {
    const Vec3 out = std::cos(angle) * Vec3::UnitZ() + std::sin(angle) * sideways;
    samples.push_back({t, (radius + height) * out});
    t += 0.005;
  };
  for (int i = 0; i <= 100; ++i) add(0.03 - i * (0.03 + pressed) / 100.0, 0.0);
  for (int i = 0; i <= 600; ++i) add(-pressed, 2.0 * pi * i / 600.0);
  return HipPath(samples);
}

struct Round {
  std::vector<Vec3> forces;
  std::size_t poses = 0, contact = 0, through = 0;
  double least = 1e9, most = 0.0, worst_angle = 0.0;  // [N], [rad] off the radius
};

Round stroke(const Mesh& mesh, const Vec3& sideways) {
  std::vector<std::unique_ptr<Source>> sources;
  sources.push_back(camera(mesh));
  FrameSequence frames(std::move(sources));
  const auto method = make_method("sight", Parameters(), standard_methods());
  Round round;
  Eigen::Matrix4d pose = Eigen::Matrix4d::Zero();
  touch_along(frames, *method, round_path(sideways), 1000.0, [&](const Tick& tick) {
    round.forces.push_back(tick.force);
    const Eigen::Matrix4d now = frames.newest()[0]->image()->world_from_camera().matrix();
    round.poses += now == pose ? 0 : 1;
    pose = now;
    if (round.forces.size() < 600) return true;  // it arrives
    ++round.contact;
    round.through += tick.proxy.norm() < radius ? 1 : 0;
    const double force = tick.force.norm();
    round.least = std::min(round.least, force);
    round.most = std::max(round.most, force);
    round.worst_angle = std::max(round.worst_angle,
                                 std::acos(tick.force.dot(tick.hip) / (force * tick.hip.norm())));
    return true;
  });
  return round;
}

TEST(Follow, FeelsABallAllRoundWithTheSameForce) {
  const Mesh mesh = ball();
  const double expected = Parameters().coupling.stiffness * pressed;  // [N]
  for (const Vec3& sideways : {Vec3(1, 0, 0), Vec3(0.6, 0.8, 0)}) {
    const Round round = stroke(mesh, sideways);
    EXPECT_GT(round.poses, 15U) << "the camera goes round";
    EXPECT_LT(round.poses, 60U) << "and does not follow each frame";
    EXPECT_EQ(round.through, 0U);
    EXPECT_GT(round.least, 0.95 * expected);
    EXPECT_LT(round.most, 1.05 * expected);
    EXPECT_LT(round.worst_angle, 5.0 * pi / 180.0);
  }
}

TEST(Follow, GivesTheSameForcesForTheSamePath) {
  const Mesh mesh = ball();
  EXPECT_EQ(stroke(mesh, Vec3::UnitX()).forces, stroke(mesh, Vec3::UnitX()).forces);
}

TEST(Follow, IsWhatASessionTellsItsCamera) {
  SessionOptions options;
  options.cameras.resize(1);
  options.open_cameras.push_back(camera(ball()));
  options.open_devices[0] = std::make_unique<ScriptedDevice>(round_path(Vec3::UnitY()), false);
  options.pace = Pace::free_running;
  options.safety.max_force = 10.0;
  Session session(std::move(options));
  std::size_t ticks = 0;
  session.run(3.5, [&](const ServoTick& tick) {
    if (++ticks > 600) {
      EXPECT_NEAR(tick.tick.force.norm(), 3.0, 0.15) << ticks;
    }
  });
  EXPECT_EQ(ticks, 3500U);
}

// Says where it was told the hand is.
class Follower final : public Source {
 public:
  explicit Follower(std::promise<Vec3> told) : told_(std::move(told)) {}
  std::optional<Frame> next(double /*timeout*/) override {
    return Frame{1e-3 * static_cast<double>(number_++),
                 std::make_shared<BruteForceCloud>(std::vector<Vec3>{Vec3::Zero()})};
  }
  void follow(const Vec3& hand) override {
    if (!std::exchange(is_told_, true)) told_.set_value(hand);
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  std::promise<Vec3> told_;
  bool is_told_ = false;
  int number_ = 0;
  SourceInfo info_{.uri = "follower:", .kind = "follower"};
};

TEST(Follow, IsCalledOnTheThreadOfACamera) {
  std::promise<Vec3> told;
  std::future<Vec3> where = told.get_future();
  CameraFeed feed(std::make_unique<Follower>(std::move(told)));
  feed.start([](const FedFrame&) {}, [] { return std::optional(Vec3(1, 2, 3)); });
  ASSERT_EQ(where.wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_EQ(where.get(), Vec3(1, 2, 3));
}

}  // namespace test_follow
}  // namespace palpate
