// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdlib>
#include <new>

/// Replaces the program's operator new and delete by ones that count: include it in one file of a
/// test program. Sanitizers bring their own, so there nothing is counted.
namespace palpate::test {

#ifdef PALPATE_SANITIZED
constexpr bool memory_is_counted = false;
#else
constexpr bool memory_is_counted = true;
#endif

/// How often this thread has allocated or released memory by new and delete.
inline thread_local std::uint64_t memory_calls = 0;

/// Counts while it lives.
class MemoryCalls {
 public:
  [[nodiscard]] std::uint64_t count() const { return memory_calls - before_; }

 private:
  std::uint64_t before_ = memory_calls;
};

inline void* counted_allocation(std::size_t size, std::size_t alignment) {
  ++memory_calls;
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(size)
          : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

inline void counted_release(void* memory) noexcept {
  ++memory_calls;
  std::free(memory);
}

}  // namespace palpate::test

#ifndef PALPATE_SANITIZED
// The array and nothrow forms end in these.
void* operator new(std::size_t size) {
  return palpate::test::counted_allocation(size, alignof(std::max_align_t));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  return palpate::test::counted_allocation(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { palpate::test::counted_release(memory); }
void operator delete(void* memory, std::size_t) noexcept { palpate::test::counted_release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept {
  palpate::test::counted_release(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  palpate::test::counted_release(memory);
}
#endif
