// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "palpate/io/sources/intrinsics_file.hpp"
#include "palpate/kernel/core/error.hpp"

// Stops unless the text gives an Error of one line, or a camera that makes sense.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const palpate::RecordedCamera camera =
        palpate::parse_intrinsics({reinterpret_cast<const char*>(data), size}, "fuzz");
    palpate::validate(camera.intrinsics);
    if (!(camera.units_per_metre > 0.0)) std::abort();
  } catch (const palpate::Error& error) {
    const std::string_view message = error.what();
    if (!message.starts_with("fuzz") || message.find_first_of("\r\n") != message.npos) std::abort();
  }
  return 0;
}
