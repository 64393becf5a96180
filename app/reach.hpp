// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace palpate::app {

/// The addresses at which other machines reach a server that listens on `listen`, as they stand in
/// a URL. Of 0.0.0.0 and :: these are the machine's own, that of the default route first; loopback,
/// link-local addresses and interfaces that are down are left out. Empty: there is none.
std::vector<std::string> reachable_addresses(std::string_view listen);

/// A QR code of `text` for a terminal: two modules a character, a quiet zone of four modules, light
/// and dark stated by SGR sequences, lines that end in a line feed. Empty if the text is too long.
std::string qr_code(const std::string& text);

}  // namespace palpate::app
