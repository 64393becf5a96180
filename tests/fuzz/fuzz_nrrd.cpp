// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/fuzz_point_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  palpate::test::fuzz_point_file(
      [](std::span<const std::byte> bytes, std::string_view name) {
        return palpate::parse_nrrd(bytes, name, "/nowhere");
      },
      data, size);
  return 0;
}
