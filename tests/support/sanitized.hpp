// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

namespace palpate::test {

/// Whether a sanitizer watches this build. All then takes some ten times as long, so tests that
/// repeat themselves with other numbers repeat themselves less often: a sanitizer judges which code
/// runs, not how often.
#ifdef PALPATE_SANITIZED
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

/// How often a test repeats itself: `times`, or a sixth of it where a sanitizer or valgrind
/// watches.
inline int rounds(int times) {
  return sanitized || std::getenv("PALPATE_MEMCHECK") != nullptr ? (times + 5) / 6 : times;
}

}  // namespace palpate::test
