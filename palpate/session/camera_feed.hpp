// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "palpate/drivers/drivers.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/session/player.hpp"
#include "palpate/session/stamp_placer.hpp"

namespace palpate {

/// Time and waiting of a CameraFeed: this machine's, or a simulated one in tests.
class FeedClock {
 public:
  virtual ~FeedClock() = default;
  /// [s] the servo loop's clock, CLOCK_MONOTONIC. Any thread.
  [[nodiscard]] virtual double now() const = 0;
  /// [s since 1970] the wall clock, CLOCK_REALTIME, when `now` was 0.
  [[nodiscard]] virtual double system_start() const = 0;
  /// Waits on `changed` until it is notified or time `t` [s] has come; may return early.
  virtual void wait(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                    double t) = 0;
};

/// This machine's clocks.
std::shared_ptr<FeedClock> machine_clock();

/// When a camera is given up and looked for again. Times in seconds.
struct FeedOptions {
  double silence = 2.0;        ///< [s] without a frame after which a live camera is opened again
  double start_up = 5.0;       ///< [s] the same, for its first frame after it was opened
  double first_pause = 0.1;    ///< [s] before it is opened again; doubles with each failure
  double longest_pause = 5.0;  ///< [s] at most
  double waiting = 0.25;       ///< [s] without a frame after which its state says so
  int frozen_frames = 10;      ///< identical depth images in a row that make a live camera frozen
  Registry<SourceScheme> schemes = all_sources();  ///< opens the URI, also again
  std::shared_ptr<FeedClock> clock = machine_clock();
};

/// One camera in its own thread.
///
/// Frames reach the sink with their capture timestamps, shifted to the servo loop's clock by one
/// constant offset, so that the intervals stay as the camera measured them:
/// - A recording plays at the pace of its stamps, as Player says. Where decoding is too slow,
/// frames
///   come late or are left out (`dropped`); the stamps stay.
/// - A live camera's clock is followed as StampPlacer says; stamps that cannot be true are replaced
///   by the time of arrival, and counted.
///
/// A live camera that throws an Error three times in a row, or delivers nothing for `silence`, is
/// closed and opened again after pauses that double from `first_pause` to `longest_pause`, without
/// end. Bit-identical depth images in a row mean that the camera hangs, because real images have
/// noise. From the `frozen_frames`-th identical image on, frames are dropped, so that the frame age
/// grows and the safety chain reacts.
///
/// Where the source says what distances the camera can measure (SourceInfo::range), one frame in 30
/// is held against it: if more than 30 % of the points lie elsewhere, `CameraStatus::doubt` says
/// so, as drivers are known to give depth in another unit than they say.
///
/// Nothing here waits for the camera's thread without a bound: a thread that hangs inside the
/// source is left behind with all that it uses and ends when the source returns.
class CameraFeed {
 public:
  /// Called on the camera's thread for each frame. Must be quick and must not throw.
  using Sink = std::function<void(const FedFrame&)>;
  using Open = Player::Open;
  /// Where the hand is [m, world]; none: not known. Called on the camera's thread before it reads.
  using Hand = std::function<std::optional<Vec3>()>;

  /// Opens the source. @throws Error as open_source.
  explicit CameraFeed(const std::string& uri, FeedOptions options = {});
  /// @param source  open
  /// @param open    opens it again after it has ended or gone; empty: it cannot be opened again
  explicit CameraFeed(std::unique_ptr<Source> source, FeedOptions options = {}, Open open = {});
  /// stop().
  ~CameraFeed();

  /// Before start(): the first frame, read on the caller's thread and handed over after start().
  /// Its stamp is the source's own.
  /// @return none if a live camera delivers none within `timeout` [s]
  /// @throws Error as Source::next, or if a recording holds no frames.
  std::optional<Frame> first_frame(double timeout);

  /// Starts the thread, which calls `sink` and, if there is one, `hand` for a source that follows
  /// it. Once.
  void start(Sink sink, Hand hand = {});

  /// Asks the thread to end and returns at once (after a sink that is just being called). Never are
  /// sink and hand called after this has returned. Hold no lock that the sink takes. Any thread;
  /// from within the sink, too.
  void request_stop() noexcept;
  /// Waits up to `timeout` [s, real time] for the thread to end.
  /// @return false if it has not, because the source hangs
  bool join(double timeout);
  /// request_stop, then join; a thread that does not end is left behind. @return as join
  bool stop(double timeout = 0.5);

  /// From now on; of a recording. Any thread. @throws Error if the speed is out of range.
  void set_playback(const Playback& playback);
  /// A recording continues from another place: 0 is its first frame, 1 its last. Nothing happens
  /// where it does not know how many frames it has. Any thread. @throws Error beyond 0 to 1.
  void seek(double share);

  /// Any thread; waits for nothing.
  [[nodiscard]] CameraStatus status() const;
  /// As the source was opened first.
  [[nodiscard]] const SourceInfo& info() const { return info_; }

 private:
  class Worker;
  SourceInfo info_;
  std::shared_ptr<Worker> worker_;  // shared with the thread, which may outlive this
  std::thread thread_;
};

}  // namespace palpate
