// SPDX-License-Identifier: Apache-2.0
// A truncated signed distance function about the proxy, what one would try today: 64^3 voxels of
// 1.5 mm into which every frame is fused, touched by ImplicitMethod.
//
// Each point within it writes its signed distance along its line of sight into the voxels there,
// from the near side of the volume (free: +truncation) to one truncation (4 voxels) behind it. A
// voxel keeps the mean of the frames, none counting for less than an eighth: that smooths noise
// over eight frames and lags behind what moves. The volume moves along with the proxy by whole
// voxels.
#include <algorithm>
#include <vector>

#include "lab/implicit_method.hpp"
#include "lab/local_points.hpp"

namespace palpate::lab {
namespace {

constexpr int side = 64;                     // [voxels]
constexpr double voxel = 1.5e-3;             // [m]
constexpr double truncation = 4.0 * voxel;   // [m]
constexpr double half = 0.5 * side * voxel;  // [m]
// From here on a line of sight writes nothing but that its voxels are free.
constexpr double free_from = truncation + 2.0 * voxel;  // [m]
constexpr float most_weight = 8.0F;                     // [frames]

using Cell = Eigen::Vector3i;

class Tsdf final : public ImplicitMethod {
 public:
  explicit Tsdf(const Parameters& parameters)
      : ImplicitMethod(parameters, voxel / 3.0, truncation),
        distance_(voxels, 1.0F),
        weight_(voxels, 0.0F),
        sum_(voxels, 0.0F),
        hits_(voxels, 0.0F) {}

 private:
  static constexpr std::size_t voxels = std::size_t{side} * side * side;

  void take(const Cloud& cloud, const Vec3& place) override {
    cloud_ = &cloud;
    move_to(place);
    fuse(true);
  }

  void prepare(const Vec3& place) override {
    if (cloud_ == nullptr || (place - centre()).cwiseAbs().maxCoeff() < 0.25 * half) return;
    move_to(place);
    fuse(false);
  }

  [[nodiscard]] Vec3 centre() const {
    return voxel * (corner_.cast<double>() + Vec3::Constant(0.5 * side));
  }

  static std::size_t index(const Cell& cell) {
    return (static_cast<std::size_t>(cell.z()) * side + static_cast<std::size_t>(cell.y())) * side +
           static_cast<std::size_t>(cell.x());
  }

  void move_to(const Vec3& place) {
    const Cell corner =
        (place / voxel).array().round().matrix().cast<int>() - Cell::Constant(side / 2);
    const Cell shift = corner - corner_;
    corner_ = corner;
    if (shift.isZero()) return;
    std::vector<float> distance(voxels, 1.0F);
    std::vector<float> weight(voxels, 0.0F);
    for (int z = 0; z < side; ++z) {
      for (int y = 0; y < side; ++y) {
        for (int x = 0; x < side; ++x) {
          const Cell from = Cell(x, y, z) + shift;
          if ((from.array() < 0).any() || (from.array() >= side).any()) continue;
          distance[index({x, y, z})] = distance_[index(from)];
          weight[index({x, y, z})] = weight_[index(from)];
        }
      }
    }
    distance_.swap(distance);
    weight_.swap(weight);
  }

  // @param all  also into voxels that are known; else only into those that came in by a move
  void fuse(bool all) {
    gather(*cloud_, Ball{centre(), 1.7320508 * half}, patch_);
    if (patch_.size() == 0) return;
    const auto& viewpoint = patch_.view(0).viewpoint;
    written_.clear();
    const Vec3 corner = voxel * corner_.cast<double>();
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const Vec3 point = patch_.ball().centre + Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]);
      const Vec3 out = towards_viewer(viewpoint, point).normalized();
      for (double s = -truncation; s < 2.0 * half; s += s < free_from ? 0.5 * voxel : voxel) {
        const Vec3 at = (point + s * out - corner) / voxel - Vec3::Constant(0.5);
        const Cell low = at.array().floor().matrix().cast<int>();
        if ((low.array() < -1).any() || (low.array() >= side).any()) {
          if (s > 0.0) break;
          continue;
        }
        // To the eight voxels about the place, by how near they are.
        const Vec3 part = at - low.cast<double>();
        const auto value = static_cast<float>(std::min(s / truncation, 1.0));
        const bool inside = low.minCoeff() >= 0 && low.maxCoeff() < side - 1;
        for (int k = 0; k < 8; ++k) {
          const Cell cell = low + Cell(k & 1, k >> 1 & 1, k >> 2);
          if (!inside && (cell.minCoeff() < 0 || cell.maxCoeff() >= side)) continue;
          if (s >= free_from) {
            write_free(index(cell), all);
            continue;
          }
          const auto share = static_cast<float>((k & 1 ? part.x() : 1.0 - part.x()) *
                                                (k & 2 ? part.y() : 1.0 - part.y()) *
                                                (k & 4 ? part.z() : 1.0 - part.z()));
          const std::size_t j = index(cell);
          if (share <= 0.0F || (!all && weight_[j] > 0.0F)) continue;
          if (hits_[j] == 0.0F) written_.push_back(static_cast<std::uint32_t>(j));
          hits_[j] += share;
          // The value of the voxel itself, by the distance along this line of sight.
          const double nearer = out.dot((cell.cast<double>() - at)) * voxel;
          sum_[j] += share * std::min(value + static_cast<float>(nearer / truncation), 1.0F);
        }
      }
    }
    for (const std::uint32_t j : written_) {
      const float value = std::max(sum_[j] / hits_[j], -1.0F);
      const float weight = weight_[j];
      distance_[j] = (distance_[j] * weight + value) / (weight + 1.0F);
      weight_[j] = std::min(weight + 1.0F, most_weight - 1.0F);
      sum_[j] = hits_[j] = 0.0F;
    }
  }

  // Once a frame is enough.
  void write_free(std::size_t j, bool all) {
    if (hits_[j] > 0.0F || (!all && weight_[j] > 0.0F)) return;
    written_.push_back(static_cast<std::uint32_t>(j));
    hits_[j] = sum_[j] = 1.0F;
  }

  // Trilinear; unknown where one of the eight voxels was never written.
  std::optional<FieldValue> field(const Vec3& at) override {
    const Vec3 place = at / voxel - corner_.cast<double>() - Vec3::Constant(0.5);
    const Cell low = place.array().floor().matrix().cast<int>();
    if ((low.array() < 0).any() || (low.array() >= side - 1).any()) return std::nullopt;
    const Vec3 part = place - low.cast<double>();
    FieldValue result{0.0, Vec3::Zero()};
    for (int k = 0; k < 8; ++k) {
      const std::size_t j = index(low + Cell(k & 1, k >> 1 & 1, k >> 2));
      if (weight_[j] == 0.0F) return std::nullopt;
      const Vec3 share(k & 1 ? part.x() : 1.0 - part.x(), k & 2 ? part.y() : 1.0 - part.y(),
                       k & 4 ? part.z() : 1.0 - part.z());
      const double value = double{distance_[j]} * truncation;
      result.value += value * share.prod();
      result.gradient += value / voxel *
                         Vec3((k & 1 ? 1.0 : -1.0) * share.y() * share.z(),
                              (k & 2 ? 1.0 : -1.0) * share.x() * share.z(),
                              (k & 4 ? 1.0 : -1.0) * share.x() * share.y());
    }
    return result;
  }

  const Cloud* cloud_ = nullptr;
  Patch patch_;
  Cell corner_ = Cell::Constant(-side / 2);
  std::vector<float> distance_, weight_;  // [truncations], [frames]
  std::vector<float> sum_, hits_;         // of the frame that is being fused; zero between
  std::vector<std::uint32_t> written_;
};

}  // namespace

std::vector<MethodInfo> tsdf_methods() {
  return {
      {"tsdf", "64^3 voxels of signed distance around the proxy, fused over frames", made<Tsdf>}};
}

}  // namespace palpate::lab
