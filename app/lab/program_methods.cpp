// SPDX-License-Identifier: Apache-2.0
#include "app/program_methods.hpp"

#include "lab/method.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"

namespace palpate::app {

MethodRegistry program_methods(const Source* camera) {
  const auto* synthetic = dynamic_cast<const SyntheticCamera*>(camera);
  if (synthetic == nullptr) return lab::methods();
  return lab::methods(lab::truth_of(std::make_shared<const Scene>(synthetic->scene())));
}

}  // namespace palpate::app
