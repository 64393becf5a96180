// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "palpate/kernel/core/error.hpp"

#include "python/arrays.hpp"

PYBIND11_MODULE(_core, m) {
  using namespace palpate::python;  // NOLINT(google-build-using-namespace)
  m.doc() = "palpate's library, as the package palpate shows it.";
  m.attr("__version__") = PALPATE_VERSION;
#if PYBIND11_VERSION_HEX < 0x020C0000  // would take an element of an array to have no bytes
  if (std::stoi(py::module_::import("numpy").attr("__version__").cast<std::string>()) > 1)
    throw py::import_error(
        "palpate was built with a pybind11 older than 2.12, which cannot read "
        "arrays of numpy 2; install the distribution's numpy, or 'numpy<2'");
#endif
  const auto error = py::register_exception<palpate::Error>(m, "Error", PyExc_ValueError);
  error.attr("__doc__") = "Bad input: one line that says what was wrong and what to do.";
  PYBIND11_NUMPY_DTYPE(TickRecord, t, hip, proxy, normal, force, torque, orientation,
                       proxy_orientation, surface_velocity, frame, steps, flags, state);
  PYBIND11_NUMPY_DTYPE(CycleRecord, t, hip, proxy, normal, asked, force, torque, position,
                       orientation, proxy_orientation, surface_velocity, gain, frame_age, frame,
                       number, steps, flags, safety, hand, state);
  define_core(m);
  define_sources(m);
  define_session(m);
  define_bench(m);
}
