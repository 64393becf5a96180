// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "app/verbs.hpp"
#include "lab/runner.hpp"
#include "palpate/core/error.hpp"
#include "palpate/core/nearest_name.hpp"
#include "palpate/core/parameters.hpp"

namespace palpate::app {
namespace {

enum ExitCode : int { done = 0, failed = 1, wrong_usage = 2 };

int complain(ExitCode code, const std::string& message) {
  std::fprintf(stderr, "palpate: %s\n", message.c_str());
  return code;
}

// The names a verb's options go by, for suggestions.
std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

void refuse_extras(const CLI::App& command, const std::vector<std::string>& candidates,
                   const std::string& noun, const std::string& list) {
  const std::vector<std::string> extras = command.remaining();
  if (extras.empty()) return;
  const std::string word = extras.front().substr(0, extras.front().find('='));
  const std::vector<std::string_view> views(candidates.begin(), candidates.end());
  const std::string_view near = nearest_name(word, views);
  throw Error("'" + word + "'", "there is no such " + noun,
              near.empty() ? list : "did you mean '" + std::string(near) + "'?");
}

int run_program(int argc, char** argv) {
  const lab::Ranks ranks(&argc, &argv);
  CLI::App program("Feel what a depth camera sees.", "palpate");
  program.set_version_flag("--version", "palpate " PALPATE_VERSION);
  program.allow_extras();

  const std::array adders = {add_run,  add_trace, add_replay,     add_eval,
                             add_info, add_bench, add_parameters, add_doctor};
  std::vector<Verb> verbs;
  std::vector<std::string> words;
  for (const auto& add : adders) {
    verbs.push_back(add(program));
    verbs.back().command->allow_extras();
    words.push_back(verbs.back().command->get_name());
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::CallForHelp& help) {
    return program.exit(help);
  } catch (const CLI::CallForVersion& version) {
    return program.exit(version);
  } catch (const CLI::ParseError& error) {
    std::string what = error.what();
    for (char& c : what) {
      if (c == '\n') c = ' ';
    }
    return complain(wrong_usage, what + "; see 'palpate --help'");
  }
  for (const Verb& verb : verbs) {
    if (!verb.command->parsed()) continue;
    refuse_extras(*verb.command, option_names(*verb.command), "option",
                  "see 'palpate " + verb.command->get_name() + " --help'");
    return verb.action();
  }
  refuse_extras(program, words, "verb", "see 'palpate --help'");
  std::fputs(program.help().c_str(), stdout);
  return wrong_usage;
}

}  // namespace
}  // namespace palpate::app

int main(int argc, char** argv) {
  using namespace palpate::app;
  try {
    return run_program(argc, argv);
  } catch (const palpate::Error& error) {
    return complain(wrong_usage, error.what());
  } catch (const std::exception& error) {
    return complain(failed, error.what());
  }
}
