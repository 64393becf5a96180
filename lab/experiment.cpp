// SPDX-License-Identifier: Apache-2.0
#include "lab/experiment.hpp"

#include <fmt/format.h>

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
    const auto& usual = experiment.default_methods;  // of some these are no methods of the lab
    if (!is_own && std::find(usual.begin(), usual.end(), name) == usual.end())
      static_cast<void>(methods().find(name));
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

Column shown(std::string title, std::vector<std::string_view> columns, std::string_view format,
             double unit, double (*of)(std::span<const double>)) {
  return {std::move(title), [=, columns = std::move(columns)](const Table& group) {
            std::string text;
            for (const std::string_view column : columns)
              add_to_list(text,
                          fmt::format(fmt::runtime(format), unit * of(group.numbers(column))));
            return text;
          }};
}

Scores scores_of(const std::vector<Table>& groups, const std::vector<std::string_view>& keys,
                 const std::vector<Column>& columns, std::string note) {
  Scores scores{.columns = {keys.begin(), keys.end()}, .rows = {}, .note = std::move(note)};
  for (const Column& column : columns) scores.columns.push_back(column.title);
  for (const Table& group : groups) {
    std::vector<std::string>& line = scores.rows.emplace_back();
    for (const std::string_view key : keys) line.push_back(group.text(0, key));
    for (const Column& column : columns) line.push_back(column.text(group));
  }
  return scores;
}

Scores scores_by(const Table& table, const std::vector<std::string_view>& keys,
                 const std::vector<Column>& columns, std::string note) {
  return scores_of(table.by(keys), keys, columns, std::move(note));
}

Scores aim_scores(const Table& table, const std::vector<AimLine>& lines, std::string note,
                  double exact) {
  const std::vector<Table> methods = table.by({"method"});
  Scores scores{.columns = {}, .rows = {}, .note = std::move(note)};
  for (const auto& [column, text] : lines.front().where) scores.columns.emplace_back(column);
  std::vector<std::string> last(scores.columns.size());
  last.front() = "aims met";
  scores.columns.emplace_back("aim");
  for (const Table& method : methods) scores.columns.push_back(method.text(0, "method"));
  std::vector<int> met(methods.size(), 0);
  int aims = 0;
  for (const AimLine& one : lines) {
    if (table.numbers("value", {one.where.front()}).empty()) continue;
    std::vector<std::string>& line = scores.rows.emplace_back();
    for (const auto& [column, text] : one.where) line.emplace_back(text);
    if (!one.unit.empty()) line.back() += fmt::format(" [{}]", one.unit);
    line.push_back(one.aim ? fmt::format("<= {:g}", *one.aim) : "-");
    aims += one.aim ? 1 : 0;
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const std::vector<double> values = methods[m].numbers("value", one.where);
      const bool missed = one.aim && !(first(values) <= *one.aim);  // as NaN, of none
      met[m] += one.aim && !missed ? 1 : 0;
      line.push_back(values.empty() ? "-"
                                    : fmt::format("{:.3g}", values[0] < exact ? 0.0 : values[0]));
      if (missed) line.back() += " *";
    }
  }
  last.push_back(std::to_string(aims));
  for (const int count : met) last.push_back(std::to_string(count));
  scores.rows.push_back(std::move(last));
  return scores;
}

}  // namespace palpate::lab
