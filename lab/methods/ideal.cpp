// SPDX-License-Identifier: Apache-2.0
// The ruler: a sphere of radius r_c that rests on the true surface, followed continuously in time,
// coupled to the HIP by (16).
#include <algorithm>
#include <optional>
#include <utility>

#include "lab/method.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/hand_velocity.hpp"
#include "palpate/kernel/paper/coupling.hpp"

namespace palpate::lab {
namespace {

class Ideal final : public LabMethod {
 public:
  Ideal(const Parameters& parameters, Truth truth)
      : LabMethod(parameters), truth_(std::move(truth)) {}

  void seat(const Vec3& proxy) noexcept override { proxy_ = proxy; }

  Tick tick(const Vec3& hip, double t) noexcept override {
    if (!proxy_) proxy_ = hip;
    const double r_c = parameters().proxy.r_c();
    // Steps towards the HIP, each no longer than a tenth of the radius and followed by a push out
    // of the surface along its normal, end where the way to the HIP is along the normal.
    const double longest = 0.1 * r_c;
    TruePoint under = truth_(*proxy_, t);
    for (int i = 0; i < 200; ++i) {
      const Vec3 before = *proxy_;
      Vec3 step = hip - *proxy_;
      if (under.distance <= r_c + 1e-9 && step.dot(under.normal) < 0.0)
        step -= step.dot(under.normal) * under.normal;
      else
        step *= std::min(1.0, std::max(under.distance - r_c, 1e-6) / std::max(step.norm(), 1e-12));
      if (under.distance <= r_c + 1e-9 && step.norm() > longest) step *= longest / step.norm();
      *proxy_ += step;
      under = truth_(*proxy_, t);
      for (int j = 0; j < 4 && under.distance < r_c - 1e-10; ++j) {
        *proxy_ += (r_c - under.distance) * under.normal;
        under = truth_(*proxy_, t);
      }
      if ((*proxy_ - before).norm() < 1e-9) break;
    }
    const bool touching = under.distance <= r_c + 1e-7 && (hip - *proxy_).norm() > 1e-9;
    hand_velocity_.update(hip, t);
    Vec3 force = Vec3::Zero();
    if (touching) {
      // The damper acts on the hand's velocity relative to the surface, as that of `sight`.
      const double rises =
          (truth_(*proxy_, t - surface_dt).distance - truth_(*proxy_, t).distance) / surface_dt;
      const Vec3 u = hip - *proxy_;
      const double rate =
          (hand_velocity_.value() - rises * under.normal).dot(u) / std::max(u.norm(), 1e-12);
      force = coupling_force(parameters().coupling, u, rate, r_c, false).force;
    }
    Tick tick = free(hip, t);
    tick.proxy = *proxy_;
    tick.force = force;
    if (touching) {
      tick.normal = under.normal;
      tick.state = ContactState::contact;
    }
    return tick;
  }

 private:
  static constexpr double surface_dt = 1e-3;  // [s]
  Truth truth_;
  HandVelocity hand_velocity_;
  std::optional<Vec3> proxy_;
};

}  // namespace

MethodInfo ideal_method(const Truth& truth) {
  const auto make = [truth](const Parameters& parameters) {
    if (!truth)
      throw Error("method 'ideal'", "there is no analytic ground truth here",
                  "choose another method, or a synthetic scene");
    return std::make_unique<Ideal>(parameters, truth);
  };
  return {"ideal", "the proxy on the true surface: the ground-truth reference", make, false};
}

}  // namespace palpate::lab
