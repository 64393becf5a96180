// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string_view>

// Loops that are compiled once per instruction set. A loop is a function marked PALPATE_VECTORISED,
// and vectorised<loop>(arguments) calls it for the set in use. All sets give the same bits, as sums
// go through core/lanes.hpp. CMake's PALPATE_VECTOR_SET leaves sets out; other processors have one.

// PALPATE_INLINED on a loop that is to be part of whatever calls it.
#define PALPATE_INLINED __attribute__((always_inline)) inline
#define PALPATE_VECTORISED PALPATE_INLINED

#if defined(__x86_64__) && !defined(PALPATE_VECTOR_SET_SSE2)
#define PALPATE_AVX2 1
#if !defined(PALPATE_VECTOR_SET_AVX2)
#define PALPATE_AVX512 1
#endif
#endif

namespace palpate {

/// The instruction sets that this processor and this build have, the widest last: sse2, avx2,
/// avx512; elsewhere than on x86-64: portable.
std::span<const std::string_view> vector_sets() noexcept;

/// The set in use: the widest, until `use_vector_set`.
std::string_view vector_set_in_use() noexcept;

/// Chooses the set of all loops. Before the first tick, or between ticks.
/// @throws Error, which names the sets there are, if there is no such set
void use_vector_set(std::string_view name);

namespace detail {

/// Index of the set in use in `vector_sets()`.
extern int vector_set;

template <auto loop>
struct Vectorised;

template <class Result, class... Arguments, Result (*loop)(Arguments...)>
struct Vectorised<loop> {
  PALPATE_INLINED Result operator()(Arguments... arguments) const {
#if defined(PALPATE_AVX512)
    if (vector_set == 2) return on_avx512(arguments...);
#endif
#if defined(PALPATE_AVX2)
    if (vector_set == 1) return on_avx2(arguments...);
#endif
    return on_any(arguments...);
  }

 private:
  __attribute__((noinline)) static Result on_any(Arguments... arguments) {
    return loop(arguments...);
  }
#if defined(PALPATE_AVX2)
  __attribute__((noinline, target("avx2"))) static Result on_avx2(Arguments... arguments) {
    return loop(arguments...);
  }
#endif
#if defined(PALPATE_AVX512)
  __attribute__((noinline, target("avx512f"))) static Result on_avx512(Arguments... arguments) {
    return loop(arguments...);
  }
#endif
};

}  // namespace detail

/// vectorised<loop>(arguments...): the loop as it is compiled for the set in use.
template <auto loop>
inline constexpr detail::Vectorised<loop> vectorised{};

}  // namespace palpate
