// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace palpate::test {

/// Whether a sanitizer watches this build. All then takes some ten times as long, so tests that
/// repeat themselves with other numbers repeat themselves less often: a sanitizer judges which code
/// runs, not how often.
#ifdef PALPATE_SANITIZED
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif

}  // namespace palpate::test
