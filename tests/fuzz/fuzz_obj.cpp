// SPDX-License-Identifier: Apache-2.0
#include "tests/fuzz/fuzz_point_file.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  palpate::test::fuzz_point_file(palpate::parse_obj, data, size);
  return 0;
}
