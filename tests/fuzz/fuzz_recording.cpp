// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "palpate/io/bag/bag_writer.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/record/replay.hpp"

#include "tests/fuzz/expect.hpp"
#include "tests/fuzz/memory_folder.hpp"

namespace {

namespace fs = std::filesystem;
using namespace palpate;

// Everything that a reader of sessions does.
void read_all(const fs::path& path) {
  test::succeeds([&] { static_cast<void>(BagReader(path).check()); });
  test::succeeds([&] {
    SessionReader session(path);
    for (const auto& frame : session.frames())
      test::succeeds([&] { static_cast<void>(session.seen(frame.first)); });
    static_cast<void>(replay(session));
  });
  test::succeeds([&] {
    const auto source = open_source("recording:" + path.string());
    while (source->next()) {
    }
  });
}

// Messages with whatever the fuzzer puts in them: records of a byte that chooses the topic, two for
// the length, and the data.
void write_messages(BagWriter& writer, std::string_view text) {
  struct Topic {
    std::string_view name, type;
  };
  constexpr std::array<Topic, 8> topics = {
      {{session_topic::session, ros::String::type},
       {session_topic::settings, ros::String::type},
       {session_topic::frame, ros::Float64MultiArray::type},
       {session_topic::tick, ros::Float64MultiArray::type},
       {"/camera_0/depth/image_raw/compressedDepth", ros::CompressedImage::type},
       {"/camera_0/depth/camera_info", ros::CameraInfo::type},
       {"/camera_0/depth/exact", ros::Float64MultiArray::type},
       {"/camera_0/depth/points", ros::PointCloud2::type}}};
  while (text.size() >= 3) {
    const Topic& topic = topics[static_cast<std::uint8_t>(text[0]) % topics.size()];
    const std::size_t length =
        static_cast<std::uint8_t>(text[1]) + 256U * static_cast<std::uint8_t>(text[2]);
    const std::string_view data = text.substr(3, length);
    text.remove_prefix(std::min(text.size(), 3 + length));
    writer.write(writer.topic(std::string(topic.name), topic.type), 0,
                 std::as_bytes(std::span(data)));
  }
}

}  // namespace

// The first byte chooses what the rest is: a file of SQLite, or messages of a session.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fs::path folder = test::memory_folder();
  if (size == 0) return 0;
  const std::string_view text = test::text_of(data + 1, size - 1);
  fs::create_directories(folder);
  if (data[0] % 2 == 0) {
    std::ofstream(folder / "bag.db3", std::ios::binary) << text;
    read_all(folder / "bag.db3");
  } else {
    {
      BagWriter writer(folder / "bag");
      write_messages(writer, text);
    }
    read_all(folder / "bag");
  }
  fs::remove_all(folder);
  return 0;
}
