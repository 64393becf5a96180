// SPDX-License-Identifier: Apache-2.0
// palpate's own renderer as a method under test.
#include "lab/method.hpp"

namespace palpate::lab {
namespace {

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
std::unique_ptr<TouchMethod> make(const MethodSetup& setup) {
  Parameters parameters = setup.parameters;
  parameters.method = method;
  return std::make_unique<KernelMethod>(parameters);
}

}  // namespace

std::vector<MethodInfo> kernel_methods() {
  return {
      {"paper", "Rydén and Chizeck 2013, errata corrected", make<Method::paper>},
      {"paper-as-printed", "Rydén and Chizeck 2013, to the letter", make<Method::paper_as_printed>},
      {"fixed-step", "Rydén 2011 [1]: steps of 0.1 r_1, no velocity", make<Method::fixed_step>},
      {"sight", "sightline tracking with remembered sides (docs/method.md)", make<Method::sight>}};
}

}  // namespace palpate::lab
