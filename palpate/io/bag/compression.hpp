// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace palpate {

/// Do the bytes begin as data compressed with zstd? No message in CDR does.
[[nodiscard]] bool is_zstd(std::span<const std::byte> bytes) noexcept;

/// Decompresses data of zstd, one frame or several.
///
/// What the data declare is not trusted: memory grows with what is really there, and never beyond
/// `max_bytes`.
/// @param name  of the message or file, for errors
/// @throws Error if the data are damaged, end too early or hold more than `max_bytes`.
[[nodiscard]] std::vector<std::byte> decompress_zstd(std::span<const std::byte> packed,
                                                     std::size_t max_bytes,
                                                     const std::string& name);

/// The same for frames of LZ4.
[[nodiscard]] std::vector<std::byte> decompress_lz4(std::span<const std::byte> packed,
                                                    std::size_t max_bytes, const std::string& name);

/// The same for bzip2, of which there is one stream.
[[nodiscard]] std::vector<std::byte> decompress_bz2(std::span<const std::byte> packed,
                                                    std::size_t max_bytes, const std::string& name);

/// The same for gzip, one member or several.
[[nodiscard]] std::vector<std::byte> decompress_gzip(std::span<const std::byte> packed,
                                                     std::size_t max_bytes,
                                                     const std::string& name);

}  // namespace palpate
