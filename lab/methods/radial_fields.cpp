// SPDX-License-Identifier: Apache-2.0
// [13], first form: every point is a ball that fades outwards, and where the balls add up to T is
// an implicit surface, touched by ImplicitMethod:
//
//   phi = T - sum f(r),  f(r) = (1 - r/R)^4 (4 r/R + 1),
//   R = 2.5 times the mean distance from the point to its three nearest neighbours
//
// Left open by the publication: T. At 0.05 the surface lies 0.71 R off a plane of points, to both
// sides, and ripples by 0.002 R. A larger T brings it nearer (0.39 R at 1), but a surface that
// moves farther than that from one frame to the next has passed the hand, and noise opens it. R is
// at most 10 mm, or a stray point would be a balloon.
#include <algorithm>
#include <cmath>

#include "lab/implicit_method.hpp"
#include "lab/local_points.hpp"

namespace palpate::lab {
namespace {

constexpr double threshold = 0.05;  // T
constexpr double largest = 0.010;   // [m] R
constexpr double stride = 0.5e-3;   // [m] about R/8
constexpr double reach = 0.010;     // [m]
constexpr std::size_t a_few = 3;    // frames

class RadialFields final : public ImplicitMethod {
 public:
  RadialFields(const Parameters& parameters, std::size_t window)
      : ImplicitMethod(parameters, stride, reach), points_(0.03, window) {}

 private:
  void take(const Cloud& cloud, const Vec3& /*place*/) override { points_.frame(cloud); }

  void prepare(const Vec3& place) override {
    if (points_.cover(place)) radii_.assign(points_.points().size(), 0.0);
  }

  double radius(std::uint32_t i) {
    if (radii_[i] > 0.0) return radii_[i];
    points_.nearest(points_.points()[i], 4, neighbours_);  // the nearest is the point itself
    double sum = 0.0;
    for (const auto& near : neighbours_) sum += std::sqrt(near.squared);
    return radii_[i] = std::clamp(2.5 * sum / 3.0, 1e-6, largest);
  }

  std::optional<FieldValue> field(const Vec3& at) override {
    FieldValue result{threshold, Vec3::Zero()};
    points_.within(at, largest, near_);
    for (const auto& [index, squared] : near_) {
      const double big = radius(index);
      const double r = std::sqrt(squared);
      if (!(r < big)) continue;
      const double q = r / big;
      const double cube = (1.0 - q) * (1.0 - q) * (1.0 - q);
      result.value -= cube * (1.0 - q) * (4.0 * q + 1.0);
      result.gradient += 20.0 * cube / (big * big) * (at - points_.points()[index]);
    }
    return result;
  }

  LocalPoints points_;
  std::vector<double> radii_;  // [m] R of each point, 0 until it is asked for
  std::vector<LocalPoints::Neighbour> near_, neighbours_;
};

}  // namespace

std::vector<MethodInfo> radial_fields_methods() {
  return {{"radial-fields", "implicit surface of summed radial fields ([13], first form)",
           made<RadialFields, 1>},
          {"radial-fields-3", "the same over the last three frames", made<RadialFields, a_few>}};
}

}  // namespace palpate::lab
