// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "palpate/kernel/core/cloud.hpp"
#include "palpate/kernel/core/patch.hpp"

namespace palpate {

/// An object that approaches a tool.
struct Approach {
  double speed = 0.0;         ///< [m/s] approach speed; 0: nothing approaches
  double gap = 0.0;           ///< [m] from `place` to the nearest point, when it was measured
  Vec3 place = Vec3::Zero();  ///< [m] world: where the tool was
  Vec3 away = Vec3::UnitZ();  ///< [-] unit, world: from the object to the tool
  double stamp = 0.0;         ///< [s] of the frame
  double noise = 0.0;         ///< [m] standard deviation of such a gap from frame to frame
};

/// Detects objects that approach a tool before contact, only from the frames of one camera.
///
/// A method may wait until it can distinguish noise from motion (`sight` needs up to 0.2 s with a
/// noisy camera); a robot that retreats too early does no harm. The distances from the tool's
/// position to the nearest points of the last frames give a straight line over time. Its slope
/// counts as a speed if it exceeds `least_speed` and `least_ratio` times its standard error; half
/// of that is enough for an object that approached before. A sideways motion without approach does
/// not count.
class ApproachWatch {
 public:
  static constexpr double reach = 0.06;         ///< [m] about the tool
  static constexpr double least_speed = 0.015;  ///< [m/s] slower things are left to the proxy
  static constexpr double least_ratio = 3.0;    ///< [-] of a slope to its standard error

  ApproachWatch();

  /// A frame has come. Four gatherings of a ball. @param tool  [m] world
  /// @param stamp  [s] later than those before; others begin again
  const Approach& frame(std::shared_ptr<const Cloud> cloud, double stamp, const Vec3& tool);
  [[nodiscard]] const Approach& newest() const { return approach_; }
  /// Does the straight line from the tool to its proxy pass through a surface of the newest frame?
  /// Then that proxy has been lost, and the tool must not follow it. Space that is only occluded
  /// may be entered from the side. False without a frame. Looks every 10 ms: at most 17 gatherings
  /// of a beam as wide as the tool.
  /// @param proxy, tool  [m, world]
  /// @param radius       [m] of the tool
  /// @param t            [s] now
  [[nodiscard]] bool is_between(const Vec3& proxy, const Vec3& tool, double radius,
                                double t) noexcept;
  /// [m] from the tool to the nearest point of the newest frame; at most `reach`.
  [[nodiscard]] double clearance() const { return clearance_; }

 private:
  // The slope is taken over several numbers of frames, as little noise or much speed need few; the
  // surest one counts.
  static constexpr std::array<std::size_t, 3> windows = {4, 6, 9};
  static constexpr std::size_t frames = windows.back();
  static constexpr std::size_t nearest = 24;  // points: more than a speckle of noise has

  static constexpr double noise_memory = 30.0;  // [frames]
  static constexpr double surprise = 4.0;       // [-] of a variance beyond the usual one
  static constexpr double across = 0.02;        // [m] about the line to the nearest points
  static constexpr double one_surface = 0.015;  // [m] along it: what is farther is another one

  struct Seen {
    std::shared_ptr<const Cloud> cloud;
    double stamp = 0.0;  // [s]
  };

  bool find_nearest(const Cloud& cloud, const Vec3& tool, Vec3& towards);
  double behind(const Cloud& cloud, const Vec3& place, double radius) noexcept;
  double distance_along(const Cloud& cloud, const Vec3& tool, const Vec3& direction,
                        double expected);

  std::vector<Seen> seen_;  // the newest last
  std::unique_ptr<Patch> patch_;
  std::vector<std::size_t> order_;
  std::vector<float> squares_;
  double variance_ = -1.0;  // [m^2] of a distance, as usual; negative: not known yet
  bool comes_ = false;
  bool between_ = false;
  double looked_ = -1e9;  // [s] when it was looked for what is between tool and proxy
  Approach approach_;
  double clearance_ = reach;  // [m]
};

}  // namespace palpate
