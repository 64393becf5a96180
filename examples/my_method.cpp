// SPDX-License-Identifier: Apache-2.0
// A method of haptic rendering in one class, chosen by its name.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <utility>

#include <palpate/session/session.hpp>

// A spring to the mean of the points near the hand, along the line of sight. It yields to noise and
// can be pushed through; the library's methods cannot.
class Cushion final : public palpate::Method {
 public:
  void seat(const palpate::Vec3& /*proxy*/) noexcept override {}  // it remembers nothing
  void observe(const palpate::Observation& seen) noexcept override {
    seen_.take(seen.camera, seen.cloud);
    ++number_;
  }

  palpate::Tick tick(const palpate::Vec3& hip, double t) noexcept override {
    palpate::Tick tick = palpate::free_tick(hip, t, number_);
    if (seen_.parts().empty()) return tick;
    const palpate::Ball ball{.centre = hip, .radius = 0.02};
    patch_.start(ball);
    seen_.gather(ball, palpate::Patch::capacity, patch_);
    if (patch_.size() == 0 || !patch_.view(0).viewpoint) return tick;
    const palpate::Vec3 towards_camera = (*patch_.view(0).viewpoint - hip).normalized();
    double height = 0.0;  // [m] of the points over the hand
    for (std::size_t i = 0; i < patch_.size(); ++i)
      height += towards_camera.dot(palpate::Vec3(patch_.x()[i], patch_.y()[i], patch_.z()[i]));
    height /= static_cast<double>(patch_.size());
    if (height <= 0.0) return tick;
    tick.state = palpate::ContactState::contact;
    tick.normal = towards_camera;
    tick.proxy = hip + height * towards_camera;
    tick.force = stiffness_ * height * towards_camera;
    return tick;
  }

  void set_parameters(const palpate::Parameters& parameters) noexcept override {
    stiffness_ = parameters.coupling.stiffness;
  }

 private:
  palpate::ObservedClouds seen_;  // of all cameras, as one
  palpate::Patch patch_;
  double stiffness_ = 0.0;  // [N/m]
  std::int64_t number_ = -1;
};

int main() {
  palpate::SessionOptions options;
  options.methods.add({"cushion", "a spring to the mean of the points near the hand",
                       [](const palpate::Parameters& parameters) {
                         auto method = std::make_unique<Cushion>();
                         method->set_parameters(parameters);
                         return method;
                       }});
  options.method = "cushion";
  options.cameras.push_back({.uri = "synthetic:plane?noise=1mm&size=320x240"});
  options.pace = palpate::Pace::free_running;
  options.stroke_time = 6.0;
  palpate::Session session(std::move(options));
  double deepest = 0.0;  // [m]
  session.run(6.0, [&](const palpate::ServoTick& record) {
    deepest = std::max(deepest, (record.tick.proxy - record.tick.hip).norm());
  });
  std::printf("method %s: pressed in by %.1f mm, felt %.1f N\n", session.settings().method.c_str(),
              1e3 * deepest, session.state().hands[0].summary.largest_sent);
}
