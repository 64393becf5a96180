// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <memory>
#include <optional>

#include "palpate/kernel/core/method.hpp"

#include "python/arrays.hpp"

namespace palpate::python {

/// What a method written in Python sees of a cloud: good until its next frame.
class CloudView {
 public:
  explicit CloudView(const Cloud* cloud) : cloud_(cloud) {}
  void end() noexcept { cloud_ = nullptr; }
  /// Points [m, world] within `radius` [m] of `centre`, at most Patch::capacity.
  /// @throws Error after the method's next frame.
  [[nodiscard]] Points near(const Numbers& about, double radius);
  /// [m] world: from where the first camera's points were seen; none if that is not known.
  [[nodiscard]] std::optional<Vec3> viewpoint();

 private:
  [[nodiscard]] const Patch& gathered(const Ball& ball);

  const Cloud* cloud_;
  std::unique_ptr<Patch> patch_;
};

/// The first exception of a method written in Python: a tick cannot throw, so whoever runs the
/// ticks asks for it.
struct Trouble {
  std::exception_ptr first;
  void rethrow() const {
    if (first) std::rethrow_exception(first);
  }
};

/// A method by its name, or an object of a class derived from palpate.Method, which takes the GIL
/// for each call and touches nothing more after an exception.
/// @throws Error for an unknown name, or parameters that do not validate.
std::unique_ptr<Method> method_of(const py::object& method, const Parameters& parameters,
                                  const std::shared_ptr<Trouble>& trouble);

/// name -> summary
py::dict summaries_of(const MethodRegistry& methods);

}  // namespace palpate::python
