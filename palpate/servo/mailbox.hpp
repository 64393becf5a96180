// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <utility>

namespace palpate {

/// Hands the newest value from one thread to one other; older unread ones are dropped.
///
/// Neither side waits: slots change hands by one atomic exchange. Values are only ever assigned
/// and destroyed on the writer's side, so a shared_ptr that goes through here is never released
/// by the reader: no deallocation in a tick. The reader may use what it took last, and what it
/// took before that, until it takes the next.
template <class T>
class Mailbox {
 public:
  /// Puts a value, and destroys one that is no longer in use. One thread at a time; wait-free
  /// apart from T's own assignment.
  /// @return its number, from 1
  std::uint64_t put(T value) {
    slots_[back_].value = std::move(value);
    slots_[back_].number = ++put_;
    back_ = middle_.exchange(back_ | unread, std::memory_order_acq_rel) & index_bits;
    return put_;
  }

  /// The newest value if it was not taken yet, else null. One thread; wait-free. [servo]
  const T* take() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & unread) == 0) return nullptr;
    const unsigned taken = middle_.exchange(before_, std::memory_order_acq_rel) & index_bits;
    before_ = front_;
    front_ = taken;
    ++taken_;
    return &slots_[front_].value;
  }

  /// The value taken last (a default one before the first). Reader's thread.
  [[nodiscard]] const T& taken_last() const noexcept { return slots_[front_].value; }
  /// How many were put before the one taken last and never taken. Reader's thread.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return slots_[front_].number - taken_; }

 private:
  static constexpr unsigned unread = 4;  // a bit of middle_, beside the slot's index
  static constexpr unsigned index_bits = 3;
  struct Slot {
    T value{};
    std::uint64_t number = 0;
  };

  // Four slots: the writer's, the one in between, and the reader's two.
  std::array<Slot, 4> slots_{};
  alignas(64) std::atomic<unsigned> middle_{1};
  alignas(64) unsigned back_ = 0;  // writer
  std::uint64_t put_ = 0;
  alignas(64) unsigned front_ = 2;  // reader
  unsigned before_ = 3;
  std::uint64_t taken_ = 0;
};

}  // namespace palpate
