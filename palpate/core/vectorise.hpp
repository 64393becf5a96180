// SPDX-License-Identifier: Apache-2.0
#pragma once

// PALPATE_VECTORISED on a function with a `#pragma omp simd` loop: compiled once per instruction
// set, the best one picked when the program starts. Sanitizers can't run inside that choice, so
// their builds have the portable code only, as do other processors and systems.
#if defined(__x86_64__) && defined(__linux__) && !defined(PALPATE_SANITIZED)
#define PALPATE_VECTORISED __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define PALPATE_VECTORISED
#endif

// PALPATE_INLINED on a loop that is to be part of whatever clone calls it.
#define PALPATE_INLINED __attribute__((always_inline)) inline
