// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "palpate/io/sources/source.hpp"
#include "palpate/session/stamp_placer.hpp"

namespace palpate {

/// [s] at which an image that stays valid is shown again: 30 Hz, as a camera would.
inline constexpr double still_interval = 1.0 / 30.0;
/// [s] of a recording that begins again at its end; a shorter one stays on its last frame.
inline constexpr double shortest_loop = 2.0;

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
  std::string text{};        ///< the state in words, with what is wrong; "live"
  double rate = 0.0;         ///< [Hz] of the frames lately
  std::uint64_t frames = 0;  ///< handed over, each once
  /// Dropped: to keep up with a recording, frozen, unreadable, or with a timestamp that is not
  /// later than the last.
  std::uint64_t dropped = 0;
  std::uint64_t opened_again = 0;  ///< how often after it was gone
  std::uint64_t slowed = 0;        ///< how often a recording was slowed down: it was 1 s behind
  /// How often each StampProblem was seen; [0] is not used.
  std::array<std::uint64_t, stamp_problem_count> stamp_problems{};
  double latency = 0.0;                ///< [s] usual time from capture to arrival (live cameras)
  std::optional<double> last_frame{};  ///< [s, CLOCK_MONOTONIC] stamp of the newest frame
  std::string trouble{};               ///< the error met last; a live camera's next frame clears it
  /// The last frame is declared valid until another one replaces it: a static image, or a recording
  /// that is paused or has ended. Never true for a live camera that stopped.
  bool stays_valid = false;
  std::shared_ptr<const Body> body{};  ///< as SourceInfo::body
  std::string doubt{};       ///< why its unit or its axes may be wrong; empty: no sign of it
  Playback playback{};       ///< of a recording
  std::size_t recorded = 0;  ///< frames of a recording; 0: not known, or no recording
  std::size_t place = 0;     ///< of a recording: number of the frame shown last, from 0
  /// [s] of a recording: stamp of that frame, from the recording's first
  double recorded_time = 0.0;
};

/// What drives a Player.
enum class Playing : std::uint8_t {
  /// A clock that waits for it. A recording of less than `shortest_loop` stays on its last frame.
  freely,
  in_real_time,  ///< a clock that goes on. Of a live camera it keeps the status, no more.
  /// Stamps stay the source's, which may be live; nothing begins again nor is shown again.
  by_its_stamps,
};

/// A recording or simulation, played on any clock: its driver says what time it is. No thread and
/// no lock: the driver calls all of it on one thread.
///
/// Stamps of capture keep their intervals, by one constant offset a pass. A frame whose stamp is
/// not later than that of the frame before is left out; where stamps go back by more than 1 s or
/// forward by more than 10 s, time jumps (FedFrame::after_jump) and the offset is chosen again.
/// What ends begins again, an interval after its last frame. A frame that stays, as it is the only
/// one, or the recording is paused or has ended, is shown again at 30 Hz with new stamps.
class Player {
 public:
  using Open = std::function<std::unique_ptr<Source>()>;

  /// @param source  open
  /// @param open    opens it again at its end; empty: it cannot be
  /// A live source on StampClock::session is played by its stamps.
  /// @throws Error if any other source is live and played freely.
  Player(std::shared_ptr<Source> source, Open open, Playing playing = Playing::freely);

  /// The first frame, which next_until gives later. @throws Error if there is none, or as read.
  const Frame& first_frame();
  /// The next frame that is due at or before `t` [s on the driver's clock]; none if there is none
  /// yet. The first frame is due when this, or due, is called first. Reads what it needs.
  /// @throws Error as read and the function that opens the source again.
  std::optional<FedFrame> next_until(double t);
  /// Reads ahead, as next_until does. @return the frame to come; null: there is none, or only after
  /// many that are left out. @throws Error as next_until.
  const Frame* look_ahead();
  [[nodiscard]] const Frame* upcoming() const { return next_ ? &*next_ : nullptr; }

  /// Where the hand is [m, world], for the frames that are read from now on.
  void follow(const Vec3& hand) {
    if (source_) source_->follow(hand);
  }

  /// From time `now` [s] on.
  void set_playback(const Playback& playback, double now);
  /// Continues from another place: 0 is the first frame, 1 the last. Nothing happens where the
  /// number of frames is not known.
  void seek(double share);

  /// For a driver that opens, reads and waits by itself, in this order: the source has to be opened
  /// again and given to `begin`; `read` is to be called; next_until gives a frame from `due` on.
  [[nodiscard]] bool needs_source() const { return !source_ || (has_ended_ && !is_still()); }
  [[nodiscard]] bool needs_frame() const { return !next_ && !is_still(); }
  /// Closes the source: it has to begin again.
  void close();
  void begin(std::shared_ptr<Source> source) { source_ = std::move(source); }
  /// Reads one frame, and may leave it out.
  /// @param now   [s] frames that are late by then are left out, if the source can; none: it waits
  /// @param took  [s] which the read before took, and this one will take
  /// @throws Error as Source::next, after which it goes on with the frame after it; or if the
  ///         source has no frame at all, after which it has to begin again.
  void read(double now = -std::numeric_limits<double>::infinity(), double took = 0.0);
  /// @param now  [s]
  /// @return [s] infinity: nothing will come; minus infinity: a frame has to be read first
  double due(double now);

  /// The source has given all its frames.
  [[nodiscard]] bool has_ended() const { return has_ended_; }
  /// The one in use; not while it has to be opened again.
  [[nodiscard]] const Source& source() const { return *source_; }
  [[nodiscard]] const CameraStatus& status() const { return status_; }
  /// What the driver knows of it may be added.
  [[nodiscard]] CameraStatus& status() { return status_; }

 private:
  [[nodiscard]] bool gives_frames_later() const {
    return source_->info().live && source_->info().clock == StampClock::session;
  }
  [[nodiscard]] bool is_still() const {
    const bool paused = status_.playback.paused;
    return next_ ? paused && !is_new_place_ : has_ended_ && (stays_ || paused);
  }
  void leave_out_late(double now, double took);
  void leave_out();
  void keep(Frame frame);
  void end();
  FedFrame again(double t);
  std::optional<FedFrame> show();

  std::shared_ptr<Source> source_;  // null: it has to be opened again
  Open open_;
  Playing playing_;
  CameraStatus status_;
  std::optional<Frame> next_;         // read already
  FedFrame shown_;                    // given last
  std::size_t at_ = 0;                // frames read or left out in this pass
  std::size_t given_ = 0;             // of them, shown
  std::size_t sought_ = 0;            // number of the frame to go to
  bool has_ended_ = false;            // this pass
  bool stays_ = false;                // at its end, for ever
  bool is_new_place_ = true;          // time jumps before the frame to come
  bool is_placed_ = false;            // the offset is that of the frame to come
  double pass_began_ = 0.0;           // [s] on the driver's clock
  double first_stamp_ = 0.0;          // [s] of the recording's first frame, by its own clock
  double offset_ = 0.0;               // [s] from the source's clock, at the speed, to the driver's
  double interval_ = still_interval;  // [s] of the last two frames
  double last_ = -std::numeric_limits<double>::infinity();  // [s] stamp given last
};

}  // namespace palpate
