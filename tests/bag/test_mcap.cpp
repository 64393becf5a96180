// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/compression.hpp"
#include "palpate/io/bag/messages.hpp"

#include "tests/support/bag_contents.hpp"
#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/mcap.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_mcap {

using test::bag_contents;
using test::fails_saying;
using test::McapWriter;
using test::TemporaryFolder;

constexpr int messages_of_a_file = 16;  // four in a chunk

// What a program leaves at some point: how long the file is, and the messages that are whole in it.
struct Whole {
  std::size_t bytes;
  std::uint64_t messages;
};

// Some messages on two topics. @param wholes  where messages, or chunks of them, end
std::string small_file(const McapWriter::Options& options, std::vector<Whole>* wholes = nullptr) {
  std::mt19937 random(3);
  McapWriter writer(options);
  const std::uint16_t a = writer.channel("/a", ros::String::type);
  const std::uint16_t b = writer.channel("/b", ros::Float64MultiArray::type);
  for (int i = 0; i < messages_of_a_file; i += 2) {
    const auto whole = [&](bool now) {
      if (now && wholes != nullptr) wholes->push_back({writer.file().size(), writer.messages()});
    };
    writer.message(a, 1000 * i, ros::encode(ros::String{std::string(random() % 20, 'x')}));
    whole(!options.in_chunks);
    writer.message(b, 1000 * i, ros::encode(ros::Float64MultiArray{"b", {1.0 / 3.0, 1.0 * i}}));
    if (i % 4 == 2) writer.end_chunk();
    whole(!options.in_chunks || i % 4 == 2);
  }
  return writer.close();
}

// What small_file() holds, written without the reader: by topic, as bag_contents() has it.
std::vector<std::string> small_contents() {
  std::mt19937 random(3);
  std::vector<std::string> texts;
  std::vector<std::string> arrays;
  const auto bytes = [](const std::vector<std::byte>& message) {
    return std::string(reinterpret_cast<const char*>(message.data()), message.size());
  };
  for (int i = 0; i < messages_of_a_file; i += 2) {
    const std::string stamp = std::to_string(1000 * i);
    texts.push_back("/astd_msgs/msg/String" + stamp +
                    bytes(ros::encode(ros::String{std::string(random() % 20, 'x')})));
    arrays.push_back("/bstd_msgs/msg/Float64MultiArray" + stamp +
                     bytes(ros::encode(ros::Float64MultiArray{"b", {1.0 / 3.0, 1.0 * i}})));
  }
  texts.insert(texts.end(), arrays.begin(), arrays.end());
  return texts;
}

// Chunks of all kinds, and none.
std::vector<McapWriter::Options> layouts() {
  std::vector<McapWriter::Options> layouts{{.in_chunks = false}};
  for (const char* compression : {"", "zstd", "lz4"})
    layouts.push_back({.compression = compression});
  return layouts;
}

TEST(Mcap, GivesBackWhatIsInItInEveryLayout) {
  const TemporaryFolder folder;
  const std::vector<std::string> expected = small_contents();
  for (McapWriter::Options options : layouts()) {
    for (const bool checksums : {true, false}) {
      for (const bool indexes : {true, false}) {
        options.checksums = checksums;
        options.indexes = indexes;
        const auto file = folder.write("some.mcap", small_file(options));
        EXPECT_EQ(bag_contents(file), expected)
            << options.compression << options.in_chunks << checksums << indexes;
        const BagCheck check = BagReader(file).check();
        EXPECT_EQ(check.damage, "");
        EXPECT_EQ(check.has_checksums, checksums);
        EXPECT_TRUE(check.closed);
        EXPECT_EQ(check.messages, expected.size());
        EXPECT_EQ(check.unchecked, checksums ? 0U : expected.size());
      }
    }
  }
}

TEST(Mcap, OfSeveralFilesInAFolderIsReadInTheirOrder) {
  const TemporaryFolder folder;
  for (const int part : {10, 2}) {
    McapWriter writer({});
    writer.message(writer.channel("/a", ros::String::type), part,
                   ros::encode(ros::String{std::to_string(part)}));
    static_cast<void>(folder.write("split_" + std::to_string(part) + ".mcap", writer.close()));
  }
  static_cast<void>(folder.write("metadata.yaml", "anything"));
  BagReader reader(folder.path());
  const auto places = reader.places("/a");
  ASSERT_EQ(places.size(), 2U);
  EXPECT_EQ(ros::decode<ros::String>(reader.read(places[0]), "it").data, "2");
  EXPECT_EQ(ros::decode<ros::String>(reader.read(places[1]), "it").data, "10");
  static_cast<void>(folder.write("other.db3", ""));
  EXPECT_TRUE(fails_saying([&] { return BagReader(folder.path()); }, "more than one bag"));
}

TEST(Mcap, IsKnownByItsBeginWhateverItsName) {
  const TemporaryFolder folder;
  EXPECT_EQ(bag_contents(folder.write("named.bag0", small_file({}))), small_contents());
}

TEST(Mcap, ThatEndsEarlyGivesWhatIsWholeAtEveryPoint) {
  const TemporaryFolder folder;
  for (const McapWriter::Options& options : layouts()) {
    std::vector<Whole> wholes{{8, 0}};
    const auto cut = folder.write("cut.mcap", small_file(options, &wholes));
    for (std::size_t size = std::filesystem::file_size(cut); size-- > 0;) {
      std::filesystem::resize_file(cut, size);
      if (size < 8) {
        ASSERT_TRUE(fails_saying([&] { return BagReader(cut); }, "cut.mcap", "not an MCAP"));
        continue;
      }
      const Whole* whole = wholes.data();
      for (const Whole& each : wholes) {
        // The indexes behind a chunk are not needed for it.
        if (each.bytes <= size) whole = &each;
      }
      const BagCheck check = BagReader(cut).check();
      ASSERT_FALSE(check.closed) << size;
      ASSERT_EQ(check.damage, "") << size;
      ASSERT_GE(check.messages, whole->messages) << size;
      const std::vector<std::string> messages = bag_contents(cut);
      ASSERT_EQ(messages.size(), check.messages) << size;
      if (whole + 1 < wholes.data() + wholes.size()) {
        ASSERT_LE(check.messages, (whole + 1)->messages) << size;
      } else {
        ASSERT_EQ(messages, small_contents()) << size;
      }
    }
  }
}

TEST(Mcap, ShowsEachFlippedBitThatChangesWhatIsRead) {
  const TemporaryFolder folder;
  const std::vector<std::string> original = small_contents();
  std::mt19937 random(7);
  std::size_t bytes = 0;
  std::size_t noticed = 0;
  for (McapWriter::Options options : layouts()) {
    for (const bool indexes : {true, false}) {
      options.indexes = indexes;
      const std::string whole = small_file(options);
      const auto flipped = folder.write("flipped.mcap", whole);
      // In place: a file that is written anew costs its disk far more.
      const auto put = [&](std::size_t at, char byte) {
        std::fstream file(flipped, std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(static_cast<std::streamoff>(at)).put(byte);
      };
      for (std::size_t at = 0; at < whole.size(); at += 1 + random() % 4) {
        put(at, static_cast<char>(whole[at] ^ (1 << random() % 8)));
        try {
          const BagCheck check = BagReader(flipped).check();
          if (check.damage.empty() && check.closed) {
            ASSERT_EQ(bag_contents(flipped), original) << "byte " << at;
          } else {
            ++noticed;
          }
        } catch (const Error&) {
          ++noticed;
        }
        put(at, whole[at]);
        ++bytes;
      }
    }
  }
  EXPECT_EQ(noticed, bytes);  // each byte is below some checksum, or is looked at
}

TEST(Mcap, DamagedWithinAChunkNamesTheByteAndKeepsTheOtherChunks) {
  const TemporaryFolder folder;
  std::vector<Whole> wholes;
  std::string file = small_file({.compression = "zstd"}, &wholes);
  const std::string place = "byte " + std::to_string(wholes[0].bytes);
  file[wholes[0].bytes + 80] ^= 1;  // within the second chunk
  BagReader reader(folder.write("damaged.mcap", file));
  const auto places = reader.places("/a");
  ASSERT_EQ(places.size(), 8U);
  EXPECT_FALSE(reader.read(places[1]).empty());
  EXPECT_TRUE(fails_saying([&] { return reader.read(places[2]); }, "damaged.mcap", place));
  EXPECT_FALSE(reader.read(places[4]).empty());
  EXPECT_NE(reader.check().damage.find(place), std::string::npos) << reader.check().damage;
  // Without indexes all chunks must be read to know what is there.
  wholes.clear();
  std::string plain = small_file({.compression = "zstd", .indexes = false}, &wholes);
  plain[wholes[0].bytes + 80] ^= 1;
  EXPECT_TRUE(fails_saying([&] { return BagReader(folder.write("plain.mcap", plain)); },
                           "plain.mcap", "byte "));
}

TEST(Mcap, DecompressesAChunkOnceForAllOfItsMessages) {
  const TemporaryFolder folder;
  std::vector<Whole> wholes;
  std::string file = small_file({.compression = "lz4"}, &wholes);
  const auto path = folder.write("some.mcap", file);
  BagReader reader(path);
  const auto places = reader.places("/a");
  EXPECT_FALSE(reader.read(places[0]).empty());
  // What is on the disk does not matter any more for this chunk.
  for (std::size_t at = 100; at < wholes[1].bytes; ++at) file[at] = '\x55';
  static_cast<void>(folder.write("some.mcap", file));
  EXPECT_FALSE(reader.read(places[1]).empty());
  EXPECT_TRUE(fails_saying([&] { return reader.read(places[2]); }, "some.mcap"));
}

TEST(Mcap, ThatDeclaresMoreThanItHoldsIsRefused) {
  const TemporaryFolder folder;
  const std::uint64_t huge = std::uint64_t{1} << 60U;
  const auto chunk = [](std::uint64_t size, std::uint64_t packed, const std::string& kind) {
    return McapWriter::number(std::uint64_t{0}) + McapWriter::number(std::uint64_t{0}) +
           McapWriter::number(size) + McapWriter::number(std::uint32_t{0}) +
           McapWriter::text(kind) + McapWriter::number(packed) + "data";
  };
  const auto refused = [&](std::uint8_t kind, const std::string& content, const char* why) {
    McapWriter writer({});
    const std::string place = "byte " + std::to_string(writer.file().size());
    writer.put(kind, content);
    EXPECT_TRUE(fails_saying([&] { return BagReader(folder.write("huge.mcap", writer.file())); },
                             "huge.mcap", place, why));
  };
  refused(6, chunk(huge, 4, "zstd"), "more than can be read");
  refused(6, chunk(4, huge, ""), "shorter than its fields");
  refused(6, chunk(5, 4, ""), "not of the size");
  refused(6, chunk(4, 4, "bzip2"), "bzip2");
  refused(6, chunk(4, 4, "lz4"), "decompressed");
  refused(6, chunk(4, 4, "zstd"), "zstd");
  refused(6, "", "shorter than its fields");
  refused(5, "", "shorter than its fields");
  refused(5, std::string(22, '\x07'), "channel 1799");
  refused(3, std::string("\x01\x00\xff\xff\xff\x7fname", 10), "shorter than its fields");
}

TEST(Mcap, PassesOverWhatItDoesNotNeed) {
  const TemporaryFolder folder;
  McapWriter writer({});
  writer.put(0x0c, McapWriter::text("name") + McapWriter::text(""));  // metadata
  writer.put(0x80, "of somebody's own");
  writer.message(writer.channel("/a", ros::String::type), 5, ros::encode(ros::String{"it"}));
  EXPECT_EQ(bag_contents(folder.write("some.mcap", writer.close())).size(), 1U);
}

// Written by the format's own libraries, in every layout, with what is in them beside them.
TEST(Mcap, OfTheFormatsConformanceTestsIsRead) {
  PALPATE_DATA_OR_SKIP(folder, "formats/mcap");
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".mcap") continue;
    const auto json = nlohmann::json::parse(
        std::ifstream(std::filesystem::path(entry.path()).replace_extension(".json")));
    std::vector<std::string> expected;
    std::string topic;
    std::string type;
    for (const auto& record : json["records"]) {
      const auto field = [&](const char* name) {
        for (const auto& pair : record["fields"]) {
          if (pair[0] == name) return pair[1];
        }
        return nlohmann::json();
      };
      if (record["type"] == "Schema") type = field("name").get<std::string>();
      if (record["type"] == "Channel") topic = field("topic").get<std::string>();
      if (record["type"] != "Message") continue;
      std::string text = topic + type + field("log_time").get<std::string>();
      for (const auto& byte : field("data"))
        text.push_back(static_cast<char>(std::stoi(byte.get<std::string>())));
      expected.push_back(text);
    }
    EXPECT_EQ(bag_contents(entry.path()), expected) << entry.path();
    const BagCheck check = BagReader(entry.path()).check();
    EXPECT_EQ(check.damage, "") << entry.path();
    EXPECT_TRUE(check.closed) << entry.path();
    EXPECT_EQ(check.messages, expected.size()) << entry.path();
    ++files;
  }
  EXPECT_GT(files, 40);
}

// The same bag, written by rosbag2 in both storages.
TEST(Mcap, OfRosbag2IsWhatItIsInSqlite) {
  PALPATE_DATA_OR_SKIP(folder, "formats/rosbag2");
  EXPECT_EQ(bag_contents(folder / "rosbag2__cdr_test_0.mcap"),
            bag_contents(folder / "rosbag2__cdr_test_0.db3"));
  BagReader reader(folder / "rosbag2__talker.mcap");
  const auto places = reader.places("/topic");
  ASSERT_GT(places.size(), 5U);
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(ros::decode<ros::String>(reader.read(places[i]), "it").data,
              "Hello, world! " + std::to_string(i));
  }
  EXPECT_EQ(reader.check().damage, "");
}

}  // namespace test_mcap
}  // namespace palpate
