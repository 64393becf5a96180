// SPDX-License-Identifier: Apache-2.0
// [14]: an image augmented with haptic features. Nothing is made a surface: the height is that of
// the depth map at the HIP's own pixel, the slope that of its neighbours, the texture the
// brightness of the image there.
//
// Left open by the publication: how many neighbours. A plane through those within 4 mm of the HIP's
// line of sight favours it over single pixels. Half a millimetre of height is white against black,
// where a frame came with its brightness.
#include <limits>

#include "lab/method.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/linear.hpp"

namespace palpate::lab {
namespace {

constexpr double around = 0.004;           // [m]
constexpr double reach = 0.3;              // [m] along the line of sight
constexpr double texture_height = 0.5e-3;  // [m] of white

class ImageFeatures final : public LabMethod {
 public:
  explicit ImageFeatures(const Parameters& parameters) : LabMethod(parameters) {}

  Tick tick(const Vec3& hip, double t) noexcept override {
    const Tick nothing = free(hip, t);
    if (seen() == nullptr) return nothing;
    const Beam beam{hip, around, reach, -Vec3::UnitZ()};
    gather(*seen(), beam, Patch::capacity, patch_);
    if (patch_.size() < 3) return nothing;
    const SightCone cone(beam, patch_.view(0).viewpoint);
    const Vec3 away = cone.axis();
    const Vec3 right = away.unitOrthogonal();
    const Vec3 down = away.cross(right);

    // Depth beyond the HIP = c0 + c1 right + c2 down, over the pixels about it. Of what lies one
    // behind the other the image sees the nearest only, and so do these.
    Eigen::Matrix3d squares = Eigen::Matrix3d::Identity() * 1e-12;
    Vec3 sums = Vec3::Zero();
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const Vec3 x(patch_.x()[i], patch_.y()[i], patch_.z()[i]);
      const Vec3 row(1.0, x.dot(right) / around, x.dot(down) / around);
      squares += row * row.transpose();
      sums += x.dot(away) * row;
    }
    const Vec3 plane = solve_symmetric<3>(squares, sums);
    const Vec3 normal = (plane[1] / around * right + plane[2] / around * down - away).normalized();
    const Vec3 place = hip + plane[0] * away + texture(hip) * normal;
    const double depth = normal.dot(place - hip);
    if (!(depth > 0.0)) return nothing;
    return held(hip, {hip + depth * normal, normal}, t);
  }

 private:
  // [m] Of the pixel that sees the HIP.
  [[nodiscard]] double texture(const Vec3& hip) const {
    const DepthImage* image = seen()->image();
    if (image == nullptr || image->brightness().empty()) return 0.0;
    const Vec3 in_camera = image->world_from_camera().inverse() * hip;
    const auto window = image->rays().window(in_camera, around);
    double least = std::numeric_limits<double>::infinity();
    double height = 0.0;
    for (int v = window.v_begin; v < window.v_end; ++v) {
      for (int u = window.u_begin; u < window.u_end; ++u) {
        const double off = (image->rays().ray(u, v) - in_camera.hnormalized()).squaredNorm();
        if (!(off < least)) continue;
        least = off;
        const auto pixel = static_cast<std::size_t>(v) * image->intrinsics().width + u;
        height = texture_height * image->brightness()[pixel] / 255.0;
      }
    }
    return height;
  }

  Patch patch_;
};

}  // namespace

std::vector<MethodInfo> image_features_methods() {
  return {{"image-features", "height and texture of the image at the pixel of the HIP ([14])",
           made<ImageFeatures>}};
}

}  // namespace palpate::lab
