// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/depth_image.hpp"
#include "palpate/kernel/cloud/material_map.hpp"
#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/tick.hpp"
#include "palpate/servo/cycle.hpp"

namespace palpate::python {

namespace py = pybind11;

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
/// An argument that is an array; numpy makes one of a sequence.
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// A tick as a record of a structured array.
struct TickRecord {
  double t;
  std::array<double, 3> hip, proxy, normal, force, torque;
  std::array<double, 4> orientation, proxy_orientation;  // x y z w
  double surface_velocity;
  std::int64_t frame;
  std::int64_t steps;
  std::uint32_t flags;
  std::int32_t state;
};

/// A cycle of a session as a record of a structured array.
struct CycleRecord {
  double t;
  std::array<double, 3> hip, proxy, normal, asked, force, torque, position;
  std::array<double, 4> orientation, proxy_orientation;  // x y z w
  double surface_velocity, gain, frame_age;
  std::int64_t frame;
  std::uint64_t number;
  std::int64_t steps;
  std::uint32_t flags, safety, hand;
  std::int32_t state;
};

TickRecord record_of(const Tick& tick);
CycleRecord record_of(const ServoTick& tick);

/// Structured arrays; made once the module has registered their types.
py::array array_of(const std::vector<TickRecord>& ticks);
py::array array_of(const std::vector<CycleRecord>& ticks);

/// A row of x, y and z for each point.
Points rows_of(const std::vector<Vec3>& points);

/// @param shape  what is needed; 0 for any length
/// @param give   what an array of that shape holds
/// @throws Error that names both shapes, unless they are the same
void check_shape(const py::array& array, const std::string& name,
                 const std::vector<py::ssize_t>& shape, const std::string& give);

/// Three numbers as a place or direction in the world. @throws Error naming `name`
Vec3 vector_of(const Numbers& numbers, const char* name);

/// A unit quaternion x y z w as world_from_handle; none: the identity.
/// @throws Error if it is none, or not of length 1
Rotation rotation_of(const std::optional<Numbers>& quaternion);

/// A 4x4 matrix as a rigid pose. @throws Error naming `name` if it is none.
Eigen::Isometry3d pose_of(const Numbers& matrix, const char* name);

/// Numbers by their names. @throws TypeError for what is no number
std::vector<std::pair<std::string, double>> numbers_of(const py::dict& values);

/// Sets the parameters named by keywords. @throws Error for an unknown name or a value out of its
/// range; TypeError for what is no number.
void set_all(Parameters& parameters, const py::kwargs& values);

/// The values that the rows of a table have in an object, by the rows' names.
template <class Table, class Object>
py::dict values_of(const Table& table, const Object& object) {
  py::dict values;
  for (const auto& row : table) values[py::str(std::string(row.name))] = row.get(object);
  return values;
}

/// What surfaces are made of: palpate.Materials.
struct MaterialsOf {
  std::shared_ptr<const MaterialTable> table;
};

/// Labels without a brightness, or the other way round, or both.
/// @param labels      uint8 (height, width), or None
/// @param brightness  likewise
/// @return null if nothing is given
/// @throws Error or TypeError for arrays of another form
std::shared_ptr<const MaterialMap> make_map(const Intrinsics& k,
                                            const std::optional<MaterialsOf>& materials,
                                            const py::object& labels, const py::object& brightness);

/// A camera that is a Python object: iterating over it gives (cloud, stamp) or ends. Its attribute
/// `live`, if it has one, says that stamps are time.monotonic(); with an attribute
/// `scale_reference` it is brought to metres (with_scale_reference). [with the lock]
/// @throws Error if one cannot iterate over it, or as with_scale_reference
std::unique_ptr<Source> open_python_source(const py::object& camera);

/// Lets Python handle a signal, such as Ctrl-C; throws what it raises. Takes the GIL.
void check_signals();

/// An object of Python's that C++ may release on any thread.
std::shared_ptr<const py::object> kept(py::object object);

/// What the parts of the module define.
void define_core(py::module_& module);
void define_sources(py::module_& module);
void define_session(py::module_& module);
void define_bench(py::module_& module);

}  // namespace palpate::python
