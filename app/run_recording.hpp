// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "palpate/record/session_writer.hpp"

namespace palpate::app {

/// The recording of a headless run, or of none if no folder is named. A disk that is full ends the
/// recording, with a message on standard error, and not the run.
class RunRecording {
 public:
  /// @param folder  of the bag; empty for no recording
  /// @param info    kind, version and epoch are filled in
  /// @param start   [s] of the session's clock at which the run begins
  /// @throws Error if the folder is there already or cannot be made.
  RunRecording(const std::string& folder, SessionInfo info, const ServoSettings& settings,
               double start);

  /// A frame was adopted. @param cameras  what each saw last
  void frame(double stamp, std::span<const std::shared_ptr<const Cloud>> cameras);
  void tick(const Tick& tick);
  /// @return false if the recording was broken off
  bool finish();

 private:
  template <class Write>
  void attempt(const Write& write);

  std::unique_ptr<SessionWriter> writer_;
  std::uint64_t frames_ = 0, ticks_ = 0;
  double stamp_ = 0.0;
  bool broken_off_ = false;
};

}  // namespace palpate::app
