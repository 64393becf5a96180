// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "palpate/devices/hip_path.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// Opens `script:FILE.csv`, `hand:FILE.csv?...` or `mouse:?...`; docs/devices.md lists the options.
///
/// @param path  what `script:` and `hand:` follow if they name no file
/// @throws Error for an unknown scheme or option (naming the nearest), a value out of range, a file
///         that cannot be used, or a path that is missing.
std::unique_ptr<Device> open_device(std::string_view uri,
                                    const std::optional<HipPath>& path = std::nullopt);

}  // namespace palpate
