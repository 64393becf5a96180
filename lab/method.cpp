// SPDX-License-Identifier: Apache-2.0
#include "lab/method.hpp"

#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"

namespace palpate::lab {

Truth truth_of(const std::shared_ptr<const Scene>& scene) {
  return [scene](const Vec3& p, double t) {
    const SurfacePoint nearest = scene->nearest(p, t);
    return TruePoint{nearest.distance, nearest.normal};
  };
}

// The files of lab/methods, in the order in which tables show their methods. FILE.cpp defines
// `std::vector<MethodInfo> FILE_methods()`. Adding a method: its file, and one line here.
// clang-format off
#define PALPATE_METHOD_FILES(file) \
  file(kernel)                     \
  file(virtual_coupling)           \
  file(god_object)                 \
  file(direct)                     \
  file(point_boxes)                \
  file(radial_fields)              \
  file(surfels)                    \
  file(image_features)             \
  file(tsdf)                       \
  file(ideal)
// clang-format on

#define PALPATE_DECLARE(name) std::vector<MethodInfo> name##_methods();
PALPATE_METHOD_FILES(PALPATE_DECLARE)
#undef PALPATE_DECLARE

const std::vector<MethodInfo>& known_methods() {
  static const std::vector<MethodInfo> methods = [] {
    std::vector<MethodInfo> all;
    const auto add = [&all](const std::vector<MethodInfo>& of_file) {
      all.insert(all.end(), of_file.begin(), of_file.end());
    };
#define PALPATE_ADD(name) add(name##_methods());
    PALPATE_METHOD_FILES(PALPATE_ADD)
#undef PALPATE_ADD
    return all;
  }();
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
