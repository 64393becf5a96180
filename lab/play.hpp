// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "lab/method.hpp"

namespace palpate::lab {

inline constexpr double f_c = 30.0;  ///< [Hz] the camera's frame rate in Table 2

/// [s] behind the true surface for longer than this in one go, a proxy is lost
inline constexpr double patience = 0.5;

/// Of `count` frames that are played forth and back, the one that is shown as number `k`.
inline std::size_t forth_and_back(std::uint64_t k, std::size_t count) {
  const std::size_t turn = std::max<std::size_t>(2 * count - 2, 1);
  const std::size_t at = k % turn;
  return at < count ? at : turn - at;
}

/// What a method is put through: a camera and a hand, over time.
struct Scenario {
  double frame_rate = f_c;    ///< [Hz] frame k is captured at k / frame_rate
  double tick_rate = 1000.0;  ///< [Hz]
  double duration = 1.0;      ///< [s]
  std::function<std::shared_ptr<const Cloud>(std::uint64_t frame, double t)> cloud;
  std::function<Vec3(double t)> hip;  ///< [m] world
  /// [s] how long after its capture a frame arrives; none: it never does. Without it: at once.
  std::function<std::optional<double>(std::uint64_t frame)> delay = nullptr;
};

/// Runs a scenario: each frame at the first tick at or after it arrives, in order.
/// @param on_frame  (const std::shared_ptr<const Cloud>&, double stamp, double t) when one arrives;
///                  it lives until the next
/// @param on_tick   (double t) -> bool, at each tick: continue?
template <class OnFrame, class OnTick>
void run(const Scenario& scenario, const OnFrame& on_frame, const OnTick& on_tick) {
  std::uint64_t frame = 0;
  std::shared_ptr<const Cloud> in_use;
  const auto ticks =
      static_cast<std::int64_t>(std::llround(scenario.duration * scenario.tick_rate));
  for (std::int64_t i = 0; i <= ticks; ++i) {
    const double t = static_cast<double>(i) / scenario.tick_rate;
    for (;; ++frame) {
      const double stamp = static_cast<double>(frame) / scenario.frame_rate;
      const std::optional<double> delay = scenario.delay ? scenario.delay(frame) : 0.0;
      if (stamp + delay.value_or(0.0) > t + 1e-9) break;
      if (!delay) continue;
      std::shared_ptr<const Cloud> cloud = scenario.cloud(frame, stamp);
      on_frame(cloud, stamp, t);
      in_use = std::move(cloud);  // only now may the frame before go
    }
    if (!on_tick(t)) return;
  }
}

/// Plays a scenario to a method.
/// @param on_tick  (const Tick&) -> bool, after each tick: continue?
template <class OnTick>
void play(Method& method, const Scenario& scenario, const OnTick& on_tick) {
  const auto* of_lab = dynamic_cast<const LabMethod*>(&method);
  run(
      scenario,
      [&](const std::shared_ptr<const Cloud>& cloud, double stamp, double /*t*/) {
        method.observe({*cloud, stamp});
      },
      [&](double t) {
        const Tick tick = method.tick(scenario.hip(t), t);
        if (of_lab != nullptr) of_lab->rethrow();
        return on_tick(tick);
      });
}

}  // namespace palpate::lab
