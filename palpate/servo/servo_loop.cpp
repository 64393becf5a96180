// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/servo_loop.hpp"

#include <string>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate {

ServoLoop::ServoLoop(std::unique_ptr<Rendering> rendering, Device& device,
                     const ServoSettings& settings, const ServoOptions& options)
    : device_(device), options_(options), cycle_(std::move(rendering), device, settings) {
  if (!(options_.rate >= 500.0 && options_.rate <= 10'000.0)) {
    throw Error("servo rate", std::to_string(options_.rate) + " Hz is out of range",
                "give a rate from 500 to 10000 Hz");
  }
}

ServoLoop::~ServoLoop() {
  stop();
}

void ServoLoop::start() {
  if (thread_) return;
  thread_ = std::make_unique<PeriodicThread>(options_.rate, options_.realtime,
                                             [this](const Wake& wake) { cycle_.run(wake); });
}

void ServoLoop::stop() {
  if (!thread_ || thread_->stopped()) return;
  thread_->stop();
  device_.write(Vec3::Zero(), monotonic_now());
}

}  // namespace palpate
