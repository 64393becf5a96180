// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "palpate/io/bag/bag_reader.hpp"

namespace palpate::test {

/// Topic, type, time and bytes of each message, as one text each. @throws Error
inline std::vector<std::string> bag_contents(const std::filesystem::path& path) {
  std::vector<std::string> messages;
  BagReader reader(path);
  for (const BagReader::Topic& topic : reader.topics()) {
    for (const BagReader::Place& place : reader.places(topic.name)) {
      const std::vector<std::byte> bytes = reader.read(place);
      messages.push_back(topic.name + topic.type + std::to_string(place.nanoseconds) +
                         std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
    }
  }
  return messages;
}

}  // namespace palpate::test
