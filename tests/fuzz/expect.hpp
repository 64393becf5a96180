// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "palpate/kernel/core/error.hpp"

namespace palpate::test {

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// Runs `action`; stops the fuzzer if it throws anything but an Error of one line.
/// @return true if it threw none
template <class Action>
bool succeeds(const Action& action) {
  try {
    action();
    return true;
  } catch (const Error& error) {
    if (std::string_view(error.what()).find_first_of("\r\n") != std::string_view::npos)
      std::abort();
    return false;
  }
}

/// Stops the fuzzer unless `holds`.
inline void expect(bool holds) {
  if (!holds) std::abort();
}

}  // namespace palpate::test
