// SPDX-License-Identifier: Apache-2.0
#include "palpate/net/viewer/session_host.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <span>
#include <system_error>

#include <nlohmann/json.hpp>

#include "palpate/io/devices/mouse_device.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/io/sources/virtual_camera.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/kernel/core/uri.hpp"
#include "palpate/record/session_reader.hpp"
#include "palpate/servo/placement.hpp"
#include "palpate/servo/stiffness.hpp"

namespace palpate {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(PortEnergy, made, generating)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(SceneChoice, uri, meaning, group)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Playback, paused, loop, speed)

using nlohmann::json;

template <class Owner>
static void to_json(json& shown, const ParameterRow<Owner>& row) {
  shown = {{"name", row.name},       {"symbol", row.symbol},
           {"unit", row.unit},       {"default", row.default_value},
           {"min", row.min},         {"max", row.max},
           {"meaning", row.meaning}, {"source", row.source}};
}

static void to_json(json& shown, const MethodInfo& method) {
  shown = {{"name", method.name}, {"meaning", method.summary}};
}

static void to_json(json& shown, const FlagInfo& flag) {
  shown = {{"name", flag.name}, {"meaning", flag.meaning}};
}

static void to_json(json& shown, const CameraStatus& camera) {
  shown = {{"uri", camera.uri},
           {"kind", camera.kind},
           {"sensor", name_of(camera.sensor)},
           {"rate", camera.rate},
           {"state", camera.text},
           {"stays_valid", camera.stays_valid},
           {"dropped", camera.dropped},
           {"frames", camera.recorded},
           {"place", camera.place},
           {"time", camera.recorded_time}};
}

static void to_json(json& shown, const Dab& dab) {
  shown = {{"place", dab.place},
           {"normal", dab.normal},
           {"radius", dab.radius},
           {"material", dab.material}};
}

static void to_json(json& shown, const FixtureSet::Item& item) {
  const Fixture& fixture = item.fixture;
  json pose = json::array();  // row by row
  for (int i = 0; i < 12; ++i) pose.push_back(fixture.world_from_fixture(i / 4, i % 4));
  Vec3 size = fixture.size;
  json points = json::array();
  if (fixture.shape == FixtureShape::mesh) {  // its box
    Eigen::AlignedBox3d box;
    for (const Vec3& point : fixture.points) box.extend(point);
    size = box.sizes();
    const Vec3 middle = fixture.world_from_fixture * box.center();
    for (int axis = 0; axis < 3; ++axis)
      pose[static_cast<std::size_t>(4 * axis + 3)] = middle[axis];
  } else {
    points = fixture.points;
  }
  shown = {{"name", fixture.name},
           {"kind", fixture_kind_names()[static_cast<std::size_t>(fixture.kind)]},
           {"shape", fixture_shape_names()[static_cast<std::size_t>(fixture.shape)]},
           {"pose", pose},
           {"size", size},
           {"radius", fixture.radius},
           {"length", fixture.length},
           {"points", points}};
}

namespace {

constexpr double samples_per_second = 200.0;  // of the page's plots
constexpr std::array<const char*, 7> tools = {
    "ball",        "box:40x20x5mm",    "box:30x30x30mm", "capsule:80x8mm", "cylinder:40x20mm",
    "cone:60x6mm", "gripper:40x30x8mm"};

template <class Owner>
json values_json(std::span<const ParameterRow<Owner>> table, const Owner& owner) {
  json values;
  for (const auto& row : table) values[std::string(row.name)] = row.get(owner);
  return values;
}

std::string realtime_text(const RealtimeReport& report) {
  std::string text = report.fifo ? "real-time, priority " + std::to_string(report.priority)
                                 : "not real-time; see palpate doctor";
  if (report.core >= 0) text += ", core " + std::to_string(report.core);
  return text;
}

json servo_json(const Session& session, const SessionState& state) {
  const CycleStatistics& cycles = session.statistics();
  json servo = {{"rate", state.rate},
                {"ticks", cycles.ticks.load()},
                {"late_ticks", state.hands.front().summary.late_ticks},
                {"frames_adopted", cycles.frames_adopted.load()},
                {"frames_dropped", cycles.frames_dropped.load()}};
  if (const Timing* timing = session.timing()) {
    servo["realtime"] = realtime_text(*session.realtime());
    servo["compute_p99"] = 1e-9 * static_cast<double>(timing->compute.quantile(0.99));
    servo["wake_up_p99"] = 1e-9 * static_cast<double>(timing->wake_up.quantile(0.99));
  }
  return servo;
}

// t [s from its first frame], x, y, z [m] of the hand in a recording; empty if it has none.
std::vector<float> path_of(const std::string& uri) {
  constexpr std::size_t most_places = 4000;
  std::vector<float> path;
  if (Uri(uri).scheme() != "recording") return path;
  try {
    const double first = open_source(uri)->info().start_time;
    for (const Tick& hand : recorded_hand(Uri(uri).path(), most_places)) {
      path.push_back(static_cast<float>(hand.t - first));
      for (int axis = 0; axis < 3; ++axis) path.push_back(static_cast<float>(hand.hip[axis]));
    }
  } catch (const Error&) {  // a bag without a hand, or a damaged one: its frames may still do
    path.clear();
  }
  return path;
}

std::string_view stricter_text(std::string_view limit) {
  constexpr std::array<std::string_view, 3> names{"lower", "higher", ""};
  return names[static_cast<std::size_t>(stricter_direction(limit))];
}

namespace fs = std::filesystem;

constexpr std::uint64_t keep_free = 100'000'000;  // [bytes] of the disk

bool is_simple_name(const std::string& name) {
  return !name.empty() && name.size() <= DroppedFiles::longest_name && name.front() != '.' &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '.' || c == '-' || c == '_';
         });
}

std::string megabytes(std::uint64_t bytes) {
  return std::to_string((bytes + 999'999) / 1'000'000) + " MB";
}

fs::path make_folder() {
  std::string name = (fs::temp_directory_path() / DroppedFiles::folder_prefix).string() + "XXXXXX";
  if (mkdtemp(name.data()) == nullptr)
    throw Error(name, "cannot be made", "set TMPDIR to a folder that can be written");
  return name;
}

}  // namespace

void SessionHost::attach(Session& session) {
  bounds_.emplace(session.settings().safety, rules_.operator_limits);
  recordings_ = std::make_unique<ObserverRecordings>(session, rules_.recordings);
  session_ = &session;
  first_tool_ = session.settings().tool;
  mouse_ = session.mouse();
  if (mouse_ != nullptr) target_ = start_ = mouse_->start_position();
  reader_.emplace(session.ticks());
  for (std::size_t hand = 1; hand < session.hands(); ++hand)
    others_.push_back({.reader = session.ticks(hand)});
  const double rate = session.state().rate;
  batcher_.emplace(static_cast<unsigned>(std::max(1.0, rate / samples_per_second)));
}

void SessionHost::show_on(ViewerServer* server) {
  server_.store(server, std::memory_order_release);
  if (server == nullptr) return;
  const std::vector<CameraStatus> cameras = session_->state().cameras;
  for (std::size_t i = 0; i < cameras.size() && i < Patch::max_views; ++i) {
    std::vector<float> path = path_of(cameras[i].uri);
    if (!path.empty())
      server->show(static_cast<std::uint8_t>(i),
                   path_message(static_cast<std::uint8_t>(i), std::move(path)));
  }
}

json SessionHost::hello() {
  json safety = safety_parameter_table();
  for (json& row : safety) row["stricter"] = stricter_text(row["name"].get<std::string>());
  json choices = tools;
  if (first_tool_ &&
      std::find(choices.begin(), choices.end(), first_tool_->text()) == choices.end())
    choices.push_back(first_tool_->text());
  const std::uint64_t most = rules_.files && rules_.open_scene ? rules_.files->limit() : 0;
  return {{"file_limit", most},
          {"scenes", rules_.scenes},
          {"notice", rules_.notice},
          {"splat", Uri(session_->state().cameras.front().uri).scheme() == "splat"},
          {"version", version_},
          {"methods", session_->methods().entries()},
          {"tools", choices},
          {"parameters", parameter_table()},
          {"safety", safety},
          {"placement", placement_table()},
          {"flags", tick_flag_table()},
          {"safety_flags", safety_flag_table()}};
}

void SessionHost::forbid(const Forbid& wanted) {
  if (!touched_)
    throw Error("fixture", "nothing has been touched yet",
                "touch the object that is to be forbidden");
  Fixture region{.name = {},
                 .kind = FixtureKind::forbidden,
                 .shape = FixtureShape::seen,
                 .size = Vec3::Constant(wanted.size)};
  region.world_from_fixture.translation() = *touched_;
  region.numbers.margin = wanted.margin;
  add_fixture(std::move(region), "keep off");
}

void SessionHost::guide(const Guide& wanted) {
  constexpr double shortest = 0.01;  // [m] from end to end of a path; else it is a place
  if (stroke_.empty())
    throw Error("fixture", "there was no contact yet", "slide along the path of the guide first");
  double length = 0.0;
  for (std::size_t i = 1; i < stroke_.size(); ++i) length += (stroke_[i] - stroke_[i - 1]).norm();
  Fixture line{.name = {}, .kind = FixtureKind::guide, .shape = FixtureShape::point};
  if (length >= shortest) {
    line.shape = FixtureShape::path;
    line.points = stroke_;
  } else {
    line.world_from_fixture.translation() = stroke_.back();
  }
  set_parameter(line.numbers, "slack", wanted.slack);
  add_fixture(std::move(line), length >= shortest ? "stroke" : "place");
}

void SessionHost::add_fixture(Fixture fixture, const std::string& name) {
  session_->change([&](ServoSettings& settings) {
    std::vector<Fixture> all =
        settings.fixtures ? settings.fixtures->fixtures() : std::vector<Fixture>{};
    const auto is_taken = [&] {
      return std::any_of(all.begin(), all.end(),
                         [&](const Fixture& other) { return other.name == fixture.name; });
    };
    for (int number = 1; fixture.name.empty() || is_taken(); ++number)
      fixture.name = name + " " + std::to_string(number);
    all.push_back(std::move(fixture));
    settings.fixtures = std::make_shared<const FixtureSet>(all);
  });
}

void SessionHost::remove_fixture(const std::string& name) {
  session_->change([&](ServoSettings& settings) {
    std::vector<Fixture> all =
        settings.fixtures ? settings.fixtures->fixtures() : std::vector<Fixture>{};
    if (std::erase_if(all, [&](const Fixture& fixture) { return fixture.name == name; }) == 0)
      throw Error("fixture '" + name + "'", "there is no fixture of that name",
                  "see the list on the page");
    settings.fixtures = all.empty() ? nullptr : std::make_shared<const FixtureSet>(all);
  });
}

// The names of what the first camera's surfaces can be painted with.
std::vector<std::string> SessionHost::paintable() const {
  const auto clouds = session_->newest_clouds();
  return clouds.empty() || !clouds.front() ? std::vector<std::string>{}
                                           : Paint::names(*clouds.front());
}

// The recording that was made last, to be touched; empty while there is none that is whole.
std::string SessionHost::recorded_scene(const RecordingState& recording) const {
  if (!rules_.open_scene || recording.on || recording.closing || recording.failed ||
      recording.folder.empty())
    return {};
  const bool has_mark = recording.folder.find('?') != std::string::npos;  // of options, in a URI
  return "recording:" + recording.folder + (has_mark ? "?" : "");
}

// A scale that somebody chose is asked about no more.
void SessionHost::look_at_points(const std::string& uri) {
  if (proposed_) return;
  const auto clouds = session_->newest_clouds();
  const auto* points =
      clouds.empty() ? nullptr : dynamic_cast<const PointCloud*>(clouds.front().get());
  if (points == nullptr) return;
  proposed_ = proposed_touch(*points);
  const bool may_open = rules_.open_scene && !rules_.scenes.empty() && clouds.size() == 1;
  if (may_open && proposed_->scale != 1.0 && !Uri(uri).has("scale"))
    rescaled_uri_ = rescaled(uri, proposed_->scale);
}

void SessionHost::rescale(double times) {
  const std::vector<CameraStatus> cameras = session_->state().cameras;
  const bool may_open = rules_.open_scene && cameras.size() == 1 && times > 0.0;
  const std::string uri = may_open ? rescaled(cameras.front().uri, times) : std::string();
  if (uri.empty())
    throw Error("scale", "it can be changed only of one mesh, splat or point file on its own",
                "restart the program with ?scale= in --camera");
  rules_.open_scene(uri);
}

json SessionHost::recording_json(const RecordingState& recording) const {
  json shown = {{"path", nullptr},
                {"message", recording.message},
                {"ended", recording_ended()},
                {"seconds", recording.seconds},
                {"bytes", recording.bytes},
                {"room", nullptr},
                {"open", nullptr}};
  if (recording.on) shown["path"] = recording.folder;
  if (const auto room = recordings_ ? recordings_->room() : std::nullopt) shown["room"] = *room;
  if (const std::string uri = recorded_scene(recording); !uri.empty()) shown["open"] = uri;
  return shown;
}

json SessionHost::state() {
  SessionState state = session_->state();
  look_at_points(state.cameras.front().uri);
  show_tool(state.settings.tool);
  const SessionHandState& first = state.hands.front();
  const auto playing = std::find_if(state.cameras.begin(), state.cameras.end(),
                                    [](const CameraStatus& camera) { return camera.recorded > 1; });
  json playback;
  if (playing != state.cameras.end()) playback = playing->playback;
  json points;
  if (proposed_)
    points = {{"extent", proposed_->extent},
              {"spacing", proposed_->spacing},
              {"scale", proposed_->scale},
              {"rescaled", rescaled_uri_}};
  json fixtures = json::array();
  if (state.settings.fixtures) fixtures = state.settings.fixtures->items();
  json brush;
  if (brush_) brush = {{"material", brush_->material}, {"radius", brush_->radius}};
  const DeviceInfo& device = session_->device().info();
  const std::vector<std::string> warnings =
      stiffness_warnings(device, state.settings.parameters.coupling.stiffness,
                         state.settings.placement.workspace_scale, state.rate);
  return {{"method", state.settings.method},
          {"tool", state.settings.tool ? state.settings.tool->text() : "ball"},
          {"parameters", values_json(parameter_table(), state.settings.parameters)},
          {"safety", values_json(safety_parameter_table(), state.settings.safety)},
          {"placement", values_json(placement_table(), state.settings.placement)},
          {"cameras", state.cameras},
          {"playback", playback},
          {"points", points},
          {"device",
           {{"uri", device.uri},
            {"kind", device.kind},
            {"takes_hand", mouse_ != nullptr},
            {"fault", first.trouble},
            {"warnings", warnings}}},
          {"servo", servo_json(*session_, state)},
          {"interventions", first.interventions},
          {"latched_by", names_of(flags_in(first.latched_by, safety_flag_table()))},
          {"on_hold", state.held},
          {"flag_ticks", first.summary.flag_ticks},
          {"pop_throughs", first.summary.pop_throughs},
          {"energy",
           {{"contacts", first.summary.energy.contacts},
            {"relative", first.summary.energy.relative},
            {"absolute", first.summary.energy.absolute}}},
          {"fixtures", fixtures},
          {"paint",
           {{"brush", brush},
            {"dabs", session_->paint().dabs()},
            {"materials", paintable()},
            {"trouble", brush_trouble_}}},
          {"recording", recording_json(state.recording)}};
}

json SessionHost::robot() {
  const std::optional<RobotPicture> robot = rules_.robot ? rules_.robot() : std::nullopt;
  if (!robot) return {};
  json tool;
  if (robot->tool) tool = *robot->tool;
  return {{"name", robot->name},       {"tool", tool},
          {"links", robot->links},     {"force", robot->force},
          {"radius", robot->radius},   {"age", robot->age},
          {"latency", robot->latency}, {"led", robot->led},
          {"trouble", robot->trouble}};
}

json SessionHost::more_hands() {
  if (others_.empty()) return {};
  json hands = json::array();
  for (std::size_t i = 0; i < others_.size(); ++i) {
    Other& other = others_[i];
    while (other.reader.try_pop(other.newest)) {
    }
    const Tick& tick = other.newest.tick;
    hands.push_back({{"name", session_->hand_name(i + 1)},
                     {"hip", tick.hip},
                     {"proxy", tick.proxy},
                     {"force", other.newest.force},
                     {"touches", tick.state != ContactState::free_motion},
                     {"present", (other.newest.hand & hand_present) != 0},
                     {"trouble", describe(fault_of(other.newest.hand))}});
  }
  return hands;
}

// To all pages, if it is another than before.
void SessionHost::show_tool(const std::shared_ptr<const ToolShape>& tool) {
  ViewerServer* server = server_.load(std::memory_order_acquire);
  if (server == nullptr || tool == tool_) return;
  tool_ = tool;
  server->show(0, tool_message(tool.get()));
}

std::optional<TickBatch> SessionHost::ticks() {
  const ServoSettings settings = session_->settings();
  // [m] between the proxy and what it touches; a tool touches with its own surface.
  const double radius = settings.tool ? 0.0 : settings.parameters.proxy.r_c();
  const bool has_torque = session_->device().info().limits.max_torque > 0.0;
  for (ServoTick record{}; reader_->try_pop(record);) {
    if (!has_torque) record.torque = record.gain * record.tick.torque;  // shown, never felt
    batcher_->add(record, radius);
    paint(record, radius);  // each, so that a stroke is the same however often it is drawn
  }
  return batcher_->take();
}

// Keeps the stroke in as few places as a guide may have, however long it becomes.
void SessionHost::follow(const Tick& tick, const Vec3& foot) {
  constexpr double finest = 0.002;   // [m]
  constexpr std::size_t most = 128;  // places
  if (tick.force.isZero()) {
    stroke_is_over_ = true;
    return;
  }
  if (std::exchange(stroke_is_over_, false)) {
    stroke_.clear();
    stroke_spacing_ = finest;
  }
  if (!stroke_.empty() && (foot - stroke_.back()).norm() < stroke_spacing_) return;
  stroke_.push_back(foot);
  if (stroke_.size() < most) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < stroke_.size(); i += 2) stroke_[kept++] = stroke_[i];
  stroke_.resize(kept);
  stroke_spacing_ *= 2.0;
}

// Along a stroke, a dab in each third of the brush's radius.
void SessionHost::paint(const ServoTick& record, double contact_radius) {
  const Tick& tick = record.tick;
  const Vec3 foot = tick.proxy - contact_radius * tick.normal;
  follow(tick, foot);
  if (!tick.force.isZero()) touched_ = foot;
  if (!brush_ || tick.force.isZero()) {
    dabbed_.reset();
    return;
  }
  if (dabbed_ && (foot - *dabbed_).norm() < brush_->radius / 3.0) return;
  dabbed_ = foot;
  try {
    if (brush_->material.empty())
      session_->paint().erase(foot, brush_->radius);
    else
      session_->paint().add({.place = foot,
                             .radius = brush_->radius,
                             .normal = tick.normal,
                             .material = brush_->material});
    brush_trouble_.clear();
  } catch (const Error& error) {  // full
    brush_trouble_ = error.what();
  }
}

void SessionHost::hand(const HandMessage& hand) {
  if (mouse_ == nullptr) return;
  if (hand.target) {
    const Placement placement = session_->settings().placement;
    if (hand.orientation)
      turn_ = Eigen::Quaterniond(placement.world_from_device.linear().transpose() *
                                 hand.orientation->toRotationMatrix());
    const Vec3 place =
        placement.world_from_device.inverse() * *hand.target / placement.workspace_scale;
    if (is_place(place)) target_ = place;
  }
  mouse_->aim({.position = target_, .orientation = turn_, .present = hand.held});
}

void SessionHost::command(const Command& command, Role role) {
  if (const auto* set = std::get_if<SetParameter>(&command)) {
    session_->change([&](ServoSettings& settings) {
      set_parameter(settings.parameters, set->name, set->value);
    });
  } else if (const auto* limit = std::get_if<SetSafetyParameter>(&command)) {
    bounds_->check(limit->name, limit->value, role);
    session_->change([&](ServoSettings& settings) {
      set_parameter(settings.safety, limit->name, limit->value);
    });
    if (role == Role::operating) bounds_->set_by_operator(limit->name, limit->value);
  } else if (const auto* place = std::get_if<SetPlacement>(&command)) {
    session_->change([&](ServoSettings& settings) {
      set_placement(settings.placement, place->name, place->value);
    });
  } else if (const auto* method = std::get_if<SetMethod>(&command)) {
    session_->change([&](ServoSettings& settings) { settings.method = method->name; });
  } else if (const auto* tool = std::get_if<SetTool>(&command)) {
    // A page names no files: of meshes it has the session's own.
    const bool is_first = first_tool_ && first_tool_->text() == tool->text;
    const auto chosen = is_first ? first_tool_ : make_tool(tool->text, {});
    session_->change([&](ServoSettings& settings) { settings.tool = chosen; });
  } else if (const auto* record = std::get_if<SetRecording>(&command)) {
    record->on ? recordings_->start() : recordings_->stop();
  } else if (const auto* play = std::get_if<SetPlayback>(&command)) {
    session_->set_playback({.paused = play->paused, .loop = play->loop, .speed = play->speed});
  } else if (const auto* scene = std::get_if<OpenScene>(&command)) {
    const bool is_offered =
        std::any_of(rules_.scenes.begin(), rules_.scenes.end(),
                    [&](const SceneChoice& choice) { return choice.uri == scene->uri; });
    const bool is_recorded =
        !scene->uri.empty() && scene->uri == recorded_scene(session_->state().recording);
    const bool is_proposed = !scene->uri.empty() && scene->uri == rescaled_uri_;
    if (!(is_offered || is_recorded || is_proposed) || !rules_.open_scene)
      throw Error("scene", "'" + scene->uri + "' is not among those of this session",
                  "choose one of the list, or restart the program with --camera");
    rules_.open_scene(scene->uri);
  } else if (const auto* longer = std::get_if<Rescale>(&command)) {
    rescale(longer->times);
  } else if (const auto* seek = std::get_if<Seek>(&command)) {
    session_->seek(seek->share);
  } else if (const auto* brush = std::get_if<SetBrush>(&command)) {
    check_range("brush", "radius", "m", Paint::smallest, Paint::largest, brush->radius);
    const std::vector<std::string> names = paintable();
    if (!brush->material.empty() &&
        std::find(names.begin(), names.end(), brush->material) == names.end())
      static_cast<void>(standard_material(brush->material));  // throws, naming the nearest
    brush_ = *brush;
    dabbed_.reset();
  } else if (std::holds_alternative<DropBrush>(command)) {
    brush_.reset();
  } else if (std::holds_alternative<ClearPaint>(command)) {
    session_->paint().clear();
    dabbed_.reset();
  } else if (const auto* wanted = std::get_if<Forbid>(&command)) {
    forbid(*wanted);
  } else if (const auto* along = std::get_if<Guide>(&command)) {
    guide(*along);
  } else if (const auto* fixture = std::get_if<RemoveFixture>(&command)) {
    remove_fixture(fixture->name);
  } else if (std::holds_alternative<ResetFaults>(command)) {
    session_->reset_faults();
  } else if (mouse_ != nullptr) {
    turn_.reset();
    mouse_->aim({.position = target_ = start_, .present = false});
  }
}

std::vector<Body::DrawnGaussian> SessionHost::gaussians() {
  const CameraStatus camera = session_->state().cameras.front();
  if (!camera.body) return {};
  const Uri uri(camera.uri);
  return camera.body->gaussians(uri.has("pose")
                                    ? parse_pose(uri.text_option("pose", ""), camera.uri)
                                    : Eigen::Isometry3d::Identity());
}

std::filesystem::path SessionHost::begin_file(const std::string& name, std::uint64_t size) {
  if (!rules_.files || !rules_.open_scene)
    throw Error(name, "this session opens no files", "start the program with --camera");
  return rules_.files->begin(name, size);
}

void SessionHost::end_file(const std::filesystem::path& file, bool whole) {
  if (whole)
    rules_.open_scene(uri_of_file(file));
  else
    rules_.files->abandon(file);
}

void SessionHost::show(std::size_t number, const FedFrame& fed) {
  ViewerServer* server = server_.load(std::memory_order_acquire);
  const auto camera = static_cast<std::uint8_t>(number);
  // A still image came first before there was a server: what is shown again then is new to it.
  if (server == nullptr || (!fed.is_new && numbers_[camera] > 0)) return;
  const DepthImage* image = fed.frame.cloud->image();
  if (image == nullptr && fed.frame.cloud->point_cloud() == nullptr) return;
  if (image != nullptr && image->intrinsics().distorted() && numbers_[camera] == 0)
    server->show(camera, rays_message(camera, image->rays()));
  server->show(camera, frame_message(camera, numbers_[camera]++, fed.frame));
}

DroppedFiles::~DroppedFiles() {
  std::error_code unused;
  if (!folder_.empty()) fs::remove_all(folder_, unused);
}

fs::path DroppedFiles::begin(const std::string& name, std::uint64_t size) {
  if (!is_simple_name(name))
    throw Error("file", "its name is too long, or has other characters than letters and digits",
                "rename it");
  static_cast<void>(uri_of_file(name));  // refuses other kinds
  std::uint64_t sum = size;
  for (const File& file : files_) sum += file.size;
  if (size > limit_ || sum > limit_)
    throw Error(
        name,
        "is of " + megabytes(size) + ", and the page may send " + megabytes(limit_) + " in all",
        "start the program with --camera and the file's path");
  if (folder_.empty()) folder_ = make_folder();
  std::error_code error;
  const fs::space_info space = fs::space(folder_, error);
  if (!error && space.available < size + keep_free)
    throw Error(folder_.string(), "has no room for " + megabytes(size), "free some, or set TMPDIR");
  // A folder of its own: the name is what the person knows the file by.
  const fs::path folder = folder_ / std::to_string(++count_);
  fs::create_directory(folder, error);
  if (error) throw Error(folder.string(), "cannot be made: " + error.message());
  return files_.emplace_back(File{folder / name, size}).path;
}

void DroppedFiles::abandon(const fs::path& file) {
  std::error_code unused;
  fs::remove(file, unused);
  std::erase_if(files_, [&](const File& other) { return other.path == file; });
}

}  // namespace palpate
