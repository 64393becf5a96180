// SPDX-License-Identifier: Apache-2.0
#include "lab/method.hpp"

#include "lab/pipe_method.hpp"
#include "palpate/io/sources/scene.hpp"
#include "palpate/kernel/methods/methods.hpp"

namespace palpate::lab {

Truth truth_of(const std::shared_ptr<const Scene>& scene) {
  return [scene](const Vec3& p, double t) {
    const SurfacePoint nearest = scene->nearest(p, t);
    return TruePoint{nearest.distance, nearest.normal};
  };
}

Tick LabMethod::held(const Vec3& hip, const Contact& contact, double t) const {
  Tick tick = free(hip, t);
  tick.state = ContactState::contact;
  tick.normal = contact.normal;
  tick.proxy = contact.point + parameters_.proxy.r_c() * contact.normal;
  tick.force = parameters_.coupling.stiffness * (contact.point - hip);
  const double most = parameters_.coupling.max_force;
  if (tick.force.norm() > most) tick.force *= most / tick.force.norm();
  return tick;
}

// The files of lab/methods, in the order in which tables show their methods. FILE.cpp defines
// `std::vector<MethodInfo> FILE_methods()`. Adding a method: its file, and one line here.
// clang-format off
#define PALPATE_METHOD_FILES(file) \
  file(virtual_coupling)           \
  file(god_object)                 \
  file(direct)                     \
  file(point_boxes)                \
  file(radial_fields)              \
  file(surfels)                    \
  file(image_features)             \
  file(tsdf)
// clang-format on

#define PALPATE_DECLARE(name) std::vector<MethodInfo> name##_methods();
PALPATE_METHOD_FILES(PALPATE_DECLARE)
#undef PALPATE_DECLARE
MethodInfo ideal_method(const Truth& truth);

MethodRegistry methods(const Truth& truth) {
  static const MethodRegistry without_truth = [] {
    MethodRegistry all = standard_methods();
    const auto add = [&all](std::vector<MethodInfo> of_file) {
      for (MethodInfo& method : of_file) {
        method.bounded = false;
        all.add(std::move(method));
      }
    };
#define PALPATE_ADD(name) add(name##_methods());
    PALPATE_METHOD_FILES(PALPATE_ADD)
#undef PALPATE_ADD
    return all;
  }();
  MethodRegistry all = without_truth;
  all.add(ideal_method(truth));
  return all;
}

std::unique_ptr<Method> make_method(std::string_view name, const MethodSetup& setup,
                                    const std::vector<OwnMethod>& own) {
  for (const OwnMethod& method : own) {
    if (method.name == name) return method.make(setup);
  }
  if (is_pipe(name)) return make_pipe_method(name, setup.parameters);
  return palpate::make_method(name, setup.parameters, methods(setup.truth));
}

}  // namespace palpate::lab
