// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>

#include "palpate/bag/bag_reader.hpp"

#include "tests/fuzz/expect.hpp"
#include "tests/fuzz/memory_folder.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace fs = std::filesystem;
  using namespace palpate;
  static const fs::path folder = test::memory_folder();
  fs::create_directories(folder);
  const fs::path file = folder / "bag.mcap";
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
    // Its indexes, where they are used, name as many as there are.
    test::expect(!check.damage.empty() || check.messages == messages);
  });
  fs::remove_all(folder);
  return 0;
}
