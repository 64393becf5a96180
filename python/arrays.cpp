// SPDX-License-Identifier: Apache-2.0
#include "python/arrays.hpp"

#include <algorithm>
#include <cstring>

#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/pose.hpp"
#include "palpate/kernel/core/rotation.hpp"

namespace palpate::python {
namespace {

std::array<double, 3> numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

std::array<double, 4> numbers(const Rotation& q) { return {q.x(), q.y(), q.z(), q.w()}; }

template <class Record>
py::array copied(const std::vector<Record>& records) {
  py::array_t<Record> array(static_cast<py::ssize_t>(records.size()));
  if (!records.empty())
    std::memcpy(array.mutable_data(), records.data(), records.size() * sizeof(Record));
  return array;
}

}  // namespace

TickRecord record_of(const Tick& tick) {
  return {.t = tick.t,
          .hip = numbers(tick.hip),
          .proxy = numbers(tick.proxy),
          .normal = numbers(tick.normal),
          .force = numbers(tick.force),
          .torque = numbers(tick.torque),
          .orientation = numbers(tick.orientation),
          .proxy_orientation = numbers(tick.proxy_orientation),
          .surface_velocity = tick.surface_velocity,
          .frame = tick.frame,
          .steps = tick.steps,
          .flags = tick.flags,
          .state = static_cast<std::int32_t>(tick.state)};
}

CycleRecord record_of(const ServoTick& tick) {
  return {.t = tick.tick.t,
          .hip = numbers(tick.tick.hip),
          .proxy = numbers(tick.tick.proxy),
          .normal = numbers(tick.tick.normal),
          .asked = numbers(tick.tick.force),
          .force = numbers(tick.force),
          .torque = numbers(tick.torque),
          .position = numbers(tick.position),
          .orientation = numbers(tick.tick.orientation),
          .proxy_orientation = numbers(tick.tick.proxy_orientation),
          .surface_velocity = tick.tick.surface_velocity,
          .gain = tick.gain,
          .frame_age = tick.frame_age,
          .frame = tick.tick.frame,
          .number = tick.number,
          .steps = tick.tick.steps,
          .flags = tick.tick.flags,
          .safety = tick.safety,
          .hand = tick.hand,
          .state = static_cast<std::int32_t>(tick.tick.state)};
}

Points rows_of(const std::vector<Vec3>& points) {
  const void* const numbers = points.data();
  return Eigen::Map<const Points>(static_cast<const double*>(numbers),
                                  static_cast<Eigen::Index>(points.size()), 3);
}

py::array array_of(const std::vector<TickRecord>& ticks) { return copied(ticks); }

py::array array_of(const std::vector<CycleRecord>& ticks) { return copied(ticks); }

void check_shape(const py::array& array, const std::string& name,
                 const std::vector<py::ssize_t>& shape, const std::string& give) {
  const std::vector<py::ssize_t> given(array.shape(), array.shape() + array.ndim());
  const auto is_needed = [&](auto begin, auto end) {
    return std::equal(begin, end, shape.begin(), shape.end(),
                      [](auto length, auto needed) { return length == needed || needed == 0; });
  };
  if (is_needed(given.begin(), given.end())) return;
  std::string needed;
  for (const py::ssize_t length : shape)
    needed += (needed.empty() ? "" : ", ") + (length == 0 ? "n" : std::to_string(length));
  throw Error(name,
              "its shape is " + py::cast<std::string>(py::str(array.attr("shape"))) + ", not (" +
                  needed + (shape.size() == 1 ? ",)" : ")"),
              "give " + (is_needed(given.rbegin(), given.rend()) ? name + ".T" : give));
}

Vec3 vector_of(const Numbers& numbers, const char* name) {
  if (numbers.size() != 3 || numbers.shape(0) != 3)  // a column will do
    check_shape(numbers, name, {3}, "x, y and z in the world's frame");
  return {numbers.data()[0], numbers.data()[1], numbers.data()[2]};
}

Rotation rotation_of(const std::optional<Numbers>& quaternion) {
  if (!quaternion) return Rotation::Identity();
  const char* const give = "a unit quaternion x, y, z, w that turns the tool into the world";
  check_shape(*quaternion, "orientation", {4}, give);
  const Rotation turn(Eigen::Map<const Eigen::Vector4d>(quaternion->data()));
  if (!is_rotation(turn))
    throw Error("orientation", "its length is " + std::to_string(turn.norm()) + ", not 1",
                std::string("give ") + give);
  return turn.normalized();
}

Eigen::Isometry3d pose_of(const Numbers& matrix, const char* name) {
  const char* const give = "a homogeneous matrix, with the translation [m] in its last column";
  check_shape(matrix, name, {4, 4}, give);
  Eigen::Isometry3d pose;
  pose.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(matrix.data());
  check_rigid(pose, name);
  if (pose.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw Error(name, "its last row is not 0 0 0 1", std::string("give ") + give);
  return pose;
}

std::vector<std::pair<std::string, double>> numbers_of(const py::dict& values) {
  std::vector<std::pair<std::string, double>> numbers;
  for (const auto& [name, value] : values) {
    const auto text = py::cast<std::string>(name);
    if (!py::isinstance<py::float_>(value) && !py::isinstance<py::int_>(value) &&
        !py::hasattr(value, "__float__"))
      throw py::type_error(text + ": a parameter is a number, not " +
                           py::cast<std::string>(py::str(py::type::of(value).attr("__name__"))));
    numbers.emplace_back(text,
                         py::cast<double>(py::float_(py::reinterpret_borrow<py::object>(value))));
  }
  return numbers;
}

void set_all(Parameters& parameters, const py::kwargs& values) {
  for (const auto& [name, value] : numbers_of(values)) set_parameter(parameters, name, value);
  validate(parameters);
}

void check_signals() {
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

std::shared_ptr<const py::object> kept(py::object object) {
  auto* owner = new py::object(std::move(object));
  return {owner, [](const py::object* let_go) {
            const py::gil_scoped_acquire gil;
            delete let_go;
          }};
}

}  // namespace palpate::python
