// SPDX-License-Identifier: Apache-2.0
#include "palpate/drivers/stiffness.hpp"

#include <cmath>

namespace palpate {

std::vector<std::string> stiffness_warnings(const DeviceInfo& device, double stiffness,
                                            double rate) {
  std::vector<std::string> warnings;
  if (!device.limits.motors || device.simulated) return warnings;
  const auto warn = [&](double most, const std::string& why) {
    if (stiffness <= most) return;
    const std::string bound = std::to_string(std::lround(std::floor(most)));
    warnings.push_back("walls of " + std::to_string(std::lround(stiffness)) +
                       " N/m are more than " + bound + " N/m, " + why +
                       "; --set stiffness=" + bound + " or less");
  };
  if (device.limits.max_stiffness)
    warn(*device.limits.max_stiffness, "what the device is good for");
  if (device.damping)
    warn(2.0 * *device.damping / (1.0 / rate + 2.0 * device.delay.value_or(0.0)),
         "above which a handle that nobody holds may swing (2b/(T + 2 t_d))");
  return warnings;
}

}  // namespace palpate
