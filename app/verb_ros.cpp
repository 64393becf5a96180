// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/running_session.hpp"
#include "app/signals.hpp"
#include "app/verbs.hpp"
#include "palpate/net/node/ros_node.hpp"

namespace palpate::app {
namespace {

struct RosOptions {
  RunOptions run;
  RosNodeOptions node;
};

int run_node(const RosOptions& options) {
  const SessionConfig config = options.run.session.config(session_methods());
  if (prints_config(options.run, config)) return 0;
  // While there is one thread, and before there is DDS: a guard is another process.
  GuardedDevices guarded = guarded_devices(config);
  Running running;
  const EndingSignals signals([&] { running.end(); });
  OpenedSession opened(options.run, config, std::move(guarded), running);
  Session& session = opened.session;
  RosNodeOptions wishes = options.node;
  wishes.recordings.folder = config.record_folder;
  wishes.recordings.limit = 1e9 * config.record_limit;
  std::string ended_recording;
  {
    const std::unique_ptr<const RosNode> node = make_ros_node(session, wishes);
    fmt::print(stderr, "palpate: node {} in domain {}; Ctrl-C ends it\n", node->name(),
               node->domain());
    if (!running.ended) session.run(options.run.duration);  // the force is off when it returns
    ended_recording = node->recording_ended();
    if (const std::string trouble = node->trouble(); !trouble.empty())
      fmt::print(stderr, "palpate: {}\n", trouble);
  }
  return finish(session, options.run.json, ended_recording);
}

}  // namespace

Verb add_ros(CLI::App& program) {
  CLI::App* command = program.add_subcommand("ros", "run a session as a ROS 2 node");
  const auto options = std::make_shared<RosOptions>();
  options->run.headless = options->run.in_real_time = true;
  options->run.add_to(*command, nullptr);
  command->add_option("--name", options->node.name,
                      "name of the node (palpate), with its namespace: cell_3/palpate");
  command->add_option("--frame", options->node.frame, "frame_id of the published messages (world)");
  command->add_option("--publish-rate", options->node.rate,
                      "rate [Hz] of poses, force, contact and flags (100), 1 to 1000");
  return {command, [options] { return run_node(*options); }};
}

}  // namespace palpate::app
