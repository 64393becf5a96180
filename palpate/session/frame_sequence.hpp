// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/method.hpp"
#include "palpate/session/player.hpp"

namespace palpate {

/// The frames of one camera that have been handed over so far.
struct ShownFrames {
  std::size_t count = 0;
  double first = 0.0;  ///< [s] stamp of the first; before there is one, of the one to come
  double last = 0.0;   ///< [s] stamp of the newest
  bool ended = false;  ///< no frame follows
};

/// Frames of one or several cameras in the order of their stamps, each adopted at the first tick at
/// or after it.
///
/// When all have ended, what they saw last is valid: it is shown again at 30 Hz, with the stamps of
/// then. A single frame is not, as methods take it for a picture anyway.
class FrameSequence {
 public:
  /// @throws Error if a source cannot be opened, or there are none.
  explicit FrameSequence(const std::vector<std::string>& uris);
  /// Of sources that are open. @throws Error as above.
  explicit FrameSequence(std::vector<std::unique_ptr<Source>> sources);

  /// Hands every frame stamped at or before `t` [s] to `adopt`, oldest first; after the last, each
  /// camera's last again. A frame lives until its camera's next has been handed over.
  /// @throws Error if a frame cannot be read.
  void adopt_until(double t, const std::function<void(const Observation&)>& adopt);

  /// Where the hand is [m, world], for sources that follow it.
  void follow(const Vec3& hand) {
    for (Player& player : players_) player.follow(hand);
  }

  /// @throws Error if the method cannot touch what a camera shows first.
  void check(const Method& method) const;
  /// Frames handed over so far, each once.
  [[nodiscard]] std::size_t adopted() const { return adopted_; }
  /// The same of each camera.
  [[nodiscard]] const std::vector<ShownFrames>& shown() const { return shown_; }
  [[nodiscard]] std::size_t cameras() const { return players_.size(); }
  [[nodiscard]] const Source& source(std::size_t camera) const { return players_[camera].source(); }
  /// How each camera measures, for `for_sensors`.
  [[nodiscard]] std::vector<SensorKind> sensors() const;
  /// What a camera will show next; null after its last frame.
  [[nodiscard]] const Frame* upcoming(std::size_t camera) const {
    return players_[camera].upcoming();
  }
  /// What each camera saw last; null before its first frame.
  [[nodiscard]] std::span<const std::shared_ptr<const Cloud>> newest() const { return newest_; }

 private:
  std::vector<Player> players_;  // of each camera
  std::vector<ShownFrames> shown_;
  std::vector<std::shared_ptr<const Cloud>> newest_;
  std::size_t adopted_ = 0;
  double last_ = 0.0;  // [s] stamp handed over last
};

/// Moves a hand through what the cameras saw, tick by tick, from `first` on, where the proxy
/// starts.
/// @param hand  where it is at a time [s], asked for once a tick after that tick's frames; none:
///              the end
/// Else as touch_along.
void touch(FrameSequence& frames, Method& method, const HipPath::Sample& first, double rate,
           const std::function<std::optional<HandPose>(double)>& hand,
           const std::function<bool(const Tick&)>& on_tick);

/// How many ticks `touch_along` makes.
/// @throws Error if `rate` is not in 1 to 100 000 Hz.
std::int64_t ticks_along(const HipPath& path, double rate);

/// Moves a hand along a path through what the cameras saw, tick by tick, each frame taken into use
/// at the first tick at or after its stamp; the proxy starts at the path's first place. The same
/// arguments give the same ticks, bit for bit.
/// @param rate     [Hz] ticks a second
/// @param on_tick  sees each tick; false ends the run
/// @throws Error if the method cannot touch the frames, or one of them cannot be read.
void touch_along(FrameSequence& frames, Method& method, const HipPath& path, double rate,
                 const std::function<bool(const Tick&)>& on_tick);

}  // namespace palpate
