// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <thread>

#include <sqlite3.h>

namespace palpate::test {

/// While one of these is there, the recordings of this process are on a disk that takes `delay` for
/// each write, or hangs. Set `hangs` to false before it goes.
class SlowDisk {
 public:
  SlowDisk() {
    usual = sqlite3_vfs_find(nullptr);
    slow = *usual;
    slow.zName = "slow";
    slow.xOpen = open;
    sqlite3_vfs_register(&slow, 1);
  }
  ~SlowDisk() {
    sqlite3_vfs_register(usual, 1);
    sqlite3_vfs_unregister(&slow);
  }
  SlowDisk(const SlowDisk&) = delete;
  SlowDisk& operator=(const SlowDisk&) = delete;

  static inline std::atomic<bool> hangs{false}, is_hanging{false};
  static inline std::atomic<std::chrono::microseconds> delay{};

 private:
  static int open(sqlite3_vfs* /*vfs*/, const char* name, sqlite3_file* file, int flags, int* got) {
    const int code = usual->xOpen(usual, name, file, flags, got);
    if (file->pMethods == nullptr) return code;
    const std::lock_guard lock(mutex);
    sqlite3_io_methods& methods = tables.try_emplace(file->pMethods, *file->pMethods).first->second;
    if (methods.xWrite != write) {
      usual_write = methods.xWrite;  // the same in all tables
      methods.xWrite = write;
    }
    file->pMethods = &methods;
    return code;
  }

  static int write(sqlite3_file* to, const void* bytes, int count, sqlite3_int64 at) {
    for (; hangs; std::this_thread::sleep_for(std::chrono::milliseconds(1))) is_hanging = true;
    is_hanging = false;
    std::this_thread::sleep_for(delay.load());
    return usual_write.load()(to, bytes, count, at);
  }

  static inline std::mutex mutex;
  // By the tables of the usual disk: databases and journals have different ones.
  static inline std::map<const sqlite3_io_methods*, sqlite3_io_methods> tables;
  static inline std::atomic<decltype(sqlite3_io_methods::xWrite)> usual_write{};
  static inline sqlite3_vfs* usual = nullptr;
  static inline sqlite3_vfs slow{};
};

}  // namespace palpate::test
