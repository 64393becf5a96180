// SPDX-License-Identifier: Apache-2.0
#include "lab/entry.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <numeric>
#include <optional>
#include <random>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include "lab/experiments/pop.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/pipe_method.hpp"
#include "lab/sha256.hpp"
#include "lab/statistics.hpp"
#include "lab/table.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/uri.hpp"

namespace palpate::lab {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int format_version = 1;
constexpr int parts = 4;                    // of `fidelity`, each with noise of its own
constexpr double same_measure = 1e-3;       // [-] measures that differ by less are the same
constexpr std::size_t most_different = 20;  // one difference in so many may be rounding
constexpr const char* not_given = "not run: no recording was given";

// A case, or a scene of `fidelity` in one of its parts.
struct Item {
  std::string bench;
  std::string family;  // or the scene
  std::string text;    // all that it depends on
  Cell play;           // gives its line of the outcomes, without a newline
};

// All that an entry's seed and sizes stand for.
struct Plan {
  std::vector<Item> items;
  std::vector<std::pair<std::string, RealCases>> recordings;  // by what they are called
};

// A recording's name without its folders: those are of somebody's machine.
std::string called(const std::string& uri) {
  const Uri parsed(uri);
  fs::path path(parsed.path());
  if (!path.has_filename()) path = path.parent_path();
  const std::size_t options = uri.find('?');
  return parsed.scheme() + ":" + path.filename().string() +
         (options == std::string::npos ? "" : uri.substr(options));
}

ExperimentOptions experiment_options(const EntryOptions& options) {
  ExperimentOptions result;
  result.methods = {options.method};
  result.own_methods = options.own_methods;
  return result;
}

// Its method goes by a name that a CSV can hold.
EntryOptions renamed(EntryOptions options) {
  const std::string name = options.method;
  const std::vector<OwnMethod> own = options.own_methods;
  options.method = "entered";
  options.own_methods = {
      {"entered", [name, own](const MethodSetup& setup) { return make_method(name, setup, own); }}};
  return options;
}

std::string outcome_text(const Judgement& judgement) {
  return fmt::format("{}{}", judgement.held ? 1 : 0, judgement.right ? 1 : 0);
}

void plan_pop(const EntryOptions& options, Plan& plan) {
  for (const PopFamily& family : pop_families()) {
    for (int i = 0; i < options.cases; ++i) {
      const PopCase c = draw_pop_case(family, options.seed, static_cast<std::uint64_t>(i));
      plan.items.push_back(
          {"pop", std::string(family.name), c.text(),
           [=] { return outcome_text(judge(options.method, c, experiment_options(options))); }});
    }
  }
}

// A scene gives an object of its measures, in the order of their table.
void plan_fidelity(const EntryOptions& options, Plan& plan) {
  const Experiment& fidelity = find_experiment("fidelity");
  for (int part = 0; part < parts; ++part) {
    for (const std::string_view of : fidelity_scenes()) {
      if (part > 0 && is_without_chance(of)) continue;
      const std::string scene(of);
      ExperimentOptions given = experiment_options(options);
      given.families = {scene};
      given.seed = options.seed * parts + static_cast<std::uint64_t>(part);
      given.grid = {options.repeats, options.repeats};
      plan.items.push_back(
          {"fidelity", scene,
           fmt::format("fidelity:{}?repeats={}&seed={}", scene, options.repeats, given.seed),
           [=, &fidelity] {
             std::string csv = std::string(fidelity.header) + "\n";
             for (const Cell& cell : fidelity.cells(fidelity, given)) csv += cell();
             const Table table(scene, csv);
             Json values = Json::object();
             for (std::size_t row = 0; row < table.rows(); ++row)
               values[table.text(row, "measure")] =
                   std::stod(fmt::format("{:.6g}", table.number(row, "value")));
             return values.dump();
           }});
    }
  }
}

void plan_real(const EntryOptions& options, Plan& plan) {
  const std::size_t count = options.recordings.size();
  for (std::size_t i = 0; i < count; ++i) {
    const std::string name = called(options.recordings[i]);
    // The cases of the family, shared among the recordings.
    const auto cases = static_cast<std::size_t>(options.cases) * 4;
    const std::size_t share = cases / count + (i < cases % count ? 1 : 0);
    plan.recordings.emplace_back(name,
                                 draw_real_cases(options.recordings[i], name, options.seed, share));
    for (const RealCase& c : plan.recordings.back().second.cases)
      plan.items.push_back(
          {"real", name, c.text,
           [=] { return outcome_text(c.play(options.method, experiment_options(options))); }});
  }
}

Plan plan_of(const EntryOptions& options) {
  if (options.cases < 1 || options.cases > 10'000)
    throw Error(fmt::format("--cases {}", options.cases), "it is not from 1 to 10000",
                "write for example --cases 25");
  if (options.repeats < 1 || options.repeats > 1000)
    throw Error(fmt::format("--repeats {}", options.repeats), "it is not from 1 to 1000",
                "write for example --repeats 5");
  if (options.seed >= 1ULL << 48U)
    throw Error(fmt::format("--seed {}", options.seed), "it is 2^48 or more",
                "remove it: then it is random");
  Plan plan;
  plan_pop(options, plan);
  plan_fidelity(options, plan);
  plan_real(options, plan);
  return plan;
}

std::string hash_of_cases(const Plan& plan) {
  Sha256 hash;
  for (const Item& item : plan.items) hash.add(item.text + "\n");
  return hash.digest();
}

std::vector<Cell> cells_of(const std::vector<const Item*>& items) {
  std::vector<Cell> cells;
  cells.reserve(items.size());
  for (const Item* item : items) cells.emplace_back([item] { return item->play() + "\n"; });
  return cells;
}

// ---- From outcomes to scores. ----

Json percent(const Interval& interval) {
  const auto rounded = [](double share) { return std::round(1e4 * share) / 100.0; };
  Json json;
  json["value"] = rounded(interval.value);
  json["low"] = rounded(std::clamp(interval.low, 0.0, 1.0));
  json["high"] = rounded(std::clamp(interval.high, 0.0, 1.0));
  return json;
}

Interval share_of(const std::string& digits) {
  return wilson(static_cast<std::size_t>(std::count(digits.begin(), digits.end(), '1')),
                digits.size());
}

// Of each part of `fidelity`, the share of the aims that are met. What has no noise counts in all
// of them; what was lost in every repeat has no figure and misses its aim.
std::vector<double> aims_met(const Json& fidelity) {
  std::vector<double> shares;
  for (std::size_t part = 0; part < fidelity.size(); ++part) {
    int aims = 0;
    int met = 0;
    for (const FidelityMeasure& measure : fidelity_measures()) {
      if (!measure.aim) continue;
      const Json& values =
          fidelity.at(is_without_chance(measure.scene) ? 0 : part).at(std::string(measure.scene));
      const auto found = values.find(std::string(measure.name));
      ++aims;
      met += found != values.end() && found->get<double>() <= *measure.aim ? 1 : 0;
    }
    shares.push_back(static_cast<double>(met) / aims);
  }
  return shares;
}

Json scores_of(const Json& outcomes) {
  std::vector<Interval> held;
  std::vector<Interval> right;
  for (const auto& family : outcomes.at("pop").items()) {
    held.push_back(share_of(family.value().at("held").get<std::string>()));
    right.push_back(share_of(family.value().at("right").get<std::string>()));
  }
  Json scores;
  Json real = not_given;
  const Interval pop_held = mean_of(held);
  const Interval pop_right = mean_of(right);
  if (outcomes.at("real").is_object()) {
    std::string all_held;
    std::string all_right;
    for (const auto& recording : outcomes.at("real").items()) {
      all_held += recording.value().at("held").get<std::string>();
      all_right += recording.value().at("right").get<std::string>();
    }
    held.push_back(share_of(all_held));
    right.push_back(share_of(all_right));
    real = Json{{"held", percent(held.back())}, {"right", percent(right.back())}};
  }
  scores["score"] = percent(mean_of(right));
  scores["held"] = percent(mean_of(held));
  scores["pop"] = Json{{"held", percent(pop_held)}, {"right", percent(pop_right)}};
  scores["fidelity"] = Json{{"aims met", percent(student(aims_met(outcomes.at("fidelity"))))}};
  scores["real"] = real;
  return scores;
}

// Where an item's outcome is kept: by bench and family, in the order of the items.
Json outcomes_of(const Plan& plan, const std::vector<std::string>& lines) {
  Json pop = Json::object();
  Json real = Json::object();
  Json fidelity = Json::array();
  const auto add = [](Json& family, const std::string& line) {
    for (std::size_t i = 0; const char* key : {"held", "right"}) {
      const std::string before = family.contains(key) ? family[key].get<std::string>() : "";
      family[key] = before + line.at(i++);
    }
  };
  for (std::size_t i = 0; i < plan.items.size(); ++i) {
    const Item& item = plan.items[i];
    if (item.bench == "pop") add(pop[item.family], lines.at(i));
    if (item.bench == "real") add(real[item.family], lines.at(i));
    if (item.bench != "fidelity") continue;
    // A scene that is there again begins another part.
    if (fidelity.empty() || fidelity.back().contains(item.family))
      fidelity.push_back(Json::object());
    fidelity.back()[item.family] = Json::parse(lines.at(i));
  }
  Json outcomes;
  outcomes["pop"] = pop;
  outcomes["fidelity"] = fidelity;
  outcomes["real"] = plan.recordings.empty() ? Json(not_given) : real;
  return outcomes;
}

double processor_seconds() {
  double total = 0.0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    getrusage(who, &usage);
    for (const timeval& time : {usage.ru_utime, usage.ru_stime})
      total += static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  }
  return total;
}

std::string quoted(const std::string& word) {
  const bool plain = word.find_first_not_of(
                         "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                         "0123456789-_=:./,") == std::string::npos;
  return plain ? word : "'" + word + "'";
}

// How it is run: by the lab's name, as a program, or as an object of whoever calls.
std::string kind_of(const EntryOptions& options) {
  if (is_pipe(options.method)) return "pipe";
  const bool own =
      std::any_of(options.own_methods.begin(), options.own_methods.end(),
                  [&](const OwnMethod& method) { return method.name == options.method; });
  return own ? "python" : "lab";
}

std::string command_of(const EntryOptions& options) {
  if (kind_of(options) == "python") {
    std::string recordings;
    for (const std::string& uri : options.recordings)
      recordings += fmt::format("{}'{}'", recordings.empty() ? "" : ", ", called(uri));
    return fmt::format("palpate.bench.entry({}(), seed={}, cases={}, repeats={}, recordings=[{}])",
                       options.method, options.seed, options.cases, options.repeats, recordings);
  }
  std::string command =
      fmt::format("palpate bench-entry {} --seed {} --cases {} --repeats {}",
                  quoted(options.method), options.seed, options.cases, options.repeats);
  for (const std::string& uri : options.recordings)
    command += " --recording " + quoted(called(uri));
  return command;
}

// @throws Error for a method that is not known.
std::string summary_of(const EntryOptions& options) {
  return kind_of(options) == "lab" ? methods().find(options.method).summary : "";
}

Json read_entry(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in)
    throw Error(file.string(), std::string("it cannot be read: ") + std::strerror(errno),
                "give a file that bench-entry wrote");
  Json entry = Json::parse(in, nullptr, false);
  if (!entry.is_object() || !entry.contains("palpate_entry"))
    throw Error(file.string(), "it is not a benchmark entry", "give a file that bench-entry wrote");
  if (entry["palpate_entry"] != format_version)
    throw Error(file.string(), "it is an entry of another version",
                "check it with the palpate version that it states");
  return entry;
}

// The recordings that are here, in the order of the entry; empty where one is missing.
std::vector<std::string> recordings_of(const Json& entry, const std::vector<std::string>& given,
                                       std::uint64_t seed, EntryCheck& check) {
  std::vector<std::string> found;
  for (const Json& recording : entry.at("recordings")) {
    const auto name = recording.at("name").get<std::string>();
    const auto here = std::find_if(given.begin(), given.end(), [&](const std::string& uri) {
      return draw_real_cases(uri, name, seed, 0).hash == recording.at("sha256").get<std::string>();
    });
    if (here == given.end()) {
      check.left_out.push_back(name);
    } else {
      found.push_back(*here);
    }
  }
  return check.left_out.empty() ? found : std::vector<std::string>();
}

bool same_measures(const Json& a, const Json& b) {
  for (const auto& [name, value] : a.items()) {
    if (!b.contains(name)) return false;
    const auto x = value.get<double>();
    const auto y = b.at(name).get<double>();
    if (std::abs(x - y) > same_measure * std::max(std::abs(x), std::abs(y)) + 1e-9) return false;
  }
  return a.size() == b.size();
}

// How the outcome of an item differs from what the entry has.
std::optional<std::string> difference(const Item& item, const std::string& entered,
                                      const std::string& played) {
  if (entered == played) return std::nullopt;
  if (item.bench == "fidelity") {
    if (same_measures(Json::parse(entered), Json::parse(played))) return std::nullopt;
    return fmt::format("{}: in the entry {}; now {}", item.text, entered, played);
  }
  const auto words = [](const std::string& line) {
    return line == "11" ? "held and right" : line == "10" ? "held, not right" : "lost";
  };
  return fmt::format("{}: in the entry {}; now {}", item.text, words(entered), words(played));
}

// The lines that the outcomes of an entry were made from, one an item of the plan.
// @throws Json's exceptions, or std::out_of_range, where the entry has fewer
std::vector<std::string> entered_lines(const Json& outcomes, const Plan& plan) {
  std::map<std::string, std::size_t> seen;
  std::vector<std::string> lines;
  for (const Item& item : plan.items) {
    const std::size_t index = seen[item.bench + " " + item.family]++;
    if (item.bench == "fidelity") {
      lines.push_back(outcomes.at("fidelity").at(index).at(item.family).dump());
    } else {
      const Json& family = outcomes.at(item.bench).at(item.family);
      lines.push_back({family.at("held").get<std::string>().at(index),
                       family.at("right").get<std::string>().at(index)});
    }
  }
  return lines;
}

EntryCheck check_parsed(const Json& entry, std::size_t sample, std::uint64_t chance,
                        const std::vector<std::string>& recordings,
                        const std::vector<OwnMethod>& own_methods, const RunnerOptions& runner,
                        const fs::path& scratch) {
  EntryCheck check;
  EntryOptions options;
  options.method = entry.at("method").get<std::string>();
  options.seed = entry.at("seed").get<std::uint64_t>();
  options.cases = entry.at("cases").get<int>();
  options.repeats = entry.at("repeats").get<int>();
  options.own_methods = own_methods;
  if (entry.at("kind") != kind_of(options))
    throw Error(options.method, "it is a method written in Python",
                "check it in Python: palpate.bench.check(FILE, METHOD)");
  static_cast<void>(summary_of(options));
  options.recordings = recordings_of(entry, recordings, options.seed, check);
  const Plan plan = plan_of(renamed(options));
  const std::vector<std::string> entered = entered_lines(entry.at("outcomes"), plan);

  if (check.left_out.empty()) {
    if (entry.at("cases_sha256") != hash_of_cases(plan))
      check.faults.emplace_back("its cases are not those that its seed gives in this version");
    if (entry.at("outcomes") != outcomes_of(plan, entered))
      check.faults.emplace_back("it has outcomes of more cases than it states");
  }
  if (entry.at("scores") != scores_of(entry.at("outcomes")))
    check.faults.emplace_back("its scores do not match its outcomes");

  std::vector<std::size_t> order(plan.items.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::mt19937_64 bits(chance);
  for (std::size_t i = order.size() - 1; i > 0; --i) std::swap(order[i], order[bits() % (i + 1)]);
  order.resize(std::min(sample, order.size()));
  std::sort(order.begin(), order.end());
  std::vector<const Item*> items;
  for (const std::size_t i : order) items.push_back(&plan.items[i]);
  const std::vector<std::string> played = lines_of(
      run_cells(cells_of(items), fmt::format("palpate check {}", chance), runner, scratch));
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (const auto line = difference(*items[i], entered[order[i]], played.at(i)))
      check.differences.push_back(*line);
  }
  check.played = order.size();
  check.entered = plan.items.size();
  check.holds = check.faults.empty() && check.differences.size() * most_different <= check.played;
  return check;
}

}  // namespace

std::string make_entry(const EntryOptions& options, const EntryRun& run,
                       const RunnerOptions& runner, const fs::path& file) {
  const double began = processor_seconds();
  Json entry;
  entry["palpate_entry"] = format_version;
  entry["method"] = options.method;
  entry["kind"] = kind_of(options);
  entry["summary"] = summary_of(options);
  const Plan plan = plan_of(renamed(options));
  std::vector<const Item*> items;
  for (const Item& item : plan.items) items.push_back(&item);
  const std::string cases_hash = hash_of_cases(plan);
  const std::string rows = run_cells(
      cells_of(items), "palpate entry of " + options.method + " " + cases_hash, runner, file);
  const double cost = processor_seconds() - began;

  const Json outcomes = outcomes_of(plan, lines_of(rows));
  entry["command"] = command_of(options);
  entry["version"] = PALPATE_VERSION;
  entry["seed"] = options.seed;
  entry["cases"] = options.cases;
  entry["repeats"] = options.repeats;
  entry["cases_sha256"] = cases_hash;
  entry["recordings"] = Json::array();
  for (const auto& [name, cases] : plan.recordings)
    entry["recordings"].push_back(
        {{"name", name}, {"frames", cases.frames}, {"sha256", cases.hash}});
  entry["scores"] = scores_of(outcomes);
  entry["outcomes"] = outcomes;
  Json said = Json::object();
  for (const auto& [key, value] : run) said[key] = value;
  said["threads"] = runner.jobs;
  said["cpu_seconds"] = std::round(10.0 * cost) / 10.0;
  entry["run"] = said;
  std::string text = entry.dump(1) + "\n";
  write_file(file, text);
  return text;
}

EntryCheck check_entry(const fs::path& file, std::size_t sample, std::uint64_t chance,
                       const std::vector<std::string>& recordings,
                       const std::vector<OwnMethod>& own_methods, const RunnerOptions& runner) {
  const Json entry = read_entry(file);
  const fs::path scratch = fs::temp_directory_path() / fmt::format("palpate-check-{:016x}", chance);
  try {
    return check_parsed(entry, sample, chance, recordings, own_methods, runner, scratch);
  } catch (const Json::exception& error) {
    throw Error(file.string(), std::string("it is incomplete: ") + error.what(),
                "give a file that bench-entry wrote");
  } catch (const std::out_of_range&) {
    throw Error(file.string(), "it has outcomes of fewer cases than it states",
                "give a file that bench-entry wrote");
  }
}

}  // namespace palpate::lab
