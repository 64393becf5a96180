// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <thread>

#include <sys/syscall.h>
#include <unistd.h>

namespace palpate::test {

/// While one of these is there, the recordings of this process are on a disk that takes `delay` for
/// each write, or hangs. Set `hangs` to false before it goes. To be included in one file.
class SlowDisk {
 public:
  ~SlowDisk() {
    hangs = false;
    delay = std::chrono::microseconds();
  }
  static inline std::atomic<bool> hangs{false}, is_hanging{false};
  static inline std::atomic<std::chrono::microseconds> delay{};
};

}  // namespace palpate::test

// Takes the place of the system's own, with which a bag is written.
extern "C" ssize_t pwrite(int file, const void* bytes, size_t count, off_t at) {
  using palpate::test::SlowDisk;
  for (; SlowDisk::hangs; std::this_thread::sleep_for(std::chrono::milliseconds(1)))
    SlowDisk::is_hanging = true;
  SlowDisk::is_hanging = false;
  std::this_thread::sleep_for(SlowDisk::delay.load());
  return static_cast<ssize_t>(syscall(SYS_pwrite64, file, bytes, count, at));
}
