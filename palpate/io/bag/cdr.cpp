// SPDX-License-Identifier: Apache-2.0
#include "palpate/io/bag/cdr.hpp"

#include "palpate/kernel/core/error.hpp"

namespace palpate {
namespace {

constexpr std::size_t header = 4;

}  // namespace

CdrReader::CdrReader(std::span<const std::byte> message, std::string name, Layout layout)
    : name_(std::move(name)), layout_(layout) {
  if (layout == Layout::ros1) {
    swapped_ = std::endian::native == std::endian::big;
    body_ = message;
    return;
  }
  if (message.size() < header)
    throw Error(name_, "is too short for a message", "the bag may be damaged");
  const std::span<const std::byte> representation = message.first(header);
  const auto kind = std::to_integer<unsigned>(representation[1]);
  if (representation[0] != std::byte{0} || kind > 1)
    throw Error(name_, "is not in CDR", "record the topic with ROS 2's own serialization");
  const bool is_little = kind == 1;
  swapped_ = is_little != (std::endian::native == std::endian::little);
  body_ = message.subspan(header);
}

void CdrReader::align(std::size_t size) {
  if (layout_ == Layout::ros1) return;
  const std::size_t past = at_ % size;
  if (past != 0) static_cast<void>(take(size - past));
}

std::span<const std::byte> CdrReader::take(std::size_t count) {
  if (count > body_.size() - at_)
    throw Error(name_, "ends too early", "it is damaged, or not of the type that its topic says");
  at_ += count;
  return body_.subspan(at_ - count, count);
}

std::size_t CdrReader::count(std::size_t size) {
  const std::size_t count = number<std::uint32_t>();
  if (count > (body_.size() - at_) / size)
    throw Error(name_, "promises " + std::to_string(count) + " elements, more than it can hold",
                "it is damaged, or not of the type that its topic says");
  return count;
}

void CdrReader::get(std::string& text) {
  const std::span<const std::byte> bytes = take(count(1));  // the NUL behind it included
  text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.empty() && text.back() == '\0') text.pop_back();
}

}  // namespace palpate
