// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/kernel/core/registry.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// A kind of device, chosen by the scheme of its URI.
struct DeviceScheme {
  std::string name;     ///< before the colon, e.g. "script"
  std::string summary;  ///< what it is, in a line
  /// Opens a device of this kind, or throws Error.
  /// @param path  what a simulated hand follows if the URI names no file
  std::function<std::unique_ptr<Device>(const Uri& uri, const std::optional<HipPath>& path)> open;
};

/// The library's own kinds: `script:`, `hand:` and `mouse:`; docs/devices.md lists their options.
/// A program adds kinds of its own to a copy.
Registry<DeviceScheme> standard_devices();

/// Opens a device by its URI, such as `script:FILE.csv`.
///
/// @param path      what `script:` and `hand:` follow if they name no file
/// @param registry  the kinds to choose from
/// @throws Error for an unknown scheme or option (naming the nearest), a value out of range, a file
///         that cannot be used, or a path that is missing.
std::unique_ptr<Device> open_device(std::string_view uri,
                                    const std::optional<HipPath>& path = std::nullopt,
                                    const Registry<DeviceScheme>& registry = standard_devices());

}  // namespace palpate
