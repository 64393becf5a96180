// SPDX-License-Identifier: Apache-2.0
// A session in real time: how it starts and ends. Orders of events are judged, never times.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <future>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/session/session.hpp"

#include "tests/session/fakes.hpp"
#include "tests/support/comes_true.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/patient.hpp"

namespace palpate {
namespace test_session_live {

using test::comes_true;
using test::fails_saying;
using test::wall;
using test::wall_depth;

// What happened, in its order. Any thread.
class Log {
 public:
  void note(std::string event) {
    const std::lock_guard lock(mutex_);
    events_.push_back(std::move(event));
  }
  [[nodiscard]] std::vector<std::string> events() const {
    const std::lock_guard lock(mutex_);
    return events_;
  }
  std::atomic<double> last_gap{0.0};  // [s] from a device's last read to its last write

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> events_;
};

// A door that stays shut until it is opened.
class Gate {
 public:
  void open() {
    {
      const std::lock_guard lock(mutex_);
      is_open_ = true;
    }
    opened_.notify_all();
  }
  void wait() {
    std::unique_lock lock(mutex_);
    opened_.wait(lock, [this] { return is_open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable opened_;
  bool is_open_ = false;
};

const SourceInfo live{.uri = "live:",
                      .kind = "live camera",
                      .frame_rate = 100.0,
                      .live = true,
                      .clock = StampClock::monotonic};

// 100 frames a second; once it may, never returns from `next` until the gate opens, whoever cancels
// it.
class HangingCamera final : public Source {
 public:
  HangingCamera(std::shared_ptr<Log> log, std::shared_ptr<Gate> gate, std::promise<void> ended)
      : log_(std::move(log)), gate_(std::move(gate)), ended_(std::move(ended)) {}
  ~HangingCamera() override { ended_.set_value(); }
  std::optional<Frame> next(double /*timeout*/) override {
    if (!may_hang) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      return Frame{monotonic_now(), wall()};
    }
    hangs = true;
    gate_->wait();
    return std::nullopt;
  }
  void cancel() noexcept override { log_->note("cancel the hanging camera"); }
  [[nodiscard]] const SourceInfo& info() const override { return live; }
  static inline std::atomic<bool> may_hang{false};
  static inline std::atomic<bool> hangs{false};

 private:
  std::shared_ptr<Log> log_;
  std::shared_ptr<Gate> gate_;
  std::promise<void> ended_;
};

// 100 frames a second.
class LivingCamera final : public Source {
 public:
  explicit LivingCamera(std::shared_ptr<Log> log) : log_(std::move(log)) {}
  std::optional<Frame> next(double timeout) override {
    std::unique_lock lock(mutex_);
    const auto pause = std::chrono::duration<double>(std::min(timeout, 0.01));
    if (changed_.wait_for(lock, pause, [this] { return is_cancelled_; })) return std::nullopt;
    return Frame{monotonic_now(), wall(static_cast<std::uint16_t>(500 + number_++ % 2))};
  }
  void cancel() noexcept override {
    log_->note("cancel the living camera");
    {
      const std::lock_guard lock(mutex_);
      is_cancelled_ = true;
    }
    changed_.notify_all();
  }
  [[nodiscard]] const SourceInfo& info() const override { return live; }

 private:
  std::shared_ptr<Log> log_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_cancelled_ = false;
  int number_ = 0;
};

// A hand that hovers for 50 reads, then presses into the wall for 500, again and again: after a
// stall of a busy machine it is free to engage anew.
class LoggingDevice final : public Device {
 public:
  explicit LoggingDevice(
      std::shared_ptr<Log> log, bool refuses = false,
      const DeviceInfo& info = {.uri = "logging:", .kind = "logging", .limits = no_motors})
      : log_(std::move(log)), refuses_(refuses), info_(info) {}
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double /*t*/) noexcept override {
    read_at_ = monotonic_now();
    return {.position = {0.0, 0.0, ++reads_ % 550 <= 50 ? wall_depth - 0.05 : wall_depth + 0.005}};
  }
  void write(const Vec3& force, double /*t*/) noexcept override {
    log_->last_gap = monotonic_now() - read_at_;
    if (is_enabled_) log_->note(force.isZero(0.0) ? "write zero" : "write a force");
  }
  void enable() override {
    if (refuses_) throw Error("logging:", "it is not calibrated", "calibrate it");
    log_->note("enable");
    is_enabled_ = true;
  }
  void disable() noexcept override {
    is_enabled_ = false;
    log_->note("disable");
  }

 private:
  std::atomic<bool> is_enabled_{false};
  std::shared_ptr<Log> log_;
  bool refuses_;
  int reads_ = 0;
  double read_at_ = 0.0;  // [s]
  DeviceInfo info_;
};

// Method `paper`, until `hangs` is set: then a tick does not return before the gate opens.
class HangingMethod final : public Method {
 public:
  HangingMethod(const Parameters& parameters, std::shared_ptr<Gate> gate,
                std::shared_ptr<std::promise<void>> ended)
      : method_(make_method("paper", parameters)),
        gate_(std::move(gate)),
        ended_(std::move(ended)) {}
  ~HangingMethod() override { ended_->set_value(); }
  void seat(const Vec3& proxy) noexcept override { method_->seat(proxy); }
  void observe(const Observation& seen) noexcept override { method_->observe(seen); }
  Tick tick(const Vec3& hip, double t) noexcept override {
    if (hangs) {
      is_hanging = true;
      gate_->wait();
    }
    return method_->tick(hip, t);
  }
  void set_parameters(const Parameters& parameters) noexcept override {
    method_->set_parameters(parameters);
  }
  static inline std::atomic<bool> hangs{false}, is_hanging{false};

 private:
  std::unique_ptr<Method> method_;
  std::shared_ptr<Gate> gate_;
  std::shared_ptr<std::promise<void>> ended_;
};

// The camera that hangs must not be what takes the force off.
SessionOptions patient(const std::shared_ptr<Log>& log) {
  SessionOptions options;
  options.open_cameras.push_back(std::make_unique<LivingCamera>(log));
  options.open_devices[0] = std::make_unique<LoggingDevice>(log);
  options.safety = test::patient();
  return options;
}

std::string last_event_of_the_device(const Log& log) {
  std::string last;
  for (const std::string& event : log.events()) {
    if (!event.starts_with("cancel")) last = event;
  }
  return last;
}

std::size_t threads_of_this_process() {
  const std::filesystem::directory_iterator tasks("/proc/self/task");
  return static_cast<std::size_t>(std::distance(begin(tasks), end(tasks)));
}

// False if its loop stood still when it was stopped, for longer than `stop` waits for it.
bool stops_beside_a_hanging_camera() {
  bool is_in_time = true;
  const auto log = std::make_shared<Log>();
  const auto gate = std::make_shared<Gate>();
  std::promise<void> ended;
  std::future<void> camera_ended = ended.get_future();
  HangingCamera::may_hang = HangingCamera::hangs = false;
  {
    SessionOptions options = patient(log);
    options.open_cameras.push_back(std::make_unique<HangingCamera>(log, gate, std::move(ended)));
    Session session(std::move(options));
    EXPECT_FALSE(session.state().running);
    session.start();
    session.start();  // harmless
    EXPECT_TRUE(session.state().running);
    const auto force_is_out = [&] { return session.statistics().force_out.load(); };
    EXPECT_TRUE(comes_true(force_is_out)) << "no force was sent";
    HangingCamera::may_hang = true;
    EXPECT_TRUE(comes_true([&] { return HangingCamera::hangs && force_is_out(); }));
    session.stop();  // returns although the camera hangs

    const std::vector<std::string> events = log->events();
    const auto is_cancel = [](const std::string& event) { return event.starts_with("cancel"); };
    const auto is_write = [](const std::string& event) { return event.starts_with("write"); };
    const auto first_cancel = std::find_if(events.begin(), events.end(), is_cancel);
    EXPECT_EQ(std::count_if(events.begin(), events.end(), is_cancel), 2);
    EXPECT_EQ(std::find_if(first_cancel, events.end(), is_write), events.end())
        << "nothing is written once a camera is told to end";
    const auto last_write =
        std::find_if(std::make_reverse_iterator(first_cancel), events.rend(), is_write);
    is_in_time = log->last_gap < 0.04;  // else the device may be disabled before
    if (is_in_time) {
      EXPECT_TRUE(last_write != events.rend() && *last_write == "write zero");
      EXPECT_NE(std::find(last_write.base(), first_cancel, "disable"), first_cancel)
          << "the device is disabled between the last write and the first camera's end";
    }
    EXPECT_GT(std::count(events.begin(), events.end(), "write a force"), 0);

    session.stop();  // harmless
    EXPECT_EQ(log->events().size(), events.size());
    EXPECT_FALSE(session.state().running);
    EXPECT_TRUE(fails_saying([&] { session.start(); }, "session", "stopped"));
  }
  gate->open();
  camera_ended.wait();
  return is_in_time;
}

// Hazard: session-stops
TEST(LiveSession, TakesTheForceOffBeforeAnyCameraIsWaitedFor) {
  for (int attempt = 0; attempt < 10; ++attempt) {
    if (stops_beside_a_hanging_camera() || HasFailure()) return;
  }
  FAIL() << "the machine stood still in each attempt";
}

// Hazard: hang, session-stops
TEST(LiveSession, TakesTheForceOfAMethodThatHangsAwayAndLeavesItsThreadBehind) {
  const auto log = std::make_shared<Log>();
  const auto gate = std::make_shared<Gate>();
  const auto ended = std::make_shared<std::promise<void>>();
  std::thread([] {}).join();  // a sanitizer starts a thread of its own with the first
  const std::size_t threads = threads_of_this_process();
  HangingMethod::hangs = HangingMethod::is_hanging = false;
  {
    SessionOptions options = patient(log);
    options.methods.add(
        {.name = "hanging", .summary = "", .make = [=](const Parameters& parameters) {
           return std::make_unique<HangingMethod>(parameters, gate, ended);
         }});
    options.method = "hanging";
    Session session(std::move(options));
    session.start();
    ASSERT_TRUE(comes_true([&] { return session.statistics().force_out.load(); }));
    HangingMethod::hangs = true;
    ASSERT_TRUE(comes_true([] { return HangingMethod::is_hanging.load(); }));
    const auto is_disabled = [&] { return last_event_of_the_device(*log) == "disable"; };
    EXPECT_TRUE(comes_true(is_disabled)) << "before anybody stops the session";
    EXPECT_TRUE(comes_true([&] {
      return session.state().hands[0].trouble.starts_with("no tick for");
    })) << session.state().hands[0].trouble;
    session.stop();  // returns although the method hangs
    EXPECT_TRUE(is_disabled());
    EXPECT_TRUE(session.state().hands[0].trouble.starts_with("the method or the device's driver"))
        << session.state().hands[0].trouble;
    session.stop();
  }
  gate->open();
  ended->get_future().wait();
  EXPECT_TRUE(comes_true([&] { return threads_of_this_process() <= threads; }));
  EXPECT_EQ(last_event_of_the_device(*log), "disable")
      << "nothing is written or enabled afterwards";
}

// Hazard: session-stops
TEST(LiveSession, EndsWithoutEverHavingBegun) {
  const auto log = std::make_shared<Log>();
  { const Session session(patient(log)); }
  const std::vector<std::string> events = log->events();
  EXPECT_EQ(std::count(events.begin(), events.end(), "enable"), 0);
  EXPECT_EQ(std::count(events.begin(), events.end(), "write a force"), 0);
  EXPECT_GT(std::count(events.begin(), events.end(), "disable"), 0);
}

// Hazard: session-stops
TEST(LiveSession, LeavesNoThreadBehindWhereTheDeviceRefuses) {
  const auto log = std::make_shared<Log>();
  SessionOptions options = patient(log);
  options.open_devices[0] = std::make_unique<LoggingDevice>(log, true);
  std::thread([] {}).join();  // a sanitizer starts a thread of its own with the first
  const std::size_t before = threads_of_this_process();
  Session session(std::move(options));
  EXPECT_TRUE(fails_saying([&] { session.start(); }, "logging:", "calibrate it"));
  EXPECT_TRUE(comes_true([&] { return threads_of_this_process() <= before; }));
  EXPECT_FALSE(session.state().running);
  session.stop();
}

// Hazard: session-stops, unwatched-motors
TEST(LiveSession, RefusesForcesOnMotorsThatNothingWatches) {
  const DeviceInfo arm{.uri = "arm:", .kind = "an arm", .limits = {.max_force = 2.0}};
  const auto with_limit = [](double newtons) {
    SafetyParameters safety;
    safety.max_force = newtons;
    return safety;
  };
  const auto open = [&](const DeviceInfo& info, const SafetyParameters& safety,
                        bool without_watchdog = false) {
    const auto log = std::make_shared<Log>();
    SessionOptions options;
    options.open_cameras.push_back(std::make_unique<LivingCamera>(log));
    options.open_devices[0] = std::make_unique<LoggingDevice>(log, false, info);
    options.safety = safety;
    options.without_watchdog = without_watchdog;
    return std::make_unique<Session>(std::move(options));
  };
  const auto is_refused = [&](const DeviceInfo& info, const SafetyParameters& safety) {
    return fails_saying([&] { return open(info, safety); }, "arm:", "watchdog", "open_guarded",
                        "0.2 N", "without_watchdog");
  };
  EXPECT_TRUE(is_refused(arm, {}));
  EXPECT_TRUE(fails_saying([&] { return open(arm, {}); }, "up to 2 N")) << "the device's own limit";
  EXPECT_TRUE(is_refused(arm, with_limit(0.21)));
  SafetyParameters engages_late = with_limit(1.0);
  engages_late.engage_force = 1.0;
  EXPECT_TRUE(is_refused(arm, engages_late));
  DeviceInfo weak = arm, watched = arm, slow = arm, simulated = arm, motorless = arm;
  weak.limits.max_force = 0.2;
  watched.watchdog = 0.05;
  slow.watchdog = 10.0;
  simulated.simulated = true;
  motorless.limits = no_motors;
  EXPECT_TRUE(is_refused(slow, {}));
  for (const DeviceInfo& info : {weak, watched, simulated, motorless})
    EXPECT_NO_THROW(open(info, {})->set({}));
  EXPECT_NO_THROW(open(arm, {}, true)->set({}));

  const std::unique_ptr<Session> gentle = open(arm, with_limit(0.2));
  ServoSettings settings = gentle->settings();
  settings.safety.max_force = 1.0;
  EXPECT_TRUE(fails_saying([&] { return gentle->set(settings), 0; }, "arm:", "up to 1 N"));
  EXPECT_EQ(gentle->settings().safety.max_force, 0.2) << "nothing was changed";
  settings.safety.max_force = 0.1;
  gentle->set(settings);
  EXPECT_EQ(gentle->settings().safety.max_force, 0.1);
}

// Hazard: session-stops
TEST(LiveSession, EndsARunWhenItIsAskedTo) {
  Session session(patient(std::make_shared<Log>()));
  std::thread other([&] {
    comes_true([&] { return session.statistics().ticks.load() > 20; });
    session.request_stop();
  });
  session.run(std::nullopt);
  other.join();
  const SessionState state = session.state();
  EXPECT_GT(state.hands[0].summary.ticks, 20U);
  EXPECT_FALSE(state.running);
  ASSERT_NE(session.timing(), nullptr);
}

// Hazard: session-stops, scene-jumps
TEST(LiveSession, LetsGoOfTheHandWhereTimeJumpsInARecording) {
  SessionOptions options = patient(std::make_shared<Log>());
  options.open_cameras[0] = std::make_unique<test::MadeSource>(
      [cloud = wall()](int k) {
        return k < 300 ? std::optional(Frame{k / 100.0, cloud}) : std::nullopt;
      },
      SourceInfo{.uri = "made:", .kind = "made", .frames = 300, .frame_rate = 100.0});
  Session session(std::move(options));
  auto ticks = session.ticks();
  session.start();
  bool was_engaged = false;
  EXPECT_TRUE(comes_true([&] {
    for (ServoTick tick{}; ticks.try_pop(tick);) was_engaged |= tick.gain > 0.0;
    return was_engaged;
  }));
  session.seek(0.9);
  int jumps = 0;  // before the frame there, and after it
  EXPECT_TRUE(comes_true([&] {
    for (ServoTick tick{}; ticks.try_pop(tick);) {
      if ((tick.hand & proxy_reseated) == 0) continue;
      ++jumps;
      EXPECT_EQ(tick.gain, 0.0);
    }
    return session.state().cameras.front().place >= 269U && jumps > 0;
  }));
}

// A source that has one frame says that it is valid for as long as nothing replaces it; of a camera
// that stops nobody knows what it would see by now.
// Hazard: session-stops
TEST(LiveSession, GoesOnFeelingAStillPictureAndNotWhatAStoppedCameraSaw) {
  constexpr double lost_age = 0.3;  // [s]
  constexpr double slack = 0.05;    // [s]
  for (const bool is_live : {false, true}) {
    const auto captured = std::make_shared<std::atomic<double>>(0.0);  // [s] the last frame
    const auto was_felt = std::make_shared<std::atomic<bool>>(false);
    const auto has_ended = std::make_shared<std::atomic<bool>>(false);
    SessionOptions options = patient(std::make_shared<Log>());
    options.safety.fade_age = 0.5 * lost_age;
    options.safety.lost_age = lost_age;
    options.open_cameras[0] = std::make_unique<test::MadeSource>(
        [=](int k) -> std::optional<Frame> {
          if (is_live ? k >= 100 && (*was_felt || k >= 6000) : k >= 1) {
            *has_ended = true;
            return std::nullopt;
          }
          if (k > 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
          *captured = monotonic_now();
          return Frame{*captured, wall(static_cast<std::uint16_t>(500 + k % 2))};
        },
        SourceInfo{.uri = "made:", .kind = "made", .live = is_live});
    Session session(std::move(options));
    auto ticks = session.ticks();
    session.start();
    bool is_felt = false, is_felt_late = false;
    double last = 0.0;  // [s]
    EXPECT_TRUE(comes_true([&] {
      for (ServoTick tick{}; ticks.try_pop(tick);) {
        last = tick.tick.t;
        const bool is_late = *has_ended && tick.tick.t > *captured + lost_age + slack;
        (is_late ? is_felt_late : is_felt) |= !tick.force.isZero(0.0);
      }
      *was_felt = is_felt;
      return is_felt_late || (*has_ended && last > *captured + 10.0 * lost_age);
    }));
    EXPECT_EQ(is_felt_late, !is_live);
    EXPECT_TRUE(is_felt || !is_live);
    EXPECT_EQ(session.state().cameras.front().stays_valid, !is_live);
  }
}

// Hazard: session-stops
TEST(LiveSession, IsChangedAndWatchedFromSeveralThreads) {
  Session session(patient(std::make_shared<Log>()));
  session.start();
  std::atomic<bool> ended{false};
  std::vector<std::thread> threads;
  for (const double stiffness : {300.0, 500.0}) {
    threads.emplace_back([&session, stiffness] {
      for (int i = 0; i < 30; ++i) {
        session.change(
            [&](ServoSettings& settings) { settings.parameters.coupling.stiffness = stiffness; });
      }
    });
  }
  threads.emplace_back([&session] {
    for (int i = 0; i < 20; ++i) {
      session.change(
          [&](ServoSettings& settings) { settings.method = i % 2 == 0 ? "paper" : "sight"; });
      session.reset_faults();
    }
  });
  std::thread watcher([&] {
    auto ticks = session.ticks();
    while (!ended) {
      for (ServoTick tick{}; ticks.try_pop(tick);) EXPECT_TRUE(tick.force.allFinite());
      EXPECT_EQ(session.state().cameras.size(), 1U);
      static_cast<void>(session.newest_clouds());
    }
  });
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(comes_true([&] { return session.state().hands[0].summary.ticks > 20; }));
  ended = true;
  watcher.join();
  session.stop();
  const double stiffness = session.settings().parameters.coupling.stiffness;
  // Who changes the method meanwhile must not take back the stiffness that others set.
  EXPECT_TRUE(stiffness == 300.0 || stiffness == 500.0) << stiffness;
  EXPECT_EQ(session.settings().method, "sight");
}

}  // namespace test_session_live
}  // namespace palpate
