// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "palpate/sources/source.hpp"

namespace palpate::app {

/// How a camera is doing.
struct CameraStatus {
  std::string uri, kind;
  double rate = 0.0;           ///< [Hz] of the frames lately
  std::string state = "live";  ///< or what is wrong
};

/// A source on a thread of its own, frame by frame at the pace of its stamps.
///
/// What ends begins again; a source of one frame shows it for ever.
class LiveCamera {
 public:
  /// @param frame   its stamp is the time it is handed over, or was due, on monotonic_now()'s clock
  /// @param is_new  false where the only frame is shown again
  using Sink = std::function<void(const Frame& frame, bool is_new)>;

  /// Opens the source and reads its first frame. @throws Error as open_source, or if it is empty.
  explicit LiveCamera(std::string uri);
  /// Stops.
  ~LiveCamera();
  LiveCamera(const LiveCamera&) = delete;
  LiveCamera& operator=(const LiveCamera&) = delete;

  [[nodiscard]] const Frame& first_frame() const { return first_; }
  /// Starts the thread, which calls `sink`.
  void start(Sink sink);
  /// Returns when the sink is not called any more.
  void stop();
  /// Any thread.
  [[nodiscard]] CameraStatus status() const;

 private:
  void run(const Sink& sink);
  std::optional<Frame> next_frame();
  bool wait_until(double t);

  std::string uri_;
  std::unique_ptr<Source> source_;
  Frame first_;
  std::size_t frames_ = 1;  // of this pass
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  CameraStatus status_;    // guarded by mutex_
  bool stopping_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace palpate::app
