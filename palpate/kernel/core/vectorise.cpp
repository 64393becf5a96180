// SPDX-License-Identifier: Apache-2.0
#include "palpate/kernel/core/vectorise.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate {

std::span<const std::string_view> vector_sets() noexcept {
#if defined(__x86_64__)
  static constexpr std::array<std::string_view, 3> names{"sse2", "avx2", "avx512"};
  std::size_t count = 1;
#if defined(PALPATE_AVX2)
  if (__builtin_cpu_supports("avx2") != 0) count = 2;
#endif
#if defined(PALPATE_AVX512)
  if (__builtin_cpu_supports("avx512f") != 0) count = 3;
#endif
  return std::span(names).first(count);
#else
  static constexpr std::array<std::string_view, 1> names{"portable"};
  return names;
#endif
}

namespace detail {
int vector_set = static_cast<int>(vector_sets().size()) - 1;
}  // namespace detail

std::string_view vector_set_in_use() noexcept {
  return vector_sets()[static_cast<std::size_t>(detail::vector_set)];
}

void use_vector_set(std::string_view name) {
  const auto sets = vector_sets();
  const auto found = std::find(sets.begin(), sets.end(), name);
  std::string list;
  for (const std::string_view set : sets) add_to_list(list, set);
  if (found == sets.end())
    throw Error("vector set '" + std::string(name) + "'",
                "this processor and this build have no such loops", "there are: " + list);
  detail::vector_set = static_cast<int>(found - sets.begin());
}

}  // namespace palpate
