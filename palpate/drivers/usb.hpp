// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate {

/// What is plugged in by USB: vendor and product of each, such as "8086:0b07", as the system below
/// `root` shows them. Never throws for what is missing.
std::vector<std::string> usb_ids(const std::filesystem::path& root = "/");

/// Does an id, such as "1451:0301", begin with one of `known`: "1451" or "0403:cb48"?
bool is_usb_of(const std::string& id, std::span<const std::string> known);

/// What to do where the system shows a device by USB that its library does not open: the rule for
/// udev that lets every user open each vendor's, and what else it may be.
std::string usb_permission_remedy(const std::string& id);

/// The problem of a driver whose device is plugged in but is not opened, with its remedy; empty if
/// none is plugged in.
/// @param scheme  of the driver's URIs  @param known  as for is_usb_of
/// @param why     what its library says; empty: nothing
std::string unopened_by_usb(std::string_view scheme, std::span<const std::string> known,
                            const std::string& why = {});

}  // namespace palpate
