// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/bag/bag_writer.hpp"
#include "palpate/cloud/depth_image.hpp"
#include "palpate/cloud/point_cloud.hpp"
#include "palpate/record/session.hpp"

namespace palpate {

/// Writes a session as a ROS 2 bag (docs/recording.md): standard messages for whoever looks at it,
/// and beside them every number that a replay needs, to the bit. Used on one thread.
class SessionWriter {
 public:
  /// @param folder     of the bag; must not be there yet
  /// @param t          [s] on the session's clock: now
  /// @param max_bytes  as BagWriter's
  /// @throws Error if it is there, or cannot be made.
  SessionWriter(const std::filesystem::path& folder, const SessionInfo& info, double t,
                std::optional<std::uint64_t> max_bytes = std::nullopt);

  // Each throws Error if the disk is full or fails; what was committed before stays.

  /// Says anew what the session is: the last time counts. Its epoch stays.
  /// @param t  [s] when it was that
  void info(const SessionInfo& info, double t);
  /// Settings, before the first tick that uses them.
  /// @param t  [s] when they were set
  void settings(const NumberedSettings& settings, double t);
  /// A frame, before or after the ticks that use it.
  /// @param number   as ServoTick::frame_number; increasing
  /// @param stamp    [s] as the renderer got it
  /// @param cameras  what each camera saw last, null before its first frame. What a camera saw
  ///                 before is not written again.
  /// @throws Error also for a cloud that is neither a DepthImage nor a PointCloud.
  void frame(std::uint64_t number, double stamp,
             std::span<const std::shared_ptr<const Cloud>> cameras);
  void tick(const ServoTick& tick);
  /// Commits once a second of the machine's clock; call it often.
  void commit_if_due();
  void commit() { bag_.commit(); }
  void close() { bag_.close(); }

  [[nodiscard]] const std::filesystem::path& folder() const { return bag_.folder(); }
  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  struct Camera {
    std::shared_ptr<const Cloud> newest;  // kept, so that no other cloud can have its address
    std::uint64_t frames = 0;
  };

  template <class Message>
  void write(std::string_view topic, std::int64_t nanoseconds, const Message& message,
             bool latched = false);
  [[nodiscard]] std::int64_t nanoseconds(double t) const;
  void depth(std::size_t camera, double stamp, const DepthImage& image);
  void points(std::size_t camera, double stamp, const PointCloud& cloud);

  std::int64_t epoch_;  // [ns]
  BagWriter bag_;
  std::vector<Camera> cameras_;
  std::uint64_t ticks_ = 0, frames_ = 0;
  double committed_at_ = 0.0;  // [s] monotonic_now()
};

}  // namespace palpate
