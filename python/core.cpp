// SPDX-License-Identifier: Apache-2.0
// Numbers that can be set, what can be touched, and a method that touches it.
#include <array>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "palpate/io/sources/material_file.hpp"
#include "palpate/io/sources/tool_file.hpp"
#include "palpate/kernel/cloud/point_cloud.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/methods/methods.hpp"
#include "palpate/servo/safety.hpp"

#include "python/arrays.hpp"
#include "python/python_method.hpp"

namespace palpate::python {
namespace {

constexpr const char* image_shape = "the rows and columns of its camera";
constexpr const char* point_shape = "a row of x, y and z [m, world] for each point";

std::vector<std::uint8_t> bytes_of(const py::object& array, const char* what, const Intrinsics& k) {
  if (!py::isinstance<py::array_t<std::uint8_t>>(array))
    throw py::type_error(std::string(what) + ": it has to be an array of uint8; give " + what +
                         ".astype(numpy.uint8)");
  const auto pixels =
      py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>::ensure(array);
  check_shape(pixels, what, {k.height, k.width}, image_shape);
  return {pixels.data(), pixels.data() + pixels.size()};
}

using namespace py::literals;
using SharedRays = std::shared_ptr<const ViewingRays>;
using Singles = py::array_t<float, py::array::c_style | py::array::forcecast>;

/// A pinhole camera, whose viewing rays are computed once for all of its frames.
struct Camera {
  SharedRays rays;
  [[nodiscard]] const Intrinsics& intrinsics() const { return rays->intrinsics(); }
};

Camera make_camera(int width, int height, double fx, double fy, double cx, double cy,
                   const std::vector<double>& distortion) {
  Intrinsics k{.width = width, .height = height, .fx = fx, .fy = fy, .cx = cx, .cy = cy};
  if (distortion.size() > k.distortion.size())
    throw Error("distortion", std::to_string(distortion.size()) + " coefficients are too many",
                "give at most eight: k1 k2 p1 p2 k3 k4 k5 k6");
  std::copy(distortion.begin(), distortion.end(), k.distortion.begin());
  validate(k);
  return {std::make_shared<const ViewingRays>(k)};
}

MaterialsOf make_materials(const py::object& what) {
  if (py::isinstance<py::str>(what) || py::hasattr(what, "__fspath__"))
    return {materials_of(py::cast<std::string>(py::str(what))).table};
  MaterialTable table;
  for (const py::handle& entry : what) {
    const auto values = py::cast<py::dict>(py::reinterpret_borrow<py::object>(entry));
    NamedMaterial material;
    if (values.contains("like"))
      material.material = standard_material(py::cast<std::string>(values["like"])).material;
    py::dict numbers;
    for (const auto& [key, value] : values) {
      const auto name = py::cast<std::string>(key);
      if (name == "name") material.name = py::cast<std::string>(value);
      if (name != "name" && name != "like") numbers[key] = value;
    }
    for (const auto& [name, value] : numbers_of(numbers))
      set_parameter(material.material, name, value);
    table.materials.push_back(std::move(material));
  }
  validate(table);
  return {std::make_shared<const MaterialTable>(std::move(table))};
}

/// Takes the array's own memory, which stays alive as long as the image does.
std::shared_ptr<DepthImage> make_image(const py::array& depth, const Camera& camera,
                                       double units_per_metre,
                                       const std::optional<Numbers>& world_from_camera,
                                       const std::optional<MaterialsOf>& materials,
                                       const py::object& labels, const py::object& brightness,
                                       const std::optional<Singles>& noise) {
  const Intrinsics& k = camera.intrinsics();
  if (!py::isinstance<py::array_t<std::uint16_t>>(depth))
    throw py::type_error("depth: it has to be an array of uint16, not of " +
                         py::cast<std::string>(py::str(depth.dtype())) +
                         "; for metres, numpy.round(metres * 1000).astype(numpy.uint16)");
  check_shape(depth, "depth", {k.height, k.width}, image_shape);
  if ((depth.flags() & py::array::c_style) == 0)
    throw Error("depth", "its rows do not follow one another in memory",
                "give numpy.ascontiguousarray(depth)");
  const auto* data = static_cast<const std::uint16_t*>(depth.data());
  auto image = std::make_shared<DepthImage>(
      camera.rays, DepthReadings({data, static_cast<std::size_t>(depth.size())}, kept(depth)),
      units_per_metre,
      world_from_camera ? pose_of(*world_from_camera, "world_from_camera")
                        : Eigen::Isometry3d::Identity());
  image->set_materials(make_map(k, materials, labels, brightness));
  if (noise) {
    check_shape(*noise, "noise", {k.height, k.width}, image_shape);
    image->set_noise({noise->data(), static_cast<std::size_t>(noise->size())});
  }
  return image;
}

std::shared_ptr<PointCloud> make_points(const Numbers& points,
                                        const std::optional<Numbers>& viewpoint) {
  check_shape(points, "points", {0, 3}, point_shape);
  std::vector<Vec3> list;
  list.reserve(static_cast<std::size_t>(points.shape(0)));
  for (py::ssize_t i = 0; i < points.shape(0); ++i) list.emplace_back(points.data(i));
  std::optional<Vec3> from;
  if (viewpoint) from = vector_of(*viewpoint, "viewpoint");
  const py::gil_scoped_release released;
  return std::make_shared<PointCloud>(list, from);
}

/// A method, and the frame that it touches.
class Renderer {
 public:
  Renderer(const py::object& method, const std::string& tool, const py::kwargs& parameters) {
    set_all(parameters_, parameters);
    const auto shape = tool.empty() ? nullptr : read_tool(tool);
    method_ = shape ? make_method(py::cast<std::string>(py::str(method)), parameters_,
                                  standard_methods(), shape)
                    : method_of(method, parameters_, trouble_);
  }

  void frame(const std::shared_ptr<Cloud>& cloud, double stamp, std::size_t number) {
    if (number >= clouds_.size())
      throw Error("camera_number", std::to_string(number) + " is out of range",
                  "number cameras from 0 to " + std::to_string(clouds_.size() - 1));
    method_->check(*cloud);
    {
      const py::gil_scoped_release released;
      method_->observe({*cloud, stamp, number});
    }
    clouds_[number] = cloud;  // only now may the camera's frame before go
    trouble_->rethrow();
  }

  Tick tick(const Numbers& hip, double t, const std::optional<Numbers>& orientation) {
    Tick tick = method_->tick(HandPose{vector_of(hip, "hip"), rotation_of(orientation)}, t);
    trouble_->rethrow();
    return tick;
  }

  py::array ticks(const Numbers& hips, const Numbers& times) {
    check_shape(hips, "hips", {0, 3}, point_shape);
    check_shape(times, "times", {hips.shape(0)}, "one time [s] for each of the hips");
    const py::ssize_t count = hips.shape(0);
    py::array_t<TickRecord> records(count);
    TickRecord* record = records.mutable_data();
    const double* hip = hips.data();
    const double* time = times.data();
    {
      const py::gil_scoped_release released;
      for (py::ssize_t i = 0; i < count && !trouble_->first; ++i)
        record[i] = record_of(method_->tick(Vec3(hip + 3 * i), time[i]));
    }
    trouble_->rethrow();
    return records;
  }

  void set(const py::kwargs& values) {
    Parameters changed = parameters_;
    set_all(changed, values);
    validate(changed);
    method_->set_parameters(changed);
    trouble_->rethrow();
    parameters_ = changed;
  }

  void seat(const Numbers& proxy) { method_->seat(vector_of(proxy, "proxy")); }
  [[nodiscard]] const Parameters& parameters() const { return parameters_; }

 private:
  Parameters parameters_;
  std::shared_ptr<Trouble> trouble_ = std::make_shared<Trouble>();
  std::unique_ptr<Method> method_;
  std::array<std::shared_ptr<Cloud>, Patch::max_views> clouds_;  // by camera
};

template <class Table>
py::dict table_dict(const Table& table) {
  py::dict all;
  for (const auto& row : table)
    all[py::str(std::string(row.name))] =
        py::dict("unit"_a = std::string(row.unit), "default"_a = row.default_value,
                 "min"_a = row.min, "max"_a = row.max, "meaning"_a = std::string(row.meaning),
                 "source"_a = std::string(row.source));
  return all;
}

// name -> meaning of the bits that are set.
py::dict named_bits(std::uint32_t bits, std::span<const FlagInfo> table) {
  py::dict set;
  for (const auto& [name, meaning] : flags_in(bits, table))
    set[py::str(std::string(name))] = std::string(meaning);
  return set;
}

void define_tables(py::module_& m) {
  m.def(
      "parameters", [] { return table_dict(parameter_table()); },
      "All numbers that can be set on a method: name -> unit, default, min, max, meaning, "
      "source.");
  m.def(
      "limits", [] { return table_dict(safety_parameter_table()); },
      "All numbers of a session's safety chain: name -> unit, default, min, max, meaning, "
      "source.");
  m.def(
      "materials",
      [] {
        py::dict all;
        for (const NamedMaterial& named : standard_materials().materials)
          all[py::str(named.name)] = values_of(material_table(), named.material);
        return all;
      },
      "The standard materials: name -> its numbers, as Materials takes them.");
  m.def(
      "methods", [] { return summaries_of(standard_methods()); },
      "The available methods: name -> description.");
  m.def(
      "flags", [](std::uint32_t bits) { return named_bits(bits, tick_flag_table()); },
      py::arg("bits"), "The conditions in a tick's `flags`: name -> what it means.");
  m.def(
      "safety_flags", [](std::uint32_t bits) { return named_bits(bits, safety_flag_table()); },
      py::arg("bits"), "What the safety chain did in a tick, from its `safety`.");
}

void define_cameras(py::module_& m) {
  py::class_<Camera>(m, "Camera", "A pinhole camera; its viewing rays are computed once.")
      .def(py::init(&make_camera), py::arg("width"), py::arg("height"), py::arg("fx"),
           py::arg("fy"), py::arg("cx"), py::arg("cy"),
           py::arg("distortion") = std::vector<double>(),
           "Sizes, focal lengths and principal point [px]; the distortion's coefficients are k1 "
           "k2 p1 p2 k3 k4 k5 k6 in OpenCV's order.")
      .def_property_readonly("width", [](const Camera& c) { return c.intrinsics().width; })
      .def_property_readonly("height", [](const Camera& c) { return c.intrinsics().height; })
      .def_property_readonly("fx", [](const Camera& c) { return c.intrinsics().fx; })
      .def_property_readonly("fy", [](const Camera& c) { return c.intrinsics().fy; })
      .def_property_readonly("cx", [](const Camera& c) { return c.intrinsics().cx; })
      .def_property_readonly("cy", [](const Camera& c) { return c.intrinsics().cy; })
      .def_property_readonly("distortion",
                             [](const Camera& c) { return c.intrinsics().distortion; })
      .def("__repr__", [](const Camera& c) {
        const Intrinsics& k = c.intrinsics();
        return "palpate.Camera(" + std::to_string(k.width) + ", " + std::to_string(k.height) +
               ", fx=" + std::to_string(k.fx) + ", fy=" + std::to_string(k.fy) +
               ", cx=" + std::to_string(k.cx) + ", cy=" + std::to_string(k.cy) + ")";
      });
}

void define_clouds(py::module_& m) {
  py::class_<Cloud, std::shared_ptr<Cloud>>(m, "Cloud", "Whatever can be touched.")
      .def(
          "near",
          [](const Cloud& cloud, const Numbers& centre, double radius) {
            return CloudView(&cloud).near(centre, radius);
          },
          py::arg("centre"), py::arg("radius"),
          "The points within `radius` [m] of `centre` [m, world], as an array (n, 3); at most "
          "16 384, thinned evenly.");
  py::class_<CloudView, std::shared_ptr<CloudView>>(
      m, "CloudView", "What a method of your own sees of a frame, until its next one.")
      .def("near", &CloudView::near, py::arg("centre"), py::arg("radius"),
           "The points within `radius` [m] of `centre` [m, world], as an array (n, 3).")
      .def_property_readonly("viewpoint", &CloudView::viewpoint,
                             "[m] world: from where they were seen, if that is known");
}

void define_materials(py::module_& m) {
  py::class_<MaterialsOf>(m, "Materials", "What surfaces are made of, and feel like.")
      .def(
          py::init(&make_materials), py::arg("what"),
          "A standard material's name (palpate.materials()), a TOML file, or a list of dicts, each "
          "with a `name`, numbers by their names, and perhaps `like`, a standard material to begin "
          "from.")
      .def_property_readonly(
          "names",
          [](const MaterialsOf& materials) {
            std::vector<std::string> names;
            for (const NamedMaterial& m : materials.table->materials) names.push_back(m.name);
            return names;
          },
          "in the order of their labels, from 1")
      .def("__len__",
           [](const MaterialsOf& materials) { return materials.table->materials.size(); });
}

// The image's own memory.
py::array_t<std::uint16_t> depth_view(const py::object& self) {
  const auto& image = py::cast<const DepthImage&>(self);
  py::array_t<std::uint16_t> view({image.intrinsics().height, image.intrinsics().width},
                                  image.depth().data(), self);
  view.attr("setflags")(py::arg("write") = false);
  return view;
}

std::optional<Singles> noise_of(const DepthImage& image) {
  if (!image.noise()) return std::nullopt;
  Singles noise({image.intrinsics().height, image.intrinsics().width});
  std::transform(
      image.noise()->begin(), image.noise()->end(), noise.mutable_data(),
      [](std::uint16_t steps) { return static_cast<float>(steps / DepthImage::noise_steps); });
  return noise;
}

py::array_t<float> metres_of(const DepthImage& image) {
  const Intrinsics& k = image.intrinsics();
  py::array_t<float> metres({k.height, k.width});
  float* out = metres.mutable_data();
  for (std::size_t i = 0; i < image.depth().size(); ++i) {
    const std::uint16_t raw = image.depth()[i];
    out[i] = is_measured(raw) ? static_cast<float>(raw / image.units_per_metre())
                              : std::numeric_limits<float>::quiet_NaN();
  }
  return metres;
}

void define_depth_images(py::module_& m) {
  py::class_<DepthImage, Cloud, std::shared_ptr<DepthImage>>(
      m, "DepthImage", "One capture of a depth camera: 16-bit depth, touched in place.")
      .def(
          py::init(&make_image), py::arg("depth"), py::arg("camera"),
          py::arg("units_per_metre") = 1000.0, py::arg("world_from_camera") = py::none(),
          py::arg("materials") = py::none(), py::arg("labels") = py::none(),
          py::arg("brightness") = py::none(), py::arg("noise") = py::none(),
          "Depth along the optical axis, uint16 (height, width); 0 and 65535 are holes. The "
          "array is not copied: it is kept alive, and must not change meanwhile. The pose is a "
          "4x4 matrix, the camera's optical frame (x right, y down, z forward) in the world.\n\n"
          "`labels`, uint8 (height, width), says which of `materials` each pixel is: 0 none, 1 the "
          "first. `brightness`, of the same shape, is what `relief` makes heights of. `noise`, of "
          "the same shape and in the depth's own unit, is the standard deviation of each reading, "
          "finite and 0 or more, also where depth has holes; it is kept to a 16th of the unit. "
          "Without it the noise is that of the sensor type. All are copied.")
      .def_property_readonly("depth", &depth_view,
                             "uint16 (height, width), not to be written to: the image's own memory")
      .def_property_readonly("camera",
                             [](const DepthImage& image) { return Camera{image.shared_rays()}; })
      .def_property_readonly(
          "noise", &noise_of,
          "float32 (height, width), standard deviations in the depth's own unit, as they are kept; "
          "None: not known")
      .def_property_readonly("units_per_metre", &DepthImage::units_per_metre)
      .def_property_readonly(
          "world_from_camera",
          [](const DepthImage& image) {
            return Eigen::Matrix4d(image.world_from_camera().matrix());
          },
          "4x4, the camera's optical frame in the world [m]")
      .def("metres", &metres_of,
           "Depth [m] as float32 (height, width), NaN where nothing was measured.")
      .def(
          "points", [](const DepthImage& image) { return rows_of(image.points()); },
          "All measured points [m, world], an array (n, 3).");
}

void define_points(py::module_& m) {
  py::class_<PointCloud, Cloud, std::shared_ptr<PointCloud>>(
      m, "PointCloud", "Points in no particular order, sorted once.")
      .def(py::init(&make_points), py::arg("points"), py::arg("viewpoint") = py::none(),
           "Points (n, 3) [m, world], and from where they were seen, if that is known.")
      .def("__len__", &PointCloud::size)
      .def_property_readonly("viewpoint", &PointCloud::viewpoint)
      .def(
          "points",
          [](const PointCloud& cloud) {
            std::vector<Vec3> points;
            for (std::size_t i = 0; i < cloud.size(); ++i) points.push_back(cloud.point(i));
            return rows_of(points);
          },
          "All finite points [m, world], an array (n, 3), sorted along a space-filling curve.");
}

void define_ticks(py::module_& m) {
  py::enum_<ContactState>(m, "State", py::arithmetic(), "Where the proxy stands.")
      .value("FREE", ContactState::free_motion, "nothing within r_2")
      .value("CONTACT", ContactState::contact, "points between r_1 and r_2")
      .value("ENTRENCHMENT", ContactState::entrenchment, "points within r_1");

  py::class_<Tick>(m, "Tick", "One cycle of haptic rendering: HIP in, proxy and force out.")
      .def_readonly("t", &Tick::t, "[s] as given")
      .def_readonly("hip", &Tick::hip, "[m] world, as given")
      .def_readonly("proxy", &Tick::proxy, "[m] world, the centre of the sphere")
      .def_readonly("normal", &Tick::normal, "[-] unit, away from the surface; zero: none near")
      .def_readonly("force", &Tick::force, "[N] world, on the hand; at most max_force long")
      .def_readonly("torque", &Tick::torque,
                    "[N m] world, on the hand about the HIP; zero without a tool")
      .def_property_readonly(
          "orientation", [](const Tick& tick) { return tick.orientation.coeffs(); },
          "of the hand, as given: a unit quaternion x y z w, world from tool")
      .def_property_readonly(
          "proxy_orientation", [](const Tick& tick) { return tick.proxy_orientation.coeffs(); },
          "of the proxy, likewise; of a ball that of the hand")
      .def_property_readonly(
          "contacts",
          [](const Tick& tick) {
            Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor> rows(tick.contact_count, 6);
            for (std::uint32_t i = 0; i < tick.contact_count; ++i) {
              const ContactPush& contact = tick.contacts[i];
              rows.row(i) << (tick.proxy + contact.lever.cast<double>()).transpose(),
                  contact.force.cast<double>().transpose();
            }
            return rows;
          },
          "where surfaces push a tool with a shape, at most six rows: x, y, z of the place [m,\n"
          "world], and of the force there [N, world]; of a ball none")
      .def_readonly("state", &Tick::state)
      .def_readonly("steps", &Tick::steps, "proxy steps taken")
      .def_readonly("surface_velocity", &Tick::surface_velocity, "[m/s] towards the proxy")
      .def_readonly("transient", &Tick::transient,
                    "[N] world, the part of `force` that is an impact's ringing")
      .def_readonly("hardness", &Tick::hardness,
                    "[-] share of `stiffness` that is felt, where a material is softer")
      .def_readonly("frame", &Tick::frame, "number of the frame in use, from 0; -1: none")
      .def_readonly("flags", &Tick::flags, "bits that palpate.flags() names")
      .def("__repr__", [](const Tick& tick) {
        return "<palpate.Tick t=" + std::to_string(tick.t) + " s, " + to_string(tick.state) +
               ", force " + std::to_string(tick.force.norm()) + " N>";
      });
}

void define_renderer(py::module_& m) {
  py::class_<Renderer>(
      m, "Renderer",
      "A method of haptic rendering: frames and HIPs in, proxy and force out.\n\n"
      "The same calls give the same ticks, bit for bit. No safety chain stands behind it: what\n"
      "drives a motor belongs into a Session.")
      .def(py::init<const py::object&, const std::string&, const py::kwargs&>(),
           py::arg("method") = "sight", py::kw_only(), py::arg("tool") = "",
           "A method by its name (palpate.methods()) or an object of a class derived from\n"
           "palpate.Method; what it touches with, such as \"box:40x20x5mm\" (docs/tools.md);\n"
           "parameters by their names (palpate.parameters()), in SI units.")
      .def("frame", &Renderer::frame, py::arg("cloud"), py::arg("stamp"),
           py::arg("camera_number") = 0,
           "Takes a frame into use: a DepthImage or PointCloud, and when it was captured [s]; "
           "where\n"
           "there are several cameras, which one's it is, from 0. What the others saw stays.")
      .def(
          "frame",
          [](Renderer& self, const py::array& depth, const Camera& camera, double stamp,
             const std::optional<Numbers>& world_from_camera, double units_per_metre,
             const std::optional<MaterialsOf>& materials, const py::object& labels,
             const py::object& brightness, const std::optional<Singles>& noise,
             std::size_t number) {
            self.frame(make_image(depth, camera, units_per_metre, world_from_camera, materials,
                                  labels, brightness, noise),
                       stamp, number);
          },
          py::arg("depth"), py::kw_only(), py::arg("camera"), py::arg("stamp"),
          py::arg("world_from_camera") = py::none(), py::arg("units_per_metre") = 1000.0,
          py::arg("materials") = py::none(), py::arg("labels") = py::none(),
          py::arg("brightness") = py::none(), py::arg("noise") = py::none(),
          py::arg("camera_number") = 0,
          "The same from a depth image, uint16 (height, width), without a copy; the rest as\n"
          "DepthImage has it.")
      .def(
          "frame",
          [](Renderer& self, const Numbers& points, double stamp,
             const std::optional<Numbers>& viewpoint, std::size_t number) {
            check_shape(points, "points", {0, 3},
                        std::string(point_shape) + ", or a depth image with camera=");
            self.frame(make_points(points, viewpoint), stamp, number);
          },
          py::arg("points"), py::kw_only(), py::arg("stamp"), py::arg("viewpoint") = py::none(),
          py::arg("camera_number") = 0, "The same from points (n, 3) [m, world].")
      .def(
          "tick", &Renderer::tick, py::arg("hip"), py::arg("t"),
          py::arg("orientation") = py::none(),
          "Moves the proxy towards the HIP [m, world] at time t [s] and renders force and torque.\n"
          "orientation: of the tool, a unit quaternion x y z w, world from tool; None: the world's "
          "axes.")
      .def("ticks", &Renderer::ticks, py::arg("hips"), py::arg("times"),
           "Many ticks on one frame: HIPs (n, 3) and times (n,) in, a structured array out.")
      .def("set", &Renderer::set, "Changes parameters between two ticks; the contact stays.")
      .def("seat", &Renderer::seat, py::arg("proxy"),
           "Puts the proxy at a place [m, world] in free motion and forgets the contact.")
      .def_property_readonly(
          "parameters",
          [](const Renderer& self) { return values_of(parameter_table(), self.parameters()); },
          "All parameters as they are: name -> value.");
}

}  // namespace

std::shared_ptr<const MaterialMap> make_map(const Intrinsics& k,
                                            const std::optional<MaterialsOf>& materials,
                                            const py::object& labels,
                                            const py::object& brightness) {
  if (!materials && labels.is_none() && brightness.is_none()) return nullptr;
  if (!materials && !labels.is_none())
    throw Error("labels", "there are no materials that they name",
                "give materials=palpate.Materials(...)");
  if (materials && labels.is_none() && materials->table->materials.size() > 1)
    throw Error("materials", "nothing says which pixel is which of them",
                "give labels, uint8 (height, width): 0 for none, i for the i-th of them");
  const std::size_t size = static_cast<std::size_t>(k.width) * static_cast<std::size_t>(k.height);
  const auto everywhere = static_cast<std::uint8_t>(materials ? 1 : 0);
  return std::make_shared<LabelImage>(
      materials ? materials->table : std::make_shared<const MaterialTable>(),
      labels.is_none() ? std::vector<std::uint8_t>(size, everywhere)
                       : bytes_of(labels, "labels", k),
      brightness.is_none() ? std::vector<std::uint8_t>() : bytes_of(brightness, "brightness", k));
}

void define_core(py::module_& module) {
  define_tables(module);
  define_cameras(module);
  define_clouds(module);
  define_materials(module);
  define_depth_images(module);
  define_points(module);
  define_ticks(module);
  define_renderer(module);
}

}  // namespace palpate::python
