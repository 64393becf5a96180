// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "palpate/session/observer_recordings.hpp"
#include "palpate/session/session.hpp"

namespace palpate {

struct RosNodeOptions {
  std::string name = "palpate";  ///< of the node; with its namespace: "cell_3/palpate"
  std::string frame = "world";   ///< frame_id of what it publishes
  double rate = 100.0;           ///< [Hz] of poses, force, contact and flags; 1 to 1000
  RecordingRules recordings = {};
};

/// A session as a node of ROS 2: an observer that publishes its ticks and reports, and sends
/// settings back. docs/ros.md has its topics, services and parameters.
///
/// All of it is on one thread of its own, which reads the ring of ticks: whatever the network does,
/// no tick waits for it.
class RosNode {
 public:
  virtual ~RosNode() = default;

  /// With its namespace: "/palpate".
  [[nodiscard]] virtual const std::string& name() const = 0;
  [[nodiscard]] virtual std::uint32_t domain() const = 0;
  /// What could not be done, the last of it; empty if all went well.
  [[nodiscard]] virtual std::string trouble() const = 0;
  /// Why the last recording was ended by its limits; empty if it was not.
  [[nodiscard]] virtual std::string recording_ended() const = 0;
};

/// Takes part in the network from now on. Before the first, nothing of this process may fork later.
/// @param session  must outlive the node
/// @throws Error if a name is none, the rate is out of range, or DDS is missing.
std::unique_ptr<RosNode> make_ros_node(Session& session, const RosNodeOptions& options);

}  // namespace palpate
