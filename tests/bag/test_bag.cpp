// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <lz4frame.h>
#include <zstd.h>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/bag_writer.hpp"
#include "palpate/io/bag/compression.hpp"
#include "palpate/io/bag/messages.hpp"

#include "tests/support/bag_contents.hpp"
#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/gzip.hpp"
#include "tests/support/sqlite.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_bag {

using test::bag_contents;
using test::fails_saying;
using test::TemporaryFolder;

std::string text_of(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

void write_two(const std::filesystem::path& folder) {
  BagWriter writer(folder);
  const std::size_t a = writer.topic("/a", ros::String::type);
  const std::size_t b = writer.topic("/b", ros::String::type, true);
  writer.write(a, 2000, ros::encode(ros::String{"first"}));
  writer.write(b, 1000, ros::encode(ros::String{"other"}));
  writer.write(a, 3000, ros::encode(ros::String{"second"}));
  writer.close();
}

TEST(Bag, GivesBackEachTopicInOrder) {
  const TemporaryFolder folder;
  write_two(folder.path() / "bag");
  BagReader reader(folder.path() / "bag");
  ASSERT_EQ(reader.topics().size(), 2U);
  EXPECT_EQ(reader.topics()[0].name, "/a");
  EXPECT_EQ(reader.topics()[0].type, "std_msgs/msg/String");
  const auto places = reader.places("/a");
  ASSERT_EQ(places.size(), 2U);
  EXPECT_EQ(places[1].nanoseconds, 3000);
  EXPECT_EQ(ros::decode<ros::String>(reader.read(places[1]), "it").data, "second");
  EXPECT_TRUE(reader.places("/c").empty());
  EXPECT_EQ(reader.find("/c"), nullptr);
}

TEST(Bag, SaysInItsMetadataWhatItHolds) {
  const TemporaryFolder folder;
  write_two(folder.path() / "bag");
  const std::string yaml = text_of(folder.path() / "bag/metadata.yaml");
  for (const char* line :
       {"rosbag2_bagfile_information:\n  version: 7\n  storage_identifier: mcap\n",
        "  duration:\n    nanoseconds: 2000\n",
        "  starting_time:\n    nanoseconds_since_epoch: 1000\n", "  message_count: 3\n",
        "        name: \"/a\"\n        type: std_msgs/msg/String\n",
        "  relative_file_paths:\n    - \"bag_0.mcap\"\n"})
    EXPECT_NE(yaml.find(line), std::string::npos) << line << " is not in\n" << yaml;
}

TEST(Bag, IsNotWrittenOverAnother) {
  const TemporaryFolder folder;
  write_two(folder.path() / "bag");
  EXPECT_TRUE(fails_saying([&] { return BagWriter(folder.path() / "bag").messages(); }, "bag",
                           "is there already"));
}

TEST(Bag, InSeveralFilesIsReadInTheirOrder) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() / "split");
  for (const int part : {10, 2}) {
    const std::string name = "part_" + std::to_string(part);
    BagWriter writer(folder.path() / name);
    // Its number in this file is another one than in the other.
    if (part == 10) static_cast<void>(writer.topic("/before", ros::String::type));
    writer.write(writer.topic("/a", ros::String::type), part, ros::encode(ros::String{name}));
    writer.close();
    std::filesystem::rename(folder.path() / name / (name + "_0.mcap"),
                            folder.path() / "split" / ("split_" + std::to_string(part) + ".mcap"));
  }
  BagReader reader(folder.path() / "split");
  const auto places = reader.places("/a");
  ASSERT_EQ(places.size(), 2U);
  EXPECT_EQ(ros::decode<ros::String>(reader.read(places[0]), "it").data, "part_2");
  EXPECT_EQ(ros::decode<ros::String>(reader.read(places[1]), "it").data, "part_10");
}

TEST(Bag, SaysWhyWhatIsNoneIsRefused) {
  const TemporaryFolder folder;
  const auto open = [](const std::filesystem::path& path) {
    return [path] { return BagReader(path); };
  };
  EXPECT_TRUE(fails_saying(open(folder.path() / "nothing"), "no such bag"));
  EXPECT_TRUE(fails_saying(open(folder.path()), "holds no .db3 or .mcap file"));
  EXPECT_TRUE(fails_saying(open(folder.write("text.db3", "not a database, but long enough")),
                           "text.db3", "not a database"));
  EXPECT_TRUE(fails_saying(open(folder.write("empty.db3", "")), "empty.db3", "no table of topics"));
  EXPECT_TRUE(fails_saying(open(folder.write("some.bag", "")), "some.bag", "no bag of ROS 1"));
  EXPECT_TRUE(fails_saying(open(folder.write("some.mcap", "")), "some.mcap", "not an MCAP file"));
  std::filesystem::create_directory(folder.path() / "zstd");
  static_cast<void>(folder.write("zstd/some.db3.zstd", ""));
  EXPECT_TRUE(fails_saying(open(folder.path() / "zstd"), "compressed"));
}

std::vector<std::byte> compressed(const std::vector<std::byte>& bytes) {
  std::vector<std::byte> packed(ZSTD_compressBound(bytes.size()));
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1));
  return packed;
}

TEST(Bag, WithMessagesCompressedOneByOneIsRead) {
  const TemporaryFolder folder;
  const auto text = ros::encode(ros::String{std::string(100'000, 'x') + "end"});
  const auto packed = compressed(text);
  ASSERT_LT(packed.size(), 1000U);
  {
    BagWriter writer(folder.path() / "bag");
    const std::size_t a = writer.topic("/a", ros::String::type);
    writer.write(a, 1, packed);
    writer.write(a, 2, text);
    writer.write(a, 3, std::span(packed).first(packed.size() - 5));
  }
  BagReader reader(folder.path() / "bag");
  const auto places = reader.places("/a");
  EXPECT_EQ(reader.read(places[0]), text);
  EXPECT_EQ(reader.read(places[1]), text);
  EXPECT_TRUE(fails_saying([&] { return reader.read(places[2]); }, "message 3 of /a", "too early"));
  EXPECT_TRUE(reader.check().damage.empty()) << "checksums are of what lies in the file";
}

std::vector<std::byte> lz4(const std::vector<std::byte>& bytes) {
  std::vector<std::byte> packed(LZ4F_compressFrameBound(bytes.size(), nullptr));
  packed.resize(
      LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
  return packed;
}

std::vector<std::byte> gzip(const std::vector<std::byte>& bytes) {
  const std::string packed =
      test::gzip({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  const auto all = std::as_bytes(std::span(packed));
  return {all.begin(), all.end()};
}

// One of the codecs that can be several frames.
struct Codec {
  const char* name;
  std::vector<std::byte> (*pack)(const std::vector<std::byte>&);
  std::vector<std::byte> (*unpack)(std::span<const std::byte>, std::size_t, const std::string&);
};
class Compression : public ::testing::TestWithParam<Codec> {};
INSTANTIATE_TEST_SUITE_P(Codecs, Compression,
                         ::testing::Values(Codec{"Zstd", compressed, decompress_zstd},
                                           Codec{"Lz4", lz4, decompress_lz4},
                                           Codec{"Gzip", gzip, decompress_gzip}),
                         [](const auto& each) { return std::string(each.param.name); });

TEST_P(Compression, GivesBackFramesOneAfterAnother) {
  const Codec& codec = GetParam();
  std::mt19937 random(3);
  std::vector<std::byte> noise(70'000);
  for (std::byte& byte : noise) byte = static_cast<std::byte>(random());
  const std::vector<std::byte> zeros(3'000'000);
  auto packed = codec.pack(noise);
  EXPECT_EQ(is_zstd(packed), codec.unpack == decompress_zstd);
  EXPECT_EQ(codec.unpack(packed, noise.size(), "it"), noise);
  EXPECT_EQ(codec.unpack(codec.pack({}), 0, "it"), std::vector<std::byte>{});
  const auto more = codec.pack(zeros);
  packed.insert(packed.end(), more.begin(), more.end());
  auto both = noise;
  both.insert(both.end(), zeros.begin(), zeros.end());
  EXPECT_EQ(codec.unpack(packed, both.size(), "it"), both);
  EXPECT_TRUE(fails_saying([&] { return codec.unpack(packed, both.size() - 1, "it"); }, "it",
                           "more than 3069999 bytes"));
  EXPECT_TRUE(fails_saying([&] { return codec.unpack({}, 9, "it"); }, "it", "; it may be damaged"));
}

TEST(Zstd, RefusesWhatDeclaresOrHoldsTooMuch) {
  const auto packed = compressed(std::vector<std::byte>(1'000'000));
  EXPECT_TRUE(fails_saying([&] { return decompress_zstd(packed, 999'999, "it"); }, "it", "999999"));
  EXPECT_TRUE(fails_saying([] { return decompress_zstd({}, 9, "it"); }, "it", "not compressed"));
  // A frame that declares 2^40 bytes in a window of 1 kB
  const std::vector<unsigned char> liar{0x28, 0xb5, 0x2f, 0xfd, 0xc0, 0, 0, 0, 0, 0, 0, 1, 0, 0};
  EXPECT_TRUE(
      fails_saying([&] { return decompress_zstd(std::as_bytes(std::span(liar)), 1 << 20, "it"); },
                   "it", "1048576"));
}

TEST_P(Compression, OfDamagedDataIsAnErrorOrWhatItBecame) {
  std::mt19937 random(4);
  std::vector<std::byte> bytes(5000);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 3);
  const auto packed = GetParam().pack(bytes);
  int errors = 0;
  for (int i = 0; i < 2000; ++i) {
    auto damaged = packed;
    damaged[random() % damaged.size()] ^= static_cast<std::byte>(1U << random() % 8);
    if (i % 3 == 0) damaged.resize(random() % damaged.size());
    try {
      ASSERT_LE(GetParam().unpack(damaged, 10'000, "it").size(), 10'000U);
    } catch (const Error&) {
      ++errors;
    }
  }
  EXPECT_GT(errors, 700);
}

TEST(Bag, AViewInsteadOfATableIsRefused) {
  const TemporaryFolder folder;
  test::run_sql(
      folder.path() / "view.db3",
      "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT,type TEXT);"
      "CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i FROM n) "
      "SELECT i AS id, 1 AS topic_id, 0 AS timestamp, '' AS data FROM n");
  EXPECT_TRUE(
      fails_saying([&] { return BagReader(folder.path() / "view.db3"); }, "no table of messages"));
}

// Written by rosbag2 itself, with other tables around the same two.
TEST(Bag, OfRosbag2IsRead) {
  PALPATE_DATA_OR_SKIP(file, "formats/rosbag2/rosbag2__talker.db3");
  BagReader reader(file);
  ASSERT_NE(reader.find("/topic"), nullptr);
  EXPECT_EQ(reader.find("/topic")->type, "std_msgs/msg/String");
  const auto places = reader.places("/topic");
  ASSERT_GT(places.size(), 5U);
  for (std::size_t i = 0; i < places.size(); ++i) {
    EXPECT_EQ(ros::decode<ros::String>(reader.read(places[i]), "it").data,
              "Hello, world! " + std::to_string(i));
  }
}

TEST(BagChecksums, TellABagThatWasNotClosedFromADamagedOne) {
  const TemporaryFolder folder;
  // What a reader finds is what a program that dies now would leave.
  BagWriter writer(folder.path() / "open");
  writer.write(writer.topic("/a", ros::String::type), 0, ros::encode(ros::String{"committed"}));
  writer.commit();
  writer.write(writer.topic("/a", ros::String::type), 0, ros::encode(ros::String{"not yet"}));
  const BagCheck check = BagReader(folder.path() / "open").check();
  EXPECT_TRUE(check.has_checksums);
  EXPECT_FALSE(check.closed);
  EXPECT_EQ(check.messages, 1U);
  EXPECT_EQ(check.unchecked, 0U);
  EXPECT_EQ(check.damage, "");
}

TEST(BagChecksums, AreMissingInSqliteWhichIsReadAllTheSame) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "bag.db3";
  test::run_sql(
      file,
      "CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,"
      "timestamp INTEGER NOT NULL,data BLOB NOT NULL);"
      "INSERT INTO topics VALUES(1,'/a','std_msgs/msg/String');"
      "INSERT INTO messages(topic_id,timestamp,data) VALUES(1,0,x'00010000'),(1,9,x'00010000')");
  const BagCheck check = BagReader(file).check();
  EXPECT_FALSE(check.has_checksums);
  EXPECT_EQ(check.messages, 2U);
  EXPECT_EQ(check.unchecked, 2U);
  EXPECT_EQ(check.damage, "");
  EXPECT_EQ(bag_contents(file).size(), 2U);
}

}  // namespace test_bag
}  // namespace palpate
