// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/node/ros_node.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "palpate/drivers/dds.hpp"
#include "palpate/io/bag/messages.hpp"
#include "palpate/io/bag/node_messages.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/net/node/node_parameters.hpp"
#include "palpate/servo/realtime.hpp"

namespace palpate {
namespace {

constexpr double marker_interval = 1.0 / 30.0;  // [s]
constexpr double report_interval = 1.0;         // [s]
constexpr double nodes_interval = 0.2;          // [s] between two looks at who else is there
constexpr double longest_wait = 0.05;           // [s] until the end of the session is noticed
constexpr dds::Quality reliable{.reliable = true, .depth = 10};
constexpr dds::Quality newest_alone{.reliable = true};
constexpr dds::Quality latched{.reliable = true, .keeps_for_late = true};
constexpr dds::Quality events{.reliable = true, .depth = 1000};  // as ROS's own

struct SessionReport {
  SessionState state;
  double tick_rate = 0.0;        // [Hz] measured
  std::uint64_t late_ticks = 0;  // in that time
  double now = 0.0;              // [s] on the servo loop's clock
  struct Hand {
    TickReport ticks;
    DeviceInfo device;
  };
  std::vector<Hand> hands = {};  // as SessionState::hands
};

using ros::DiagnosticStatus;
using ros::Marker;

constexpr double hip_radius = 3e-3;         // [m]
constexpr double line_width = 1e-3;         // [m]
constexpr double metres_per_newton = 0.05;  // of the force's arrow
constexpr double normal_length = 0.03;      // [m]
constexpr std::uint32_t lifetime = 1;       // [s] after which they go if the node has gone
constexpr double least_share = 0.9;         // [-] of the loop's rate: less is worth a warning

constexpr std::array<float, 4> proxy_colour{0.20F, 0.60F, 1.00F, 0.70F};
constexpr std::array<float, 4> touching_colour{0.20F, 0.80F, 0.30F, 0.80F};
constexpr std::array<float, 4> hip_colour{1.00F, 0.60F, 0.10F, 0.90F};
constexpr std::array<float, 4> force_colour{0.90F, 0.20F, 0.20F, 1.00F};
constexpr std::array<float, 4> normal_colour{0.60F, 0.60F, 0.60F, 1.00F};

Marker marker(const ros::Header& header, const std::string& name, Marker::Kind kind,
              const std::array<float, 4>& colour) {
  Marker made;
  made.header = header;
  made.ns = name;
  made.kind = kind;
  made.colour = colour;
  made.lifetime = {lifetime, 0};
  return made;
}

Marker ball(const ros::Header& header, const std::string& name, const Vec3& place, double radius,
            const std::array<float, 4>& colour) {
  Marker made = marker(header, name, Marker::sphere, colour);
  made.position = components(place);
  made.scale = {2.0 * radius, 2.0 * radius, 2.0 * radius};
  return made;
}

// None where there is nothing to point at: what was drawn before goes.
Marker arrow(const ros::Header& header, const std::string& name, const Vec3& from, const Vec3& way,
             const std::array<float, 4>& colour) {
  Marker made = marker(header, name, Marker::arrow, colour);
  if (way.norm() < line_width) {
    made.action = Marker::remove;
    return made;
  }
  made.points = {components(from), components(from + way)};
  made.scale = {2.0 * line_width, 4.0 * line_width, 0.0};  // shaft, head
  return made;
}

std::string number(double value) { return number_text(value, 4); }

std::string names_of(std::uint32_t bits, std::span<const FlagInfo> table) {
  std::string text;
  for (const FlagInfo& flag : flags_in(bits, table))
    text += (text.empty() ? "" : " ") + std::string(flag.name);
  return text;
}

DiagnosticStatus status(const std::string& name, std::uint8_t level, std::string message) {
  DiagnosticStatus made;
  made.level = level;
  made.name = "palpate: " + name;
  made.message = std::move(message);
  return made;
}

DiagnosticStatus loop_status(const SessionReport& report) {
  const SessionState& state = report.state;
  DiagnosticStatus made = status("servo loop", DiagnosticStatus::ok, "runs");
  if (report.tick_rate == 0.0) {
    made.level = DiagnosticStatus::error;
    made.message = "there are no ticks";
  } else if (report.tick_rate < least_share * state.rate || report.late_ticks > 0) {
    made.level = DiagnosticStatus::warn;
    made.message = "ticks are late; see palpate doctor";
  }
  made.values = {{"rate [Hz]", number(report.tick_rate)},
                 {"rate asked for [Hz]", number(state.rate)},
                 {"late ticks", std::to_string(report.late_ticks)},
                 {"late ticks in all", std::to_string(state.hands[0].summary.late_ticks)},
                 {"method", state.settings.method}};
  return made;
}

DiagnosticStatus camera_status(const CameraStatus& camera, double now) {
  DiagnosticStatus made = status("camera " + camera.uri, DiagnosticStatus::ok, camera.text);
  if (camera.state == CameraState::frozen || camera.state == CameraState::searching)
    made.level = DiagnosticStatus::error;
  else if (camera.state != CameraState::live || !camera.doubt.empty())
    made.level = DiagnosticStatus::warn;
  made.hardware_id = camera.uri;
  made.values = {{"rate [Hz]", number(camera.rate)},
                 {"frames", std::to_string(camera.frames)},
                 {"frames dropped", std::to_string(camera.dropped)},
                 {"latency [s]", number(camera.latency)}};
  if (camera.last_frame)
    made.values.push_back({"age of the newest frame [s]", number(now - *camera.last_frame)});
  if (!camera.trouble.empty()) made.values.push_back({"trouble", camera.trouble});
  if (!camera.doubt.empty()) made.values.push_back({"doubt", camera.doubt});
  return made;
}

// @param name  of the hand, with a blank behind it; empty: the first one
// @param held  the force is paused
DiagnosticStatus contact_status(const std::string& name, const TickReport& ticks,
                                const SessionHandState& hand, bool held) {
  const ServoTick& newest = ticks.newest;
  DiagnosticStatus made =
      status(name + "contact", DiagnosticStatus::ok, to_string(newest.tick.state));
  if (held) made.message += "; the force is paused (~/release ends this)";
  if (hand.latched_by != 0) {
    made.level = DiagnosticStatus::error;
    made.message = "no force: latched by " + names_of(hand.latched_by, safety_flag_table()) +
                   " (~/reset_faults ends that)";
  }
  made.values = {{"force asked for [N]", number(newest.tick.force.norm())},
                 {"force sent [N]", number(newest.force.norm())},
                 {"gain", number(newest.gain)},
                 {"age of the frame [s]", number(newest.frame_age)},
                 {"flags", names_of(ticks.flags, tick_flag_table())},
                 {"safety flags", names_of(ticks.safety, safety_flag_table())},
                 {"pop-throughs suspected", std::to_string(hand.summary.pop_throughs)}};
  return made;
}

// @param name     as above
// @param trouble  of the device, in more words than its fault has; may be empty
DiagnosticStatus device_status(const std::string& name, const TickReport& ticks,
                               const std::string& trouble, const DeviceInfo& device) {
  const std::uint32_t hand = ticks.newest.hand;
  DiagnosticStatus made = status(name + "device " + device.uri, DiagnosticStatus::ok, "no hand");
  if ((hand & hand_present) != 0) made.message = "held";
  if ((hand & hand_clutched) != 0) made.message = "clutched";
  if ((hand & hand_fault) != 0) {
    made.level = DiagnosticStatus::error;
    made.message = trouble.empty() ? std::string(describe(fault_of(hand))) : trouble;
  }
  made.hardware_id = device.serial.empty() ? device.uri : device.serial;
  made.values = {{"kind", device.kind},
                 {"fault", std::string(to_string(fault_of(hand)))},
                 {"largest force [N]", number(device.limits.max_force)}};
  return made;
}

DiagnosticStatus recording_status(const RecordingState& recording) {
  DiagnosticStatus made = status("recording", DiagnosticStatus::ok, "off");
  if (recording.on)
    made.message = "on";
  else if (recording.closing)
    made.message = "being written";
  if (recording.failed) {
    made.level = DiagnosticStatus::warn;
    made.message = recording.message;
  }
  made.values = {{"folder", recording.folder}, {"last", recording.message}};
  return made;
}

// Proxy, HIP, the line between them, force and normal, as RViz and Foxglove draw them.
// @param contact_radius  [m] of the proxy
ros::MarkerArray markers_of(const ServoTick& record, double contact_radius,
                            const ros::Header& header) {
  const Tick& tick = record.tick;
  const bool touches = tick.state != ContactState::free_motion;
  Marker line = marker(header, "hip_to_proxy", Marker::line_strip, hip_colour);
  line.points = {components(tick.hip), components(tick.proxy)};
  line.scale = {line_width, 0.0, 0.0};
  return {
      {ball(header, "proxy", tick.proxy, contact_radius, touches ? touching_colour : proxy_colour),
       ball(header, "hip", tick.hip, hip_radius, hip_colour), std::move(line),
       arrow(header, "force", tick.proxy, metres_per_newton * record.force, force_colour),
       arrow(header, "normal", tick.proxy, normal_length * tick.normal, normal_colour)}};
}

ros::DiagnosticArray diagnostics_of(const SessionReport& report, const ros::Header& header) {
  ros::DiagnosticArray array;
  array.header = header;
  array.status.push_back(loop_status(report));
  const SessionState& state = report.state;
  for (const CameraStatus& camera : state.cameras)
    array.status.push_back(camera_status(camera, report.now));
  for (std::size_t i = 0; i < report.hands.size(); ++i) {
    const auto& [ticks, device] = report.hands[i];
    const SessionHandState& hand = state.hands[i];
    const std::string name = i == 0 ? "" : hand.name + " ";
    array.status.push_back(contact_status(name, ticks, hand, state.held));
    array.status.push_back(device_status(name, ticks, hand.trouble, device));
  }
  array.status.push_back(recording_status(state.recording));
  return array;
}

struct NodeName {
  std::string space, name;  // "/cell_3", "palpate"
  [[nodiscard]] std::string full() const { return (space == "/" ? "" : space) + "/" + name; }
};

// @throws Error if it is none by ROS's rules.
NodeName checked_name(const std::string& text) {
  const std::string path = text.substr(text.starts_with('/') ? 1 : 0);
  bool is_good = !path.empty() && path.back() != '/';
  char before = '/';
  for (const char c : path) {
    const auto letter = static_cast<unsigned char>(c);
    is_good = is_good && (std::isalnum(letter) != 0 || c == '_' || c == '/') &&
              !(before == '/' && (c == '/' || std::isdigit(letter) != 0));
    before = c;
  }
  if (!is_good)
    throw Error("--name", "'" + text + "' is not a valid node name",
                "write letters, digits and _, such as palpate or cell_3/palpate");
  const std::size_t slash = path.rfind('/');
  if (slash == std::string::npos) return {"/", path};
  return {"/" + path.substr(0, slash), path.substr(slash + 1)};
}

double checked_rate(double rate) {
  check_range("--publish-rate", "", "Hz", 1.0, 1000.0, rate);
  return rate;
}

template <std::size_t size>
std::array<std::uint8_t, size> identity(const dds::Guid& guid) {
  std::array<std::uint8_t, size> bytes{};
  std::copy(guid.begin(), guid.end(), bytes.begin());
  return bytes;
}

struct HandTopics {
  HandTopics(dds::Participant& participant, const std::string& name,
             const TickRing<ServoTick>::Reader& reader)
      : ticks(reader),
        proxy(participant, name + "/proxy", ros::PoseStamped{}, reliable),
        hip(participant, name + "/hip", ros::PoseStamped{}, reliable),
        force(participant, name + "/force", ros::WrenchStamped{}, reliable),
        normal(participant, name + "/normal", ros::Vector3Stamped{}, reliable),
        contact(participant, name + "/contact", ros::UInt8{}, reliable),
        flags(participant, name + "/flags", ros::UInt32{}, reliable),
        safety(participant, name + "/safety_flags", ros::UInt32{}, reliable) {}

  void read() {
    TickReport since;
    fresh = false;
    for (ServoTick record{}; ticks.try_pop(record); fresh = true) {
      since.add(record);
      second.add(record);
    }
    if (fresh) report = since;
  }

  void publish(const ros::Header& now) {
    const Tick& tick = report.newest.tick;
    proxy.write(pose_of(now, tick.proxy, tick.proxy_orientation));
    hip.write(pose_of(now, tick.hip, tick.orientation));
    force.write(
        ros::WrenchStamped{now, components(report.newest.force), components(report.newest.torque)});
    normal.write(ros::Vector3Stamped{now, components(tick.normal)});
    contact.write(ros::UInt8{static_cast<std::uint8_t>(tick.state)});
    flags.write(ros::UInt32{report.flags});
    safety.write(ros::UInt32{report.safety});
  }

  [[nodiscard]] std::array<const dds::Writer*, 7> writers() const {
    return {&proxy, &hip, &force, &normal, &contact, &flags, &safety};
  }

  TickRing<ServoTick>::Reader ticks;
  dds::Writer proxy, hip, force, normal, contact, flags, safety;
  TickReport report;   // since the last message
  TickReport second;   // since the last report
  bool fresh = false;  // a tick came since the last message
};

class Node final : public RosNode {
 public:
  Node(Session& session, const RosNodeOptions& options)
      : session_(session),
        node_(checked_name(options.name)),
        name_(node_.full()),
        frame_(options.frame),
        interval_(1.0 / checked_rate(options.rate)),
        parameters_(session.methods()),
        participant_("ros", "enclave=/;"),
        hands_(topics_of(participant_, name_, session)),
        markers_(participant_, name_ + "/markers", ros::MarkerArray{}, newest_alone),
        diagnostics_(participant_, "/diagnostics", ros::DiagnosticArray{}, reliable),
        events_(participant_, "/parameter_events", ros::ParameterEvent{}, events),
        set_(participant_, name_ + "/set_parameters", 1,
             [this](const auto& request) { return set_each(request); }),
        set_all_(participant_, name_ + "/set_parameters_atomically", 2,
                 [this](const auto& request) { return set_together(request); }),
        get_(participant_, name_ + "/get_parameters", 3,
             [this](const auto& names) {
               return each<ros::GetParameters>(
                   names, [&, settings = session_.settings()](const auto& name) {
                     return parameters_.get(settings, name);
                   });
             }),
        types_(participant_, name_ + "/get_parameter_types", 4,
               [this](const auto& names) {
                 return each<ros::GetParameterTypes>(
                     names, [&](const auto& name) { return parameters_.describe(name).type; });
               }),
        describe_(participant_, name_ + "/describe_parameters", 5,
                  [this](const auto& names) {
                    return each<ros::DescribeParameters>(
                        names, [&](const auto& name) { return parameters_.describe(name); });
                  }),
        list_(participant_, name_ + "/list_parameters", 6,
              [this](const ros::ListParameters::Request& request) {
                return ros::ListParameters::Reply{{}, parameters_.list(request.content)};
              }),
        start_recording_(participant_, name_ + "/start_recording", 7,
                         [this](const auto&) { return start_recording(); }),
        stop_recording_(participant_, name_ + "/stop_recording", 8,
                        [this](const auto&) { return stop_recording(); }),
        // Hazard: ros-node
        hold_(participant_, name_ + "/hold", 9,
              [this](const auto&) {
                return done([this] { session_.hold(true); }, "no force from now on");
              }),
        release_(participant_, name_ + "/release", 10,
                 [this](const auto&) {
                   return done([this] { session_.hold(false); },
                               "the device engages in free space");
                 }),
        reset_(participant_, name_ + "/reset_faults", 11,
               [this](const auto&) {
                 return done([this] { session_.reset_faults(); }, "latched faults have ended");
               }),
        recordings_(session, options.recordings),
        known_(parameters_.all(session.settings())),
        thread_([this] { run(); }) {}

  ~Node() override {
    ends_ = true;
    thread_.join();
  }

  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint32_t domain() const override { return participant_.domain(); }
  [[nodiscard]] std::string recording_ended() const override { return recordings_.ended(); }
  [[nodiscard]] std::string trouble() const override {
    const std::lock_guard lock(trouble_mutex_);
    return trouble_;
  }

 private:
  // The first hand's are the node's own; another one's have its name between.
  static std::vector<std::unique_ptr<HandTopics>> topics_of(dds::Participant& participant,
                                                            const std::string& node,
                                                            const Session& session) {
    std::vector<std::unique_ptr<HandTopics>> hands;
    for (std::size_t i = 0; i < session.hands(); ++i)
      hands.push_back(std::make_unique<HandTopics>(
          participant, i == 0 ? node : node + "/" + session.hand_name(i), session.ticks(i)));
    return hands;
  }

  // When each of its works is due next [s].
  struct Due {
    double ticks, markers, report, nodes;
  };

  void run() {
    const double begin = monotonic_now();
    Due due{begin, begin, begin + report_interval, begin};
    counted_at_ = begin;
    while (!ends_) {
      try {
        participant_.wait(std::clamp(due.ticks - monotonic_now(), 0.0, longest_wait));
        work(due);
      } catch (const std::exception& error) {  // the session continues without what failed
        const std::lock_guard lock(trouble_mutex_);
        trouble_ = error.what();
      }
    }
  }

  void work(Due& due) {
    const double now = monotonic_now();
    serve(now);
    if (now < due.ticks) return;
    due.ticks = std::max(due.ticks + interval_, now);  // what was missed is not made up for
    bool fresh = false;
    for (const auto& hand : hands_) {
      hand->read();
      if (hand->fresh) hand->publish({dds::stamp_of(hand->report.newest.tick.t), frame_});
      fresh = fresh || hand->fresh;
    }
    if (fresh && now >= due.markers) {
      due.markers = now + marker_interval;
      write_markers();
    }
    if (now >= due.nodes) {
      due.nodes = now + nodes_interval;
      announce();
    }
    if (now >= due.report) {
      due.report = now + report_interval;
      report(now);
    }
  }

  // Of all hands in one message, by the hand's number.
  void write_markers() {
    const double radius = session_.settings().parameters.proxy.r_c();
    ros::MarkerArray all;
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      const ServoTick& newest = hands_[i]->report.newest;
      ros::MarkerArray markers = markers_of(newest, radius, {dds::stamp_of(newest.tick.t), frame_});
      for (auto& marker : markers.markers) {
        marker.id = static_cast<std::int32_t>(i);
        all.markers.push_back(std::move(marker));
      }
    }
    markers_.write(all);
  }

  void report(double now) {
    SessionReport report;
    report.state = session_.state();
    report.now = now;
    const std::uint64_t ticks = session_.statistics().ticks.load();
    report.tick_rate =
        static_cast<double>(ticks - counted_ticks_) / std::max(now - counted_at_, 1e-3);
    report.late_ticks = report.state.hands[0].summary.late_ticks - counted_late_;
    counted_at_ = now;
    counted_ticks_ = ticks;
    counted_late_ = report.state.hands[0].summary.late_ticks;
    for (std::size_t i = 0; i < hands_.size(); ++i) {
      report.hands.push_back({hands_[i]->second, session_.device(i).info()});
      hands_[i]->second.flags = hands_[i]->second.safety = 0;
    }
    diagnostics_.write(diagnostics_of(report, {dds::stamp_of(now), frame_}));
    tell_changes();
  }

  // ROS's nodes tell each other their names and whose each reader and writer is; the message has
  // another form from Iron on, and is an error to those of the other form. So it waits until one
  // is there, and takes its form.
  void announce() {
    const dds::Generation generation = participant_.generation();
    if (generation == announced_ || generation == dds::Generation::unknown) return;
    nodes_.reset();
    if (generation == dds::Generation::from_iron)
      announce_as<16>();
    else
      announce_as<24>();
    announced_ = generation;
  }

  template <std::size_t size>
  void announce_as() {
    ros::ParticipantEntitiesInfo<size> info;
    info.participant = identity<size>(participant_.guid());
    auto& node = info.nodes.emplace_back();
    node.node_namespace = node_.space;
    node.node_name = node_.name;
    for (const auto& hand : hands_) {
      for (const dds::Writer* writer : hand->writers())
        node.writers.push_back(identity<size>(writer->guid()));
    }
    for (const dds::Writer* writer : {&markers_, &diagnostics_, &events_})
      node.writers.push_back(identity<size>(writer->guid()));
    for_services([&](const auto& service) {
      node.readers.push_back(identity<size>(service.reader()));
      node.writers.push_back(identity<size>(service.writer()));
    });
    nodes_.emplace(participant_, "", info, latched);
    nodes_->write(info);
  }

  void serve(double now) {
    for_services([now](auto& service) { service.serve(now); });
  }
  template <class Visit>
  void for_services(const Visit& visit) {
    const auto all = [&](auto&... services) { (visit(services), ...); };
    all(set_, set_all_, get_, types_, describe_, list_, start_recording_, stop_recording_, hold_,
        release_, reset_);
  }

  // All of them or none.
  ros::SetParametersResult set(const std::vector<ros::Parameter>& parameters) {
    try {
      session_.change([&](ServoSettings& settings) {
        for (const ros::Parameter& parameter : parameters) parameters_.set(settings, parameter);
      });
    } catch (const std::exception& error) {
      return {false, error.what()};
    }
    return {true, ""};
  }

  ros::SetParameters::Reply set_each(const ros::SetParameters::Request& request) {
    ros::SetParameters::Reply reply;
    for (const ros::Parameter& parameter : request.content)
      reply.content.push_back(set({parameter}));
    tell_changes();
    return reply;
  }

  ros::SetParametersAtomically::Reply set_together(
      const ros::SetParametersAtomically::Request& request) {
    ros::SetParametersAtomically::Reply reply{{}, set(request.content)};
    tell_changes();
    return reply;
  }

  // What `of` says of each of the names that a service is asked for.
  template <class Service, class Of>
  static typename Service::Reply each(const typename Service::Request& names, const Of& of) {
    typename Service::Reply reply;
    for (const std::string& name : names.content) reply.content.push_back(of(name));
    return reply;
  }

  // Whoever changed them: one that is set may change others, as r_c does.
  void tell_changes() {
    std::vector<ros::Parameter> all = parameters_.all(session_.settings());
    ros::ParameterEvent event;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].value != known_[i].value) event.changed.push_back(all[i]);
    }
    known_ = std::move(all);
    if (event.changed.empty()) return;
    event.stamp = dds::stamp_of(monotonic_now());
    event.node = name_;
    events_.write(event);
  }

  ros::Trigger::Reply start_recording() {
    ros::Trigger::Reply reply = done([this] { recordings_.start(); }, "");
    if (reply.content.success) reply.content.message = session_.state().recording.folder;
    return reply;
  }

  ros::Trigger::Reply stop_recording() {
    const RecordingState before = session_.state().recording;
    if (!before.on) return {{}, {false, "no recording is on"}};
    return done([this] { recordings_.stop(); }, before.folder);
  }

  static ros::Trigger::Reply done(const std::function<void()>& what, const std::string& message) {
    try {
      what();
    } catch (const std::exception& error) {
      return {{}, {false, error.what()}};
    }
    return {{}, {true, message}};
  }

  Session& session_;
  const NodeName node_;
  const std::string name_, frame_;
  const double interval_;  // [s]
  const NodeParameters parameters_;

  dds::Participant participant_;
  std::vector<std::unique_ptr<HandTopics>> hands_;
  dds::Writer markers_, diagnostics_, events_;
  dds::Service<ros::SetParameters> set_;
  dds::Service<ros::SetParametersAtomically> set_all_;
  dds::Service<ros::GetParameters> get_;
  dds::Service<ros::GetParameterTypes> types_;
  dds::Service<ros::DescribeParameters> describe_;
  dds::Service<ros::ListParameters> list_;
  dds::Service<ros::Trigger> start_recording_, stop_recording_, hold_, release_, reset_;
  std::optional<dds::Writer> nodes_;
  dds::Generation announced_ = dds::Generation::unknown;

  ObserverRecordings recordings_;
  std::vector<ros::Parameter> known_;  // as others were told
  double counted_at_ = 0.0;            // [s]
  std::uint64_t counted_ticks_ = 0, counted_late_ = 0;
  mutable std::mutex trouble_mutex_;
  std::string trouble_;  // guarded by it
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

}  // namespace

std::unique_ptr<RosNode> make_ros_node(Session& session, const RosNodeOptions& options) {
  return std::make_unique<Node>(session, options);
}

}  // namespace palpate
