// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <string>

#include "palpate/kernel/core/tick.hpp"

namespace palpate::app {

/// Writes ticks as CSV, one row each, numbers in the shortest form that reads back to the same
/// bits. The columns are those of the header line.
class TraceWriter {
 public:
  static constexpr const char* header =
      "t,hip_x,hip_y,hip_z,proxy_x,proxy_y,proxy_z,normal_x,normal_y,normal_z,"
      "force_x,force_y,force_z,state,steps,surface_velocity,frame,flags";

  /// @param path  where to, `-` for standard output. @throws Error if it cannot be opened.
  explicit TraceWriter(const std::string& path);
  ~TraceWriter();
  TraceWriter(const TraceWriter&) = delete;
  TraceWriter& operator=(const TraceWriter&) = delete;

  /// @throws std::runtime_error if nothing more can be written (a full disk).
  void write(const Tick& tick);
  /// Where the rows go, for people.
  [[nodiscard]] const std::string& name() const { return path_; }
  /// Flushes the buffer; the trace is complete after it. Throws as `write`.
  void finish();

 private:
  void flush();

  std::string path_;
  std::FILE* file_;
  std::string buffer_;
};

}  // namespace palpate::app
