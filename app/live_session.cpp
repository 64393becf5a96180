// SPDX-License-Identifier: Apache-2.0
#include "app/live_session.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spawn.h>
#include <unistd.h>

#include "app/program_methods.hpp"
#include "app/scripted_hand.hpp"
#include "app/summary.hpp"
#include "palpate/cloud/depth_image.hpp"
#include "palpate/cloud/point_cloud.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/uri.hpp"
#include "palpate/devices/devices.hpp"
#include "palpate/devices/mouse_device.hpp"
#include "palpate/methods/methods.hpp"
#include "palpate/record/recorder.hpp"
#include "palpate/servo/servo_loop.hpp"
#include "palpate/session/camera_feed.hpp"
#include "palpate/viewer/tick_batcher.hpp"

namespace palpate::app {
namespace {

using nlohmann::json;

constexpr double samples_per_second = 200.0;  // of the page's plots
constexpr double first_frame_timeout = 10.0;  // [s] for a live camera to start up

// Where a hand hovers at first: before the middle of what the camera sees.
Vec3 hover_place(const Cloud& cloud) {
  constexpr double hover = 0.05;  // [m]
  if (const auto* image = dynamic_cast<const DepthImage*>(&cloud)) {
    const Intrinsics& k = image->intrinsics();
    const Vec3 camera = image->world_from_camera().translation();
    // Outwards from the middle until something was measured.
    for (int ring = 0; ring < k.width / 2; ++ring) {
      for (const int side : {-1, 1}) {
        const auto point = image->deproject(k.width / 2 + side * ring, k.height / 2);
        if (point) return *point + hover * (camera - *point).normalized();
      }
    }
    return camera;
  }
  const auto* points = dynamic_cast<const PointCloud*>(&cloud);
  if (points == nullptr || points->size() == 0) return Vec3::Zero();
  Vec3 middle = Vec3::Zero();
  for (std::size_t i = 0; i < points->size(); ++i) middle += points->point(i);
  middle /= static_cast<double>(points->size());
  Vec3 nearest = points->point(0);
  for (std::size_t i = 1; i < points->size(); ++i) {
    const Vec3 point = points->point(i);
    if ((point - middle).squaredNorm() < (nearest - middle).squaredNorm()) nearest = point;
  }
  const Vec3 from = points->viewpoint().value_or(Vec3::Zero());
  const Vec3 away = from - nearest;
  return nearest + hover * (away.norm() > 1e-3 ? away.normalized() : Vec3::UnitZ());
}

// A mouse begins where a hand can hover, a scripted hand strokes what the camera sees.
std::unique_ptr<Device> open_hand(const std::string& text, const Cloud& seen) {
  const Uri uri(text);
  if (uri.scheme() == "mouse" && !uri.has("x") && !uri.has("y") && !uri.has("z")) {
    const Vec3 place = hover_place(seen);
    return open_device(fmt::format("{}{}x={}&y={}&z={}", text,
                                   text.find('?') == std::string::npos ? '?' : '&', place.x(),
                                   place.y(), place.z()));
  }
  std::optional<HipPath> path;
  constexpr double stroke_time = 20.0;  // [s]
  constexpr double press = 0.008;       // [m]
  if (const auto* image = dynamic_cast<const DepthImage*>(&seen); image && uri.path().empty())
    path = scripted_hand(*image, stroke_time, press);
  return open_device(text, path);
}

std::unique_ptr<ViewerServer> open_server(const LiveOptions& options, ViewerHost& host) {
  try {
    return std::make_unique<ViewerServer>(options.viewer, host);
  } catch (const Error&) {
    if (!options.any_port_will_do) throw;
    ViewerOptions viewer = options.viewer;
    viewer.port = 0;
    return std::make_unique<ViewerServer>(viewer, host);
  }
}

json row_json(std::string_view name, std::string_view symbol, std::string_view unit,
              double default_value, double min, double max, std::string_view meaning,
              std::string_view source) {
  return {{"name", name}, {"symbol", symbol}, {"unit", unit},       {"default", default_value},
          {"min", min},   {"max", max},       {"meaning", meaning}, {"source", source}};
}

// All that a session can run: `ideal`, the lab's ruler, needs the truth.
MethodRegistry session_methods() {
  const MethodRegistry all = program_methods();
  MethodRegistry methods("method", "", {});
  for (const MethodInfo& method : all.entries()) {
    if (method.name != "ideal") methods.add(method);
  }
  return methods;
}

std::string realtime_text(const RealtimeReport& report) {
  std::string text = report.fifo ? fmt::format("real-time, priority {}", report.priority)
                                 : "not real-time; see palpate doctor";
  if (report.core >= 0) text += fmt::format(", core {}", report.core);
  return text;
}

// Cameras, servo loop and page, wired together; alive from construction to destruction.
class LiveSession final : public ViewerHost {
 public:
  explicit LiveSession(const LiveOptions& options)
      : rate_(options.rate),
        device_uri_(options.device),
        batcher_(static_cast<unsigned>(std::max(1.0, options.rate / samples_per_second))) {
    std::vector<std::shared_ptr<const Cloud>> seen;
    for (const std::string& uri : options.cameras) {
      cameras_.push_back(std::make_unique<CameraFeed>(uri));
      const std::optional<Frame> first = cameras_.back()->first_frame(first_frame_timeout);
      if (!first)
        throw Error(uri, fmt::format("it has delivered no frame in {} s", first_frame_timeout),
                    "check the camera, its cable and its permissions");
      seen.push_back(first->cloud);
    }
    newest_.resize(cameras_.size());
    numbers_.resize(cameras_.size());
    device_ = open_hand(options.device, *seen.front());
    mouse_ = dynamic_cast<MouseDevice*>(device_.get());
    if (mouse_ != nullptr) target_ = start_ = mouse_->read(0.0).position;
    settings_.parameters = options.parameters;
    settings_.method = options.method;
    loop_ = std::make_unique<ServoLoop>(open_method(settings_, seen), *device_, settings_,
                                        ServoOptions{options.rate, {}});
    reader_.emplace(loop_->reader());
    if (!options.record.empty()) open_recorder(options.record, {});
    loop_->start();  // before anybody asks how it does
    server_ = open_server(options, *this);
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      cameras_[i]->start([this, i](const FedFrame& fed) { take(i, fed.frame, fed.is_new); });
    }
  }
  ~LiveSession() override { close(); }
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  // Ends all threads; the summary stays.
  void close() {
    if (loop_) loop_->stop();  // first of all the force
    for (const auto& camera : cameras_) camera->request_stop();
    for (const auto& camera : cameras_) camera->stop();
    if (!server_) return;
    server_.reset();
    stop_recording();
    for (const auto& recorder : closing_) recorder->stop();
    report_closed();
    ticks();  // the last ones
    summary_.set_late_ticks(loop_->timing().late_ticks.load());
  }

  [[nodiscard]] std::string url() const { return server_->url(); }
  [[nodiscard]] std::vector<std::string> advice() const { return loop_->realtime().advice; }
  /// After close().
  [[nodiscard]] const Summary& summary() const { return summary_; }
  /// After close(): has a recording ended before its time?
  [[nodiscard]] bool lost_recording() const { return lost_recording_; }

  std::string hello() override {
    json parameters = json::array();
    json safety = json::array();
    json methods = json::array();
    json flags = json::array();
    json safety_flags = json::array();
    for (const ParameterInfo& row : parameter_table())
      parameters.push_back(row_json(row.name, row.symbol, row.unit, row.default_value, row.min,
                                    row.max, row.meaning, row.source));
    for (const SafetyParameterInfo& row : safety_parameter_table())
      safety.push_back(
          row_json(row.name, "", row.unit, row.default_value, row.min, row.max, row.meaning, ""));
    for (const MethodInfo& row : methods_.entries())
      methods.push_back({{"name", row.name}, {"meaning", row.summary}});
    for (const TickFlagInfo& flag : tick_flag_table())
      flags.push_back({{"name", flag.name}, {"meaning", flag.meaning}});
    for (std::size_t i = 0; i < safety_flag_count; ++i)
      safety_flags.push_back(
          {{"name", safety_flag_names()[i]}, {"meaning", safety_flag_meanings()[i]}});
    return json{{"version", PALPATE_VERSION}, {"methods", methods}, {"parameters", parameters},
                {"safety", safety},           {"flags", flags},     {"safety_flags", safety_flags}}
        .dump();
  }

  std::string state() override {
    json parameters;
    json safety;
    json cameras = json::array();
    for (const ParameterInfo& row : parameter_table())
      parameters[std::string(row.name)] = row.get(settings_.parameters);
    for (const SafetyParameterInfo& row : safety_parameter_table())
      safety[std::string(row.name)] = settings_.safety.*row.member;
    for (const auto& camera : cameras_) {
      const CameraStatus status = camera->status();
      cameras.push_back({{"uri", status.uri},
                         {"kind", status.kind},
                         {"rate", status.rate},
                         {"state", status.text}});
    }
    const CycleStatistics& cycles = loop_->statistics();
    const Timing& timing = loop_->timing();
    const json servo = {{"rate", rate_},
                        {"realtime", realtime_text(loop_->realtime())},
                        {"ticks", cycles.ticks.load()},
                        {"late_ticks", timing.late_ticks.load()},
                        {"compute_p99", 1e-9 * static_cast<double>(timing.compute.quantile(0.99))},
                        {"wake_up_p99", 1e-9 * static_cast<double>(timing.wake_up.quantile(0.99))},
                        {"frames_adopted", cycles.frames_adopted.load()},
                        {"frames_dropped", cycles.frames_dropped.load()}};
    json interventions = json::array();
    for (const auto& count : cycles.interventions) interventions.push_back(count.load());
    return json{
        {"method", settings_.method},
        {"parameters", parameters},
        {"safety", safety},
        {"cameras", cameras},
        {"device",
         {{"uri", device_uri_}, {"kind", device_->info().kind}, {"takes_hand", mouse_ != nullptr}}},
        {"servo", servo},
        {"interventions", interventions},
        {"flag_ticks", flag_ticks_},
        {"pop_throughs", summary_.pop_throughs()},
        {"recording", recording_state()}}
        .dump(-1, ' ', false, json::error_handler_t::replace);
  }

  std::optional<TickBatch> ticks() override {
    std::vector<const Cloud*> seen;
    std::vector<std::shared_ptr<const Cloud>> newest;
    std::size_t frames = 0;
    {
      const std::lock_guard lock(mutex_);
      newest = newest_;
      frames = frames_;
    }
    for (const auto& cloud : newest) seen.push_back(cloud.get());
    const double r_c = settings_.parameters.proxy.r_c();
    ServoTick record{};
    bool any = false;
    const auto count = [&](bool look) {
      Tick tick = record.tick;
      tick.force = record.force;  // what the hand felt
      const auto behind = look ? least_behind(seen, tick.proxy, r_c) : std::nullopt;
      summary_.count(tick, frames, behind, r_c);
    };
    for (ServoTick next{}; reader_->try_pop(next); record = next) {
      if (std::exchange(any, true)) count(false);
      batcher_.add(next);
      for (std::size_t i = 0; i < flag_ticks_.size(); ++i)
        flag_ticks_[i] += (next.tick.flags >> i) & 1U;
    }
    if (any) count(true);
    return batcher_.take();
  }

  void hand(const std::optional<Vec3>& target) override {
    if (mouse_ == nullptr) return;
    if (target) target_ = *target;
    mouse_->aim({.position = target_, .present = target.has_value()});
  }

  void command(const Command& command) override {
    ServoSettings settings = settings_;
    if (const auto* set = std::get_if<SetParameter>(&command)) {
      set_parameter(settings.parameters, set->name, set->value);
    } else if (const auto* limit = std::get_if<SetSafetyParameter>(&command)) {
      set_parameter(settings.safety, limit->name, limit->value);
    } else if (const auto* method = std::get_if<SetMethod>(&command)) {
      settings.method = method->name;
    } else if (const auto* record = std::get_if<SetRecording>(&command)) {
      if (!record->on) stop_recording();
      if (record->on && !recorder_) start_recording();
      return;
    } else if (mouse_ != nullptr) {
      mouse_->aim({.position = target_ = start_, .present = false});
    }
    settings_number_ = settings.method == settings_.method
                           ? loop_->set_settings(settings)
                           : loop_->set_method(open_method(settings, newest()), settings);
    settings_ = settings;
    if (recorder_) recorder_->settings({settings_number_, settings_}, monotonic_now());
  }

 private:
  [[nodiscard]] std::vector<std::shared_ptr<const Cloud>> newest() {
    const std::lock_guard lock(mutex_);
    return newest_;
  }

  // The method of the settings, if it can touch what the cameras see.
  [[nodiscard]] std::shared_ptr<Method> open_method(
      const ServoSettings& settings, const std::vector<std::shared_ptr<const Cloud>>& seen) const {
    std::shared_ptr<Method> method = make_method(settings.method, settings.parameters, methods_);
    for (const auto& cloud : seen) {
      if (cloud) method->check(*cloud);
    }
    return method;
  }

  // A camera's thread: one frame to the loop and to the pages.
  void take(std::size_t camera, const Frame& frame, bool is_new) {
    {
      const std::lock_guard lock(mutex_);
      newest_[camera] = frame.cloud;
      std::vector<std::shared_ptr<const Cloud>> clouds;
      for (const auto& cloud : newest_) {
        if (cloud) clouds.push_back(cloud);
      }
      stamp_ = std::max(frame.stamp, stamp_ + 1e-6);  // of two cameras that are due at once
      frame_number_ = loop_->put_frame(
          clouds.size() == 1 ? clouds.front() : std::make_shared<CloudSet>(std::move(clouds)),
          stamp_);
      if (recorder_) recorder_->frame(frame_number_, stamp_, newest_);
      ++frames_;
    }
    if (is_new) show(static_cast<std::uint8_t>(camera), frame);
  }

  void show(std::uint8_t camera, const Frame& frame) {
    FrameHeader header;
    header.camera = camera;
    header.number = numbers_[camera]++;
    header.stamp = frame.stamp;
    if (const auto* image = dynamic_cast<const DepthImage*>(frame.cloud.get())) {
      const Intrinsics& k = image->intrinsics();
      header.width = static_cast<std::uint32_t>(k.width);
      header.height = static_cast<std::uint32_t>(k.height);
      header.fx = k.fx;
      header.fy = k.fy;
      header.cx = k.cx;
      header.cy = k.cy;
      header.metres_per_unit = 1.0 / image->units_per_metre();
      header.world_from_camera = image->world_from_camera();
      header.has_rays = k.distorted();
      if (header.has_rays && header.number == 0) describe(camera, image->rays());
      server_->show(camera, depth_message(header, image->depth(), frame.cloud));
    } else if (const auto* points = dynamic_cast<const PointCloud*>(frame.cloud.get())) {
      std::vector<float> xyz;
      xyz.reserve(3 * points->size());
      for (std::size_t i = 0; i < points->size(); ++i) {
        const Vec3 point = points->point(i);
        for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(point[axis]));
      }
      header.width = static_cast<std::uint32_t>(points->size());
      server_->show(camera, points_message(header, std::move(xyz)));
    }
  }

  void describe(std::uint8_t camera, const ViewingRays& rays) {
    const Intrinsics& k = rays.intrinsics();
    std::vector<float> xy;
    xy.reserve(2 * static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height));
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const Eigen::Vector2d ray = rays.ray(u, v);
        xy.push_back(static_cast<float>(ray.x()));
        xy.push_back(static_cast<float>(ray.y()));
      }
    }
    server_->describe(camera, rays_message(camera, static_cast<std::uint32_t>(k.width),
                                           static_cast<std::uint32_t>(k.height), std::move(xy)));
  }

  // The server's thread, or before it runs and after.
  void open_recorder(const std::string& folder, std::function<void()> renew) {
    using std::chrono::nanoseconds;
    SessionInfo info{.kind = SessionInfo::Kind::live, .version = PALPATE_VERSION};
    for (const auto& camera : cameras_) info.cameras.push_back(camera->status().uri);
    info.device = device_uri_;
    info.epoch =
        std::chrono::duration_cast<nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
            .count() -
        std::llround(1e9 * monotonic_now());
    auto recorder = std::make_unique<Recorder>(folder, info, loop_->reader(), std::move(renew));
    recorder->settings({settings_number_, settings_}, monotonic_now());
    const std::lock_guard lock(mutex_);
    // The loop's first tick of the recording uses this frame, or one that is yet to come.
    if (frame_number_ > 0) recorder->frame(frame_number_, stamp_, newest_);
    recorder_ = std::move(recorder);
  }

  void start_recording() {
    const std::time_t now = std::time(nullptr);
    std::tm local{};
    localtime_r(&now, &local);
    open_recorder(fmt::format("palpate_{:%Y-%m-%d_%H-%M-%S}", local), [this, settings = settings_] {
      const NumberedSettings anew = loop_->set_method(open_method(settings, newest()));
      const std::lock_guard lock(mutex_);
      if (recorder_) recorder_->settings(anew, monotonic_now());
    });
  }

  void stop_recording() {
    if (!recorder_) return;
    std::unique_ptr<Recorder> recorder;
    {
      const std::lock_guard lock(mutex_);
      recorder = std::move(recorder_);
    }
    // Closing takes as long as the disk does, and the hand must not wait for that.
    recorder->request_stop();
    recording_message_ = fmt::format("{}: closing", recorder->status().folder.string());
    closing_.push_back(std::move(recorder));
  }

  // Says how the recordings ended that are closed by now.
  void report_closed() {
    std::erase_if(closing_, [this](const std::unique_ptr<Recorder>& recorder) {
      const Recorder::Status status = recorder->status();
      if (status.done) report(status);
      return status.done;
    });
  }

  void report(const Recorder::Status& status) {
    const std::string folder = status.folder.string();
    if (!status.trouble.empty()) {
      lost_recording_ = true;
      recording_message_ = status.trouble;
      fmt::print(stderr, "palpate: the recording has stopped: {}\n", status.trouble);
    } else if (status.lost_ticks + status.lost_frames > 0) {
      lost_recording_ = true;
      recording_message_ = fmt::format("{}: the machine was too slow for {} ticks and {} frames",
                                       folder, status.lost_ticks, status.lost_frames);
      fmt::print(stderr, "palpate: {}\n", recording_message_);
    } else {
      recording_message_ =
          fmt::format("{}: {} ticks, {} frames", folder, status.ticks, status.frames);
    }
  }

  json recording_state() {
    if (recorder_ && !recorder_->status().trouble.empty()) stop_recording();
    report_closed();
    json state = {{"possible", true}, {"path", nullptr}, {"message", recording_message_}};
    if (recorder_) state["path"] = recorder_->status().folder.string();
    return state;
  }

  MethodRegistry methods_ = session_methods();
  double rate_;
  std::string device_uri_;
  std::vector<std::unique_ptr<CameraFeed>> cameras_;
  std::unique_ptr<Device> device_;
  MouseDevice* mouse_ = nullptr;  // device_, if the page moves it
  std::unique_ptr<ServoLoop> loop_;
  std::unique_ptr<ViewerServer> server_;

  // The cameras' threads.
  std::mutex mutex_;
  std::vector<std::shared_ptr<const Cloud>> newest_;  // guarded by mutex_
  double stamp_ = 0.0;                                // guarded by mutex_
  std::uint64_t frame_number_ = 0;                    // guarded by mutex_
  std::size_t frames_ = 0;                            // guarded by mutex_
  std::vector<std::uint32_t> numbers_;                // each camera's own

  // The server's thread, and after it has ended the main one.
  ServoSettings settings_;
  std::uint64_t settings_number_ = 0;  // as the loop counts them
  // Set and reset under mutex_, for the cameras' threads; before the loop, which it reads, is gone.
  std::unique_ptr<Recorder> recorder_;
  std::vector<std::unique_ptr<Recorder>> closing_;  // stopped, and still writing
  std::string recording_message_;
  bool lost_recording_ = false;
  Vec3 start_ = Vec3::Zero();   // [m] where the mouse's hand began
  Vec3 target_ = Vec3::Zero();  // [m] where it was sent last
  std::optional<TickRing<ServoTick>::Reader> reader_;
  TickBatcher batcher_;
  Summary summary_;
  std::array<std::uint64_t, tick_flag_count> flag_ticks_{};
};

// SIGINT and SIGTERM wait to be asked for, in all threads that begin from here on.
class Signals {
 public:
  Signals() {
    sigemptyset(&set_);
    sigaddset(&set_, SIGINT);
    sigaddset(&set_, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &set_, &before_);
  }
  ~Signals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

  /// Waits for one until `t` [s, monotonic_now()]. @return false if none came
  [[nodiscard]] bool wait_until(double t) const {
    for (;;) {
      const double left = std::min(t - monotonic_now(), 3600.0);
      if (left <= 0.0) return false;
      const auto seconds = static_cast<std::time_t>(left);
      const timespec timeout{seconds,
                             static_cast<long>(1e9 * (left - static_cast<double>(seconds)))};
      if (sigtimedwait(&set_, nullptr, &timeout) > 0) return true;
    }
  }

 private:
  sigset_t set_{}, before_{};
};

void show_in_browser(const std::string& url) {
  if (std::getenv("DISPLAY") == nullptr && std::getenv("WAYLAND_DISPLAY") == nullptr) return;
  std::string program = "xdg-open";
  std::string argument = url;
  std::array<char*, 3> arguments = {program.data(), argument.data(), nullptr};
  pid_t pid = 0;
  // Without a browser the person still has the address.
  static_cast<void>(
      posix_spawnp(&pid, program.c_str(), nullptr, nullptr, arguments.data(), environ));
}

}  // namespace

int run_live(const LiveOptions& options) {
  const Signals signals;
  LiveSession session(options);
  for (const std::string& line : session.advice()) fmt::print(stderr, "palpate: {}\n", line);
  if (!program_methods().find(options.method).bounded)
    fmt::print(stderr, "palpate: {} is a method of the lab: its ticks can come late\n",
               options.method);
  fmt::print(stderr, "palpate: open {} in a browser; Ctrl-C ends the session\n", session.url());
  if (options.open_browser && isatty(STDERR_FILENO) == 1) show_in_browser(session.url());
  const double end = options.duration ? monotonic_now() + *options.duration
                                      : std::numeric_limits<double>::infinity();
  static_cast<void>(signals.wait_until(end));
  session.close();
  std::fputs(options.json ? session.summary().json().c_str() : session.summary().text().c_str(),
             stdout);
  return session.lost_recording() ? 1 : 0;
}

}  // namespace palpate::app
