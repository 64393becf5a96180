// SPDX-License-Identifier: Apache-2.0
#include "palpate/servo/device.hpp"

#include <array>

namespace palpate {
namespace {

struct Row {
  std::string_view name, sentence;
};
// In DeviceFault's order.
constexpr std::array rows{
    Row{"none", ""},
    Row{"not_calibrated", "the device is not calibrated; calibrate it as described in its manual"},
    Row{"disconnected", "the device does not answer; check its cable, power and driver"},
    Row{"overheated", "the motors are too hot; let them cool down for some minutes"},
    Row{"emergency_stop",
        "the emergency stop or dead man's switch is open; close it when it is safe to do so"},
    Row{"busy", "another program uses the device; close that program"},
    Row{"refused_command", "the device did not accept the force; switch it off and on again"},
    Row{"other", "the device reports a fault; see its manual, or switch it off and on again"},
    Row{"another_hand", "another hand of this session has a fault or does not answer; see there"},
};

const Row& row_of(DeviceFault fault) {
  const auto i = static_cast<std::size_t>(fault);
  return rows[i < rows.size() ? i : static_cast<std::size_t>(DeviceFault::other)];
}

}  // namespace

std::string_view to_string(DeviceFault fault) { return row_of(fault).name; }

std::string_view describe(DeviceFault fault) { return row_of(fault).sentence; }

}  // namespace palpate
