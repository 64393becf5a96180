// SPDX-License-Identifier: Apache-2.0
// A whole session: cameras, device, method, safety chain, recorder.
#include "palpate/session/session.hpp"

#include <algorithm>
#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/io/sources/fixture_file.hpp"
#include "palpate/io/sources/tool_file.hpp"
#include "palpate/kernel/cloud/proposed_touch.hpp"
#include "palpate/kernel/core/error.hpp"

#include "python/arrays.hpp"

namespace palpate::python {
namespace {

using namespace py::literals;

// How long a wait lasts before Python is asked for signals.
constexpr std::chrono::milliseconds session_pause{50};
// Ticks of a free-running session between two looks at signals.
constexpr std::size_t session_batch = 4096;

void set_limits(SafetyParameters& limits, const py::dict& values) {
  for (const auto& [name, value] : numbers_of(values)) set_parameter(limits, name, value);
  validate(limits);
}

// Of a TOML file, or of the text of one.
std::shared_ptr<const FixtureSet> fixtures_of(const std::optional<std::string>& what) {
  if (!what || what->empty()) return nullptr;
  return std::make_shared<const FixtureSet>(what->find("[[fixture]]") != std::string::npos
                                                ? parse_fixtures(*what, "fixtures", {})
                                                : read_fixtures(*what));
}

// A further hand: the URI of its device, or a dict with keys of [[hand]].
HandSpec hand_of(const py::handle& what) {
  HandSpec hand;
  if (py::isinstance<py::str>(what)) {
    hand.device = py::cast<std::string>(what);
    return hand;
  }
  const auto values = py::cast<py::dict>(what);
  std::vector<std::string_view> known;
  HandSpec::walk_keys(hand, [&](const Key& key, auto& value) {
    using Value = std::remove_reference_t<decltype(value)>;
    known.push_back(key.name);
    if (!values.contains(key.name)) return;
    const py::object given = values[py::str(key.name)];
    if constexpr (std::is_same_v<Value, Eigen::Isometry3d>)
      value = pose_of(py::cast<Numbers>(given), "world_from_device");
    else
      value = py::cast<Value>(given);
  });
  for (const auto& [key, value] : values) {
    const auto name = py::cast<std::string>(key);
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw Error("hands", "a hand has no '" + name + "'", did_you_mean(name, known));
  }
  return hand;
}

// Asks a Python function, on a camera's thread, which of the materials each pixel is.
// @param labels  called with the camera's number and its depth; gives labels or None
auto labelled(const MaterialsOf& materials, const py::function& labels) {
  return [materials, held = kept(labels)](std::size_t camera, const DepthImage& image) {
    const py::gil_scoped_acquire lock;
    try {
      const Intrinsics& k = image.intrinsics();
      const py::array_t<std::uint16_t> depth({k.height, k.width}, image.depth().data());
      const py::object found = (*held)(camera, depth);
      return found.is_none() ? nullptr : make_map(k, materials, found, py::none());
    } catch (py::error_already_set& error) {  // of the interpreter, which is locked here alone
      throw Error("labels", error.what(), "return uint8 (height, width), or None");
    }
  };
}

class PythonSession {
 public:
  PythonSession(const py::object& camera, const std::string& device, const std::string& method,
                bool free_running, double rate, const std::string& record, double stroke_time,
                const std::optional<Numbers>& world_from_device, double scale,
                const py::dict& limits, bool without_watchdog,
                const std::optional<std::string>& fixtures, const py::iterable& hands,
                const std::optional<MaterialsOf>& materials,
                const std::optional<py::function>& labels, const std::string& tool,
                const py::kwargs& parameters)
      : free_running_(free_running) {
    SessionOptions options;
    const bool are_several = py::isinstance<py::list>(camera) || py::isinstance<py::tuple>(camera);
    for (const py::handle& one : are_several ? camera : py::make_tuple(camera)) {
      const bool is_uri = py::isinstance<py::str>(one);
      options.cameras.push_back({.uri = is_uri ? py::cast<std::string>(one) : ""});
      options.open_cameras.push_back(
          is_uri ? nullptr : open_python_source(py::reinterpret_borrow<py::object>(one)));
    }
    options.hands[0].device = device;
    options.method = method;
    options.tool = tool;
    set_all(options.parameters, parameters);
    for (const auto& [name, value] : parameters)
      options.radii_chosen = options.radii_chosen || is_proxy_radius(py::cast<std::string>(name));
    set_limits(options.safety, limits);
    Placement& placement = options.hands[0].placement;
    placement.workspace_scale = scale;
    if (world_from_device)
      placement.world_from_device = pose_of(*world_from_device, "world_from_device");
    options.fixture_set = fixtures_of(fixtures);
    options.rate = rate;
    options.pace = free_running ? Pace::free_running : Pace::real_time;
    options.without_watchdog = without_watchdog;
    options.stroke_time = stroke_time;
    options.record = record;
    options.version = PALPATE_VERSION;
    for (const py::handle& hand : hands) options.hands.push_back(hand_of(hand));
    if (materials.has_value() != labels.has_value())
      throw Error("materials, labels", "one is of no use without the other",
                  "give materials=palpate.Materials(...) and labels=FUNCTION");
    if (labels) options.materials = labelled(*materials, *labels);
    ran_.resize(options.hands.size());
    if (free_running_)
      options.on_tick = [this](std::size_t hand, const ServoTick& tick) {
        if (hand > 0) ran_[hand].push_back(record_of(tick));
      };
    const py::gil_scoped_release released;
    session_.emplace(std::move(options));
    for (std::size_t i = 0; i < ran_.size(); ++i) readers_.push_back(session_->ticks(i));
  }

  ~PythonSession() { stop(); }
  PythonSession(const PythonSession&) = delete;
  PythonSession& operator=(const PythonSession&) = delete;

  void start() {
    const py::gil_scoped_release released;
    if (!free_running_) session_->start();  // else its ticks are those of `run`
  }

  void stop() {
    const py::gil_scoped_release released;
    session_->stop();
  }

  void run(const std::optional<double>& duration) {
    const py::gil_scoped_release released;
    if (free_running_) {
      std::size_t count = 0;
      session_->run(duration, [&](const ServoTick& tick) {
        ran_.front().push_back(record_of(tick));
        if (++count % session_batch == 0) check_signals();
      });
      return;
    }
    session_->start();
    const auto end =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(duration.value_or(1e9));
    while (std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(session_pause);
      check_signals();
    }
    session_->stop();
  }

  py::array ticks(std::size_t hand) {
    if (hand >= ran_.size())
      throw Error("hand " + std::to_string(hand), "the session has none of this number",
                  "give 0 to " + std::to_string(ran_.size() - 1));
    if (free_running_) return array_of(std::exchange(ran_[hand], {}));
    std::vector<CycleRecord> records;
    ServoTick tick;
    while (readers_[hand].try_pop(tick)) records.push_back(record_of(tick));
    return array_of(records);
  }
  [[nodiscard]] std::uint64_t lost() const {
    std::uint64_t lost = 0;
    for (const auto& reader : readers_) lost += reader.lost();
    return lost;
  }

  void set(const std::optional<std::string>& method, const std::optional<std::string>& tool,
           const py::kwargs& values) {
    const auto numbers = numbers_of(values);
    const py::gil_scoped_release released;
    const auto shape = tool ? read_tool(*tool) : nullptr;
    session_->change([&](ServoSettings& settings) {
      if (method) settings.method = *method;
      if (tool) settings.tool = shape;
      for (const auto& [name, value] : numbers) set_parameter(settings.parameters, name, value);
    });
  }
  void fixtures(const std::optional<std::string>& what) {
    const py::gil_scoped_release released;
    const auto set = fixtures_of(what);
    session_->change([&](ServoSettings& settings) { settings.fixtures = set; });
  }
  void limit(const py::kwargs& values) {
    const auto numbers = numbers_of(values);
    const py::gil_scoped_release released;
    session_->change([&](ServoSettings& settings) {
      for (const auto& [name, value] : numbers) set_parameter(settings.safety, name, value);
    });
  }

  py::dict state() {
    const SessionState now = [this] {
      const py::gil_scoped_release released;
      return session_->state();
    }();
    py::list cameras;
    for (const CameraStatus& camera : now.cameras)
      cameras.append(py::dict("uri"_a = camera.uri, "kind"_a = camera.kind, "state"_a = camera.text,
                              "rate"_a = camera.rate, "frames"_a = camera.frames,
                              "dropped"_a = camera.dropped, "latency"_a = camera.latency,
                              "trouble"_a = camera.trouble, "doubt"_a = camera.doubt));
    const RecordingState& recording = now.recording;
    const Summary& summary = now.hands[0].summary;
    py::dict interventions;
    for (std::size_t i = 0; i < safety_flag_count; ++i) {
      if (now.hands[0].interventions[i] > 0)
        interventions[py::str(std::string(safety_flag_table()[i].name))] =
            now.hands[0].interventions[i];
    }
    py::list hands;
    for (const SessionHandState& hand : std::span(now.hands).subspan(1))
      hands.append(py::dict("name"_a = hand.name, "ticks"_a = hand.summary.ticks,
                            "contact_ticks"_a = hand.summary.contact_ticks,
                            "largest_force"_a = hand.summary.largest_sent,
                            "latched_by"_a = hand.latched_by, "trouble"_a = hand.trouble));
    return py::dict(
        "running"_a = now.running, "rate"_a = now.rate, "method"_a = now.settings.method,
        "cameras"_a = cameras,
        "recording"_a = py::dict("on"_a = recording.on, "folder"_a = recording.folder,
                                 "message"_a = recording.message, "failed"_a = recording.failed,
                                 "closing"_a = recording.closing),
        "ticks"_a = summary.ticks, "late_ticks"_a = summary.late_ticks,
        "contact_ticks"_a = summary.contact_ticks, "largest_force"_a = summary.largest_sent,
        "pop_throughs"_a = summary.pop_throughs, "interventions"_a = interventions,
        "latched_by"_a = now.hands[0].latched_by, "more_hands"_a = hands);
  }

  py::list clouds() {
    py::list all;
    for (const auto& cloud : session_->newest_clouds())
      all.append(py::cast(std::const_pointer_cast<Cloud>(cloud)));
    return all;
  }
  void reset_faults() { session_->reset_faults(); }
  void start_recording(const std::string& folder) {
    const py::gil_scoped_release released;
    session_->start_recording(folder);
  }
  void stop_recording() { session_->stop_recording(); }

 private:
  bool free_running_;
  std::optional<Session> session_;
  // Of each hand:
  std::vector<TickRing<ServoTick>::Reader> readers_;
  std::vector<std::vector<CycleRecord>> ran_;
};

}  // namespace

void define_session(py::module_& m) {
  py::class_<PythonSession>(
      m, "Session",
      "Cameras, a device, a method, the safety chain and a recorder as one object.\n\n"
      "    with palpate.Session('synthetic:desk', device='hand:') as session:\n"
      "        session.run(5.0)\n\n"
      "`with` starts it, and takes the force off the device before anything else at the end.")
      .def(py::init<const py::object&, const std::string&, const std::string&, bool, double,
                    const std::string&, double, const std::optional<Numbers>&, double,
                    const py::dict&, bool, const std::optional<std::string>&, const py::iterable&,
                    const std::optional<MaterialsOf>&, const std::optional<py::function>&,
                    const std::string&, const py::kwargs&>(),
           py::arg("camera"), py::arg("device") = "hand:", py::kw_only(),
           py::arg("method") = "sight", py::arg("free_running") = false, py::arg("rate") = 1000.0,
           py::arg("record") = "", py::arg("stroke_time") = 20.0,
           py::arg("world_from_device") = py::none(), py::arg("scale") = 1.0,
           py::arg("limits") = py::dict(), py::arg("without_watchdog") = false,
           py::arg("fixtures") = py::none(), py::arg("hands") = py::tuple(),
           py::arg("materials") = py::none(), py::arg("labels") = py::none(), py::arg("tool") = "",
           "camera: a URI, an object to iterate over that gives (DepthImage or PointCloud, stamp\n"
           "[s]), or a list of these; an object's attribute `live`, if True, says that the\n"
           "stamps are time.monotonic(). device: a URI. free_running: as fast as the machine\n"
           "can, with the same forces each time. limits: of the safety chain (palpate.limits()).\n"
           "fixtures: a TOML file of virtual fixtures, or its text. hands: further hands, each a\n"
           "device's URI or a dict with keys of [[hand]] (docs/session.md); while one of the\n"
           "hands is in trouble, none has a force. labels: a function that is called with a\n"
           "camera's number and depth for each of its frames, and returns uint8 (height, width),\n"
           "0 for none and i for the i-th of `materials`. tool: what touches, such as\n"
           "\"box:40x20x5mm\" (docs/tools.md); empty: a ball. Further keywords are parameters\n"
           "(palpate.parameters()).")
      .def("__enter__",
           [](const py::object& self) {
             py::cast<PythonSession&>(self).start();
             return self;
           })
      .def("__exit__", [](PythonSession& self, const py::args&) { self.stop(); })
      .def("start", &PythonSession::start, "Starts loop and cameras, and returns.")
      .def("stop", &PythonSession::stop,
           "Takes the force off the device, then ends everything. Any number of times.")
      .def("run", &PythonSession::run, py::arg("duration") = py::none(),
           "Runs for `duration` [s], or until Ctrl-C, and stops.")
      .def("ticks", &PythonSession::ticks, py::arg("hand") = 0,
           "The cycles of a hand since the last call, as a structured array. Call it at least "
           "every few\n"
           "seconds: the last 8192 are kept; of a free-running session, all of them.")
      .def_property_readonly(
          "lost", &PythonSession::lost,
          "How many cycles were overwritten before `ticks` was called, of all hands.")
      .def("state", &PythonSession::state, "How the session does: a dict.")
      .def("clouds", &PythonSession::clouds, "What each camera saw last; None before that.")
      .def("set", &PythonSession::set, py::arg("method") = py::none(), py::arg("tool") = py::none(),
           "Changes method, tool and parameters in the next tick; the contact stays, but not that\n"
           "of a tool which is inside a surface: it feels nothing until it is free.")
      .def("fixtures", &PythonSession::fixtures, py::arg("fixtures"),
           "Other virtual fixtures from the next tick on: a TOML file, its text, or None for none.")
      .def("limit", &PythonSession::limit, "Changes limits of the safety chain.")
      .def("reset_faults", &PythonSession::reset_faults, "Ends a latched fault.")
      .def("start_recording", &PythonSession::start_recording, py::arg("folder"))
      .def("stop_recording", &PythonSession::stop_recording,
           "Returns at once; state()['recording'] says when all is written.");
}

}  // namespace palpate::python
