// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/telelink/robot_end.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "palpate/io/bag/messages.hpp"
#include "palpate/io/bag/node_messages.hpp"
#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/io/sources/tool_file.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/net/telelink/touched_paint.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double first_state = 5.0;       // [s] that a robot may take to say where it is
constexpr double order_interval = 2e-3;   // [s]
constexpr double report_interval = 0.01;  // [s]

// A device for a session, of a hand that the robot's end keeps.
class Borrowed final : public Device {
 public:
  explicit Borrowed(std::shared_ptr<LedHand> hand) : hand_(std::move(hand)) {}
  [[nodiscard]] const DeviceInfo& info() const override { return hand_->info(); }
  HandState read(double t) noexcept override { return hand_->read(t); }
  void write(const Vec3& force, double t) noexcept override { hand_->write(force, t); }

 private:
  std::shared_ptr<LedHand> hand_;
};

void add_walls(const Eigen::AlignedBox3d& reach, std::vector<Fixture>& fixtures) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Vec3 inward = Vec3::Zero();
      inward[axis] = -sign;
      Vec3 place = reach.center();
      place[axis] = sign < 0.0 ? reach.min()[axis] : reach.max()[axis];
      fixtures.push_back(half_space(std::string("reach ") + (sign < 0.0 ? "-" : "+") + "xyz"[axis],
                                    inward, place));
    }
  }
}

std::shared_ptr<const FixtureSet> regions_of(const RobotInfo& info,
                                             const std::shared_ptr<const FixtureSet>& own) {
  std::vector<Fixture> all;
  if (own) all = own->fixtures();
  if (info.reach) add_walls(*info.reach, all);
  return std::make_shared<const FixtureSet>(all);
}

RobotState first_of(Robot& robot) {
  const double end = monotonic_now() + first_state;
  for (;;) {
    if (std::optional<RobotState> state = robot.state()) return *std::move(state);
    if (monotonic_now() > end)
      throw Error(robot.info().uri, "the robot does not report its position",
                  "switch it on, and check its topics");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

// [m] The farthest point of the tool with its margin; 0 of a ball.
double reach_of(const RobotInfo& info, const RobotEndOptions& options) {
  const auto tool = options.tool.empty() ? nullptr : read_tool(options.tool);
  if (!tool) return 0.0;
  if (!info.turns)
    throw Error("tool '" + options.tool + "'", info.uri + " does not turn its tool",
                "leave out --tool, or use a robot that turns, such as ros2:?...&turns");
  return tool->reach() + options.margin;
}

double lever_of(double reach) { return std::max(LeadLimits{}.lever, reach); }

LeadLimits limits_of(const RobotInfo& info, double reach) {
  LeadLimits limits;
  limits.lever = lever_of(reach);
  limits.turns = info.turns;
  limits.max_speed = std::min(limits.max_speed, info.max_speed);
  limits.reach = info.reach;
  return limits;
}

SetPointOptions set_point_of(const RobotInfo& info, const RobotEndOptions& options, double reach,
                             const std::shared_ptr<const FixtureSet>& regions) {
  return {.tool_radius = info.tool_radius,
          .tool_reach = reach,
          .turns = info.turns,
          .lever = lever_of(reach),
          .margin = options.margin,
          .lag = info.lag,
          .stiffness = info.stiffness,
          .max_force = info.max_force,
          .press_share = options.press_share,
          .max_speed = info.max_speed,
          .fixtures = robot_fixtures(*regions)};
}

}  // namespace

RobotEnd::RobotEnd(std::shared_ptr<Robot> robot, const RobotEndOptions& options)
    : robot_(std::move(robot)),
      state_(first_of(*robot_)),
      regions_(regions_of(robot_->info(), options.fixtures)),
      options_(options),
      tool_reach_(reach_of(robot_->info(), options)),
      hand_(std::make_shared<LedHand>(state_.position, limits_of(robot_->info(), tool_reach_),
                                      state_.orientation)),
      step_(*hand_, set_point_of(robot_->info(), options, tool_reach_, regions_)),
      publisher_(options.name, options.packing),
      participant_("teleop"),
      places_(participant_, teleop_topic(options.name, "place"), ros::PoseStamped{}, newest_alone),
      presses_(participant_, teleop_topic(options.name, "press"), ros::WrenchStamped{},
               newest_alone),
      says_(participant_, options.name),
      learner_(robot_->info().tool_radius) {
  says_.regions.write(ros::String{fixtures_json(*regions_)});
  says_.fault.write(ros::String{""});
  says_.found.write(
      pose_of({dds::stamp_of(monotonic_now()), "world"}, state_.position, state_.orientation));
}
RobotEnd::~RobotEnd() { detach(); }

void RobotEnd::prepare(SessionOptions& options) const {
  options.open_devices.at(0) = std::make_unique<Borrowed>(hand_);
  set_parameter(options.parameters, "r_c", robot_->info().tool_radius + options_.margin);
  options.fixture_set = robot_fixtures(*regions_);
  options.tool = options_.tool;
  if (tool_reach_ > 0.0)
    options.tool += (options.tool.find('?') == std::string::npos ? "?margin=" : "&margin=") +
                    number_text(options_.margin) + "m";
}

void RobotEnd::on_frame(std::size_t camera, const FedFrame& fed) {
  const DepthImage* image = fed.frame.cloud->image();
  // What others touch is the first camera's.
  if (camera == 0 && image != nullptr)
    publisher_.publish(*image, dds::stamp_of(fed.frame.stamp).seconds());
  const std::lock_guard lock(mutex_);
  if (watches_.size() <= camera) watches_.resize(camera + 1);
  watches_[camera].frame(fed.frame.cloud, fed.frame.stamp, state_.position);
}

void RobotEnd::attach(Session& session) {
  ends_ = false;
  ticks_.emplace(session.ticks());
  thread_ = std::thread([this] { lead(); });
}
void RobotEnd::detach() {
  ends_ = true;
  if (thread_.joinable()) thread_.join();
  ticks_.reset();
}

RobotState RobotEnd::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

void RobotEnd::lead() {
  double order_due = monotonic_now();
  double report_due = order_due;
  while (!ends_) {
    participant_.wait(std::clamp(order_due - monotonic_now(), 0.0, order_interval));
    const double now = monotonic_now();
    hear(now);
    if (now < order_due) continue;
    order_due = std::max(order_due + order_interval, now);
    try {
      order(now);
      if (now >= report_due) {
        report_due = std::max(report_due + report_interval, now);
        report(now);
      }
    } catch (const std::exception& error) {  // no orders: the robot stops by itself
      say(error.what());
    }
  }
}

void RobotEnd::hear(double now) {
  while (const auto press = presses_.take_whole<ros::WrenchStamped>())
    lead_.press = Vec3(press->force[0], press->force[1], press->force[2]);
  bool any = false;
  while (const auto place = places_.take_whole<ros::PoseStamped>()) {
    const std::int64_t stamp = place->header.stamp.nanoseconds();
    // What was overtaken on the way is late; a stamp long before begins again.
    constexpr std::int64_t anew = 1'000'000'000;  // [ns]
    if (stamp <= heard_ && stamp > heard_ - anew) continue;
    heard_ = stamp;
    lead_.place = Vec3(place->position[0], place->position[1], place->position[2]);
    lead_.turn = orientation_of(*place);
    any = true;
  }
  if (!any) return;
  lead_.leads = lead_.place.allFinite() && lead_.press.allFinite();
  hand_->lead(lead_, now);
}

void RobotEnd::order(double now) {
  if (std::optional<RobotState> state = robot_->state()) {
    hand_->tool_is_at(state->position, state->orientation);
    const std::lock_guard lock(mutex_);
    state_ = *std::move(state);
  }
  bool any = false;
  ServoTick tick;
  while (ticks_->try_pop(tick)) any = true;
  if (!any) return;  // nothing guards the robot now
  RobotState at;
  Outlook seen;
  {
    const std::lock_guard lock(mutex_);
    at = state_;
    seen = outlook(watches_, tick.place, at.position, robot_->info().tool_radius, now);
  }
  const SetPoint::Order order = step_.next(tick, seen, lead_.press, at, now);
  contact_ = at.force;
  if (at.fault.empty()) robot_->command({order.position, order.orientation}, order.velocity, now);
  if (const auto found = learner_.next(at.t, at.position, at.velocity, at.force, tick.tick.normal))
    says_.touched.write(message_of(*found));
  say(at.fault.empty() ? step_.trouble() : at.fault);
}

void RobotEnd::report(double now) {
  const RobotState at = state();
  const ros::Header header{dds::stamp_of(now), "world"};
  says_.tool.write(pose_of(header, at.position, at.orientation));
  says_.twist.write(ros::TwistStamped{header, components(at.velocity)});
  says_.contact.write(ros::WrenchStamped{header, components(contact_), {}});
  ros::Float64MultiArray links;
  for (const Vec3& place : at.links)
    links.data.insert(links.data.end(), {place.x(), place.y(), place.z()});
  says_.links.write(links);
  if (!at.joints.empty())
    says_.joints.write(ros::JointState{header, robot_->info().joint_names, at.joints, {}, {}});
}

void RobotEnd::say(const std::string& fault) {
  if (fault == said_) return;
  said_ = fault;
  says_.fault.write(ros::String{fault});
}

}  // namespace palpate
