// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <spawn.h>
#include <unistd.h>

#include "app/options.hpp"
#include "app/program_methods.hpp"
#include "app/signals.hpp"
#include "app/summary_text.hpp"
#include "app/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/uri.hpp"
#include "palpate/session/session.hpp"
#include "palpate/viewer/session_host.hpp"

namespace palpate::app {
namespace {

struct RunOptions {
  std::vector<std::string> cameras{"synthetic:desk?noise=1mm"};
  std::string device;
  std::optional<double> duration;
  double rate = 1000.0;
  bool headless = false;
  bool json = false;
  std::string listen = "127.0.0.1";
  std::optional<std::uint16_t> port;
  std::string token;
  bool no_browser = false;
  std::string record;
  MethodOptions method;
};

constexpr double headless_duration = 10.0;  // [s]
constexpr std::uint16_t usual_port = 8642;

// One line that is written over and over while a person watches.
void show_status(const ServoTick& record) {
  const Tick& tick = record.tick;
  fmt::print(
      stderr,
      "\rt {:7.2f} s  {:<12} proxy {:+.3f} {:+.3f} {:+.3f} m  asked {:6.3f} N  sent {:6.3f} N ",
      tick.t, to_string(tick.state), tick.proxy.x(), tick.proxy.y(), tick.proxy.z(),
      tick.force.norm(), record.force.norm());
  std::fflush(stderr);
}

bool is_loopback(std::string_view address) {
  return address.substr(0, 4) == "127." || address == "::1";
}

void show_in_browser(const std::string& url) {
  if (std::getenv("DISPLAY") == nullptr && std::getenv("WAYLAND_DISPLAY") == nullptr) return;
  std::string program = "xdg-open";
  std::string argument = url;
  std::array<char*, 3> arguments = {program.data(), argument.data(), nullptr};
  pid_t pid = 0;
  // Without a browser the person still has the address.
  static_cast<void>(
      posix_spawnp(&pid, program.c_str(), nullptr, nullptr, arguments.data(), environ));
}

std::unique_ptr<ViewerServer> open_server(const RunOptions& options, ViewerHost& host) {
  ViewerOptions viewer{
      .listen = options.listen, .port = options.port.value_or(usual_port), .token = options.token};
  if (options.token.empty() && !is_loopback(options.listen)) viewer.token = make_token();
  try {
    return std::make_unique<ViewerServer>(viewer, host);
  } catch (const Error&) {
    if (options.port) throw;
    viewer.port = 0;  // another program has the usual one
    return std::make_unique<ViewerServer>(viewer, host);
  }
}

// All that a session can run: `ideal`, the lab's ruler, needs the truth.
MethodRegistry session_methods() {
  const MethodRegistry all = program_methods();
  MethodRegistry methods("method", "", {});
  for (const MethodInfo& method : all.entries()) {
    if (method.name != "ideal") methods.add(method);
  }
  return methods;
}

// Can it run faster than time? Only where nothing but simulations and recordings takes part.
bool can_run_freely(const RunOptions& options) {
  for (const std::string& uri : options.cameras) {
    if (open_source(uri)->info().live) return false;
  }
  const std::string scheme = Uri(options.device.empty() ? "hand:" : options.device).scheme();
  return scheme == "hand" || scheme == "script";
}

SessionOptions session_options(const RunOptions& options) {
  if (!(options.rate >= 100.0 && options.rate <= 100000.0))
    throw Error("--rate", fmt::format("{} Hz is not a servo rate", options.rate),
                "give 100 to 100000, or 500 to 10000 in real time");
  if (options.duration && !(*options.duration >= 0.1 && *options.duration <= 86400.0))
    throw Error("--duration", fmt::format("{} s is too short or too long", *options.duration),
                "give 0.1 to 86400 s");
  SessionOptions session;
  session.methods = session_methods();
  const auto [name, parameters] = options.method.choice(session.methods);
  for (const std::string& uri : options.cameras) session.cameras.push_back({.uri = uri});
  session.device_uri = !options.device.empty() ? options.device
                       : options.headless      ? "hand:"
                                               : "mouse:";
  session.settings.method = name;
  session.settings.parameters = parameters;
  session.servo.rate = options.rate;
  session.record = options.record;
  session.version = PALPATE_VERSION;
  if (options.headless) {
    if (can_run_freely(options)) session.pace = Pace::free_running;
    session.stroke_time = std::max(options.duration.value_or(headless_duration), 2.0);
  }
  return session;
}

// Prints how the recording ended and the summary.
int finish(Session& session, bool json) {
  const SessionState state = session.state();
  if (!state.recording.message.empty())
    fmt::print(stderr, "palpate: {}\n", state.recording.message);
  std::fputs(json ? json_of(state.summary).c_str() : text_of(state.summary).c_str(), stdout);
  return state.recording.failed ? 1 : 0;
}

int run(const RunOptions& options) {
  // Before any other thread begins, so that these signals come to this one alone.
  std::atomic<Session*> running{nullptr};
  std::atomic<bool> ended{false};
  const EndingSignals signals([&] {
    ended = true;
    if (Session* session = running.load()) session->request_stop();
  });

  SessionHost host(PALPATE_VERSION);
  SessionOptions wanted = session_options(options);
  if (!options.headless)
    wanted.on_frame = [&host](std::size_t camera, const FedFrame& frame) {
      host.show(camera, frame);
    };
  const bool is_bounded = wanted.methods.find(wanted.settings.method).bounded;
  const bool is_free = wanted.pace == Pace::free_running;
  Session session(std::move(wanted));
  running = &session;
  if (ended) return finish(session, options.json);
  if (!is_bounded)
    fmt::print(stderr, "palpate: {} is a method of the lab: its ticks can come late\n",
               session.settings().method);

  if (options.headless) {
    const bool watched = isatty(STDERR_FILENO) == 1;
    const auto ticks_a_line = static_cast<std::uint64_t>(std::max(options.rate / 10.0, 1.0));
    session.run(options.duration.value_or(headless_duration), [&](const ServoTick& record) {
      if (watched && is_free && record.number % ticks_a_line == 0) show_status(record);
    });
    if (watched && is_free) fmt::print(stderr, "\n");
    running = nullptr;
    return finish(session, options.json);
  }

  session.start();
  for (const std::string& line : session.realtime()->advice)
    fmt::print(stderr, "palpate: {}\n", line);
  {
    host.attach(session);
    const std::unique_ptr<ViewerServer> server = open_server(options, host);
    host.show_on(server.get());
    fmt::print(stderr, "palpate: open {} in a browser; Ctrl-C ends the session\n", server->url());
    if (!options.no_browser && isatty(STDERR_FILENO) == 1) show_in_browser(server->url());
    session.run(options.duration);
    host.show_on(nullptr);
  }
  running = nullptr;
  return finish(session, options.json);
}

}  // namespace

Verb add_run(CLI::App& program) {
  CLI::App* command = program.add_subcommand("run", "touch a scene");
  const auto options = std::make_shared<RunOptions>();
  command
      ->add_option("--camera", options->cameras,
                   "where frames come from (synthetic:desk?noise=1mm); may be given several times")
      ->allow_extra_args(false);
  command->add_option("--device", options->device,
                      "the hand: mouse: in the page (the default), hand: a simulated person (the "
                      "default of --headless), script:FILE.csv a path");
  command->add_option("--duration", options->duration,
                      "seconds of the session (until Ctrl-C; headless 10)");
  command->add_option("--rate", options->rate, "ticks a second (1000)");
  command->add_option("--listen", options->listen,
                      "address at which browsers find the page (127.0.0.1: this machine's alone)");
  command->add_option("--port", options->port,
                      "port of the page (8642, or any if that is taken; 0: any)");
  command->add_option("--token", options->token,
                      "what a page must know; made up if --listen lets other machines in");
  command->add_flag("--no-browser", options->no_browser, "only say where the page is");
  command->add_option("--record", options->record,
                      "write the session into this folder, a ROS 2 bag; palpate replay checks it");
  command->add_flag("--headless", options->headless,
                    "no page; recordings and simulations run as fast as the machine can");
  command->add_flag("--json", options->json, "print the summary as a JSON object");
  options->method.add_to(*command);
  return {command, [options] { return run(*options); }};
}

}  // namespace palpate::app
