// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

#include "palpate/io/sources/point_file.hpp"
#include "palpate/kernel/core/error.hpp"

#include "tests/support/point_file_rules.hpp"

namespace palpate::test {

/// Stops the fuzzer unless the bytes give an Error of one line, or a consistent cloud.
inline void fuzz_point_file(PointFile (*parse)(std::span<const std::byte>, std::string_view),
                            const std::uint8_t* data, std::size_t size) {
  try {
    if (!is_consistent(parse(std::as_bytes(std::span(data, size)), "fuzz"), size)) std::abort();
  } catch (const Error& error) {
    if (std::string_view(error.what()).find_first_of("\r\n") != std::string_view::npos) {
      std::abort();
    }
  }
}

}  // namespace palpate::test
