// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace palpate {

/// The last records of one writer, for any number of readers that each see all of them.
///
/// The writer never waits and does not know its readers; one that falls behind by more than the
/// capacity loses the oldest records and is told how many. Records are copied as bytes, a word at
/// a time, each word atomic: a record that is overwritten while it is read is noticed and dropped,
/// without a data race.
template <class Record>
class TickRing {
  // Not is_trivially_copyable, which Eigen's vectors of fixed size are not by the letter.
  static_assert(std::is_standard_layout_v<Record> && std::is_trivially_destructible_v<Record>);
  static_assert(sizeof(Record) % sizeof(std::uint64_t) == 0);
  static constexpr std::size_t words = sizeof(Record) / sizeof(std::uint64_t);
  using Slot = std::array<std::atomic<std::uint64_t>, words>;

 public:
  /// @param capacity  how far a reader can fall behind [records]; rounded up to a power of two
  explicit TickRing(std::size_t capacity)
      : slots_(std::bit_ceil(std::max<std::size_t>(capacity, 2))) {}

  /// One thread; wait-free, no allocation. [servo]
  void push(const Record& record) noexcept {
    std::array<std::uint64_t, words> copy;
    std::memcpy(copy.data(), static_cast<const void*>(&record), sizeof(Record));
    const std::uint64_t n = done_.load(std::memory_order_relaxed);
    begun_.store(n + 1, std::memory_order_relaxed);
    Slot& slot = slots_[n & (slots_.size() - 1)];
    // Release, so that a reader that sees one of these words also sees begun_.
    for (std::size_t i = 0; i < words; ++i) slot[i].store(copy[i], std::memory_order_release);
    done_.store(n + 1, std::memory_order_release);
  }

  /// Reads the records in order, each once. Of one thread; must not outlive the ring.
  class Reader {
   public:
    /// The next record, or false if there is none yet. Never waits.
    bool try_pop(Record& record) noexcept {
      const std::uint64_t size = ring_->slots_.size();
      for (;;) {
        const std::uint64_t done = ring_->done_.load(std::memory_order_acquire);
        if (next_ == done) return false;
        if (done - next_ > size) skip_to(done - size);
        std::array<std::uint64_t, words> copy;
        const Slot& slot = ring_->slots_[next_ & (size - 1)];
        for (std::size_t i = 0; i < words; ++i) copy[i] = slot[i].load(std::memory_order_acquire);
        const std::uint64_t begun = ring_->begun_.load(std::memory_order_relaxed);
        if (begun - next_ > size) {  // overwritten meanwhile
          skip_to(begun - size);
          continue;
        }
        std::memcpy(static_cast<void*>(&record), copy.data(), sizeof(Record));
        ++next_;
        return true;
      }
    }

    /// How many records were overwritten before this reader came to them.
    [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }

   private:
    friend class TickRing;
    explicit Reader(const TickRing& ring)
        : ring_(&ring), next_(ring.done_.load(std::memory_order_acquire)) {}

    void skip_to(std::uint64_t next) noexcept {
      lost_ += next - next_;
      next_ = next;
    }

    const TickRing* ring_;
    std::uint64_t next_;
    std::uint64_t lost_ = 0;
  };

  /// A reader that begins with the next record pushed. Any thread.
  [[nodiscard]] Reader reader() const { return Reader(*this); }

 private:
  std::vector<Slot> slots_;
  alignas(64) std::atomic<std::uint64_t> begun_{0};  // records whose writing has begun
  std::atomic<std::uint64_t> done_{0};               // records that can be read
};

}  // namespace palpate
