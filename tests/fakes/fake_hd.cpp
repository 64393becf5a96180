// SPDX-License-Identifier: Apache-2.0
// OpenHaptics' HD layer with a Touch that nobody sees. Axes: x to the right, y up, z towards the
// user; millimetres, newtons. Its scheduler is a thread of its own, at the rate that was set.
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <mutex>
#include <thread>

#include <pthread.h>

#include "tests/fakes/workbench.hpp"

namespace {

using palpate::test::clock_now;
using palpate::test::find_workbench;
using palpate::test::workbench;

struct ErrorInfo {
  unsigned code;
  int internal_code;
  unsigned handle;
};
using Callback = unsigned (*)(void*);

constexpr unsigned handle = 7;
constexpr double most_impulse = 0.9;  // [N] a tick; more drops the motors

std::recursive_mutex mutex;  // of all below
std::array<unsigned, 16> errors{};
std::size_t error_count = 0;
bool is_open = false;
bool in_frame = false;
bool framed_this_tick = false;
std::array<double, 3> wanted{};  // [N]
std::array<double, 3> given{};
Callback callback = nullptr;
void* callback_data = nullptr;
std::atomic<bool> running{false};
double rate = 1000.0;  // [Hz]
std::thread scheduler;

void raise(unsigned code) {
  const std::lock_guard lock(mutex);
  if (error_count < errors.size()) errors[error_count++] = code;
}

bool answers() {
  if (is_open && workbench().plugged_in) return true;
  raise(0x302);
  return false;
}

void run_scheduler() {
  sched_param priority{};
  priority.sched_priority = 80;  // where the system grants it
  static_cast<void>(pthread_setschedparam(pthread_self(), SCHED_FIFO, &priority));
  while (running) {
    {
      const std::lock_guard lock(mutex);
      framed_this_tick = false;
    }
    if (callback != nullptr && callback(callback_data) == 0) callback = nullptr;
    std::this_thread::sleep_for(std::chrono::duration<double>(1.0 / rate));
  }
}

}  // namespace

#define EXPORT extern "C" __attribute__((visibility("default")))

EXPORT unsigned hdInitDevice(const char* name) {
  const std::lock_guard lock(mutex);
  find_workbench();
  if (name != nullptr && std::strcmp(name, "Default Device") != 0) {
    raise(0x303);
    return 0xFFFFFFFF;
  }
  if (!workbench().plugged_in) {
    raise(0x300);
    return 0xFFFFFFFF;
  }
  is_open = true;
  in_frame = false;
  ++workbench().opens;
  return handle;
}
EXPORT void hdDisableDevice(unsigned /*device*/) {
  const std::lock_guard lock(mutex);
  if (is_open) ++workbench().closes;
  is_open = false;
  workbench().force_on = false;
}
EXPORT void hdMakeCurrentDevice(unsigned /*device*/) {}
EXPORT void hdBeginFrame(unsigned /*device*/) {
  const std::lock_guard lock(mutex);
  if (!answers()) return;
  if (in_frame) return raise(0x400);
  if (running && framed_this_tick) return raise(0x402);  // one frame a tick
  in_frame = framed_this_tick = true;
  if (const int code = workbench().error.exchange(0); code != 0) {
    raise(static_cast<unsigned>(code));
    if (code >= 0x201 && code <= 0x204) workbench().force_on = false;
  }
}
EXPORT void hdEndFrame(unsigned /*device*/) {
  const std::lock_guard lock(mutex);
  if (!answers()) return;
  if (!in_frame) return raise(0x401);
  in_frame = false;
  const double impulse =
      std::hypot(wanted[0] - given[0], wanted[1] - given[1], wanted[2] - given[2]);
  if (impulse > most_impulse && std::hypot(wanted[0], wanted[1], wanted[2]) > 0.0) {
    raise(0x202);
    workbench().force_on = false;
  }
  given = wanted;
  workbench().command(given[0], given[1], given[2], clock_now());
}
EXPORT void hdEnable(unsigned what) {
  const std::lock_guard lock(mutex);
  if (answers() && what == 0x4000) workbench().force_on = true;
}
EXPORT void hdDisable(unsigned what) {
  const std::lock_guard lock(mutex);
  if (answers() && what == 0x4000) workbench().force_on = false;
}
EXPORT void hdGetDoublev(unsigned name, double* values) {
  const std::lock_guard lock(mutex);
  if (!answers()) return;
  const auto [right, away, up] = workbench().hand(clock_now());
  switch (name) {
    case 0x2050:
      values[0] = 1e3 * right;
      values[1] = 1e3 * up;
      values[2] = -1e3 * away;
      break;
    case 0x2052:
      for (int i = 0; i < 16; ++i) values[i] = i % 5 == 0 ? 1.0 : 0.0;
      break;
    case 0x2551: {
      const std::array<double, 6> box = {-210.0, -110.0, -85.0, 210.0, 205.0, 130.0};
      std::memcpy(values, box.data(), sizeof box);
      break;
    }
    case 0x2603:
      values[0] = 3.4;
      break;
    case 0x2604:
      values[0] = 0.88;
      break;
    case 0x2605:
      for (int i = 0; i < 6; ++i) values[i] = workbench().too_fast ? 0.99 : 0.2;  // hot motors
      break;
    default:
      raise(0x100);
  }
}
EXPORT void hdGetIntegerv(unsigned name, int* values) {
  if (name == 0x2000) {
    *values = 2;
  } else if (name == 0x2555) {
    *values = 4;  // inkwell
  } else {
    raise(0x100);
  }
}
EXPORT const char* hdGetString(unsigned name) {
  return name == 0x2501 ? "Touch" : name == 0x2504 ? "20230117" : nullptr;
}
EXPORT void hdSetDoublev(unsigned name, const double* values) {
  const std::lock_guard lock(mutex);
  if (!answers()) return;
  if (!in_frame) return raise(0x102);
  if (name == 0x2700) std::memcpy(wanted.data(), values, sizeof wanted);
}
EXPORT ErrorInfo hdGetError() {
  const std::lock_guard lock(mutex);
  return {error_count == 0 ? 0 : errors[--error_count], 0, handle};
}
EXPORT const char* hdGetErrorString(unsigned code) {
  return code == 0x300 ? "device fault" : code == 0x303 ? "no such device" : "error";
}
EXPORT unsigned long hdScheduleAsynchronous(Callback function, void* data, unsigned short) {
  callback = function;
  callback_data = data;
  return 1;
}
EXPORT void hdUnschedule(unsigned long) { callback = nullptr; }
EXPORT void hdSetSchedulerRate(unsigned long hertz) { rate = static_cast<double>(hertz); }
EXPORT void hdStartScheduler() {
  running = true;
  scheduler = std::thread(run_scheduler);
}
EXPORT void hdStopScheduler() {
  running = false;
  if (scheduler.joinable()) scheduler.join();
}
EXPORT unsigned hdCheckCalibration() {
  const std::lock_guard lock(mutex);
  if (!in_frame) raise(0x102);
  return workbench().calibrated ? 0x5000 : 0x5002;
}
EXPORT void hdUpdateCalibration(unsigned) { ++workbench().calibrations; }
