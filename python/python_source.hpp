// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "palpate/io/sources/source.hpp"

#include "python/arrays.hpp"

namespace palpate::python {

/// A camera that is a Python object: iterating over it gives (cloud, stamp) or ends. Takes the
/// interpreter's lock for each frame, and copies depth, so that nothing else needs it.
class PythonSource final : public Source {
 public:
  /// [with the lock] Its attribute `live`, if it has one, says that stamps are time.monotonic().
  /// @throws Error if one cannot iterate over it.
  explicit PythonSource(const py::object& camera);
  ~PythonSource() override;
  PythonSource(const PythonSource&) = delete;
  PythonSource& operator=(const PythonSource&) = delete;

  /// Waits as long as the object does. @throws Error with the object's exception.
  std::optional<Frame> next(double timeout = no_timeout) override;
  [[nodiscard]] const SourceInfo& info() const override { return info_; }

 private:
  SourceInfo info_;
  py::iterator frames_;
};

/// The camera that an object is, brought to metres where it has an attribute `scale_reference`
/// (with_scale_reference). [with the lock] @throws Error as these do
std::unique_ptr<Source> open_python_source(const py::object& camera);

}  // namespace palpate::python
