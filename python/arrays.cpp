// SPDX-License-Identifier: Apache-2.0
#include "python/arrays.hpp"

#include <algorithm>
#include <cstring>

#include "palpate/core/error.hpp"
#include "palpate/core/pose.hpp"

namespace palpate::python {
namespace {

std::array<double, 3> numbers(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

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
          .position = numbers(tick.position),
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

py::array array_of(const std::vector<TickRecord>& ticks) {
  return copied(ticks);
}

py::array array_of(const std::vector<CycleRecord>& ticks) {
  return copied(ticks);
}

Eigen::Isometry3d pose_of(const Eigen::Matrix4d& matrix, const char* subject) {
  Eigen::Isometry3d pose;
  pose.matrix() = matrix;
  check_rigid(pose, subject);
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw Error(subject, "its last row is not 0 0 0 1", "give a 4x4 homogeneous matrix");
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

std::shared_ptr<const void> kept(py::object object) {
  auto* owner = new py::object(std::move(object));
  return {owner, [](const py::object* let_go) {
            const py::gil_scoped_acquire gil;
            delete let_go;
          }};
}

}  // namespace palpate::python
