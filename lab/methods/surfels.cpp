// SPDX-License-Identifier: Apache-2.0
// [13], second form: every point gets a normal n_i by total least squares over its 9 nearest
// neighbours [16], towards the camera, and these surfels blend to an implicit surface, touched by
// ImplicitMethod:
//
//   phi(p) = n . (p - a),  a = sum w x_i / sum w,  n = sum w n_i, normalised
//
// Left open by the publication: w. Wendland's function down to 0 at r_3, the neighbourhood in which
// the paper's own method makes its normal. Where no point is within r_3 there is no surface.
//
// [6] is the same where the points came with normals: `point-normals` takes those of the file, and
// total least squares only where a frame has none.
#include <cmath>

#include <Eigen/Eigenvalues>

#include "lab/implicit_method.hpp"
#include "lab/local_points.hpp"

namespace palpate::lab {
namespace {

constexpr std::size_t neighbours_of_a_normal = 9;
constexpr double stride = 0.5e-3;  // [m]
constexpr std::size_t a_few = 3;   // frames

class Surfels final : public ImplicitMethod {
 public:
  Surfels(const Parameters& parameters, std::size_t window, bool given)
      : ImplicitMethod(parameters, stride, parameters.proxy.r_3),
        given_(given),
        points_(0.03, window) {}

 private:
  void parameters_changed() noexcept override { set_reach(parameters().proxy.r_3); }

  void take(const Cloud& cloud, const Vec3& /*place*/) override { points_.frame(cloud); }

  void prepare(const Vec3& place) override {
    if (!points_.cover(place)) return;
    normals_.assign(points_.points().size(), Vec3::Zero());
    if (given_ && !points_.normals().empty()) normals_ = points_.normals();
  }

  const Vec3& normal(std::uint32_t i) {
    Vec3& normal = normals_[i];
    if (!normal.isZero()) return normal;
    const Vec3& at = points_.points()[i];
    points_.nearest(at, neighbours_of_a_normal + 1, neighbours_);  // and the point itself
    Vec3 mean = Vec3::Zero();
    for (const auto& near : neighbours_) mean += points_.points()[near.index] - at;
    mean /= static_cast<double>(neighbours_.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const auto& near : neighbours_) {
      const Vec3 off = points_.points()[near.index] - at - mean;
      scatter += off * off.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(scatter);
    normal = axes.eigenvectors().col(0);
    if (normal.dot(towards_viewer(points_.viewpoint(), at)) < 0.0) normal = -normal;
    return normal;
  }

  std::optional<FieldValue> field(const Vec3& at) override {
    const double radius = parameters().proxy.r_3;  // w is 0 beyond
    points_.within(at, radius, near_);
    double total = 0.0;
    Vec3 mean = Vec3::Zero();
    Vec3 direction = Vec3::Zero();
    for (const auto& [index, squared] : near_) {
      const double q = std::sqrt(squared) / radius;
      const double square = (1.0 - q) * (1.0 - q);
      const double w = square * square * (4.0 * q + 1.0);
      total += w;
      mean += w * points_.points()[index];
      direction += w * normal(index);
    }
    if (!(total > 1e-9) || !(direction.norm() > 1e-9 * total)) return std::nullopt;
    direction.normalize();
    return FieldValue{direction.dot(at - mean / total), direction};
  }

  bool given_;  // normals are taken as they came, where they did
  LocalPoints points_;
  std::vector<Vec3> normals_;  // of each point, zero until it is asked for
  std::vector<LocalPoints::Neighbour> near_, neighbours_;
};

}  // namespace

std::vector<MethodInfo> surfels_methods() {
  return {{"surfels", "implicit surface of total-least-squares normals ([13], second form, [16])",
           made<Surfels, 1, false>},
          {"surfels-3", "the same over the last three frames", made<Surfels, a_few, false>},
          {"point-normals", "a point set with given normals ([6])", made<Surfels, 1, true>}};
}

}  // namespace palpate::lab
