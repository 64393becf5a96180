// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "app/live_session.hpp"
#include "app/options.hpp"
#include "app/playback.hpp"
#include "app/program_methods.hpp"
#include "app/run_recording.hpp"
#include "app/scripted_hand.hpp"
#include "app/summary.hpp"
#include "app/verbs.hpp"
#include "palpate/core/error.hpp"
#include "palpate/methods/methods.hpp"

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
void show_status(const Tick& tick) {
  fmt::print(stderr, "\rt {:7.2f} s  {:<12} proxy {:+.3f} {:+.3f} {:+.3f} m  force {:6.3f} N  ",
             tick.t, to_string(tick.state), tick.proxy.x(), tick.proxy.y(), tick.proxy.z(),
             tick.force.norm());
  std::fflush(stderr);
}

HipPath open_hand(const RunOptions& options, const Playback& playback) {
  constexpr std::string_view script = "script:";
  if (!options.device.empty()) {
    if (options.device.substr(0, script.size()) != script)
      throw Error("--device " + options.device, "a headless run has no such hand",
                  "give script:FILE.csv, or none for the built-in one");
    return HipPath::read_csv(options.device.substr(script.size()));
  }
  const auto* image = dynamic_cast<const DepthImage*>(playback.upcoming(0));
  if (image == nullptr)
    throw Error("scripted hand",
                "it follows a depth image, and " + options.cameras.front() + " has none",
                "give a path with --device script:FILE.csv");
  constexpr double press = 0.008;
  return scripted_hand(*image, options.duration.value_or(headless_duration), press);
}

bool is_loopback(std::string_view address) {
  return address.substr(0, 4) == "127." || address == "::1";
}

int run_in_browser(const RunOptions& options) {
  if (options.duration && !(*options.duration > 0.0))
    throw Error("--duration", fmt::format("{} s is no time", *options.duration),
                "give seconds, or nothing to go on until Ctrl-C");
  LiveOptions live;
  live.cameras = options.cameras;
  if (!options.device.empty()) live.device = options.device;
  live.duration = options.duration;
  live.rate = options.rate;
  live.viewer.listen = options.listen;
  live.viewer.port = options.port.value_or(usual_port);
  live.any_port_will_do = !options.port;
  live.viewer.token = options.token;
  if (options.token.empty() && !is_loopback(options.listen)) live.viewer.token = make_token();
  live.open_browser = !options.no_browser;
  live.json = options.json;
  const auto [name, parameters] = options.method.choice(program_methods());
  live.method = name;
  live.parameters = parameters;
  live.record = options.record;
  return run_live(live);
}

int run_headless(const RunOptions& options) {
  const double duration = options.duration.value_or(headless_duration);
  if (!(options.rate >= 100.0 && options.rate <= 100000.0))
    throw Error("--rate", fmt::format("{} Hz is not a servo rate", options.rate),
                "give 100 to 100000");
  if (!(duration >= 2.0 && duration <= 86400.0))
    throw Error("--duration", fmt::format("{} s is too short or too long", duration),
                "give 2 to 86400");
  Playback playback(options.cameras);
  const MethodRegistry methods = program_methods(&playback.source(0));
  const auto [name, parameters] = options.method.choice(methods);
  const HipPath hand = open_hand(options, playback);
  const Vec3 seat = hand.at(hand.first_time());
  const std::unique_ptr<Method> method = make_method(name, parameters, methods);
  playback.check(*method);
  method->seat(seat);
  Summary summary;
  RunRecording recording(options.record,
                         {.cameras = options.cameras, .device = options.device, .seat = seat},
                         {name, parameters, {}, {}}, hand.first_time());
  playback.watch([&recording](double stamp, auto cameras) { recording.frame(stamp, cameras); });

  const bool watched = isatty(STDERR_FILENO) == 1;
  const auto ticks = static_cast<std::int64_t>(duration * options.rate);
  const auto ticks_a_line = static_cast<std::int64_t>(options.rate / 10.0);
  for (std::int64_t i = 0; i < ticks; ++i) {
    const double t = hand.first_time() + static_cast<double>(i) / options.rate;
    playback.adopt_until(t, [&](const Cloud& cloud, double stamp) { method->frame(cloud, stamp); });
    const Tick tick = method->tick(hand.at(t), t);
    recording.tick(tick);
    const double r_c = parameters.proxy.r_c();
    summary.count(tick, playback.adopted(), least_behind(playback.newest(), tick.proxy, r_c), r_c);
    if (watched && i % ticks_a_line == 0) show_status(tick);
  }
  if (watched) fmt::print(stderr, "\n");
  std::fputs(options.json ? summary.json().c_str() : summary.text().c_str(), stdout);
  return recording.finish() ? 0 : 1;
}

int run(const RunOptions& options) {
  return options.headless ? run_headless(options) : run_in_browser(options);
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
                      "the hand: mouse: in the page, script:FILE.csv, hand:FILE.csv; headless a "
                      "script:FILE.csv or a built-in one");
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
                    "no page: as fast as the machine can, with a status line and a summary");
  command->add_flag("--json", options->json, "print the summary as a JSON object");
  options->method.add_to(*command);
  return {command, [options] { return run(*options); }};
}

}  // namespace palpate::app
