// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdlib>
#include <span>
#include <string>
#include <string_view>

#include "palpate/io/sources/depth_png.hpp"
#include "palpate/io/sources/depth_rvl.hpp"
#include "palpate/kernel/core/error.hpp"

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

// Slices of an image, one behind the other: the first byte of each is its length.
void read_slices(std::string_view bytes) {
  palpate::SliceAssembler assembler;
  for (double now = 0.0; !bytes.empty(); now += 0.001) {
    const std::size_t size =
        std::min(static_cast<std::size_t>(static_cast<unsigned char>(bytes[0])), bytes.size() - 1);
    try {
      assembler.add(std::as_bytes(std::span(bytes.substr(1, size))), 0.0, now, "fuzz");
      const auto image = assembler.take(now, 0.01);
      if (image && image->depth.size() != static_cast<std::size_t>(image->width) *
                                              static_cast<std::size_t>(image->height))
        std::abort();
    } catch (const palpate::Error&) {
    }
    bytes.remove_prefix(1 + size);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  read(bytes);
  // The same bytes as RVL: of the size that they say, and of 16 x 16 pixels
  read(bytes, palpate::parse_depth_rvl);
  read(std::string("\x10\0\0\0\x10\0\0\0", 8) + bytes, palpate::parse_depth_rvl);
  read_slices(bytes);
  // The same with the checksums that a fuzzer does not guess: a header and packed pixels.
  using palpate::test::chunk;
  constexpr std::size_t header = 13;
  if (size > header) {
    read("\x89PNG\r\n\x1a\n" + chunk("IHDR", bytes.substr(0, header)) +
         chunk("IDAT", bytes.substr(header)) + chunk("IEND", ""));
  }
  return 0;
}
