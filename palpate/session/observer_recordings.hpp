// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "palpate/servo/end_signal.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// Where recordings go that a page or a node of ROS 2 starts, and how large they may grow.
struct RecordingRules {
  std::filesystem::path folder = {};  ///< made when it is needed; empty: the current one
  double limit = 20e9;                ///< [bytes] of all that they record in a session
  double keep_free = 1e9;             ///< [bytes] left free on the disk
  double interval = 0.5;              ///< [s] between two looks at the sizes
  bool own_thread = true;             ///< false: `look` is called now and then
};

/// The recordings that observers start, a page or a node of ROS 2: in one folder, under names made
/// here, ended in time.
///
/// A thread of its own looks at the sizes while a recording is on, as a disk may be slow.
class ObserverRecordings {
 public:
  /// @param session  must outlive this
  ObserverRecordings(Session& session, RecordingRules rules);
  ~ObserverRecordings();

  /// Begins a recording, unless one is on. @throws Error if the limit is reached, the disk is
  /// nearly full or the folder cannot be made.
  void start();
  void stop();
  /// Ends a recording that has reached a limit.
  void look();
  /// Why the last one was ended by its limits; empty if it was not. Any thread.
  [[nodiscard]] std::string ended() const;
  /// [bytes] until a limit ends one, as of the last look; none before the first. Any thread.
  [[nodiscard]] std::optional<double> room() const;

 private:
  std::string reason_to_end();  // empty: none

  Session& session_;
  const RecordingRules rules_;
  mutable std::mutex mutex_;
  std::vector<std::filesystem::path> folders_;  // guarded by mutex_: of all that were begun
  std::string ended_;                           // guarded by mutex_
  std::optional<double> room_;                  // guarded by mutex_
  bool watching_ = false;                       // guarded by mutex_
  EndSignal end_;
  std::thread thread_;
};

}  // namespace palpate
