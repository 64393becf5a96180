// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/session.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <future>
#include <limits>
#include <mutex>
#include <thread>
#include <utility>

#include "palpate/cloud/depth_image.hpp"
#include "palpate/cloud/point_cloud.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/sensor.hpp"
#include "palpate/core/uri.hpp"
#include "palpate/devices/mouse_device.hpp"
#include "palpate/session/hand_paths.hpp"
#include "palpate/session/played_source.hpp"
#include "palpate/sources/posed_source.hpp"

namespace palpate {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr double first_frame_timeout = 10.0;  // [s] for a live camera to start up
constexpr double shortest_loop = 2.0;         // [s] of a recording; others stay on their last frame
constexpr double press = 0.008;               // [m] of the built-in path
constexpr auto housekeeping_interval = std::chrono::milliseconds(10);
constexpr auto stop_poll_interval = std::chrono::milliseconds(5);
constexpr double longest_watchdog = 0.5;              // [s] in which a hand reacts
constexpr double camera_join_time = 0.5;              // [s] for a camera's thread to end
constexpr std::int64_t ticks_between_flushes = 2000;  // of a free-running session's recording

std::string seconds_text(double seconds) {
  return std::to_string(static_cast<int>(seconds)) + " s";
}

std::function<std::unique_ptr<Source>()> opener(const SessionCamera& camera,
                                                const Registry<SourceScheme>& sources) {
  if (camera.world_from_camera && Uri(camera.uri).has("pose"))
    throw Error(camera.uri, "its pose is given twice, by ?pose= and by world_from_camera",
                "leave one of them out");
  return [uri = camera.uri, pose = camera.world_from_camera, sources] {
    std::unique_ptr<Source> source = open_source(uri, sources);
    return pose ? with_pose(std::move(source), *pose) : std::move(source);
  };
}

// A mouse starts where it can hover; a hand without a path strokes what the camera sees.
std::unique_ptr<Device> open_hand(const SessionOptions& options, const Cloud& seen) {
  const Uri uri(options.device_uri);
  if (uri.scheme() == "mouse" && !uri.has("x") && !uri.has("y") && !uri.has("z")) {
    const Vec3 place = hover_place(seen);
    std::string text = options.device_uri;
    char mark = text.find('?') == std::string::npos ? '?' : '&';
    for (int axis = 0; axis < 3; ++axis) {
      text += std::string(1, std::exchange(mark, '&')) + "xyz"[axis] + "=" +
              std::to_string(place[axis]);
    }
    return open_device(text, std::nullopt, options.devices);
  }
  std::optional<HipPath> path;
  const bool follows_path = uri.scheme() == "hand" || uri.scheme() == "script";
  if (const auto* image = dynamic_cast<const DepthImage*>(&seen);
      image != nullptr && follows_path && uri.path().empty()) {
    path = stroke_path(*image, options.stroke_time, press);
  }
  return open_device(options.device_uri, path, options.devices);
}

// A device with motors that nothing watches keeps its last force when this process is killed: no
// more than what a hand engages at, whatever the settings call that.
void refuse_without_watchdog(const DeviceInfo& device, const SafetyParameters& safety) {
  const bool watched =
      device.watchdog && *device.watchdog > 0.0 && *device.watchdog <= longest_watchdog;
  if (watched || device.simulated || !device.limits.motors) return;
  const double most = std::min(safety.engage_force, SafetyParameters{}.engage_force);
  const double limit = std::min(safety.max_force, device.limits.max_force);
  if (limit <= most) return;
  throw Error(device.uri,
              "a force of up to " + number_text(limit) + " N is allowed on it, but it states no " +
                  "watchdog of at most " + number_text(longest_watchdog) +
                  " s that takes the force away when the session is killed",
              "hold it by open_guarded, set max_device_force to " + number_text(most) +
                  " N, or allow it by without_watchdog");
}

}  // namespace

class Session::Impl {
 public:
  explicit Impl(SessionOptions options) : options_(std::move(options)) {
    if (options_.cameras.empty())
      throw Error("camera", "the session has none", "give one, such as synthetic:desk");
    if (options_.cameras.size() > Patch::max_views)
      throw Error("camera", std::to_string(options_.cameras.size()) + " cameras are too many",
                  "give at most " + std::to_string(Patch::max_views));
    if (!is_live() && !(options_.servo.rate >= 1.0 && options_.servo.rate <= 100'000.0))
      throw Error("servo rate", std::to_string(options_.servo.rate) + " Hz is out of range",
                  "give a rate from 1 to 100000 Hz");
    validate(options_.settings);
    newest_.resize(options_.cameras.size());
    stamps_.resize(options_.cameras.size());
    for (std::size_t i = 0; i < stamps_.size(); ++i) stamps_[i].camera = i;
    std::vector<std::shared_ptr<const Cloud>> first;
    for (SessionCamera& camera : options_.cameras) first.push_back(open_camera(camera));
    device_ = options_.device ? std::move(options_.device) : open_hand(options_, *first.front());
    if (needs_watchdog()) refuse_without_watchdog(device_->info(), options_.settings.safety);
    settings_ = for_cameras(options_.settings);
    proxy_radius_ = settings_.parameters.proxy.r_c();
    auto method = open_method(settings_, first);
    if (is_live()) {
      loop_ = std::make_unique<ServoLoop>(std::move(method), *device_, settings_, options_.servo);
      cycle_ = &loop_->cycle();
    } else {
      free_cycle_ = std::make_unique<Cycle>(std::move(method), *device_, settings_);
      cycle_ = free_cycle_.get();
    }
    ticks_.emplace(cycle_->reader());
    if (!options_.record.empty()) open_recorder(options_.record, false);
  }

  ~Impl() {
    stop();
    if (loop_ && !loop_->has_ended()) leave_behind();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void start() {
    refuse_if_stopped();
    if (started_) return;
    if (!is_live())
      throw Error("session", "a free-running session has no time of its own to start in",
                  "call run, or choose real time");
    loop_->start();
    started_ = true;
    for (std::size_t i = 0; i < feeds_.size(); ++i)
      feeds_[i]->start([this, i](const FedFrame& frame) { take(i, frame); });
    housekeeper_ = std::thread([this] { keep_house(); });
  }

  void stop() noexcept {
    if (stopped_.exchange(true)) {
      if (loop_) loop_->stop();
      return;
    }
    // Zero force leaves first: nothing above this line may wait for anything.
    if (loop_) loop_->stop();
    if (free_cycle_ && started_) device_->write(Vec3::Zero(), free_t_);
    device_->disable();
    for (const auto& feed : feeds_) feed->request_stop();
    {
      const std::lock_guard lock(house_mutex_);
      house_ends_ = true;
    }
    house_wakes_.notify_all();
    if (housekeeper_.joinable()) housekeeper_.join();
    for (const auto& feed : feeds_) static_cast<void>(feed->join(camera_join_time));
    {
      const std::lock_guard lock(control_);
      end_recording();
    }
    drain();
    const std::lock_guard lock(control_);
    for (auto& recorder : closing_) {
      if (!recorder->try_stop(options_.record_patience)) leave_behind(std::move(recorder));
    }
    std::erase(closing_, nullptr);
    report_closed();
  }

  void run(std::optional<double> duration, const std::function<void(const ServoTick&)>& on_tick,
           const std::atomic<bool>& stop_requested) {
    refuse_if_stopped();
    // Also where a source or the caller's function throws.
    struct End {
      Impl& session;
      ~End() { session.stop(); }
    } const end_of_run{*this};
    if (is_live()) {
      start();
      const double end = monotonic_now() + duration.value_or(1e18);
      while (!stop_requested.load(std::memory_order_relaxed) && monotonic_now() < end)
        std::this_thread::sleep_for(stop_poll_interval);
    } else {
      run_free(duration, on_tick, stop_requested);
    }
  }

  [[nodiscard]] std::vector<std::shared_ptr<const Cloud>> newest() const {
    const std::lock_guard lock(frames_mutex_);
    return newest_;
  }

  SessionState state() {
    drain();
    SessionState state;
    for (const auto& feed : feeds_) state.cameras.push_back(feed->status());
    for (const auto& played : played_) state.cameras.push_back(played->status());
    if (loop_) state.device = loop_->device_status();
    const CycleStatistics& statistics = cycle_->statistics();
    for (std::size_t i = 0; i < safety_flag_count; ++i)
      state.interventions[i] = statistics.interventions[i].load();
    state.latched_by = statistics.latched_by.load();
    state.rate = loop_ ? loop_->rate() : options_.servo.rate;
    state.running = started_ && !stopped_;
    {
      const std::lock_guard lock(summary_mutex_);
      state.summary = summary_;
    }
    if (loop_) state.summary.late_ticks = loop_->timing().late_ticks.load();
    {
      const std::lock_guard lock(frames_mutex_);
      state.summary.frames = frames_;
    }
    const std::lock_guard lock(control_);
    state.settings = settings_;
    state.held = held_;
    if (recorder_ && !recorder_->status().trouble.empty()) end_recording();
    report_closed();
    state.recording = recording_;
    state.recording.on = recorder_ != nullptr;
    state.recording.closing = !closing_.empty();
    if (recorder_) state.recording.folder = recorder_->status().folder.string();
    return state;
  }

  [[nodiscard]] ServoSettings settings() const {
    const std::lock_guard lock(control_);
    return settings_;
  }

  void change(const std::function<void(ServoSettings&)>& edit) {
    const std::lock_guard lock(control_);
    ServoSettings settings = settings_;
    edit(settings);
    if (needs_watchdog()) refuse_without_watchdog(device_->info(), settings.safety);
    settings = for_cameras(std::move(settings));
    settings.scene = settings_.scene;  // not for others to count
    const ServoSettings applied = as_held(settings);
    const std::uint64_t number = settings.method == settings_.method
                                     ? cycle_->set_settings(applied)
                                     : cycle_->set_method(open_method(settings, newest()), applied);
    settings_ = settings;
    settings_number_ = number;
    proxy_radius_ = settings.parameters.proxy.r_c();
    if (recorder_) recorder_->settings({number, applied}, now());
  }

  void hold(bool on) {
    const std::lock_guard lock(control_);
    if (held_ == on) return;
    held_ = on;
    if (!on) ++settings_.scene;  // the hand has to engage anew
    const ServoSettings applied = as_held(settings_);
    settings_number_ = cycle_->set_settings(applied);
    if (recorder_) recorder_->settings({settings_number_, applied}, now());
  }

  void set_playback(const Playback& playback) {
    for (const auto& feed : feeds_) feed->set_playback(playback);
  }

  void seek(double share) {
    for (const auto& feed : feeds_) feed->seek(share);
  }

  void start_recording(const std::string& folder) {
    const std::lock_guard lock(control_);
    if (recorder_)
      throw Error(folder, "a recording is on already", "stop it before another is begun");
    open_recorder(folder, cycle_->statistics().ticks > 0);
  }

  void stop_recording() {
    const std::lock_guard lock(control_);
    end_recording();
  }

  Paint& paint() { return paint_; }
  Cycle& cycle() { return *cycle_; }
  [[nodiscard]] const Cycle& cycle() const { return *cycle_; }
  [[nodiscard]] const Device& device() const { return *device_; }
  [[nodiscard]] MouseDevice* mouse() const { return dynamic_cast<MouseDevice*>(device_.get()); }
  [[nodiscard]] const MethodRegistry& methods() const { return options_.methods; }
  [[nodiscard]] const ServoLoop* loop() const { return loop_.get(); }

 private:
  [[nodiscard]] bool is_live() const { return options_.pace == Pace::real_time; }
  [[nodiscard]] bool needs_watchdog() const { return is_live() && !options_.without_watchdog; }
  void refuse_if_stopped() const {
    if (stopped_)
      throw Error("session", "it has been stopped and cannot go on", "make another session");
  }
  // The thread of a cycle that hangs uses loop and device until it returns.
  void leave_behind() {
    struct Left {
      std::unique_ptr<Device> device;
      std::unique_ptr<ServoLoop> loop;  // destroyed first
    };
    auto left = std::make_unique<Left>();
    left->device = std::move(device_);
    left->loop = std::move(loop_);
    std::thread([left = std::move(left)]() mutable { left.reset(); }).detach();
  }
  // With control_ held: a recorder whose disk hangs. Its threads use nothing of the session.
  void leave_behind(std::unique_ptr<Recorder> recorder) {
    const Recorder::Status status = recorder->status();
    const std::uint64_t ticks = status.ticks + status.ticks_waiting;
    recording_.failed = true;
    recording_.message = status.folder.string() +
                         ": the disk hangs: " + std::to_string(ticks - status.committed_ticks) +
                         " of " + std::to_string(ticks) + " ticks and " +
                         std::to_string(status.frames_waiting) +
                         " frames are not written; what was written before can be read";
    std::thread([left = std::move(recorder)]() mutable { left.reset(); }).detach();
  }
  // What is left to the cameras' kind is that of those that are open.
  [[nodiscard]] ServoSettings for_cameras(ServoSettings settings) const {
    settings.parameters = for_sensors(settings.parameters, sensors_);
    return settings;
  }
  // [s] on the session's clock
  [[nodiscard]] double now() const { return is_live() ? monotonic_now() : free_t_.load(); }

  std::shared_ptr<const Cloud> open_camera(SessionCamera& camera) {
    std::unique_ptr<Source> source = std::move(camera.source);
    std::function<std::unique_ptr<Source>()> open;
    if (source) {
      if (camera.uri.empty()) camera.uri = source->info().uri;
      if (camera.world_from_camera)
        source = with_pose(std::move(source), *camera.world_from_camera);
    } else {
      open = opener(camera, options_.sources);
      source = open();
    }
    sensors_.push_back(source->info().sensor);
    if (!is_live()) {
      if (!open)
        open = [uri = camera.uri]() -> std::unique_ptr<Source> {
          throw Error(uri, "it has ended and cannot be opened again", "run a shorter session");
        };
      played_.push_back(std::make_unique<PlayedSource>(std::move(source), open));
      return played_.back()->first_frame().cloud;
    }
    feeds_.push_back(std::make_unique<CameraFeed>(
        std::move(source), FeedOptions{.schemes = options_.sources}, std::move(open)));
    const SourceInfo& info = feeds_.back()->info();
    if (info.frames &&
        static_cast<double>(*info.frames) < shortest_loop * info.frame_rate.value_or(30.0))
      feeds_.back()->set_playback({.loop = false});
    const std::optional<Frame> first = feeds_.back()->first_frame(first_frame_timeout);
    if (!first)
      throw Error(camera.uri, "it has delivered no frame in " + seconds_text(first_frame_timeout),
                  "check the camera, its cable and its permissions");
    return first->cloud;
  }

  [[nodiscard]] std::shared_ptr<Method> open_method(
      const ServoSettings& settings, const std::vector<std::shared_ptr<const Cloud>>& seen) const {
    std::shared_ptr<Method> method =
        make_method(settings.method, settings.parameters, options_.methods);
    for (const auto& cloud : seen) {
      if (cloud) method->check(*cloud);
    }
    return method;
  }

  // What the cycle gets, for these settings of the user's: no force while it is held back.
  [[nodiscard]] ServoSettings as_held(ServoSettings settings) const {
    if (held_) settings.safety.max_force = 0.0;
    return settings;
  }

  // What is seen jumps. Before the frame after the jump the hand is disengaged; after it a method
  // takes over that remembers nothing of before, on the free side of what is seen now.
  void disengage(bool method_begins_anew) {
    const std::lock_guard lock(control_);
    ++settings_.scene;
    const ServoSettings applied = as_held(settings_);
    if (method_begins_anew) {
      settings_number_ = cycle_->set_method(open_method(settings_, newest()), applied);
    } else {
      settings_number_ = cycle_->set_settings(applied);
    }
    if (recorder_) recorder_->settings({settings_number_, applied}, now());
  }

  // A camera's thread, or the free-running one: a frame to all who want it.
  void take(std::size_t camera, const FedFrame& fed) {
    if (fed.after_jump) disengage(false);
    give(camera, fed);
    if (fed.after_jump) disengage(true);
    if (options_.on_frame) options_.on_frame(camera, fed);
  }

  // To the method and the recorder.
  void give(std::size_t camera, const FedFrame& fed) {
    std::shared_ptr<const Cloud> painted = paint_.on(fed.frame.cloud, camera);
    const std::lock_guard lock(frames_mutex_);
    newest_[camera] = std::move(painted);
    stamps_[camera].stamp = fed.frame.stamp;
    std::vector<std::shared_ptr<const Cloud>> clouds;
    for (const auto& cloud : newest_) {
      if (cloud) clouds.push_back(cloud);
    }
    stamp_ = std::max(fed.frame.stamp, stamp_ + 1e-6);  // of two cameras in the wrong order
    frame_number_ = cycle_->put_frame(
        clouds.size() == 1 ? clouds.front() : std::make_shared<CloudSet>(std::move(clouds)), stamp_,
        stamps_, now());
    if (recorder_) recorder_->frame(frame_number_, stamp_, newest_);
    ++frames_;
  }

  void run_free(std::optional<double> duration,
                const std::function<void(const ServoTick&)>& on_tick,
                const std::atomic<bool>& stop_requested) {
    device_->enable();
    started_ = true;
    const auto ticks = static_cast<std::int64_t>(duration.value_or(1e9) * options_.servo.rate);
    TickRing<ServoTick>::Reader reader = cycle_->reader();
    for (std::int64_t i = 0; i < ticks && !stop_requested.load(std::memory_order_relaxed); ++i) {
      const double t = static_cast<double>(i) / options_.servo.rate;
      free_t_ = t;
      for (std::size_t camera = 0; camera < played_.size(); ++camera) {
        while (const auto frame = played_[camera]->next_until(t)) take(camera, *frame);
      }
      cycle_->run({.t = t});
      if (ServoTick record{}; on_tick && reader.try_pop(record)) on_tick(record);
      drain();
      if (i % ticks_between_flushes == 0) wait_for_recorder();
    }
  }

  // The clock waits for the disk here, as it runs faster than time.
  void wait_for_recorder() {
    const std::lock_guard lock(control_);
    if (recorder_) recorder_->flush();
  }

  void keep_house() {
    std::unique_lock lock(house_mutex_);
    while (!house_wakes_.wait_for(lock, housekeeping_interval, [this] { return house_ends_; })) {
      lock.unlock();
      drain();
      lock.lock();
    }
  }

  // Counts the ticks that came since the last time; of the newest one, whether its proxy is behind
  // what the cameras see.
  void drain() {
    const std::lock_guard lock(summary_mutex_);
    const double r_c = proxy_radius_.load(std::memory_order_relaxed);
    ServoTick record{};
    bool any = false;
    for (ServoTick next{}; ticks_->try_pop(next); record = next) {
      if (any) summary_.count(record, std::nullopt, r_c);
      any = true;
    }
    if (any) summary_.count(record, least_behind(newest(), record.tick.proxy, r_c), r_c);
  }

  // With control_ held, or before anything runs.
  void open_recorder(const std::string& folder, bool is_on) {
    using std::chrono::nanoseconds;
    using std::chrono::system_clock;
    SessionInfo info{.kind = SessionInfo::Kind::live, .version = options_.version};
    for (const SessionCamera& camera : options_.cameras) info.cameras.push_back(camera.uri);
    info.device = device_->info().uri;
    info.limits = device_->info().limits;
    info.epoch =
        std::chrono::duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count() -
        std::llround(1e9 * now());
    std::function<void()> begin_anew;
    auto opened = std::make_shared<std::promise<Recorder*>>();
    if (is_on) {
      // On the recorder's thread, once: the recording begins with a method that remembers nothing.
      begin_anew = [this, opened, settings = settings_] {
        Recorder* recorder = opened->get_future().get();
        recorder->settings(cycle_->set_method(open_method(settings, newest())), now());
      };
    }
    auto recorder =
        std::make_unique<Recorder>(folder, info, cycle_->full_reader(), std::move(begin_anew));
    recorder->settings({settings_number_, as_held(settings_)}, now());
    {
      const std::lock_guard lock(frames_mutex_);
      // The first tick of the recording uses this frame, or one that is yet to come.
      if (frame_number_ > 0) recorder->frame(frame_number_, stamp_, newest_);
      recorder_ = std::move(recorder);
    }
    opened->set_value(recorder_.get());
    recording_.folder = folder;
  }

  // With control_ held. Closing takes as long as the disk does, and nobody waits for that.
  void end_recording() {
    if (!recorder_) return;
    std::unique_ptr<Recorder> recorder;
    {
      const std::lock_guard lock(frames_mutex_);
      recorder = std::move(recorder_);
    }
    recorder->request_stop();
    recording_.message = recorder->status().folder.string() + ": closing";
    closing_.push_back(std::move(recorder));
  }

  // With control_ held: how the recordings ended that are closed by now.
  void report_closed() {
    std::erase_if(closing_, [this](const std::unique_ptr<Recorder>& recorder) {
      const Recorder::Status status = recorder->status();
      if (!status.done) return false;
      const std::string folder = status.folder.string();
      const auto counts = [](std::uint64_t ticks, std::uint64_t frames) {
        return std::to_string(ticks) + " ticks, " + std::to_string(frames) + " frames";
      };
      if (!status.trouble.empty()) {
        recording_.failed = true;
        recording_.message = "the recording has stopped: " + status.trouble;
      } else if (status.lost_ticks + status.lost_frames > 0) {
        recording_.failed = true;
        recording_.message = folder + ": the machine was too slow for " +
                             counts(status.lost_ticks, status.lost_frames);
      } else {
        recording_.message = folder + ": " + counts(status.ticks, status.frames);
      }
      return true;
    });
  }

  SessionOptions options_;
  Paint paint_;
  std::vector<SensorKind> sensors_;                    // of the cameras
  std::vector<std::unique_ptr<CameraFeed>> feeds_;     // in real time
  std::vector<std::unique_ptr<PlayedSource>> played_;  // free-running
  std::unique_ptr<Device> device_;
  std::unique_ptr<ServoLoop> loop_;    // in real time
  std::unique_ptr<Cycle> free_cycle_;  // free-running
  Cycle* cycle_ = nullptr;             // of one of these
  std::atomic<double> free_t_{0.0};    // [s]
  std::atomic<bool> started_{false};
  std::atomic<bool> stopped_{false};

  mutable std::mutex frames_mutex_;  // taken by the cameras' threads; never held for long
  std::vector<std::shared_ptr<const Cloud>> newest_;         // guarded by frames_mutex_
  std::vector<CameraFrame> stamps_;                          // guarded by frames_mutex_
  double stamp_ = -std::numeric_limits<double>::infinity();  // guarded by frames_mutex_
  std::uint64_t frame_number_ = 0;                           // guarded by frames_mutex_
  std::size_t frames_ = 0;                                   // guarded by frames_mutex_
  // Set and reset with both mutexes held; used with either.
  std::unique_ptr<Recorder> recorder_;

  mutable std::mutex control_;         // settings and recordings; taken before frames_mutex_
  ServoSettings settings_;             // guarded by control_
  std::uint64_t settings_number_ = 0;  // guarded by control_
  bool held_ = false;                  // guarded by control_
  RecordingState recording_;           // guarded by control_
  std::vector<std::unique_ptr<Recorder>> closing_;  // guarded by control_
  std::atomic<double> proxy_radius_{ProxyParameters{}.r_c()};

  std::mutex summary_mutex_;                          // taken before frames_mutex_
  std::optional<TickRing<ServoTick>::Reader> ticks_;  // guarded by summary_mutex_
  Summary summary_;                                   // guarded by summary_mutex_

  std::thread housekeeper_;
  std::mutex house_mutex_;
  std::condition_variable house_wakes_;
  bool house_ends_ = false;  // guarded by house_mutex_
};

Session::Session(SessionOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}

Session::~Session() = default;

void Session::start() {
  impl_->start();
}

void Session::stop() noexcept {
  impl_->stop();
}

void Session::run(std::optional<double> duration,
                  const std::function<void(const ServoTick&)>& on_tick) {
  impl_->run(duration, on_tick, stop_requested_);
}

TickRing<ServoTick>::Reader Session::ticks() const {
  return impl_->cycle().reader();
}

std::vector<std::shared_ptr<const Cloud>> Session::newest_clouds() const {
  return impl_->newest();
}

SessionState Session::state() {
  return impl_->state();
}

ServoSettings Session::settings() const {
  return impl_->settings();
}

void Session::set(const ServoSettings& settings) {
  impl_->change([&](ServoSettings& now) { now = settings; });
}

void Session::change(const std::function<void(ServoSettings&)>& edit) {
  impl_->change(edit);
}

void Session::set_playback(const Playback& playback) {
  impl_->set_playback(playback);
}

void Session::seek(double share) {
  impl_->seek(share);
}

void Session::hold(bool on) {
  impl_->hold(on);
}

void Session::reset_faults() noexcept {
  impl_->cycle().reset_faults();
}

void Session::start_recording(const std::string& folder) {
  impl_->start_recording(folder);
}

void Session::stop_recording() {
  impl_->stop_recording();
}

Paint& Session::paint() {
  return impl_->paint();
}

const Device& Session::device() const {
  return impl_->device();
}

MouseDevice* Session::mouse() const {
  return impl_->mouse();
}

const MethodRegistry& Session::methods() const {
  return impl_->methods();
}

const CycleStatistics& Session::statistics() const {
  return impl_->cycle().statistics();
}

const Timing* Session::timing() const {
  return impl_->loop() == nullptr ? nullptr : &impl_->loop()->timing();
}

const RealtimeReport* Session::realtime() const {
  return impl_->loop() == nullptr ? nullptr : &impl_->loop()->realtime();
}

}  // namespace palpate
