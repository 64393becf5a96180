// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
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

/// How a Recorder shares out its work. The defaults suit a disk of 50 MB/s.
struct RecorderOptions {
  double commit_interval = 0.5;     ///< [s] on the machine's clock: how much a crash can cost
  std::size_t most_frames = 150;    ///< waiting; the next is left out, and counted. 90 MB at VGA
  std::size_t most_ticks = 60'000;  ///< waiting; the next are lost, and counted. 20 MB
  /// False: another recording of the session has the frames; see SessionInfo::frames_in_parent.
  bool with_frames = true;
  /// False: it has none, and everything happens in `flush` and `request_stop`, on their thread.
  bool own_threads = true;
};

/// Records a live session on threads of its own: ticks from the servo's ring, frames and settings
/// from whoever hands them to the loop. None of these waits for a compressor or the disk.
///
/// One thread empties the ring, one packs images, one compresses all and writes. A tick is written
/// after the frame and the settings that it used, so that whatever is committed can be replayed to
/// its end; a commit is made twice a second, however much is waiting. Where the machine cannot keep
/// up, frames are left out, then ticks are lost, and each is counted.
class Recorder {
 public:
  struct Status {
    std::filesystem::path folder;
    std::string trouble;   ///< why it ended before it was stopped; empty if it did not
    bool closing = false;  ///< asked to stop, and not done yet
    bool done = false;     ///< everything is written and the bag is closed, or there was trouble
    std::uint64_t ticks = 0, frames = 0;  ///< written
    std::uint64_t committed_ticks = 0;    ///< of these, safe from a crash of the program
    std::uint64_t ticks_waiting = 0, frames_waiting = 0;
    std::uint64_t bytes = 0;  ///< of the bag's file so far
    std::uint64_t lost_ticks = 0, lost_frames = 0;
  };

  /// Starts.
  /// @param folder  of the bag; must not be there yet
  /// @param cycle   a reader of the loop that nobody else reads; the loop must outlive this
  /// @param renew   none if the loop has not started. Else asks the loop for a new renderer
  ///                (Cycle::renew), which the first tick recorded has; called once, on a thread of
  ///                this.
  /// @throws Error if the folder is there or cannot be made.
  Recorder(const std::filesystem::path& folder, const SessionInfo& info, const CycleReader& cycle,
           std::function<void()> renew = {}, const RecorderOptions& options = {});
  /// Stops, and waits until it is done.
  ~Recorder();

  /// A frame that the loop got, with its number there, in their order. Any thread. Does not wait
  /// for the disk.
  void frame(std::uint64_t number, double stamp, std::size_t camera,
             std::shared_ptr<const Cloud> cloud);
  /// What the loop was told. Any thread. Does not wait for the disk.
  void commands(const ServoCommands& commands, double t);

  /// Returns when what has come so far is written and committed, or the recording has ended. Waits
  /// for the disk: not for the servo's thread, a camera's or the page's.
  void flush();
  /// Asks for the end and returns at once: no frame or setting is taken any more, what has come so
  /// far is written, and the bag is closed. Ticks that use a frame or settings that this was not
  /// handed are left out. Any thread, but not from `renew`.
  void request_stop();
  /// Is everything written and the bag closed? Any thread; does not wait.
  [[nodiscard]] bool done() const;
  /// request_stop(), and waits until done(). Not for a thread on which a hand depends.
  void stop();
  /// The same, but gives up when the disk has taken nothing for `patience` [s], or not all within
  /// six times that. The cycle's reader is not used any more then, and the bag is closed when the
  /// disk continues; only the destructor waits for that.
  /// @return done()
  bool try_stop(double patience);
  /// Any thread.
  [[nodiscard]] Status status() const;

 private:
  struct PutFrame {
    std::uint64_t number;
    double stamp;
    std::size_t camera;
    std::shared_ptr<const Cloud> cloud;  // null: left out
    PackedImage packed{};
    bool ready = true;  // guarded by mutex_, as is packed until it is set
  };
  struct Told {
    ServoCommands commands;
    double t;
  };
  using Entry = std::variant<std::shared_ptr<PutFrame>, Told>;

  void work();     // all of it, where there is no thread
  void collect();  // the thread that empties the ring
  void pack();     // the thread that packs images
  void write();    // the thread that writes the bag
  void collect_ticks();
  void begin(const ServoTick& first);
  void write_entries();
  bool write_ticks();
  [[nodiscard]] bool has_ready_entry() const;
  [[nodiscard]] bool flush_is_due() const;
  void fail(const std::string& trouble);
  template <class Work>
  void guarded(const Work& work);

  RecorderOptions options_;

  // The collecting thread's.
  CycleReader cycle_;
  std::function<void()> renew_;
  bool begun_ = false;
  std::optional<std::uint64_t> tick_before_;  // number of the tick before the first recorded one
  std::vector<AdoptedFrame> frames_taken_;    // not handed on yet: the last before it, and later
  std::uint64_t overflowed_ = 0;              // ticks that found no room in collected_

  // The writing thread's.
  SessionInfo info_;
  std::optional<SessionWriter> writer_;
  std::uint64_t frame_written_ = 0;                // its number
  std::optional<std::uint64_t> commands_written_;  // their number
  std::uint64_t entries_written_ = 0;

  mutable std::mutex mutex_;
  std::condition_variable wake_collector_, wake_packer_, wake_writer_, progress_;
  // All below are guarded by mutex_.
  std::deque<Entry> entries_;                      // to be written, in this order
  std::deque<std::shared_ptr<PutFrame>> to_pack_;  // of these, what no thread has taken yet
  std::deque<ServoTick> collected_;                // ticks to be written
  std::deque<AdoptedFrame> adopted_;               // to be written before them
  std::map<std::size_t, std::shared_ptr<const Cloud>> newest_;  // of each camera, as handed over
  std::uint64_t entries_handed_ = 0;
  std::optional<std::pair<CycleState, double>> state_;  // before the first tick; when that was [s]
  Status status_;
  bool stopping_ = false, collecting_ = true, failed_ = false;
  std::uint64_t flushes_asked_ = 0, flushes_collected_ = 0, flushes_done_ = 0, flush_entries_ = 0;

  std::vector<std::thread> threads_;
};

}  // namespace palpate
