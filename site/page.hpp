// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace palpate::site {

/// Unpacks zstd by the page's JavaScript.
/// @return empty if the data are damaged or hold more than `max_bytes`
std::vector<std::byte> unpack_zstd(std::span<const std::byte> packed, std::size_t max_bytes);
/// The same for zlib.
std::vector<std::byte> unpack_zlib(std::span<const std::byte> packed, std::size_t max_bytes);
/// The same for gzip, whose end says how much it holds.
std::vector<std::byte> unpack_gzip(std::span<const std::byte> packed, std::size_t max_bytes);
std::vector<std::byte> pack_zlib(std::span<const std::byte> bytes);

}  // namespace palpate::site
