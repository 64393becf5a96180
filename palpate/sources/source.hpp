// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/cloud/frame.hpp"

namespace palpate {

/// What can be said of a source before, or without, reading all of it.
struct SourceInfo {
  std::string uri;                      ///< as it was opened
  std::string kind;                     ///< e.g. "TUM RGB-D recording"
  std::optional<std::size_t> frames{};  ///< how many there are; none if endless
  std::optional<double> frame_rate{};   ///< [Hz] nominal, or the median of the stamps
  double start_time = 0.0;              ///< [s] stamp 0 by the recording's own clock
  std::vector<std::string> notes{};     ///< what a person should know, such as frames left out
  std::string details{};                ///< of the frame read last: its file's encoding, fields
};

/// Where frames come from: a camera, a simulation, a recording. Used on one thread, the camera's.
class Source {
 public:
  virtual ~Source() = default;

  /// The next frame in the order of capture, or none after the last. Reads and decodes; may wait
  /// for files but never for the clock: pacing is the caller's.
  /// @throws Error naming the file that cannot be used. The source can be asked again: it goes on
  ///         with the frame after that.
  virtual std::optional<Frame> next() = 0;

  [[nodiscard]] virtual const SourceInfo& info() const = 0;
};

/// Opens `synthetic:SCENE?...`, `tum:DIR`, `depth:DIR`, `pcd:FILE|DIR`, `ply:FILE|DIR`,
/// `recording:BAG`.
/// @throws Error for an unknown scheme or option (naming the nearest known one), or input that
///         cannot be used.
std::unique_ptr<Source> open_source(std::string_view uri);

}  // namespace palpate
