// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "app/options.hpp"
#include "app/progress.hpp"
#include "app/verbs.hpp"
#include "lab/experiment.hpp"
#include "lab/method.hpp"
#include "lab/report.hpp"
#include "lab/runner.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::app {
namespace {

namespace fs = std::filesystem;

struct EvalOptions {
  std::vector<std::string> names;
  std::string out = "eval", grid, noise = "white";
  lab::ExperimentOptions given;  // but for what is checked first
  std::int64_t seed = 1;
  int jobs = 0;
  int cases = 0;
  bool resume = false;
  bool list_methods = false;
  bool list_experiments = false;
  MethodOptions parameters;
};

std::pair<int, int> parse_grid(const std::string& text) {
  const std::size_t cross = text.find('x');
  const Error error("--grid " + text, "it is not NxM with N and M from 1 to 100000",
                    "write for example --grid 76x71");
  if (cross == std::string::npos) throw error;
  const double n = parse_number("--grid " + text, text.substr(0, cross));
  const double m = parse_number("--grid " + text, text.substr(cross + 1));
  const auto whole = [](double v) { return v >= 1.0 && v <= 1e5 && v == static_cast<int>(v); };
  if (!whole(n) || !whole(m)) throw error;
  return {static_cast<int>(n), static_cast<int>(m)};
}

lab::ExperimentOptions experiment_options(const EvalOptions& options) {
  lab::ExperimentOptions result = options.given;
  result.parameters = options.parameters.session(lab::methods()).parameters;
  if (options.seed < 0)
    throw Error("--seed " + std::to_string(options.seed), "it is negative",
                "use a whole number from 0 on");
  result.seed = static_cast<std::uint64_t>(options.seed);
  if (!options.grid.empty()) result.grid = parse_grid(options.grid);
  if (options.cases < 0 || options.cases > 10'000'000)
    throw Error("--cases " + std::to_string(options.cases), "it is not from 1 to 10000000",
                "write for example --cases 1000");
  if (options.cases > 0) result.cases = options.cases;
  if (options.noise == "correlated")
    result.noise = lab::Noise::correlated;
  else if (options.noise != "white")
    throw Error("--noise " + options.noise, "there is no such noise", "choose white or correlated");
  return result;
}

int eval(const EvalOptions& options) {
  if (options.list_methods) {
    const MethodRegistry methods = lab::methods();
    for (const MethodInfo& method : methods.entries()) fmt::print("{}\n", method.name);
    return 0;
  }
  if (options.list_experiments) {
    for (const lab::Experiment& experiment : lab::known_experiments())
      fmt::print("{:<14} {}\n", experiment.name, experiment.summary);
    return 0;
  }
  if (options.names.empty())
    throw Error("eval", "no experiment is given", "see 'palpate eval --list' for their names");
  const lab::ExperimentOptions given = experiment_options(options);
  std::vector<const lab::Experiment*> experiments;
  if (std::find(options.names.begin(), options.names.end(), "all") != options.names.end()) {
    for (const lab::Experiment& experiment : lab::known_experiments())
      experiments.push_back(&experiment);
  } else {
    for (const std::string& name : options.names) {
      experiments.push_back(&lab::find_experiment(name));
      if (given.grid && !experiments.back()->has_grid)
        throw Error("--grid", "the experiment '" + name + "' has no grid", "leave it out");
      if (!given.recording.empty() && !experiments.back()->takes_recording)
        throw Error("--recording", "the experiment '" + name + "' is a simulation",
                    "remove this option, or use real");
    }
  }
  lab::RunnerOptions runner;
  runner.jobs = lab::threads_of(options.jobs);
  runner.resume = options.resume;

  std::error_code error;
  fs::create_directories(options.out, error);
  if (error)
    throw Error("--out " + options.out, "the folder cannot be created: " + error.message(),
                "use a folder with write permission");
  std::vector<lab::Result> results;
  for (const lab::Experiment* experiment : experiments) {
    lab::ExperimentOptions fitting = given;
    if (!experiment->has_grid) fitting.grid.reset();
    if (!experiment->takes_recording) fitting.recording.clear();
    std::unique_ptr<Progress> progress;
    runner.progress = [&](std::size_t done, std::size_t total) {
      if (!progress) progress = std::make_unique<Progress>(std::string(experiment->name), total);
      progress->set(done);
    };
    const fs::path csv = fs::path(options.out) / (std::string(experiment->name) + ".csv");
    const std::string text = lab::run_experiment(*experiment, fitting, runner, csv);
    if (progress) progress->finish();
    results.push_back(lab::make_result(*experiment, fitting, text));
    fmt::print("{}", lab::result_as_text(results.back()));
  }
  lab::write_report(results, options.out);
  fmt::print("wrote {0}; `python3 -m palpate.figures {0}/*.csv` draws the figures\n", options.out);
  return 0;
}

}  // namespace

Verb add_eval(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "eval", "run experiments: the paper's figures and claims, and the benchmark of methods");
  const auto options = std::make_shared<EvalOptions>();
  command->add_option("experiment", options->names, "its name, several, or all; see --list");
  command->add_option("--out", options->out, "folder for CSV files and tables (eval)");
  add_repeated(*command, "--methods", options->given.methods,
               "methods to compare, separated by commas; see --list-methods")
      ->delimiter(',');
  command->add_option("--grid", options->grid, "NxM: size of the first two axes, e.g. 76x71");
  command->add_option("--cases", options->cases,
                      "pop, field, visits: number of cases of each family or class (50, 5, 4); "
                      "real: positions to press and stroke instead");
  add_repeated(*command, "--families", options->given.families,
               "pop, field, visits, fidelity, feel: which, separated by commas")
      ->delimiter(',');
  add_repeated(*command, "--fix", options->given.fixed,
               "pop, field, visits: KEY=VALUE instead of a random value");
  command->add_option("--case", options->given.case_text,
                      "pop, field, visits: one case as a run printed it, such as field:...");
  command->add_option("--noise", options->noise, "white (default) or correlated");
  command->add_option("--recording", options->given.recording,
                      "real: touch a recording, e.g. tum:FOLDER, instead of the synthetic desk");
  command->add_option("--seed", options->seed, "random seed of all noise (1)");
  command->add_option("--jobs", options->jobs, "threads (one a core)");
  command->add_flag("--resume", options->resume,
                    "continue from the finished cells of an interrupted run");
  command->add_flag("--list", options->list_experiments, "list the experiments");
  command->add_flag("--list-methods", options->list_methods, "list the methods, one per line");
  options->parameters.add_parameters_to(*command);
  return {command, [options] { return eval(*options); }};
}

}  // namespace palpate::app
