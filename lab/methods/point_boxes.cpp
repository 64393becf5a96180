// SPDX-License-Identifier: Apache-2.0
// [9]: a small axis-aligned box around each point, found through a hash, and a god-object that the
// boxes' faces hold back, at most three at a time.
//
// Left open by the publication: the boxes' size. Half their edge is 0.8 times the median distance
// between neighbours, so that boxes overlap even where the points of a noisy frame lie apart. In a
// new frame a proxy that finds itself in a box leaves it, and those behind it, through the side
// that it was held back by.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "lab/local_points.hpp"
#include "lab/method.hpp"
#include "lab/table.hpp"

namespace palpate::lab {
namespace {

constexpr double share_of_spacing = 0.8;
constexpr double off = 1e-9;  // [m] between a face and what rests on it

class PointBoxes final : public LabMethod {
 public:
  explicit PointBoxes(const Parameters& parameters) : LabMethod(parameters) {}

  void seat(const Vec3& proxy) noexcept override {
    proxy_ = proxy;
    touching_ = false;
  }

  void frame(const Cloud& cloud, double /*stamp*/) noexcept override {
    points_.frame(cloud);
    new_frame_ = true;
  }

  Tick tick(const Vec3& hip, double t) noexcept override {
    if (!proxy_) proxy_ = hip;
    if (points_.cover(*proxy_)) build();
    if (new_frame_) climb();
    new_frame_ = false;
    const int faces = follow(hip);
    touching_ = faces > 0;
    Tick tick = free(hip, t);
    if (touching_) {
      const Vec3 pull = *proxy_ - hip;
      normal_ = pull.norm() > 1e-12 ? Vec3(pull.normalized()) : normal_;
      tick = held(hip, {*proxy_, normal_}, t);
    }
    tick.steps = faces + 1;
    return tick;
  }

 private:
  using Key = std::array<std::int32_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      return static_cast<std::size_t>(key[0]) * 73856093U ^
             static_cast<std::size_t>(key[1]) * 19349663U ^
             static_cast<std::size_t>(key[2]) * 83492791U;
    }
  };

  void build() {
    // The median over some of the points of the distance to the nearest other one.
    const std::vector<Vec3>& all = points_.points();
    std::vector<double> distances;
    for (std::size_t i = 0; i < all.size(); i += 1 + all.size() / 100) {
      points_.nearest(all[i], 2, near_);
      if (near_.size() == 2) distances.push_back(std::sqrt(near_[1].squared));
    }
    cells_.clear();
    if (distances.empty()) return;
    half_ = std::max(share_of_spacing * median(distances), 1e-5);
    for (std::uint32_t i = 0; i < all.size(); ++i) cells_[key(all[i])].push_back(i);
  }

  // A cell is as wide as a box: a box reaches into the next cell at most.
  [[nodiscard]] Key key(const Vec3& at) const {
    const Eigen::Array3d cell = (at.array() / (2.0 * half_)).floor();
    return {static_cast<std::int32_t>(cell.x()), static_cast<std::int32_t>(cell.y()),
            static_cast<std::int32_t>(cell.z())};
  }

  template <class Visit>
  void for_points_near(const Vec3& at, const Visit& visit) const {
    const Key middle = key(at);
    for (int i = 0; i < 27; ++i) {
      const auto found =
          cells_.find({middle[0] + i % 3 - 1, middle[1] + i / 3 % 3 - 1, middle[2] + i / 9 - 1});
      if (found == cells_.end()) continue;
      for (const std::uint32_t index : found->second) visit(points_.points()[index]);
    }
  }

  // Out of all boxes through the side where it was held back last.
  void climb() {
    if (!touching_) return;
    int axis = 0;
    normal_.cwiseAbs().maxCoeff(&axis);
    const double sign = normal_[axis] < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < 64; ++i) {
      double farthest = 0.0;
      for_points_near(*proxy_, [&](const Vec3& point) {
        const Vec3 from = *proxy_ - point;
        if (from.cwiseAbs().maxCoeff() < half_)
          farthest = std::max(farthest, half_ - sign * from[axis]);
      });
      if (farthest == 0.0) return;
      (*proxy_)[axis] += sign * (farthest + off);
    }
  }

  struct Hit {
    double travel;  // [-] share of the way
    int axis;       // of the face
    double at;      // [m] its coordinate, and a little outside of it
  };

  // The first face on the way from a place. Cell after cell, so that the way may be long.
  [[nodiscard]] Hit first_face(const Vec3& from, const Vec3& way) const {
    Hit hit{std::numeric_limits<double>::infinity(), 0, 0.0};
    const int cells = std::min(static_cast<int>(way.norm() / (2.0 * half_)) + 1, 1000);
    for (int i = 0; i <= cells && !(hit.travel * cells < i - 1); ++i)
      for_points_near(from + way * (double(i) / cells), [&](const Vec3& point) {
        double enter = -std::numeric_limits<double>::infinity();
        double leave = std::numeric_limits<double>::infinity();
        int axis = 0;
        for (int k = 0; k < 3; ++k) {
          const double offset = point[k] - from[k];
          if (way[k] == 0.0) {
            if (std::abs(offset) >= half_) return;
            continue;
          }
          const double side = way[k] > 0.0 ? -half_ : half_;
          const double first = (offset + side) / way[k];
          leave = std::min(leave, (offset - side) / way[k]);
          if (first > enter) {
            enter = first;
            axis = k;
          }
        }
        if (enter < 0.0 || enter > 1.0 || enter >= leave || enter >= hit.travel) return;
        const double side = way[axis] > 0.0 ? -(half_ + off) : half_ + off;
        hit = {enter, axis, point[axis] + side};
      });
    return hit;
  }

  // Towards the HIP: each face that is met holds its coordinate, the others continue.
  int follow(const Vec3& hip) {
    std::array<bool, 3> blocked{};
    Vec3 goal = hip;
    for (int faces = 0; faces < 3; ++faces) {
      const Vec3 way = goal - *proxy_;
      const Hit hit = way.norm() > off ? first_face(*proxy_, way) : Hit{2.0, 0, 0.0};
      if (hit.travel > 1.0) {
        proxy_ = goal;
        return faces;
      }
      *proxy_ += hit.travel * way;
      (*proxy_)[hit.axis] = hit.at;
      if (blocked[static_cast<std::size_t>(hit.axis)]) return faces;
      blocked[static_cast<std::size_t>(hit.axis)] = true;
      goal[hit.axis] = hit.at;
    }
    return 3;
  }

  LocalPoints points_{0.03};
  std::vector<LocalPoints::Neighbour> near_;
  std::unordered_map<Key, std::vector<std::uint32_t>, Hash> cells_;
  double half_ = 1e-3;  // [m] half a box's edge
  std::optional<Vec3> proxy_;
  Vec3 normal_ = Vec3::UnitZ();
  bool touching_ = false;
  bool new_frame_ = false;
};

}  // namespace

std::vector<MethodInfo> point_boxes_methods() {
  return {{"point-boxes", "a box around every point, in a hash, and a god-object ([9])",
           made<PointBoxes>}};
}

}  // namespace palpate::lab
