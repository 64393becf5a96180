// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/net/viewer/protocol.hpp"

namespace palpate {
namespace test_protocol {

template <class Number>
Number at(const std::vector<std::byte>& bytes, std::size_t offset) {
  Number value;
  EXPECT_LE(offset + sizeof value, bytes.size());
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

std::vector<std::byte> hand_bytes(std::uint8_t held, const Vec3& target) {
  std::vector<std::byte> bytes(32);
  bytes[0] = std::byte{16};
  bytes[1] = std::byte{held};
  std::memcpy(bytes.data() + 8, target.data(), 24);
  return bytes;
}

// An image of 3 x 2 pixels.
std::shared_ptr<const DepthImage> small_image() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Vec3(1.0, 2.0, 3.0);
  return std::make_shared<const DepthImage>(
      std::make_shared<const ViewingRays>(
          Intrinsics{.width = 3, .height = 2, .fx = 525.0, .fy = 525.0, .cy = 239.5}),
      std::vector<std::uint16_t>{0, 700, 65535, 701, 702, 703}, 1000.0, pose);
}

TEST(Protocol, SendsADepthImageAsItLiesInMemory) {
  const auto image = small_image();
  const ViewerMessage message = frame_message(3, 41, {.stamp = 12.5, .cloud = image});
  ASSERT_EQ(message.head.size(), 96u);
  EXPECT_FALSE(message.text);
  EXPECT_EQ(at<std::uint8_t>(message.head, 0), 1);
  EXPECT_EQ(at<std::uint8_t>(message.head, 1), 3);
  EXPECT_EQ(at<std::uint8_t>(message.head, 2), 0);
  EXPECT_EQ(at<std::uint32_t>(message.head, 4), 41u);
  EXPECT_EQ(at<double>(message.head, 8), 12.5);
  EXPECT_EQ(at<std::uint32_t>(message.head, 16), 3u);
  EXPECT_EQ(at<std::uint32_t>(message.head, 20), 2u);
  EXPECT_EQ(at<float>(message.head, 24), 525.0F);
  EXPECT_EQ(at<float>(message.head, 36), 239.5F);
  EXPECT_EQ(at<float>(message.head, 40), 0.001F);
  EXPECT_EQ(at<float>(message.head, 44), 1.0F);           // row 0: rotation ...
  EXPECT_EQ(at<float>(message.head, 44 + 4 * 3), 1.0F);   // ... and translation
  EXPECT_EQ(at<float>(message.head, 44 + 4 * 11), 3.0F);  // row 2
  EXPECT_EQ(static_cast<const void*>(message.payload.data()), image->depth().data())
      << "it was copied";
  EXPECT_EQ(message.payload.size(), 12u);
}

TEST(Protocol, SendsColoursAsTheyLieInMemoryAndSaysWhose) {
  auto colour = std::make_shared<ColourImage>();
  colour->width = 3;
  colour->height = 2;
  colour->rgb.assign(18, 7);
  const Frame frame{.cloud = small_image(), .colour = colour};
  const ViewerMessage registered = frame_message(0, 0, frame);
  EXPECT_EQ(at<std::uint8_t>(registered.head, 3), 1);
  EXPECT_EQ(registered.head.size(), 96u);
  EXPECT_EQ(registered.colour, colour) << "it was copied";
  colour->height = 1;
  colour->rgb.resize(9);
  EXPECT_THROW(frame_message(0, 0, frame), Error);
  colour->camera = ColourImage::Camera{};
  colour->camera->intrinsics.fx = 400.0;
  colour->camera->world_from_camera.translation() = Vec3(1.0, 2.0, 3.0);
  const ViewerMessage own = frame_message(0, 0, frame);
  EXPECT_EQ(at<std::uint8_t>(own.head, 3), 2);
  ASSERT_EQ(own.head.size(), 168u);
  EXPECT_EQ(at<std::uint32_t>(own.head, 96), 3u);
  EXPECT_EQ(at<float>(own.head, 104), 400.0F);
  EXPECT_EQ(at<float>(own.head, 120 + 4 * 3), -1.0F) << "from the world to the camera";
  colour->rgb.pop_back();
  EXPECT_THROW(frame_message(0, 0, frame), Error);
}

TEST(Protocol, PutsTheFacesOfAMeshBehindItsCorners) {
  // Of two faces the second has a corner that is nowhere, and the third point is before it.
  Surface mesh;
  mesh.points.assign(5, Vec3::Constant(0.5));
  mesh.points[1] = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  mesh.points[4] = Vec3(1, 2, 3);
  mesh.triangles = {{4, 0, 2}, {0, 1, 2}};
  auto colour = std::make_shared<ColourImage>();
  for (std::uint8_t i = 0; i < 15; ++i) colour->rgb.push_back(i);
  colour->width = 5;
  colour->height = 1;
  const ViewerMessage message =
      frame_message(0, 0, {.cloud = std::make_shared<PointCloud>(mesh), .colour = colour});
  EXPECT_EQ(at<std::uint8_t>(message.head, 2), 2);
  EXPECT_EQ(at<std::uint32_t>(message.head, 16), 4u);
  EXPECT_EQ(at<std::uint32_t>(message.head, 20), 1u);
  EXPECT_EQ(at<std::uint32_t>(message.head, 92), 1u);
  const std::vector<std::byte> payload(message.payload.begin(), message.payload.end());
  ASSERT_EQ(payload.size(), 12 * 4 + 3 * 4u);
  EXPECT_EQ(at<float>(payload, 4 * 10), 2.0F);
  EXPECT_EQ(at<std::uint32_t>(payload, 12 * 4), 3u);
  EXPECT_EQ(at<std::uint32_t>(payload, 12 * 4 + 8), 1u);
  ASSERT_EQ(message.colour->rgb.size(), 12u);
  EXPECT_EQ(message.colour->rgb[3], 6);

  const std::vector<Vec3> points(3, Vec3::Zero());
  const ViewerMessage plain = frame_message(0, 0, {.cloud = std::make_shared<PointCloud>(points)});
  EXPECT_EQ(at<std::uint32_t>(plain.head, 16), 3u);
  EXPECT_EQ(at<std::uint32_t>(plain.head, 92), 0u);
}

TEST(Protocol, SendsTheRaysOfALensAndThePathOfAHand) {
  const ViewingRays rays(Intrinsics{.width = 2, .height = 1, .fx = 2.0, .fy = 1.0, .cx = 0.5});
  const ViewerMessage message = rays_message(2, rays);
  EXPECT_EQ(at<std::uint32_t>(message.head, 0), 3u | 2u << 8U);
  EXPECT_EQ(at<std::uint32_t>(message.head, 4), 2u);
  EXPECT_EQ(at<std::uint32_t>(message.head, 8), 1u);
  const std::vector<std::byte> payload(message.payload.begin(), message.payload.end());
  ASSERT_EQ(payload.size(), 16u);
  EXPECT_EQ(at<float>(payload, 8), 0.25F);
  EXPECT_THROW(path_message(0, std::vector<float>(7)), Error);
  EXPECT_EQ(at<std::uint32_t>(path_message(0, std::vector<float>(8)).head, 4), 2u);
}

TEST(Protocol, SendsTheSurfaceOfATool) {
  const ViewerMessage message = tool_message(make_tool("box:40x20x5mm?points=100", {}).get());
  EXPECT_EQ(at<std::uint32_t>(message.head, 0), 5u);
  EXPECT_EQ(at<std::uint32_t>(message.head, 4), 8u);
  EXPECT_EQ(at<std::uint32_t>(message.head, 8), 12u);
  const std::vector<std::byte> payload(message.payload.begin(), message.payload.end());
  ASSERT_EQ(payload.size(), 12u * (8 + 12));
  EXPECT_EQ(std::abs(at<float>(payload, 0)), 0.02F);
  EXPECT_LT(at<std::uint32_t>(payload, 12 * 8), 8u);
  const ViewerMessage ball = tool_message(nullptr);
  EXPECT_EQ(ball.head.size(), 12u);
  EXPECT_EQ(at<std::uint32_t>(ball.head, 8), 0u);
  EXPECT_TRUE(ball.payload.empty());
}

TEST(Protocol, SendsTheNewestSamplesWithTheirAge) {
  TickBatch batch;
  ServoTick& record = batch.newest;
  record.tick.t = 100.0;
  record.tick.state = ContactState::contact;
  batch.flags = 5;
  batch.safety = 1u << 12;
  record.tick.frame = -1;
  record.force = Vec3(0.0, 0.0, 2.5);
  record.gain = 0.25;
  record.tick.force = Vec3(0.0, 0.0, 2.0);
  record.region = Vec3(0.0, 0.0, 3.0);  // more along the same way: not their sum
  record.guidance = Vec3(4.0, 0.0, 0.0);
  record.place = Vec3(0.0, 0.0, 0.02);
  record.fixtures = 5;
  record.tick.orientation = {0.5, 0.25, -0.25, 0.125};
  record.tick.proxy_orientation = {1.0, 2.0, 3.0, 4.0};
  record.torque = {0.0, 0.0, 0.75};
  record.tick.proxy = Vec3(1.0, 2.0, 3.0);
  record.tick.contact_count = 2;
  record.tick.contacts[1] = {{0.5F, 0.0F, -0.5F}, {0.0F, 0.0F, 4.0F}};
  for (std::size_t i = 0; i < TickBatch::max_samples + 10; ++i)
    batch.samples.push_back(
        {100.0 - 0.001 * static_cast<double>(i), 1.0F, 0.5F, 2.0F, 3e-6F, 4e-4F, -5e-4F});
  const ViewerMessage message = ticks_message(batch);
  EXPECT_EQ(at<std::uint16_t>(message.head, 2), TickBatch::max_samples);
  ASSERT_EQ(message.head.size(), 160 + 2 * 24 + 28 * TickBatch::max_samples);
  EXPECT_EQ(at<std::uint32_t>(message.head, 4), 5u);
  EXPECT_EQ(at<double>(message.head, 8), 100.0);
  EXPECT_EQ(at<std::uint32_t>(message.head, 16), 1u << 12);
  EXPECT_EQ(at<float>(message.head, 68), 2.5F);
  EXPECT_EQ(at<std::int32_t>(message.head, 76), -1);
  EXPECT_EQ(at<float>(message.head, 80), 0.25F);
  EXPECT_EQ(at<float>(message.head, 84), 5.0F);
  EXPECT_EQ(at<float>(message.head, 96), 0.02F);
  EXPECT_EQ(at<float>(message.head, 100), 3.0F);
  EXPECT_EQ(at<float>(message.head, 104), 4.0F);
  EXPECT_EQ(at<std::uint32_t>(message.head, 108), 5u);
  EXPECT_EQ(at<float>(message.head, 112), 0.25F) << "x first";
  EXPECT_EQ(at<float>(message.head, 124), 0.5F) << "w last";
  EXPECT_EQ(at<float>(message.head, 140), 1.0F);
  EXPECT_EQ(at<float>(message.head, 152), 0.75F);
  EXPECT_EQ(at<std::uint32_t>(message.head, 156), 2u);
  EXPECT_EQ(at<float>(message.head, 160), 1.0F) << "at the proxy";
  EXPECT_EQ(at<float>(message.head, 184), 1.5F);
  EXPECT_EQ(at<float>(message.head, 192), 2.5F);
  EXPECT_EQ(at<float>(message.head, 204), 1.0F) << "as the gain is";
  EXPECT_NEAR(at<float>(message.head, 208), 0.010, 1e-6) << "the first ten are the oldest";
  EXPECT_EQ(at<float>(message.head, 208 + 16), 3e-6F);
  EXPECT_EQ(at<float>(message.head, 208 + 20), 4e-4F);
  EXPECT_EQ(at<float>(message.head, 208 + 24), -5e-4F);
}

TEST(Protocol, UnderstandsAHandThatIsHeldOrLetGo) {
  const auto hand = [](std::uint8_t grip) {
    return std::get<HandMessage>(parse_binary(hand_bytes(grip, {0.1, -0.2, 0.3})).value());
  };
  EXPECT_TRUE(hand(1).held);
  EXPECT_EQ(hand(1).target, Vec3(0.1, -0.2, 0.3));
  EXPECT_FALSE(hand(0).held);
  EXPECT_FALSE(hand(0).target) << "it stays where it is";
  EXPECT_FALSE(hand(2).held);
  EXPECT_EQ(hand(2).target, Vec3(0.1, -0.2, 0.3));
}

TEST(Protocol, UnderstandsAHandThatIsTurned) {
  std::vector<std::byte> bytes = hand_bytes(1, {0.1, -0.2, 0.3});
  bytes.resize(64);
  const auto turned = [&](const std::array<double, 4>& xyzw) {
    std::memcpy(bytes.data() + 32, xyzw.data(), 32);
    return parse_binary(bytes);
  };
  const auto hand = std::get<HandMessage>(turned({0.6, 0.0, 0.0, 0.8}).value());
  EXPECT_EQ(hand.target, Vec3(0.1, -0.2, 0.3));
  EXPECT_NEAR(hand.orientation.value().x(), 0.6, 1e-12);
  EXPECT_NEAR(hand.orientation.value().w(), 0.8, 1e-12);
  EXPECT_FALSE(turned({0.6, 0.0, 0.0, 0.9})) << "not of length 1";
  EXPECT_FALSE(turned({std::nan(""), 0.0, 0.0, 1.0}));
}

TEST(Protocol, RefusesAHandThatIsNowhere) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, 1000.1, -1e300}) {
    EXPECT_FALSE(parse_binary(hand_bytes(1, {0.0, bad, 0.0}))) << bad;
    EXPECT_FALSE(parse_binary(hand_bytes(1, {0.0, 0.0, bad}))) << bad;
    EXPECT_FALSE(parse_binary(hand_bytes(2, {bad, 0.0, 0.0}))) << bad;
  }
  EXPECT_FALSE(parse_binary(hand_bytes(3, {0.0, 0.0, 0.0})));
}

TEST(Protocol, RefusesMessagesThatAreNotItsOwnToTheByte) {
  std::vector<std::byte> bytes = hand_bytes(1, {0.0, 0.0, 0.0});
  bytes.pop_back();
  EXPECT_FALSE(parse_binary(bytes));
  bytes.resize(33);
  EXPECT_FALSE(parse_binary(bytes));
  EXPECT_FALSE(parse_binary({}));
  std::vector<std::byte> shown(8);
  shown[0] = std::byte{17};
  EXPECT_TRUE(parse_binary(shown));
  shown[1] = std::byte{Patch::max_views};
  EXPECT_FALSE(parse_binary(shown)) << "there is no such camera";
  shown[0] = std::byte{1};
  EXPECT_FALSE(parse_binary(shown)) << "only the program sends frames";
}

// @throws if it is no such command
template <class Asked>
Asked asked(const char* text) {
  return std::get<Asked>(parse_command(text).value());
}

TEST(Protocol, UnderstandsEachCommand) {
  const auto set = asked<SetParameter>(R"({"set": {"name": "stiffness", "value": 500}})");
  EXPECT_EQ(set.name, "stiffness");
  EXPECT_EQ(set.value, 500.0);
  const auto limit =
      asked<SetSafetyParameter>(R"({"set_safety": {"name": "max_force", "value": 2.5}})");
  EXPECT_EQ(limit.value, 2.5);
  EXPECT_EQ(asked<SetPlacement>(R"({"place": {"name": "scale", "value": 2}})").value, 2.0);
  EXPECT_EQ(asked<SetMethod>(R"({"method": "paper"})").name, "paper");
  EXPECT_EQ(asked<SetTool>(R"({"tool": "cone:60x6mm"})").text, "cone:60x6mm");
  EXPECT_FALSE(asked<SetRecording>(R"({"record": false})").on);
  asked<ResetHand>(R"({"reset": true})");
  const auto play =
      asked<SetPlayback>(R"({"play": {"paused": true, "loop": false, "speed": 0.5}})");
  EXPECT_TRUE(play.paused);
  EXPECT_FALSE(play.loop);
  EXPECT_EQ(play.speed, 0.5);
  EXPECT_EQ(asked<Rescale>(R"({"rescale": 0.5})").times, 0.5);
  EXPECT_EQ(asked<OpenScene>(R"({"open": "synthetic:desk"})").uri, "synthetic:desk");
  EXPECT_EQ(asked<Seek>(R"({"seek": 0.25})").share, 0.25);
  const auto brush = asked<SetBrush>(R"({"brush": {"material": "ice", "radius": 0.02}})");
  EXPECT_EQ(brush.material, "ice");
  EXPECT_EQ(brush.radius, 0.02);
  asked<DropBrush>(R"({"brush": null})");
  asked<ClearPaint>(R"({"clear_paint": true})");
  const auto forbid = asked<Forbid>(R"({"forbid": {"size": 0.1, "margin": 0.01}})");
  EXPECT_EQ(forbid.size, 0.1);
  EXPECT_EQ(forbid.margin, 0.01);
  EXPECT_EQ(asked<Guide>(R"({"guide": {"slack": 0.003}})").slack, 0.003);
  EXPECT_EQ(asked<RemoveFixture>(R"({"remove_fixture": "wall"})").name, "wall");
  asked<ResetFaults>(R"({"reset_faults": true})");
}

TEST(Protocol, RefusesCommandsThatAreNotItsOwn) {
  for (const char* text : {"",
                           "{}",
                           "null",
                           "[1]",
                           "{",
                           R"({"set": 1})",
                           R"({"set": {"name": "x"}})",
                           R"({"set": {"name": 1, "value": 1}})",
                           R"({"set": {"name": "x", "value": "1"}})",
                           R"({"set": {"name": "x", "value": 1, "more": 1}})",
                           R"({"method": 1})",
                           R"({"tool": null})",
                           R"({"record": "yes"})",
                           R"({"reset": false})",
                           R"({"reset_faults": 1})",
                           R"({"brush": "ice"})",
                           R"({"brush": {"material": "ice"}})",
                           R"({"brush": {"material": 1, "radius": 0.01}})",
                           R"({"clear_paint": false})",
                           R"({"forbid": {"size": 0.1}})",
                           R"({"forbid": true})",
                           R"({"guide": {}})",
                           R"({"guide": {"slack": "wide"}})",
                           R"({"remove_fixture": 1})",
                           R"({"quit": true})",
                           R"({"method": "paper", "reset": true})",
                           "\xff\xfe",
                           R"({"method": "\ud800"})"}) {
    EXPECT_FALSE(parse_command(text)) << text;
  }
  std::string deep(max_page_message, '[');
  EXPECT_FALSE(parse_command(deep));
  std::string longer = R"({"method": ")" + std::string(max_page_message, 'x') + "\"}";
  EXPECT_FALSE(parse_command(longer));
}

}  // namespace test_protocol
}  // namespace palpate
