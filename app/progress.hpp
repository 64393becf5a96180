// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

namespace palpate::app {

/// A progress line on standard error while a person watches: on a terminal only, never in a pipe.
class Progress {
 public:
  Progress(std::string what, std::size_t total);

  void advance() { set(done_ + 1); }
  /// So many are done.
  void set(std::size_t done);
  /// Clears the line.
  void finish();

 private:
  std::string what_;
  std::size_t total_;
  std::size_t done_ = 0;
  int shown_percent_ = -1;
  bool watched_;
};

}  // namespace palpate::app
