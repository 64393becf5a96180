// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/net/teleop/robot.hpp"

#include "robot/simulation.hpp"

namespace palpate::robot {

/// Who advances the simulation's time.
enum class Pace : std::uint8_t {
  real_time,  ///< a thread of its own, on the servo loop's clock
  stepped,    ///< the caller, or the camera's `next`: the same every time
};

/// A robot and a camera that share one simulation.
///
/// `mujoco:desk?KEY=VALUE&...`:
///   plate=30mm plate_stroke=0mm plate_rate=0.5Hz  height of the plate's top, and its motion
///   plate_stiffness=400  [N/m] of a soft skin that it has; without it, it is hard
///   hole=15mm  side of the square hole in the board
///   max_force=8 max_speed=0.5  [N] and [m/s] of the robot
///   arm=hidden|remembered|seen margin=3mm latency=0ms  of the camera, and as a synthetic camera
///   has them: size fps fov distance tilt azimuth seed sensor noise noise_grows correlation
///   quantisation disparity_step dropouts grazing flying
class SimulatedCell {
 public:
  /// The simulation runs, or stands at time 0.
  /// @throws Error for an unknown model or option, or a value out of range.
  explicit SimulatedCell(const Uri& uri, Pace pace = Pace::real_time);

  [[nodiscard]] const std::shared_ptr<Simulation>& simulation() const { return simulation_; }

  // What follows outlives the cell.

  [[nodiscard]] std::unique_ptr<Robot> robot() const;
  [[nodiscard]] std::unique_ptr<Source> camera() const;
  /// `mujoco:desk?...` as a source's URI: a camera in this cell, with that URI's options of a
  /// camera. Its options of plate and robot are checked but change nothing.
  [[nodiscard]] SourceScheme source_scheme() const;

 private:
  Uri uri_;
  std::shared_ptr<Simulation> simulation_;
};

}  // namespace palpate::robot
