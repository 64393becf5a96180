// SPDX-License-Identifier: Apache-2.0
// The god-object [3] and the sphere proxy [4] on polygons: on a mesh, or on each depth image
// tessellated [10], [11].
//
// The point (the sphere's centre) moves towards the place nearest to the HIP that at most three
// planes allow. Each triangle that it meets on the way adds its plane; a sphere adds the plane
// across its contact, which on edges and corners is no triangle's.
//
// A new frame: the publications are about recordings whose frames replace one another. Kept in
// world space (`-kept`) the point is behind a surface that rises over it. Lifted, the default here
// as it favours the method, it is put upon the new surface if that has come no more than r_c over
// it along its line of sight (of a mesh: along the last normal). Triangles hold from the front
// only, so that a hand that was lost can come back.
//
// `force-shading` turns the god-object's force to the normal interpolated between the corners.
#include <array>
#include <optional>

#include "lab/method.hpp"
#include "lab/polygons.hpp"

namespace palpate::lab {
namespace {

constexpr int most_moves = 16;    // a tick
constexpr double at_rest = 1e-7;  // [m] more than it is kept off the triangles

struct Plane {
  Vec3 normal;
  Vec3 at;
};

// The place nearest to `hip` that is behind none of the (at most three) planes: of the feet of
// `hip` on each plane and on the lines where two meet, the nearest that the others allow. Where
// there is none, three planes meet in a corner: where it has come to meet the last of them.
Vec3 nearest_allowed(const std::vector<Plane>& planes, const Vec3& hip) {
  std::array<double, 3> behind{};  // [m] how far the hip is
  for (std::size_t i = 0; i < planes.size(); ++i)
    behind[i] = planes[i].normal.dot(planes[i].at - hip);
  std::optional<Vec3> best;
  const auto consider = [&](const Vec3& way) {
    if (best && way.squaredNorm() >= (*best - hip).squaredNorm()) return;
    for (std::size_t i = 0; i < planes.size(); ++i) {
      if (!(planes[i].normal.dot(way) - behind[i] > -1e-9)) return;
    }
    best = hip + way;
  };
  consider(Vec3::Zero());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    const Vec3& n = planes[i].normal;
    consider(behind[i] * n);
    for (std::size_t j = 0; j < i; ++j) {
      const Vec3& m = planes[j].normal;
      const double c = n.dot(m);
      const double rest = 1.0 - c * c;
      if (rest < 1e-12) continue;  // parallel
      consider(((behind[i] - c * behind[j]) * n + (behind[j] - c * behind[i]) * m) / rest);
    }
  }
  return best.value_or(planes.empty() ? hip : planes.back().at);
}

class Constrained final : public LabMethod {
 public:
  struct Kind {
    bool sphere = false;
    bool lifted = true;
    bool shaded = false;
  };

  Constrained(const Parameters& parameters, Kind kind) : LabMethod(parameters), kind_(kind) {}

  void seat(const Vec3& proxy) noexcept override {
    centre_ = proxy;
    normal_.reset();
  }

  void frame(const Cloud& cloud, double /*stamp*/) noexcept override {
    polygons_.frame(cloud);
    new_frame_ = true;
  }

  Tick tick(const Vec3& hip, double t) noexcept override {
    if (!centre_) centre_ = hip;
    polygons_.cover(*centre_);
    if (new_frame_ && kind_.lifted && normal_) lift();
    new_frame_ = false;
    const auto triangle = follow(hip);
    if (!triangle) return free(hip, t);
    const Vec3 point = *centre_ - radius() * *normal_;
    Vec3 normal = *normal_;
    if (kind_.shaded) normal = polygons_.shaded_normal(*triangle, point);
    Tick tick = held(hip, {point, normal}, t);
    if (kind_.sphere) {
      // The spring of a sphere ends at its centre, and is slack at r_c: (16).
      tick.proxy = *centre_;
      const double length = (*centre_ - hip).norm();
      tick.force = std::min(parameters().coupling.stiffness * std::max(length - radius(), 0.0),
                            parameters().coupling.max_force) *
                   *normal_;
    }
    if (kind_.shaded) tick.force = tick.force.norm() * normal;
    tick.steps = moves_;
    return tick;
  }

  void check(const Cloud& cloud) const override { Polygons::check(cloud); }

 private:
  // [m] 0 of a god-object
  [[nodiscard]] double radius() const { return kind_.sphere ? parameters().proxy.r_c() : 0.0; }

  // Onto a new surface that has come over it by no more than r_c; then out of what the sphere
  // reaches into.
  void lift() {
    const Vec3 up = polygons_.towards_camera(*centre_).value_or(*normal_);
    const double high = parameters().proxy.r_c();
    const double low = radius() + 1e-6;
    const Vec3 from = *centre_ + high * up;
    if (const auto hit = polygons_.sweep(from, -(high + low) * up, 0.0))
      centre_ = from + (radius() + 1e-8 - hit->share * (high + low)) * up;
    for (int i = 0; i < 8 && radius() > 0.0; ++i) {
      const auto near = polygons_.nearest(*centre_, radius());
      if (!near || (*centre_ - *near).norm() < 1e-9) return;
      centre_ = *near + (radius() + 1e-8) * (*centre_ - *near).normalized();
    }
  }

  // The triangle that holds it, if any.
  std::optional<std::uint32_t> follow(const Vec3& hip) {
    std::vector<Plane> planes;
    std::optional<std::uint32_t> holds;
    moves_ = 0;
    Vec3 before = *centre_;
    while (moves_ < most_moves) {
      if (++moves_ % 6 == 0) {  // where more than three planes meet it would continue in a circle
        if ((*centre_ - before).norm() < at_rest) break;
        before = *centre_;
      }
      const Vec3 goal = nearest_allowed(planes, hip);
      const Vec3 way = goal - *centre_;
      if (way.norm() < at_rest) break;
      const auto hit = polygons_.sweep(*centre_, way, radius());
      if (!hit) {
        centre_ = goal;
        break;
      }
      *centre_ += hit->share * way + 1e-8 * hit->normal;
      planes.push_back({hit->normal, *centre_});
      if (planes.size() > 3) planes.erase(planes.begin());
      holds = hit->triangle;
    }
    const Vec3 pull = *centre_ - hip;
    if (planes.empty() || pull.norm() < 1e-7) {
      if (planes.empty()) normal_.reset();
      return std::nullopt;
    }
    normal_ = pull.normalized();
    return holds;
  }

  Kind kind_;
  Polygons polygons_{0.03};
  std::optional<Vec3> centre_;
  std::optional<Vec3> normal_;  // while it is held
  bool new_frame_ = false;
  int moves_ = 0;
};

using Kind = Constrained::Kind;

}  // namespace

std::vector<MethodInfo> god_object_methods() {
  return {
      {"god-object", "a point constrained by polygons ([3]; depth images tessellated: [10], [11])",
       made<Constrained, Kind{}>},
      {"god-object-kept", "the same, kept in world space when a frame arrives",
       made<Constrained, Kind{.lifted = false}>},
      {"sphere-proxy", "a sphere constrained by polygons ([4]; depth images tessellated)",
       made<Constrained, Kind{.sphere = true}>},
      {"sphere-proxy-kept", "the same, kept in world space when a frame arrives",
       made<Constrained, Kind{.sphere = true, .lifted = false}>},
      {"force-shading", "god-object whose force has the normal interpolated between corners",
       made<Constrained, Kind{.shaded = true}>}};
}

}  // namespace palpate::lab
