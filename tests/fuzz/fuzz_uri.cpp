// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "palpate/kernel/core/uri.hpp"

#include "tests/fuzz/expect.hpp"

// A name of a source or device gives an Error of one line, or parts whose numbers are in range.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate;
  test::succeeds([&] {
    const Uri uri(test::text_of(data, size));
    test::expect(!uri.scheme().empty() && uri.text().starts_with(uri.scheme()));
    for (const char* unit : {"", "m", "s", "Hz", "rad", "1", "px"}) {
      test::succeeds([&] {
        const double value = uri.number_option("a", 1.0, -1e3, 1e3, unit);
        test::expect(value >= -1e3 && value <= 1e3);
      });
    }
    constexpr std::string_view known[] = {"a", "noise"};
    test::succeeds([&] { uri.allow_only(known); });
  });
  return 0;
}
