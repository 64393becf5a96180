// SPDX-License-Identifier: Apache-2.0
#include "lab/experiment.hpp"

#include <algorithm>

#include "lab/experiments/experiments.hpp"
#include "lab/find_named.hpp"
#include "lab/method.hpp"
#include "lab/pipe_method.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {

const std::vector<Experiment>& known_experiments() {
  static const std::vector<Experiment> experiments = {
      flat_experiment(),          jump_experiment(),    single_lift_experiment(),
      lift_experiment(),          bound_experiment(),   speed_experiment(),
      first_contact_experiment(), hold_experiment(),    force_experiment(),
      damping_experiment(),       corners_experiment(), scan_experiment(),
      fidelity_experiment(),      feel_experiment(),    zwidth_experiment(),
      materials_experiment(),     teleop_experiment(),  teleop_faults_experiment(),
      pop_experiment(),           field_experiment(),   visits_experiment(),
      real_experiment()};
  return experiments;
}

const Experiment& find_experiment(std::string_view name) {
  return find_named(known_experiments(), name, "experiment", "there is no such experiment", "all");
}

std::vector<std::string> methods_of(const Experiment& experiment,
                                    const ExperimentOptions& options) {
  if (options.methods.empty())
    return {experiment.default_methods.begin(), experiment.default_methods.end()};
  for (const std::string& name : options.methods) {
    const bool is_own = std::any_of(options.own_methods.begin(), options.own_methods.end(),
                                    [&](const OwnMethod& method) { return method.name == name; });
    if (is_pipe(name)) {
      if (!experiment.plays_programs)
        throw Error("--methods " + name,
                    "the experiment '" + std::string(experiment.name) +
                        "' runs only the methods of the lab",
                    "use a program only with pop, fidelity, real or bench-entry");
      continue;
    }
    if (!is_own) static_cast<void>(methods().find(name));
  }
  return options.methods;
}

}  // namespace palpate::lab
