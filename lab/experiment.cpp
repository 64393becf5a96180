// SPDX-License-Identifier: Apache-2.0
#include "lab/experiment.hpp"

#include <utility>

#include <fmt/format.h>

#include "lab/method.hpp"
#include "lab/pipe_method.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/text.hpp"

namespace palpate::lab {

// The experiments, in the order of the report: a file of lab/experiments defines `Experiment
// NAME_experiment()`. Adding an experiment: that, and its name here.
// clang-format off
#define PALPATE_EXPERIMENTS(name)                                                             \
  name(flat) name(single_lift) name(lift) name(bound) name(corners) name(scan)                \
  name(fidelity) name(feel) name(cameras) name(zwidth) name(tool) name(tool_cases)            \
  name(turning) name(splat) name(materials) name(teleop) name(teleop_faults) name(pop)        \
  name(field) name(visits) name(real)
// clang-format on

#define PALPATE_DECLARE(name) Experiment name##_experiment();
PALPATE_EXPERIMENTS(PALPATE_DECLARE)
#undef PALPATE_DECLARE

const std::vector<Experiment>& known_experiments() {
#define PALPATE_MAKE(name) name##_experiment(),
  static const std::vector<Experiment> experiments = {PALPATE_EXPERIMENTS(PALPATE_MAKE)};
#undef PALPATE_MAKE
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

void check_families(const ExperimentOptions& options, std::string_view what,
                    std::span<const std::string_view> known) {
  for (const std::string& name : options.families) {
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw Error("--families " + name, std::string(what), did_you_mean(name, known));
  }
}

AimTable::AimTable(std::vector<std::string> labels, std::vector<std::string> methods)
    : methods_(std::move(methods)), met_(methods_.size(), 0) {
  scores_.columns = std::move(labels);
  scores_.columns.emplace_back("aim");
  scores_.columns.insert(scores_.columns.end(), methods_.begin(), methods_.end());
}

void AimTable::add(std::vector<std::string> labels, std::optional<double> aim,
                   const std::vector<std::optional<double>>& values) {
  std::vector<std::string> line = std::move(labels);
  line.push_back(aim ? fmt::format("<= {:g}", *aim) : "-");
  aims_ += aim ? 1 : 0;
  for (std::size_t m = 0; m < methods_.size(); ++m) {
    const bool missed = aim && !(values[m] && *values[m] <= *aim);
    met_[m] += aim && !missed ? 1 : 0;
    line.push_back((values[m] ? fmt::format("{:.3g}", *values[m]) : "-") + (missed ? " *" : ""));
  }
  scores_.rows.push_back(std::move(line));
}

Scores AimTable::scores(std::string note) const {
  Scores scores = scores_;
  std::vector<std::string> line(scores.columns.size() - methods_.size() - 1);
  line.front() = "aims met";
  line.push_back(fmt::format("{}", aims_));
  for (const int count : met_) line.push_back(fmt::format("{}", count));
  scores.rows.push_back(std::move(line));
  scores.note = std::move(note);
  return scores;
}

std::string measure_text(std::string_view name, std::string_view unit) {
  return unit.empty() ? std::string(name) : fmt::format("{} [{}]", name, unit);
}

}  // namespace palpate::lab
