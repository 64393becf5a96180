// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "palpate/session/camera_feed.hpp"

namespace palpate {

/// A recording or simulation played on the caller's clock, which may run as fast as the machine
/// can. No thread; each frame comes, but those whose stamp is not later than that of the frame
/// before. As with a CameraFeed, stamps of capture stay what they are but for one offset a pass;
/// what ends begins again, and time jumps there (FedFrame::after_jump); a recording of less than
/// `shortest_loop`, or that cannot be opened again, stays on its last frame, at 30 Hz.
class PlayedSource {
 public:
  /// @param source  open; not live
  /// @param open    opens it again at its end; empty: it cannot be
  /// @throws Error if the source is live.
  PlayedSource(std::unique_ptr<Source> source, std::function<std::unique_ptr<Source>()> open);

  /// Before `next_until`: the first frame, which that gives again. @throws Error if there is none.
  const Frame& first_frame();
  /// The next frame that is stamped at or before `t` [s on the caller's clock]; none if there is
  /// none yet. The first frame is due at 0.
  /// @throws Error if a frame cannot be read.
  std::optional<FedFrame> next_until(double t);

  [[nodiscard]] CameraStatus status() const { return status_; }

 private:
  void begin();
  std::optional<Frame> read();
  void read_next();

  std::unique_ptr<Source> source_;
  std::function<std::unique_ptr<Source>()> open_;
  std::optional<Frame> next_;  // read already
  FedFrame shown_;             // given last
  bool is_still_ = false;      // it stays
  bool has_jumped_ = false;    // in time, before the frame to come
  bool has_ended_ = false;     // this pass
  std::uint64_t frames_in_pass_ = 0;
  double pass_began_ = 0.0;       // [s] on the caller's clock
  double offset_ = 0.0;           // [s] from the source's clock to the caller's
  double last_ = 0.0;             // [s] stamp of the last frame on the caller's clock
  double interval_ = 1.0 / 30.0;  // [s] of the last two frames
  CameraStatus status_;
};

}  // namespace palpate
