// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "palpate/io/sources/trajectory.hpp"
#include "palpate/kernel/core/error.hpp"

namespace {

// Stops unless `parse` gives an Error of one line, or what it returns.
template <class Parse>
void check(const Parse& parse, std::string_view text) {
  try {
    static_cast<void>(parse(text, "fuzz"));
  } catch (const palpate::Error& error) {
    const std::string_view message = error.what();
    if (!message.starts_with("fuzz") || message.find_first_of("\r\n") != message.npos) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  check(palpate::parse_trajectory, text);
  check(palpate::parse_pose_matrices, text);
  check(palpate::parse_image_list, text);
  return 0;
}
