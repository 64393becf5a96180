// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>
#include <cstring>

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsrt/log.h>
#include <gtest/gtest.h>

#include "palpate/drivers/cyclone_api.hpp"
#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"

#include "tests/drivers/dds_test.hpp"
#include "tests/support/errors.hpp"

// What is written out of Cyclone's headers is what they say.
namespace cyclone = palpate::cyclone;
#define SAME_PLACE(OURS, MINE, THEIRS, FIELD) \
  static_assert(offsetof(cyclone::OURS, MINE) == offsetof(THEIRS, FIELD))
static_assert(sizeof(cyclone::TopicDescriptor) == sizeof(dds_topic_descriptor_t));
SAME_PLACE(TopicDescriptor, flags, dds_topic_descriptor_t, m_flagset);
SAME_PLACE(TopicDescriptor, type_name, dds_topic_descriptor_t, m_typename);
SAME_PLACE(TopicDescriptor, instruction_count, dds_topic_descriptor_t, m_nops);
SAME_PLACE(TopicDescriptor, instructions, dds_topic_descriptor_t, m_ops);
SAME_PLACE(TopicDescriptor, type_information, dds_topic_descriptor_t, type_information);
SAME_PLACE(TopicDescriptor, data_representation, dds_topic_descriptor_t,
           restrict_data_representation);
static_assert(sizeof(cyclone::SampleInfo) == sizeof(dds_sample_info_t));
SAME_PLACE(SampleInfo, instance_state, dds_sample_info_t, instance_state);
SAME_PLACE(SampleInfo, valid_data, dds_sample_info_t, valid_data);
static_assert(sizeof(cyclone::Endpoint) == sizeof(dds_builtintopic_endpoint_t));
SAME_PLACE(Endpoint, topic_name, dds_builtintopic_endpoint_t, topic_name);
SAME_PLACE(Endpoint, type_name, dds_builtintopic_endpoint_t, type_name);
static_assert(sizeof(cyclone::Guid) == sizeof(dds_guid_t));
SAME_PLACE(Endpoint, participant_key, dds_builtintopic_endpoint_t, participant_key);
SAME_PLACE(Endpoint, qos, dds_builtintopic_endpoint_t, qos);
SAME_PLACE(SampleInfo, publication_handle, dds_sample_info_t, publication_handle);
static_assert(cyclone::publications_topic == DDS_BUILTIN_TOPIC_DCPSPUBLICATION);
static_assert(cyclone::precondition_not_met == DDS_RETCODE_PRECONDITION_NOT_MET);
static_assert(cyclone::any_state == DDS_ANY_STATE);
static_assert(cyclone::alive_state == DDS_IST_ALIVE);
static_assert(cyclone::data_available == DDS_DATA_AVAILABLE_STATUS);
static_assert(cyclone::no_optimise == DDS_TOPIC_NO_OPTIMIZE);
static_assert(cyclone::log_errors == (DDS_LC_FATAL | DDS_LC_ERROR));
static_assert(cyclone::volatile_data == DDS_DURABILITY_VOLATILE);
static_assert(cyclone::transient_local == DDS_DURABILITY_TRANSIENT_LOCAL);
static_assert(cyclone::keep_last == DDS_HISTORY_KEEP_LAST);
static_assert(cyclone::best_effort == DDS_RELIABILITY_BEST_EFFORT);
static_assert(cyclone::reliable == DDS_RELIABILITY_RELIABLE);
static_assert(sizeof(ddsrt_iovec_t) == sizeof(iovec));
static_assert(cyclone::op_return == DDS_OP_RTS && cyclone::op_field == DDS_OP_ADR);
static_assert(cyclone::of_1_byte == DDS_OP_VAL_1BY && cyclone::of_2_bytes == DDS_OP_VAL_2BY);
static_assert(cyclone::of_4_bytes == DDS_OP_VAL_4BY && cyclone::of_8_bytes == DDS_OP_VAL_8BY);
static_assert(cyclone::of_text == DDS_OP_VAL_STR && cyclone::of_sequence == DDS_OP_VAL_SEQ);
static_assert(cyclone::of_array == DDS_OP_VAL_ARR && cyclone::of_struct == DDS_OP_VAL_STU);
static_assert(cyclone::of_flag == DDS_OP_VAL_BLN);

namespace palpate::dds {
namespace test_dds {

constexpr double long_enough = 60.0;  // [s]

class Dds : public ::testing::Test {
 protected:
  // Waits for a message, however slow the machine is.
  static std::vector<std::byte> next(Participant& participant, Reader& reader) {
    std::vector<std::byte> cdr;
    for (double waited = 0.0; cdr.empty() && waited < long_enough; waited += 0.1) {
      if (!reader.take(
              [&](std::span<const std::byte> bytes) { cdr.assign(bytes.begin(), bytes.end()); }))
        participant.wait(0.1);
    }
    return cdr;
  }

  // Sent and received, a message is what encode() makes of it, but for the last two bits of its
  // header, which count the bytes that fill up its end.
  template <class Message>
  static void goes_through(const Message& message) {
    Participant participant("test:");
    const Quality kept{.reliable = true, .keeps_for_late = true};
    Writer writer(participant, "/test/topic", message, kept);
    Reader reader(participant, "test/topic", Message{}, kept);
    ASSERT_TRUE(writer.write(message));
    std::vector<std::byte> expected = ros::encode(message);
    std::vector<std::byte> cdr = next(participant, reader);
    ASSERT_GE(cdr.size(), expected.size()) << Message::type;
    EXPECT_LT(cdr.size(), expected.size() + 4) << Message::type;
    EXPECT_EQ(std::to_integer<int>(cdr[3]) & ~3, 0);
    cdr[3] = std::byte{0};
    cdr.resize(expected.size());
    EXPECT_EQ(cdr, expected) << Message::type;
    EXPECT_EQ(reader.writers(), 1);
    EXPECT_EQ(writer.readers(), 1);
  }

  test::OwnNetwork network_;
};

ros::Header header(const char* frame) { return {{17, 250'000'001}, frame}; }

std::vector<std::byte> bytes(std::size_t count) {
  std::vector<std::byte> all(count);
  for (std::size_t i = 0; i < count; ++i) all[i] = static_cast<std::byte>(i * 7);
  return all;
}

TEST_F(Dds, CarriesEachTypeOfMessageAsBagsHaveIt) {
  goes_through(ros::Image{header("a"), 3, 5, "16UC1", 0, 10, bytes(30)});
  goes_through(ros::CompressedImage{header(""), "16UC1; compressedDepth png", bytes(1001)});
  ros::CameraInfo info;
  info.header = header("optical");
  info.height = 3;
  info.width = 5;
  info.distortion_model = "plumb_bob";
  info.d = {0.5, -1.0, 0.0, 2e-300, 7.0};
  info.k = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  info.p[11] = 12.0;
  info.roi = {1, 2, 3, 4};
  info.do_rectify = true;
  goes_through(info);
  ros::PointCloud2 cloud;
  cloud.header = header("b");
  cloud.width = 2;
  cloud.fields = {{"x", 0, 7, 1}, {"long name", 4, 8, 1}, {"", 12, 2, 3}};
  cloud.point_step = 16;
  cloud.row_step = 32;
  cloud.data = bytes(32);
  goes_through(cloud);
  goes_through(ros::PointCloud2{});
  goes_through(ros::PoseStamped{header("hand"), {1.0, 2.0, 3.0}, {0.0, 0.6, 0.0, 0.8}});
  goes_through(ros::WrenchStamped{header("hand"), {1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}});
  ros::TFMessage tf;
  tf.transforms = {{header("map"), "odom", {1.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 1.0}},
                   {header("odometry"), "base", {0.0, 2.0, 0.0}, {1.0, 0.0, 0.0, 0.0}}};
  goes_through(tf);
  goes_through(ros::TFMessage{});
  goes_through(ros::Float64MultiArray{"axes", {1.0, 2.0, 3.0}});
  goes_through(ros::Bool{true});
  goes_through(ros::Point{{1.0, -2.0, 3.0}});
  goes_through(ros::Vector3{{1.0, -2.0, 3.0}});
  goes_through(ros::Wrench{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}});
  goes_through(ros::OmniFeedback{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}});
}

TEST_F(Dds, CarriesWhatANodeReports) {
  goes_through(ros::Vector3Stamped{header("hand"), {1.0, 2.0, 3.0}});
  goes_through(ros::UInt8{2});
  goes_through(ros::UInt32{1U << 31});
  ros::DiagnosticArray report{header(""), {{}, {}}};
  report.status[0].name = "loop";
  report.status[0].values = {{"rate [Hz]", "1000"}, {"", "x"}};
  report.status[1].level = 2;
  report.status[1].message = "no tick comes";
  report.status[1].values = {{"one more", "y"}};
  goes_through(report);
  ros::Marker ball;
  ball.header = header("world");
  ball.ns = "proxy";
  ball.scale = {0.01, 0.02, 0.03};
  ball.colour = {0.1F, 0.2F, 0.3F, 1.0F};
  ball.lifetime = {1, 7};
  ros::Marker line = ball;
  line.id = 3;
  line.points = {{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}};
  goes_through(ros::MarkerArray{{ball, line, ball}});
  goes_through(ros::MarkerArray{});
}

TEST_F(Dds, CarriesParametersAndServices) {
  const std::vector<ros::Parameter> three = {{"stiffness", ros::ParameterValue::of(1.5)},
                                             {"method", ros::ParameterValue::of(std::string("s"))},
                                             {"n", ros::ParameterValue::of(std::int64_t{-3})}};
  goes_through(ros::ParameterEvent{{17, 5}, "/palpate", {}, three, {three[0]}});
  const ros::RequestHeader ask{0xfedcba9876543210U, 12};
  goes_through(ros::SetParameters::Request{ask, three});
  goes_through(ros::SetParameters::Reply{ask, {{true, ""}, {false, "no such"}, {true, "x"}}});
  goes_through(ros::SetParametersAtomically::Request{ask, three});
  goes_through(ros::SetParametersAtomically::Reply{ask, {false, "too large"}});
  goes_through(ros::GetParameters::Request{ask, {"a", "", "longer"}});
  goes_through(ros::GetParameters::Reply{ask, {three[0].value, {}, three[1].value}});
  goes_through(ros::GetParameterTypes::Request{ask, {}});
  goes_through(ros::GetParameterTypes::Reply{ask, {3, 0, 4}});
  goes_through(ros::DescribeParameters::Request{ask, {"stiffness"}});
  ros::ParameterDescriptor described;
  described.name = "stiffness";
  described.type = ros::ParameterValue::number;
  described.floating_point_range = {{0.0, 20000.0, 0.0}};
  ros::ParameterDescriptor whole;
  whole.read_only = true;
  whole.integer_range = {{-5, 5, 1}};
  goes_through(ros::DescribeParameters::Reply{ask, {described, whole, {}}});
  goes_through(ros::ListParameters::Request{ask, {{"safety"}, 2}});
  goes_through(ros::ListParameters::Reply{ask, {{"safety.a", "safety.b"}, {"safety"}}});
  goes_through(ros::Trigger::Request{ask});
  goes_through(ros::Trigger::Reply{ask, {true, "a folder"}});
  ros::ParticipantEntitiesInfo<16> info;
  info.participant = {1, 2, 3};
  info.nodes.resize(2);
  info.nodes[0].node_name = "palpate";
  info.nodes[0].readers = {{4, 5}, {6, 7}};
  info.nodes[1].node_namespace = "/";
  info.nodes[1].writers = {{8}};
  goes_through(info);
  goes_through(ros::ParticipantEntitiesInfo<24>{});
}

// Of rmw_dds_common's and rmw_cyclonedds_cpp's sources: what a node of either generation reads.
TEST_F(Dds, LaysOutWhatRosReadsByItsOwnRules) {
  ros::ParticipantEntitiesInfo<24> info;
  info.participant[0] = 7;
  info.nodes.resize(1);
  info.nodes[0] = {"/", "p", {}, {}};
  const std::vector<std::byte> cdr = ros::encode(info);
  ASSERT_EQ(cdr.size(), 4U + 24 + 4 + (4 + 2) + 2 + (4 + 2) + 2 + 4 + 4);
  EXPECT_EQ(cdr[4], std::byte{7});
  EXPECT_EQ(cdr[4 + 24], std::byte{1});  // one node
  // A request: two numbers of 8 bytes in front, and the rest as without them.
  const std::vector<std::byte> request =
      ros::encode(ros::GetParameters::Request{{0x0102030405060708U, 9}, {"a"}});
  ASSERT_EQ(request.size(), 4U + 8 + 8 + 4 + 4 + 2);
  EXPECT_EQ(request[4], std::byte{8});
  EXPECT_EQ(request[4 + 8], std::byte{9});
  EXPECT_EQ(request[4 + 16], std::byte{1});  // one name
  EXPECT_EQ(dds_topic("/palpate/hold", ros::Trigger::Request::type), "rq/palpate/holdRequest");
  EXPECT_EQ(dds_topic("/palpate/hold", ros::Trigger::Reply::type), "rr/palpate/holdReply");
  EXPECT_EQ(dds_topic("", decltype(info)::type), "ros_discovery_info");
  EXPECT_EQ(dds_type(ros::Trigger::Request::type), "std_srvs::srv::dds_::Trigger_Request_");
}

TEST_F(Dds, TellsTheGenerationOfNodesByTheirTypeHash) {
  Participant participant("test:");
  const auto hears = [&](Generation generation) {
    for (double waited = 0.0; waited < long_enough; waited += 0.02) {
      if (participant.generation() == generation) return true;
      participant.wait(0.02);
    }
    return false;
  };
  const ros::ParticipantEntitiesInfo<24> old;
  const ros::ParticipantEntitiesInfo<16> modern;
  const Quality kept{.reliable = true, .keeps_for_late = true};
  EXPECT_EQ(participant.generation(), Generation::unknown);
  const Writer own(participant, "", modern, kept);
  EXPECT_EQ(participant.generation(), Generation::unknown);
  Participant humble("humble:");
  const Writer humble_writer(humble, "", old, kept);
  EXPECT_TRUE(hears(Generation::to_humble));
  Participant jazzy("jazzy:");
  Quality hashed = kept;
  hashed.user_data = "typehash=RIHS01_0;";
  const Writer jazzy_writer(jazzy, "", modern, hashed);
  EXPECT_TRUE(hears(Generation::from_iron));
}

TEST_F(Dds, NamesWhatOthersPublish) {
  // A domain of its own: in the others' one, a session that was killed is heard of for seconds.
  const test::Environment domain("ROS_DOMAIN_ID", "99");
  Participant camera("camera:");
  const Writer writer(camera, "/camera/depth/image_raw", ros::Image{}, {});
  Participant participant("test:");
  std::vector<Publication> heard;
  for (double waited = 0.0; heard.empty() && waited < long_enough; waited += 0.02) {
    participant.wait(0.02);
    heard = participant.publications();
  }
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_EQ(heard[0], (Publication{"/camera/depth/image_raw", "sensor_msgs/msg/Image"}));
}

TEST_F(Dds, RefusesWhatIsNoDomain) {
  const test::Environment domain("ROS_DOMAIN_ID", "hall");
  EXPECT_TRUE(test::fails_saying([] { return std::make_unique<Participant>("ros2:"); },
                                 "ROS_DOMAIN_ID", "hall", "0 to 232"));
}

TEST_F(Dds, NamesThePackageWhereTheLibraryIsMissing) {
  const test::Environment library("PALPATE_CYCLONEDDS", "/no/such/library");
  EXPECT_TRUE(test::fails_saying([] { return std::make_unique<Participant>("ros2:"); },
                                 "Cyclone DDS", "apt install"));
}

}  // namespace test_dds
}  // namespace palpate::dds
