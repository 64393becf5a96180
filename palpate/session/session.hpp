// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "palpate/drivers/drivers.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/record/recorder.hpp"
#include "palpate/servo/end_signal.hpp"
#include "palpate/servo/servo_loop.hpp"
#include "palpate/session/camera_feed.hpp"
#include "palpate/session/config.hpp"
#include "palpate/session/paint.hpp"
#include "palpate/session/session_hand.hpp"
#include "palpate/session/summary.hpp"

namespace palpate {

class MouseDevice;

/// Whose time a session runs in.
enum class Pace {
  real_time,     ///< this machine's clock: a person, a device, a live camera
  free_running,  ///< as fast as the machine can: recordings and simulations, a simulated hand
};

/// A whole session, as it begins: what describes it, what is open already, and what only code can
/// give. What has a default may be left out.
struct SessionOptions : SessionSpec {
  /// Used in place of the cameras' URIs, by their numbers, where not null; cameras that `cameras`
  /// lacks are added. When one ends, its last frame stays.
  std::vector<std::unique_ptr<Source>> open_cameras = {};
  /// Likewise of the hands.
  std::vector<std::unique_ptr<Device>> open_devices{std::vector<std::unique_ptr<Device>>(1)};
  std::shared_ptr<const FixtureSet> fixture_set = {};  ///< used in place of the file `fixtures`
  RealtimeRequest realtime = {};
  Pace pace = Pace::real_time;
  /// [s] of the built-in path of `hand:` and `script:`; less where a recording begins again before
  double stroke_time = 20.0;
  /// [s] that `stop` waits for the disk of a recording while that takes nothing; six times that in
  /// all. What is not written then is said in RecordingState::message.
  double record_patience = 10.0;
  std::string version = {};  ///< of the program, for recordings
  MethodRegistry methods = standard_methods();
  Registry<SourceScheme> sources = all_sources();
  Registry<DeviceScheme> devices = all_devices();
  /// Says what a camera's depth image is made of, before anything else sees it; null: what it came
  /// with. A map of another size, or an exception, is said in CameraStatus::doubt, and the frame
  /// continues as it came. A camera's thread, or the caller's of `run` where the session is
  /// free-running.
  std::function<std::shared_ptr<const MaterialMap>(std::size_t camera, const DepthImage& image)>
      materials = {};
  /// Free-running: sees each tick of each hand. The caller's thread of `run`.
  std::function<void(std::size_t hand, const ServoTick& tick)> on_tick = {};
  /// Sees each frame after the method got it. A camera's thread, or the caller's of `run` where the
  /// session is free-running. Must be quick and must not throw.
  std::function<void(std::size_t camera, const FedFrame& frame)> on_frame = {};
};

/// How a recording does.
struct RecordingState {
  bool on = false;
  std::string folder;    ///< of the one that is on, or else of the last; empty: none
  std::string message;   ///< about the last: how it went
  bool failed = false;   ///< one ended before its time or lost something
  bool closing = false;  ///< one that was stopped is still being written
  double seconds = 0.0;  ///< of the one that is on, or else of the last
  double bytes = 0.0;    ///< of the same, on the disk so far
};

/// A size in kB, MB or GB, as people read it.
std::string size_text(double bytes);

/// How a hand of a session does.
struct SessionHandState {
  std::string name;  ///< empty: it is the only one
  Placement placement;
  std::string trouble;  ///< of a session in real time, as ServoLoop::trouble
  Summary summary;
  std::array<std::uint64_t, safety_flag_count> interventions{};
  std::uint32_t latched_by = 0;  ///< SafetyFlag bits that hold the force off until `reset_faults`
};

/// How a session does: what a page or a program shows of it.
struct SessionState {
  ServoSettings settings;
  std::vector<CameraStatus> cameras;
  std::vector<SessionHandState> hands;  ///< one at least
  RecordingState recording;
  double rate = 0.0;  ///< [Hz]
  bool running = false;
  bool held = false;  ///< by Session::hold
};

/// Cameras, device, method, safety chain and recorder, wired together: a whole session as one
/// object. Prints nothing.
///
/// A session has one hand, or several, numbered from 0. Where a function asks for a hand's number
/// it throws std::out_of_range for one that is not there.
///
/// One way through, whatever the clock, the hand and the watcher: camera's thread → newest frame →
/// method → safety chain → device. Program, page and tests differ in their options alone.
///
/// Functions may be called by any thread but the servo's; `run`, `start` and `stop` by one.
class Session {
 public:
  static constexpr std::size_t most_hands = 8;

  /// Opens cameras and devices (`mouse:` without a place starts before what the first camera sees;
  /// `hand:` and `script:` without a file stroke it), waits for each camera's first frame, and
  /// makes the method.
  /// @throws Error if one of them cannot be used: a URI, a device, a method that cannot touch what
  ///         the cameras see, settings out of range, a force that needs a watchdog, a hand's name,
  ///         a fixture of a material that no camera knows.
  explicit Session(SessionOptions options);
  /// stop().
  ~Session();

  /// Real time: starts loop and cameras, and returns. A session runs once.
  /// @throws Error if the device refuses, or the session has been stopped.
  void start();
  /// Takes the force off all devices before anything else, then ends everything. A camera, a
  /// method, a driver or a disk that hangs is left behind: its thread ends when it returns, also
  /// after this has been destroyed, and the device stays disabled. Any number of times; while one
  /// call is at work another one disables the device at once.
  void stop() noexcept;

  /// Runs until `duration` [s] has passed (none: without end) or `request_stop`, then stops.
  /// Real time: starts what is not started. Free-running: runs the ticks on this thread.
  /// @param on_tick  free-running: sees each tick of the first hand
  /// @throws Error as `start`; free-running: what a source throws whose frame cannot be read. The
  ///         session is stopped then, too.
  void run(std::optional<double> duration,
           const std::function<void(const ServoTick&)>& on_tick = {});
  /// Free-running, in place of `run`: runs the ticks that are due up to a time, on this thread. For
  /// a caller that has a clock and no threads, such as a page.
  /// @param t  [s] since the session's begin. Where it is more than 0.1 s beyond the last tick, the
  ///           ticks between are left out.
  /// @throws Error as `run`, where a source's frame cannot be read.
  void advance(double t);
  /// Makes `run` return soon. Any thread, and a signal handler.
  void request_stop() noexcept { stop_requested_.store(true, std::memory_order_relaxed); }

  [[nodiscard]] std::size_t hands() const { return hands_.size(); }
  /// Empty for a first hand that is alone; hand_1 if it is not.
  [[nodiscard]] const std::string& hand_name(std::size_t hand) const {
    return hands_.at(hand)->name();
  }
  /// Sees every tick from the next one on; must not outlive the session.
  [[nodiscard]] TickRing<ServoTick>::Reader ticks(std::size_t hand = 0) const {
    return hands_.at(hand)->cycle().reader();
  }
  /// What each camera saw last; null before its first frame.
  [[nodiscard]] std::vector<std::shared_ptr<const Cloud>> newest_clouds() const;
  /// Counts what has happened so far; looks at no more than the last second of ticks.
  [[nodiscard]] SessionState state();

  [[nodiscard]] ServoSettings settings() const;
  /// Takes effect in the next tick. Another method is made and takes over where the proxy is.
  /// @throws Error, leaving everything as it was, if something does not validate, there is no such
  ///         method, it cannot touch what the cameras see, the force limit needs a watchdog, or a
  ///         fixture is of a material that no camera knows.
  void set(const ServoSettings& settings) {
    change([&](ServoSettings& now) { now = settings; });
  }
  /// As `set`, for what others may change meanwhile: `edit` gets the settings as they are, and
  /// nobody else's change comes between that and what it makes of them. It must not use the
  /// session.
  /// @throws Error as `set`, and what `edit` throws; everything is then as it was
  void change(const std::function<void(ServoSettings&)>& edit);
  /// Says where a hand's device lies in the scene; takes effect in the next tick, and the hand has
  /// to engage again.
  /// @throws Error, leaving everything as it was, if the placement is out of range.
  void place(std::size_t hand, const Placement& placement);
  /// How its recordings are played. The force goes to zero and ramps up again wherever time jumps.
  /// Free-running: on the thread of `advance`. @throws Error as CameraFeed::set_playback and seek.
  void set_playback(const Playback& playback);
  void seek(double share);
  /// Takes the force away, as fast as the safety chain's `fall_rate` says, and keeps it away while
  /// everything else continues. Afterwards the hand has to engage again, so the force comes up
  /// gradually.
  void hold(bool on);
  /// Ends latched faults of all hands' safety chains: an operator's decision.
  void reset_faults() noexcept;

  /// Begins to record into `folder`, which must not be there yet. @throws Error if it cannot be
  /// made, or a recording is on.
  void start_recording(const std::string& folder);
  /// Returns at once; state().recording says when all is written.
  void stop_recording();

  /// What is painted on the cameras' frames; see Paint.
  [[nodiscard]] Paint& paint() { return paint_; }

  [[nodiscard]] const Device& device(std::size_t hand = 0) const {
    return hands_.at(hand)->device();
  }
  /// The device that a page moves; null if there is none.
  [[nodiscard]] MouseDevice* mouse() const;
  [[nodiscard]] const MethodRegistry& methods() const { return options_.methods; }
  [[nodiscard]] const CycleStatistics& statistics(std::size_t hand = 0) const {
    return hands_.at(hand)->cycle().statistics();
  }
  /// Real time: of the hand's loop. Free-running: null.
  [[nodiscard]] const Timing* timing(std::size_t hand = 0) const;
  [[nodiscard]] const RealtimeReport* realtime(std::size_t hand = 0) const;

 private:
  using Recording = std::vector<std::unique_ptr<Recorder>>;

  void stop_loops() noexcept;
  [[nodiscard]] bool is_live() const { return options_.pace == Pace::real_time; }
  [[nodiscard]] bool needs_watchdog() const { return is_live() && !options_.without_watchdog; }
  void refuse_if_stopped() const;
  void leave_behind(std::unique_ptr<Recorder> recorder);
  [[nodiscard]] ServoSettings for_hardware(ServoSettings settings) const;
  [[nodiscard]] double now() const { return is_live() ? monotonic_now() : free_t_.load(); }
  void open_hands(const Cloud& seen);
  std::shared_ptr<const Cloud> open_camera(CameraSpec& camera, std::unique_ptr<Source> source);
  [[nodiscard]] std::shared_ptr<Method> open_method(
      const ServoSettings& settings, const std::vector<std::shared_ptr<const Cloud>>& seen) const;
  [[nodiscard]] ServoSettings settings_of(const SessionHand& hand, ServoSettings settings) const;
  void note(SessionHand& hand, const ServoCommands& told);
  void tell(const std::function<void(SessionHand&, ServoCommands&)>& edit,
            const ServoSettings* new_methods = nullptr);
  void change_scene(bool methods_begin_anew);
  void take(std::size_t camera, const FedFrame& fed);
  std::shared_ptr<const Cloud> with_materials(std::shared_ptr<const Cloud> cloud,
                                              std::size_t camera);
  [[nodiscard]] std::function<std::optional<Vec3>()> hand_place() const;
  void give(std::size_t camera, const FedFrame& fed);
  void begin_free();
  std::optional<ServoTick> run_tick(std::int64_t number);
  void wait_for_recorder();
  void drain();
  [[nodiscard]] bool is_recording() const { return hands_.front()->recorder != nullptr; }
  void open_recorder(const std::string& folder, bool is_on);
  [[nodiscard]] SessionInfo info_of(const SessionHand& hand) const;
  void end_recording();
  void report_closed();
  void report_closed(const std::vector<Recorder::Status>& parts);

  SessionOptions options_;
  Paint paint_;
  std::vector<SensorKind> sensors_;                 // of the cameras
  std::vector<std::unique_ptr<CameraFeed>> feeds_;  // in real time
  std::vector<Player> played_;                      // free-running
  // As many from the first thread on. Recorders are set and reset with control_ and frames_mutex_
  // held, and used with either.
  std::vector<std::unique_ptr<SessionHand>> hands_;
  std::atomic<double> free_t_{0.0};  // [s]
  std::function<std::optional<Vec3>()> free_hand_;
  std::int64_t next_tick_ = 0;  // of `advance`
  std::atomic<bool> started_{false};
  std::atomic<bool> stopped_{false};
  mutable std::mutex frames_mutex_;  // taken by the cameras' threads; never held for long
  std::vector<std::shared_ptr<const Cloud>> newest_;  // guarded by frames_mutex_
  std::vector<CameraFrame> stamps_;                   // of these; guarded by frames_mutex_
  std::array<std::string, Patch::max_views> materials_trouble_;  // guarded by frames_mutex_
  std::vector<std::uint64_t> numbers_;                           // guarded by frames_mutex_
  std::size_t frames_ = 0;                                       // guarded by frames_mutex_
  mutable std::mutex control_;  // settings and recordings; taken before frames_mutex_
  ServoSettings settings_;      // guarded by control_; the placement is the first hand's
  bool held_ = false;           // guarded by control_
  RecordingState recording_;    // guarded by control_
  double recording_since_ = 0;  // [s] on the session's clock; guarded by control_
  // Of each hand, the first hand's first.
  std::vector<Recording> closing_;  // guarded by control_
  std::atomic<double> proxy_radius_{ProxyParameters{}.r_c()};
  std::thread housekeeper_;
  EndSignal house_end_;
  std::atomic<bool> stop_requested_{false};
};

}  // namespace palpate
