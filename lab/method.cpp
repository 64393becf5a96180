// SPDX-License-Identifier: Apache-2.0
#include "lab/method.hpp"

#include "lab/methods/direct.hpp"
#include "lab/methods/ideal.hpp"
#include "lab/methods/kernel.hpp"
#include "palpate/core/error.hpp"

namespace palpate::lab {

Truth truth_of(const std::shared_ptr<const Scene>& scene) {
  return [scene](const Vec3& p, double t) {
    const SurfacePoint nearest = scene->nearest(p, t);
    return TruePoint{nearest.distance, nearest.normal};
  };
}

const std::vector<MethodInfo>& known_methods() {
  // Adding a method: one file in lab/methods, one line here.
  static const std::vector<MethodInfo> methods = {
      {"paper", "Rydén and Chizeck 2013, errata corrected", make_kernel<Method::paper>},
      {"paper-as-printed", "Rydén and Chizeck 2013, to the letter",
       make_kernel<Method::paper_as_printed>},
      {"fixed-step", "Rydén 2011 [1]: steps of 0.1 r_1, no velocity",
       make_kernel<Method::fixed_step>},
      {"sight", "sightline tracking with remembered sides (docs/method.md)",
       make_kernel<Method::sight>},
      {"direct", "penalty force on a moving-least-squares surface (2.1, [7])", make_direct},
      {"ideal", "the proxy on the true surface: the ruler", make_ideal},
  };
  return methods;
}

const MethodInfo& find_method(std::string_view name) {
  std::vector<std::string_view> names;
  std::string list;
  for (const MethodInfo& method : known_methods()) {
    if (method.name == name) return method;
    names.push_back(method.name);
    list += (list.empty() ? "" : ", ") + std::string(method.name);
  }
  const std::string_view near = nearest_name(name, names);
  throw Error("method '" + std::string(name) + "'", "there is no such method",
              (near.empty() ? "" : "did you mean '" + std::string(near) + "'? ") +
                  ("the methods are " + list));
}

std::unique_ptr<TouchMethod> make_method(std::string_view name, const MethodSetup& setup) {
  return find_method(name).make(setup);
}

}  // namespace palpate::lab
