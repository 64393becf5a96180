// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>

namespace palpate {

/// The newest frame of one camera of a session.
struct CameraFrame {
  std::size_t camera = 0;  ///< number of the camera, 0 to Freshness::max_cameras - 1
  /// [s] when it was captured, on the loop's clock; NaN before the camera's first frame
  double stamp = std::numeric_limits<double>::quiet_NaN();
};

/// Age of the frames in use, per camera, from capture timestamps and arrival times.
///
/// A frame is fresh if its timestamp is later than the previous one of the same camera and at most
/// a tolerance ahead of the loop's clock. A camera that repeats a timestamp, runs backwards or uses
/// another clock delivers no fresh frames, however many arrive. The worst camera counts, so a
/// working camera does not mask a failed one. Uses no clock. One thread. [servo] No allocation,
/// lock or system call; O(max_cameras).
class Freshness {
 public:
  static constexpr std::size_t max_cameras = 16;

  /// Takes note of a frame. Cameras that are not in `frames` are no longer waited for.
  /// @param frames     the new frame, then the newest of each other camera that has to be alive, as
  ///                   far as that is known; numbers beyond max_cameras are ignored
  /// @param arrived    [s] when the new one arrived, on the loop's clock
  /// @param tolerance  [s] how far ahead of `arrived` a stamp may be
  void adopt(std::span<const CameraFrame> frames, double arrived, double tolerance) noexcept;

  struct Age {
    /// [s] since capture, and at least since arrival, of the oldest camera's newest fresh frame;
    /// infinite if a camera has not had one
    double age;
    /// [intervals] since the arrival of a camera's newest fresh frame, in that camera's usual
    /// intervals; the largest of all cameras. Capture to arrival is left out: a camera of high rate
    /// and long delay is old at any time, but it is not late.
    double intervals;
  };
  [[nodiscard]] Age at(double t) const noexcept;

  /// Walks over all that is remembered of the cameras; see CycleState.
  template <class Way, class Self>
  static void walk(Way& way, Self& self) {
    for (auto& camera : self.cameras_) {
      way("camera.expected", camera.expected);
      way("camera.last_stamp", camera.last_stamp);
      way("camera.fresh_stamp", camera.fresh_stamp);
      way("camera.arrived", camera.arrived);
      way("camera.was_fresh", camera.was_fresh);
      way("camera.ever_fresh", camera.ever_fresh);
      Interval::walk(way, camera.interval);
    }
  }

 private:
  // The median of the last intervals: neither a frame that was skipped nor a burst changes it.
  class Interval {
   public:
    void add(double seconds) noexcept;
    [[nodiscard]] double usual() const noexcept { return usual_; }
    template <class Way, class Self>
    static void walk(Way& way, Self& self) {
      for (auto& last : self.last_) way("camera.interval", last);
      way("camera.intervals", self.added_);
      way("camera.usual_interval", self.usual_);
    }

   private:
    static constexpr std::size_t count = 9;
    std::array<double, count> last_{};
    std::size_t added_ = 0;
    double usual_ = 1.0 / 30.0;  // [s] before two frames came: the commonest rate of a camera
  };

  struct Camera {
    bool expected = false;
    double last_stamp = -std::numeric_limits<double>::infinity();  // [s] fresh or not
    double fresh_stamp = 0.0;                                      // [s]
    double arrived = 0.0;                                          // [s] of the fresh one
    bool was_fresh = false;                                        // the last frame
    bool ever_fresh = false;
    Interval interval;
  };

  std::array<Camera, max_cameras> cameras_{};
};

}  // namespace palpate
