// SPDX-License-Identifier: Apache-2.0
// The lab's benches, also for methods written in Python.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <future>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <unistd.h>

#include "lab/entry.hpp"
#include "lab/experiment.hpp"
#include "lab/runner.hpp"
#include "palpate/kernel/core/error.hpp"

#include "python/arrays.hpp"
#include "python/python_method.hpp"

namespace palpate::python {
namespace {

using namespace py::literals;

// How long a wait lasts before Python is asked for signals.
constexpr std::chrono::milliseconds bench_pause{50};

using Own = std::vector<std::pair<std::string, py::function>>;

// Methods that functions of Python's make, a fresh object for each case.
std::vector<lab::OwnMethod> own_methods(const Own& own, const std::shared_ptr<Trouble>& trouble) {
  std::vector<lab::OwnMethod> methods;
  for (const auto& [name, make] : own) {
    // Copied by threads that do not hold the GIL, so not as an object of Python's.
    methods.push_back({name, [trouble, maker = kept(make)](const lab::MethodSetup& setup) {
                         trouble->rethrow();
                         const py::gil_scoped_acquire gil;
                         return method_of((*maker)(), setup.parameters, trouble);
                       }});
  }
  return methods;
}

// Does the work on a thread of its own, as only this one, Python's main thread, sees Ctrl-C.
// @param work  gets how its cells are to be run, and gives a result
template <class Work>
auto on_a_thread(int jobs, const std::shared_ptr<Trouble>& trouble, const Work& work) {
  std::atomic<bool> interrupted = false;
  std::atomic<std::size_t> done = 0, total = 0;
  lab::RunnerOptions runner;
  runner.jobs = jobs;
  runner.progress = [&](std::size_t so_far, std::size_t of) {
    done = so_far, total = of;
    if (interrupted) throw std::runtime_error("interrupted");
  };
  const bool watched = isatty(STDERR_FILENO) == 1;
  const py::gil_scoped_release released;
  auto run = std::async(std::launch::async, [&] { return work(runner); });
  std::exception_ptr signal;
  for (std::size_t shown = 0; run.wait_for(bench_pause) != std::future_status::ready;) {
    if (watched && done != shown)
      std::fprintf(stderr, "\rbench: %zu of %zu", shown = done, total.load());
    if (signal) continue;
    try {
      check_signals();
    } catch (...) {
      signal = std::current_exception();
      interrupted = true;
    }
  }
  if (watched) std::fputs("\r\033[K", stderr);
  if (signal) std::rethrow_exception(signal);
  try {
    auto result = run.get();
    trouble->rethrow();
    return result;
  } catch (...) {
    trouble->rethrow();  // rather than what it led to
    throw;
  }
}

/// Runs a bench and gives its scores.
/// @param own   names and functions that make a fresh object of a method, one for each case
/// @param file  where the CSV goes
py::dict bench(const std::string& name, const std::vector<std::string>& methods, const Own& own,
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
  options.own_methods = own_methods(own, trouble);
  for (const lab::OwnMethod& method : options.own_methods) options.methods.push_back(method.name);
  const std::string csv = on_a_thread(jobs, trouble, [&](const lab::RunnerOptions& runner) {
    return lab::run_experiment(experiment, options, runner, file);
  });
  const lab::Scores scores = experiment.scores(lab::Table(name, csv));
  return py::dict("columns"_a = scores.columns, "rows"_a = scores.rows, "note"_a = scores.note,
                  "csv"_a = csv);
}

/// Makes an entry of the bench and gives its text.
/// @param run  what is said of the machine and the time
std::string entry(const std::string& method, const Own& own, const std::string& file,
                  std::uint64_t seed, int cases, int repeats,
                  const std::vector<std::string>& recordings, int jobs, const lab::EntryRun& run) {
  const auto trouble = std::make_shared<Trouble>();
  lab::EntryOptions options;
  options.method = method;
  options.seed = seed;
  options.cases = cases;
  options.repeats = repeats;
  options.recordings = recordings;
  options.own_methods = own_methods(own, trouble);
  return on_a_thread(jobs, trouble, [&](const lab::RunnerOptions& runner) {
    return lab::make_entry(options, run, runner, file);
  });
}

/// Plays a sample of an entry again.
py::dict check(const std::string& file, const Own& own, std::size_t sample, std::uint64_t chance,
               const std::vector<std::string>& recordings, int jobs) {
  const auto trouble = std::make_shared<Trouble>();
  const std::vector<lab::OwnMethod> methods = own_methods(own, trouble);
  const lab::EntryCheck check = on_a_thread(jobs, trouble, [&](const lab::RunnerOptions& runner) {
    return lab::check_entry(file, sample, chance, recordings, methods, runner);
  });
  return py::dict("holds"_a = check.holds, "played"_a = check.played, "entered"_a = check.entered,
                  "differences"_a = check.differences, "faults"_a = check.faults,
                  "left_out"_a = check.left_out);
}

}  // namespace

void define_bench(py::module_& m) {
  m.def("_bench", &bench, py::arg("name"), py::arg("methods"), py::arg("own"), py::arg("file"),
        py::arg("cases"), py::arg("seed"), py::arg("families"), py::arg("jobs"));
  m.def("_bench_entry", &entry, py::arg("method"), py::arg("own"), py::arg("file"), py::arg("seed"),
        py::arg("cases"), py::arg("repeats"), py::arg("recordings"), py::arg("jobs"),
        py::arg("run"));
  m.def("_bench_check", &check, py::arg("file"), py::arg("own"), py::arg("sample"),
        py::arg("chance"), py::arg("recordings"), py::arg("jobs"));
  m.def("_bench_methods", [] { return summaries_of(lab::methods()); });
}

}  // namespace palpate::python
