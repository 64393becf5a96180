// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <span>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sources/depth_png.hpp"

#include "tests/support/depth_pngs.hpp"

namespace {

// Stops the fuzzer unless the bytes give an Error, or a consistent image.
void read(const std::string& bytes) {
  try {
    const palpate::DepthPng image =
        palpate::parse_depth_png(std::as_bytes(std::span(bytes)), "fuzz");
    if (image.depth.size() != static_cast<std::size_t>(image.width) * image.height) std::abort();
  } catch (const palpate::Error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  read(bytes);
  // The same with the checksums that a fuzzer does not guess: a header and packed pixels.
  using palpate::test::chunk;
  constexpr std::size_t header = 13;
  if (size > header) {
    read("\x89PNG\r\n\x1a\n" + chunk("IHDR", bytes.substr(0, header)) +
         chunk("IDAT", bytes.substr(header)) + chunk("IEND", ""));
  }
  return 0;
}
