// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/io/bag/messages.hpp"

// What a node of ROS 2 says besides what recordings hold: reports, parameters, services, and which
// nodes there are. As in messages.hpp.
namespace palpate::ros {

// ---------------------------------------------------------------------------- reports

struct Vector3Stamped {
  static constexpr std::string_view type = "geometry_msgs/msg/Vector3Stamped";
  Header header;
  std::array<double, 3> vector{};

  static void walk(auto& way, auto& m) { way(m.header, m.vector); }
};

struct DiagnosticStatus {
  enum Level : std::uint8_t { ok, warn, error, stale };
  std::uint8_t level = ok;
  std::string name{}, message{}, hardware_id{};
  std::vector<KeyValue> values;

  static void walk(auto& way, auto& m) { way(m.level, m.name, m.message, m.hardware_id, m.values); }
};

struct DiagnosticArray {
  static constexpr std::string_view type = "diagnostic_msgs/msg/DiagnosticArray";
  Header header;
  std::vector<DiagnosticStatus> status;

  static void walk(auto& way, auto& m) { way(m.header, m.status); }
};

/// As from ROS 2 Galactic on. Textures and meshes are left empty, and are not read.
struct Marker {
  enum Kind : std::int32_t { arrow = 0, sphere = 2, line_strip = 4 };
  enum Action : std::int32_t { add = 0, remove = 2 };
  Header header;
  std::string ns;
  std::int32_t id = 0, kind = sphere, action = add;
  std::array<double, 3> position{};                       ///< [m]
  std::array<double, 4> orientation{0.0, 0.0, 0.0, 1.0};  ///< x y z w
  std::array<double, 3> scale{};                          ///< [m]
  std::array<float, 4> colour{};                          ///< red, green, blue, opacity: 0 to 1
  std::array<std::uint32_t, 2> lifetime{};                ///< [s], [ns]; 0: for ever
  std::vector<std::array<double, 3>> points;              ///< [m]

  static void walk(auto& way, auto& m) {
    bool frame_locked = false, embedded = false;
    std::vector<std::array<float, 4>> colours;
    std::string text;  // the names of texture and meshes, and the texture's format
    Header texture;
    std::vector<std::byte> data;
    std::vector<std::array<float, 2>> coordinates;
    way(m.header, m.ns, m.id, m.kind, m.action, m.position, m.orientation, m.scale, m.colour,
        m.lifetime, frame_locked, m.points, colours, text, texture, text, data, coordinates, text,
        text, text, data, embedded);
  }
};

struct MarkerArray {
  static constexpr std::string_view type = "visualization_msgs/msg/MarkerArray";
  std::vector<Marker> markers;

  static void walk(auto& way, auto& m) { way(m.markers); }
};

// ---------------------------------------------------------------------------- parameters

struct ParameterValue {
  enum Type : std::uint8_t { not_set, flag, integer, number, text };  ///< others are not kept
  std::uint8_t type = not_set;
  bool bool_value = false;
  std::int64_t integer_value = 0;
  double double_value = 0.0;
  std::string string_value{};

  static ParameterValue of(double value) { return {.type = number, .double_value = value}; }
  static ParameterValue of(std::int64_t value) { return {.type = integer, .integer_value = value}; }
  static ParameterValue of(const std::string& value) {
    return {.type = text, .string_value = value};
  }
  friend bool operator==(const ParameterValue&, const ParameterValue&) = default;

  static void walk(auto& way, auto& m) {
    std::vector<std::byte> bytes, bools;
    std::vector<std::int64_t> integers;
    std::vector<double> doubles;
    std::vector<std::string> texts;
    way(m.type, m.bool_value, m.integer_value, m.double_value, m.string_value, bytes, bools,
        integers, doubles, texts);
  }
};

struct Parameter {
  std::string name;
  ParameterValue value;

  static void walk(auto& way, auto& m) { way(m.name, m.value); }
};

struct ParameterEvent {
  static constexpr std::string_view type = "rcl_interfaces/msg/ParameterEvent";
  Time stamp;
  std::string node;
  std::vector<Parameter> added, changed, deleted;

  static void walk(auto& way, auto& m) { way(m.stamp, m.node, m.added, m.changed, m.deleted); }
};

/// A range from, to, step; a step of 0 leaves everything between.
template <class Number, class Step = Number>
struct ParameterRange {
  Number from{}, to{};
  Step step{};

  static void walk(auto& way, auto& m) { way(m.from, m.to, m.step); }
};

struct ParameterDescriptor {
  std::string name;
  std::uint8_t type = ParameterValue::not_set;
  std::string description, additional_constraints;
  bool read_only = false;
  bool dynamic_typing = false;
  std::vector<ParameterRange<double>> floating_point_range;                ///< at most one
  std::vector<ParameterRange<std::int64_t, std::uint64_t>> integer_range;  ///< at most one

  static void walk(auto& way, auto& m) {
    way(m.name, m.type, m.description, m.additional_constraints, m.read_only, m.dynamic_typing,
        m.floating_point_range, m.integer_range);
  }
};

struct SetParametersResult {
  bool successful = false;
  std::string reason;

  static void walk(auto& way, auto& m) { way(m.successful, m.reason); }
};

// ---------------------------------------------------------------------------- services

/// Which request a service's message belongs to, as rmw_cyclonedds_cpp writes it in front.
struct RequestHeader {
  std::uint64_t client = 0;   ///< the client's own name for itself
  std::int64_t sequence = 0;  ///< of the request

  static void walk(auto& way, auto& m) { way(m.client, m.sequence); }
};

template <TypeName name, class Content>
struct ServiceMessage {
  static constexpr std::string_view type = name.view();
  RequestHeader header{};
  Content content{};

  static void walk(auto& way, auto& m) { way(m.header, m.content); }
};

/// A service by its name, and what is asked and answered.
template <TypeName name, class Asked, class Answered>
struct ServiceType {
  using Request = ServiceMessage<name + TypeName("_Request"), Asked>;
  using Reply = ServiceMessage<name + TypeName("_Response"), Answered>;
};

/// Requests that name parameters.
using ParameterNames = std::vector<std::string>;

using SetParameters = ServiceType<"rcl_interfaces/srv/SetParameters", std::vector<Parameter>,
                                  std::vector<SetParametersResult>>;
using SetParametersAtomically = ServiceType<"rcl_interfaces/srv/SetParametersAtomically",
                                            std::vector<Parameter>, SetParametersResult>;
using GetParameters =
    ServiceType<"rcl_interfaces/srv/GetParameters", ParameterNames, std::vector<ParameterValue>>;
using GetParameterTypes =
    ServiceType<"rcl_interfaces/srv/GetParameterTypes", ParameterNames, std::vector<std::uint8_t>>;
using DescribeParameters = ServiceType<"rcl_interfaces/srv/DescribeParameters", ParameterNames,
                                       std::vector<ParameterDescriptor>>;

struct ParametersWithin {
  std::vector<std::string> prefixes;
  std::uint64_t depth = 0;  ///< 0: any

  static void walk(auto& way, auto& m) { way(m.prefixes, m.depth); }
};
struct ParametersFound {
  std::vector<std::string> names, prefixes;

  static void walk(auto& way, auto& m) { way(m.names, m.prefixes); }
};
using ListParameters =
    ServiceType<"rcl_interfaces/srv/ListParameters", ParametersWithin, ParametersFound>;

struct TriggerOutcome {
  bool success = false;
  std::string message;

  static void walk(auto& way, auto& m) { way(m.success, m.message); }
};
/// IDL has no struct without a field; ROS sends this byte.
using Trigger = ServiceType<"std_srvs/srv/Trigger", std::uint8_t, TriggerOutcome>;

// ---------------------------------------------------------------------------- nodes

/// The nodes of a participant, and which readers and writers are theirs.
/// @tparam size  [bytes] of an entity's identity: 24 up to ROS 2 Humble, 16 from Iron on
template <std::size_t size>
struct ParticipantEntitiesInfo {
  static constexpr std::string_view type = "rmw_dds_common/msg/ParticipantEntitiesInfo";
  using Identity = std::array<std::uint8_t, size>;
  struct Node {
    std::string node_namespace, node_name;
    std::vector<Identity> readers, writers;

    static void walk(auto& way, auto& m) {
      way(m.node_namespace, m.node_name, m.readers, m.writers);
    }
  };
  Identity participant{};
  std::vector<Node> nodes;

  static void walk(auto& way, auto& m) { way(m.participant, m.nodes); }
};

// ---------------------------------------------------------------------------- robots

struct TwistStamped {
  static constexpr std::string_view type = "geometry_msgs/msg/TwistStamped";
  Header header;
  std::array<double, 3> linear{}, angular{};  ///< [m/s], [rad/s]

  static void walk(auto& way, auto& m) { way(m.header, m.linear, m.angular); }
};

struct JointState {
  static constexpr std::string_view type = "sensor_msgs/msg/JointState";
  Header header;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;  ///< as long as `name`, or empty

  static void walk(auto& way, auto& m) { way(m.header, m.name, m.position, m.velocity, m.effort); }
};

}  // namespace palpate::ros
