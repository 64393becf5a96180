// SPDX-License-Identifier: Apache-2.0
#include "app/program.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <unistd.h>

#include "palpate/kernel/core/parameters.hpp"
#include "palpate/kernel/core/text.hpp"
#include "palpate/kernel/core/vectorise.hpp"

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

// Verbs of programs that are built when they are first asked for.
struct OtherProgram {
  std::string_view verb, program;
};
constexpr std::array others = {
    OtherProgram{"eval", "palpate-lab"}, OtherProgram{"bench-entry", "palpate-lab"},
    OtherProgram{"bench-check", "palpate-lab"}, OtherProgram{"bench", "palpate-bench"}};
constexpr std::string_view lab_program = "palpate-lab";

// This program's own file; empty where the system does not say.
std::filesystem::path own_path() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error);
}

// Becomes the program of that name with the same arguments; returns if it is not in this one's
// folder.
void become(std::string_view program, char** argv) {
  const std::filesystem::path path = own_path().replace_filename(program);
  execv(path.c_str(), argv);
}

// Is it a file, a folder or a URI, and no verb?
bool is_scene(const std::string& word, const std::vector<std::string>& verbs) {
  std::error_code unused;
  return !word.empty() && word.front() != '-' &&
         std::find(verbs.begin(), verbs.end(), word) == verbs.end() &&
         (word.find(':') != std::string::npos || std::filesystem::exists(word, unused));
}

int run_verb(int argc, char** argv, std::span<const AddVerb> own_verbs) {
  CLI::App program("Feel what a depth camera sees.", "palpate");
  program.set_version_flag("--version", "palpate " PALPATE_VERSION);
  program.allow_extras();
  program.require_subcommand(0, 1);  // a verb's name behind a verb is no verb: `eval methods`

  std::vector<AddVerb> adders = listed_verbs();
  adders.insert(adders.begin(), own_verbs.begin(), own_verbs.end());
  std::stable_partition(adders.begin(), adders.end(), [](AddVerb add) { return add == &add_run; });
  std::vector<Verb> verbs;
  std::vector<std::string> words;
  for (const AddVerb add : adders) {
    verbs.push_back(add(program));
    verbs.back().command->allow_extras();
    words.push_back(verbs.back().command->get_name());
  }
  std::string footer;
  for (const auto& [verb, other] : others) {
    if (std::find(words.begin(), words.end(), verb) != words.end()) continue;
    footer += std::string(footer.empty() ? "" : "\n") + "`" + std::string(verb) + "` is in " +
              std::string(other);
    if (argc < 2 || argv[1] != verb) continue;
    become(other, argv);
    throw Error("'" + std::string(verb) + "'",
                "it is in the program " + std::string(other) + ", which has not been built",
                "run it with `scripts/run " + std::string(verb) + "`, or build " +
                    std::string(other) + " with CMake's -DPALPATE_LAB=ON");
  }
  program.footer(footer);
  std::vector<std::string> arguments(argv + 1, argv + argc);
  // `palpate FILE` touches it.
  if (!arguments.empty() && is_scene(arguments.front(), words))
    arguments.insert(arguments.begin(), {"run", "--camera"});
  std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes them
  try {
    program.parse(arguments);
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
  refuse_extras(program, words, "subcommand", "see 'palpate --help'");
  std::fputs(program.help().c_str(), stdout);
  return wrong_usage;
}

}  // namespace

int run_program(int argc, char** argv, std::span<const AddVerb> own_verbs) {
  // The simulated arm is in a program of its own; without it there are simpler robots.
  if (argc > 1 && argv[1] == std::string_view("teleop") && own_path().filename() == "palpate")
    become("palpate-robot", argv);
  try {
    if (const char* name = std::getenv("PALPATE_VECTOR")) use_vector_set(name);
    return run_verb(argc, argv, own_verbs);
  } catch (const UnknownMethod& error) {
    std::string what = error.what();
    if (own_path().filename() != lab_program) {
      become(lab_program, argv);
      what += "; the lab's methods are in palpate-lab, which `scripts/run --method NAME` builds";
    }
    return complain(wrong_usage, what);
  } catch (const Error& error) {
    return complain(wrong_usage, error.what());
  } catch (const std::exception& error) {
    return complain(failed, error.what());
  }
}

}  // namespace palpate::app
