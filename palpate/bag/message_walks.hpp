// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "palpate/bag/header_walk.hpp"
#include "palpate/bag/messages.hpp"

// The fields of each message in their order, once for all: `way` writes them, reads them, or lays
// them out in memory.
namespace palpate::ros {

template <class Way, class M>
void walk_image(Way& way, M& m) {
  walk_header(way, m.header);
  way.number(m.height);
  way.number(m.width);
  way.text(m.encoding);
  way.number(m.is_bigendian);
  way.number(m.step);
  way.bytes(m.data);
}

template <class Way, class M>
void walk_compressed(Way& way, M& m) {
  walk_header(way, m.header);
  way.text(m.format);
  way.bytes(m.data);
}

template <class Way, class M>
void walk_camera(Way& way, M& m) {
  walk_header(way, m.header);
  way.number(m.height);
  way.number(m.width);
  way.text(m.distortion_model);
  way.numbers(m.d);
  way.array(m.k);
  way.array(m.r);
  way.array(m.p);
  way.number(m.binning_x);
  way.number(m.binning_y);
  way.array(m.roi);
  way.flag(m.do_rectify);
}

template <class Way, class M>
void walk_points(Way& way, M& m) {
  walk_header(way, m.header);
  way.number(m.height);
  way.number(m.width);
  way.sequence(m.fields, 13, [&way](auto& field) {
    way.text(field.name);
    way.number(field.offset);
    way.number(field.datatype);
    way.number(field.count);
  });
  way.flag(m.is_bigendian);
  way.number(m.point_step);
  way.number(m.row_step);
  way.bytes(m.data);
  way.flag(m.is_dense);
}

template <class Way, class M>
void walk_pose(Way& way, M& m) {
  walk_header(way, m.header);
  way.array(m.position);
  way.array(m.orientation);
}

template <class Way, class M>
void walk_wrench(Way& way, M& m) {
  walk_header(way, m.header);
  way.array(m.force);
  way.array(m.torque);
}

template <class Way, class M>
void walk_transforms(Way& way, M& m) {
  way.sequence(m.transforms, 72, [&way](auto& transform) {
    walk_header(way, transform.header);
    way.text(transform.child_frame_id);
    way.array(transform.translation);
    way.array(transform.rotation);
  });
}

// ROS's layout of one dimension; further ones are passed over.
template <class Way, class M>
void walk_multi_array(Way& way, M& m) {
  struct Dimension {
    std::string label;
    std::uint32_t size = 0, stride = 0;
  };
  const auto size = static_cast<std::uint32_t>(m.data.size());
  std::vector<Dimension> dimensions{{m.label, size, size}};
  way.sequence(dimensions, 12, [&way](auto& dimension) {
    way.text(dimension.label);
    way.number(dimension.size);
    way.number(dimension.stride);
  });
  std::uint32_t offset = 0;
  way.number(offset);
  way.numbers(m.data);
  if constexpr (!std::is_const_v<M>) m.label = dimensions.empty() ? "" : dimensions.front().label;
}

inline constexpr auto image = [](auto& way, auto& m) { walk_image(way, m); };
inline constexpr auto compressed = [](auto& way, auto& m) { walk_compressed(way, m); };
inline constexpr auto camera = [](auto& way, auto& m) { walk_camera(way, m); };
inline constexpr auto points = [](auto& way, auto& m) { walk_points(way, m); };
inline constexpr auto pose = [](auto& way, auto& m) { walk_pose(way, m); };
inline constexpr auto wrench = [](auto& way, auto& m) { walk_wrench(way, m); };
inline constexpr auto time_reference = [](auto& way, auto& m) {
  walk_header(way, m.header);
  way.number(m.time_ref.sec);
  way.number(m.time_ref.nanosec);
  way.text(m.source);
};
inline constexpr auto transform = [](auto& way, auto& m) {
  way.array(m.translation);
  way.array(m.rotation);
};
inline constexpr auto transforms = [](auto& way, auto& m) { walk_transforms(way, m); };
inline constexpr auto float32 = [](auto& way, auto& m) { way.number(m.data); };
inline constexpr auto key_value = [](auto& way, auto& m) {
  way.text(m.key);
  way.text(m.value);
};
inline constexpr auto string = [](auto& way, auto& m) { way.text(m.data); };
inline constexpr auto multi_array = [](auto& way, auto& m) { walk_multi_array(way, m); };
inline constexpr auto boolean = [](auto& way, auto& m) { way.flag(m.data); };
inline constexpr auto point = [](auto& way, auto& m) { way.array(m.xyz); };
inline constexpr auto plain_wrench = [](auto& way, auto& m) {
  way.array(m.force);
  way.array(m.torque);
};
inline constexpr auto omni_feedback = [](auto& way, auto& m) {
  way.array(m.force);
  way.array(m.position);
};

}  // namespace palpate::ros
