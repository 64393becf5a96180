// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "palpate/bag/cdr.hpp"

namespace palpate::ros {

/// One walk over a message's fields serves both ways: this one writes them.
class Put {
 public:
  void begin_header() {}
  template <class T>
  void number(const T& value) {
    out_.put(value);
  }
  void flag(const bool& value) { out_.put(static_cast<std::uint8_t>(value ? 1 : 0)); }
  void text(const std::string& value) { out_.put_string(value); }
  void bytes(const std::vector<std::byte>& value) {
    out_.put_sequence(std::span(reinterpret_cast<const std::uint8_t*>(value.data()), value.size()));
  }
  template <class T>
  void numbers(const std::vector<T>& values) {
    out_.put_sequence(std::span(values));
  }
  void texts(const std::vector<std::string>& values) {
    out_.put(static_cast<std::uint32_t>(values.size()));
    for (const std::string& value : values) out_.put_string(value);
  }
  template <class T, std::size_t n>
  void array(const std::array<T, n>& values) {
    out_.put_array(std::span<const T>(values));
  }
  template <class T, class Each>
  void sequence(const std::vector<T>& values, std::size_t /*least*/, const Each& each) {
    out_.put(static_cast<std::uint32_t>(values.size()));
    for (const T& value : values) each(value);
  }
  std::vector<std::byte> take() { return out_.take(); }

 private:
  CdrWriter out_;
};

/// And this one reads them.
class Get {
 public:
  Get(std::span<const std::byte> bytes, const std::string& name,
      CdrReader::Layout layout = CdrReader::Layout::cdr)
      : in_(bytes, name, layout) {}

  // A header of ROS 1 begins with a number that ROS 2 has no more.
  void begin_header() {
    if (in_.layout() == CdrReader::Layout::ros1) static_cast<void>(in_.get<std::uint32_t>());
  }

  template <class T>
  void number(T& value) {
    value = in_.get<T>();
  }
  void flag(bool& value) { value = in_.get<std::uint8_t>() != 0; }
  void text(std::string& value) { value = in_.get_string(); }
  void bytes(std::vector<std::byte>& value) {
    const std::span<const std::byte> bytes = in_.get_bytes();
    value.assign(bytes.begin(), bytes.end());
  }
  template <class T>
  void numbers(std::vector<T>& values) {
    values = in_.get_sequence<T>();
  }
  void texts(std::vector<std::string>& values) {
    values.resize(in_.get_count(sizeof(std::uint32_t)));
    for (std::string& value : values) value = in_.get_string();
  }
  template <class T, std::size_t n>
  void array(std::array<T, n>& values) {
    for (T& value : values) value = in_.get<T>();
  }
  template <class T, class Each>
  void sequence(std::vector<T>& values, std::size_t least, const Each& each) {
    values.resize(in_.get_count(least));
    for (T& value : values) each(value);
  }

 private:
  CdrReader in_;
};

template <class Message, class Walk>
std::vector<std::byte> encode_by(const Message& message, const Walk& walk) {
  Put put;
  walk(put, message);
  return put.take();
}

template <class Message, class Walk>
Message decode_by(std::span<const std::byte> bytes, const std::string& name, const Walk& walk) {
  Get get(bytes, name);
  Message message;
  walk(get, message);
  return message;
}

}  // namespace palpate::ros
