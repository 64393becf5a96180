// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "palpate/io/sources/shapes.hpp"

namespace palpate {
namespace test_shapes {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Each shape beside the definition of its inside, which is all that the oracles below know of it.
struct Case {
  std::string name;
  Shape shape;
  std::function<bool(const Vec3&)> inside;
};

std::vector<Case> cases() {
  const auto disc = [](const Vec3& p) { return std::hypot(p.x(), p.z()); };
  return {
      {"half-space", HalfSpace{}, [](const Vec3& p) { return p.z() < 0.0; }},
      {"sphere", Sphere{0.04}, [](const Vec3& p) { return p.norm() < 0.04; }},
      {"capsule", Capsule{0.02, 0.05},
       [](const Vec3& p) {
         return (p - Vec3(0.0, std::clamp(p.y(), -0.05, 0.05), 0.0)).norm() < 0.02;
       }},
      {"cylinder", Cylinder{0.03, 0.05},
       [disc](const Vec3& p) { return disc(p) < 0.03 && std::abs(p.y()) < 0.05; }},
      {"block", block(Vec3(0.05, 0.03, 0.02)),
       [](const Vec3& p) {
         return std::abs(p.x()) < 0.05 && std::abs(p.y()) < 0.03 && std::abs(p.z()) < 0.02;
       }},
      {"notched prism",
       Prism{{{-0.05, -0.05}, {0.05, -0.05}, {0.05, 0.03}, {0.0, -0.02}, {-0.05, 0.03}}, 0.04},
       [](const Vec3& p) {
         return std::abs(p.x()) < 0.05 && p.z() > -0.05 && p.z() < -0.02 + std::abs(p.x()) &&
                std::abs(p.y()) < 0.04;
       }},
      {"endless groove",
       Prism{{{-1.0, -1.0}, {1.0, -1.0}, {1.0, 0.5}, {0.0, 0.0}, {-1.0, 0.5}}, infinity},
       [](const Vec3& p) {
         return std::abs(p.x()) < 1.0 && p.z() > -1.0 && p.z() < 0.5 * std::abs(p.x());
       }},
      {"wave", Wave{0.02, 0.05},
       [](const Vec3& p) {
         return p.z() < 0.01 * std::sin(2.0 * std::numbers::pi * p.x() / 0.05);
       }},
  };
}

class Uniform {
 public:
  Vec3 in_cube(double half) { return half * Vec3(draw_(engine_), draw_(engine_), draw_(engine_)); }

 private:
  std::mt19937_64 engine_{20260401};
  std::uniform_real_distribution<double> draw_{-1.0, 1.0};
};

double cast_one(const Shape& shape, const Vec3& origin, const Vec3& direction) {
  const std::array<Vec3, 1> directions{direction};
  std::array<double, 1> along{infinity};
  cast(shape, origin, directions, along);
  return along[0];
}

// The first place along the ray, up to `reach`, where inside turns to outside or back.
double march(const Case& body, const Vec3& origin, const Vec3& direction, double reach) {
  constexpr int steps = 4000;
  const bool began_inside = body.inside(origin);
  for (int i = 1; i <= steps; ++i) {
    double high = reach * i / steps;
    if (body.inside(origin + high * direction) == began_inside) continue;
    double low = reach * (i - 1) / steps;
    for (int k = 0; k < 50; ++k) {
      const double middle = 0.5 * (low + high);
      (body.inside(origin + middle * direction) == began_inside ? low : high) = middle;
    }
    return high;
  }
  return infinity;
}

TEST(Shapes, AreHitWhereInsideTurnsToOutside) {
  for (const Case& body : cases()) {
    Uniform uniform;
    int hits = 0;
    for (int i = 0; i < 300; ++i) {
      const Vec3 origin = uniform.in_cube(0.12);
      const Vec3 direction = uniform.in_cube(0.05) - origin;
      const double reach = 2.0;
      const double expected = march(body, origin, direction, reach);
      const double s = cast_one(body.shape, origin, direction);
      if (std::isfinite(expected)) {
        ++hits;
        EXPECT_NEAR(s, expected, 1e-9) << body.name << " ray " << i;
      } else if (s < reach) {
        // The march may step over a corner; the cast must still be at a surface.
        EXPECT_NE(body.inside(origin + (s - 1e-6) * direction),
                  body.inside(origin + (s + 1e-6) * direction))
            << body.name << " ray " << i;
      }
    }
    EXPECT_GT(hits, 100) << body.name;
  }
}

TEST(Shapes, AreNowhereNearerThanTheirNearestPoint) {
  for (const Case& body : cases()) {
    Uniform uniform;
    std::vector<Vec3> surface;
    while (surface.size() < 20000) {
      const Vec3 origin = uniform.in_cube(0.15);
      const Vec3 direction = uniform.in_cube(0.1) - origin;
      const double s = cast_one(body.shape, origin, direction);
      if (s < 2.0) surface.emplace_back(origin + s * direction);
    }
    for (int i = 0; i < 100; ++i) {
      const Vec3 p = uniform.in_cube(0.08);
      const Nearest near = nearest(body.shape, p);
      double sampled = infinity;
      for (const Vec3& point : surface) sampled = std::min(sampled, (point - p).norm());
      EXPECT_LE(std::abs(near.distance), sampled + 1e-9) << body.name << " point " << i;
      EXPECT_NEAR((near.point - p).norm(), std::abs(near.distance), 1e-12) << body.name;
      EXPECT_EQ(near.distance < 0.0, body.inside(p)) << body.name << " point " << i;
      EXPECT_LT((near.point + near.distance * near.normal - p).norm(), 1e-12) << body.name;
      EXPECT_NEAR(near.normal.norm(), 1.0, 1e-12) << body.name;
      // The body ends at the nearest point: right beside it there is both inside and outside.
      int inside = 0;
      for (int k = 0; k < 64; ++k)
        inside += body.inside(near.point + uniform.in_cube(1e-7)) ? 1 : 0;
      EXPECT_GT(inside, 0) << body.name << " point " << i;
      EXPECT_LT(inside, 64) << body.name << " point " << i;
    }
  }
}

TEST(Shapes, FitInTheirBoundingBlock) {
  for (const Case& body : cases()) {
    const Vec3 half = bounding_half(body.shape);
    if (!half.allFinite()) continue;
    Uniform uniform;
    Vec3 farthest = Vec3::Zero();
    for (int i = 0; i < 20000; ++i) {
      const Vec3 p = uniform.in_cube(0.12);
      if (body.inside(p)) farthest = farthest.cwiseMax(p.cwiseAbs());
    }
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(farthest[axis], half[axis]) << body.name;
      EXPECT_GT(farthest[axis], 0.8 * half[axis]) << body.name;
    }
  }
}

TEST(Shapes, KeepAUnitNormalOnTheSurfaceItself) {
  EXPECT_EQ(nearest(block(Vec3(1.0, 1.0, 1.0)), Vec3(0.2, 0.1, 1.0)).normal, Vec3::UnitZ());
  EXPECT_EQ(nearest(HalfSpace{}, Vec3(3.0, 1.0, 0.0)).normal, Vec3::UnitZ());
  EXPECT_NEAR(nearest(Wave{0.02, 0.05}, Vec3::Zero()).normal.norm(), 1.0, 1e-12);
  EXPECT_NEAR(nearest(Sphere{0.1}, Vec3::Zero()).normal.norm(), 1.0, 1e-12);
}

TEST(Shapes, ARayBesideOrAwayFromThemHitsNothing) {
  for (const Case& body : cases()) {
    if (body.name == "endless groove") continue;
    EXPECT_EQ(cast_one(body.shape, Vec3(0.0, 0.0, 0.5), Vec3::UnitZ()), infinity) << body.name;
    EXPECT_EQ(cast_one(body.shape, Vec3(0.0, 0.0, 0.5), Vec3::UnitX()), infinity) << body.name;
  }
}

}  // namespace test_shapes
}  // namespace palpate
