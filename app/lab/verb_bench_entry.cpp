// SPDX-License-Identifier: Apache-2.0
#include <ctime>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/machine.hpp"
#include "app/options.hpp"
#include "app/progress.hpp"
#include "app/verbs.hpp"
#include "lab/entry.hpp"
#include "lab/runner.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::app {
namespace {

struct EntryArguments {
  lab::EntryOptions entry;
  std::string out = "entry.json";
  std::optional<std::uint64_t> seed;
  int jobs = 0;
  bool resume = false;
};

struct CheckArguments {
  std::string file;
  std::size_t sample = 20;
  std::vector<std::string> recordings;
  int jobs = 0;
};

std::uint64_t by_chance() {
  std::random_device bits;
  return bits();
}

// One thread a core; a line of progress where a person watches.
lab::RunnerOptions runner_options(int jobs, std::shared_ptr<Progress>& progress) {
  lab::RunnerOptions runner;
  runner.jobs = lab::threads_of(jobs);
  runner.progress = [&progress](std::size_t done, std::size_t total) {
    if (!progress) progress = std::make_shared<Progress>("bench", total);
    progress->set(done);
  };
  return runner;
}

int enter(const EntryArguments& arguments) {
  lab::EntryOptions options = arguments.entry;
  options.seed = arguments.seed.value_or(by_chance());
  const Machine machine = look_at_machine();
  const lab::EntryRun run = {
      {"date", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)))},
      {"processor", machine.processor},
      {"compiler", __VERSION__}};
  std::shared_ptr<Progress> progress;
  lab::RunnerOptions runner = runner_options(arguments.jobs, progress);
  runner.resume = arguments.resume;
  const std::string text = lab::make_entry(options, run, runner, arguments.out);
  if (progress) progress->finish();
  const nlohmann::json entry = nlohmann::json::parse(text);
  const auto line = [](const std::string& name, const nlohmann::json& score) {
    if (score.is_string())
      fmt::print("{:<22} {}\n", name, score.get<std::string>());
    else
      fmt::print("{:<22} {:.2f} %, {:.2f} to {:.2f}\n", name, score["value"].get<double>(),
                 score["low"].get<double>(), score["high"].get<double>());
  };
  const nlohmann::json& scores = entry["scores"];
  line("score", scores["score"]);
  line("held", scores["held"]);
  line("pop, right", scores["pop"]["right"]);
  line("fidelity, aims met", scores["fidelity"]["aims met"]);
  line("real, right", scores["real"].is_string() ? scores["real"] : scores["real"]["right"]);
  fmt::print("wrote {}, seed {}, {:.1f} CPU-minutes\n", arguments.out, options.seed,
             entry["run"]["cpu_seconds"].get<double>() / 60.0);
  return 0;
}

int check(const CheckArguments& arguments) {
  if (arguments.sample == 0) throw Error("--sample 0", "no case would be run", "give 1 or more");
  std::shared_ptr<Progress> progress;
  const lab::RunnerOptions runner = runner_options(arguments.jobs, progress);
  const lab::EntryCheck check = lab::check_entry(arguments.file, arguments.sample, by_chance(),
                                                 arguments.recordings, {}, runner);
  if (progress) progress->finish();
  for (const std::string& fault : check.faults) fmt::print("{}\n", fault);
  for (const std::string& difference : check.differences) fmt::print("{}\n", difference);
  for (const std::string& name : check.left_out)
    fmt::print("not run: {}, set it with --recording\n", name);
  fmt::print("{}: {} of {} cases and scenes run again, {} differ\n",
             check.holds ? "the entry is valid" : "the entry is not valid", check.played,
             check.entered, check.differences.size());
  return check.holds ? 0 : 1;
}

}  // namespace

Verb add_bench_entry(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "bench-entry", "run a method on the whole benchmark and write an entry for the leaderboard");
  const auto options = std::make_shared<EntryArguments>();
  command
      ->add_option("method", options->entry.method,
                   "a name of `palpate eval --list-methods`, or a program: 'pipe:COMMAND'")
      ->required();
  command->add_option("--out", options->out, "the entry's file (entry.json)");
  command->add_option("--seed", options->seed, "random seed of the cases (default: random)");
  command->add_option("--cases", options->entry.cases, "number of cases of each family (25)");
  command->add_option("--repeats", options->entry.repeats,
                      "repeats of each scene of fidelity, in each of four parts (5)");
  add_repeated(
      *command, "--recording", options->entry.recordings,
      "recording of a camera at rest, e.g. depth:FOLDER?frames=8; may be given several times");
  command->add_option("--jobs", options->jobs, "threads (one a core)");
  command->add_flag("--resume", options->resume,
                    "continue from the finished cases of an interrupted run, with its --seed");
  return {command, [options] { return enter(*options); }};
}

Verb add_bench_check(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("bench-check", "run a sample of an entry again and check it");
  const auto options = std::make_shared<CheckArguments>();
  command->add_option("entry", options->file, "its file")->required();
  command->add_option("--sample", options->sample, "number of cases and scenes (20)");
  add_repeated(*command, "--recording", options->recordings,
               "recording with which the entry was made; may be given several times");
  command->add_option("--jobs", options->jobs, "threads (one a core)");
  return {command, [options] { return check(*options); }};
}

}  // namespace palpate::app
