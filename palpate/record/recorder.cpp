// SPDX-License-Identifier: Apache-2.0
#include "palpate/record/recorder.hpp"

#include <chrono>
#include <exception>
#include <utility>

#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr std::size_t most_items = 150;            // frames of five seconds, 90 MB
constexpr std::chrono::milliseconds interval{20};  // between looks at the ring, which holds seconds

}  // namespace

Recorder::Recorder(const std::filesystem::path& folder, const SessionInfo& info,
                   TickRing<ServoTick>::Reader ticks, std::function<void()> renew)
    : info_(info),
      writer_(folder, info, monotonic_now()),
      ticks_(ticks),
      renew_(std::move(renew)),
      begun_(!renew_) {
  status_.folder = writer_.folder();
  thread_ = std::thread([this] { run(); });
}

Recorder::~Recorder() {
  stop();
}

void Recorder::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  asked_.notify_all();
  if (thread_.joinable()) thread_.join();
}

Recorder::Status Recorder::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void Recorder::frame(std::uint64_t number, double stamp,
                     std::vector<std::shared_ptr<const Cloud>> cameras) {
  const std::lock_guard lock(mutex_);
  if (stopping_) return;
  frame_handed_ = number;
  if (items_.size() >= most_items) {
    ++status_.lost_frames;
    return;
  }
  items_.emplace_back(PutFrame{number, stamp, std::move(cameras)});
}

void Recorder::settings(const NumberedSettings& settings, double t) {
  const std::lock_guard lock(mutex_);
  if (stopping_) return;
  settings_handed_ = settings.number;
  items_.emplace_back(SetSettings{settings, t});
}

void Recorder::flush() {
  std::unique_lock lock(mutex_);
  const std::uint64_t mine = ++flushes_asked_;
  asked_.notify_all();
  done_.wait(lock, [&] { return stopping_ || flushes_done_ >= mine; });
}

void Recorder::run() {
  try {
    for (bool last = false; !last;) {
      std::uint64_t flushes = 0;
      bool flush = false;
      {
        std::unique_lock lock(mutex_);
        asked_.wait_for(lock, interval,
                        [this] { return stopping_ || flushes_asked_ > flushes_done_; });
        last = stopping_;
        flushes = flushes_asked_;
        flush = flushes > flushes_done_;
      }
      write_ticks();
      write_items();
      // What is committed can be replayed to its end: all that its ticks used is in it.
      if (flush) {
        writer_.commit();
      } else if (frame_used_ <= frame_written_ && settings_used_ <= settings_written_) {
        writer_.commit_if_due();
      }
      {
        const std::lock_guard lock(mutex_);
        flushes_done_ = flushes;
      }
      done_.notify_all();
    }
    writer_.close();
  } catch (const std::exception& error) {
    const std::lock_guard lock(mutex_);
    status_.trouble = error.what();
    items_.clear();
    stopping_ = true;
  }
  done_.notify_all();
}

bool Recorder::knows_what_it_used(const ServoTick& tick) const {
  const std::lock_guard lock(mutex_);
  return tick.frame_number <= frame_handed_ && tick.settings_number <= settings_handed_;
}

void Recorder::write_ticks() {
  for (ServoTick tick{}; waiting_ || ticks_.try_pop(tick);) {
    if (waiting_) tick = *std::exchange(waiting_, std::nullopt);
    if (!begun_) {
      const bool first = (tick.hand & rendering_renewed) != 0;
      if (!first) {
        proxy_ = tick.tick.proxy;
        // Only now, so that the tick before the first is known.
        if (renew_) std::exchange(renew_, nullptr)();
        continue;
      }
      begun_ = true;
      info_.seat = proxy_;
      writer_.info(info_, tick.tick.t);
    }
    if (!knows_what_it_used(tick)) {
      waiting_ = tick;
      break;
    }
    writer_.tick(tick);
    frame_used_ = tick.frame_number;
    settings_used_ = tick.settings_number;
  }
  const std::lock_guard lock(mutex_);
  status_.ticks = writer_.ticks();
  status_.lost_ticks = begun_ ? ticks_.lost() : 0;
}

void Recorder::write_items() {
  std::deque<Item> items;
  {
    const std::lock_guard lock(mutex_);
    items.swap(items_);
  }
  for (const Item& item : items) {
    if (const auto* frame = std::get_if<PutFrame>(&item)) {
      writer_.frame(frame->number, frame->stamp, frame->cameras);
      frame_written_ = frame->number;
    } else {
      const auto& set = std::get<SetSettings>(item);
      writer_.settings(set.settings, set.t);
      settings_written_ = set.settings.number;
    }
    // Images take milliseconds to pack: ticks are not to wait for many of them.
    write_ticks();
  }
  const std::lock_guard lock(mutex_);
  status_.frames = writer_.frames();
}

}  // namespace palpate
