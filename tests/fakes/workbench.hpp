// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <new>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace palpate::test {

/// [s] on CLOCK_MONOTONIC
inline double clock_now() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Where the fake hand goes.
enum class Path : int { press_and_lift, inside };

/// What a fake device and the test beside it see of each other, in a file that both map. It
/// outlives the process that drives the device, as a device does.
struct Workbench {
  static constexpr const char* variable = "PALPATE_FAKE_WORKBENCH";

  // Set by the test.
  std::atomic<bool> plugged_in{true}, calibrated{true}, too_fast{false}, active_wrist{false};
  std::atomic<bool> wrist_is_off{false};  ///< of an arm that has one
  std::atomic<int> devices{1};
  std::atomic<int> error{0};  ///< the vendor's code that the next call reports once
  std::atomic<Path> path{Path::press_and_lift};

  // Set by the fake: what its motors and its firmware do, in the vendor's axes.
  std::array<std::atomic<double>, 3> force{};   ///< [N] of the last command
  std::array<std::atomic<double>, 3> torque{};  ///< [N m] the same
  std::atomic<double> max_torque{-1.0};         ///< [N m] that it may be; negative: any
  std::atomic<double> commanded{0.0};           ///< [s] when that was
  std::atomic<double> watchdog{0.0};            ///< [s] of the firmware; 0: none
  std::atomic<bool> force_on{false};            ///< the motors take forces
  std::atomic<double> largest{0.0};             ///< [N] so far
  std::atomic<double> largest_first{0.0};       ///< [N] of forces that came after none
  std::atomic<int> opens{0}, commands{0}, calibrations{0}, closes{0};
  std::atomic<double> fell{0.0};         ///< [s] when a force ended last, by the computer's word
  std::atomic<double> longest_gap{0.0};  ///< [s] between commands since the test set it to 0
  std::atomic<double> began{0.0};        ///< [s] when the hand began to move

  /// [N] what the motors give: the firmware lets go when no command came for its watchdog's time.
  [[nodiscard]] double motor_force(double now) const {
    if (!force_on || (watchdog > 0.0 && now - commanded > watchdog)) return 0.0;
    return std::hypot(force[0].load(), force[1].load(), force[2].load());
  }

  /// Takes a force [N] at `now`, in the vendor's axes.
  void command(double x, double y, double z, double now) {
    const double before = motor_force(now);
    if (watchdog > 0.0 && now - commanded > watchdog && commanded > 0.0) force_on = false;
    force[0] = x;
    force[1] = y;
    force[2] = z;
    if (commanded > 0.0) longest_gap = std::fmax(longest_gap, now - commanded);
    commanded = now;
    ++commands;
    const double size = motor_force(now);
    largest = std::fmax(largest, size);
    if (before == 0.0) largest_first = std::fmax(largest_first, size);
    if (before > 0.0 && size == 0.0) fell = now;
  }

  /// [m] x to the right, y away, z up: up to 14 mm above z = 0 and down to 6 mm below it, once a
  /// second, with a slow sway. It begins when the session has run for half a second's ticks: one
  /// that is inside before the first frame comes touches the surface from behind.
  std::array<double, 3> hand(double now) {
    if (began == 0.0 && commands > 500) began = now;
    const double t = began > 0.0 ? now - began : 0.0;
    const double z = path == Path::inside ? -0.006 : 0.004 + 0.01 * std::cos(2.0 * M_PI * t);
    const double sway = 0.004 * std::sin(2.0 * t);
    return {sway, 0.5 * sway, z};
  }
};
static_assert(std::atomic<double>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

/// The workbench in a file; made where it is not there.
inline Workbench& open_workbench(const char* file) {
  const int descriptor = open(file, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  const bool is_new = descriptor >= 0 && lseek(descriptor, 0, SEEK_END) == 0;
  if (descriptor < 0 || ftruncate(descriptor, sizeof(Workbench)) != 0) std::abort();
  void* memory =
      mmap(nullptr, sizeof(Workbench), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  close(descriptor);
  if (memory == MAP_FAILED) std::abort();
  return is_new ? *new (memory) Workbench : *static_cast<Workbench*>(memory);
}

/// What a fake has before it sees a workbench: one that nobody watches.
inline Workbench unwatched_workbench;
inline Workbench* current_workbench = &unwatched_workbench;

/// The workbench of a fake.
inline Workbench& workbench() { return *current_workbench; }
/// Finds the one that the environment names, when a fake's device is opened.
inline void find_workbench() {
  if (const char* file = std::getenv(Workbench::variable))
    current_workbench = &open_workbench(file);
}

}  // namespace palpate::test
