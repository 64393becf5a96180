// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/fuzz_point_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using palpate::parse_gltf;
  for (const auto parse : {+[](std::span<const std::byte> bytes, std::string_view name) {
                             return parse_gltf(bytes, name, "/nowhere", false);
                           },
                           +[](std::span<const std::byte> bytes, std::string_view name) {
                             return parse_gltf(bytes, name, "/nowhere", true);
                           }})
    palpate::test::fuzz_point_file(parse, data, size);
  return 0;
}
