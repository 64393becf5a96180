// SPDX-License-Identifier: Apache-2.0
#include "app/progress.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

namespace palpate::app {

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)),
      total_(std::max<std::size_t>(total, 1)),
      watched_(isatty(STDERR_FILENO) == 1) {}

void Progress::set(std::size_t done) {
  done_ = done;
  const int percent = static_cast<int>(100 * done_ / total_);
  if (!watched_ || percent == shown_percent_) return;
  shown_percent_ = percent;
  const int bar = percent * 40 / 100;
  fmt::print(stderr, "\r{} [{:<40}] {:>3} %", what_, std::string(bar, '='), percent);
  std::fflush(stderr);
}

void Progress::finish() {
  if (watched_ && shown_percent_ >= 0) fmt::print(stderr, "\r{:<{}}\r", "", what_.size() + 50);
}

}  // namespace palpate::app
