// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/stiffness.hpp"

#include <cmath>

namespace palpate {

std::vector<std::string> stiffness_warnings(const DeviceInfo& device, double stiffness,
                                            double scale, double rate) {
  std::vector<std::string> warnings;
  if (!device.limits.motors || device.simulated) return warnings;
  const double felt = stiffness * scale;
  const auto whole = [](double number) { return std::to_string(std::lround(number)); };
  const auto warn = [&](double most, const std::string& why) {
    if (felt <= most) return;
    warnings.push_back("walls of " + whole(felt) + " N/m are more than " + whole(std::floor(most)) +
                       " N/m, " + why + "; set stiffness to " + whole(std::floor(most / scale)) +
                       " N/m or less");
  };
  if (device.limits.max_stiffness)
    warn(*device.limits.max_stiffness, "the rated stiffness of the device");
  if (device.damping)
    warn(largest_stiffness(*device.damping, 1.0 / rate, device.delay.value_or(0.0)),
         "above which a released handle may oscillate (2b/(T + 2 t_d))");
  return warnings;
}

}  // namespace palpate
