// SPDX-License-Identifier: Apache-2.0
#include <utility>
#include <vector>

#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/core/error.hpp"

#include "python/arrays.hpp"

namespace palpate::python {
namespace {

constexpr const char* remedy = "let it give pairs: a palpate.DepthImage or PointCloud, and [s]";

// In memory of its own: an array's last reference would need the interpreter.
std::shared_ptr<const Cloud> without_python(std::shared_ptr<Cloud> cloud) {
  const DepthImage* image = cloud->image();
  if (image == nullptr) return cloud;
  const auto depth = image->depth();
  auto copy = std::make_shared<DepthImage>(
      image->shared_rays(), std::vector<std::uint16_t>(depth.begin(), depth.end()),
      image->units_per_metre(), image->world_from_camera(), image->brightness());
  copy->set_materials(image->materials());
  copy->set_noise(image->noise());
  return copy;
}

// Iterating over the object gives (cloud, stamp) or ends. Takes the interpreter's lock for each
// frame, and copies depth, so that nothing else needs it.
class PythonSource final : public Source {
 public:
  explicit PythonSource(const py::object& camera) {
    const auto name = py::cast<std::string>(py::type::of(camera).attr("__name__"));
    info_.uri = "python:" + name;
    info_.kind = "Python's " + name;
    if (!py::isinstance<py::iterable>(camera))
      throw Error(info_.uri, "one cannot iterate over it", remedy);
    info_.live = py::cast<bool>(py::getattr(camera, "live", py::bool_(false)));
    info_.clock = info_.live ? StampClock::monotonic : StampClock::recording;
    frames_ = py::iter(camera);
  }
  ~PythonSource() override {
    const py::gil_scoped_acquire lock;
    frames_ = py::iterator();
  }
  PythonSource(const PythonSource&) = delete;
  PythonSource& operator=(const PythonSource&) = delete;

  // Waits as long as the object does.
  std::optional<Frame> next(double /*timeout*/) override {
    const py::gil_scoped_acquire lock;
    try {
      const auto given = py::reinterpret_steal<py::object>(PyIter_Next(frames_.ptr()));
      if (PyErr_Occurred() != nullptr) throw py::error_already_set();
      if (!given) return std::nullopt;
      auto [cloud, stamp] = py::cast<std::pair<std::shared_ptr<Cloud>, double>>(given);
      if (!cloud) throw py::cast_error();
      return Frame{stamp, without_python(std::move(cloud))};
    } catch (py::error_already_set& error) {  // of the interpreter, which is locked here alone
      throw Error(info_.uri, error.what(), remedy);
    } catch (const py::cast_error&) {
      throw Error(info_.uri, "it gave something else than a cloud and its time", remedy);
    }
  }
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  SourceInfo info_;
  py::iterator frames_;
};

}  // namespace

std::unique_ptr<Source> open_python_source(const py::object& camera) {
  auto source = std::make_unique<PythonSource>(camera);
  if (!py::hasattr(camera, "scale_reference")) return source;
  const std::string uri = source->info().uri;
  return with_scale_reference(std::move(source), py::str(camera.attr("scale_reference")), uri);
}

}  // namespace palpate::python
