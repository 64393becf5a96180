// SPDX-License-Identifier: Apache-2.0
#include "lab/closed_loop.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "palpate/io/devices/simulated_hand.hpp"

namespace palpate::lab {
namespace {

std::function<double()> speed_of(const SimulatedHand& hand, double mass) {
  return [&hand, mass] { return std::sqrt(2.0 * hand.statistics().kinetic / mass); };
}

// A handle that is moved along a path until the hand on it feels nothing and releases.
class LetGo final : public Device {
 public:
  LetGo(const HipPath& path, const DevicePreset& device, double from)
      : path_(path),
        handle_(HipPath({{0.0, Vec3::Zero()}}),
                {.mass = 0.0, .stiffness = 0.0, .damping = 0.0, .tremor = 0.0, .body = device.body},
                "hand:"),
        friction_(device.body.friction),
        from_(from) {
    handle_.set_device(device);
  }

  [[nodiscard]] const DeviceInfo& info() const override { return handle_.info(); }
  HandState read(double t) noexcept override {
    if (free_) return handle_.read(t);
    position_ = path_.at(t);
    return {.position = position_};
  }
  void write(const Vec3& force, double t) noexcept override {
    if (!free_ && t > from_ && force.norm() <= friction_) {
      free_ = true;
      handle_.launch(position_, Vec3::Zero());
      handle_.read(t);
    }
    if (free_) handle_.write(force, t);
  }
  [[nodiscard]] const SimulatedHand& handle() const { return handle_; }

 private:
  HipPath path_;
  SimulatedHand handle_;
  double friction_;  // [N]
  double from_;      // [s]
  Vec3 position_ = Vec3::Zero();
  bool free_ = false;
};

class StraightLoop final : public TouchLoop {
 public:
  StraightLoop(std::unique_ptr<Method> method, HeldDevice held)
      : method_(std::move(method)), held_(std::move(held)) {}

  void frame(const std::shared_ptr<const Cloud>& cloud, double stamp, double /*t*/) override {
    method_->observe({*cloud, stamp});
  }

  Felt tick(double t) override {
    const Vec3 hip = held_.device->read(t).position;
    const Tick tick = method_->tick(hip, t);
    Felt felt{t, hip, tick.force, tick.force, tick.surface_velocity, held_.speed()};
    const double magnitude = felt.force.norm();
    if (magnitude > held_.peak_force) felt.force *= held_.peak_force / magnitude;
    held_.device->write(felt.force, t);
    return felt;
  }

 private:
  std::unique_ptr<Method> method_;
  HeldDevice held_;
};

class SafeLoop final : public TouchLoop {
 public:
  SafeLoop(std::unique_ptr<Method> method, HeldDevice held, const ServoSettings& settings)
      : held_(std::move(held)),
        cycle_(std::move(method), *held_.device, settings, ring),
        reader_(cycle_.reader()) {}

  void frame(const std::shared_ptr<const Cloud>& cloud, double stamp, double t) override {
    cycle_.put_frame(cloud, stamp, t);
  }

  Felt tick(double t) override {
    cycle_.run({.t = t});
    ServoTick done;
    static_cast<void>(reader_.try_pop(done));
    return {t,
            done.tick.hip,
            done.force,
            done.tick.force,
            done.tick.surface_velocity,
            held_.speed(),
            done.safety};
  }

 private:
  static constexpr std::size_t ring = 4;  // read after each tick
  HeldDevice held_;
  Cycle cycle_;
  TickRing<ServoTick>::Reader reader_;
};

}  // namespace

HeldDevice on_path(const HipPath& path) {
  return {std::make_unique<ScriptedDevice>(path, false), std::numeric_limits<double>::infinity(),
          [] { return 0.0; }};
}

std::unique_ptr<SimulatedHand> simulated_hand(const HipPath& path, const Grip& grip,
                                              const DevicePreset& device, std::uint64_t seed) {
  auto hand = std::make_unique<SimulatedHand>(path, HandModel{.mass = grip.mass,
                                                              .stiffness = grip.stiffness,
                                                              .damping = grip.damping,
                                                              .seed = seed,
                                                              .body = device.body});
  hand->set_device(device);
  return hand;
}

HeldDevice in_hand(const HipPath& path, const Grip& grip, const DevicePreset& device,
                   std::uint64_t seed) {
  auto hand = simulated_hand(path, grip, device, seed);
  auto speed = speed_of(*hand, grip.mass + device.body.mass);
  return {std::move(hand), device.limits.max_force, std::move(speed)};
}

HeldDevice let_go(const HipPath& path, const DevicePreset& device, double from) {
  auto handle = std::make_unique<LetGo>(path, device, from);
  auto speed = speed_of(handle->handle(), device.body.mass);
  return {std::move(handle), device.limits.max_force, std::move(speed)};
}

std::unique_ptr<TouchLoop> straight_loop(std::unique_ptr<Method> method, HeldDevice held) {
  return std::make_unique<StraightLoop>(std::move(method), std::move(held));
}

std::unique_ptr<TouchLoop> safe_loop(std::unique_ptr<Method> method, HeldDevice held,
                                     const Parameters& parameters, SafetyParameters safety) {
  ServoSettings settings;
  settings.parameters = parameters;
  settings.safety = safety;
  settings.safety.initial_heat = 0.0;
  return std::make_unique<SafeLoop>(std::move(method), std::move(held), settings);
}

void play_to(const std::vector<std::unique_ptr<TouchLoop>>& loops, const Scenario& scenario,
             const std::function<void(std::size_t loop, const Felt&)>& on_tick) {
  run(
      scenario,
      [&](const std::shared_ptr<const Cloud>& cloud, double stamp, double t) {
        for (const auto& loop : loops) loop->frame(cloud, stamp, t);
      },
      [&](double t) {
        for (std::size_t k = 0; k < loops.size(); ++k) on_tick(k, loops[k]->tick(t));
        return true;
      });
}

}  // namespace palpate::lab
