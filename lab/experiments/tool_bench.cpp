// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/tool_bench.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "lab/method.hpp"

namespace palpate::lab {

Part part(Shape shape, const Vec3& at, const Vec3& turn) {
  Part made;
  made.shape = std::move(shape);
  made.world_from_part.linear() = rotation_by(turn).toRotationMatrix();
  made.world_from_part.translation() = at;
  return made;
}

namespace {

constexpr double deepest = 30e-3;  // [m] what is deeper is behind something else

struct Seen {
  const DepthImage& image;
  Eigen::Isometry3d camera_from_world = image.world_from_camera().inverse();

  // [m] how far a place is behind what is seen along its line of sight; below 0 in front. None
  // where nothing is known.
  [[nodiscard]] std::optional<double> behind(const Vec3& place) const {
    const Intrinsics& k = image.intrinsics();
    const Vec3 p = camera_from_world * place;
    const int u = static_cast<int>(std::lround(k.cx + k.fx * p.x() / p.z()));
    const int v = static_cast<int>(std::lround(k.cy + k.fy * p.y() / p.z()));
    if (u < 0 || v < 0 || u >= k.width || v >= k.height) return std::nullopt;
    const double z = image.depth_at(u, v);
    return z > 0.0 ? std::optional(p.z() - z) : std::nullopt;
  }
};

// The newest frame as a field of such depths in voxels about the tool, as planners and simulators
// have it; its gradient points into the surface.
class VoxelField {
 public:
  void take(const DepthImage& image, const Vec3& place, double reach) {
    const Seen seen{image};
    spacing_ = 2.0 * (reach + deepest) / (side - 1);
    low_ = place - Vec3::Constant(0.5 * (side - 1) * spacing_);
    depth_.clear();
    for (int i = 0; i < side * side * side; ++i) {
      const Vec3 at = low_ + spacing_ * Vec3(i % side, i / side % side, i / (side * side));
      depth_.push_back(std::clamp(seen.behind(at).value_or(-deepest), -deepest, deepest));
    }
  }
  // Interpolated. @return the depth, and its gradient
  [[nodiscard]] std::pair<double, Vec3> at(const Vec3& place) const {
    const Vec3 q = (place - low_) / spacing_;
    std::pair<double, Vec3> found{-deepest, Vec3::Zero()};
    if (!(q.minCoeff() >= 0.0 && q.maxCoeff() < side - 1)) return found;
    const Eigen::Vector3i cell = q.cast<int>();
    const Vec3 part = q - cell.cast<double>();
    found.first = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3i bit(corner & 1, corner >> 1 & 1, corner >> 2);
      const Eigen::Vector3i of = cell + bit;
      const double depth =
          depth_[static_cast<std::size_t>((of.z() * side + of.y()) * side + of.x())];
      const Vec3 share =
          bit.cast<double>().cwiseProduct(2.0 * part - Vec3::Ones()) + Vec3::Ones() - part;
      found.first += depth * share.prod();
      for (int k = 0; k < 3; ++k)
        found.second[k] += depth * (bit[k] ? 1.0 : -1.0) * share[(k + 1) % 3] * share[(k + 2) % 3];
    }
    return found;
  }

 private:
  static constexpr int side = 64;
  double spacing_ = 0.0;  // [m]
  Vec3 low_ = Vec3::Zero();
  std::vector<double> depth_;  // [m]
};

class Penalty final : public LabMethod {
 public:
  Penalty(std::shared_ptr<const ToolShape> shape, bool has_voxels)
      : LabMethod(Parameters()), shape_(std::move(shape)), has_voxels_(has_voxels) {}
  Tick tick(const Vec3& hip, double t) noexcept override { return tick(HandPose{hip}, t); }
  Tick tick(const HandPose& hand, double t) noexcept override {
    const DepthImage& image = *seen()->image();
    if (has_voxels_ && is_new_) voxels_.take(image, hand.position, shape_->reach());
    is_new_ = false;
    Tick tick = free(hand.position, t);
    tick.orientation = tick.proxy_orientation = hand.orientation;
    const Seen view{image};
    double depths = 0.0, squares = 0.0;
    for (const auto& point : shape_->points()) {
      const Vec3 lever = hand.orientation * point.at;
      double depth = 0.0;
      Vec3 way = hand.orientation * point.inward;
      if (has_voxels_) {
        const auto [behind, gradient] = voxels_.at(hand.position + lever);
        depth = behind;
        way = -gradient.normalized();
      } else {
        depth = view.behind(hand.position + lever).value_or(0.0);
      }
      if (depth <= 0.0 || depth > deepest) continue;
      const Vec3 force = depth * way;
      tick.force += force;
      tick.torque += lever.cross(force);
      depths += depth;
      squares += depth * depth;
    }
    if (depths <= 0.0) return tick;
    // As if as many points as share the depths evenly were the springs.
    const double share = squares / (depths * depths);
    const double stiffness = Coupling{}.stiffness;
    const double length = shape_->turn_length();
    tick.proxy += share * tick.force;
    tick.proxy_orientation =
        rotation_by(share / (length * length) * tick.torque) * hand.orientation;
    tick.force *= share * stiffness;
    tick.torque *= share * stiffness;
    return tick;
  }

 private:
  void frame(const Cloud& /*all*/, double /*stamp*/) noexcept override { is_new_ = true; }

  std::shared_ptr<const ToolShape> shape_;
  bool has_voxels_;
  bool is_new_ = false;  // the newest frame is not in the voxels yet
  VoxelField voxels_;
};

}  // namespace

std::unique_ptr<Method> make_tool_method(std::string_view name,
                                         std::shared_ptr<const ToolShape> shape) {
  if (name == "shape") return std::make_unique<ShapeTouch>(std::move(shape), Parameters());
  return std::make_unique<Penalty>(std::move(shape), name == "voxels");
}

}  // namespace palpate::lab
