// SPDX-License-Identifier: Apache-2.0
// palpate-lab: the program with the lab's methods and its experiments.
#include <array>

#include "app/program.hpp"
#include "lab/method.hpp"
#include "palpate/io/sources/synthetic_camera.hpp"

namespace palpate::app {

Verb add_eval(CLI::App& program);
Verb add_bench_entry(CLI::App& program);
Verb add_bench_check(CLI::App& program);

MethodRegistry program_methods(const Source* camera) {
  const auto* synthetic = dynamic_cast<const SyntheticCamera*>(camera);
  if (synthetic == nullptr) return lab::methods();
  return lab::methods(lab::truth_of(std::make_shared<const Scene>(synthetic->scene())));
}

}  // namespace palpate::app

int main(int argc, char** argv) {
  constexpr std::array<palpate::app::AddVerb, 3> own = {
      palpate::app::add_eval, palpate::app::add_bench_entry, palpate::app::add_bench_check};
  return palpate::app::run_program(argc, argv, own);
}
