// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "palpate/servo/safety.hpp"

namespace palpate::test {

/// For sessions in real time on a machine that is busy with other tests: it wakes the servo and the
/// cameras late several times a second, and the force would fade or rise from nothing each time.
inline SafetyParameters patient() {
  SafetyParameters safety;
  safety.fade_age = 5.0;
  safety.lost_age = 10.0;
  safety.late_intervals = 100.0;
  safety.stall_time = 0.1;
  return safety;
}

}  // namespace palpate::test
