// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "lab/method.hpp"

namespace palpate::lab {

/// palpate's own renderer as a method under test.
class KernelMethod final : public TouchMethod {
 public:
  explicit KernelMethod(const Parameters& parameters) : renderer_(parameters) {}
  void seat(const Vec3& proxy) override { renderer_.seat(proxy); }
  void frame(const Cloud& cloud, double stamp) override { renderer_.frame(cloud, stamp); }
  Tick tick(const Vec3& hip, double t) override { return renderer_.tick(hip, t); }

 private:
  Renderer renderer_;
};

template <Method method>
std::unique_ptr<TouchMethod> make_kernel(const MethodSetup& setup) {
  Parameters parameters = setup.parameters;
  parameters.method = method;
  return std::make_unique<KernelMethod>(parameters);
}

}  // namespace palpate::lab
