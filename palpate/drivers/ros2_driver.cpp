// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "palpate/drivers/channel_hand.hpp"
#include "palpate/drivers/dds.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/drivers/ros2.hpp"
#include "palpate/io/sources/ros_frames.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace ros2 {
namespace {

constexpr double idle_wait = 0.010;      // [s] between two zeros while no force comes
constexpr double listening_wait = 0.02;  // [s] after which the end is heard
constexpr int zeros_at_the_end = 3;      // for nodes that read as best effort, and lose some
constexpr double last_wait = 0.05;       // [s] for reliable readers to have the last one
constexpr dds::Quality force_quality{
    .reliable = true,
    .lifespan = 0.1,   // [s] an older force reaches no motor
    .deadline = 0.1};  // [s] more than idle_wait: a node may watch it

constexpr double needed_buffer = 4e6;   // [bytes] for depth and clouds without loss
constexpr double listening_time = 0.5;  // [s] to hear of who publishes

struct HandOptions : Ros2Hand {
  std::string uri = {};
  Eigen::Matrix3d device_from_topic = Eigen::Matrix3d::Identity();
  double max_force = 3.3;  // [N]
  double silence = 0.06;   // [s] without a pose: no hand
  double patience = 5.0;   // [s] for the node to be there
};

// "y,-x,z": which of the topic's axes are right, away and up.
Eigen::Matrix3d axes_of(const std::string& text, const std::string& uri) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Zero();
  int row = 0;
  bool good = true;
  for (std::size_t i = 0; i < text.size() && good; ++row) {
    double sign = 1.0;
    if (text[i] == '-') {
      sign = -1.0;
      ++i;
    }
    good = row < 3 && i < text.size() && text[i] >= 'x' && text[i] <= 'z';
    if (good) axes(row, text[i] - 'x') = sign;
    ++i;
    good = good && (i >= text.size() || text[i] == ',');
    ++i;
  }
  if (!good || row != 3 || std::abs(axes.determinant() - 1.0) > 0.5)
    throw Error(uri, "axes=" + text + " is no rotation",
                "name the topic's axes that point right, away and up, such as axes=y,-x,z");
  return axes;
}

HandOptions hand_options(const Uri& uri) {
  uri.allow_only(
      std::to_array<std::string_view>({"name", "pose", "pose_type", "force", "force_type", "button",
                                       "axes", "max_force", "silence", "wait"}));
  HandOptions wanted;
  wanted.uri = uri.text();
  std::string names;
  for (const Ros2Hand& one : ros2_hands()) {
    add_to_list(names, "ros2:" + one.name);
    if (one.name == uri.path()) static_cast<Ros2Hand&>(wanted) = one;
  }
  if (wanted.name != uri.path())
    throw Error(uri.text(), "no haptic node is known as '" + uri.path() + "'",
                "write " + names + ", or ros2:?pose=/TOPIC&force=/TOPIC");
  const std::string name = uri.text_option("name", "arm");
  const auto topic_option = [&](std::string_view key, std::string& topic) {
    if (const std::size_t at = topic.find("NAME"); at != std::string::npos)
      topic.replace(at, 4, name);
    topic = uri.text_option(key, topic);
  };
  topic_option("pose", wanted.pose);
  topic_option("force", wanted.force);
  topic_option("button", wanted.button);
  wanted.pose_type = uri.text_option("pose_type", wanted.pose_type);
  wanted.force_type = uri.text_option("force_type", wanted.force_type);
  for (const std::string* topic : {&wanted.pose, &wanted.force}) {
    if (topic->size() < 2 || topic->front() != '/')
      throw Error(uri.text(), "names no topic for the pose, or none for the force",
                  "write ros2:?pose=/TOPIC&force=/TOPIC, or the name of a node: ros2:fd");
  }
  wanted.device_from_topic = axes_of(uri.text_option("axes", wanted.axes), uri.text());
  wanted.max_force = uri.number_option("max_force", wanted.max_force, 0.1, 20.0, "N");
  wanted.silence = uri.number_option("silence", wanted.silence, 0.005, 1.0, "s");
  wanted.patience = uri.number_option("wait", wanted.patience, 0.1, 25.0, "s");
  return wanted;
}

using Xyz = std::array<double, 3>;

// Where a node takes forces, and what sends one there as the type of message that it wants.
struct ForceTopic {
  std::unique_ptr<dds::Writer> writer = {};
  std::function<void(const Xyz& force)> send = {};
};

ForceTopic force_topic(dds::Participant& participant, const HandOptions& wanted) {
  ForceTopic topic;
  std::string names;
  const auto type = [&](std::string_view name, auto message_of) {
    add_to_list(names, name);
    if (name != wanted.force_type) return;
    topic.writer =
        std::make_unique<dds::Writer>(participant, wanted.force, message_of(Xyz{}), force_quality);
    topic.send = [writer = topic.writer.get(), message_of](const Xyz& force) {
      writer->write(message_of(force));
    };
  };
  type("WrenchStamped", [](const Xyz& force) {
    return ros::WrenchStamped{{ros::Time::now(), ""}, force, {}};
  });
  type("Wrench", [](const Xyz& force) { return ros::Wrench{force, {}}; });
  type("Vector3", [](const Xyz& force) { return ros::Vector3{force}; });
  type("Float64MultiArray", [](const Xyz& force) {
    return ros::Float64MultiArray{"", {force.begin(), force.end()}};
  });
  type("OmniFeedback", [](const Xyz& force) { return ros::OmniFeedback{force, {}}; });
  if (topic.writer == nullptr)
    throw Error(wanted.uri, "force_type=" + wanted.force_type + " is not known",
                "there are: " + names);
  return topic;
}

class Hand final : public ChannelHand {
 public:
  explicit Hand(HandOptions wanted)
      : ChannelHand(wanted.silence),
        wanted_(std::move(wanted)),
        participant_(wanted_.uri),
        forces_out_(force_topic(participant_, wanted_)) {
    info_.uri = wanted_.uri;
    info_.kind = "ROS 2, " + wanted_.node;
    info_.limits.max_force = wanted_.max_force;
    info_.limits.continuous_force = std::min(info_.limits.continuous_force, wanted_.max_force);
    constexpr dds::Quality best_effort{};
    if (wanted_.pose_type == "PoseStamped")
      poses_.emplace(participant_, wanted_.pose, ros::PoseStamped{}, best_effort);
    else if (wanted_.pose_type == "Point")
      points_.emplace(participant_, wanted_.pose, ros::Point{}, best_effort);
    else
      throw Error(wanted_.uri, "pose_type=" + wanted_.pose_type + " is not known",
                  "there are: PoseStamped, Point");
    if (!wanted_.button.empty())
      buttons_.emplace(participant_, wanted_.button, ros::Bool{}, best_effort);
    wait_for_node();
    listener_ = std::thread(&Hand::listen, this);
    talker_ = std::thread(&Hand::talk, this);
  }
  ~Hand() override {
    disable();
    begin_end();
    talker_.join();
    listener_.join();
  }

  [[nodiscard]] std::string fault_text() const override {
    if (!silent_.load(std::memory_order_acquire)) return {};
    return wanted_.uri + ": no pose comes on " + wanted_.pose + ": check that its node runs";
  }

 private:
  void wait_for_node() {
    const double end = monotonic_now() + wanted_.patience;
    for (;;) {
      participant_.wait(0.01);
      hear();
      const bool is_told = newest_.time > 0.0;
      const bool is_taken = forces_out_.writer->readers() > 0;
      if (is_told && is_taken) return;
      if (monotonic_now() < end) continue;
      const std::string where = " in domain " + std::to_string(participant_.domain());
      throw Error(wanted_.uri,
                  is_told ? "no node subscribes to forces of type " + wanted_.force_type + " on " +
                                wanted_.force + where
                          : "no pose comes as " + wanted_.pose_type + " on " + wanted_.pose + where,
                  "start the haptic node, or name its topics with ?pose= and ?force=");
    }
  }

  // ---- The listener's thread, and before that the constructor's.
  void hear() {
    if (buttons_) {
      while (const auto button = buttons_->take_whole<ros::Bool>())
        newest_.state.buttons = button->data ? 1U : 0U;
    }
    bool any = false;
    if (poses_) {
      while (const auto pose = poses_->take_whole<ros::PoseStamped>()) {
        const auto& [qx, qy, qz, qw] = pose->orientation;
        const Eigen::Quaterniond turn(qw, qx, qy, qz);
        newest_.state.orientation.reset();
        if (turn.coeffs().allFinite() && turn.norm() > 0.5)
          newest_.state.orientation =
              Eigen::Quaterniond(wanted_.device_from_topic) * turn.normalized();
        any = place(pose->position) || any;
      }
    } else {
      while (const auto point = points_->take_whole<ros::Point>()) any = place(point->data) || any;
    }
    if (any) seen_.put(newest_);
    silent_.store(monotonic_now() - newest_.time > wanted_.silence, std::memory_order_release);
  }
  // A place that is none is as good as no pose.
  bool place(const std::array<double, 3>& xyz) {
    const Vec3 in_topic(xyz[0], xyz[1], xyz[2]);
    if (!in_topic.allFinite()) return false;
    newest_.state.position = wanted_.device_from_topic * in_topic;
    newest_.state.fault = DeviceFault::none;
    newest_.time = monotonic_now();
    return true;
  }
  void listen() {
    while (!is_ending()) {
      participant_.wait(listening_wait);
      hear();
    }
  }

  // ---- The talker's thread.
  void talk() {
    while (!is_ending()) {
      word_.wait(idle_wait);
      send(newest_force(wanted_.max_force));
    }
    for (int i = 0; i < zeros_at_the_end; ++i) {
      send(Vec3::Zero());
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    forces_out_.writer->wait_for_readers(last_wait);
  }
  void send(const Vec3& force_in_device) {
    const Vec3 force = wanted_.device_from_topic.transpose() * force_in_device;
    forces_out_.send({force.x(), force.y(), force.z()});
  }

  const HandOptions wanted_;
  dds::Participant participant_;
  ForceTopic forces_out_;
  std::optional<dds::Reader> poses_, points_, buttons_;
  std::atomic<bool> silent_{false};
  Seen newest_;  // of the listener's thread
  std::thread listener_, talker_;
};

std::string small_buffer(double bytes) {
  return "the kernel lets a socket keep " + std::to_string(std::lround(bytes / 1000.0)) +
         " kB, and loses images beyond: sudo sysctl -w net.core.rmem_max=8388608";
}

DriverReport look() {
  dds::Participant participant("ros2:");
  DriverReport report{.library = participant.library_path()};
  const double end = monotonic_now() + listening_time;
  for (double left = listening_time; left > 0.0; left = end - monotonic_now())
    participant.wait(left);
  std::ifstream allowed("/proc/sys/net/core/rmem_max");
  double bytes = 0.0;
  const bool is_small = allowed >> bytes && bytes < needed_buffer;
  for (const dds::Publication& one : participant.publications()) {
    if (!is_topic_of_depth(one.topic, one.type)) continue;
    report.found.push_back(
        {.uri = "ros2:" + one.topic,
         .name = one.type + ", in domain " + std::to_string(participant.domain()),
         .note = is_small ? small_buffer(bytes) : ""});
  }
  return report;
}

}  // namespace
}  // namespace ros2

const std::vector<Ros2Hand>& ros2_hands() {
  static const std::vector<Ros2Hand> hands{
      {"fd", "ICube's forcedimension_ros2", "/fd/ee_pose", "PoseStamped",
       "/fd/fd_controller/commands", "Float64MultiArray", "/fd/button_state", "y,-x,z"},
      {"ricmua", "ricmua's ros_force_dimension", "/robot/feedback/position", "Point",
       "/robot/command/force", "Vector3", "", "y,-x,z"},
      {"omni", "omni_state, of the drivers of the Touch", "/phantom/pose", "PoseStamped",
       "/phantom/force_feedback", "OmniFeedback", "", "x,y,z"},
      {"crtk", "a node of CRTK's interface", "/NAME/measured_cp", "PoseStamped",
       "/NAME/body/servo_cf", "WrenchStamped", "", "x,y,z"}};
  return hands;
}

std::unique_ptr<Device> open_ros2_device(const Uri& uri) {
  return std::make_unique<ros2::Hand>(ros2::hand_options(uri));
}

Driver ros2_driver() {
  return {.name = "ros2",
          .summary =
              "ros2:/TOPIC of a camera's depth or points, ros2:fd and others as haptic devices, "
              "on the network of ROS 2",
          .tried = "only simulated Cyclone DDS nodes, without ROS 2",
          .open_camera = open_ros2_camera,
          .open_device = open_ros2_device,
          .look = reporting(ros2::look),
          .needs_guard = true};
}

}  // namespace palpate
