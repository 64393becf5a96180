// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/options.hpp"
#include "app/program.hpp"
#include "app/progress.hpp"
#include "app/remarks.hpp"
#include "app/signals.hpp"
#include "app/summary_text.hpp"
#include "app/verbs.hpp"
#include "palpate/drivers/drivers.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/tool_file.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/sensor.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/session/frame_sequence.hpp"
#include "palpate/session/press.hpp"

namespace palpate::app {
namespace {

struct TraceOptions {
  std::vector<std::string> cameras;
  std::optional<std::string> material;
  std::string path;
  std::optional<std::string> tool;
  std::string press, slide_to;
  PressOptions pressing;
  std::string out = "-";
  double rate = 1000.0;
  bool json = false;
  MethodOptions method;
};

// Writes ticks as CSV, one row each, numbers in the shortest form that reads back to the same bits.
// The columns are those of the header line.
class TraceWriter {
 public:
  static constexpr const char* header =
      "t,hip_x,hip_y,hip_z,proxy_x,proxy_y,proxy_z,normal_x,normal_y,normal_z,"
      "force_x,force_y,force_z,state,steps,surface_velocity,frame,flags";

  // Behind it where a tool has a shape.
  static constexpr const char* tool_header =
      ",hip_qx,hip_qy,hip_qz,hip_qw,proxy_qx,proxy_qy,proxy_qz,proxy_qw,"
      "torque_x,torque_y,torque_z";

  // @param path  where to, `-` for standard output. @throws Error if it cannot be opened.
  TraceWriter(const std::string& path, bool has_tool)
      : path_(path == "-" ? "standard output" : path),
        has_tool_(has_tool),
        file_(path == "-" ? stdout : std::fopen(path.c_str(), "wb")) {
    if (file_ == nullptr)
      throw Error(path, std::string("cannot be written: ") + std::strerror(errno),
                  "give a file in a folder that you may write to");
    buffer_ = std::string(header) + (has_tool_ ? tool_header : "") + '\n';
  }
  ~TraceWriter() {
    if (file_ != stdout) std::fclose(file_);
  }
  TraceWriter(const TraceWriter&) = delete;
  TraceWriter& operator=(const TraceWriter&) = delete;

  // @throws std::runtime_error if nothing more can be written (a full disk).
  void write(const Tick& tick) {
    append(tick.t);
    append(tick.hip);
    append(tick.proxy);
    append(tick.normal);
    append(tick.force);
    buffer_ += to_string(tick.state);
    buffer_ += ',';
    append(tick.steps);
    append(tick.surface_velocity);
    append(tick.frame);
    append(tick.flags);
    if (has_tool_) {
      for (const Rotation* turn : {&tick.orientation, &tick.proxy_orientation})
        for (int i = 0; i < 4; ++i) append(turn->coeffs()[i]);
      append(tick.torque);
    }
    buffer_.back() = '\n';
    if (buffer_.size() >= buffered) flush();
  }
  // Where the rows go, for people.
  [[nodiscard]] const std::string& name() const { return path_; }
  // Flushes the buffer; the trace is complete after it. Throws as `write`.
  void finish() {
    flush();
    check(std::fflush(file_) == 0);
  }

 private:
  static constexpr std::size_t buffered = 1U << 16U;  // [bytes]

  template <class Number>
  void append(Number value) {
    std::array<char, 32> text{};
    const auto result = std::to_chars(text.data(), text.data() + text.size(), value);
    buffer_.append(text.data(), result.ptr);
    buffer_ += ',';
  }
  void append(const Vec3& v) {
    for (int axis = 0; axis < 3; ++axis) append(v[axis]);
  }
  void flush() {
    check(std::fwrite(buffer_.data(), 1, buffer_.size(), file_) == buffer_.size());
    buffer_.clear();
  }
  void check(bool written) const {
    if (!written)
      throw std::runtime_error(path_ + ": cannot be written: " + std::strerror(errno) +
                               "; free some space");
  }

  std::string path_;
  bool has_tool_;
  std::FILE* file_;
  std::string buffer_;
};

// A hand that presses what the first camera sees; none: a path is given.
std::optional<Press> press_of(const TraceOptions& options, const FrameSequence& playback) {
  if (options.press.empty()) return std::nullopt;
  PressOptions pressing = options.pressing;
  if (!options.slide_to.empty()) pressing.slide_to = parse_pixel(options.slide_to, "--slide-to");
  return Press(*playback.upcoming(0)->cloud, parse_pixel(options.press, "--press"), pressing);
}

// @throws Error for what cannot be, or not together.
void check(const TraceOptions& options) {
  if (!(options.rate >= 1.0 && options.rate <= 100000.0))
    throw Error("--rate", std::to_string(options.rate) + " Hz is not a tick rate",
                "give 1 to 100000");
  if (options.json && options.out == "-")
    throw Error("--json", "the trace itself goes to standard output", "name a file with --out");
  if (options.path.empty() == options.press.empty())
    throw Error("trace", "it needs one of --path and --press",
                "give a CSV file with --path, or a pixel of the first frame with --press U,V");
  if (options.press.empty() && !options.slide_to.empty())
    throw Error("--slide-to", "there is no --press to slide from", "add --press U,V");
}

Parameters parameters_for(const FrameSequence& playback, const SessionConfig& config) {
  const Parameters parameters = for_sensors(config.parameters, playback.sensors());
  if (config.radii_chosen) return parameters;
  std::vector<const Cloud*> seen;
  for (std::size_t i = 0; i < playback.cameras(); ++i)
    seen.push_back(playback.upcoming(i)->cloud.get());
  return for_points(parameters, seen);
}

void say_notes(const FrameSequence& playback) {
  for (std::size_t camera = 0; camera < playback.cameras(); ++camera) {
    const SourceInfo& about = playback.source(camera).info();
    std::vector<std::string> notes = about.notes;
    if (!about.assumed.empty()) notes.push_back(about.assumed);
    for (const std::string& note : notes) fmt::print(stderr, "palpate: {}: {}\n", about.uri, note);
  }
}

// What is odd about a trace that has ended.
void say_remarks(const TraceOptions& options, const std::optional<Press>& press,
                 const std::vector<std::string>& remarks) {
  if (press && press->pixel() != parse_pixel(options.press, "--press") && options.slide_to.empty())
    fmt::print(
        stderr,
        "palpate: pixel {} has no surface to press: the nearest one that has, {},{}, was pressed\n",
        options.press, press->pixel().u, press->pixel().v);
  for (const std::string& remark : remarks) fmt::print(stderr, "palpate: {}\n", remark);
}

int trace(TraceOptions options) {
  for (std::string& camera : options.cameras)
    camera = with_material(source_uri(camera, all_sources()), options.material);
  check(options);
  FrameSequence playback(options.cameras);
  std::optional<Press> press = press_of(options, playback);
  const std::optional<HipPath> path =
      press ? std::nullopt : std::optional(HipPath::read_csv(options.path));
  say_notes(playback);
  const MethodRegistry methods = program_methods(&playback.source(0));
  const SessionConfig config = options.method.session(methods);
  const std::string& name = config.method;
  const Parameters parameters = parameters_for(playback, config);
  const Cloud& first = *playback.upcoming(0)->cloud;
  const double r_c = parameters.proxy.r_c();
  if (const std::string remark = radius_remark(first, r_c); !config.radii_chosen && !remark.empty())
    fmt::print(stderr, "palpate: {}: {}\n", options.cameras.front(), remark);
  const std::string& tool_text = options.tool ? *options.tool : config.tool;
  const auto tool = tool_text.empty() ? nullptr : read_tool(tool_text);
  const std::unique_ptr<Method> method = make_method(name, parameters, methods, tool);
  const std::string sparse = sparse_remark(first, options.cameras.front(), r_c);
  playback.check(*method);  // before a file is written over
  TraceWriter writer(options.out, tool != nullptr);
  Summary summary;
  TraceRemarks remarks(r_c, press.has_value(), sparse);
  const Interruption interruption;
  // Of a press that is not known before.
  const std::int64_t ticks = path ? ticks_along(*path, options.rate) : 0;
  Progress progress("trace", static_cast<std::size_t>(ticks));
  const auto on_tick = [&](const Tick& tick) {
    writer.write(tick);
    remarks.count(tick, playback.newest());
    summary.count(tick, least_behind(playback.newest(), tick.proxy, r_c), r_c);
    progress.advance();
    return interruption.signal() == 0;
  };
  if (press)
    touch_along(playback, *method, *press, options.rate, on_tick);
  else
    touch_along(playback, *method, *path, options.rate, on_tick);
  summary.frames = playback.adopted();
  writer.finish();
  progress.finish();
  say_remarks(options, press, remarks.lines(playback.shown(), options.cameras));
  const int signal = interruption.signal();
  const bool is_whole = press ? press->done() : summary.ticks == static_cast<std::size_t>(ticks);
  if (!is_whole)
    fmt::print(stderr,
               "palpate: interrupted: {} has {}{} ticks, in complete lines; the same command again "
               "writes the same lines and continues to the end\n",
               writer.name(), summary.ticks, press ? "" : fmt::format(" of {}", ticks));
  std::array<SessionHandState, 1> hand;
  hand[0].summary = summary;
  if (options.json) {
    std::fputs(json_of(hand).c_str(), stdout);
  } else {
    std::fputs(text_of(hand).c_str(), options.out == "-" ? stderr : stdout);
  }
  return is_whole ? 0 : exit_status_of(signal);
}

}  // namespace

Verb add_trace(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "trace",
      "run a HIP path or a press over a source, and write a CSV of ticks; exactly repeatable");
  const auto options = std::make_shared<TraceOptions>();
  add_repeated(*command, "--camera", options->cameras,
               "source of the frames, e.g. tum:DIR; may be given several times")
      ->required();
  command->add_option("--material", options->material,
                      "material of its surfaces, such as wood, or a TOML file");
  command->add_option("--path", options->path,
                      "CSV of the HIP's path: t,x,y,z in s and m, world; with qx,qy,qz,qw, too, "
                      "how the tool is turned");
  command->add_option("--tool", options->tool,
                      "what touches, such as box:40x20x5mm or mesh:FILE.stl?unit=mm (a ball)");
  command->add_option("--press", options->press,
                      "instead of a path: press the surface at this pixel, U,V, in the newest "
                      "frame, along the line of sight, and lift again");
  command->add_option("--slide-to", options->slide_to,
                      "with --press: slide along the surface to this pixel before lifting, U,V");
  command->add_option("--press-depth", options->pressing.depth,
                      "with --press: how far behind the surface [m] (0.008)");
  command->add_option("--press-speed", options->pressing.speed,
                      "with --press: speed down, along and up [m/s] (0.05)");
  command->add_option("--press-hold", options->pressing.hold,
                      "with --press: time to stay before sliding and before lifting [s] (0.5)");
  command->add_option("--out", options->out, "file of the trace, - for standard output");
  command->add_option("--rate", options->rate, "ticks per second (1000)");
  command->add_flag("--json", options->json, "print the summary as a JSON object");
  options->method.add_to(*command);
  return {command, [options] { return trace(*options); }};
}

}  // namespace palpate::app
