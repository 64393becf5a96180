// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "palpate/kernel/core/cloud.hpp"
#include "palpate/kernel/core/tick.hpp"
#include "palpate/session/frame_sequence.hpp"

namespace palpate::app {

/// Distances for people: millimetres up to a metre.
std::string length_text(double metres);

/// One sentence about points that are touched by a larger proxy than the usual one; empty: they
/// are not. @param r_c  [m] of the proxy
std::string radius_remark(const Cloud& cloud, double r_c);

/// Why points without an image are not felt, and what to do; empty: nothing is odd about them.
/// @param uri  of their source  @param r_c  [m] of the proxy
std::string sparse_remark(const Cloud& cloud, const std::string& uri, double r_c);

/// What is odd about a trace, noticed while it is made: a path that meets nothing, frames that
/// begin after the path or end before it, a path that begins inside the surface.
///
/// Points are measured only until the first contact, and only in ticks that can have come nearer
/// than any before: a distance changes by no more than its place moves.
class TraceRemarks {
 public:
  /// @param r_c       [m] of the proxy
  /// @param is_press  the hand is led by the visible surface, so it began where it did on purpose
  /// @param sparse    why points cannot be felt anywhere (sparse_remark); empty: they can
  TraceRemarks(double r_c, bool is_press, std::string sparse)
      : r_c_(r_c), is_press_(is_press), sparse_(std::move(sparse)) {}

  /// Counts a tick. @param cameras  the newest frame of each; null before its first
  void count(const Tick& tick, std::span<const std::shared_ptr<const Cloud>> cameras);

  /// One line for each oddity, without a line feed; empty: there is none.
  /// @param shown  of each camera  @param uris  of each camera
  [[nodiscard]] std::vector<std::string> lines(std::span<const ShownFrames> shown,
                                               std::span<const std::string> uris) const;

 private:
  void look_at_start(const Tick& tick, std::span<const std::shared_ptr<const Cloud>> cameras);
  void measure(const Tick& tick, std::span<const std::shared_ptr<const Cloud>> cameras);
  void count_points(const Tick& tick, std::span<const std::shared_ptr<const Cloud>> cameras);
  [[nodiscard]] std::string nothing_met() const;
  [[nodiscard]] std::string hardly_felt(std::span<const ShownFrames> shown) const;

  double r_c_;  // [m]
  bool is_press_;
  std::string sparse_;
  bool any_tick_ = false, touched_ = false;
  int felt_ = 0;                 // ticks with a force that anybody feels
  int contact_ = 0, stale_ = 0;  // ticks in contact, and those of them with an old frame
  int points_about_ = -1;        // where it touched first
  double largest_ = 0.0;         // [N]
  bool first_without_frame_ = false;
  double first_t_ = 0.0, last_t_ = 0.0;  // [s] of ticks
  std::string start_;                    // what is odd about where the path began
  Eigen::AlignedBox3d path_;             // [m] all HIPs

  // Of the frame in use: an even part of its points [m, world].
  std::int64_t measured_frame_ = -1;
  std::vector<Vec3> points_;
  Eigen::AlignedBox3d extent_;
  std::optional<double> distance_;  // [m] from measured_at_ to the nearest of them
  Vec3 measured_at_ = Vec3::Zero();

  double nearest_ = std::numeric_limits<double>::infinity();  // [m] ever
  double nearest_t_ = 0.0;                                    // [s]
  Eigen::AlignedBox3d nearest_extent_;                        // [m] of the points of that frame
};

}  // namespace palpate::app
