// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "palpate/kernel/core/observed_clouds.hpp"

namespace palpate {

/// What each camera saw last, and how the newest stamp follows the ones before.
class NewestFrame {
 public:
  /// [s] Over less no velocity is derived: a millimetre of noise would be more than 1 m/s. No depth
  /// camera is faster than 1 kHz.
  static constexpr double shortest_interval = 1e-3;

  /// @param seen     a camera's number beyond Patch::max_views is ignored
  /// @param nominal  [s] the interval to assume before two stamps are known
  /// @param fixed    the interval is always the nominal one
  void take(const Observation& seen, double nominal, bool fixed = false) noexcept {
    if (seen.camera >= cameras_.size()) return;
    clouds_.take(seen.camera, seen.cloud);
    Camera& own = cameras_[seen.camera];
    const bool finite = std::isfinite(seen.stamp);
    camera_interval_ = fixed || !own.seen ? nominal : seen.stamp - own.stamp;
    in_order_ = finite && camera_interval_ >= shortest_interval;
    interval_ = fixed || count_ == 0 ? nominal : seen.stamp - stamp_;
    advances_ = finite && interval_ >= shortest_interval;
    own.seen = true;
    if (finite) own.stamp = seen.stamp;
    camera_stamp_ = own.stamp;
    if (finite && (advances_ || clouds_.parts().size() == 1)) stamp_ = seen.stamp;
    ++count_;
  }

  /// What each camera saw last, as one; null before the first frame.
  [[nodiscard]] const ObservedClouds* cloud() const noexcept {
    return count_ > 0 ? &clouds_ : nullptr;
  }
  [[nodiscard]] double stamp() const noexcept { return stamp_; }  ///< [s] t_j, of any camera
  /// [s] t_j - t_(j-1), of any two cameras; only where `advances`.
  [[nodiscard]] double interval() const noexcept { return interval_; }
  /// [s] of the newest frame's own camera.
  [[nodiscard]] double camera_stamp() const noexcept { return camera_stamp_; }
  /// [s] since the frame before of the same camera; only where `in_order`.
  [[nodiscard]] double camera_interval() const noexcept { return camera_interval_; }
  /// Is the newest frame's stamp finite and later than that of its camera's frame before, by
  /// `shortest_interval` at least?
  [[nodiscard]] bool in_order() const noexcept { return in_order_; }
  /// The same beside all cameras' stamps. Two cameras may capture at one time.
  [[nodiscard]] bool advances() const noexcept { return advances_; }
  [[nodiscard]] std::int64_t count() const noexcept { return count_; }       ///< frames so far
  [[nodiscard]] std::int64_t number() const noexcept { return count_ - 1; }  ///< of this, from 0

 private:
  struct Camera {
    bool seen = false;
    double stamp = 0.0;  // [s]
  };

  ObservedClouds clouds_;
  std::array<Camera, Patch::max_views> cameras_{};
  double stamp_ = 0.0;
  double interval_ = 0.0;
  double camera_stamp_ = 0.0;
  double camera_interval_ = 0.0;
  bool in_order_ = true;
  bool advances_ = true;
  std::int64_t count_ = 0;
};

}  // namespace palpate
