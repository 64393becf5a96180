// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>

namespace palpate {

/// How often a duration occurred, in buckets that are 1/32 of their value wide (3 %), from 1 ns
/// to more than an hour. Fixed memory. One thread adds, any may look.
class Histogram {
 public:
  /// Wait-free, no allocation. [servo]
  void add(std::uint64_t nanoseconds) noexcept {
    bump(counts_[bucket(nanoseconds)], 1);
    bump(total_, 1);
    if (nanoseconds > max_.load(std::memory_order_relaxed))
      max_.store(nanoseconds, std::memory_order_relaxed);
  }

  [[nodiscard]] std::uint64_t count() const noexcept {
    return total_.load(std::memory_order_relaxed);
  }
  /// [ns] exact; 0 if empty.
  [[nodiscard]] std::uint64_t max() const noexcept { return max_.load(std::memory_order_relaxed); }

  /// The duration [ns] that a share `q` of all did not exceed, rounded up to its bucket's end and
  /// never above max(); 0 if empty.
  [[nodiscard]] std::uint64_t quantile(double q) const noexcept {
    std::uint64_t total = 0;
    for (const auto& c : counts_) total += c.load(std::memory_order_relaxed);
    const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(total)));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < buckets; ++i) {
      seen += counts_[i].load(std::memory_order_relaxed);
      if (seen >= wanted && seen > 0) return std::min(last_of(i), max());
    }
    return max();
  }

 private:
  static constexpr int sub_bits = 5;  // 32 buckets an octave
  static constexpr std::size_t octaves = 38;
  static constexpr std::size_t buckets = octaves << sub_bits;

  static void bump(std::atomic<std::uint64_t>& n, std::uint64_t by) noexcept {
    n.store(n.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
  }

  // Below 32 each value has a bucket; above, the five bits after the leading one number it.
  static std::size_t bucket(std::uint64_t v) noexcept {
    if (v < (1U << sub_bits)) return v;
    const int shift = static_cast<int>(std::bit_width(v)) - 1 - sub_bits;
    const std::size_t i =
        (static_cast<std::size_t>(shift + 1) << sub_bits) + ((v >> shift) & ((1U << sub_bits) - 1));
    return std::min(i, buckets - 1);
  }

  static std::uint64_t last_of(std::size_t i) noexcept {
    if (i < (1U << sub_bits)) return i;
    const std::size_t shift = (i >> sub_bits) - 1;
    const std::uint64_t first = ((1ULL << sub_bits) + (i & ((1U << sub_bits) - 1))) << shift;
    return first + (1ULL << shift) - 1;
  }

  std::array<std::atomic<std::uint64_t>, buckets> counts_{};
  std::atomic<std::uint64_t> total_{0};
  std::atomic<std::uint64_t> max_{0};
};

}  // namespace palpate
