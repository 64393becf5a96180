// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/bag/c_sample.hpp"
#include "palpate/bag/cdr_ways.hpp"
#include "palpate/bag/header_walk.hpp"
#include "palpate/bag/messages.hpp"

// What a node of ROS 2 says besides what recordings hold: reports, parameters, services, and which
// nodes there are. Each message walks over its own fields, in the order of their definitions.
namespace palpate::ros {

template <Walked Message>
std::vector<std::byte> encode(const Message& message) {
  return encode_by(message, [](auto& way, auto& m) { Message::walk(way, m); });
}
template <Walked Message>
Message decode(std::span<const std::byte> bytes, const std::string& name) {
  return decode_by<Message>(bytes, name, [](auto& way, auto& m) { Message::walk(way, m); });
}

// ---------------------------------------------------------------------------- reports

struct Vector3Stamped {
  static constexpr std::string_view type = "geometry_msgs/msg/Vector3Stamped";
  Header header;
  std::array<double, 3> vector{};

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    walk_header(way, m.header);
    way.array(m.vector);
  }
};

struct UInt8 {
  static constexpr std::string_view type = "std_msgs/msg/UInt8";
  std::uint8_t data = 0;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.number(m.data);
  }
};

struct UInt32 {
  static constexpr std::string_view type = "std_msgs/msg/UInt32";
  std::uint32_t data = 0;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.number(m.data);
  }
};

struct DiagnosticStatus {
  enum Level : std::uint8_t { ok, warn, error, stale };
  std::uint8_t level = ok;
  std::string name{}, message{}, hardware_id{};
  std::vector<KeyValue> values;
};

struct DiagnosticArray {
  static constexpr std::string_view type = "diagnostic_msgs/msg/DiagnosticArray";
  Header header;
  std::vector<DiagnosticStatus> status;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    walk_header(way, m.header);
    way.sequence(m.status, 17, [&way](auto& each) {
      way.number(each.level);
      way.text(each.name);
      way.text(each.message);
      way.text(each.hardware_id);
      way.sequence(each.values, 8, [&way](auto& value) {
        way.text(value.key);
        way.text(value.value);
      });
    });
  }
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
};

struct MarkerArray {
  static constexpr std::string_view type = "visualization_msgs/msg/MarkerArray";
  std::vector<Marker> markers;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.sequence(m.markers, 200, [&way](auto& marker) { walk_marker(way, marker); });
  }

 private:
  template <class Way, class Self>
  static void walk_marker(Way& way, Self& m) {
    walk_header(way, m.header);
    way.text(m.ns);
    way.number(m.id);
    way.number(m.kind);
    way.number(m.action);
    way.array(m.position);
    way.array(m.orientation);
    way.array(m.scale);
    way.array(m.colour);
    way.array(m.lifetime);
    bool frame_locked = false;
    way.flag(frame_locked);
    way.sequence(m.points, 24, [&way](auto& point) { way.array(point); });
    std::vector<std::array<float, 4>> colours;
    way.sequence(colours, 16, [&way](auto& colour) { way.array(colour); });
    std::string text;
    way.text(text);  // texture_resource
    Header texture;
    walk_header(way, texture);
    way.text(text);  // its format
    std::vector<std::byte> data;
    way.bytes(data);
    std::vector<std::array<float, 2>> coordinates;
    way.sequence(coordinates, 8, [&way](auto& coordinate) { way.array(coordinate); });
    way.text(text);
    way.text(text);  // mesh_resource
    way.text(text);  // mesh_file
    way.bytes(data);
    bool embedded = false;
    way.flag(embedded);
  }
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

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.number(m.type);
    way.flag(m.bool_value);
    way.number(m.integer_value);
    way.number(m.double_value);
    way.text(m.string_value);
    std::vector<std::byte> bytes;
    way.bytes(bytes);
    way.bytes(bytes);  // bools
    std::vector<std::int64_t> integers;
    way.numbers(integers);
    std::vector<double> doubles;
    way.numbers(doubles);
    std::vector<std::string> texts;
    way.texts(texts);
  }
};

struct Parameter {
  std::string name;
  ParameterValue value;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.text(m.name);
    ParameterValue::walk(way, m.value);
  }
};

struct ParameterEvent {
  static constexpr std::string_view type = "rcl_interfaces/msg/ParameterEvent";
  Time stamp;
  std::string node;
  std::vector<Parameter> added, changed, deleted;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.number(m.stamp.sec);
    way.number(m.stamp.nanosec);
    way.text(m.node);
    const auto each = [&way](auto& parameter) { Parameter::walk(way, parameter); };
    way.sequence(m.added, 48, each);
    way.sequence(m.changed, 48, each);
    way.sequence(m.deleted, 48, each);
  }
};

/// A range from, to, step; a step of 0 leaves everything between.
template <class Number, class Step = Number>
struct ParameterRange {
  Number from{}, to{};
  Step step{};
};

struct ParameterDescriptor {
  std::string name;
  std::uint8_t type = ParameterValue::not_set;
  std::string description, additional_constraints;
  bool read_only = false;
  bool dynamic_typing = false;
  std::vector<ParameterRange<double>> floating_point_range;                ///< at most one
  std::vector<ParameterRange<std::int64_t, std::uint64_t>> integer_range;  ///< at most one

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.text(m.name);
    way.number(m.type);
    way.text(m.description);
    way.text(m.additional_constraints);
    way.flag(m.read_only);
    way.flag(m.dynamic_typing);
    const auto each = [&way](auto& range) {
      way.number(range.from);
      way.number(range.to);
      way.number(range.step);
    };
    way.sequence(m.floating_point_range, 24, each);
    way.sequence(m.integer_range, 24, each);
  }
};

struct SetParametersResult {
  bool successful = false;
  std::string reason;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.flag(m.successful);
    way.text(m.reason);
  }
};

// ---------------------------------------------------------------------------- services

/// Which request a message of a service belongs to, as rmw_cyclonedds_cpp writes it in front of
/// requests and replies alike.
struct RequestHeader {
  std::uint64_t client = 0;   ///< the client's own name for itself
  std::int64_t sequence = 0;  ///< of the request

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.number(m.client);
    way.number(m.sequence);
  }
};

struct SetParameters {
  struct Request {
    static constexpr std::string_view type = "rcl_interfaces/srv/SetParameters_Request";
    RequestHeader header{};
    std::vector<Parameter> parameters;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.sequence(m.parameters, 48, [&way](auto& p) { Parameter::walk(way, p); });
    }
  };
  struct Reply {
    static constexpr std::string_view type = "rcl_interfaces/srv/SetParameters_Response";
    RequestHeader header{};
    std::vector<SetParametersResult> results;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.sequence(m.results, 8, [&way](auto& r) { SetParametersResult::walk(way, r); });
    }
  };
};

struct SetParametersAtomically {
  struct Request {
    static constexpr std::string_view type = "rcl_interfaces/srv/SetParametersAtomically_Request";
    RequestHeader header{};
    std::vector<Parameter> parameters;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      SetParameters::Request::walk(way, m);
    }
  };
  struct Reply {
    static constexpr std::string_view type = "rcl_interfaces/srv/SetParametersAtomically_Response";
    RequestHeader header{};
    SetParametersResult result;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      SetParametersResult::walk(way, m.result);
    }
  };
};

struct GetParameters {
  struct Request {
    static constexpr std::string_view type = "rcl_interfaces/srv/GetParameters_Request";
    RequestHeader header{};
    std::vector<std::string> names;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.texts(m.names);
    }
  };
  struct Reply {
    static constexpr std::string_view type = "rcl_interfaces/srv/GetParameters_Response";
    RequestHeader header{};
    std::vector<ParameterValue> values;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.sequence(m.values, 44, [&way](auto& value) { ParameterValue::walk(way, value); });
    }
  };
};

struct GetParameterTypes {
  struct Request {
    static constexpr std::string_view type = "rcl_interfaces/srv/GetParameterTypes_Request";
    RequestHeader header{};
    std::vector<std::string> names;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      GetParameters::Request::walk(way, m);
    }
  };
  struct Reply {
    static constexpr std::string_view type = "rcl_interfaces/srv/GetParameterTypes_Response";
    RequestHeader header{};
    std::vector<std::uint8_t> types;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.numbers(m.types);
    }
  };
};

struct DescribeParameters {
  struct Request {
    static constexpr std::string_view type = "rcl_interfaces/srv/DescribeParameters_Request";
    RequestHeader header{};
    std::vector<std::string> names;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      GetParameters::Request::walk(way, m);
    }
  };
  struct Reply {
    static constexpr std::string_view type = "rcl_interfaces/srv/DescribeParameters_Response";
    RequestHeader header{};
    std::vector<ParameterDescriptor> descriptors;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.sequence(m.descriptors, 24, [&way](auto& d) { ParameterDescriptor::walk(way, d); });
    }
  };
};

struct ListParameters {
  struct Request {
    static constexpr std::string_view type = "rcl_interfaces/srv/ListParameters_Request";
    RequestHeader header{};
    std::vector<std::string> prefixes;
    std::uint64_t depth = 0;  ///< 0: any

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.texts(m.prefixes);
      way.number(m.depth);
    }
  };
  struct Reply {
    static constexpr std::string_view type = "rcl_interfaces/srv/ListParameters_Response";
    RequestHeader header{};
    std::vector<std::string> names, prefixes;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.texts(m.names);
      way.texts(m.prefixes);
    }
  };
};

struct Trigger {
  struct Request {
    static constexpr std::string_view type = "std_srvs/srv/Trigger_Request";
    RequestHeader header{};
    std::uint8_t empty = 0;  ///< IDL has no struct without a field; ROS sends this byte

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.number(m.empty);
    }
  };
  struct Reply {
    static constexpr std::string_view type = "std_srvs/srv/Trigger_Response";
    RequestHeader header{};
    bool success = false;
    std::string message;

    template <class Way, class Self>
    static void walk(Way& way, Self& m) {
      RequestHeader::walk(way, m.header);
      way.flag(m.success);
      way.text(m.message);
    }
  };
};

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
  };
  Identity participant{};
  std::vector<Node> nodes;

  template <class Way, class Self>
  static void walk(Way& way, Self& m) {
    way.array(m.participant);
    way.sequence(m.nodes, 16, [&way](auto& node) {
      way.text(node.node_namespace);
      way.text(node.node_name);
      const auto each = [&way](auto& identity) { way.array(identity); };
      way.sequence(node.readers, size, each);
      way.sequence(node.writers, size, each);
    });
  }
};

}  // namespace palpate::ros
