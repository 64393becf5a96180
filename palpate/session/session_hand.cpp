// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/session_hand.hpp"

#include <limits>
#include <thread>
#include <utility>
#include <vector>

#include "palpate/io/devices/mouse_device.hpp"

namespace palpate {

SessionHand::SessionHand(std::string name, std::unique_ptr<Device> device, const Placement& place)
    : name_(std::move(name)),
      device_(std::move(device)),
      mouse_(dynamic_cast<MouseDevice*>(device_.get())),
      placement(place) {}

SessionHand::~SessionHand() {
  if (!loop_ || loop_->has_ended()) return;
  struct Left {
    std::unique_ptr<Device> device;
    std::unique_ptr<ServoLoop> loop;  // destroyed first
  };
  auto left = std::make_unique<Left>();
  left->device = std::move(device_);
  left->loop = std::move(loop_);
  std::thread([left = std::move(left)]() mutable { left.reset(); }).detach();
}

void SessionHand::begin(std::shared_ptr<Method> method, const ServoSettings& settings,
                        const std::optional<ServoOptions>& servo) {
  if (servo) {
    loop_ = std::make_unique<ServoLoop>(std::move(method), *device_, settings, *servo);
    cycle_ = &loop_->cycle();
  } else {
    free_cycle_ = std::make_unique<Cycle>(std::move(method), *device_, settings);
    cycle_ = free_cycle_.get();
  }
  counted_.emplace(cycle_->reader());
  run_.emplace(cycle_->reader());
}

void SessionHand::link(std::span<const std::unique_ptr<SessionHand>> hands) {
  std::vector<std::shared_ptr<const CycleStatistics>> others;
  for (const auto& hand : hands) {
    if (hand.get() != this) others.push_back(hand->cycle().shared_statistics());
  }
  cycle_->link(std::move(others), loop_ ? ForceWatchdog::Limits().force_time
                                        : std::numeric_limits<double>::infinity());
}

std::optional<ServoTick> SessionHand::run_at(double t) {
  cycle_->run({.t = t});
  ServoTick record{};
  return run_->try_pop(record) ? std::optional(record) : std::nullopt;
}

void SessionHand::count(std::span<const std::shared_ptr<const Cloud>> cameras, double r_c) {
  const std::lock_guard lock(mutex_);
  ServoTick record{};
  bool any = false;
  for (ServoTick next{}; counted_->try_pop(next); record = next) {
    if (any) summary_.count(record, std::nullopt, r_c);
    any = true;
  }
  if (any) summary_.count(record, least_behind(cameras, record.tick.proxy, r_c), r_c);
}

Summary SessionHand::summary() const {
  Summary summary;
  {
    const std::lock_guard lock(mutex_);
    summary = summary_;
  }
  if (loop_) summary.late_ticks = loop_->timing().late_ticks.load();
  return summary;
}

}  // namespace palpate
