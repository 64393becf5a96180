// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/program.hpp"
#include "app/progress.hpp"
#include "app/verbs.hpp"
#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/record/replay.hpp"

namespace palpate::app {
namespace {

struct ReplayOptions {
  std::string path;
  bool json = false;
};

nlohmann::ordered_json replay_json(const ReplayDifferences& differences) {
  nlohmann::ordered_json object = {{"identical", !differences.first},
                                   {"different_ticks", differences.ticks}};
  if (differences.first) {
    object["largest_force_difference"] = differences.largest_force;
    object["first_difference"] = {{"tick", differences.first->tick},
                                  {"field", differences.first->field},
                                  {"recorded", differences.first->recorded},
                                  {"replayed", differences.first->replayed}};
  }
  return object;
}

nlohmann::ordered_json replay_json(const ReplayReport& report) {
  nlohmann::ordered_json object = {
      {"identical", report.identical()},   {"ticks", report.ticks},
      {"frames", report.frames},           {"hash", fmt::format("{:016x}", report.hash)},
      {"vector_set", vector_set_in_use()}, {"asked", replay_json(report.asked)},
      {"sent", replay_json(report.sent)}};
  if (!report.broken_off.empty()) object["broken_off"] = report.broken_off;
  object["checksums"] = text_of(report.check);
  if (!report.check.damage.empty()) object["damage"] = report.check.damage;
  return object;
}

struct HandReplay {
  std::string name;  // of the hand; empty: it is the only one
  ReplayReport report;
  std::vector<std::string> more_hands;
};

HandReplay replayed(const std::filesystem::path& path) {
  SessionReader session(path);
  const std::string& name = session.info().hand;
  Progress progress(name.empty() ? "replay" : "replay of " + name, session.ticks());
  ReplayReport report = replay(
      session, [&progress](std::size_t ticks) { progress.set(ticks); }, program_methods());
  progress.finish();
  return {name, std::move(report), session.info().more_hands};
}

int run(const ReplayOptions& options) {
  std::vector<HandReplay> hands{replayed(options.path)};
  const std::vector<std::string> more = hands.front().more_hands;
  for (const std::string& name : more) hands.push_back(replayed(hand_folder(options.path, name)));
  if (options.json) {
    nlohmann::ordered_json object = replay_json(hands.front().report);
    for (std::size_t i = 1; i < hands.size(); ++i)
      object["more_hands"][hands[i].name] = replay_json(hands[i].report);
    fmt::print("{}\n", object.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  } else {
    for (const HandReplay& hand : hands)
      fmt::print("{}{}", hands.size() == 1 ? "" : hand.name + ":\n", text_of(hand.report));
  }
  const bool identical = std::all_of(hands.begin(), hands.end(),
                                     [](const auto& hand) { return hand.report.identical(); });
  return identical ? 0 : 1;
}

}  // namespace

Verb add_replay(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "replay", "run a recorded session again and check that every force is the same");
  const auto options = std::make_shared<ReplayOptions>();
  command->add_option("recording", options->path, "folder of the recording")->required();
  command->add_flag("--json", options->json, "print a JSON object");
  return {command, [options] { return run(*options); }};
}

}  // namespace palpate::app
