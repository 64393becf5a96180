// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "palpate/io/bag/bag_writer.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/record/session.hpp"

namespace palpate {

/// A depth image, packed.
struct PackedImage {
  std::vector<std::byte> depth;  ///< as RVL
  /// A PNG of 16 bits: the label of each pixel's material, and its brightness in the upper eight,
  /// if that is felt. Empty where neither is known.
  std::vector<std::byte> materials;
  std::vector<std::byte> noise{};  ///< as RVL: DepthImage::noise(); empty where it is not known
};

/// Packs a depth image for SessionWriter::frame: some 2 ms at 640x480. Any thread.
/// @throws Error for a cloud that is not a DepthImage.
PackedImage packed_image(const Cloud& image);

/// Writes a session as a ROS 2 bag (docs/recording.md): standard messages for whoever looks at it,
/// and beside them every number that a replay needs, to the bit. Used on one thread.
class SessionWriter {
 public:
  /// @param folder     of the bag; must not be there yet
  /// @param t          [s] on the session's clock: now
  /// @param commit_interval  [s] of commit_if_due()
  /// @throws Error if it is there, or cannot be made.
  SessionWriter(const std::filesystem::path& folder, const SessionInfo& info, double t,
                double commit_interval = 1.0);

  // Each throws Error if the disk is full or fails; what was committed before stays.

  /// Settings, before the first tick that uses them.
  /// @param t  [s] when they were set
  void commands(const ServoCommands& commands, double t);
  /// A frame, before or after the ticks that use it.
  /// @param number  as ServoTick::frame_number; increasing
  /// @param stamp   [s] as the renderer got it
  /// @param cloud   what that camera saw; not written again if it is what it saw before
  /// @param packed  that image; null: it is packed here
  /// @throws Error also for a cloud that is neither a DepthImage nor a PointCloud.
  void frame(std::uint64_t number, double stamp, std::size_t camera,
             const std::shared_ptr<const Cloud>& cloud, const PackedImage* packed = nullptr);
  /// Notes that a frame is not in the recording, for want of time or space.
  void left_out(std::uint64_t number, double stamp);
  /// How a frame was taken into use, before the ticks that use it.
  void adopted(const AdoptedFrame& frame);
  /// What the cycle remembered before the first tick, if that is in mid-session.
  /// @param t  [s] of that tick
  void state(const CycleState& state, double t);
  void tick(const ServoTick& tick);
  /// Has the commit interval passed since the last commit, on the machine's clock?
  [[nodiscard]] bool commit_is_due() const;
  /// Commits if that is due; call it often. @return true if it did
  bool commit_if_due();
  void commit();
  void close() { bag_.close(); }

  [[nodiscard]] const std::filesystem::path& folder() const { return bag_.folder(); }
  [[nodiscard]] std::uint64_t ticks() const { return ticks_; }
  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] std::uint64_t bytes() const { return bag_.bytes(); }  ///< on the disk

 private:
  struct Camera {
    std::shared_ptr<const Cloud> newest;  // kept, so that no other cloud can have its address
    std::uint64_t frames = 0;
    // What was written last of its materials, and how often.
    std::vector<std::byte> materials;
    std::shared_ptr<const MaterialTable> table;
    std::uint64_t material_images = 0, tables = 0;
    std::vector<std::byte> noise;  // likewise
    std::uint64_t noise_images = 0;
  };

  template <class Message>
  void write(std::string_view topic, std::int64_t nanoseconds, const Message& message,
             bool latched = false);
  [[nodiscard]] std::int64_t nanoseconds(double t) const;
  void depth(std::size_t camera, double stamp, const DepthImage& image, const PackedImage& packed);
  void materials(std::size_t camera, double stamp, const DepthImage& image,
                 const PackedImage& packed);
  void points(std::size_t camera, double stamp, const PointCloud& cloud);

  std::int64_t epoch_;  // [ns]
  BagWriter bag_;
  std::vector<Camera> cameras_;
  std::uint64_t ticks_ = 0, frames_ = 0;
  double commit_interval_;     // [s]
  double committed_at_ = 0.0;  // [s] monotonic_now()
};

}  // namespace palpate
