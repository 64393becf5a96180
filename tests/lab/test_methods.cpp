// SPDX-License-Identifier: Apache-2.0
// Every method does what its publication claims where it was made for, and fails where it should.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lab/experiment.hpp"
#include "lab/grid_cloud.hpp"
#include "lab/local_points.hpp"
#include "lab/method.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"

#include "tests/support/errors.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate::lab {
namespace test_methods {

constexpr double spacing = 1.5e-3;  // [m] of the points
constexpr double r_c = 5e-3;
constexpr double stiffness = 600.0;
const Vec3 camera(0, 0, 1);

MethodSetup with_flat_truth() {
  return {Parameters{}, [](const Vec3& p, double) { return TruePoint{p.z(), Vec3::UnitZ()}; }};
}

// The hand goes from one place to another at 0.1 m/s, one tick a millisecond.
Tick go(Method& method, const Vec3& from, const Vec3& to) {
  const int ticks = std::max(1, static_cast<int>((to - from).norm() / 1e-4));
  Tick tick{};
  for (int i = 0; i <= ticks; ++i)
    tick = method.tick(from + (to - from) * (double(i) / ticks), 1e-3 * i);
  return tick;
}

// Onto a cloud from above, and how the hand is held there.
Tick press(Method& method, const Cloud& cloud, const Vec3& to) {
  method.seat(Vec3(to.x(), to.y(), 0.03));
  method.observe({cloud, 0.0});
  return go(method, Vec3(to.x(), to.y(), 0.03), to);
}

// Where it was held back, as the method has it: on the surface, not r_c above it.
Vec3 contact(const Tick& tick) { return tick.proxy - r_c * tick.normal; }

// The middle of an image that a camera a metre above takes of a height field.
template <class Height>
PointCloud seen(const Height& height) {
  Surface surface;
  surface.points = test::grid(spacing, 40, height);
  surface.columns = surface.rows = 81;
  return PointCloud(std::move(surface), camera);
}

double flat(double /*x*/, double /*y*/) { return 0.0; }

class EveryMethod : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryMethod, PushesAHandOutOfAPlaneAndLeavesItAloneAbove) {
  const PointCloud plane = seen(flat);
  const auto method = make_method(GetParam(), with_flat_truth());
  const Tick pressed = press(*method, plane, {0.0002, 0.0003, -0.008});
  EXPECT_GT(pressed.force.normalized().z(), 0.99);
  EXPECT_GT(pressed.force.z(), 0.8 * stiffness * 0.008);
  EXPECT_LT(std::abs(contact(pressed).z()), 0.003);
  const Tick left = go(*method, pressed.hip, {0.0002, 0.0003, 0.03});
  EXPECT_TRUE(left.force.isZero());
  EXPECT_LT((left.proxy - left.hip).norm(), 1e-6);
}

TEST_P(EveryMethod, FeelsNothingWithoutAFrameOrPoints) {
  if (GetParam() == "ideal") GTEST_SKIP() << "it needs neither";
  const auto method = make_method(GetParam(), {});
  EXPECT_TRUE(method->tick({0, 0, -0.01}, 0.0).force.isZero());
  const PointCloud nothing(std::vector<Vec3>{}, camera);
  method->observe({nothing, 0.0});
  const Tick tick = method->tick({0, 0, -0.02}, 0.001);
  EXPECT_TRUE(tick.force.isZero());
  EXPECT_TRUE(tick.proxy.allFinite());
}

TEST_P(EveryMethod, StaysFiniteUnderFiveMillimetresOfNoise) {
  GridCloud grid;
  grid.half_x = grid.half_y = 0.05;
  grid.sigma = 5e-3;
  const auto method = make_method(GetParam(), with_flat_truth());
  std::unique_ptr<Cloud> in_use;
  for (int frame = 0; frame < 10; ++frame) {
    auto cloud = grid.capture(static_cast<std::uint64_t>(frame), 0.0);
    method->observe({*cloud, frame / 30.0});
    in_use = std::move(cloud);
    for (int i = 0; i < 33; ++i) {
      const double t = (frame + i / 33.0) / 30.0;
      const Tick tick = method->tick({0.01 * t, 0, 0.02 - 0.1 * t}, t);
      ASSERT_TRUE(tick.proxy.allFinite() && tick.normal.allFinite() && tick.force.allFinite());
      ASSERT_LE(tick.force.norm(), 20.0 + 1e-9);
    }
  }
}

std::vector<std::string> all_names() {
  std::vector<std::string> names;
  const MethodRegistry all = methods();
  for (const MethodInfo& method : all.entries()) names.emplace_back(method.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Of, EveryMethod, ::testing::ValuesIn(all_names()), [](const auto& of) {
  std::string name = of.param;
  std::erase(name, '-');
  return name;
});

TEST(PointBoxes, RestsHalfABoxAboveAPlaneThatLiesAsTheAxesDo) {
  const PointCloud plane(test::flat_grid(), camera);
  const auto method = make_method("point-boxes", {});
  const Tick tick = press(*method, plane, {0.0004, 0.0003, -0.008});
  EXPECT_NEAR(contact(tick).z(), 0.8 * spacing, 1e-6);
  EXPECT_NEAR(contact(tick).x(), 0.0004, 1e-6) << "nothing holds it aside";
  EXPECT_NEAR(tick.force.z(), stiffness * (0.008 + 0.8 * spacing), 1e-3);
}

TEST(PointBoxes, CatchesOnTheStairsOfATiltedPlane) {
  const auto tilted = [](double x, double) { return 0.5 * x; };
  const PointCloud plane(test::grid(spacing, 50, tilted), camera);
  const auto method = make_method("point-boxes", {});
  // Uphill along it, 8 mm below: the foot of the hand on the plane is 3.2 mm behind the hand.
  method->seat({-0.02, 0.0, 0.02});
  method->observe({plane, 0.0});
  go(*method, {-0.02, 0.0, 0.02}, {-0.02, 0.0, -0.018});
  const Tick tick = go(*method, {-0.02, 0.0, -0.018}, {0.02, 0.0, 0.002});
  EXPECT_LT(tick.proxy.x(), 0.0) << "it was stopped by a step";
}

TEST(RadialFields, RestsWhereTheFieldsAddUpToT) {
  const PointCloud plane(test::flat_grid(), camera);
  const auto method = make_method("radial-fields", {});
  const Tick tick = press(*method, plane, {0.0, 0.0, -0.008});
  // In the middle of a square grid all R are 2.5 spacings.
  const auto sum = [](double z) {
    double total = 0.0;
    for (int i = -4; i <= 4; ++i) {
      for (int j = -4; j <= 4; ++j) {
        const double q = std::sqrt(i * i * spacing * spacing + j * j * spacing * spacing + z * z) /
                         (2.5 * spacing);
        if (q < 1.0) total += std::pow(1.0 - q, 4) * (4.0 * q + 1.0);
      }
    }
    return total;
  };
  EXPECT_NEAR(sum(contact(tick).z()), 0.05, 1e-3);
  EXPECT_NEAR(contact(tick).z(), 0.71 * 2.5 * spacing, 0.05e-3);
}

TEST(RadialFields, IsLostToASurfaceThatMovesByMoreThanItsShell) {
  // Half the shell is 0.71 R = 2.66 mm. Once the points have passed the proxy, out is down.
  for (const double travel : {2.4e-3, 3.2e-3}) {
    const PointCloud plane(test::flat_grid(), camera);
    const PointCloud risen(test::flat_grid(travel), camera);
    const auto method = make_method("radial-fields", {});
    const Tick before = press(*method, plane, {0.0, 0.0, -0.008});
    method->observe({risen, 1.0 / 30.0});
    const Tick tick = method->tick(before.hip, 0.5);
    EXPECT_EQ(tick.proxy.z() > 0.0, travel < 2.66e-3) << travel;
  }
}

TEST(Surfels, IsExactOnATiltedPlane) {
  const auto tilted = [](double x, double y) { return 0.3 * x - 0.2 * y; };
  const Vec3 normal = Vec3(-0.3, 0.2, 1.0).normalized();
  const PointCloud plane(test::grid(spacing, 50, tilted), camera);
  const auto method = make_method("surfels", {});
  const Vec3 foot(0.002, 0.001, tilted(0.002, 0.001));
  press(*method, plane, foot - 0.002 * normal);
  const Tick tick = go(*method, foot - 0.002 * normal, foot - 0.006 * normal);
  EXPECT_LT(std::acos(std::min(1.0, tick.normal.dot(normal))), 1e-5);
  EXPECT_LT((contact(tick) - foot).norm(), 2e-6);
}

TEST(Surfels, RoundsAnEdgeThatIsSharp) {
  const auto roof = [](double x, double) { return -std::abs(x); };
  const PointCloud edge(test::grid(spacing, 50, roof), camera);
  const auto method = make_method("surfels", {});
  const Tick tick = press(*method, edge, {0.0, 0.0, -0.01});
  EXPECT_LT(contact(tick).z(), -0.5e-3) << "below the edge: it averages over r_3";
}

TEST(Surfels, OverThreeFramesJittersLessAtRestAndLagsBehindWhatMoves) {
  const auto jitter_and_lag = [](const char* name) {
    double squares = 0.0;
    double lag = 0.0;
    for (const bool moves : {false, true}) {
      GridCloud grid;
      grid.sigma = moves ? 0.0 : 1e-3;
      const auto method = make_method(name, {});
      method->seat({0, 0, 0.01});
      std::unique_ptr<Cloud> in_use;
      for (int k = 0; k < 40; ++k) {
        const double height = moves ? 0.001 * k : 0.0;
        auto cloud = grid.capture(static_cast<std::uint64_t>(k), height);
        method->observe({*cloud, k / 30.0});
        in_use = std::move(cloud);
        for (int i = 0; i < 4; ++i) {
          const Tick tick = method->tick({0, 0, height - 0.02}, (k + i / 4.0) / 30.0);
          if (k < 10 || i < 3) continue;
          const double error = contact(tick).z() - height;
          (moves ? lag : squares) += (moves ? -error : error * error) / 30.0;
        }
      }
    }
    return std::pair{std::sqrt(squares), lag};
  };
  const auto [one_jitter, one_lag] = jitter_and_lag("surfels");
  const auto [few_jitter, few_lag] = jitter_and_lag("surfels-3");
  EXPECT_LT(few_jitter, 0.75 * one_jitter);
  EXPECT_NEAR(one_lag, 0.0, 1e-6);
  EXPECT_NEAR(few_lag, 0.001, 0.1e-3) << "the mean of three frames is one frame old";
}

TEST(GodObject, IsAsNearToTheHandAsAPlaneAllows) {
  const auto tilted = [](double x, double y) { return 0.3 * x - 0.2 * y; };
  const Vec3 normal = Vec3(-0.3, 0.2, 1.0).normalized();
  const PointCloud plane = seen(tilted);
  const Vec3 foot(0.002, 0.001, tilted(0.002, 0.001));
  for (const char* name : {"god-object", "sphere-proxy", "force-shading"}) {
    const auto method = make_method(name, {});
    press(*method, plane, foot - 0.002 * normal);
    const Tick tick = go(*method, foot - 0.002 * normal, foot - 0.006 * normal);
    EXPECT_LT((contact(tick) - foot).norm(), 1e-6) << name;
    EXPECT_LT((tick.force - stiffness * 0.006 * normal).norm(), 1e-3) << name;
  }
}

// A mesh in a PLY file, as a session has it.
class MeshFile {
 public:
  MeshFile(const Surface& mesh, const std::string& faces) {
    const bool normals = !mesh.normals.empty();
    std::ostringstream text;
    text << "ply\nformat ascii 1.0\nelement vertex " << mesh.points.size()
         << "\nproperty double x\nproperty double y\nproperty double z\n";
    if (normals) text << "property double nx\nproperty double ny\nproperty double nz\n";
    text << "element face " << std::count(faces.begin(), faces.end(), '\n')
         << "\nproperty list uchar int vertex_indices\nend_header\n";
    text.precision(17);
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
      text << mesh.points[i].transpose();
      if (normals) text << ' ' << mesh.normals[i].transpose();
      text << '\n';
    }
    text << faces;
    frame_ = *open_source("ply:" + folder_.write("mesh.ply", text.str()).string())->next();
  }
  [[nodiscard]] const Cloud& cloud() const { return *frame_.cloud; }

 private:
  test::TemporaryFolder folder_;
  Frame frame_;
};

// A cube about the origin, of squares: touched from without, or a room touched from within.
constexpr double half_edge = 0.05;  // [m]

MeshFile cube(bool is_room) {
  Surface mesh;
  for (const double z : {-half_edge, half_edge}) {
    for (const double y : {-half_edge, half_edge}) {
      for (const double x : {-half_edge, half_edge}) mesh.points.emplace_back(x, y, z);
    }
  }
  return {mesh, is_room ? "4 0 1 3 2\n4 4 6 7 5\n4 0 4 5 1\n4 2 3 7 6\n4 0 2 6 4\n4 1 5 7 3\n"
                        : "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"};
}

TEST(GodObject, IsPushedOutOfACubesFaceByWhichItCameIn) {
  const MeshFile file = cube(false);
  for (const char* name : {"god-object", "god-object-kept", "force-shading"}) {
    const auto method = make_method(name, {});
    method->seat({0.01, 0.0, 0.07});
    method->observe({file.cloud(), 0.0});
    go(*method, {0.01, 0.0, 0.07}, {0.01, 0.0, 0.03});
    // Now 20 mm below the top and 5 mm from a side, which would be the nearer.
    const Tick tick = go(*method, {0.01, 0.0, 0.03}, {0.045, 0.01, 0.03});
    EXPECT_LT((contact(tick) - Vec3(0.045, 0.01, half_edge)).norm(), 1e-6) << name;
    if (name == std::string("force-shading")) continue;  // its corners are round
    EXPECT_LT((tick.force - Vec3(0, 0, stiffness * 0.02)).norm(), 1e-3) << name;
  }
}

TEST(GodObject, RestsInEdgesAndCornersOfARoom) {
  const MeshFile file = cube(true);
  for (const char* name : {"god-object", "god-object-kept", "sphere-proxy", "sphere-proxy-kept"}) {
    const bool is_sphere = std::string(name).substr(0, 6) == "sphere";
    const double wall = half_edge - (is_sphere ? r_c : 0.0);
    struct Case {
      Vec3 hip, rest;
    };
    for (const Case& c : {Case{{0.01, 0.02, 0.058}, {0.01, 0.02, wall}},   // a wall
                          Case{{0.057, 0.01, 0.054}, {wall, 0.01, wall}},  // an edge: two planes
                          Case{{-0.057, 0.051, 0.054}, {-wall, wall, wall}}}) {  // a corner: three
      const auto method = make_method(name, {});
      method->seat(Vec3::Zero());
      method->observe({file.cloud(), 0.0});
      const Tick tick = go(*method, Vec3::Zero(), c.hip);
      const Vec3 rest = is_sphere ? tick.proxy : contact(tick);
      EXPECT_LT((rest - c.rest).norm(), 1e-6) << name;
      const Vec3 pull = c.rest - c.hip;
      const double length = pull.norm() - (is_sphere ? r_c : 0.0);
      EXPECT_LT((tick.force - stiffness * length * pull.normalized()).norm(), 1e-3) << name;
    }
  }
}

// A ball of 50 mm of 24 x 12 facets, whose corners know the ball's normals.
MeshFile facetted_ball(double radius) {
  constexpr int around = 24;
  constexpr int down = 12;
  constexpr double pi = std::numbers::pi;
  Surface mesh;
  std::ostringstream faces;
  for (int i = 0; i <= down; ++i) {
    for (int j = 0; j < around; ++j) {
      const double a = pi * i / down;
      const double b = 2.0 * pi * j / around;
      mesh.normals.emplace_back(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      mesh.points.emplace_back(radius * mesh.normals.back());
      const int next = (j + 1) % around;
      if (i < down)
        faces << "4 " << around * i + j << ' ' << around * (i + 1) + j << ' '
              << around * (i + 1) + next << ' ' << around * i + next << '\n';
    }
  }
  return {mesh, faces.str()};
}

TEST(ForceShading, TurnsTheForceSmoothlyOverTheFacetsOfAMesh) {
  const double radius = 0.05;
  const MeshFile ball = facetted_ball(radius);
  // A stroke along a parallel, 2 mm below the surface, by 0.3 degrees a tick; the facets meet at
  // some 12. The largest turn of the force in a tick, and how far it is off the ball's normal.
  const auto turns = [&](const char* name) {
    const auto out = [](double angle) {
      return Vec3(std::cos(angle), std::sin(angle), 0.75).normalized();
    };
    const auto method = make_method(name, {});
    const double deep = radius - 0.002;
    method->seat(0.06 * out(0.0));
    method->observe({ball.cloud(), 0.0});
    Vec3 before = go(*method, 0.06 * out(0.0), deep * out(0.0)).force;
    double step = 0.0;
    double off = 0.0;
    for (int i = 1; i <= 200; ++i) {
      const double angle = 0.3 * i * std::numbers::pi / 180.0;
      const Tick tick = method->tick(deep * out(angle), 1.0 + 1e-3 * i);
      const auto between = [](const Vec3& a, const Vec3& b) {
        return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
      };
      step = std::max(step, between(before, tick.force));
      off = std::max(off, between(out(angle), tick.force));
      before = tick.force;
    }
    return std::pair{step, off};
  };
  const auto [flat_step, flat_off] = turns("god-object");
  const auto [shaded_step, shaded_off] = turns("force-shading");
  EXPECT_GT(flat_step, 4.0);
  EXPECT_LT(shaded_step, 1.0);
  EXPECT_GT(flat_off, 5.0);
  EXPECT_LT(shaded_off, 1.0);
}

TEST(ForceShading, TurnsTheForceToTheNormalsThatAMeshCameWith) {
  Surface mesh;
  mesh.points = {{-0.1, -0.1, 0}, {0.1, -0.1, 0}, {0.1, 0.1, 0}, {-0.1, 0.1, 0}};
  const Vec3 given(0.3, 0.0, 1.0);
  mesh.normals.assign(4, given);
  const MeshFile square(mesh, "4 0 1 2 3\n");
  const Tick tick = press(*make_method("force-shading", {}), square.cloud(), {0.01, 0.03, -0.004});
  EXPECT_LT((tick.force - stiffness * 0.004 * given.normalized()).norm(), 1e-3);
  EXPECT_GT(press(*make_method("god-object", {}), square.cloud(), {0.01, 0.03, -0.004}).normal.z(),
            0.999999);
}

TEST(PointNormals, TakesTheNormalsThatAFileGivesAtAnyLength) {
  Surface mesh;
  mesh.points = test::flat_grid();
  const Vec3 given = Vec3(0.3, 0.0, 1.0);
  mesh.normals.assign(mesh.points.size(), 7.0 * given);
  const MeshFile file(mesh, "");
  const Tick tick = press(*make_method("point-normals", {}), file.cloud(), {0, 0, -0.004});
  EXPECT_LT((tick.normal - given.normalized()).norm(), 1e-9);
  EXPECT_GT(press(*make_method("surfels", {}), file.cloud(), {0, 0, -0.004}).normal.z(), 0.999999);
}

TEST(GodObject, RefusesPointsThatNothingJoins) {
  const PointCloud points(test::flat_grid(), camera);
  for (const char* name : {"god-object", "sphere-proxy-kept", "force-shading"}) {
    EXPECT_TRUE(test::fails_saying(
        [&] {
          make_method(name, {})->check(points);
          return 0;
        },
        "polygons", "PLY with faces"));
  }
}

TEST(GodObject, DoesNotPopThroughAThinPlate) {
  // Its claim: it remembers the side. The direct method, which doesn't, lets go.
  const PointCloud plate = seen(flat);
  for (const char* name : {"god-object", "sphere-proxy", "force-shading"}) {
    const auto method = make_method(name, {});
    EXPECT_NEAR(press(*method, plate, {0.0, 0.0, -0.025}).force.z(), stiffness * 0.025, 1e-2);
  }
  const auto direct = make_method("direct", {});
  EXPECT_TRUE(press(*direct, plate, {0.0, 0.0, -0.04}).force.isZero());
}

TEST(SphereProxy, RollsOverAConvexEdgeAtItsRadius) {
  const auto roof = [](double x, double) { return -std::abs(x); };
  const PointCloud edge = seen(roof);
  const auto method = make_method("sphere-proxy", {});
  const Tick tick = press(*method, edge, {0.0, 0.0, -0.01});
  EXPECT_NEAR(tick.proxy.z(), r_c, 1e-6) << "on the edge, which is a line";
  // A hand within the sphere turns it about the edge, as far as the faces let it.
  Tick aside = go(*method, {0.0, 0.0, -0.01}, {0.001, 0.0, 0.002});
  for (int i = 0; i < 50; ++i) aside = method->tick(aside.hip, aside.t + 1e-3);
  EXPECT_LT((aside.proxy - r_c * Vec3(1.0, 0.0, 2.0).normalized()).norm(), 1e-5);
}

TEST(GodObject, IsLostWhereItIsKeptAndASurfaceRisesOverIt) {
  for (const auto& [name, held] :
       {std::pair{"god-object", true}, std::pair{"god-object-kept", false},
        std::pair{"sphere-proxy", true}}) {
    const PointCloud low = seen(flat);
    const PointCloud high = seen([](double, double) { return 0.003; });
    const auto method = make_method(name, {});
    const Tick before = press(*method, low, {0.0003, 0.0002, -0.008});
    method->observe({high, 1.0 / 30.0});
    const Tick tick = method->tick(before.hip, 0.5);
    EXPECT_EQ(tick.proxy.z() > 0.0, held) << name;
    if (held) {
      EXPECT_NEAR(contact(tick).z(), 0.003, 1e-6) << name;
    }
    // Further than r_c, and all are lost.
    const PointCloud higher = seen([](double, double) { return 0.020; });
    method->observe({higher, 2.0 / 30.0});
    EXPECT_TRUE(method->tick(before.hip, 0.6).force.isZero()) << name;
  }
}

TEST(PointNormals, KeepsTheSideThatItsNormalsTell) {
  // The same points with normals down, as of a ceiling: it is touched from beneath.
  Surface ceiling;
  ceiling.points = test::flat_grid();
  ceiling.normals.assign(ceiling.points.size(), -Vec3::UnitZ());
  const PointCloud cloud(std::move(ceiling), camera);
  const auto method = make_method("point-normals", {});
  method->seat({0, 0, -0.02});
  method->observe({cloud, 0.0});
  const Tick tick = go(*method, {0, 0, -0.02}, {0, 0, 0.006});
  EXPECT_NEAR(tick.force.z(), -stiffness * 0.006, 1e-3);
}

TEST(ImageFeatures, FeelsHeightAndBrightnessAtItsOwnPixel) {
  // Waves of light, 20 mm long: white at x = 5 mm and black at -5 mm, where the camera, half a
  // metre above, sees the surface in line with a hand 8 mm beneath it.
  const auto source = open_source("synthetic:plane?brightness=20mm&distance=0.5m&tilt=0");
  const Frame frame = *source->next();
  const auto method = make_method("image-features", {});
  method->observe({*frame.cloud, 0.0});
  for (const double seen : {-0.005, -0.0025, 0.0, 0.0025, 0.005}) {
    const double height = 0.5e-3 * (0.5 + 0.5 * std::sin(2.0 * std::numbers::pi * seen / 0.02));
    const Tick tick = method->tick({seen * 0.508 / 0.5, 0.0, -0.008}, 0.0);
    // A pixel is 0.85 mm wide.
    EXPECT_NEAR(tick.force.z(), stiffness * (0.008 + height), 0.045) << seen;
  }
}

TEST(ImageFeatures, PushesAHandThatIsBehindAnOccluder) {
  // A hand over a table is under an arm: the image knows only the arm.
  const PointCloud arm = seen([](double, double) { return 0.02; });
  const auto method = make_method("image-features", {});
  method->observe({arm, 0.0});
  EXPECT_GT(method->tick({0, 0, 0.0}, 0.0).force.z(), 10.0);
}

TEST(Tsdf, FindsAPlaneToATenthOfAVoxel) {
  const PointCloud plane = seen(flat);
  const auto method = make_method("tsdf", {});
  const Tick tick = press(*method, plane, {0.0003, 0.0002, -0.008});
  EXPECT_NEAR(contact(tick).z(), 0.0, 0.15e-3);
  EXPECT_GT(tick.normal.z(), 0.999);
}

TEST(Tsdf, SmoothsNoiseOverFramesAndLagsBehindWhatMoves) {
  double noise = 0.0;
  double lag = 0.0;
  for (const bool moves : {false, true}) {
    GridCloud grid;
    grid.sigma = moves ? 0.0 : 1e-3;
    const auto method = make_method("tsdf", {});
    method->seat({0, 0, 0.01});
    std::unique_ptr<Cloud> in_use;
    for (int k = 0; k < 20; ++k) {
      const double height = moves ? -0.0005 * k : 0.0;
      auto cloud = grid.capture(static_cast<std::uint64_t>(k), height);
      method->observe({*cloud, k / 30.0});
      in_use = std::move(cloud);
      Tick tick{};
      for (int i = 0; i < 4; ++i) tick = method->tick({0, 0, height - 0.012}, (k + i / 4.0) / 30.0);
      if (k < 10) continue;
      (moves ? lag : noise) += std::abs(contact(tick).z() - height) / 10.0;
    }
  }
  EXPECT_LT(noise, 0.5e-3);
  EXPECT_GT(lag, 1e-3) << "a surface that sinks by 0.5 mm a frame stays where it was";
}

TEST(VirtualCoupling, SinksInBySpringsInSeries) {
  const PointCloud plane = seen(flat);
  const auto method = make_method("virtual-coupling", {});
  const Tick tick = press(*method, plane, {0.0, 0.0, -0.008});
  // The ball's centre lies between its rest at r_c and the HIP, as 10 to 1.
  EXPECT_NEAR(tick.proxy.z(), r_c - (r_c + 0.008) / 11.0, 1e-6);
  EXPECT_NEAR(tick.force.z(), stiffness * (tick.proxy.z() + 0.008 - r_c), 1e-6);
}

// Energy [J] of a hand of 50 g that bounces on the coupling, in its fourth tenth of a second
// against its first.
double energy_kept(double stiffness_, double damping) {
  const PointCloud plane = seen(flat);
  MethodSetup setup;
  setup.parameters.coupling.stiffness = stiffness_;
  setup.parameters.coupling.max_force = 1e3;
  const auto method = make_method("virtual-coupling", setup);
  method->observe({plane, 0.0});
  const double mass = 0.05;
  const double weight = 2.0;  // [N] holds the hand on the surface
  double z = -0.001 - weight / stiffness_;
  double velocity = 0.0;
  const auto swing = [&](int from, int to) {
    double largest = 0.0;
    for (int i = from; i < to; ++i) {
      const double force = method->tick({0, 0, z}, 1e-3 * i).force.z();
      for (int j = 0; j < 100; ++j) {  // the hand between two ticks
        velocity += 1e-5 * (force - weight - damping * velocity) / mass;
        z += 1e-5 * velocity;
      }
      largest = std::max(largest, std::abs(velocity));
    }
    return largest;
  };
  const double before = swing(0, 100);
  swing(100, 300);
  const double after = swing(300, 400);
  return after * after / (before * before);
}

TEST(VirtualCoupling, IsPassiveWithinItsLimitAndNotBeyond) {
  EXPECT_DOUBLE_EQ(passive_stiffness(0.3, 0.0, 1e-3), 600.0);
  EXPECT_DOUBLE_EQ(passive_stiffness(0.5, 0.2, 1e-3), 600.0);
  EXPECT_EQ(passive_stiffness(0.1, 0.2, 1e-3), 0.0);
  // K = 500 N/m needs 0.25 N s/m; in series with the scene's spring it is 455 N/m.
  EXPECT_LT(energy_kept(500.0, 0.30), 1.0);
  EXPECT_GT(energy_kept(500.0, 0.15), 1.0);
}

}  // namespace test_methods
}  // namespace palpate::lab
