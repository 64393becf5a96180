// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "palpate/drivers/drivers.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/session/stamp_placer.hpp"

namespace palpate {

/// Time and waiting of a CameraFeed: this machine's, or a simulated one in tests.
class FeedClock {
 public:
  virtual ~FeedClock() = default;
  /// [s] the servo loop's clock, CLOCK_MONOTONIC. Any thread.
  [[nodiscard]] virtual double now() const = 0;
  /// [s since 1970] the wall clock, CLOCK_REALTIME.
  [[nodiscard]] virtual double system_now() const = 0;
  /// Waits on `changed` until it is notified or time `t` [s] has come; may return early.
  virtual void wait(std::unique_lock<std::mutex>& lock, std::condition_variable& changed,
                    double t) = 0;
};

/// This machine's clocks.
std::shared_ptr<FeedClock> machine_clock();

/// [s] at which an image that stays valid is shown again: 30 Hz, as a camera would.
inline constexpr double still_interval = 1.0 / 30.0;
/// [s] of a recording that begins again at its end; a shorter one stays on its last frame.
inline constexpr double shortest_loop = 2.0;

/// When a camera is given up, looked for again and shown. Times in seconds.
struct FeedOptions {
  double silence = 2.0;        ///< [s] without a frame after which a live camera is opened again
  double start_up = 5.0;       ///< [s] the same, for its first frame after it was opened
  double first_pause = 0.1;    ///< [s] before it is opened again; doubles with each failure
  double longest_pause = 5.0;  ///< [s] at most
  double waiting = 0.25;       ///< [s] without a frame after which its state says so
  double still_interval = palpate::still_interval;  ///< [s] at which a still image is shown again
  double longest_gap = 10.0;  ///< [s] between frames of a recording beyond which it is cut short
  double longest_lag = 1.0;   ///< [s] behind its stamps, beyond which a recording is slowed down
  int frozen_frames = 10;     ///< identical depth images in a row that make a live camera frozen
  StampPlacerOptions stamps{};
  Registry<SourceScheme> schemes = all_sources();  ///< opens the URI, also again
  std::shared_ptr<FeedClock> clock = machine_clock();
};

/// A recording whose stamps go back by this much [s] begins again there.
inline constexpr double stamp_step_back = 1.0;

/// Playback of a recording. A live camera ignores it.
struct Playback {
  bool paused = false;  ///< the last frame is repeated at 30 Hz
  bool loop = true;     ///< a recording that ends starts again; false: it pauses on its last frame
  double speed = 1.0;   ///< of its stamps
  static constexpr double slowest = 0.1, fastest = 4.0;
};

/// A frame as it is delivered to the servo loop.
struct FedFrame {
  Frame frame;                ///< its stamp is on the servo loop's clock [s, CLOCK_MONOTONIC]
  double source_stamp = 0.0;  ///< [s] the timestamp from the source
  /// False for a repeated frame of a recording; its timestamp is the time of the repetition.
  bool is_new = true;
  /// Time has jumped before this frame: the recording restarted, or was moved to another time.
  bool after_jump = false;
};

enum class CameraState : std::uint8_t {
  waiting,    ///< open, but without recent frames
  live,       ///< frames come
  frozen,     ///< a live camera sends the same image repeatedly
  searching,  ///< it is disconnected; the driver tries to reconnect
  ended,      ///< a recording that cannot be opened again has ended, and stays on its last frame
  stopped,    ///< by request_stop
};

/// Status of a camera.
struct CameraStatus {
  std::string uri, kind;
  SensorKind sensor = SensorKind::unknown;
  CameraState state = CameraState::waiting;
  std::string text;          ///< the state in words, with what is wrong; "live"
  double rate = 0.0;         ///< [Hz] of the frames lately
  std::uint64_t frames = 0;  ///< handed over, each once
  /// Dropped: to keep up with a recording, frozen, unreadable, or with a timestamp that is not
  /// later than the last.
  std::uint64_t dropped = 0;
  std::uint64_t opened_again = 0;  ///< how often after it was gone
  std::uint64_t slowed = 0;        ///< how often a recording was slowed down, see longest_lag
  /// How often each StampProblem was seen; [0] is not used.
  std::array<std::uint64_t, stamp_problem_count> stamp_problems{};
  double latency = 0.0;                ///< [s] usual time from capture to arrival (live cameras)
  std::optional<double> last_frame{};  ///< [s, CLOCK_MONOTONIC] stamp of the newest frame
  std::string trouble;                 ///< the error met last; a live camera's next frame clears it
  /// The last frame is declared valid until another one replaces it: a static image, or a recording
  /// that is paused or has ended. Never true for a live camera that stopped.
  bool stays_valid = false;
  std::string doubt;         ///< why its depth unit may be wrong; empty: no sign of it
  Playback playback;         ///< of a recording
  std::size_t recorded = 0;  ///< frames of a recording; 0: not known, or no recording
  std::size_t place = 0;     ///< of a recording: number of the frame shown last, from 0
  /// [s] of a recording: stamp of that frame, from the recording's first
  double recorded_time = 0.0;
};

/// One camera in its own thread.
///
/// Frames reach the sink with their capture timestamps, shifted to the servo loop's clock by one
/// constant offset, so that the intervals stay as the camera measured them:
/// - A recording plays at the pace of its stamps; each pass has its offset. Where decoding is too
///   slow, frames come late or are left out (`dropped`); the stamps stay. What ends begins again. A
///   frame that stays, as it is the only one, or the recording is paused or has ended, is shown
///   again at 30 Hz with new stamps (FedFrame::is_new is false; CameraStatus::stays_valid).
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
  using Open = std::function<std::unique_ptr<Source>()>;

  /// Opens the source. @throws Error as open_source.
  explicit CameraFeed(const std::string& uri, FeedOptions options = {});
  /// @param source  open
  /// @param open    opens it again after it has ended or gone; empty: it cannot be opened again
  explicit CameraFeed(std::unique_ptr<Source> source, FeedOptions options = {}, Open open = {});
  /// stop().
  ~CameraFeed();
  CameraFeed(const CameraFeed&) = delete;
  CameraFeed& operator=(const CameraFeed&) = delete;

  /// Before start(): the first frame, read on the caller's thread and handed over after start().
  /// Its stamp is the source's own.
  /// @return none if a live camera delivers none within `timeout` [s]
  /// @throws Error as Source::next, or if a recording holds no frames.
  std::optional<Frame> first_frame(double timeout);

  /// Starts the thread, which calls `sink`. Once.
  void start(Sink sink);

  /// Asks the thread to end and returns at once (after a sink that is just being called). Never is
  /// the sink called after this has returned. Hold no lock that the sink takes. Any thread; from
  /// within the sink, too.
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
