// SPDX-License-Identifier: Apache-2.0
// Frames of cameras and recordings, traces along a path, and recorded sessions.
#include <optional>
#include <string>
#include <utility>

#include "palpate/drivers/drivers.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/sensor.hpp"
#include "palpate/record/session_reader.hpp"
#include "palpate/session/frame_sequence.hpp"
#include "palpate/session/press.hpp"

#include "python/arrays.hpp"
#include "python/python_method.hpp"

namespace palpate::python {
namespace {

using namespace py::literals;

// How long a wait lasts before Python is asked for signals [s].
constexpr double between_signals = 0.1;
// Ticks between two looks at signals: some milliseconds.
constexpr std::size_t ticks_between_signals = 4096;

/// A source, whose waits end at Ctrl-C.
class FrameSource {
 public:
  FrameSource(const std::string& uri, std::optional<double> timeout) : timeout_(timeout) {
    const py::gil_scoped_release released;
    source_ = open_source(uri, all_sources());
  }

  std::optional<Frame> next(const std::optional<double>& timeout) {
    const double whole = timeout.value_or(Source::no_timeout);
    for (double waited = 0.0;;) {
      const double wait = std::min(between_signals, whole - waited);
      std::optional<Frame> frame;
      {
        const py::gil_scoped_release released;
        frame = source_->next(wait);
      }
      waited += wait;
      if (frame || !source_->info().live || waited >= whole) return frame;
      check_signals();
    }
  }

  Frame next_or_stop() {
    std::optional<Frame> frame = next(timeout_);
    if (!frame) throw py::stop_iteration();
    return std::move(*frame);
  }

  [[nodiscard]] py::dict info() const {
    const SourceInfo& info = source_->info();
    return py::dict("uri"_a = info.uri, "kind"_a = info.kind, "frames"_a = info.frames,
                    "frame_rate"_a = info.frame_rate, "start_time"_a = info.start_time,
                    "live"_a = info.live, "clock"_a = std::string(name_of(info.clock)),
                    "sensor"_a = std::string(name_of(info.sensor)), "notes"_a = info.notes,
                    "details"_a = info.details);
  }

 private:
  std::unique_ptr<Source> source_;
  std::optional<double> timeout_;
};

py::object cloud_of(const Frame& frame) {
  return py::cast(std::const_pointer_cast<Cloud>(frame.cloud));
}

py::object colour_of(const py::object& self) {
  const auto& frame = py::cast<const Frame&>(self);
  if (!frame.colour) return py::none();
  const ColourImage& image = *frame.colour;
  py::array_t<std::uint8_t> view({image.height, image.width, 3}, image.rgb.data(), self);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}

std::vector<std::string> uris_of(const py::object& camera) {
  if (py::isinstance<py::str>(camera)) return {py::cast<std::string>(camera)};
  return py::cast<std::vector<std::string>>(camera);
}

HipPath path_of(const py::object& path) {
  if (py::isinstance<py::str>(path) || py::hasattr(path, "__fspath__"))
    return HipPath::read_csv(py::cast<std::string>(py::str(path)));
  const char* const give = "a row of t [s] and x, y, z [m, world] for each sample, or a CSV file";
  const auto rows = Numbers::ensure(path);  // which clears Python's error
  if (!rows) throw Error("path", "it is neither a file nor an array", std::string("give ") + give);
  check_shape(rows, "path", {0, 4}, give);
  std::vector<HipPath::Sample> samples;
  const auto at = rows.unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i)
    samples.push_back({at(i, 0), Vec3(at(i, 1), at(i, 2), at(i, 3))});
  return HipPath(std::move(samples));
}

Press press_of(const FrameSequence& frames, std::pair<int, int> at,
               const std::optional<std::pair<int, int>>& slide_to, PressOptions options) {
  if (slide_to) options.slide_to = Pixel{slide_to->first, slide_to->second};
  return {*frames.upcoming(0)->cloud, {at.first, at.second}, options};
}

py::array trace(const py::object& camera, const py::object& path, const py::object& method,
                double rate, const std::optional<std::pair<int, int>>& press,
                const std::optional<std::pair<int, int>>& slide_to, double press_depth,
                double press_speed, double press_hold, const py::kwargs& values) {
  if (path.is_none() == !press)
    throw Error("trace", "it needs one of path and press",
                "give a path, or a pixel (u, v) of the first frame as press");
  Parameters parameters;
  set_all(parameters, values);
  const std::vector<std::string> uris = uris_of(camera);
  std::optional<FrameSequence> frames;
  {
    const py::gil_scoped_release released;
    frames.emplace(uris);
  }
  std::optional<HipPath> hips;
  std::optional<Press> pressing;
  if (press)
    pressing.emplace(press_of(*frames, *press, slide_to,
                              {.depth = press_depth, .speed = press_speed, .hold = press_hold}));
  else
    hips.emplace(path_of(path));
  const auto trouble = std::make_shared<Trouble>();
  const std::unique_ptr<Method> made =
      method_of(method, for_sensors(parameters, frames->sensors()), trouble);
  std::vector<TickRecord> records;
  if (hips) records.reserve(static_cast<std::size_t>(ticks_along(*hips, rate)));
  {
    const py::gil_scoped_release released;
    const auto on_tick = [&](const Tick& tick) {
      records.push_back(record_of(tick));
      if (records.size() % ticks_between_signals == 0) check_signals();
      return !trouble->first;
    };
    if (pressing)
      touch_along(*frames, *made, *pressing, rate, on_tick);
    else
      touch_along(*frames, *made, *hips, rate, on_tick);
  }
  trouble->rethrow();
  return array_of(records);
}

py::array read_session(const std::string& folder) {
  std::vector<CycleRecord> records;
  {
    const py::gil_scoped_release released;
    SessionReader reader(folder);
    records.reserve(reader.ticks());
    for (std::size_t i = 0; i < reader.ticks(); ++i) {
      records.push_back(record_of(reader.tick(i)));
      if (i % ticks_between_signals == 0) check_signals();
    }
  }
  return array_of(records);
}

}  // namespace

void define_sources(py::module_& m) {
  py::class_<Frame> frame(m, "Frame", "One capture of a camera.");
  frame.def_readonly("stamp", &Frame::stamp, "[s] when it was captured")
      .def_property_readonly("cloud", &cloud_of, "what was measured: a DepthImage or PointCloud")
      .def_property_readonly(
          "colour", &colour_of,
          "uint8 (height, width, 3), not to be written to; None if there is none");
  // What its cloud has; where that is no depth image, only points.
  using Named = std::pair<const char*, const char*>;  // and its meaning
  for (const auto& [name, meaning] :
       {Named{"depth", "of a depth image: uint16 (height, width), not to be written to, no copy"},
        Named{"camera", "as DepthImage has it"}, Named{"units_per_metre", "as DepthImage has it"},
        Named{"world_from_camera", "as DepthImage has it"}})
    frame.def_property_readonly(
        name, [name = name](const Frame& self) { return py::object(cloud_of(self).attr(name)); },
        meaning);
  for (const auto& [name, meaning] :
       {Named{"metres", "Depth [m] as float32 (height, width), NaN where nothing was measured."},
        Named{"points", "All measured points [m, world], an array (n, 3)."}})
    frame.def(
        name, [name = name](const Frame& self) { return py::object(cloud_of(self).attr(name)()); },
        meaning);

  py::class_<FrameSource>(m, "Source",
                          "Frames of a camera or recording, in the order of capture: iterate over "
                          "it. A recording ends; a live camera does not.")
      .def(py::init<const std::string&, std::optional<double>>(), py::arg("uri"),
           py::arg("timeout") = py::none(),
           "A source by its URI, as the program's --camera. A live camera that gives no frame for "
           "`timeout` [s] ends the iteration.")
      .def("__iter__", [](const py::object& self) { return self; })
      .def("__next__", &FrameSource::next_or_stop)
      .def("next", &FrameSource::next, py::arg("timeout") = py::none(),
           "The next frame; None at the end, or if a live camera gives none for `timeout` [s].")
      .def_property_readonly("info", &FrameSource::info, "What is known of it: a dict.");

  m.def("trace", &trace, py::arg("camera"), py::arg("path") = py::none(), py::kw_only(),
        py::arg("method") = "sight", py::arg("rate") = 1000.0, py::arg("press") = py::none(),
        py::arg("slide_to") = py::none(), py::arg("press_depth") = 8e-3,
        py::arg("press_speed") = 0.05, py::arg("press_hold") = 0.5,
        "Touches what cameras saw along a path, exactly as `palpate trace` does, and gives the\n"
        "ticks as a structured array.\n\n"
        "camera: a URI, or a list of them. path: a CSV file with the columns t,x,y,z, or an array\n"
        "(n, 4), s and m, world; or `press`, a pixel (u, v) to be pressed, led by the newest "
        "frame, and\n"
        "`slide_to`, another one to be stroked to. method: a name or an object of a class derived\n"
        "from palpate.Method. Further keywords are parameters.");
  m.def(
      "read_session",
      [](const py::object& folder) { return read_session(py::cast<std::string>(py::str(folder))); },
      py::arg("folder"), "All cycles of a recorded session as a structured array.");
}

}  // namespace palpate::python
