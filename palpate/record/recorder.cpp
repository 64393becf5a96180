// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/recorder.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr std::chrono::milliseconds interval{20};  // between looks at the ring, which holds seconds

}  // namespace

Recorder::Recorder(const std::filesystem::path& folder, const SessionInfo& info,
                   const CycleReader& cycle, std::function<void()> renew,
                   const RecorderOptions& options)
    : options_(options), cycle_(cycle), renew_(std::move(renew)), begun_(!renew_), info_(info) {
  info_.frames_in_parent = !options_.with_frames;
  writer_.emplace(folder, info_, monotonic_now(), options.commit_interval);
  status_.folder = writer_->folder();
  if (!options_.own_threads) return;
  threads_.emplace_back([this] { collect(); });
  threads_.emplace_back([this] { write(); });
  threads_.emplace_back([this] { pack(); });
}

Recorder::~Recorder() {
  request_stop();
  for (std::thread& thread : threads_) thread.join();
}

void Recorder::request_stop() {
  {
    const std::lock_guard lock(mutex_);
    if (stopping_) return;
    stopping_ = true;
    status_.closing = !status_.done;
    wake_collector_.notify_all();
    wake_packer_.notify_all();
    wake_writer_.notify_all();
    progress_.notify_all();
  }
  if (!options_.own_threads) work();
}

bool Recorder::done() const {
  const std::lock_guard lock(mutex_);
  return status_.done;
}

void Recorder::stop() {
  request_stop();
  std::unique_lock lock(mutex_);
  progress_.wait(lock, [this] { return status_.done; });
}

bool Recorder::try_stop(double patience) {
  using Clock = std::chrono::steady_clock;
  const auto wait =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(patience));
  request_stop();
  std::unique_lock lock(mutex_);
  progress_.wait(lock, [this] { return !collecting_; });
  const Clock::time_point end = Clock::now() + 6 * wait;
  const auto written = [this] { return entries_written_ + status_.ticks; };
  for (std::uint64_t before = written();; before = written()) {
    const bool moved = progress_.wait_until(lock, std::min(end, Clock::now() + wait),
                                            [&] { return status_.done || written() != before; });
    if (status_.done || !moved || Clock::now() >= end) return status_.done;
  }
}

Recorder::Status Recorder::status() const {
  const std::lock_guard lock(mutex_);
  Status status = status_;
  status.ticks_waiting = collected_.size();
  status.frames_waiting = static_cast<std::uint64_t>(std::count_if(
      entries_.begin(), entries_.end(),
      [](const Entry& entry) { return std::holds_alternative<std::shared_ptr<PutFrame>>(entry); }));
  return status;
}

void Recorder::frame(std::uint64_t number, double stamp, std::size_t camera,
                     std::shared_ptr<const Cloud> cloud) {
  const std::lock_guard lock(mutex_);
  if (stopping_) return;
  auto frame = std::make_shared<PutFrame>(
      PutFrame{.number = number, .stamp = stamp, .camera = camera, .cloud = {}});
  if (options_.with_frames && entries_.size() >= options_.most_frames) {
    ++status_.lost_frames;
  } else if (options_.with_frames) {
    frame->cloud = std::move(cloud);
    const bool is_known = std::exchange(newest_[camera], frame->cloud) == frame->cloud;
    frame->ready = is_known || frame->cloud->image() == nullptr || !options_.own_threads;
  }
  if (!frame->ready) {
    to_pack_.push_back(frame);
    wake_packer_.notify_one();
  }
  entries_.emplace_back(std::move(frame));
  ++entries_handed_;
  wake_writer_.notify_one();
}

void Recorder::commands(const ServoCommands& commands, double t) {
  const std::lock_guard lock(mutex_);
  if (stopping_) return;
  entries_.emplace_back(Told{commands, t});
  ++entries_handed_;
  wake_writer_.notify_one();
}

void Recorder::flush() {
  if (!options_.own_threads) return work();
  std::unique_lock lock(mutex_);
  const std::uint64_t mine = ++flushes_asked_;
  flush_entries_ = entries_handed_;
  wake_collector_.notify_all();
  progress_.wait(lock, [&] { return stopping_ || flushes_done_ >= mine; });
}

void Recorder::fail(const std::string& trouble) {
  const std::lock_guard lock(mutex_);
  if (!failed_) status_.trouble = trouble;
  failed_ = true;
  stopping_ = true;
  status_.closing = false;
  entries_.clear();
  to_pack_.clear();
  collected_.clear();
  adopted_.clear();
  wake_collector_.notify_all();
  wake_packer_.notify_all();
  wake_writer_.notify_all();
}

template <class Work>
void Recorder::guarded(const Work& work) {
  try {
    work();
  } catch (const std::exception& error) {
    fail(error.what());
  }
}

void Recorder::work() {
  if (!writer_) return;
  guarded([this] {
    collect_ticks();
    while (has_ready_entry()) {
      write_entries();
      writer_->commit_if_due();
    }
    while (write_ticks()) {
    }
    writer_->commit_if_due();
    if (stopping_) writer_->close();
    const std::lock_guard lock(mutex_);
    status_.committed_ticks = writer_->ticks();
    status_.bytes = writer_->bytes();
  });
  const std::lock_guard lock(mutex_);
  if (!stopping_) return;
  writer_.reset();
  collecting_ = status_.closing = false;
  status_.done = true;
}

void Recorder::collect() {
  guarded([this] {
    for (bool last = false; !last;) {
      std::uint64_t flushes = 0;
      {
        std::unique_lock lock(mutex_);
        wake_collector_.wait_for(
            lock, interval, [this] { return stopping_ || flushes_asked_ > flushes_collected_; });
        last = stopping_;
        flushes = flushes_asked_;
      }
      collect_ticks();
      const std::lock_guard lock(mutex_);
      flushes_collected_ = flushes;
      if (flush_is_due()) wake_writer_.notify_one();
    }
  });
  const std::lock_guard lock(mutex_);
  collecting_ = false;
  wake_writer_.notify_one();
  progress_.notify_all();
}

// The first tick of a recording that begins in mid-session.
void Recorder::begin(const ServoTick& first) {
  begun_ = true;
  CycleState state;
  bool found = false;
  while (!found && cycle_.states.try_pop(state))
    found = state.numbers[0] == static_cast<double>(first.number);
  const std::lock_guard lock(mutex_);
  if (found) state_.emplace(state, first.tick.t);
}

void Recorder::collect_ticks() {
  constexpr std::size_t most_at_once = 4096;
  std::vector<ServoTick> ticks;
  bool more = true;
  while (more) {
    ticks.clear();
    for (ServoTick tick{}; ticks.size() < most_at_once;) {
      more = cycle_.ticks.try_pop(tick);
      if (!more) break;
      if (!begun_) {
        if ((tick.hand & method_switched) == 0) {
          tick_before_ = tick.number;
          // Only now, so that the tick before the first is known.
          if (renew_) std::exchange(renew_, nullptr)();
          continue;
        }
        begin(tick);
      }
      ticks.push_back(tick);
    }
    // After the ticks, so that none lacks its frame.
    for (AdoptedFrame frame; cycle_.frames.try_pop(frame);) {
      // Of those before the first recorded tick, the last one of each camera is in use there.
      if (frame.tick <= tick_before_) {
        std::erase_if(frames_taken_, [&](const AdoptedFrame& before) {
          return before.cameras[0].camera == frame.cameras[0].camera;
        });
      }
      frames_taken_.push_back(frame);
    }
    const std::lock_guard lock(mutex_);
    if (failed_) return;
    if (begun_) {
      adopted_.insert(adopted_.end(), frames_taken_.begin(), frames_taken_.end());
      frames_taken_.clear();
    }
    if (begun_) status_.lost_ticks = cycle_.ticks.lost() + overflowed_;
    for (const ServoTick& tick : ticks) {
      if (collected_.size() < options_.most_ticks) {
        collected_.push_back(tick);
      } else {
        ++overflowed_;
        ++status_.lost_ticks;
      }
    }
  }
}

void Recorder::pack() {
  guarded([this] {
    for (;;) {
      std::shared_ptr<PutFrame> frame;
      {
        std::unique_lock lock(mutex_);
        wake_packer_.wait(lock, [this] { return stopping_ || !to_pack_.empty(); });
        if (to_pack_.empty()) return;
        frame = std::move(to_pack_.front());
        to_pack_.pop_front();
      }
      PackedImage packed = packed_image(*frame->cloud);
      const std::lock_guard lock(mutex_);
      frame->packed = std::move(packed);
      frame->ready = true;
      wake_writer_.notify_one();
    }
  });
}

bool Recorder::has_ready_entry() const {
  if (entries_.empty()) return false;
  const auto* frame = std::get_if<std::shared_ptr<PutFrame>>(&entries_.front());
  return frame == nullptr || (*frame)->ready;
}

bool Recorder::flush_is_due() const {
  return flushes_collected_ > flushes_done_ && entries_written_ >= flush_entries_;
}

// Hazard: hanging-disk, killed-recording
void Recorder::write() {
  guarded([this] {
    for (bool last = false; !last;) {
      std::uint64_t flushes = 0;  // whose ticks are collected
      {
        std::unique_lock lock(mutex_);
        const auto is_end = [this] { return stopping_ && !collecting_ && entries_.empty(); };
        // Ticks are no reason to wake up: they come all the time and wait for frames anyway.
        wake_writer_.wait_for(lock, interval, [&] {
          return failed_ || has_ready_entry() || flush_is_due() || is_end();
        });
        if (failed_) return;
        last = is_end();
        flushes = flushes_collected_;
      }
      write_entries();
      while (write_ticks() && (last || !writer_->commit_is_due())) {
      }
      bool flush = false;
      {
        const std::lock_guard lock(mutex_);
        flush = flushes > flushes_done_ && entries_written_ >= flush_entries_;
      }
      if (flush) writer_->commit();
      const bool committed = flush || writer_->commit_if_due();
      const std::lock_guard lock(mutex_);
      if (committed) status_.committed_ticks = writer_->ticks();
      status_.bytes = writer_->bytes();
      if (flush) flushes_done_ = flushes;
      progress_.notify_all();
    }
    writer_->close();
    const std::lock_guard lock(mutex_);
    status_.committed_ticks = writer_->ticks();
    status_.bytes = writer_->bytes();
  });
  writer_.reset();  // here, as closing waits for the disk even after trouble
  const std::lock_guard lock(mutex_);
  status_.closing = false;
  status_.done = true;
  progress_.notify_all();
}

void Recorder::write_entries() {
  for (;;) {
    std::optional<Entry> entry;
    {
      const std::lock_guard lock(mutex_);
      if (failed_ || !has_ready_entry()) return;
      entry = entries_.front();
    }
    if (const auto* put = std::get_if<std::shared_ptr<PutFrame>>(&*entry)) {
      const PutFrame& frame = **put;
      if (frame.cloud) {
        const bool is_packed = !frame.packed.depth.empty();
        writer_->frame(frame.number, frame.stamp, frame.camera, frame.cloud,
                       is_packed ? &frame.packed : nullptr);
      } else if (options_.with_frames) {
        writer_->left_out(frame.number, frame.stamp);
      }
      frame_written_ = frame.number;
    } else {
      const auto& told = std::get<Told>(*entry);
      writer_->commands(told.commands, told.t);
      commands_written_ = told.commands.number;
    }
    const std::lock_guard lock(mutex_);
    ++entries_written_;
    if (failed_) return;
    entries_.pop_front();
    status_.frames = writer_->frames();
    progress_.notify_all();
    // A slow disk must not put off the commit.
    if (writer_->commit_is_due()) return;
  }
}

// @return true if there may be more to write
bool Recorder::write_ticks() {
  constexpr std::size_t most_at_once = 4096;
  std::vector<ServoTick> ticks;
  std::deque<AdoptedFrame> adopted;
  std::optional<std::pair<CycleState, double>> state;
  {
    const std::lock_guard lock(mutex_);
    adopted.swap(adopted_);
    state = std::exchange(state_, std::nullopt);
    while (!collected_.empty() && ticks.size() < most_at_once) {
      const ServoTick& tick = collected_.front();
      if (tick.frame_number > frame_written_ || !commands_written_ ||
          tick.settings_number > *commands_written_)
        break;
      ticks.push_back(tick);
      collected_.pop_front();
    }
  }
  if (state) writer_->state(state->first, state->second);
  for (const AdoptedFrame& frame : adopted) writer_->adopted(frame);
  for (const ServoTick& tick : ticks) writer_->tick(tick);
  const std::lock_guard lock(mutex_);
  status_.ticks = writer_->ticks();
  progress_.notify_all();
  return ticks.size() == most_at_once;
}

}  // namespace palpate
