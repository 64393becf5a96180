// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/bag/bag_reader.hpp"
#include "palpate/bag/bag_writer.hpp"
#include "palpate/bag/messages.hpp"

#include "tests/support/data.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace {

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
       {"rosbag2_bagfile_information:\n  version: 7\n  storage_identifier: sqlite3\n",
        "  duration:\n    nanoseconds: 2000\n",
        "  starting_time:\n    nanoseconds_since_epoch: 1000\n", "  message_count: 3\n",
        "        name: \"/a\"\n        type: std_msgs/msg/String\n",
        "  relative_file_paths:\n    - \"bag_0.db3\"\n"})
    EXPECT_NE(yaml.find(line), std::string::npos) << line << " is not in\n" << yaml;
  // One file and no log beside it.
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "bag/bag_0.db3-wal"));
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
    std::filesystem::rename(folder.path() / name / (name + "_0.db3"),
                            folder.path() / "split" / ("split_" + std::to_string(part) + ".db3"));
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
  EXPECT_TRUE(fails_saying(open(folder.path()), "holds no .db3 file"));
  EXPECT_TRUE(fails_saying(open(folder.write("text.db3", "not a database, but long enough")),
                           "text.db3", "not a database"));
  EXPECT_TRUE(fails_saying(open(folder.write("empty.db3", "")), "empty.db3", "no table of topics"));
  EXPECT_TRUE(fails_saying(open(folder.write("some.mcap", "")), "MCAP", "sqlite3"));
  std::filesystem::create_directory(folder.path() / "mcap");
  static_cast<void>(folder.write("mcap/some.mcap", ""));
  EXPECT_TRUE(fails_saying(open(folder.path() / "mcap"), "MCAP"));
  std::filesystem::create_directory(folder.path() / "zstd");
  static_cast<void>(folder.write("zstd/some.db3.zstd", ""));
  EXPECT_TRUE(fails_saying(open(folder.path() / "zstd"), "compressed"));
}

TEST(Bag, AViewInsteadOfATableIsRefused) {
  const TemporaryFolder folder;
  Database database = Database::create(folder.path() / "view.db3");
  database.run(
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

}  // namespace
}  // namespace palpate
