// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

namespace palpate::app {

/// A progress line on standard error while a person watches: on a terminal only, never in a pipe.
class Progress {
 public:
  Progress(std::string what, std::size_t total)
      : what_(std::move(what)), total_(std::max<std::size_t>(total, 1)) {}

  void advance() { set(done_ + 1); }
  /// So many are done.
  void set(std::size_t done) {
    done_ = done;
    const int percent = static_cast<int>(100 * done_ / total_);
    if (!watched_ || percent == shown_percent_) return;
    shown_percent_ = percent;
    const int bar = percent * 40 / 100;
    fmt::print(stderr, "\r{} [{:<40}] {:>3} %", what_, std::string(bar, '='), percent);
    std::fflush(stderr);
  }
  /// Clears the line.
  void finish() {
    if (watched_ && shown_percent_ >= 0) fmt::print(stderr, "\r{:<{}}\r", "", what_.size() + 50);
  }

 private:
  std::string what_;
  std::size_t total_;
  std::size_t done_ = 0;
  int shown_percent_ = -1;
  bool watched_ = isatty(STDERR_FILENO) == 1;
};

}  // namespace palpate::app
