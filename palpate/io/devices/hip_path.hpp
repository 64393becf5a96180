// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <istream>
#include <optional>
#include <string>
#include <vector>

#include "palpate/kernel/core/hand.hpp"
#include "palpate/servo/device.hpp"

namespace palpate {

/// Where the HIP is over time: given places, straight lines between them.
class HipPath {
 public:
  struct Sample {
    double t;  ///< [s]
    Vec3 hip;  ///< [m] in whatever frame the path is meant: the world's in a CSV file
    Rotation turn = Rotation::Identity();  ///< frame_from_tool, of a tool with a shape
  };

  /// Reads a CSV file with a header that names at least the columns `t,x,y,z` (seconds, metres, in
  /// any order; others are ignored) and a line for each sample. Empty lines are skipped. A hand
  /// that turns has the columns `qx,qy,qz,qw`, too: quaternions, of length 1 within 1 %.
  /// @throws Error naming file and line: no file, no samples, a missing column or value, something
  ///         that is not a finite number, times that do not increase, places beyond 1000 km or a
  ///         path longer than 10^6 s (units that are not metres and seconds).
  static HipPath read_csv(const std::filesystem::path& file);
  /// The same from a stream. @param name  of it, for messages
  static HipPath parse_csv(std::istream& in, const std::string& name);

  /// @throws Error as `read_csv`, counting samples from 1.
  explicit HipPath(std::vector<Sample> samples);

  /// Where the HIP is at `t` [s]; before the first sample and after the last it rests there.
  /// [servo] O(log samples), no allocation.
  [[nodiscard]] Vec3 at(double t) const noexcept { return pose_at(t).position; }
  /// The same with its orientation: on the shortest way between two samples.
  [[nodiscard]] HandPose pose_at(double t) const noexcept;
  /// Does any sample say how the hand is turned?
  [[nodiscard]] bool turns() const noexcept { return turns_; }

  [[nodiscard]] double first_time() const noexcept { return samples_.front().t; }
  [[nodiscard]] double last_time() const noexcept { return samples_.back().t; }
  [[nodiscard]] const std::vector<Sample>& samples() const noexcept { return samples_; }

 private:
  std::vector<Sample> samples_;  // at least one, times increase
  bool turns_ = false;
};

/// A hand that follows a path and does not care for forces.
///
/// The path begins at the first `read`; after its end the hand rests, or begins again.
class ScriptedDevice final : public Device {
 public:
  /// @param path    [m] device frame
  /// @param repeat  begin again after the end
  ScriptedDevice(HipPath path, bool repeat, std::string uri = "script:");

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override;
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  DeviceInfo info_;
  HipPath path_;
  bool repeat_;
  std::optional<double> began_;  // [s] on the loop's clock
};

}  // namespace palpate
