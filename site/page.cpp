// SPDX-License-Identifier: Apache-2.0
// A session in a page's Worker: what the program's server is to its pages, for one page, without
// threads. worker.js calls what is exported here and posts what comes out of it.
#include "site/page.hpp"

#include <array>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include <emscripten.h>
#include <nlohmann/json.hpp>

#include "palpate/io/sources/scene.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/net/viewer/session_host.hpp"
#include "palpate/record/replay.hpp"
#include "palpate/session/session.hpp"

// clang-format off
EM_JS(void, post_text, (const char* text), { palpatePost(UTF8ToString(text)); })
EM_JS(void, post_bytes, (const void* head, std::size_t head_size, const void* payload,
                         std::size_t payload_size, const void* colour, std::size_t colour_size), {
  const bytes = new Uint8Array(head_size + payload_size + colour_size);
  bytes.set(HEAPU8.subarray(head, head + head_size), 0);
  bytes.set(HEAPU8.subarray(payload, payload + payload_size), head_size);
  bytes.set(HEAPU8.subarray(colour, colour + colour_size), head_size + payload_size);
  palpatePost(bytes.buffer);
})
EM_JS(void, post_splat, (const void* gaussians, std::size_t size), {
  const splat = HEAPU8.slice(gaussians, gaussians + size).buffer;
  palpateSend({ splat : splat }, [splat]);
})
EM_JS(void, post_file, (const char* path), { palpatePostFile(UTF8ToString(path)); })
// What a function of worker.js makes of bytes, if it fits into `to`; 0 if not.
EM_JS(std::size_t, convert, (const char* by, const void* from, std::size_t size, void* to,
                             std::size_t room), {
  try {
    const bytes = palpateConvert[UTF8ToString(by)](HEAPU8.slice(from, from + size), room);
    if (bytes.length > room) return 0;
    HEAPU8.set(bytes, to);
    return bytes.length;
  } catch (error) {
    return 0;
  }
})
// clang-format on

namespace palpate {
namespace {

constexpr double pages_interval = 0.033;  // [s] between messages of ticks, as the server's
constexpr int ticks_per_state = 6;        // of these messages for one of the state
constexpr double hand_timeout = 2.0;      // [s] pages repeat a held hand several times a second
constexpr std::uint32_t max_ahead = 2;    // frames sent that the page has not drawn yet
// [bytes] of all files that are opened in one page: they lie in its memory
constexpr std::uint64_t most_file_bytes = 500'000'000;

void post(const ViewerMessage& message) {
  if (message.text) {
    const auto* text = reinterpret_cast<const char*>(message.head.data());
    post_text(std::string(text, message.head.size()).c_str());
    return;
  }
  const auto colour =
      message.colour ? std::as_bytes(std::span(message.colour->rgb)) : std::span<const std::byte>();
  post_bytes(message.head.data(), message.head.size(), message.payload.data(),
             message.payload.size(), colour.data(), colour.size());
}

void post(std::string_view verb, const nlohmann::json& what) {
  post(text_message(nlohmann::json{{verb, what}}));
}

// With the one role that there is here.
void post_as_operator(std::string_view verb, nlohmann::json what) {
  what["role"] = to_string(Role::operating);
  post(verb, what);
}

// Frames wait here until the page has drawn those before.
struct Camera {
  std::optional<ViewerMessage> frame;
  std::uint32_t sent = 0, shown = 0;  // frames

  void offer() {
    if (!frame || sent - shown >= max_ahead) return;
    post(*std::exchange(frame, std::nullopt));
    ++sent;
  }
};

// Of the scene that is touched; there is one page and one thread.
std::array<Camera, Patch::max_views>& cameras() {
  static std::array<Camera, Patch::max_views> all;
  return all;
}

}  // namespace

class ViewerServer::Impl {};

ViewerServer::ViewerServer(const ViewerOptions& /*options*/, ViewerHost& /*host*/) {
  cameras() = {};
}

ViewerServer::~ViewerServer() = default;

void ViewerServer::show(std::uint8_t camera, ViewerMessage message) {
  if (!message.is_frame) return post(message);
  cameras()[camera].frame = std::move(message);
  cameras()[camera].offer();
}

namespace site {
namespace {

// The depth camera of the device that shows the page (WebXR): its newest frame, until that is read.
std::optional<Frame>& newest_depth() {
  static std::optional<Frame> frame;
  return frame;
}
constexpr const char* page_camera = "webxr:";

class PageCamera final : public Source {
 public:
  std::optional<Frame> next(double /*timeout*/) override {
    return std::exchange(newest_depth(), std::nullopt);
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  SourceInfo info_{.uri = page_camera,
                   .kind = "depth camera of this device",
                   .live = true,
                   .clock = StampClock::session};
};

// A scene that is touched, from its opening to the next one's.
class Scene {
 public:
  Scene(const std::string& uri, std::function<void(const std::string&)> open,
        std::shared_ptr<DroppedFiles> files)
      : host_(PALPATE_VERSION, rules_of(uri, std::move(open), std::move(files))),
        session_(options_of(uri)),
        server_({}, host_) {
    host_.attach(session_);
    post_as_operator("hello", host_.hello());
    tell_presence();
    host_.show_on(&server_);
  }
  ~Scene() { host_.show_on(nullptr); }

  void advance(double t) {
    t_ = t;
    session_.advance(t);
    if (t - beaten_ < pages_interval) return;
    beaten_ = t;
    if (holds_ && t - heard_ > hand_timeout) release({});
    if (const auto batch = host_.ticks()) post(ticks_message(*batch));
    if (++beats_ % ticks_per_state == 0) tell_state();
  }

  [[nodiscard]] const ServoTick& tick() {
    while (ticks_.try_pop(tick_)) {
    }
    return tick_;
  }

  void lead(const HandMessage& hand) {
    if (!hand.held) {
      if (holds_) release(hand);
      return;
    }
    heard_ = t_;
    host_.hand(hand);
    if (!std::exchange(holds_, true)) tell_presence();
  }

  void take(std::span<const std::byte> bytes) {
    const auto message = parse_binary(bytes);
    if (!message) return;
    if (const auto* shown = std::get_if<ShownMessage>(&*message)) {
      if (shown->camera >= Patch::max_views) return;
      Camera& camera = cameras()[shown->camera];
      camera.shown = camera.sent;
      camera.offer();
    } else {
      lead(std::get<HandMessage>(*message));
    }
  }

  std::vector<Body::DrawnGaussian> gaussians() { return host_.gaussians(); }

  void command(std::string_view text) {
    if (text == R"({"replay":true})") return replay_recording();
    const std::optional<Command> command = parse_command(text);
    if (!command) return;
    host_.command(*command, Role::operating);
    tell_state();
  }

 private:
  static PageRules rules_of(const std::string& uri, std::function<void(const std::string&)> open,
                            std::shared_ptr<DroppedFiles> files) {
    PageRules rules{
        .open_scene = std::move(open),
        .files = std::move(files),
        .notice =
            "This page runs palpate by itself, in your browser. For cameras, other haptic "
            "devices, robots and ROS 2, run the program: scripts/run."};
    rules.recordings = {
        .folder = "/recordings", .limit = most_file_bytes, .keep_free = 0.0, .own_thread = false};
    rules.scenes.push_back({uri, "what is touched now"});
    for (const SceneInfo& scene : known_scenes())
      rules.scenes.push_back(
          {"synthetic:" + std::string(scene.name), std::string(scene.summary), "Built-in scenes"});
    return rules;
  }

  SessionOptions options_of(const std::string& uri) {
    SessionOptions options;
    options.cameras = {{.uri = uri}};
    options.sources.add({.name = "webxr",
                         .summary = "webxr:, the depth camera of this device",
                         .open = [](const Uri&) { return std::make_unique<PageCamera>(); }});
    options.hands = {{.device = "mouse:"}};
    options.pace = Pace::free_running;
    options.on_frame = [this](std::size_t camera, const FedFrame& frame) {
      host_.show(camera, frame);
    };
    return options;
  }

  // What `palpate replay` says, of the recording that is touched.
  void replay_recording() {
    const std::string uri = session_.state().cameras.front().uri;
    SessionReader reader(Uri(uri).path());
    post("notice", text_of(replay(reader)));
  }

  void release(const HandMessage& farewell) {
    holds_ = false;
    host_.hand(farewell);
    tell_presence();
  }
  void tell_presence() {
    post("presence", {{"hand", holds_ ? "you" : "free"}, {"viewers", 1}});
    tell_state();
  }
  void tell_state() {
    host_.look_at_recordings();
    post_as_operator("state", host_.state());
    const RecordingState recording = session_.state().recording;
    if (recording.on || recording.failed || recording.folder == offered_) return;
    offered_ = recording.folder;
    for (const auto& file : std::filesystem::directory_iterator(offered_))
      if (file.path().extension() == ".mcap") post_file(file.path().c_str());
  }

  SessionHost host_;
  Session session_;
  ViewerServer server_;
  TickRing<ServoTick>::Reader ticks_ = session_.ticks();
  ServoTick tick_{};
  double t_ = 0.0, beaten_ = 0.0, heard_ = 0.0;  // [s] since the scene was opened
  bool holds_ = false;
  int beats_ = 0;
  std::string offered_;  // the recording that the page was given last
};

// All that the Worker has.
struct Page {
  std::shared_ptr<DroppedFiles> files = std::make_shared<DroppedFiles>(most_file_bytes);
  std::unique_ptr<Scene> scene;
  std::string wanted;   // scene that is to be opened; empty: none
  std::string shown;    // the scene that is touched
  double opened = 0.0;  // [s] on the Worker's clock
};

Page& page() {
  static Page one;
  return one;
}

// What throws becomes a message of the page.
template <class Do>
bool tried(const Do& act) {
  try {
    act();
    return true;
  } catch (const std::exception& error) {
    post("error", error.what());
    return false;
  }
}

std::vector<std::byte> converted(const char* by, std::span<const std::byte> from,
                                 std::size_t max_bytes) {
  std::vector<std::byte> bytes(max_bytes);
  bytes.resize(convert(by, from.data(), from.size(), bytes.data(), max_bytes));
  return bytes;
}

}  // namespace

std::vector<std::byte> unpack_zstd(std::span<const std::byte> packed, std::size_t max_bytes) {
  return converted("unzstd", packed, max_bytes);
}

std::vector<std::byte> unpack_zlib(std::span<const std::byte> packed, std::size_t max_bytes) {
  return converted("unzlib", packed, max_bytes);
}

std::vector<std::byte> unpack_gzip(std::span<const std::byte> packed, std::size_t max_bytes) {
  std::uint32_t size = 0;  // of its content, which it ends with
  if (packed.size() < sizeof size) return {};
  std::memcpy(&size, &packed[packed.size() - sizeof size], sizeof size);
  return size > max_bytes ? std::vector<std::byte>() : converted("gunzip", packed, size);
}

std::vector<std::byte> pack_zlib(std::span<const std::byte> bytes) {
  return converted("zlib", bytes, bytes.size() + bytes.size() / 1000 + 64);
}

}  // namespace site
}  // namespace palpate

using palpate::site::page;
using palpate::site::tried;

extern "C" {

/// Opens a scene in place of the one before, which stays where this one cannot be opened.
/// @return whether it is open
EMSCRIPTEN_KEEPALIVE bool palpate_open(const char* uri, double now) {
  const double before = std::exchange(page().opened, now);
  const bool is_open = tried([&] {
    page().scene = std::make_unique<palpate::site::Scene>(
        palpate::source_uri(uri), [](const std::string& wanted) { page().wanted = wanted; },
        page().files);
    page().shown = uri;
  });
  if (!is_open) page().opened = before;
  return is_open;
}

/// @param now  [s] on the Worker's clock
EMSCRIPTEN_KEEPALIVE void palpate_advance(double now) {
  if (page().scene) tried([&] { page().scene->advance(now - page().opened); });
  if (const std::string uri = std::exchange(page().wanted, {}); !uri.empty())
    palpate_open(uri.c_str(), now);
}

EMSCRIPTEN_KEEPALIVE void palpate_take(const std::byte* bytes, std::size_t size) {
  if (page().scene) tried([&] { page().scene->take({bytes, size}); });
}

EMSCRIPTEN_KEEPALIVE void palpate_command(const char* text) {
  if (page().scene) tried([&] { page().scene->command(text); });
}

/// A frame of the device's own depth camera, which is touched from the first one on.
/// @param depth   [mm] row by row
/// @param camera  focal lengths and principal point [px]
/// @param pose    world_from_camera of the optical frame [m], 4 x 4, column by column
/// @param now     [s] on the Worker's clock
EMSCRIPTEN_KEEPALIVE void palpate_depth(int width, int height, const std::uint16_t* depth,
                                        const double* camera, const double* pose, double now) {
  tried([&] {
    using namespace palpate;
    const bool is_shown = page().shown == site::page_camera;
    const Eigen::Map<const Eigen::Matrix4d> matrix(pose);
    Eigen::Isometry3d world_from_camera(Eigen::Translation3d(matrix.topRightCorner<3, 1>()));
    world_from_camera.rotate(
        Eigen::Quaterniond(Eigen::Matrix3d(matrix.topLeftCorner<3, 3>())).normalized());
    site::newest_depth() = {
        .stamp = is_shown ? now - page().opened : 0.0,
        .cloud = std::make_shared<DepthImage>(
            std::make_shared<const ViewingRays>(
                Intrinsics{width, height, camera[0], camera[1], camera[2], camera[3]}),
            std::vector<std::uint16_t>(depth, depth + std::ptrdiff_t{width} * height), 1000.0,
            world_from_camera)};
    if (!is_shown) palpate_open(site::page_camera, now);
  });
}

/// Gives the page what it draws of the splat that is touched.
EMSCRIPTEN_KEEPALIVE void palpate_splat() {
  if (!page().scene) return;
  const auto gaussians = page().scene->gaussians();
  post_splat(gaussians.data(), gaussians.size() * sizeof(gaussians.front()));
}

/// Where a hand is to be [m, world], or that it was let go.
EMSCRIPTEN_KEEPALIVE void palpate_hand(bool held, double x, double y, double z) {
  if (!page().scene) return;
  palpate::HandMessage hand{.held = held};
  if (held) hand.target = palpate::Vec3(x, y, z);
  tried([&] { page().scene->lead(hand); });
}

/// The newest tick: HIP, proxy, normal and force in world axes, the state, and the time.
EMSCRIPTEN_KEEPALIVE const double* palpate_tick() {
  static std::array<double, 14> numbers;
  if (!page().scene) return numbers.data();
  const palpate::ServoTick& tick = page().scene->tick();
  Eigen::Map<Eigen::Matrix<double, 3, 4>>(numbers.data()) << tick.tick.hip, tick.tick.proxy,
      tick.tick.normal, tick.force;
  numbers[12] = static_cast<double>(tick.tick.state);
  numbers[13] = tick.tick.t;
  return numbers.data();
}

/// @return where the file goes, or the content of a .zip; empty: it is refused
EMSCRIPTEN_KEEPALIVE const char* palpate_begin_file(const char* name, double size) {
  static std::string path;
  static int zips = 0;
  path.clear();
  tried([&] {
    const std::filesystem::path wanted(name);
    path = wanted.extension() == ".zip"
               ? "/zips/" + std::to_string(++zips) + "/" + wanted.stem().string()
               : page().files->begin(name, static_cast<std::uint64_t>(size)).string();
  });
  return path.c_str();
}

/// It is there: it is opened by the next `palpate_advance`.
EMSCRIPTEN_KEEPALIVE void palpate_end_file(const char* path) {
  tried([&] { page().wanted = palpate::source_uri(path); });
}

}  // extern "C"
