// SPDX-License-Identifier: Apache-2.0
#include "lab/experiment.hpp"

#include "lab/experiments/feel.hpp"
#include "lab/experiments/fidelity.hpp"
#include "lab/experiments/field.hpp"
#include "lab/experiments/forces.hpp"
#include "lab/experiments/lifts.hpp"
#include "lab/experiments/methods.hpp"
#include "lab/experiments/pop.hpp"
#include "lab/experiments/real.hpp"
#include "lab/experiments/scan.hpp"
#include "lab/experiments/surfaces.hpp"
#include "lab/experiments/tradeoff.hpp"
#include "lab/method.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"

namespace palpate::lab {

const std::vector<Experiment>& known_experiments() {
  static const std::vector<Experiment> experiments = {
      flat_experiment(),     jump_experiment(),     single_lift_experiment(),   lift_experiment(),
      bound_experiment(),    speed_experiment(),    first_contact_experiment(), hold_experiment(),
      force_experiment(),    damping_experiment(),  corners_experiment(),       scan_experiment(),
      fidelity_experiment(), feel_experiment(),     pop_experiment(),           field_experiment(),
      real_experiment(),     tradeoff_experiment(), methods_experiment()};
  return experiments;
}

const Experiment& find_experiment(std::string_view name) {
  std::vector<std::string_view> names;
  std::string list;
  for (const Experiment& experiment : known_experiments()) {
    if (experiment.name == name) return experiment;
    names.push_back(experiment.name);
    list += (list.empty() ? "" : ", ") + std::string(experiment.name);
  }
  const std::string_view near = nearest_name(name, names);
  throw Error("experiment '" + std::string(name) + "'", "there is no such experiment",
              (near.empty() ? "" : "did you mean '" + std::string(near) + "'? ") +
                  ("the experiments are " + list + " and all"));
}

std::vector<std::string> methods_of(const Experiment& experiment,
                                    const ExperimentOptions& options) {
  if (options.methods.empty())
    return {experiment.default_methods.begin(), experiment.default_methods.end()};
  for (const std::string& name : options.methods) static_cast<void>(methods().find(name));
  return options.methods;
}

}  // namespace palpate::lab
