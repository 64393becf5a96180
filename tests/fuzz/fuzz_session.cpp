// SPDX-License-Identifier: Apache-2.0
#include <cstring>
#include <string>
#include <vector>

#include "palpate/record/session.hpp"

#include "tests/fuzz/expect.hpp"

// The first byte chooses what the rest is: the JSON of settings or of a session, or a tick's
// numbers. What can be read must come out the same when it is written and read again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace palpate;
  if (size == 0) return 0;
  const std::string text(test::text_of(data + 1, size - 1));
  test::succeeds([&] {
    if (data[0] % 3 == 0) {
      const std::string once = to_json(commands_from_json(text, "fuzz"));
      test::expect(to_json(commands_from_json(once, "again")) == once);
    } else if (data[0] % 3 == 1) {
      const std::string once = to_json(session_from_json(text, "fuzz"));
      test::expect(to_json(session_from_json(once, "again")) == once);
    } else {
      std::vector<double> row(text.size() / sizeof(double));
      if (!row.empty()) std::memcpy(row.data(), text.data(), row.size() * sizeof(double));
      test::expect(row_of(TickRows().read(row, "fuzz")).size() == row.size());
    }
  });
  return 0;
}
