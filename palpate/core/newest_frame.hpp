// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>

#include "palpate/core/cloud.hpp"

namespace palpate {

/// The frame in use, and how its stamp follows the one before.
class NewestFrame {
 public:
  /// [s] Over less no velocity is derived: a millimetre of noise would be more than 1 m/s. No depth
  /// camera is faster than 1 kHz.
  static constexpr double shortest_interval = 1e-3;

  /// @param stamp    [s] when `cloud` was captured
  /// @param nominal  [s] the interval to assume before two stamps are known
  /// @param fixed    the interval is always the nominal one
  void take(const Cloud& cloud, double stamp, double nominal, bool fixed = false) noexcept {
    interval_ = fixed || count_ == 0 ? nominal : stamp - stamp_;
    in_order_ = std::isfinite(stamp) && interval_ >= shortest_interval;
    if (std::isfinite(stamp)) stamp_ = stamp;
    cloud_ = &cloud;
    ++count_;
  }

  [[nodiscard]] const Cloud* cloud() const noexcept { return cloud_; }  ///< null before the first
  [[nodiscard]] double stamp() const noexcept { return stamp_; }        ///< [s] t_j
  /// [s] t_j - t_(j-1); only where `in_order`.
  [[nodiscard]] double interval() const noexcept { return interval_; }
  /// Is the stamp finite and later than the one before by `shortest_interval` at least?
  [[nodiscard]] bool in_order() const noexcept { return in_order_; }
  [[nodiscard]] std::int64_t count() const noexcept { return count_; }       ///< frames so far
  [[nodiscard]] std::int64_t number() const noexcept { return count_ - 1; }  ///< of this, from 0

 private:
  const Cloud* cloud_ = nullptr;
  double stamp_ = 0.0;
  double interval_ = 0.0;
  bool in_order_ = true;
  std::int64_t count_ = 0;
};

}  // namespace palpate
