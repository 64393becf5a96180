// SPDX-License-Identifier: Apache-2.0
// Prints the golden hashes (golden_hashes.txt) without a test's libraries: for processors and
// systems that are not this machine's.
#include <cinttypes>
#include <cstdio>

#include "tests/record/pressed_floor.hpp"

int main() {
  using namespace palpate;
  for (const MethodInfo& method : standard_methods().entries()) {
    test::PressedFloor session(method.name);
    auto ticks = session.ticks();
    session.run(test::golden_ticks);
    std::uint64_t hash = empty_hash;
    for (ServoTick tick{}; ticks.try_pop(tick);) add_to_hash(hash, tick);
    std::printf("%s %016" PRIx64 "\n", method.name.c_str(), hash);
  }
}
