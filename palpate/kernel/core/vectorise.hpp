// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

// PALPATE_VECTORISED on a function with a vector loop: compiled once per instruction set, the best
// one picked when the program starts. Sanitizers can't run inside that choice, so their builds have
// the portable code only, as do other processors and systems. All sets give the same bits, as sums
// go through core/lanes.hpp; CMake's PALPATE_VECTOR_SET leaves some out, to measure the time of the
// others.
#if !defined(__x86_64__) || !defined(__linux__) || defined(PALPATE_SANITIZED) || \
    defined(PALPATE_VECTOR_SET_DEFAULT)
#define PALPATE_VECTORISED
#elif defined(PALPATE_VECTOR_SET_AVX2)
#define PALPATE_VECTORISED __attribute__((target_clones("default", "avx2")))
#else
#define PALPATE_VECTORISED __attribute__((target_clones("default", "avx2", "avx512f")))
#endif

// PALPATE_INLINED on a loop that is to be part of whatever clone calls it.
#define PALPATE_INLINED __attribute__((always_inline)) inline

namespace palpate {

/// The instruction set whose loops run here, by the compiler's name: avx512f, avx2 or default.
inline std::string_view vector_set_in_use() noexcept {
#if !defined(__x86_64__) || !defined(__linux__) || defined(PALPATE_SANITIZED) || \
    defined(PALPATE_VECTOR_SET_DEFAULT)
  return "default";
#else
#if !defined(PALPATE_VECTOR_SET_AVX2)
  if (__builtin_cpu_supports("avx512f") != 0) return "avx512f";
#endif
  return __builtin_cpu_supports("avx2") != 0 ? "avx2" : "default";
#endif
}

}  // namespace palpate
