// SPDX-License-Identifier: Apache-2.0
// Virtual coupling [2]: the hand does not touch the scene, a virtual tool does, and between both
// are a spring K and a damper B, within the limits in which a sampled wall is passive.
//
// The publication leaves the scene open: any passive one will do. Here the tool is a ball of r_c
// without mass, and the scene pushes it off the moving-least-squares plane of [7] with ten times
// stiffness K. The tool is where both forces are equal at the end of the tick (implicit Euler), so
// that it is stable for any K. It remembers where it was, but not on which side of the surface.
//
// K is what the parameters say, or what a device with 0.5 N s/m of its own damping can bear at the
// rate of the ticks if that is less: 1 kHz bears 1000 N/m.
#include <algorithm>

#include <Eigen/LU>

#include "lab/local_points.hpp"
#include "lab/method.hpp"

namespace palpate::lab {
namespace {

constexpr double device_damping = 0.5;    // [N s/m]
constexpr double scene_to_spring = 10.0;  // [-]

class VirtualCoupling final : public LabMethod {
 public:
  explicit VirtualCoupling(const Parameters& parameters) : LabMethod(parameters) {}

  void seat(const Vec3& proxy) noexcept override { tool_ = proxy; }

  Tick tick(const Vec3& hip, double t) noexcept override {
    const double period = t > last_t_ ? t - last_t_ : 1e-3;
    const Vec3 before = tool_.value_or(hip);
    const Vec3 hand_velocity = (hip - last_hip_.value_or(hip)) / period;
    last_t_ = t;
    last_hip_ = hip;
    Tick tick = free(hip, t);
    tool_ = hip;
    if (seen() == nullptr) return tick;

    const double r_c = parameters().proxy.r_c();
    const double radius = 7.0 * r_c;
    gather(*seen(), Ball{before, radius}, patch_);
    const auto plane = fit_plane(patch_, radius);
    if (!plane) return tick;

    // K (hip - x) + B (v_hip - (x - before) / T) + K_s max(0, r_c - n.(x - a)) n = 0
    const double damping = parameters().coupling.damping;
    const double stiffness = std::min(parameters().coupling.stiffness,
                                      passive_stiffness(device_damping, damping, period));
    const double soft = stiffness + damping / period;
    if (!(soft > 0.0)) return tick;
    const Vec3 pull = stiffness * hip + damping * (hand_velocity + before / period);
    const Vec3 loose = pull / soft;
    tool_ = loose;
    const Vec3& n = plane->normal;
    if (n.dot(loose - plane->point) >= r_c) return tick;
    const double hard = scene_to_spring * stiffness;
    const Eigen::Matrix3d sum = soft * Eigen::Matrix3d::Identity() + hard * n * n.transpose();
    tool_ = sum.inverse() * (pull + hard * (r_c + n.dot(plane->point)) * n);

    tick.state = ContactState::contact;
    tick.normal = n;
    tick.proxy = *tool_;
    tick.force =
        stiffness * (*tool_ - hip) + damping * ((*tool_ - before) / period - hand_velocity);
    // As of the other methods, the spring is slack where the ball touches.
    const double length = tick.force.norm();
    const double felt = std::clamp(length - stiffness * r_c, 0.0, parameters().coupling.max_force);
    tick.force *= length > 0.0 ? felt / length : 0.0;
    return tick;
  }

 private:
  Patch patch_;
  std::optional<Vec3> tool_, last_hip_;
  double last_t_ = 0.0;
};

}  // namespace

std::vector<MethodInfo> virtual_coupling_methods() {
  return {{"virtual-coupling",
           "spring and damper to a virtual tool, within its passive limit ([2])",
           made<VirtualCoupling>}};
}

}  // namespace palpate::lab
