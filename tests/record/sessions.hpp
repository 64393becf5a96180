// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/replay.hpp"
#include "palpate/record/session_reader.hpp"
#include "palpate/record/session_writer.hpp"

#include "tests/record/pressed_floor.hpp"

namespace palpate::test {

/// Runs a hand through the floor and records it. @return the ticks as they were
inline std::vector<ServoTick> record_press(SessionWriter& writer, const Parameters& parameters,
                                           int ticks, bool close = true,
                                           const std::string& method = "sight",
                                           const std::shared_ptr<const ToolShape>& tool = {},
                                           bool has_noise = false) {
  const auto place = [](int i) { return Vec3(0.03 + 1e-5 * i, -0.05, -0.01 - 4e-4 * i); };
  FakeDevice device;
  Cycle cycle(make_method(method, parameters, standard_methods(), tool), device,
              {method, parameters, {}, {}, {}, tool});
  CycleReader reader = cycle.full_reader();
  writer.commands(cycle.commands(), 0.0);
  std::vector<ServoTick> recorded;
  for (int i = 0; i < ticks; ++i) {
    const double t = i * 1e-3;
    if (i % 33 == 0) {
      const auto cloud = std::make_shared<DepthImage>(*wavy_floor(i / 33));
      if (has_noise) cloud->set_noise(wavy_noise(i / 66));
      const double stamp = t - 1e-4 / 3.0;
      writer.frame(cycle.put_frame(cloud, stamp, t), stamp, 0, cloud);
    }
    device.hand.position = place(i);
    device.hand.orientation = Eigen::Quaterniond(1.0, 0.1 / 3.0, 1e-3 * i, -0.2).normalized();
    cycle.run({.t = t});
    for (AdoptedFrame frame; reader.frames.try_pop(frame);) writer.adopted(frame);
    reader.ticks.try_pop(recorded.emplace_back());
    writer.tick(recorded.back());
  }
  if (close) writer.close();
  return recorded;
}

inline SessionInfo press_info() {
  return {.version = "test",
          .cameras = {"synthetic:floor"},
          .device = "script:",
          .epoch = 1'700'000'000'000'000'000};
}

}  // namespace palpate::test
