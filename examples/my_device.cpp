// SPDX-License-Identifier: Apache-2.0
// A haptic device in one class, opened by a URI of its own.
#include <atomic>
#include <cstdio>
#include <memory>
#include <utility>

#include <palpate/session/session.hpp>

// A probe that is lowered at 10 mm/s until it feels a newton, and then rests.
class Probe final : public palpate::Device {
 public:
  explicit Probe(const palpate::Uri& uri)
      : height_(uri.number_option("from", 0.03, 0.0, 1.0, "m")) {
    info_.uri = uri.text();
    info_.kind = "probe";
    info_.limits = {.max_force = 2.0, .continuous_force = 2.0};  // [N]
  }
  [[nodiscard]] const palpate::DeviceInfo& info() const override { return info_; }

  palpate::HandState read(double t) noexcept override {
    if (force_ < 1.0) height_ -= 0.01 * (t - last_t_);
    last_t_ = t;
    return {.position = {0.0, 0.0, height_}};
  }
  void write(const palpate::Vec3& force, double /*t*/) noexcept override {
    force_ = enabled_ ? force.norm() : 0.0;
  }
  void enable() override { enabled_ = true; }
  void disable() noexcept override { enabled_ = false; }

 private:
  palpate::DeviceInfo info_;
  double height_;  // [m]
  double last_t_ = 0.0;
  double force_ = 0.0;                // [N]
  std::atomic<bool> enabled_{false};  // disable() comes from any thread
};

int main() {
  palpate::SessionOptions options;
  options.devices.add(
      {"probe", "is lowered until it feels a newton: probe:?from=METRES",
       [](const palpate::Uri& uri, const auto& /*path*/) { return std::make_unique<Probe>(uri); }});
  options.hands[0].device = "probe:?from=0.04";
  options.cameras.push_back({.uri = "synthetic:plane?size=160x120"});
  options.pace = palpate::Pace::free_running;
  palpate::Session session(std::move(options));
  palpate::ServoTick last;
  session.run(6.0, [&](const palpate::ServoTick& record) { last = record; });
  std::printf("%s: felt %.1f N at a height of %.1f mm\n", session.device().info().kind.c_str(),
              last.force.norm(), 1e3 * last.position.z());
}
