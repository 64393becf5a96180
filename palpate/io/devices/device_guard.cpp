// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/devices/device_guard.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <utility>

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "palpate/kernel/core/error.hpp"
#include "palpate/servo/last_gate.hpp"
#include "palpate/servo/mailbox.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double opening_time = 30.0;   // [s] for the device to open, or to be enabled
constexpr double guard_silence = 0.05;  // [s] without the guard's loop: the device is lost

struct Command {
  palpate_gate_wish wish;
  std::uint64_t beats;
};

using Text = std::array<char, 256>;

void put_text(Text& to, const std::string& from) {
  to.fill('\0');
  std::copy_n(from.begin(), std::min(from.size(), to.size() - 1), to.begin());
}

// DeviceInfo without what needs memory of its own.
struct Info {
  Text uri, kind, serial;
  DeviceLimits limits;
  std::optional<DeviceReach> reach;
  std::optional<double> damping, delay, rate;
  double watchdog;
  bool simulated;
};

enum class Phase : int { opening, open, refused };
enum class Wish : int { disabled, enabled, ended };

// Shared by both processes: nothing in it has memory of its own.
struct Memory {
  std::atomic<Phase> phase{Phase::opening};
  Text refusal{};  // written before `phase`
  Info info{};     // likewise
  Mailbox<Command> command;
  Mailbox<HandState> seen;
  Mailbox<Text> fault_text;
  std::atomic<std::uint64_t> turns{0};   // of the guard's loop
  std::atomic<std::uint64_t> wishes{0};  // raised with each new wish
  std::atomic<Wish> wish{Wish::disabled};
  std::atomic<std::uint64_t> granted{0};  // the number of the wish that was done
  std::atomic<bool> enable_failed{false};
  Text enable_refusal{};  // written before `granted`
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
static_assert(std::atomic<Phase>::is_always_lock_free &&
              std::atomic<unsigned>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

void put_info(const DeviceInfo& from, double beat_time, Info& to) {
  put_text(to.uri, from.uri);
  put_text(to.kind, from.kind + ", guarded");
  put_text(to.serial, from.serial);
  to.limits = from.limits;
  to.reach = from.reach;
  to.damping = from.damping;
  to.delay = from.delay;
  to.rate = from.rate;
  to.watchdog = std::min(from.watchdog.value_or(beat_time), beat_time);
  to.simulated = from.simulated;
}

DeviceInfo info_of(const Info& from) {
  DeviceInfo info;
  info.uri = from.uri.data();
  info.kind = from.kind.data();
  info.limits = from.limits;
  info.reach = from.reach;
  info.damping = from.damping;
  info.delay = from.delay;
  info.rate = from.rate;
  info.watchdog = from.watchdog;
  info.simulated = from.simulated;
  info.serial = from.serial.data();
  return info;
}

// Does what the session wished for last, if it is new.
void grant(Memory& memory, Device& device) {
  const std::uint64_t wished = memory.wishes.load(std::memory_order_acquire);
  if (wished == memory.granted.load(std::memory_order_relaxed)) return;
  memory.enable_failed = false;
  if (memory.wish.load(std::memory_order_acquire) == Wish::enabled) {
    try {
      device.enable();
    } catch (const std::exception& error) {
      put_text(memory.enable_refusal, error.what());
      memory.enable_failed = true;
    }
  } else {
    device.disable();
  }
  memory.granted.store(wished, std::memory_order_release);
}

// One tick of the guard: reads the device and writes what the session wrote last.
class GuardTick {
 public:
  GuardTick(Memory& memory, Device& device, double beat_time)
      : memory_(memory), device_(device), beat_time_(beat_time), gate_(beat_time) {}

  // Hazard: dead-process
  void run() noexcept {
    HandState state = device_.read(monotonic_now());
    memory_.command.take();
    const double now = monotonic_now();
    const auto& [wish, beats] = memory_.command.taken_last();
    gate_.pass(now, beats, {vector_of(wish.force) + vector_of(wish.held), vector_of(wish.torque)});
    // A command that came already leaves the force as it is.
    if (gate_.closed()) {
      last_gate_.release(device_, now);
    } else if (beats != judged_) {
      last_gate_.write(device_, judged_here(wish), now);
    } else {
      last_gate_.write_again(device_, now);
    }
    judged_ = beats;
    if (gate_.closed()) {
      state.present = false;  // so that the session's safety chain releases, and engages again
      if (state.fault == DeviceFault::none && beats > 0) state.fault = DeviceFault::other;
    }
    memory_.seen.put(state);
    memory_.turns.fetch_add(1, std::memory_order_release);
  }

 private:
  // By what the device states here, whatever the session says of it; and by the guard's own pace,
  // which misses some of the session's ticks.
  [[nodiscard]] palpate_gate_wish judged_here(palpate_gate_wish wish) const noexcept {
    constexpr double longest_time = 5e-3;  // [s] between two commands that the guard sees
    const DeviceLimits& limits = device_.info().limits;
    wish.force_bounds.limit = std::min(wish.force_bounds.limit, limits.max_force);
    wish.torque_bounds.limit = std::min(wish.torque_bounds.limit, limits.max_torque);
    wish.longest_gap = beat_time_;
    wish.longest_time = longest_time;
    return wish;
  }

  Memory& memory_;
  Device& device_;
  double beat_time_;  // [s]
  GuardGate gate_;
  LastGate last_gate_;
  std::uint64_t judged_ = 0;  // beats of the last command
};

bool goes_on(const Memory& memory, pid_t session) {
  return getppid() == session && memory.wish.load(std::memory_order_acquire) != Wish::ended;
}

// What the device says of its fault, for the session.
void tell_fault(Memory& memory, const Device& device, std::string& told) {
  const std::string text = device.fault_text();
  if (text == told) return;
  told = text;
  Text words{};
  put_text(words, text);
  memory.fault_text.put(words);
}

// The guard's process: until the session wishes for the end, or has ended.
void hold_polled(Memory& memory, Device& device, const GuardLimits& limits, pid_t session) {
  constexpr int ticks_a_text = 50;
  RealtimeRequest request;
  request.pin = false;  // the servo has the core that it would get
  const RealtimeThread realtime(request);
  GuardTick tick(memory, device, limits.beat_time);
  std::string told;
  double next = monotonic_now();
  for (int number = 0; goes_on(memory, session); ++number) {
    grant(memory, device);
    tick.run();
    if (number % ticks_a_text == 0) tell_fault(memory, device, told);
    next = std::max(next + limits.period, monotonic_now());
    sleep_until(static_cast<std::uint64_t>(1e9 * next));
  }
  LastGate::write_zero(device, monotonic_now());
  device.disable();
}

// The same with a device whose driver calls.
void hold_driven(Memory& memory, Device& device, const GuardLimits& limits, pid_t session) {
  constexpr auto look_interval = std::chrono::milliseconds(5);
  constexpr int looks_of_end = 10;  // for the last write
  GuardTick tick(memory, device, limits.beat_time);
  std::atomic<bool> ending{false};
  std::atomic<bool> zero_sent{false};
  device.start([&] {
    if (!ending.load(std::memory_order_acquire)) return tick.run();
    static_cast<void>(device.read(monotonic_now()));
    LastGate::write_zero(device, monotonic_now());
    zero_sent.store(true, std::memory_order_release);
  });
  std::string told;
  while (goes_on(memory, session)) {
    grant(memory, device);
    tell_fault(memory, device, told);
    std::this_thread::sleep_for(look_interval);
  }
  ending.store(true, std::memory_order_release);
  for (int i = 0; i < looks_of_end && !zero_sent.load(std::memory_order_acquire); ++i)
    std::this_thread::sleep_for(look_interval);
  device.disable();
  device.stop();
}

[[noreturn]] void run_guard(Memory& memory, const std::function<std::unique_ptr<Device>()>& open,
                            const GuardLimits& limits, pid_t session) {
  // What ends a session reaches its whole group; the guard outlives it.
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGTSTP, SIGTTOU, SIGTTIN})
    std::signal(number, SIG_IGN);  // NOLINT(cert-err33-c): these can all be ignored
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  int status = 0;
  try {
    const std::unique_ptr<Device> device = open();
    put_info(device->info(), limits.beat_time, memory.info);
    memory.phase.store(Phase::open, std::memory_order_release);
    const auto hold = device->drives() ? hold_driven : hold_polled;
    hold(memory, *device, limits, session);
  } catch (const std::exception& error) {
    put_text(memory.refusal, error.what());
    memory.phase.store(Phase::refused, std::memory_order_release);
    status = 1;
  }
  _exit(status);  // nothing that the session's process has registered runs here
}

// The session's side.
class GuardedDevice final : public Device {
 public:
  GuardedDevice(Memory* memory, pid_t guard)
      : memory_(memory), guard_(guard), info_(info_of(memory->info)) {}
  ~GuardedDevice() override {
    memory_->wish.store(Wish::ended, std::memory_order_release);
    waitpid(guard_, nullptr, 0);
    munmap(memory_, sizeof(Memory));
  }

  [[nodiscard]] const DeviceInfo& info() const override { return info_; }

  HandState read(double t) noexcept override {
    memory_->seen.take();
    const std::uint64_t turns = memory_->turns.load(std::memory_order_acquire);
    if (turns != turns_) {
      turns_ = turns;
      heard_ = t;
    }
    HandState state = memory_->seen.taken_last();
    if (t - heard_ > guard_silence || turns == 0) {
      state.present = false;
      state.fault = DeviceFault::disconnected;
    }
    return state;
  }

  void announce(const palpate_gate_wish& wish) noexcept override { announced_ = wish; }
  // The guard judges what was announced; nothing was: zero.
  void write(const Vec3& /*force*/, double t) noexcept override {
    palpate_gate_wish wish = std::exchange(announced_, {});
    wish.t = t;
    if (!enabled_.load(std::memory_order_acquire)) wish.force = wish.torque = wish.held = {};
    memory_->command.put({.wish = wish, .beats = ++beats_});
  }

  void enable() override {
    const std::uint64_t number = wish(Wish::enabled);
    const double end = monotonic_now() + opening_time;
    while (memory_->granted.load(std::memory_order_acquire) < number) {
      if (monotonic_now() > end || waitpid(guard_, nullptr, WNOHANG) != 0)
        throw Error(info_.uri, "its guard does not answer", "start the session again");
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    if (memory_->enable_failed) throw Error(info_.uri, memory_->enable_refusal.data());
    enabled_.store(true, std::memory_order_release);
  }

  void disable() noexcept override {
    enabled_.store(false, std::memory_order_release);
    wish(Wish::disabled);
  }

  [[nodiscard]] std::string fault_text() const override {
    const std::lock_guard lock(asking_);
    memory_->fault_text.take();
    return memory_->fault_text.taken_last().data();
  }

 private:
  std::uint64_t wish(Wish wish) noexcept {
    memory_->wish.store(wish, std::memory_order_release);
    return memory_->wishes.fetch_add(1, std::memory_order_acq_rel) + 1;
  }

  Memory* memory_;
  pid_t guard_;
  DeviceInfo info_;
  std::atomic<bool> enabled_{false};
  mutable std::mutex asking_;  // for the fault: any thread may
  // Of the thread that reads and writes:
  palpate_gate_wish announced_{};
  std::uint64_t beats_ = 0;
  std::uint64_t turns_ = 0;
  double heard_ = 0.0;  // [s]
};

}  // namespace

Wrench GuardGate::pass(double now, std::uint64_t beats, const Wrench& wrench) {
  if (beats != beats_) {
    beats_ = beats;
    last_beat_ = now;
    if (wrench.force.isZero(0.0) && wrench.torque.isZero(0.0)) closed_ = false;
  }
  if (now - last_beat_ > beat_time_ || !wrench.force.allFinite() || !wrench.torque.allFinite())
    closed_ = true;
  return closed_ ? Wrench{} : wrench;
}

std::unique_ptr<Device> open_guarded(const std::function<std::unique_ptr<Device>()>& open,
                                     const GuardLimits& limits) {
  if (!(limits.beat_time >= 0.005 && limits.beat_time <= 0.05))
    throw Error("beat_time of the guard", "it is out of range", "give 0.005 to 0.05 s");
  if (!(limits.period >= 1e-4 && limits.period <= 0.01))
    throw Error("period of the guard", "it is out of range", "give 1e-4 to 0.01 s");
  void* shared =
      mmap(nullptr, sizeof(Memory), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (shared == MAP_FAILED) throw Error("guard", std::strerror(errno));
  auto* memory = new (shared) Memory;
  const pid_t session = getpid();
  const pid_t guard = fork();
  if (guard < 0) {
    munmap(shared, sizeof(Memory));
    throw Error("guard", std::strerror(errno), "end other processes");
  }
  if (guard == 0) run_guard(*memory, open, limits, session);
  const double end = monotonic_now() + opening_time;
  int status = 0;
  std::string trouble;
  while (memory->phase.load(std::memory_order_acquire) == Phase::opening && trouble.empty()) {
    if (waitpid(guard, &status, WNOHANG) == guard) trouble = "guard: its process has ended";
    if (monotonic_now() > end) trouble = "guard: the device did not open in 30 s";
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (memory->phase == Phase::refused) trouble = memory->refusal.data();
  if (!trouble.empty()) {
    kill(guard, SIGKILL);
    waitpid(guard, &status, 0);
    munmap(shared, sizeof(Memory));
    throw Error(trouble, "the device could not be opened in its guard process");
  }
  return std::make_unique<GuardedDevice>(memory, guard);
}

}  // namespace palpate
