// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "palpate/record/session_writer.hpp"
#include "palpate/servo/tick_ring.hpp"

namespace palpate {

/// Records a live session on a thread of its own: ticks from the servo's ring, frames and settings
/// from whoever hands them to the loop. Nobody waits for the disk; where it cannot keep up, what is
/// lost is counted.
class Recorder {
 public:
  struct Status {
    std::filesystem::path folder;
    std::string trouble;  ///< why it ended before it was stopped; empty if it did not
    std::uint64_t ticks = 0, frames = 0;
    std::uint64_t lost_ticks = 0, lost_frames = 0;
  };

  /// Starts.
  /// @param folder  of the bag; must not be there yet
  /// @param ticks   a reader of the loop that nobody else reads
  /// @param renew   none if the loop has not started. Else asks the loop for a new renderer
  ///                (Cycle::renew), which the first tick recorded has; called once, on this thread.
  /// @throws Error if the folder is there or cannot be made.
  Recorder(const std::filesystem::path& folder, const SessionInfo& info,
           TickRing<ServoTick>::Reader ticks, std::function<void()> renew = {});
  /// Stops.
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// A frame that the loop got, with its number there, in their order. Any thread. Does not wait
  /// for the disk.
  /// @param cameras  as SessionWriter::frame's
  void frame(std::uint64_t number, double stamp, std::vector<std::shared_ptr<const Cloud>> cameras);
  /// Settings that the loop got. Any thread. Does not wait for the disk.
  void settings(const NumberedSettings& settings, double t);

  /// Returns when what has come so far is written and committed, or the recording has ended. Waits
  /// for the disk: not for the servo's thread or a camera's.
  void flush();
  /// Records what has come so far and closes the bag. Ticks that use a frame or settings that this
  /// was not handed any more are left out. Not from `renew`.
  void stop();
  /// Any thread.
  [[nodiscard]] Status status() const;

 private:
  struct PutFrame {
    std::uint64_t number;
    double stamp;
    std::vector<std::shared_ptr<const Cloud>> cameras;
  };
  struct SetSettings {
    NumberedSettings settings;
    double t;
  };
  using Item = std::variant<PutFrame, SetSettings>;

  void run();
  void write_items();
  void write_ticks();
  [[nodiscard]] bool knows_what_it_used(const ServoTick& tick) const;

  // The recorder's thread.
  SessionInfo info_;
  SessionWriter writer_;
  TickRing<ServoTick>::Reader ticks_;
  std::function<void()> renew_;
  std::optional<ServoTick> waiting_;  // for its frame or settings
  bool begun_ = false;
  std::optional<Vec3> proxy_;  // [m] in the tick before the first recorded one
  std::uint64_t frame_used_ = 0, frame_written_ = 0;  // their numbers
  std::uint64_t settings_used_ = 0, settings_written_ = 0;

  mutable std::mutex mutex_;
  std::condition_variable asked_, done_;
  std::deque<Item> items_;                                // guarded by mutex_
  Status status_;                                         // guarded by mutex_
  std::uint64_t frame_handed_ = 0, settings_handed_ = 0;  // their numbers; guarded by mutex_
  bool stopping_ = false;                                 // guarded by mutex_
  std::uint64_t flushes_asked_ = 0, flushes_done_ = 0;    // guarded by mutex_
  std::thread thread_;
};

}  // namespace palpate
