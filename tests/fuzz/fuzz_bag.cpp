// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>

#include "palpate/io/bag/bag_reader.hpp"

#include "tests/fuzz/expect.hpp"
#include "tests/fuzz/memory_folder.hpp"

// MCAP, or a bag of ROS 1, which begins as that one does.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace fs = std::filesystem;
  using namespace palpate;
  static const fs::path folder = test::memory_folder();
  fs::create_directories(folder);
  const bool is_ros1 = size > 0 && data[0] == '#';
  const fs::path file = folder / (is_ros1 ? "some.bag" : "some.mcap");
  std::ofstream(file, std::ios::binary) << test::text_of(data, size);
  test::succeeds([&] {
    BagReader reader(file);
    std::size_t messages = 0;
    for (const BagReader::Topic& topic : reader.topics()) {
      for (const BagReader::Place& place : reader.places(topic.name)) {
        ++messages;
        test::succeeds([&] { static_cast<void>(reader.read(place)); });
      }
    }
    const BagCheck check = reader.check();
    test::expect(check.unchecked <= check.messages);
    // Its indexes, where they are used, name as many as there are; those of ROS 1 alone may tell of
    // messages that chunks do not hold, which then cannot be read.
    test::expect(!check.damage.empty() || check.messages == messages || is_ros1);
  });
  fs::remove_all(folder);
  return 0;
}
