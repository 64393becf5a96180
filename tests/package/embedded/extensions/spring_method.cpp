// SPDX-License-Identifier: Apache-2.0
// A stranger's method: this file, and nothing elsewhere.
#include "palpate/kernel/methods/methods.hpp"

namespace palpate {
namespace {

// A spring to a plane half a metre before the camera, whatever that sees.
class Spring final : public Method {
 public:
  void seat(const Vec3& /*proxy*/) noexcept override {}
  void observe(const Observation& /*seen*/) noexcept override { ++frames_; }
  Tick tick(const Vec3& hip, double t) noexcept override {
    Tick tick = free_tick(hip, t, frames_ - 1);
    const double depth = hip.z() - 0.5;  // [m]
    if (depth <= 0.0) return tick;
    tick.state = ContactState::contact;
    tick.normal = -Vec3::UnitZ();
    tick.proxy = hip + depth * tick.normal;
    tick.force = 250.0 * depth * tick.normal;
    return tick;
  }
  void set_parameters(const Parameters& /*parameters*/) noexcept override {}

 private:
  std::int64_t frames_ = 0;
};

}  // namespace

MethodInfo spring_method() {
  return {.name = "spring", .summary = "a spring to a plane", .make = [](const Parameters&) {
            return std::make_unique<Spring>();
          }};
}

}  // namespace palpate
