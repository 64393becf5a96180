// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/point_file.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/session/frame_sequence.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_splat {

using test::fails_saying;

constexpr double pi = std::numbers::pi;
constexpr double radius = 0.05;   // [m] of the ball
constexpr double pressed = 5e-3;  // [m] into it
constexpr std::size_t count = 8000;

// Flat Gaussians side by side on a ball, 2 mm apart, with their thin axis, z, outwards.
std::vector<Gaussian> ball() {
  std::vector<Gaussian> all;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / count;
    const double angle = pi * (3.0 - std::sqrt(5.0)) * static_cast<double>(i);
    const double r = std::sqrt(1.0 - z * z);
    const Vec3 out(r * std::cos(angle), r * std::sin(angle), z);
    all.push_back({(radius * out).cast<float>(),
                   {1.5e-3F, 1.5e-3F, 1e-4F},
                   Eigen::Quaternionf::FromTwoVectors(Eigen::Vector3f::UnitZ(), out.cast<float>()),
                   0.95F});
  }
  return all;
}

// As a training program writes it: properties that nobody asks for are between.
std::string file_of(const std::vector<Gaussian>& gaussians) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                     std::to_string(gaussians.size()) + "\n";
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                           "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    text += std::string("property float ") + name + "\n";
  text += "end_header\n";
  for (const Gaussian& g : gaussians) {
    const std::array<float, 17> row{g.mean.x(),
                                    g.mean.y(),
                                    g.mean.z(),
                                    0,
                                    0,
                                    0,
                                    0,
                                    0,
                                    0,
                                    std::log(g.opacity / (1.0F - g.opacity)),
                                    std::log(g.sigma.x()),
                                    std::log(g.sigma.y()),
                                    std::log(g.sigma.z()),
                                    g.turn.w(),
                                    g.turn.x(),
                                    g.turn.y(),
                                    g.turn.z()};
    text.append(reinterpret_cast<const char*>(row.data()), sizeof row);
  }
  return text;
}

struct Forces {
  double least = 1e9, most = 0.0, worst_angle = 0.0;  // [N], [rad] off the radius
};

// Down onto the ball, then all round it.
Forces round(std::unique_ptr<const Body> body) {
  std::vector<std::unique_ptr<Source>> sources;
  sources.push_back(std::make_unique<VirtualCamera>(std::move(body), 60.0, SourceInfo{}));
  FrameSequence frames(std::move(sources));
  std::vector<HipPath::Sample> samples;
  const auto add = [&](double height, double angle) {
    samples.push_back({5e-3 * static_cast<double>(samples.size()),
                       (radius + height) * Vec3(std::sin(angle), 0.0, std::cos(angle))});
  };
  for (int i = 0; i <= 100; ++i) add(0.03 - i * (0.03 + pressed) / 100.0, 0.0);
  for (int i = 0; i <= 600; ++i) add(-pressed, 2.0 * pi * i / 600.0);
  const auto method = make_method("sight", Parameters(), standard_methods());
  Forces forces;
  int ticks = 0;
  touch_along(frames, *method, HipPath(samples), 1000.0, [&](const Tick& tick) {
    if (++ticks < 600) return true;
    const double force = tick.force.norm();
    forces.least = std::min(forces.least, force);
    forces.most = std::max(forces.most, force);
    forces.worst_angle = std::max(forces.worst_angle,
                                  std::acos(tick.force.dot(tick.hip) / (force * tick.hip.norm())));
    return true;
  });
  return forces;
}

Forces round(const std::vector<Gaussian>& gaussians) {
  return round(std::make_unique<SplatBody>(gaussians, "a ball"));
}

// Distances to the ball in voxels of 3 mm, cut off at 12 mm as a TSDF's.
TEST(Volume, IsABallAllRound) {
  constexpr int side = 42;  // [voxels]
  std::string text =
      "NRRD0004\ntype: float\ndimension: 3\nsizes: 42 42 42\nencoding: raw\nendian: little\n"
      "spacings: 0.003 0.003 0.003\nspace origin: (-0.0615,-0.0615,-0.0615)\n\n";
  for (int i = 0; i < side * side * side; ++i) {
    const Vec3 at = 3e-3 * Vec3(i % side, i / side % side, i / side / side) - 0.0615 * Vec3::Ones();
    const auto value = static_cast<float>(std::clamp(at.norm() - radius, -0.012, 0.012));
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  const PointFile file = parse_nrrd(std::as_bytes(std::span(text)), "ball.nrrd", "");
  const double expected = Parameters().coupling.stiffness * pressed;  // [N]
  const Forces forces = round(std::make_unique<MeshBody>(file.points, file.triangles, "a ball"));
  EXPECT_GT(forces.least, 0.95 * expected);
  EXPECT_LT(forces.most, 1.05 * expected);
  EXPECT_LT(forces.worst_angle, 5.0 * pi / 180.0);
}

TEST(Splat, IsABallAllRound) {
  const double expected = Parameters().coupling.stiffness * pressed;  // [N]
  const Forces forces = round(ball());
  EXPECT_GT(forces.least, 0.95 * expected);
  EXPECT_LT(forces.most, 1.05 * expected);
  EXPECT_LT(forces.worst_angle, 5.0 * pi / 180.0);
}

TEST(Splat, IsFeltBehindFog) {
  const double expected = Parameters().coupling.stiffness * pressed;  // [N]
  std::vector<Gaussian> gaussians = ball();
  for (std::size_t i = 0; i < count; i += 4) {
    Gaussian fog = gaussians[i];
    fog.mean *= 1.2F;
    fog.sigma = {3e-3F, 3e-3F, 3e-3F};
    fog.opacity = 0.06F;
    gaussians.push_back(fog);
  }
  const Forces forces = round(gaussians);
  EXPECT_GT(forces.least, 0.93 * expected);
  EXPECT_LT(forces.most, 1.07 * expected);
}

// Its Gaussians lie above and below one another, and a camera that asks the nearest one where space
// is free would look from inside.
TEST(Splat, IsSeenFromOutsideThoughItIsRough) {
  std::mt19937 random(1);
  std::normal_distribution<float> off(0.0F, 1e-3F);  // [m]
  std::vector<Gaussian> gaussians = ball();
  for (Gaussian& g : gaussians) g.mean += off(random) * g.mean.normalized();
  VirtualCamera camera(std::make_unique<SplatBody>(gaussians, "a rough ball"), 60.0, SourceInfo{});
  double above = 0.0, points = 0.0;  // [m] of all points together
  for (int i = -30; i <= 360; ++i) {
    const double height = std::max(-1e-3 * i, 0.0) - pressed;
    const double angle = pi * std::max(i, 0) / 180.0;
    const Vec3 out(std::sin(angle), 0.0, std::cos(angle));
    camera.follow((radius + height) * out);
    const auto cloud = camera.next()->cloud;
    EXPECT_GT(-cloud->image()->world_from_camera().linear().col(2).dot(out), 0.5) << i;
    for (const Vec3& point : cloud->image()->points()) {
      above += point.norm() - radius;
      ++points;
    }
  }
  EXPECT_LT(above / points, 0.6e-3) << "those that stick out are not the surface";
}

// Beside a hole `sight` keeps to its fit, whose heights are over the plane that the camera faced
// first: they lean more and more while both go round.
TEST(Splat, IsABallAllRoundThoughItHasHoles) {
  const double expected = Parameters().coupling.stiffness * pressed;  // [N]
  std::vector<Gaussian> gaussians = ball();
  std::mt19937 random(1);
  for (int i = 0; i < 16; ++i) {
    const Eigen::Vector3f hole = gaussians[random() % gaussians.size()].mean;
    std::erase_if(gaussians, [&](const Gaussian& g) { return (g.mean - hole).norm() < 4e-3F; });
  }
  const Forces forces = round(gaussians);
  EXPECT_GT(forces.least, 0.9 * expected);
  EXPECT_LT(forces.most, 1.1 * expected);
}

TEST(Splat, HasNoFloaters) {
  std::vector<Gaussian> gaussians = ball();
  for (std::size_t i = 0; i < count; i += 400) {
    for (const float height : {1.25F, 1.3F}) {  // in pairs that touch one another
      gaussians.push_back(gaussians[i]);
      gaussians.back().mean *= height;
    }
  }
  const SplatBody body(gaussians, "a ball with floaters");
  EXPECT_EQ(body.size(), count);
  EXPECT_EQ(body.floaters(), count / 200);
  EXPECT_LT(body.bounds().high.z(), radius + 5e-3);
  EXPECT_TRUE(fails_saying([&] { SplatBody({gaussians.back()}, "one"); }, "one", "beside it"));
}

TEST(Splat, FogAloneHasNoDepth) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> some(-0.5F, 0.5F);
  const auto drawn = [&](float thick) {
    std::vector<Gaussian> gaussians = ball();  // out of sight, so that something is opaque
    for (int i = 0; i < 20000; ++i)
      gaussians.push_back({{0.1F * some(random), 0.1F * some(random), 0.25F + thick * some(random)},
                           {2e-3F, 2e-3F, 2e-3F},
                           Eigen::Quaternionf::Identity(),
                           0.1F});
    constexpr int size = 32;
    const Intrinsics k{
        .width = size, .height = size, .fx = 250.0, .fy = 250.0, .cx = 15.5, .cy = 15.5};
    std::vector<float> depth(size * size, std::numeric_limits<float>::infinity());
    SplatBody(gaussians, "fog").draw({Eigen::Isometry3d::Identity(), k, 0.06, 0.5}, depth);
    return std::count_if(depth.begin(), depth.end(), [](float z) { return std::isfinite(z); });
  };
  EXPECT_LT(drawn(0.3F), 10);
  EXPECT_GT(drawn(2e-3F), 1000);  // of the same, but thin
}

// [m] of one ray by the definition, in doubles; infinite where no half is hidden, or in fog.
double depth_of_ray(const std::vector<Gaussian>& in_order, const Vec3& ray) {
  double left = 1.0, ended = 0.0, weight = 0.0, sum = 0.0;
  for (const Gaussian& g : in_order) {
    const Eigen::Matrix3d whitened = g.sigma.cast<double>().cwiseInverse().asDiagonal() *
                                     g.turn.cast<double>().toRotationMatrix().transpose();
    const Vec3 v = whitened * ray, mean = whitened * g.mean.cast<double>();
    const double along = mean.dot(v) / v.squaredNorm();
    const double share = g.opacity * std::exp(-0.5 * (mean - along * v).squaredNorm());
    const bool is_same = weight > 0.0 && std::abs(along - sum / weight) < 3e-3;
    if (share < 0.02 || left < 0.02 || (!is_same && left < 0.5)) continue;
    if (!is_same) ended = weight = sum = 0.0;
    ended += left * share;
    weight += share;
    sum += share * along;
    left *= 1.0 - share;
  }
  return left < 0.5 && ended >= 0.25 ? sum / weight : std::numeric_limits<double>::infinity();
}

TEST(Splat, IsDrawnAsItIsDefined) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> some(-1.0F, 1.0F);
  const auto next = [&] { return some(random); };
  const auto turn = [&] {  // one after the other: compilers differ in the order of arguments
    const float z = next(), y = next(), x = next();
    return Eigen::Quaternionf(1.0F, x, y, z).normalized();
  };
  std::vector<Gaussian> gaussians;
  for (int i = 0; i < 200; ++i)
    gaussians.push_back(
        {{0.03F * next(), 0.03F * next(), 0.25F + 0.02F * next()},
         {5e-3F + 4e-3F * next(), 5e-3F + 4e-3F * next(), i % 2 == 0 ? 2e-5F : 2e-3F},
         turn(),
         0.5F + 0.4F * next()});
  constexpr int size = 32;
  const Intrinsics k{
      .width = size, .height = size, .fx = 250.0, .fy = 250.0, .cx = 15.5, .cy = 15.5};
  std::vector<float> depth(size * size, std::numeric_limits<float>::infinity());
  SplatBody(gaussians, "some").draw({Eigen::Isometry3d::Identity(), k, 0.1, 0.4}, depth);
  std::sort(gaussians.begin(), gaussians.end(),
            [](const Gaussian& a, const Gaussian& b) { return a.mean.z() < b.mean.z(); });
  int others = 0;  // where a share or a distance is just at its bound
  for (int v = 0; v < size; ++v) {
    for (int u = 0; u < size; ++u) {
      const double expected = depth_of_ray(gaussians, {(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0});
      const double drawn = depth[static_cast<std::size_t>(v * size + u)];
      others += drawn == expected || std::abs(drawn - expected) < 5e-5 ? 0 : 1;
    }
  }
  EXPECT_LT(others, size * size / 50);
}

TEST(Splat, IsReadAsItIsStored) {
  const test::TemporaryFolder folder;
  const std::vector<Gaussian> gaussians = ball();
  const std::string bytes = file_of(gaussians);
  const std::string file = folder.write("ball.ply", bytes).string();
  EXPECT_EQ(source_uri(file), "splat:" + file);
  const auto camera = open_source("splat:" + file);
  EXPECT_NE(camera->info().kind.find("8000 Gaussians"), std::string::npos);
  EXPECT_FALSE(camera->info().assumed.empty());
  camera->follow({0.0, 0.0, 0.06});
  const auto points = camera->next()->cloud->image()->points();
  EXPECT_GT(points.size(), 5000U);
  for (const Vec3& point : points) EXPECT_NEAR(point.norm(), radius, 1e-3);
  const auto small = open_source("splat:" + file + "?scale=0.5&up=x");
  small->follow({0.03, 0.0, 0.0});
  for (const Vec3& point : small->next()->cloud->image()->points())
    EXPECT_NEAR(point.norm(), 0.5 * radius, 1e-3);

  const std::string cut = folder.write("cut.ply", bytes.substr(0, bytes.size() - 1)).string();
  EXPECT_TRUE(fails_saying([&] { open_source("splat:" + cut); }, "cut.ply", "promises 8000 rows"));
  const std::string points_only =
      folder
          .write("points.ply",
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                 "property float z\nend_header\n0 0 0\n")
          .string();
  EXPECT_EQ(source_uri(points_only), "ply:" + points_only);
  EXPECT_TRUE(fails_saying([&] { open_source("splat:" + points_only); }, "points.ply", "opacity",
                           "ply: and map:"));
  std::vector<Gaussian> fog = gaussians;
  for (Gaussian& g : fog) g.opacity = 0.3F;
  const std::string foggy = folder.write("fog.ply", file_of(fog)).string();
  EXPECT_TRUE(fails_saying([&] { open_source("splat:" + foggy); }, "fog.ply", "none", "logits"));
}

}  // namespace test_splat
}  // namespace palpate
