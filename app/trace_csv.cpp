// SPDX-License-Identifier: Apache-2.0
#include "app/trace_csv.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <stdexcept>

#include "palpate/kernel/core/error.hpp"

namespace palpate::app {
namespace {

constexpr std::size_t buffered = 1U << 16U;

template <class Number>
void append(std::string& line, Number value) {
  std::array<char, 32> text{};
  const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
  line.append(text.data(), result.ptr);
  line += ',';
}

void append(std::string& line, const Vec3& v) {
  for (int axis = 0; axis < 3; ++axis) append(line, v[axis]);
}

}  // namespace

TraceWriter::TraceWriter(const std::string& path)
    : path_(path == "-" ? "standard output" : path),
      file_(path == "-" ? stdout : std::fopen(path.c_str(), "wb")) {
  if (file_ == nullptr)
    throw Error(path, std::string("cannot be written: ") + std::strerror(errno),
                "give a file in a folder that you may write to");
  buffer_ = std::string(header) + '\n';
}

TraceWriter::~TraceWriter() {
  if (file_ != stdout) std::fclose(file_);
}

void TraceWriter::write(const Tick& tick) {
  append(buffer_, tick.t);
  append(buffer_, tick.hip);
  append(buffer_, tick.proxy);
  append(buffer_, tick.normal);
  append(buffer_, tick.force);
  buffer_ += to_string(tick.state);
  buffer_ += ',';
  append(buffer_, tick.steps);
  append(buffer_, tick.surface_velocity);
  append(buffer_, tick.frame);
  append(buffer_, tick.flags);
  buffer_.back() = '\n';
  if (buffer_.size() >= buffered) flush();
}

void TraceWriter::finish() {
  flush();
  if (std::fflush(file_) != 0)
    throw std::runtime_error(path_ + ": cannot be written: " + std::strerror(errno) +
                             "; free some space");
}

void TraceWriter::flush() {
  if (std::fwrite(buffer_.data(), 1, buffer_.size(), file_) != buffer_.size())
    throw std::runtime_error(path_ + ": cannot be written: " + std::strerror(errno) +
                             "; free some space");
  buffer_.clear();
}

}  // namespace palpate::app
