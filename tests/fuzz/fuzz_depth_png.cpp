// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <span>
#include <string>

#include "palpate/core/error.hpp"
#include "palpate/sources/depth_png.hpp"
#include "palpate/sources/depth_rvl.hpp"

#include "tests/support/depth_pngs.hpp"

namespace {

using Parser = palpate::DepthPng (*)(std::span<const std::byte>, const std::string&);

// Stops the fuzzer unless the bytes give an Error, or a consistent image.
void read(const std::string& bytes, Parser parse = palpate::parse_depth_png) {
  try {
    const palpate::DepthPng image = parse(std::as_bytes(std::span(bytes)), "fuzz");
    if (image.depth.size() != static_cast<std::size_t>(image.width) * image.height) std::abort();
  } catch (const palpate::Error&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  read(bytes);
  // The same bytes as RVL: of the size that they say, and of 16 x 16 pixels
  read(bytes, palpate::parse_depth_rvl);
  read(std::string("\x10\0\0\0\x10\0\0\0", 8) + bytes, palpate::parse_depth_rvl);
  // The same with the checksums that a fuzzer does not guess: a header and packed pixels.
  using palpate::test::chunk;
  constexpr std::size_t header = 13;
  if (size > header) {
    read("\x89PNG\r\n\x1a\n" + chunk("IHDR", bytes.substr(0, header)) +
         chunk("IDAT", bytes.substr(header)) + chunk("IEND", ""));
  }
  return 0;
}
