// SPDX-License-Identifier: Apache-2.0
#include <csignal>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "app/program_robots.hpp"
#include "app/running_session.hpp"
#include "app/verbs.hpp"
#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/net/telelink/operator_end.hpp"
#include "palpate/net/telelink/robot_end.hpp"

namespace palpate::app {
namespace {

// Of the page at the robot's end, beside the operator's on one machine.
constexpr std::uint16_t robot_port = 8643;
constexpr const char* patience = "wait=25s";  // for an end that starts together with this one

struct OperatorOptions {
  RunOptions run;
  std::string name = "robot";
  bool whole_images = false, no_index = false, learn = false;
  bool robot_starts = false;  // too, now
};

struct RobotOptions {
  RunOptions run;
  bool is_beside = false;  // the operator's end, which has the page that people are to open
  RobotEndOptions end;
  std::string robot = usual_cell();
};

// A line when what is wrong changes.
void say_trouble(std::string& said, const std::string& trouble) {
  if (trouble == said) return;
  said = trouble;
  fmt::print(stderr, "palpate: robot: {}\n", trouble.empty() ? "ready" : trouble);
}

int operate(const OperatorOptions& options) {
  RunOptions run = options.run;
  SessionConfig config = run.session.config(session_methods());
  if (!run.session.names_cameras()) {
    std::string uri = "ros2:/" + options.name + "/depth/image_raw/";
    uri += options.whole_images ? "compressedDepth?reliable" : "slices";
    if (options.robot_starts) uri += std::string(options.whole_images ? "&" : "?") + patience;
    config.cameras = {{.uri = uri}};
  }
  if (prints_config(run, config)) return 0;
  std::shared_ptr<OperatorEnd> end;
  run.beside.attach = [&](Session& session) -> std::shared_ptr<void> {
    // A mouse and a simulated hand are where they want to be.
    const DeviceInfo& device = session.device().info();
    const bool is_device = device.limits.motors && !device.simulated;
    end = std::make_shared<OperatorEnd>(
        session,
        OperatorEndOptions{
            .name = options.name, .index = !options.no_index && is_device, .learn = options.learn});
    fmt::print(stderr, "palpate: teleoperates /{} in domain {}; Ctrl-C ends it\n", options.name,
               end->domain());
    return {nullptr, [&end](std::nullptr_t) { end.reset(); }};
  };
  std::string said;
  run.beside.robot = [&]() -> std::optional<RobotPicture> {
    RobotPicture picture{.name = options.name};
    if (!end) return picture;
    const RobotView view = end->robot();
    picture.age = view.age;
    picture.latency = view.latency;
    picture.led = view.led;
    if (view.state) {
      picture.tool = view.state->position;
      picture.links = view.state->links;
      picture.force = view.state->force;
      picture.trouble = view.heard ? view.state->fault : "no messages from the robot any more";
    } else {
      picture.trouble = "no messages from the robot yet";
    }
    say_trouble(said, picture.trouble);
    return picture;
  };
  return run_session(run, config);
}

int guard(const RobotOptions& options) {
  RunOptions run = options.run;
  SessionConfig config = run.session.config(session_methods());
  if (prints_config(run, config)) return 0;
  if (!config.hands.front().device.empty())
    throw Error("--device", "the haptic device is at the operator's end",
                "remove this option, and start palpate teleop operator --device there");
  run.usual_port = robot_port;
  if (options.is_beside) run.whose_page = "the robot's end has a page, too:";
  const Cell cell = open_cell(options.robot);
  const bool own_camera = cell.camera && !run.session.names_cameras();
  if (!own_camera && !run.session.names_cameras())
    throw Error("--camera", options.robot + " has no camera",
                "set the robot's camera, such as --camera realsense:");
  RobotEndOptions wishes = options.end;
  if (!config.fixtures.empty())
    wishes.fixtures = std::make_shared<const FixtureSet>(read_fixtures(config.fixtures));
  wishes.tool = config.tool;
  RobotEnd end(cell.robot(), wishes);
  run.in_real_time = true;
  run.beside.prepare = [&](SessionOptions& session) {
    end.prepare(session);
    if (own_camera) {
      session.cameras.clear();
      session.cameras.push_back({.uri = options.robot});
      session.open_cameras.push_back(cell.camera());
    }
    session.on_frame = [&, shown = std::move(session.on_frame)](std::size_t camera,
                                                                const FedFrame& frame) {
      if (own_camera && cell.on_frame) cell.on_frame(frame);
      end.on_frame(camera, frame);
      if (shown) shown(camera, frame);
    };
  };
  run.beside.attach = [&](Session& session) -> std::shared_ptr<void> {
    end.attach(session);
    fmt::print(stderr, "palpate: {} ({}) is teleoperated by /{} in domain {}; Ctrl-C ends it\n",
               end.info().uri, end.info().kind, options.end.name, end.domain());
    return {nullptr, [&end](std::nullptr_t) { end.detach(); }};
  };
  std::string said;
  run.beside.robot = [&]() -> std::optional<RobotPicture> {
    const RobotState state = end.state();
    say_trouble(said, state.fault);
    return RobotPicture{.name = options.end.name,
                        .tool = state.position,
                        .links = state.links,
                        .force = state.force,
                        .radius = end.info().tool_radius,
                        .led = end.is_led(),
                        .trouble = state.fault};
  };
  return run_session(run, config);
}

// The robot's end as a process of its own, which ends with this one, whatever becomes of it.
class OtherEnd {
 public:
  explicit OtherEnd(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "palpate");
    std::vector<char*> words;
    for (std::string& word : arguments) words.push_back(word.data());
    words.push_back(nullptr);
    const pid_t parent = getpid();
    child_ = fork();
    if (child_ < 0) throw Error("teleop", "no second process can be started", "end some others");
    if (child_ > 0) return;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() == parent) execv("/proc/self/exe", words.data());
    _exit(1);
  }
  ~OtherEnd() {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  OtherEnd(const OtherEnd&) = delete;
  OtherEnd& operator=(const OtherEnd&) = delete;

 private:
  pid_t child_ = -1;
};

// Both ends on this machine, to see how it is.
int lead_here(const OperatorOptions& operating, const RobotOptions& robot) {
  std::vector<std::string> words = {"teleop", "robot",        "--robot",      robot.robot,
                                    "--name", operating.name, "--no-browser", "--beside"};
  if (operating.run.headless) words.emplace_back("--headless");
  if (const std::string tool = operating.run.session.config(session_methods()).tool; !tool.empty())
    words.insert(words.end(), {"--tool", tool});
  const double seconds =
      operating.run.duration.value_or(operating.run.headless ? headless_duration : 0.0);
  if (seconds > 0.0) {
    words.emplace_back("--duration");
    words.push_back(fmt::format("{}", seconds + 30.0));  // it ends with this one
  }
  const OtherEnd other(std::move(words));
  return operate(operating);
}

constexpr const char* headless_help = "no page";

void add_learn(CLI::App& command, OperatorOptions& options) {
  command.add_flag(
      "--learn", options.learn,
      "render surfaces that the robot touched with the stiffness and friction measured there");
}

}  // namespace

Verb add_teleop(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("teleop", "teleoperate a robot, and feel what its camera sees");
  command->require_subcommand(0, 1);
  const auto operating = std::make_shared<OperatorOptions>();
  CLI::App* hand =
      command->add_subcommand("operator", "the operator's end, with the haptic device");
  operating->run.add_to(*hand, headless_help);
  hand->add_option("--name", operating->name,
                   "name of the robot in its topics (robot): /NAME/teleop/...");
  hand->add_flag("--whole-images", operating->whole_images,
                 "subscribe to whole depth images with reliable delivery instead of image slices");
  hand->add_flag("--no-index", operating->no_index,
                 "do not shift the scene at the start: the robot moves to the device position "
                 "(default: the scene is shifted so that the device starts at the tool)");
  add_learn(*hand, *operating);
  operating->run.in_real_time = true;

  const auto robot = std::make_shared<RobotOptions>();
  CLI::App* arm = command->add_subcommand("robot", "the robot's end: its camera and its arm");
  robot->run.add_to(*arm, headless_help);
  arm->add_option("--robot", robot->robot, robots_help());
  arm->add_option("--name", robot->end.name,
                  "name of the robot in its topics (robot): /NAME/teleop/...");
  arm->add_flag("--beside", robot->is_beside)->group("");  // not for people
  arm->add_option("--margin", robot->end.margin,
                  "distance [m] of the tool from the visible surface (0.002)");
  arm->add_option("--press", robot->end.press_share,
                  "fraction of the operator's force with which the tool presses, 0 (default) to 1");
  const auto both = std::make_shared<OperatorOptions>();
  both->run.in_real_time = both->robot_starts = true;
  both->run.add_to(*command, headless_help);
  add_learn(*command, *both);
  command->add_option("--robot", robot->robot, "both ends on this computer: as for teleop robot");
  command->add_option("--name", both->name, "of the robot's topics (robot)");
  return {command, [hand, arm, operating, robot, both] {
            if (hand->parsed()) return operate(*operating);
            if (arm->parsed()) return guard(*robot);
            return lead_here(*both, *robot);
          }};
}

}  // namespace palpate::app
