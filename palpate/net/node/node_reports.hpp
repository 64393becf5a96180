// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "palpate/io/bag/node_messages.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

/// What a node says of the ticks since it said something last: the newest, and the flags of all.
struct TickReport {
  ServoTick newest{};
  std::uint32_t flags = 0;   ///< TickFlag bits
  std::uint32_t safety = 0;  ///< SafetyFlag bits

  void add(const ServoTick& record) {
    newest = record;
    flags |= record.tick.flags;
    safety |= record.safety;
  }
};

/// Proxy, HIP, the line between them, force and normal, as RViz and Foxglove draw them.
/// @param contact_radius  [m] of the proxy
ros::MarkerArray markers_of(const ServoTick& record, double contact_radius,
                            const ros::Header& header);

/// How a session was over some time.
struct SessionReport {
  SessionState state;
  TickReport ticks;
  double tick_rate = 0.0;        ///< [Hz] measured
  std::uint64_t late_ticks = 0;  ///< in that time
  double now = 0.0;              ///< [s] on the servo loop's clock
  struct Hand {
    TickReport ticks;
    DeviceInfo device;
  };
  std::vector<Hand> more_hands = {};  ///< SessionState::hands but the first
};

/// Loop, cameras, each hand's contact and device, and recording, each with its level.
ros::DiagnosticArray diagnostics_of(const SessionReport& report, const DeviceInfo& device,
                                    const ros::Header& header);

}  // namespace palpate
