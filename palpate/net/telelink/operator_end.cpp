// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/telelink/operator_end.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <string_view>
#include <utility>
#include <vector>

#include "palpate/io/bag/messages.hpp"
#include "palpate/io/bag/node_messages.hpp"
#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/kernel/core/rotation.hpp"
#include "palpate/kernel/tool/tool_shape.hpp"
#include "palpate/net/telelink/touched_paint.hpp"
#include "palpate/net/teleop/led_hand.hpp"

namespace palpate {
namespace {

constexpr double send_interval = 2e-3;   // [s]: with jitter of 30 ms and 5 % loss one comes in time
constexpr double look_interval = 0.5;    // [s] between two looks at the link's latency
constexpr double worth_a_change = 0.02;  // [s] of latency
constexpr double silence = 0.5;          // [s] after which a robot is no longer heard
constexpr std::string_view region_prefix = "robot: ";
// A lead that was held up on the way is no use.
constexpr dds::Quality soon{.lifespan = 0.5};

}  // namespace

OperatorEnd::OperatorEnd(Session& session, const OperatorEndOptions& options)
    : session_(session),
      name_(options.name),
      index_(options.index),
      learns_(options.learn),
      ticks_(session.ticks()),
      given_(session.settings().safety),
      participant_("teleop"),
      places_(participant_, teleop_topic(name_, "place"), ros::PoseStamped{}, soon),
      presses_(participant_, teleop_topic(name_, "press"), ros::WrenchStamped{}, soon),
      hears_(participant_, name_),
      thread_([this] { run(); }) {}

OperatorEnd::~OperatorEnd() {
  ends_ = true;
  thread_.join();
}

RobotView OperatorEnd::robot() const {
  const std::lock_guard lock(mutex_);
  RobotView view = view_;
  if (view.state) {
    view.age = monotonic_now() - view.state->t;
    view.heard = view.age <= silence;
  }
  return view;
}

void OperatorEnd::run() {
  double send_due = monotonic_now();
  double look_due = send_due;
  while (!ends_) {
    try {
      participant_.wait(std::clamp(send_due - monotonic_now(), 0.0, send_interval));
      const double now = monotonic_now();
      hear(now);
      if (now < send_due) continue;
      send_due = std::max(send_due + send_interval, now);
      send(now);
      if (now < look_due) continue;
      look_due = now + look_interval;
      follow_latency();
      turn_shape();
    } catch (
        const std::exception& error) {  // the session continues; what is not sent stops a robot
      const std::lock_guard lock(mutex_);
      if (!view_.state) view_.state.emplace();
      view_.state->fault = error.what();
    }
  }
}

void OperatorEnd::send(double now) {
  bool any = false;
  while (ticks_.try_pop(tick_)) any = true;
  if (!any) return;  // nothing renders: nothing leads
  Lead lead = lead_of(tick_);
  {
    const std::lock_guard lock(mutex_);
    view_.led = lead.leads && !index_;
  }
  if (!lead.leads) return;
  if (index_) {
    bring_to_hand();
    return;
  }
  const ros::Header header{dds::stamp_of(now), "world"};
  presses_.write(ros::WrenchStamped{header, components(lead.press), {}});
  lead.turn = product(lead.turn, begin_);
  places_.write(pose_of(header, lead.place, lead.turn));
}

// The device's place in the world moves so that the hand is where the tool is, and what the tool is
// turned by now belongs to the handle's present orientation.
void OperatorEnd::bring_to_hand() {
  std::optional<RobotState> state;
  {
    const std::lock_guard lock(mutex_);
    state = view_.state;
  }
  if (!state || !found_) return;
  begin_ = product(between(Rotation::Identity(), lead_of(tick_).turn),
                   between(state->orientation, *found_));
  const Vec3 way = state->position - tick_.tick.hip;
  session_.change(
      [&](ServoSettings& settings) { settings.placement.world_from_device.pretranslate(way); });
  index_ = false;
  while (ticks_.try_pop(tick_)) {
  }
}

void OperatorEnd::hear(double now) {
  const std::lock_guard lock(mutex_);
  while (const auto tool = hears_.tool.take_whole<ros::PoseStamped>()) {
    const Vec3 position(tool->position[0], tool->position[1], tool->position[2]);
    const Rotation orientation = orientation_of(*tool);
    if (!is_place(position) || !is_rotation(orientation)) continue;
    if (!view_.state) view_.state.emplace();
    view_.state->position = position;
    view_.state->orientation = unit(orientation);
    view_.state->t = now;
  }
  while (const auto found = hears_.found.take_whole<ros::PoseStamped>())
    if (const Rotation q = orientation_of(*found); is_rotation(q)) found_ = unit(q);
  if (!view_.state) return;
  while (const auto twist = hears_.twist.take_whole<ros::TwistStamped>())
    view_.state->velocity = Vec3(twist->linear[0], twist->linear[1], twist->linear[2]);
  while (const auto contact = hears_.contact.take_whole<ros::WrenchStamped>())
    view_.state->force = Vec3(contact->force[0], contact->force[1], contact->force[2]);
  while (const auto joints = hears_.joints.take_whole<ros::JointState>())
    view_.state->joints = joints->position;
  while (const auto links = hears_.links.take_whole<ros::Float64MultiArray>()) {
    view_.state->links.clear();
    for (std::size_t i = 0; i + 2 < links->data.size(); i += 3)
      view_.state->links.emplace_back(links->data[i], links->data[i + 1], links->data[i + 2]);
  }
  while (const auto fault = hears_.fault.take_whole<ros::String>())
    view_.state->fault = fault->data;
  while (const auto regions = hears_.regions.take_whole<ros::String>()) use_regions(regions->data);
  while (const auto message = hears_.touched.take_whole<ros::Float64MultiArray>()) {
    const Touched touched = touched_of(*message);
    view_.touched = touched;
    view_.ignored = learns_
                        ? paint_touched(session_.paint(), session_.settings().parameters, touched)
                        : "ignored: the operator's end was started without --learn";
  }
}

// What the robot may not do, instead of what it said before; the operator's own fixtures stay.
void OperatorEnd::use_regions(const std::string& json) {
  const auto told = fixtures_from_json(json, teleop_topic(name_, "regions"));
  session_.change([&](ServoSettings& settings) {
    std::vector<Fixture> all;
    if (settings.fixtures) all = settings.fixtures->fixtures();
    std::erase_if(all, [](const Fixture& one) { return one.name.starts_with(region_prefix); });
    for (Fixture& fixture : told->fixtures()) {
      fixture.name = std::string(region_prefix) + fixture.name;
      all.push_back(std::move(fixture));
    }
    settings.fixtures = std::make_shared<const FixtureSet>(all);
  });
}

// The tool is turned in the hand: what is felt is turned as the robot's, whose frame is not the
// handle's.
void OperatorEnd::turn_shape() {
  const ServoSettings now = session_.settings();
  if (!found_ || index_ || !now.tool) return;
  const Rotation world_from_device(now.placement.world_from_device.linear());
  const Rotation device_from_tool =
      product(between(Rotation::Identity(), world_from_device), product(begin_, *found_));
  const bool is_ours = now.tool == turned_tool_;
  if (is_ours && device_from_tool.coeffs() == device_from_tool_.coeffs()) return;
  if (!is_ours) given_tool_ = now.tool;
  device_from_tool_ = device_from_tool;
  turned_tool_ = std::make_shared<const ToolShape>(given_tool_->turned(device_from_tool));
  session_.change([&](ServoSettings& settings) { settings.tool = turned_tool_; });
}

void OperatorEnd::follow_latency() {
  double latency = 0.0;
  for (const CameraStatus& camera : session_.state().cameras)
    latency = std::max(latency, camera.latency);
  {
    const std::lock_guard lock(mutex_);
    view_.latency = latency;
  }
  if (std::abs(latency - followed_) < worth_a_change) return;
  session_.change([&](ServoSettings& settings) {
    const SafetyParameters before = for_link(given_, followed_);
    const bool is_ours = followed_ == 0.0 ? settings.safety.fade_age == given_.fade_age
                                          : settings.safety.fade_age == before.fade_age;
    if (!is_ours) return;
    const SafetyParameters now = for_link(given_, latency);
    settings.safety.fade_age = now.fade_age;
    settings.safety.lost_age = now.lost_age;
  });
  followed_ = latency;
}

}  // namespace palpate
