// SPDX-License-Identifier: Apache-2.0
#include "palpate/session/session.hpp"

#include <algorithm>
#include <chrono>
#include <future>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/io/sources/tool_file.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/cloud/proposed_view.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/sensor.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/servo/stiffness.hpp"
#include "palpate/session/player.hpp"
#include "palpate/session/press.hpp"

namespace palpate {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr double first_frame_timeout = 10.0;  // [s] for a live camera to start up
constexpr double press = 0.008;               // [m] of the built-in path
constexpr auto housekeeping_interval = std::chrono::milliseconds(10);
constexpr auto stop_poll_interval = std::chrono::milliseconds(5);
constexpr double longest_watchdog = 0.5;             // [s] in which a hand reacts
constexpr double camera_join_time = 0.5;             // [s] for a camera's thread to end
constexpr std::int64_t ticks_between_flushes = 500;  // of a free-running session's recording
constexpr double longest_catch_up = 0.1;             // [s] of ticks that are late, in `advance`

std::function<std::unique_ptr<Source>()> opener(const CameraSpec& camera,
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
std::unique_ptr<Device> open_hand(const SessionOptions& options, const std::string& device_uri,
                                  const Cloud& seen) {
  const Uri uri(device_uri);
  if (uri.scheme() == "mouse" && !uri.has("x") && !uri.has("y") && !uri.has("z")) {
    const Vec3 place = hover_place(seen);
    std::string text = device_uri;
    char mark = text.find('?') == std::string::npos ? '?' : '&';
    for (int axis = 0; axis < 3; ++axis) {
      text += std::string(1, std::exchange(mark, '&')) + "xyz"[axis] + "=" +
              std::to_string(place[axis]);
    }
    return open_device(text, std::nullopt, options.devices);
  }
  std::optional<HipPath> path;
  const bool follows_path = uri.scheme() == "hand" || uri.scheme() == "script";
  if (follows_path && uri.path().empty()) {
    const PointCloud* points = seen.point_cloud();
    if (const DepthImage* image = seen.image())
      path = stroke_path(*image, options.stroke_time, press);
    else if (points != nullptr && points->size() > 0)
      path = stroke_path(SeenPoints(proposed_view(*points), *points).image(), options.stroke_time,
                         press);
  }
  return open_device(device_uri, path, options.devices);
}

// A fixture of a material that nothing is made of would keep nobody off anything.
void check_materials(const FixtureSet* fixtures,
                     std::span<const std::shared_ptr<const Cloud>> seen) {
  if (fixtures == nullptr) return;
  for (const FixtureSet::Item& item : fixtures->items()) {
    const std::string& wanted = item.fixture.material;
    if (wanted.empty()) continue;
    std::set<std::string> known;  // to cameras, and to brushes
    for (const auto& cloud : seen) {
      if (!cloud) continue;
      for (std::string& name : Paint::names(*cloud)) known.insert(std::move(name));
    }
    if (known.contains(wanted)) continue;
    std::string all;
    for (const std::string& name : known) all += (all.empty() ? "" : ", ") + name;
    throw Error("fixture '" + item.fixture.name + "'",
                "no camera knows a material '" + wanted + "'", "give one of " + all);
  }
}

void check_name(const std::string& name, std::span<const std::unique_ptr<SessionHand>> before) {
  const auto fits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
  };
  constexpr std::size_t longest = 40;
  const bool begins = !name.empty() && name.front() >= 'a' && name.front() <= 'z';
  if (!begins || name.size() > longest || !std::all_of(name.begin(), name.end(), fits))
    throw Error("hand '" + name + "'", "the name is not valid",
                "use small letters, digits and _, beginning with a letter, at most 40 in all");
  for (const auto& hand : before) {
    if (hand->name() == name)
      throw Error("hand '" + name + "'", "two hands have this name", "name each of them");
  }
}

// A device with motors that nothing watches keeps its last force when this process is killed: no
// more than what a hand engages at, whatever the settings call that.
// Hazard: unwatched-motors
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

Session::Session(SessionOptions options) : options_(std::move(options)) {
  options_.cameras.resize(std::max(options_.cameras.size(), options_.open_cameras.size()));
  options_.open_cameras.resize(options_.cameras.size());
  if (options_.cameras.empty())
    throw Error("camera", "the session has none", "give one, such as synthetic:desk");
  if (options_.cameras.size() > Patch::max_views)
    throw Error("camera", std::to_string(options_.cameras.size()) + " cameras are too many",
                "give at most " + std::to_string(Patch::max_views));
  if (!is_live()) check_range("servo rate", "", "Hz", 1.0, 100'000.0, options_.rate);
  settings_ = {.method = options_.method,
               .parameters = options_.parameters,
               .safety = options_.safety,
               .placement = options_.hands.empty() ? Placement() : options_.hands[0].placement,
               .fixtures = options_.fixture_set};
  if (!settings_.fixtures && !options_.fixtures.empty())
    settings_.fixtures = std::make_shared<const FixtureSet>(read_fixtures(options_.fixtures));
  if (!options_.tool.empty()) settings_.tool = read_tool(options_.tool);
  validate(settings_);
  newest_.resize(options_.cameras.size());
  stamps_.resize(options_.cameras.size());
  numbers_.resize(options_.cameras.size());
  for (std::size_t i = 0; i < stamps_.size(); ++i) stamps_[i].camera = i;
  std::vector<std::shared_ptr<const Cloud>> first;
  for (std::size_t i = 0; i < options_.cameras.size(); ++i)
    first.push_back(
        with_materials(open_camera(options_.cameras[i], std::move(options_.open_cameras[i])), i));
  open_hands(*first.front());
  for (const auto& hand : hands_) {
    if (needs_watchdog()) refuse_without_watchdog(hand->device().info(), settings_.safety);
  }
  settings_ = for_hardware(std::move(settings_));
  if (!options_.radii_chosen) {
    std::vector<const Cloud*> seen;
    for (const auto& cloud : first) seen.push_back(cloud.get());
    settings_.parameters = for_points(settings_.parameters, seen);
  }
  check_materials(settings_.fixtures.get(), first);
  proxy_radius_ = settings_.parameters.proxy.r_c();
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    ServoOptions servo{.rate = options_.rate, .realtime = options_.realtime};
    servo.realtime.core += static_cast<unsigned>(i);
    hands_[i]->begin(open_method(settings_, first), settings_of(*hands_[i], settings_),
                     is_live() ? std::optional(servo) : std::nullopt);
  }
  for (const auto& hand : hands_) hand->link(hands_);
  if (!options_.record.empty()) open_recorder(options_.record, false);
}

Session::~Session() { stop(); }

void Session::start() {
  refuse_if_stopped();
  if (started_) return;
  if (!is_live())
    throw Error("session", "a free-running session cannot be started in real time",
                "call run, or choose real time");
  try {
    for (const auto& hand : hands_) hand->loop()->start();
  } catch (...) {
    stop_loops();  // of those that have begun
    throw;
  }
  started_ = true;
  for (std::size_t i = 0; i < feeds_.size(); ++i)
    feeds_[i]->start([this, i](const FedFrame& frame) { take(i, frame); }, hand_place());
  housekeeper_ = std::thread([this] {
    while (!house_end_.rest(housekeeping_interval)) drain();
  });
}

void Session::stop() noexcept {
  if (stopped_.exchange(true)) {
    for (const auto& hand : hands_) {
      if (hand->loop() != nullptr && !hand->loop()->has_ended()) hand->device().disable();
    }
    return;
  }
  // Zero force leaves first: nothing above this line may wait for anything.
  stop_loops();
  for (const auto& feed : feeds_) feed->request_stop();
  house_end_.give();
  if (housekeeper_.joinable()) housekeeper_.join();
  for (const auto& feed : feeds_) static_cast<void>(feed->join(camera_join_time));
  {
    const std::lock_guard lock(control_);
    end_recording();
  }
  drain();
  const std::lock_guard lock(control_);
  for (auto& recording : closing_) {
    for (auto& recorder : recording) {
      if (!recorder->try_stop(options_.record_patience)) leave_behind(std::move(recorder));
    }
    std::erase(recording, nullptr);
  }
  report_closed();
}

// Every hand is let go before any is waited for.
void Session::stop_loops() noexcept {
  for (const auto& hand : hands_) {
    if (hand->loop() != nullptr) hand->loop()->request_stop();
    if (!is_live() && started_) LastGate::write_zero(hand->device(), free_t_);
  }
  for (const auto& hand : hands_) {
    if (hand->loop() != nullptr) hand->loop()->stop();
    hand->device().disable();
  }
}

void Session::run(std::optional<double> duration,
                  const std::function<void(const ServoTick&)>& on_tick) {
  refuse_if_stopped();
  // Also where a source or the caller's function throws.
  struct End {
    Session& session;
    ~End() { session.stop(); }
  } const end_of_run{*this};
  if (is_live()) {
    start();
    const double end = monotonic_now() + duration.value_or(1e18);
    while (!stop_requested_.load(std::memory_order_relaxed) && monotonic_now() < end)
      std::this_thread::sleep_for(stop_poll_interval);
    return;
  }
  begin_free();
  const auto ticks = static_cast<std::int64_t>(duration.value_or(1e9) * options_.rate);
  for (std::int64_t i = 0; i < ticks && !stop_requested_.load(std::memory_order_relaxed); ++i) {
    const std::optional<ServoTick> first = run_tick(i);
    if (on_tick && first) on_tick(*first);
    drain();
    if (i % ticks_between_flushes == 0) wait_for_recorder();
  }
}

void Session::advance(double t) {
  refuse_if_stopped();
  if (!started_) begin_free();
  const auto due = static_cast<std::int64_t>(t * options_.rate);
  const auto most = static_cast<std::int64_t>(longest_catch_up * options_.rate);
  for (next_tick_ = std::max(next_tick_, due - most); next_tick_ <= due; ++next_tick_)
    run_tick(next_tick_);
  drain();
  wait_for_recorder();
}

std::vector<std::shared_ptr<const Cloud>> Session::newest_clouds() const {
  const std::lock_guard lock(frames_mutex_);
  return newest_;
}

SessionState Session::state() {
  drain();
  SessionState state;
  for (const auto& feed : feeds_) state.cameras.push_back(feed->status());
  for (const Player& played : played_) state.cameras.push_back(played.status());
  for (const auto& hand : hands_) {
    SessionHandState& told = state.hands.emplace_back();
    told.name = hand->name();
    if (hand->loop() != nullptr) told.trouble = hand->loop()->trouble();
    const CycleStatistics& statistics = hand->cycle().statistics();
    for (std::size_t i = 0; i < safety_flag_count; ++i)
      told.interventions[i] = statistics.interventions[i].load();
    told.latched_by = statistics.latched_by.load();
    told.summary = hand->summary();
  }
  const ServoLoop* loop = hands_.front()->loop();
  state.rate = loop != nullptr ? loop->rate() : options_.rate;
  state.running = started_ && !stopped_;
  {
    const std::lock_guard lock(frames_mutex_);
    for (SessionHandState& hand : state.hands) hand.summary.frames = frames_;
    for (std::size_t i = 0; i < state.cameras.size(); ++i) {
      std::string& doubt = state.cameras[i].doubt;
      const std::string& trouble = materials_trouble_[i];
      if (!trouble.empty()) doubt += (doubt.empty() ? "" : "; ") + trouble;
    }
  }
  const std::lock_guard lock(control_);
  state.settings = settings_;
  state.held = held_;
  for (std::size_t i = 0; i < hands_.size(); ++i) state.hands[i].placement = hands_[i]->placement;
  if (is_recording() && std::any_of(hands_.begin(), hands_.end(), [](const auto& hand) {
        return !hand->recorder->status().trouble.empty();
      }))
    end_recording();
  report_closed();
  state.recording = recording_;
  state.recording.on = is_recording();
  state.recording.closing = !closing_.empty();
  if (is_recording()) {
    state.recording.folder = hands_.front()->recorder->status().folder.string();
    state.recording.seconds = now() - recording_since_;
    state.recording.bytes = 0.0;
    for (const auto& hand : hands_)
      state.recording.bytes += static_cast<double>(hand->recorder->status().bytes);
  }
  return state;
}

ServoSettings Session::settings() const {
  const std::lock_guard lock(control_);
  return settings_;
}

void Session::change(const std::function<void(ServoSettings&)>& edit) {
  const std::lock_guard lock(control_);
  ServoSettings settings = settings_;
  edit(settings);
  for (const auto& hand : hands_) {
    if (needs_watchdog()) refuse_without_watchdog(hand->device().info(), settings.safety);
  }
  settings = for_hardware(std::move(settings));
  if (settings.fixtures != settings_.fixtures)
    check_materials(settings.fixtures.get(), newest_clouds());
  const bool with_new_methods =
      settings.method != settings_.method || settings.tool != settings_.tool;
  tell([&](SessionHand& hand, ServoCommands& told) { told.settings = settings_of(hand, settings); },
       with_new_methods ? &settings : nullptr);
  hands_.front()->placement = settings.placement;
  settings_ = settings;
  proxy_radius_ = settings.parameters.proxy.r_c();
}

void Session::place(std::size_t number, const Placement& placement) {
  const std::lock_guard lock(control_);
  SessionHand& hand = *hands_.at(number);
  note(hand,
       hand.cycle().command([&](ServoCommands& told) { told.settings.placement = placement; }));
  hand.placement = placement;
  if (number == 0) settings_.placement = placement;
}

void Session::hold(bool on) {
  const std::lock_guard lock(control_);
  if (held_ == on) return;
  held_ = on;
  tell([&](SessionHand& /*hand*/, ServoCommands& told) { told.hold = on; });
}

void Session::set_playback(const Playback& playback) {
  for (const auto& feed : feeds_) feed->set_playback(playback);
  for (Player& played : played_) played.set_playback(playback, now());
}

void Session::seek(double share) {
  for (const auto& feed : feeds_) feed->seek(share);
  for (Player& played : played_) played.seek(share);
}

void Session::start_recording(const std::string& folder) {
  const std::lock_guard lock(control_);
  if (is_recording())
    throw Error(folder, "a recording is on already", "stop it before another is begun");
  open_recorder(folder, hands_.front()->cycle().statistics().ticks > 0);
}

void Session::stop_recording() {
  const std::lock_guard lock(control_);
  end_recording();
}

void Session::reset_faults() noexcept {
  for (const auto& hand : hands_) hand->cycle().reset_faults();
}

MouseDevice* Session::mouse() const {
  for (const auto& hand : hands_) {
    if (hand->mouse() != nullptr) return hand->mouse();
  }
  return nullptr;
}

void Session::refuse_if_stopped() const {
  if (stopped_)
    throw Error("session", "it has been stopped and cannot go on", "make another session");
}

// With control_ held: a recorder whose disk hangs. Its threads use nothing of the session.
void Session::leave_behind(std::unique_ptr<Recorder> recorder) {
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

// What is left to cameras and devices is that of those that are open.
ServoSettings Session::for_hardware(ServoSettings settings) const {
  settings.parameters = for_sensors(settings.parameters, sensors_);
  for (const auto& hand : hands_)
    set_turn_stiffness(hand->device().info().limits, settings.parameters.coupling);
  return settings;
}

void Session::open_hands(const Cloud& seen) {
  std::vector<HandSpec>& hands = options_.hands;
  hands.resize(std::max({hands.size(), options_.open_devices.size(), std::size_t{1}}));
  options_.open_devices.resize(hands.size());
  if (hands.size() > most_hands)
    throw Error("hands", std::to_string(hands.size()) + " are too many",
                "give at most " + std::to_string(most_hands));
  const bool alone = hands.size() == 1;
  for (std::size_t i = 0; i < hands.size(); ++i) {
    HandSpec& hand = hands[i];
    if (hand.name.empty() && !alone) hand.name = "hand_" + std::to_string(i + 1);
    if (!hand.name.empty()) check_name(hand.name, hands_);
    if (hand.device.empty()) hand.device = "hand:";
    validate(hand.placement);
    std::unique_ptr<Device> device = std::move(options_.open_devices[i]);
    if (!device) device = open_hand(options_, hand.device, seen);
    hands_.push_back(std::make_unique<SessionHand>(hand.name, std::move(device), hand.placement));
  }
  const auto mice = std::count_if(hands_.begin(), hands_.end(),
                                  [](const auto& hand) { return hand->mouse() != nullptr; });
  if (mice > 1)
    throw Error("mouse:", "two hands cannot be moved by one mouse", "give it to one of them");
}

std::shared_ptr<const Cloud> Session::open_camera(CameraSpec& camera,
                                                  std::unique_ptr<Source> source) {
  std::function<std::unique_ptr<Source>()> open;
  if (source) {
    if (camera.uri.empty()) camera.uri = source->info().uri;
    if (camera.world_from_camera) source = with_pose(std::move(source), *camera.world_from_camera);
  } else {
    open = opener(camera, options_.sources);
    source = open();
  }
  sensors_.push_back(source->info().sensor);
  const SourceInfo& known = source->info();
  const double length = known.frames
                            ? static_cast<double>(*known.frames) / known.frame_rate.value_or(30.0)
                            : std::numeric_limits<double>::infinity();  // [s]
  // A hand that strokes is out of the surface before the recording begins again.
  if (length >= shortest_loop) options_.stroke_time = std::min(options_.stroke_time, length);
  if (!is_live()) {
    played_.emplace_back(std::move(source), std::move(open));
    return played_.back().first_frame().cloud;
  }
  feeds_.push_back(std::make_unique<CameraFeed>(
      std::move(source), FeedOptions{.schemes = options_.sources}, std::move(open)));
  if (length < shortest_loop) feeds_.back()->set_playback({.loop = false});
  const std::optional<Frame> first = feeds_.back()->first_frame(first_frame_timeout);
  if (!first)
    throw Error(camera.uri,
                "it has delivered no frame in " + number_text(first_frame_timeout) + " s",
                "check the camera, its cable and its permissions");
  return first->cloud;
}

std::shared_ptr<Method> Session::open_method(
    const ServoSettings& settings, const std::vector<std::shared_ptr<const Cloud>>& seen) const {
  std::shared_ptr<Method> method =
      make_method(settings.method, settings.parameters, options_.methods, settings.tool);
  for (const auto& cloud : seen) {
    if (cloud) method->check(*cloud);
  }
  return method;
}

// A hand's settings, where the session's are these, which have the first one's placement.
ServoSettings Session::settings_of(const SessionHand& hand, ServoSettings settings) const {
  if (&hand != hands_.front().get()) settings.placement = hand.placement;
  return settings;
}

// With control_ held: what a hand's cycle was told.
void Session::note(SessionHand& hand, const ServoCommands& told) {
  if (hand.recorder) hand.recorder->commands(told, now());
}

// With control_ held: all hands; throws before any of them is told.
// @param new_methods  the settings for which methods are made anew; null: the old ones go on
void Session::tell(const std::function<void(SessionHand&, ServoCommands&)>& edit,
                   const ServoSettings* new_methods) {
  std::vector<std::shared_ptr<Method>> methods(hands_.size());
  if (new_methods != nullptr) {
    const auto seen = newest_clouds();
    for (auto& method : methods) method = open_method(*new_methods, seen);
  }
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    SessionHand& hand = *hands_[i];
    note(hand, hand.cycle().command([&](ServoCommands& told) { edit(hand, told); },
                                    std::move(methods[i])));
  }
}

// What is seen jumps. Before the frame after the jump the hands are disengaged; after it methods
// take over that remember nothing of before, on the free side of what is seen now.
void Session::change_scene(bool methods_begin_anew) {
  const std::lock_guard lock(control_);
  tell([](SessionHand& /*hand*/, ServoCommands& told) { ++told.scene; },
       methods_begin_anew ? &settings_ : nullptr);
}

// A camera's thread, or the free-running one: a frame to all who want it.
void Session::take(std::size_t camera, const FedFrame& fed) {
  if (fed.after_jump) change_scene(false);
  give(camera, fed);
  if (fed.after_jump) change_scene(true);
  if (options_.on_frame) options_.on_frame(camera, fed);
}

std::shared_ptr<const Cloud> Session::with_materials(std::shared_ptr<const Cloud> cloud,
                                                     std::size_t camera) {
  const DepthImage* image = cloud->image();
  if (!options_.materials || image == nullptr) return cloud;
  std::string trouble;
  try {
    std::shared_ptr<const MaterialMap> map = options_.materials(camera, *image);
    const auto* labels = dynamic_cast<const LabelImage*>(map.get());
    if (labels != nullptr && labels->size() != image->depth().size()) {
      trouble = "it is given materials for " + std::to_string(labels->size()) + " pixels and has " +
                std::to_string(image->depth().size());
    } else if (map) {
      auto made = std::make_shared<DepthImage>(*image);
      made->set_materials(std::move(map));
      cloud = std::move(made);
    }
  } catch (const std::exception& error) {
    trouble = std::string("its materials could not be assigned: ") + error.what();
  }
  const std::lock_guard lock(frames_mutex_);
  materials_trouble_[camera] = std::move(trouble);
  return cloud;
}

// Tells where the first hand is [m, world]; of one thread.
std::function<std::optional<Vec3>()> Session::hand_place() const {
  return [reader = hands_.front()->cycle().reader(), place = std::optional<Vec3>()]() mutable {
    for (ServoTick record{}; reader.try_pop(record);) place = record.tick.hip;
    return place;
  };
}

// To the method and the recorder.
void Session::give(std::size_t camera, const FedFrame& fed) {
  std::shared_ptr<const Cloud> painted = paint_.on(with_materials(fed.frame.cloud, camera), camera);
  const std::lock_guard lock(frames_mutex_);
  stamps_[camera].stamp = fed.frame.stamp;
  std::vector<CameraFrame> cameras = stamps_;
  std::swap(cameras.front(), cameras[camera]);
  // Each hand counts the same frames, so a frame has the same number for all.
  for (const auto& hand : hands_) {
    numbers_[camera] = hand->cycle().put_frame(painted, fed.frame.stamp, cameras, now());
    if (hand->recorder) hand->recorder->frame(numbers_[camera], fed.frame.stamp, camera, painted);
  }
  newest_[camera] = std::move(painted);
  ++frames_;
}

void Session::begin_free() {
  for (const auto& hand : hands_) hand->device().enable();
  free_hand_ = hand_place();
  started_ = true;
}

// @return the first hand's tick
std::optional<ServoTick> Session::run_tick(std::int64_t number) {
  const double t = static_cast<double>(number) / options_.rate;
  free_t_ = t;
  const std::optional<Vec3> place = free_hand_();
  for (std::size_t camera = 0; camera < played_.size(); ++camera) {
    if (place) played_[camera].follow(*place);
    while (const auto frame = played_[camera].next_until(t)) take(camera, *frame);
  }
  std::optional<ServoTick> first;
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const std::optional<ServoTick> tick = hands_[i]->run_at(t);
    if (options_.on_tick && tick) options_.on_tick(i, *tick);
    if (i == 0) first = tick;
  }
  return first;
}

// The clock waits for the disk here, as it runs faster than time: recorders have no threads then.
void Session::wait_for_recorder() {
  const std::lock_guard lock(control_);
  for (const auto& hand : hands_) {
    if (hand->recorder) hand->recorder->flush();
  }
}

void Session::drain() {
  const double r_c = proxy_radius_.load(std::memory_order_relaxed);
  const auto seen = newest_clouds();
  for (const auto& hand : hands_) hand->count(seen, r_c);
}

// With control_ held, or before anything runs. The first hand's recording holds the frames; those
// of the others lie in folders within it.
void Session::open_recorder(const std::string& folder, bool is_on) {
  struct Opened {
    std::unique_ptr<Recorder> recorder;
    std::shared_ptr<std::promise<Recorder*>> promise = std::make_shared<std::promise<Recorder*>>();
  };
  std::vector<Opened> opened(hands_.size());
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    SessionHand& hand = *hands_[i];
    std::function<void()> begin_anew;
    if (is_on) {
      // On the recorder's thread, once: the recording begins with a method that remembers
      // nothing.
      begin_anew = [this, &hand, promise = opened[i].promise, settings = settings_] {
        Recorder* recorder = promise->get_future().get();
        if (recorder != nullptr)
          recorder->commands(
              hand.cycle().command([](ServoCommands&) {}, open_method(settings, newest_clouds())),
              now());
      };
    }
    try {
      opened[i].recorder = std::make_unique<Recorder>(
          i == 0 ? folder : hand_folder(folder, hand.name()).string(), info_of(hand),
          hand.cycle().full_reader(), std::move(begin_anew),
          RecorderOptions{.with_frames = i == 0, .own_threads = is_live()});
    } catch (...) {
      for (Opened& each : opened) each.promise->set_value(nullptr);
      throw;
    }
    opened[i].recorder->commands(hand.cycle().commands(), now());
  }
  {
    const std::lock_guard lock(frames_mutex_);
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      // The first tick of the recording uses these frames, or some that are yet to come.
      std::map<std::uint64_t, std::size_t> cameras;  // by the number of their newest frame
      for (std::size_t camera = 0; camera < newest_.size(); ++camera)
        if (newest_[camera]) cameras[numbers_[camera]] = camera;
      for (const auto& [number, camera] : cameras)
        opened[i].recorder->frame(number, stamps_[camera].stamp, camera, newest_[camera]);
      hands_[i]->recorder = std::move(opened[i].recorder);
    }
  }
  for (std::size_t i = 0; i < hands_.size(); ++i)
    opened[i].promise->set_value(hands_[i]->recorder.get());
  recording_ = RecordingState();
  recording_.folder = folder;
  recording_since_ = now();
}

SessionInfo Session::info_of(const SessionHand& hand) const {
  SessionInfo info{.version = options_.version};
  for (const CameraSpec& camera : options_.cameras) info.cameras.push_back(camera.uri);
  info.device = hand.device().info().uri;
  info.limits = hand.device().info().limits;
  info.epoch = since_1970(0.0);
  info.hand = hand.name();
  if (&hand == hands_.front().get()) {
    for (std::size_t i = 1; i < hands_.size(); ++i) info.more_hands.push_back(hands_[i]->name());
  }
  return info;
}

// With control_ held. Closing takes as long as the disk does, and nobody waits for that.
void Session::end_recording() {
  if (!is_recording()) return;
  Recording recording;
  {
    const std::lock_guard lock(frames_mutex_);
    for (const auto& hand : hands_) recording.push_back(std::move(hand->recorder));
  }
  for (const auto& recorder : recording) recorder->request_stop();
  recording_.folder = recording.front()->status().folder.string();
  recording_.message = recording_.folder + ": closing";
  recording_.seconds = now() - recording_since_;
  closing_.push_back(std::move(recording));
}

// With control_ held: how the recordings ended that are closed by now.
void Session::report_closed() {
  std::erase_if(closing_, [this](const Recording& recording) {
    std::vector<Recorder::Status> parts;
    for (const auto& recorder : recording) parts.push_back(recorder->status());
    if (!std::all_of(parts.begin(), parts.end(), [](const auto& part) { return part.done; }))
      return false;
    if (!parts.empty()) report_closed(parts);
    return true;
  });
}

// What went wrong with any part of a recording comes before what went well.
void Session::report_closed(const std::vector<Recorder::Status>& parts) {
  const auto counts = [](std::uint64_t ticks, std::uint64_t frames) {
    return std::to_string(ticks) + " ticks, " + std::to_string(frames) + " frames";
  };
  recording_.bytes = 0.0;
  for (const Recorder::Status& part : parts) recording_.bytes += static_cast<double>(part.bytes);
  for (const Recorder::Status& part : parts) {
    if (part.trouble.empty()) continue;
    recording_.failed = true;
    recording_.message = "the recording has stopped: " + part.trouble;
    return;
  }
  std::string text;
  for (const Recorder::Status& part : parts) {
    if (part.lost_ticks + part.lost_frames > 0) {
      recording_.failed = true;
      recording_.message = part.folder.string() + ": the machine was too slow for " +
                           counts(part.lost_ticks, part.lost_frames);
      return;
    }
    text += text.empty() ? part.folder.string() + ": " + counts(part.ticks, part.frames)
                         : "; " + part.folder.filename().string() + ": " +
                               std::to_string(part.ticks) + " ticks";
  }
  recording_.message =
      text + "; " + fixed_text(recording_.seconds, 1) + " s, " + size_text(recording_.bytes);
}

std::string size_text(double bytes) {
  const auto [unit, name] = bytes >= 1e9   ? std::pair(1e9, "GB")
                            : bytes >= 1e6 ? std::pair(1e6, "MB")
                                           : std::pair(1e3, "kB");
  return number_text(bytes / unit, 3) + " " + name;
}

const Timing* Session::timing(std::size_t hand) const {
  const ServoLoop* loop = hands_.at(hand)->loop();
  return loop == nullptr ? nullptr : &loop->timing();
}

const RealtimeReport* Session::realtime(std::size_t hand) const {
  const ServoLoop* loop = hands_.at(hand)->loop();
  return loop == nullptr ? nullptr : &loop->realtime();
}

}  // namespace palpate
