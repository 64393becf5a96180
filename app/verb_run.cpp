// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <spawn.h>
#include <unistd.h>

#include "app/opened_scenes.hpp"
#include "app/remarks.hpp"
#include "app/running_session.hpp"
#include "app/signals.hpp"
#include "app/verbs.hpp"
#include "palpate/io/sources/scene.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/net/viewer/session_host.hpp"

namespace palpate::app {
namespace {

constexpr double noticed_force = 1.0;  // [N] that anybody feels

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

std::unique_ptr<ViewerServer> open_server(const ServerConfig& config, std::uint16_t usual_port,
                                          ViewerHost& host) {
  ViewerOptions viewer{.listen = config.listen,
                       .port = static_cast<std::uint16_t>(config.port.value_or(usual_port)),
                       .token = config.token,
                       .operator_token = config.operator_token};
  try {
    return std::make_unique<ViewerServer>(viewer, host);
  } catch (const Error&) {
    if (config.port) throw;
    viewer.port = 0;  // another program has the usual one
    return std::make_unique<ViewerServer>(viewer, host);
  }
}

PageRules page_rules(const SessionConfig& config) {
  static_cast<void>(LimitBounds(config.safety, config.operator_limits));  // refuses what is wrong
  PageRules rules;
  rules.operator_limits = config.operator_limits;
  rules.recordings.folder = config.record_folder;
  rules.recordings.limit = 1e9 * config.record_limit;
  return rules;
}

// What the operator's page can choose: what the program was started with, what was opened last,
// and the built-in scenes.
std::vector<SceneChoice> scene_choices(const std::vector<CameraSpec>& given,
                                       const OpenedScenes& opened) {
  const std::string& first = given.front().uri;
  std::vector<SceneChoice> choices = {{first, "what the program was started with"}};
  for (std::string& uri : opened.uris()) {
    if (uri != first && uri != absolute_uri(first))
      choices.push_back({std::move(uri), "opened last", "Opened last"});
  }
  for (const SceneInfo& scene : known_scenes()) {
    std::string uri = "synthetic:" + std::string(scene.name);
    if (uri != first)
      choices.push_back({std::move(uri), std::string(scene.summary), "Built-in scenes"});
  }
  return choices;
}

// How points without an image were felt, or why they were not.
void say_of_points(const Cloud& cloud, Session& session, const SessionConfig& config) {
  const double r_c = session.settings().parameters.proxy.r_c();
  std::vector<std::string> remarks;
  if (!config.radii_chosen) remarks.push_back(radius_remark(cloud, r_c));
  if (session.state().hands[0].summary.largest_sent < noticed_force)
    remarks.push_back(sparse_remark(cloud, config.cameras.front().uri, r_c));
  for (const std::string& remark : remarks) {
    if (!remark.empty())
      fmt::print(stderr, "palpate: {}: {}\n", config.cameras.front().uri, remark);
  }
}

int run_headless(const RunOptions& options, const SessionConfig& config, GuardedDevices guarded,
                 Running& running) {
  OpenedSession opened(options, config, std::move(guarded), running);
  Session& session = opened.session;
  if (running.ended) return finish(session, options.json);
  bool is_shown = false;
  const bool watched = isatty(STDERR_FILENO) == 1;
  const auto ticks_a_line = static_cast<std::uint64_t>(std::max(config.rate / 10.0, 1.0));
  session.run(options.duration.value_or(headless_duration), [&](const ServoTick& record) {
    if (!watched || record.number % ticks_a_line != 0) return;
    is_shown = true;
    show_status(record);
  });
  if (is_shown) fmt::print(stderr, "\n");
  if (const auto seen = session.newest_clouds().front()) say_of_points(*seen, session, config);
  return finish(session, options.json);
}

// The page's addresses for other machines, and one of them for a phone's camera.
void print_reach(const ServerConfig& config, const ViewerServer& server) {
  const std::vector<std::string> addresses = reachable_addresses(config.listen);
  if (addresses.empty()) {
    fmt::print(stderr,
               "palpate: no other computer can reach this one: it has no network address\n");
    return;
  }
  for (const std::string& address : addresses)
    fmt::print(stderr, "palpate: from another computer or a phone, open {}\n", server.url(address));
  if (isatty(STDERR_FILENO) == 1)
    std::fputs(qr_code(server.url(addresses.front())).c_str(), stderr);
}

void print_links(const ServerConfig& config, const ViewerServer& server) {
  fmt::print(stderr, "palpate: open {} in a browser; Ctrl-C ends the session\n",
             server.operator_url());
  fmt::print(stderr,
             "palpate: that is the operator's link; for viewing or controlling the HIP, open {}\n",
             server.url());
  if (!is_loopback(config.listen)) {
    print_reach(config, server);
    fmt::print(stderr,
               "palpate: tokens and images are sent unencrypted; see --listen in palpate run "
               "--help for a tunnel\n");
  }
  if (config.browser && isatty(STDERR_FILENO) == 1) show_in_browser(server.opening_url());
}

// What follows one session with its page.
struct Ending {
  std::optional<std::string> scene = {};  // to be touched next; none: the program ends
  int status = 0;
};

// @param config  gets port and tokens of the page, for the session that follows
Ending run_page(const RunOptions& options, SessionConfig& config, GuardedDevices guarded,
                PageRules rules, bool is_first, Running& running) {
  std::mutex mutex;
  std::optional<std::string> chosen;  // guarded by it
  rules.open_scene = [&](const std::string& uri) {
    const std::lock_guard lock(mutex);
    chosen = uri;
    if (Session* now = running.session) now->request_stop();
  };
  SessionHost host(PALPATE_VERSION, std::move(rules));
  OpenedSession opened(
      options, config, std::move(guarded), running,
      [&host](std::size_t camera, const FedFrame& frame) { host.show(camera, frame); }, is_first);
  Session& session = opened.session;
  if (running.ended) return {.status = finish(session, options.json)};
  std::string ended_recording;
  session.start();
  if (is_first) {
    for (const std::string& line : session.realtime()->advice)
      fmt::print(stderr, "palpate: {}\n", line);
  }
  {
    host.attach(session);
    struct Detach {
      SessionHost& host;
      ~Detach() { host.detach(); }
    } const after_the_server{host};
    const std::unique_ptr<ViewerServer> server =
        open_server(config.server, options.usual_port, host);
    host.show_on(server.get());
    if (is_first && !options.whose_page.empty())
      fmt::print(stderr, "palpate: {} {}\n", options.whose_page, server->operator_url());
    else if (is_first)
      print_links(config.server, *server);
    config.server.port = server->port();
    session.run(options.duration);
    host.show_on(nullptr);
    ended_recording = host.recording_ended();
  }
  if (chosen && !running.ended) return {.scene = chosen};
  return {.status = finish(session, options.json, ended_recording)};
}

// Session after session, as the operator's page chooses other scenes.
int run_pages(const RunOptions& options, SessionConfig config, GuardedDevices guarded,
              Running& running) {
  // The links stay good from one session to the next.
  ServerConfig& server = config.server;
  if (server.operator_token.empty()) server.operator_token = make_token();
  if (server.token.empty() && !is_loopback(server.listen)) server.token = make_token();
  const std::vector<CameraSpec> given = config.cameras;
  std::vector<CameraSpec> before = given;
  // A device with motors is opened once: its hand is somewhere, and its guard is another process.
  const std::string& device = config.hands.front().device;
  const bool may_choose = !options.beside.attach && config.hands.size() == 1 &&
                          (device.empty() || Uri(device).scheme() == "mouse");
  PageRules rules = page_rules(config);
  rules.robot = options.beside.robot;
  if (may_choose) rules.files = std::make_shared<DroppedFiles>();
  OpenedScenes opened(std::filesystem::temp_directory_path() / DroppedFiles::folder_prefix);
  for (bool is_first = true;; is_first = false) {
    Ending ending;
    if (config.cameras.size() == 1) opened.add(config.cameras.front().uri);
    if (may_choose) rules.scenes = scene_choices(given, opened);
    try {
      ending = run_page(options, config, std::exchange(guarded, {}), rules, is_first, running);
    } catch (const Error& error) {
      opened.remove(config.cameras.front().uri);
      if (is_first || config.cameras.front().uri == before.front().uri) throw;
      rules.notice = error.what();
      config.cameras = before;
      continue;
    }
    if (!ending.scene) return ending.status;
    fmt::print(stderr, "palpate: now {}\n", *ending.scene);
    rules.notice.clear();
    before = config.cameras;
    config.cameras = *ending.scene == given.front().uri
                         ? given
                         : std::vector<CameraSpec>{{.uri = *ending.scene}};
    config.record.clear();  // the recording of --record has ended with its session
  }
}

}  // namespace

int run_session(const RunOptions& options, const SessionConfig& config) {
  GuardedDevices guarded = guarded_devices(config);
  // Before any other thread begins, so that these signals come to this one alone.
  Running running;
  const EndingSignals signals([&] { running.end(); });
  return options.headless ? run_headless(options, config, std::move(guarded), running)
                          : run_pages(options, config, std::move(guarded), running);
}

Verb add_run(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "run", "run a session with the page: touch cameras, recordings or simulated scenes");
  const auto options = std::make_shared<RunOptions>();
  options->add_to(*command, "no page; recordings and simulations run as fast as the computer can");
  return {command, [options] {
            const SessionConfig config = options->session.config(session_methods());
            return prints_config(*options, config) ? 0 : run_session(*options, config);
          }};
}

}  // namespace palpate::app
