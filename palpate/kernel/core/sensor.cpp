// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/sensor.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace palpate {

std::string_view name_of(SensorKind sensor) noexcept {
  switch (sensor) {
    case SensorKind::stereo:
      return "stereo";
    case SensorKind::structured_light:
      return "structured light";
    case SensorKind::time_of_flight:
      return "time of flight";
    case SensorKind::unknown:
      break;
  }
  return "unknown";
}

std::optional<SensorKind> sensor_named(std::string_view name) noexcept {
  constexpr std::array kinds{SensorKind::unknown, SensorKind::stereo, SensorKind::structured_light,
                             SensorKind::time_of_flight};
  const auto* const kind = std::find_if(kinds.begin(), kinds.end(), [&](SensorKind candidate) {
    const std::string_view known = name_of(candidate);
    return std::equal(name.begin(), name.end(), known.begin(), known.end(),
                      [](char a, char b) { return a == b || (a == '-' && b == ' '); });
  });
  if (kind == kinds.end()) return std::nullopt;
  return *kind;
}

UsualNoise usual_noise(SensorKind sensor) noexcept {
  switch (sensor) {
    case SensorKind::structured_light:
      return {1.5e-3, 2};
    case SensorKind::time_of_flight:
      return {5e-3, 1};
    case SensorKind::stereo:
    case SensorKind::unknown:
      break;
  }
  return {SightParameters::unknown_noise, SightParameters::unknown_growth};
}

std::string noise_text(SensorKind sensor) {
  const auto [at_1m, growth] = usual_noise(sensor);
  return number_text(1e3 * at_1m) + " mm at 1 m, growing with " +
         (growth == 1 ? "distance" : "the square of distance");
}

Parameters for_sensors(Parameters parameters, std::span<const SensorKind> sensors) {
  UsualNoise noisiest = usual_noise(sensors.empty() ? SensorKind::unknown : sensors.front());
  for (const SensorKind sensor : sensors) {
    const UsualNoise one = usual_noise(sensor);
    if (std::pair(one.at_1m, one.growth) > std::pair(noisiest.at_1m, noisiest.growth))
      noisiest = one;
  }
  SightParameters& sight = parameters.sight;
  if (sight.usual_noise == 0.0) sight.usual_noise = noisiest.at_1m;
  if (sight.noise_growth == 0) sight.noise_growth = noisiest.growth;
  return parameters;
}

}  // namespace palpate
