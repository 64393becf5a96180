// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/program_methods.hpp"
#include "app/progress.hpp"
#include "app/recording_check.hpp"
#include "app/verbs.hpp"
#include "palpate/record/replay.hpp"

namespace palpate::app {
namespace {

struct ReplayOptions {
  std::string path;
  bool json = false;
};

std::string text_of(const ReplayReport& report) {
  std::string text;
  if (report.different_ticks == 0) {
    text = fmt::format("{} ticks and {} frames replayed: every force is the same, bit for bit\n",
                       report.ticks, report.frames);
  } else {
    text = fmt::format("{} of {} ticks differ, first tick {} in its {}; forces by up to {:.3g} N\n",
                       report.different_ticks, report.ticks, *report.first_difference, report.field,
                       report.largest_difference);
  }
  if (!report.broken_off.empty()) text += "the replay broke off: " + report.broken_off + "\n";
  return text + app::text_of(report.check) + "\n";
}

std::string json_of(const ReplayReport& report) {
  nlohmann::ordered_json object = {{"identical", report.identical()},
                                   {"ticks", report.ticks},
                                   {"frames", report.frames},
                                   {"different_ticks", report.different_ticks},
                                   {"largest_difference", report.largest_difference}};
  if (report.first_difference) {
    object["first_difference"] = *report.first_difference;
    object["field"] = report.field;
  }
  if (!report.broken_off.empty()) object["broken_off"] = report.broken_off;
  object["checksums"] = app::text_of(report.check);
  if (!report.check.damage.empty()) object["damage"] = report.check.damage;
  return object.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

int run(const ReplayOptions& options) {
  SessionReader session(options.path);
  Progress progress("replay", session.ticks());
  const ReplayReport report = replay(
      session, [&progress](std::size_t ticks) { progress.set(ticks); }, program_methods());
  progress.finish();
  std::fputs(options.json ? json_of(report).c_str() : text_of(report).c_str(), stdout);
  return report.identical() ? 0 : 1;
}

}  // namespace

Verb add_replay(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "replay", "runs a recorded session's method again and says whether every force is the same");
  const auto options = std::make_shared<ReplayOptions>();
  command->add_option("recording", options->path, "folder that run --record made")->required();
  command->add_flag("--json", options->json, "print a JSON object");
  return {command, [options] { return run(*options); }};
}

}  // namespace palpate::app
