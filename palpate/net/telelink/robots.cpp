// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/telelink/robots.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/core/tick.hpp"
#include "palpate/net/telelink/topics.hpp"
#include "palpate/servo/end_signal.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double own_stop = 0.1;  // [s] without a command

// A mass on a spring and damper of equal poles, stepped as it is looked at.
class PointRobot final : public Robot {
 public:
  explicit PointRobot(const Uri& uri) {
    uri.allow_only(std::array<std::string_view, 4>{"x", "y", "z", "lag"});
    for (int axis = 0; axis < 3; ++axis)
      position_[axis] = target_[axis] =
          uri.number_option(std::string(1, "xyz"[axis]), axis == 2 ? 0.1 : 0.0, -10.0, 10.0, "m");
    info_.uri = uri.text();
    info_.kind = "ball that follows and touches nothing";
    info_.turns = true;
    info_.lag = uri.number_option("lag", info_.lag, 0.01, 1.0, "s");
  }

  [[nodiscard]] const RobotInfo& info() const override { return info_; }

  void command(const HandPose& pose, const Vec3& /*velocity*/, double t) noexcept override {
    if (!is_place(pose.position) || !is_rotation(pose.orientation)) return;
    step(t);
    target_ = pose.position;
    target_turn_ = pose.orientation;
    commanded_ = t;
  }

  [[nodiscard]] std::optional<RobotState> state() override {
    const double t = monotonic_now();
    step(t);
    return RobotState{
        .t = t, .position = position_, .orientation = turn_.orientation, .velocity = velocity_};
  }

 private:
  void step(double t) noexcept {
    constexpr double longest = 0.2;  // [s]
    constexpr double substep = 1e-3;
    if (last_ == 0.0) last_ = t;
    const double w = 2.0 / info_.lag;
    for (double left = std::clamp(t - last_, 0.0, longest); left > 0.0; left -= substep) {
      const double dt = std::min(left, substep);
      if (t - commanded_ > own_stop) {
        target_ = position_;
        target_turn_ = turn_.orientation;
      }
      turn_.follow(target_turn_, dt);
      velocity_ += dt * (w * w * (target_ - position_) - 2.0 * w * velocity_);
      position_ += dt * velocity_;
    }
    last_ = t;
  }

  RobotInfo info_;
  Vec3 position_ = Vec3::Zero(), velocity_ = Vec3::Zero(), target_ = Vec3::Zero();
  SimulatedTurn turn_;
  Rotation target_turn_ = Rotation::Identity();
  double last_ = 0.0, commanded_ = -1e9;  // [s]
};

// A tool in a synthetic scene, on a thread of its own, as a robot's controller is.
class ToolInScene final : public SceneRobot {
 public:
  ToolInScene(std::shared_ptr<const Scene> scene, const Vec3& begin, const std::string& uri)
      : scene_(std::move(scene)),
        tool_(begin, [this](const Vec3& place, double t) { return surface(place, t); }),
        target_{begin, Rotation::Identity()} {
    info_.uri = uri;
    info_.kind = "simulated tool";
    info_.lag = SimulatedTool::lag();
    info_.stiffness = SimulatedTool::stiffness();
    info_.tool_radius = SimulatedTool::radius;
    info_.turns = true;
    thread_ = std::thread([this] { run(); });
  }
  ~ToolInScene() override {
    end_.give();
    thread_.join();
  }

  [[nodiscard]] const RobotInfo& info() const override { return info_; }
  void relate(double loop, double scene) override { ahead_ = scene - loop; }
  void command(const HandPose& pose, const Vec3& /*velocity*/, double t) noexcept override {
    if (!is_place(pose.position) || !is_rotation(pose.orientation)) return;
    const std::lock_guard lock(mutex_);
    target_ = pose;
    commanded_ = t;
  }
  [[nodiscard]] std::optional<RobotState> state() override {
    const std::lock_guard lock(mutex_);
    return RobotState{.t = monotonic_now(),
                      .position = tool_.place(),
                      .orientation = turn_.orientation,
                      .velocity = tool_.velocity(),
                      .force = tool_.contact()};
  }

 private:
  SimulatedTool::Surface surface(const Vec3& place, double t) const {
    const SurfacePoint at = scene_->nearest(place, t);
    return {at.distance, at.normal};
  }
  void run() {
    constexpr double step = 1e-3;     // [s]
    constexpr double longest = 0.05;  // [s] of a stall that is made up for
    double done = monotonic_now();
    while (!end_.rest(std::chrono::microseconds(500))) {
      const double now = monotonic_now();
      done = std::max(done, now - longest);
      const std::lock_guard lock(mutex_);
      for (; done + step <= now; done += step) {
        if (done - commanded_ > own_stop && std::exchange(led_, false))
          target_ = {tool_.place(), turn_.orientation};
        led_ = led_ || done - commanded_ <= own_stop;
        turn_.follow(target_.orientation, step);
        tool_.lead_to(target_.position, done + step + ahead_, step);
      }
    }
  }

  RobotInfo info_;
  std::shared_ptr<const Scene> scene_;
  std::mutex mutex_;
  SimulatedTool tool_;  // guarded by it, as what follows
  SimulatedTurn turn_;
  HandPose target_;
  double commanded_ = -1e9;  // [s]
  bool led_ = false;
  std::atomic<double> ahead_{0.0};  // [s] the scene's time less the loop's
  EndSignal end_;
  std::thread thread_;
};

std::string topic_option(const Uri& uri, const std::string& name, const std::string& usual) {
  std::string topic = uri.text_option(name, usual);
  if (!topic.empty() && (topic.size() < 2 || topic.front() != '/'))
    throw Error(uri.text(), name + "=" + topic + " is no topic", "begin it with /");
  return topic;
}

// An arm of ROS 2: PoseStamped in and out, its wrench where it measures one.
class Ros2Robot final : public Robot {
 public:
  explicit Ros2Robot(const Uri& uri) : participant_(uri.text()) {
    uri.allow_only(std::array<std::string_view, 12>{"command", "pose", "wrench", "joints", "frame",
                                                    "lag", "stiffness", "max_speed", "max_force",
                                                    "radius", "wait", "turns"});
    info_.uri = uri.text();
    info_.kind = "arm of ROS 2";
    info_.turns = uri.has("turns");
    info_.lag = uri.number_option("lag", info_.lag, 0.0, 1.0, "s");
    if (uri.has("stiffness"))
      info_.stiffness = uri.number_option("stiffness", 1000.0, 1.0, 1e6, "N/m");
    info_.max_speed = uri.number_option("max_speed", 0.25, 1e-3, 5.0, "m/s");
    info_.max_force = uri.number_option("max_force", info_.max_force, 0.1, 1000.0, "N");
    info_.tool_radius = uri.number_option("radius", info_.tool_radius, 1e-4, 0.05, "m");
    frame_ = uri.text_option("frame", "world");
    const std::string command = topic_option(uri, "command", "");
    const std::string pose = topic_option(uri, "pose", "");
    if (command.empty() || pose.empty())
      throw Error(uri.text(), "names no topic for commands, or none for the pose",
                  "write ros2:?command=/arm/target_pose&pose=/arm/current_pose");
    constexpr dds::Quality best_effort{};
    commands_.emplace(participant_, command, ros::PoseStamped{},
                      dds::Quality{.reliable = true, .lifespan = own_stop});
    poses_.emplace(participant_, pose, ros::PoseStamped{}, best_effort);
    if (const std::string topic = topic_option(uri, "wrench", ""); !topic.empty())
      wrenches_.emplace(participant_, topic, ros::WrenchStamped{}, best_effort);
    if (const std::string topic = topic_option(uri, "joints", ""); !topic.empty())
      joints_.emplace(participant_, topic, ros::JointState{}, best_effort);
    const double end = monotonic_now() + uri.number_option("wait", 5.0, 0.1, 60.0, "s");
    while (!hear()) {
      if (monotonic_now() > end)
        throw Error(uri.text(),
                    "no PoseStamped messages on " + pose + " in domain " +
                        std::to_string(participant_.domain()),
                    "start the arm's controller, or set its topic with pose=");
      participant_.wait(0.05);
    }
  }

  [[nodiscard]] const RobotInfo& info() const override { return info_; }

  void command(const HandPose& pose, const Vec3& /*velocity*/, double /*t*/) noexcept override {
    if (!is_place(pose.position) || !is_rotation(pose.orientation)) return;
    try {
      commands_->write(pose_of({ros::Time::now(), frame_}, pose.position,
                               info_.turns ? unit(pose.orientation) : found_));
    } catch (const std::exception&) {  // what is not sent stops the arm
    }
  }

  [[nodiscard]] std::optional<RobotState> state() override {
    hear();
    constexpr double silence = 0.5;  // [s]
    state_.fault.clear();
    if (monotonic_now() - state_.t > silence)
      state_.fault = "no pose of the arm for " + number_text(silence) + " s";
    return state_;
  }

 private:
  bool hear() {
    bool any = false;
    while (const auto pose = poses_->take_whole<ros::PoseStamped>()) {
      const Vec3 position(pose->position[0], pose->position[1], pose->position[2]);
      const Rotation orientation = orientation_of(*pose);
      const bool is_turn = is_rotation(orientation);
      if (!is_place(position) || (info_.turns && !is_turn)) continue;
      const double t = monotonic_now();
      const double dt = t - state_.t;
      constexpr double shortest = 1e-4;  // [s]
      if (state_.t > 0.0 && dt > shortest) state_.velocity = (position - state_.position) / dt;
      if (state_.t == 0.0) found_ = orientation;
      if (is_turn) state_.orientation = unit(orientation);
      state_.position = position;
      state_.t = t;
      any = true;
    }
    if (wrenches_) {
      while (const auto wrench = wrenches_->take_whole<ros::WrenchStamped>()) {
        const Vec3 force(wrench->force[0], wrench->force[1], wrench->force[2]);
        if (force.allFinite()) state_.force = force;
      }
    }
    if (joints_) {
      while (const auto joints = joints_->take_whole<ros::JointState>()) {
        info_.joint_names = joints->name;
        state_.joints = joints->position;
      }
    }
    return any;
  }
  RobotInfo info_;
  dds::Participant participant_;
  std::optional<dds::Writer> commands_;
  std::optional<dds::Reader> poses_, wrenches_, joints_;
  std::string frame_;
  Rotation found_ = Rotation::Identity();  // how the tool was turned at first
  RobotState state_;
};

}  // namespace

Registry<RobotScheme> standard_robots() {
  return {
      "type of robot",
      ":",
      {{"ros2", "a ROS 2 arm that accepts poses",
        [](const Uri& uri) -> std::unique_ptr<Robot> { return std::make_unique<Ros2Robot>(uri); }},
       {"point", "a ball that follows without contacts, to test a network link",
        [](const Uri& uri) -> std::unique_ptr<Robot> {
          return std::make_unique<PointRobot>(uri);
        }}}};
}

std::unique_ptr<SceneRobot> open_scene_robot(std::shared_ptr<const Scene> scene, const Vec3& begin,
                                             const std::string& uri) {
  return std::make_unique<ToolInScene>(std::move(scene), begin, uri);
}

std::unique_ptr<Robot> open_robot(const std::string& uri, const Registry<RobotScheme>& robots) {
  const Uri parsed(uri);
  return robots.find(parsed.scheme(), uri).open(parsed);
}

}  // namespace palpate
