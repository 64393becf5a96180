// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/config.hpp"

#include "tests/fuzz/expect.hpp"

// A session's TOML gives an Error of one line, or a valid configuration whose own TOML can be read.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate;
  SessionConfig config;
  if (test::succeeds([&] { config = parse_session_config(test::text_of(data, size), "fuzz"); })) {
    validate(config);
    static_cast<void>(parse_session_config(to_toml(config), "again"));
  }
  return 0;
}
