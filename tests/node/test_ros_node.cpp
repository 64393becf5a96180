// SPDX-License-Identifier: Apache-2.0
// A session as a node, seen by another participant: what it publishes, and its services as
// rmw_cyclonedds_cpp asks them.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/node_messages.hpp"
#include "palpate/net/node/ros_node.hpp"
#include "palpate/servo/realtime.hpp"

#include "tests/drivers/dds_test.hpp"
#include "tests/drivers/ros_client.hpp"
#include "tests/support/errors.hpp"
#include "tests/support/patient.hpp"
#include "tests/support/temporary_folder.hpp"

namespace palpate {
namespace test_ros_node {

using ros::ParameterValue;

using test::long_enough;
constexpr dds::Quality reliable{.reliable = true, .depth = 50};

class RosNodeTest : public ::testing::Test {
 protected:
  // A hand that rests in a plane: there is a force all the time.
  RosNodeTest() {
    SessionOptions options;
    options.cameras.push_back({.uri = "synthetic:plane?size=64x48"});
    begin(std::move(options));
  }

  void begin(SessionOptions options) {
    session_.reset();
    session_ = std::make_unique<Session>(std::move(options));
  }

  void open(RosNodeOptions options = {}) {
    options.recordings.folder = folder_.path() / "recordings";
    node_ = make_ros_node(*session_, options);
    session_->start();
    other_ = std::make_unique<dds::Participant>("test:");
  }

  // Waits for a message that is as wanted.
  template <class Message>
  std::optional<Message> hears(const std::string& topic,
                               const std::function<bool(const Message&)>& wanted,
                               const std::function<void()>& meanwhile = {}) {
    dds::Reader reader(*other_, topic, Message{}, reliable);
    const double end = monotonic_now() + long_enough;
    while (monotonic_now() < end) {
      while (auto message = reader.take<Message>()) {
        if (wanted(*message)) return message;
      }
      if (meanwhile && reader.writers() > 0) meanwhile();
      other_->wait(0.02);
    }
    return std::nullopt;
  }

  template <class Service>
  auto ask(const std::string& name, typename Service::Request request = {}) {
    test::RosClient<Service> client(*other_, "/palpate/" + name);
    const auto reply = client.ask(std::move(request));
    EXPECT_TRUE(reply) << name << " was not answered";
    return reply.value_or(typename Service::Reply{}).content;
  }

  test::OwnNetwork network_;
  test::TemporaryFolder folder_;
  std::unique_ptr<Session> session_;
  std::unique_ptr<RosNode> node_;
  std::unique_ptr<dds::Participant> other_;
};

double age(const ros::Time& stamp) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration<double>(now).count() -
         1e-9 * static_cast<double>(stamp.nanoseconds());
}

TEST_F(RosNodeTest, PublishesTicksAndReports) {
  open({.frame = "table"});
  const auto hip =
      hears<ros::PoseStamped>("/palpate/hip", [](const auto& m) { return m.header.stamp.sec > 0; });
  ASSERT_TRUE(hip);
  EXPECT_EQ(hip->header.frame_id, "table");
  EXPECT_GE(age(hip->header.stamp), 0.0);
  EXPECT_LT(age(hip->header.stamp), long_enough);
  const auto any = [](const auto&) { return true; };
  EXPECT_TRUE(hears<ros::PoseStamped>("/palpate/proxy", any));
  EXPECT_TRUE(hears<ros::WrenchStamped>("/palpate/force", any));
  EXPECT_TRUE(hears<ros::Vector3Stamped>("/palpate/normal", any));
  EXPECT_TRUE(hears<ros::UInt8>("/palpate/contact", [](const auto& m) { return m.data <= 2; }));
  EXPECT_TRUE(hears<ros::UInt32>("/palpate/flags", any));
  EXPECT_TRUE(hears<ros::UInt32>("/palpate/safety_flags", any));
  const auto markers =
      hears<ros::MarkerArray>("/palpate/markers", [](const auto& m) { return !m.markers.empty(); });
  ASSERT_TRUE(markers);
  EXPECT_EQ(markers->markers[0].ns, "proxy");
  EXPECT_NEAR(markers->markers[0].scale[0], 2.0 * session_->settings().parameters.proxy.r_c(),
              1e-12);
  const auto report = hears<ros::DiagnosticArray>("/diagnostics", any);
  ASSERT_TRUE(report);
  ASSERT_EQ(report->status.size(), 5U);
  EXPECT_EQ(report->status[0].name, "palpate: servo loop");
  EXPECT_NE(report->status[1].name.find("synthetic:plane"), std::string::npos);
}

// A hand whose tool is tilted about x by 0.2 rad and goes down to the plane and up again, as often
// as it takes until a busy machine has the first frame; with motors in the wrist.
class TiltedHand final : public Device {
 public:
  [[nodiscard]] const DeviceInfo& info() const override { return info_; }
  HandState read(double t) noexcept override {
    begin_ = std::min(begin_, t);
    return {.position = {0.0, 0.0, 0.016 + 0.014 * std::cos(1.5 * (t - begin_))},
            .orientation = Eigen::Quaterniond(std::cos(0.1), std::sin(0.1), 0.0, 0.0)};
  }
  void write(const Vec3& /*force*/, double /*t*/) noexcept override {}

 private:
  DeviceInfo info_{
      .uri = "tilted:", .kind = "tilted", .limits = {.max_torque = 0.2}, .simulated = true};
  double begin_ = std::numeric_limits<double>::infinity();
};

TEST_F(RosNodeTest, PublishesHowAToolIsTurnedAndItsTorque) {
  SessionOptions options;
  options.cameras.push_back({.uri = "synthetic:plane?size=320x240"});
  options.tool = "box:40x20x5mm?points=500";
  options.open_devices[0] = std::make_unique<TiltedHand>();
  options.safety = test::patient();
  begin(std::move(options));
  open();
  // The plane pushes the edge at -y, which is the lower one.
  const auto force = hears<ros::WrenchStamped>(
      "/palpate/force", [](const auto& m) { return m.force[2] > 0.3 && m.torque[0] < -2e-3; });
  ASSERT_TRUE(force);
  const auto any = [](const auto&) { return true; };
  const auto hip = hears<ros::PoseStamped>("/palpate/hip", any);
  ASSERT_TRUE(hip);
  EXPECT_NEAR(hip->orientation[0], std::sin(0.1), 1e-9);
  EXPECT_NEAR(hip->orientation[3], std::cos(0.1), 1e-9);
  // The plane turns it back.
  EXPECT_TRUE(hears<ros::PoseStamped>(
      "/palpate/proxy", [](const auto& m) { return m.orientation[0] < std::sin(0.1) - 1e-4; }));
}

TEST_F(RosNodeTest, PublishesEachHandOfTheSession) {
  SessionOptions options;
  options.cameras.push_back({.uri = "synthetic:plane?size=64x48"});
  options.hands.push_back({.name = "left"});
  begin(std::move(options));
  open();
  const auto any = [](const auto&) { return true; };
  EXPECT_TRUE(hears<ros::PoseStamped>("/palpate/hip", any));
  EXPECT_TRUE(hears<ros::PoseStamped>("/palpate/left/hip", any));
  EXPECT_TRUE(hears<ros::WrenchStamped>("/palpate/left/force", any));
  EXPECT_TRUE(hears<ros::UInt8>("/palpate/left/contact", any));
  EXPECT_TRUE(hears<ros::MarkerArray>("/palpate/markers", [](const auto& m) {
    return m.markers.size() == 10 && m.markers[0].id == 0 && m.markers[5].id == 1;
  }));
  const auto report = hears<ros::DiagnosticArray>("/diagnostics", any);
  ASSERT_TRUE(report);
  ASSERT_EQ(report->status.size(), 7U);
  EXPECT_EQ(report->status[4].name, "palpate: left contact");
  EXPECT_TRUE(report->status[5].name.starts_with("palpate: left device")) << report->status[5].name;
}

TEST_F(RosNodeTest, SetsAndDescribesParameters) {
  open();
  const auto set = ask<ros::SetParameters>("set_parameters",
                                           {{},
                                            {{"stiffness", ParameterValue::of(321.0)},
                                             {"stiffness", ParameterValue::of(-1.0)},
                                             {"safety.max_device_force", ParameterValue::of(9.0)},
                                             {"theta", ParameterValue::of(0.002)}}});
  ASSERT_EQ(set.size(), 4U);
  EXPECT_TRUE(set[0].successful) << set[0].reason;
  EXPECT_FALSE(set[1].successful);
  EXPECT_NE(set[1].reason.find("-1"), std::string::npos) << set[1].reason;
  EXPECT_FALSE(set[2].successful);
  EXPECT_TRUE(set[3].successful) << set[3].reason;
  EXPECT_EQ(session_->settings().parameters.coupling.stiffness, 321.0);
  EXPECT_EQ(session_->settings().parameters.proxy.theta, 0.002);

  const auto together = ask<ros::SetParametersAtomically>(
      "set_parameters_atomically",
      {{}, {{"stiffness", ParameterValue::of(111.0)}, {"r_1", ParameterValue::of(7.0)}}});
  EXPECT_FALSE(together.successful);
  EXPECT_EQ(session_->settings().parameters.coupling.stiffness, 321.0);

  const auto got = ask<ros::GetParameters>("get_parameters", {{}, {"stiffness", "no_such"}});
  ASSERT_EQ(got.size(), 2U);
  EXPECT_EQ(got[0], ParameterValue::of(321.0));
  EXPECT_EQ(got[1], ParameterValue{});
  const auto types = ask<ros::GetParameterTypes>("get_parameter_types", {{}, {"method", "xi"}});
  EXPECT_EQ(types, (std::vector<std::uint8_t>{ParameterValue::text, ParameterValue::number}));
  const auto described = ask<ros::DescribeParameters>("describe_parameters", {{}, {"stiffness"}});
  ASSERT_EQ(described.size(), 1U);
  EXPECT_EQ(described[0].floating_point_range.size(), 1U);
  const auto listed = ask<ros::ListParameters>("list_parameters", {{}, {{"placement"}, 0}});
  EXPECT_EQ(listed.prefixes, std::vector<std::string>{"placement"});
}

TEST_F(RosNodeTest, TellsWhichParametersChanged) {
  open();
  double stiffness = 200.0;
  const auto event = hears<ros::ParameterEvent>(
      "/parameter_events", [](const auto& m) { return !m.changed.empty(); },
      [&] {
        ask<ros::SetParameters>("set_parameters",
                                {{}, {{"stiffness", ParameterValue::of(stiffness += 1.0)}}});
      });
  ASSERT_TRUE(event);
  EXPECT_EQ(event->node, "/palpate");
  ASSERT_EQ(event->changed.size(), 1U);
  EXPECT_EQ(event->changed[0].name, "stiffness");
}

TEST_F(RosNodeTest, RecordsAndHoldsTheForceWhenAsked) {
  open();
  const auto started = ask<ros::Trigger>("start_recording");
  EXPECT_TRUE(started.success) << started.message;
  EXPECT_TRUE(std::filesystem::exists(started.message)) << started.message;
  EXPECT_TRUE(ask<ros::Trigger>("stop_recording").success);
  EXPECT_FALSE(ask<ros::Trigger>("stop_recording").success);
  EXPECT_TRUE(ask<ros::Trigger>("hold").success);
  EXPECT_TRUE(session_->state().held);
  EXPECT_TRUE(ask<ros::Trigger>("release").success);
  EXPECT_FALSE(session_->state().held);
  EXPECT_TRUE(ask<ros::Trigger>("reset_faults").success);
  EXPECT_EQ(node_->trouble(), "");
}

// By what a node of each generation says of itself.
template <std::size_t size>
void is_announced(dds::Participant& other, std::string_view user_data, const std::string& name) {
  using Info = ros::ParticipantEntitiesInfo<size>;
  const dds::Quality kept{.reliable = true, .keeps_for_late = true, .user_data = user_data};
  const dds::Writer own(other, "", Info{}, kept);
  dds::Reader reader(other, "", Info{}, kept);
  std::optional<Info> heard;
  const double end = monotonic_now() + long_enough;
  while (monotonic_now() < end && (!heard || heard->nodes.empty())) {
    heard = reader.take<Info>();
    if (!heard) other.wait(0.02);
  }
  ASSERT_TRUE(heard && heard->nodes.size() == 1);
  EXPECT_EQ(heard->nodes[0].node_namespace, "/cell_3");
  EXPECT_EQ(heard->nodes[0].node_name, name);
  EXPECT_EQ(heard->nodes[0].readers.size(), 11U);
  EXPECT_EQ(heard->nodes[0].writers.size(), 21U);
  for (std::size_t i = 16; i < size; ++i) EXPECT_EQ(heard->participant[i], 0);
  // An entity's name begins as its participant's.
  EXPECT_TRUE(std::equal(heard->participant.begin(), heard->participant.begin() + 12,
                         heard->nodes[0].writers[0].begin()));
}

TEST_F(RosNodeTest, AnnouncesItselfToHumble) {
  open({.name = "cell_3/feel"});
  EXPECT_EQ(node_->name(), "/cell_3/feel");
  is_announced<24>(*other_, "", "feel");
}

TEST_F(RosNodeTest, AnnouncesItselfFromIronOn) {
  open({.name = "/cell_3/feel"});
  is_announced<16>(*other_, "typehash=RIHS01_0;", "feel");
}

TEST_F(RosNodeTest, RefusesWhatIsNoName) {
  for (const char* name : {"", "my node", "3rd", "a//b", "a/", "a/2b"})
    EXPECT_TRUE(
        test::fails_saying([&] { return make_ros_node(*session_, RosNodeOptions{.name = name}); },
                           "--name", "not a valid node name", "palpate"))
        << name;
  EXPECT_TRUE(
      test::fails_saying([&] { return make_ros_node(*session_, RosNodeOptions{.rate = 0.0}); },
                         "--publish-rate", "out of range", "1 to 1000"));
}

}  // namespace test_ros_node
}  // namespace palpate
