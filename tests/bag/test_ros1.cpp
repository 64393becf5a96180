// SPDX-License-Identifier: Apache-2.0
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/io/bag/bag_reader.hpp"
#include "palpate/io/bag/compression.hpp"
#include "palpate/io/bag/messages.hpp"

#include "tests/support/bag_contents.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/ros1_bag.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_ros1 {

namespace ros1 = test::ros1;
using test::bag_contents;
using test::fails_saying;
using test::Ros1BagWriter;
using test::TemporaryFolder;

constexpr const char* compressions[] = {"none", "lz4", "bz2"};
constexpr int ros1_messages = 12;  // four in a chunk

struct WholeChunk {
  std::size_t bytes;
  std::uint64_t messages;
};

// Some messages on two topics. @param wholes  where chunks end
std::string small_bag(const std::string& compression, std::vector<WholeChunk>* wholes = nullptr,
                      bool close = true) {
  std::mt19937 random(3);
  Ros1BagWriter writer(compression);
  for (int i = 0; i < ros1_messages; i += 2) {
    writer.message("/a", "std_msgs/String", 1'000'000'007 * std::int64_t{i},
                   ros1::text(std::string(random() % 20, 'x')));
    writer.message("/b", "std_msgs/Float32", 5 + i, ros1::number(0.5F * static_cast<float>(i)));
    if (i % 4 != 2) continue;
    writer.end_chunk();
    if (wholes != nullptr) wholes->push_back({writer.file().size(), writer.messages()});
  }
  return close ? writer.close() : writer.file();
}

// What small_bag() holds, written without the reader: by topic, as bag_contents() has it.
std::vector<std::string> small_bag_contents() {
  std::mt19937 random(3);
  std::vector<std::string> texts;
  std::vector<std::string> floats;
  const auto bytes = [](const std::vector<std::byte>& message) {
    return std::string(reinterpret_cast<const char*>(message.data()), message.size());
  };
  for (int i = 0; i < ros1_messages; i += 2) {
    texts.push_back("/astd_msgs/msg/String" + std::to_string(1'000'000'007 * std::int64_t{i}) +
                    bytes(ros::encode(ros::String{std::string(random() % 20, 'x')})));
    floats.push_back("/bstd_msgs/msg/Float32" + std::to_string(5 + i) +
                     bytes(ros::encode(ros::Float32{0.5F * static_cast<float>(i)})));
  }
  texts.insert(texts.end(), floats.begin(), floats.end());
  return texts;
}

TEST(Ros1Bag, GivesBackWhatIsInItInEveryCompression) {
  const TemporaryFolder folder;
  for (const std::string compression : compressions) {
    for (const bool closed : {true, false}) {
      const auto file = folder.write(compression + ".bag", small_bag(compression, nullptr, closed));
      EXPECT_EQ(bag_contents(file), small_bag_contents()) << compression << closed;
      BagReader reader(file);
      EXPECT_EQ(reader.kind(), "ROS 1 bag");
      const BagCheck check = reader.check();
      EXPECT_EQ(check.damage, "");
      EXPECT_FALSE(check.has_checksums);
      EXPECT_EQ(check.closed, closed);
      EXPECT_EQ(check.messages, small_bag_contents().size());
      EXPECT_EQ(check.unchecked, check.messages);
    }
  }
  EXPECT_EQ(bag_contents(folder.write("of_any_name", small_bag("lz4"))), small_bag_contents());
}

TEST(Ros1Bag, ThatEndsEarlyGivesTheChunksThatAreWhole) {
  const TemporaryFolder folder;
  for (const std::string compression : compressions) {
    std::vector<WholeChunk> wholes;
    const auto cut = folder.write("cut.bag", small_bag(compression, &wholes));
    for (std::size_t size = std::filesystem::file_size(cut) - 1; size > 250; size -= 3) {
      std::filesystem::resize_file(cut, size);
      std::uint64_t messages = 0;
      for (const WholeChunk& each : wholes) {
        if (each.bytes <= size) messages = each.messages;
      }
      // It was closed once: the record at its begin says so while the index begins in the file.
      BagReader reader(cut);
      std::uint64_t found = 0;
      for (const auto& topic : reader.topics()) found += reader.places(topic.name).size();
      ASSERT_GE(found, messages) << size;
      ASSERT_LE(found, messages + 4) << size;
      ASSERT_EQ(bag_contents(cut).size(), found);
    }
  }
}

TEST(Ros1Bag, WithAFlippedBitIsReadOrAnErrorOfOneLine) {
  const TemporaryFolder folder;
  std::mt19937 random(7);
  int errors = 0;
  for (const std::string compression : compressions) {
    const std::string whole = small_bag(compression);
    const auto flipped = folder.write("flipped.bag", whole);
    const auto put = [&](std::size_t at, char byte) {
      std::fstream file(flipped, std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(at)).put(byte);
    };
    for (std::size_t at = 0; at < whole.size(); at += 1 + random() % 4) {
      put(at, static_cast<char>(whole[at] ^ (1 << random() % 8)));
      try {
        ASSERT_LE(bag_contents(flipped).size(), small_bag_contents().size());
        ASSERT_EQ(BagReader(flipped).check().damage.find('\n'), std::string::npos);
      } catch (const Error& error) {
        ++errors;
        ASSERT_EQ(std::string_view(error.what()).find('\n'), std::string_view::npos);
        ASSERT_NE(std::string_view(error.what()).find("flipped.bag"), std::string_view::npos);
      }
      put(at, whole[at]);
    }
  }
  EXPECT_GT(errors, 200);
}

TEST(Ros1Bag, ThatDeclaresMoreThanItHoldsIsRefused) {
  const TemporaryFolder folder;
  const auto chunk = [](std::uint32_t size, const std::string& compression) {
    return Ros1BagWriter::record(Ros1BagWriter::field("op", "\x05") +
                                     Ros1BagWriter::field("compression", compression) +
                                     Ros1BagWriter::field("size", ros1::number(size)),
                                 "data");
  };
  const auto refused = [&](const std::string& bytes, const char* why) {
    Ros1BagWriter writer;
    const std::string place = "byte " + std::to_string(writer.file().size());
    writer.put(bytes);
    EXPECT_TRUE(fails_saying([&] { return BagReader(folder.write("huge.bag", writer.file())); },
                             "huge.bag", place, why));
  };
  refused(chunk(0xffffffff, "lz4"), "more than can be read");
  refused(chunk(5, "none"), "not of the size");
  refused(chunk(4, "none"), "shorter than its fields");
  refused(chunk(4, "lz4"), "decompressed");
  refused(chunk(4, "bz2"), "decompressed");
  refused(chunk(4, "zip"), "lz4, bz2 or none");
  refused(Ros1BagWriter::record(Ros1BagWriter::field("op", "\x05"), ""), "'size'");
  refused(Ros1BagWriter::record(ros1::text("op"), ""), "no name");
}

TEST(Ros1Bag, ThatIsNoneIsRefusedWithWhatToDo) {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& bytes, const char* why, const char* remedy) {
    EXPECT_TRUE(fails_saying([&] { return BagReader(folder.write("some.bag", bytes)); }, "some.bag",
                             why, remedy));
  };
  refused("", "no bag of ROS 1", "1 or 2");
  refused("#ROSBAG V1.2\nand more", "older format", "rosbag reindex");
  refused("#ROSBAG V2.0\n", "ends before", "copy it again");
  refused("#ROSBAG V2.0\n" + Ros1BagWriter::record(Ros1BagWriter::field("op", "\x05"), ""),
          "does not begin as a bag", "copy it again");
  refused(
      "#ROSBAG V2.0\n" + Ros1BagWriter::record(Ros1BagWriter::field("op", "\x03") +
                                                   Ros1BagWriter::field("encryptor", "rosbag/Aes"),
                                               ""),
      "encrypted", "rosbag decrypt");
  std::filesystem::create_directory(folder.path() / "bags");
  static_cast<void>(folder.write("bags/a.bag", ""));
  EXPECT_TRUE(fails_saying([&] { return BagReader(folder.path() / "bags"); }, "holds bags of ROS 1",
                           "name one"));
}

TEST(Ros1Bag, OfAnUnknownTypeIsRefusedWhenItIsRead) {
  const TemporaryFolder folder;
  Ros1BagWriter writer;
  writer.message("/a", "pkg/Own", 1, "it");
  BagReader reader(folder.write("own.bag", writer.close()));
  EXPECT_EQ(reader.topics().front().type, "pkg/msg/Own");
  EXPECT_TRUE(fails_saying([&] { return reader.read(reader.places("/a").front()); }, "own.bag",
                           "message 1 of /a", "pkg/msg/Own"));
}

// A message of ROS 1, decoded as the readers of bags do.
template <class Message>
Message moved(const std::string& bytes) {
  const auto message = std::as_bytes(std::span(bytes));
  return ros::decode<Message>(ros::from_ros1(Message::type, message, "it"), "it");
}

TEST(Ros1Messages, HaveTheFieldsThatTheyWereWrittenWith) {
  const auto image = moved<ros::Image>(ros1::image(3'000'000'005, 2, 1, {500, 600}, "mono16"));
  EXPECT_EQ(image.header.stamp.nanoseconds(), 3'000'000'005);
  EXPECT_EQ(image.header.frame_id, "optical");
  EXPECT_EQ(image.width, 2U);
  EXPECT_EQ(image.height, 1U);
  EXPECT_EQ(image.encoding, "mono16");
  EXPECT_EQ(image.step, 4U);
  EXPECT_EQ(image.data.size(), 4U);

  const auto info =
      moved<ros::CameraInfo>(ros1::camera_info(640, 480, 390.5, 331.25, 242.5, "plumb_bob", {0.1}));
  EXPECT_EQ(info.width, 640U);
  EXPECT_EQ(info.height, 480U);
  EXPECT_EQ(info.k[0], 390.5);
  EXPECT_EQ(info.k[2], 331.25);
  EXPECT_EQ(info.k[5], 242.5);
  EXPECT_EQ(info.d, std::vector<double>{0.1});
  EXPECT_EQ(info.distortion_model, "plumb_bob");

  std::string transforms =
      ros1::number(std::uint32_t{1}) + ros1::header(7, "odom") + ros1::text("camera");
  for (const double each : {1.0, 2.0, 3.0, 0.0, 0.0, 1.0, 0.0}) transforms += ros1::number(each);
  const auto tf = moved<ros::TFMessage>(transforms).transforms.at(0);
  EXPECT_EQ(tf.header.frame_id, "odom");
  EXPECT_EQ(tf.child_frame_id, "camera");
  EXPECT_EQ(tf.translation, (std::array{1.0, 2.0, 3.0}));
  EXPECT_EQ(tf.rotation, (std::array{0.0, 0.0, 1.0, 0.0}));

  std::string points = ros1::header(7, "lidar") + ros1::number(std::uint32_t{1}) +
                       ros1::number(std::uint32_t{2}) + ros1::number(std::uint32_t{1}) +
                       ros1::text("x") + ros1::number(std::uint32_t{4}) + '\x07' +
                       ros1::number(std::uint32_t{1}) + '\0' + ros1::number(std::uint32_t{8}) +
                       ros1::number(std::uint32_t{16}) + ros1::text(std::string(16, 'p')) + '\1';
  const auto cloud = moved<ros::PointCloud2>(points);
  EXPECT_EQ(cloud.width, 2U);
  EXPECT_EQ(cloud.fields.at(0).name, "x");
  EXPECT_EQ(cloud.fields.at(0).offset, 4U);
  EXPECT_EQ(cloud.fields.at(0).datatype, 7);
  EXPECT_EQ(cloud.point_step, 8U);
  EXPECT_EQ(cloud.data.size(), 16U);
  EXPECT_TRUE(cloud.is_dense);

  const auto packed =
      moved<ros::CompressedImage>(ros1::header(7, "c") + ros1::text("png") + ros1::text("12345"));
  EXPECT_EQ(packed.format, "png");
  EXPECT_EQ(packed.data.size(), 5U);
  const auto pair = moved<ros::KeyValue>(ros1::text("Name") + ros1::text("D415"));
  EXPECT_EQ(pair.key + pair.value, "NameD415");
  EXPECT_EQ(moved<ros::Float32>(ros1::number(0.25F)).data, 0.25F);
  EXPECT_TRUE(fails_saying([] { return moved<ros::Float32>("abc"); }, "it", "too early"));
  EXPECT_TRUE(fails_saying([] { return moved<ros::String>(ros1::number(0xffffffffU)); }, "it",
                           "more than it can hold"));
}

TEST(Bz2, GivesNoMoreThanItMay) {
  std::string zeros(200'000, '\0');
  std::string packed(10'000, '\0');
  auto size = static_cast<unsigned>(packed.size());
  ASSERT_EQ(BZ2_bzBuffToBuffCompress(packed.data(), &size, zeros.data(),
                                     static_cast<unsigned>(zeros.size()), 1, 0, 0),
            BZ_OK);
  packed.resize(size);
  const auto bytes = std::as_bytes(std::span(packed));
  EXPECT_EQ(decompress_bz2(bytes, zeros.size(), "it").size(), zeros.size());
  EXPECT_TRUE(fails_saying([&] { return decompress_bz2(bytes, zeros.size() - 1, "it"); }, "it",
                           "more than 199999 bytes"));
  EXPECT_TRUE(fails_saying([&] { return decompress_bz2(bytes.first(size - 1), 300'000, "it"); },
                           "it", "too early"));
  packed += "more";
  EXPECT_TRUE(fails_saying(
      [&] { return decompress_bz2(std::as_bytes(std::span(packed)), 300'000, "it"); }, "it"));
}

}  // namespace test_ros1
}  // namespace palpate
