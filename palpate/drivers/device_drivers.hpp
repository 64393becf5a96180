// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "palpate/drivers/drivers.hpp"

namespace palpate {

/// The library's drivers of haptic devices, a part of standard_drivers().
std::vector<Driver> device_drivers();

}  // namespace palpate
