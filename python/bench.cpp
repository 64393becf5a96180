// SPDX-License-Identifier: Apache-2.0
// The lab's benches, also for methods written in Python.
#include <atomic>
#include <chrono>
#include <future>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "lab/experiment.hpp"
#include "lab/runner.hpp"
#include "palpate/core/error.hpp"

#include "python/arrays.hpp"
#include "python/python_method.hpp"

namespace palpate::python {
namespace {

// How long a wait lasts before Python is asked for signals.
constexpr std::chrono::milliseconds between_signals{50};

/// Runs a bench and gives its scores.
/// @param own   names and functions that make a fresh object of a method, one for each case
/// @param file  where the CSV goes
py::dict bench(const std::string& name, const std::vector<std::string>& methods,
               const std::vector<std::pair<std::string, py::function>>& own,
               const std::string& file, const std::optional<int>& cases, std::uint64_t seed,
               const std::vector<std::string>& families, int jobs, const py::kwargs& values) {
  const lab::Experiment& experiment = lab::find_experiment(name);
  if (experiment.scores == nullptr) throw Error(name, "it is no bench", "give pop or fidelity");
  if (!own.empty() && name != "pop" && name != "fidelity")
    throw Error(name, "it knows the lab's methods alone", "give pop or fidelity");
  lab::ExperimentOptions options;
  options.methods = methods;
  options.cases = cases;
  options.seed = seed;
  options.families = families;
  set_all(options.parameters, values);
  const auto trouble = std::make_shared<Trouble>();
  for (const auto& [own_name, make] : own) {
    options.methods.push_back(own_name);
    // Copied by threads that do not hold the GIL, so not as an object of Python's.
    options.own_methods.push_back(
        {own_name, [trouble, maker = kept(make)](const lab::MethodSetup& setup) {
           trouble->rethrow();
           const py::gil_scoped_acquire gil;
           const auto& function = *static_cast<const py::object*>(maker.get());
           return method_of(function(), setup.parameters, trouble);
         }});
  }
  // On a thread of its own: only this one, Python's main thread, sees Ctrl-C.
  std::atomic<bool> interrupted = false;
  lab::RunnerOptions runner;
  runner.jobs = jobs;
  runner.progress = [&](std::size_t, std::size_t) {
    if (interrupted) throw std::runtime_error("interrupted");
  };
  std::string csv;
  {
    const py::gil_scoped_release released;
    auto run = std::async(std::launch::async,
                          [&] { return lab::run_experiment(experiment, options, runner, file); });
    std::exception_ptr signal;
    while (run.wait_for(between_signals) != std::future_status::ready) {
      if (signal) continue;
      try {
        check_signals();
      } catch (...) {
        signal = std::current_exception();
        interrupted = true;
      }
    }
    if (signal) std::rethrow_exception(signal);
    try {
      csv = run.get();
    } catch (...) {
      trouble->rethrow();  // rather than what it led to
      throw;
    }
  }
  trouble->rethrow();
  const lab::Scores scores = experiment.scores(lab::Table(name, csv));
  py::dict result;
  result["columns"] = scores.columns;
  result["rows"] = scores.rows;
  result["note"] = scores.note;
  result["csv"] = csv;
  return result;
}

}  // namespace

void define_bench(py::module_& m) {
  m.def("_bench", &bench, py::arg("name"), py::arg("methods"), py::arg("own"), py::arg("file"),
        py::arg("cases"), py::arg("seed"), py::arg("families"), py::arg("jobs"));
  m.def("_bench_methods", [] {
    py::dict all;
    const MethodRegistry methods = lab::methods();
    for (const MethodInfo& method : methods.entries()) all[py::str(method.name)] = method.summary;
    return all;
  });
}

}  // namespace palpate::python
