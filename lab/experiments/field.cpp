// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/field/field_cases.hpp"
#include "lab/field/field_judge.hpp"
#include "lab/method.hpp"
#include "palpate/kernel/core/sensor.hpp"

namespace palpate::lab {
namespace {

// What a camera says of itself.
SensorKind declared(field::SensorKind kind) {
  switch (kind) {
    case field::SensorKind::stereo:
      return SensorKind::stereo;
    case field::SensorKind::light:
      return SensorKind::structured_light;
    case field::SensorKind::flight:
    case field::SensorKind::coarse:
      return SensorKind::time_of_flight;
    case field::SensorKind::exact:
      break;
  }
  return SensorKind::unknown;
}

std::string rows_of(const std::vector<std::string>& names, const field::FieldCase& c, int number,
                    const Parameters& given) {
  field::Stage stage = field::make_stage(c);
  const std::array sensors{declared(stage.sensor->setup().kind)};
  const Parameters parameters = for_sensors(given, sensors);
  std::vector<std::unique_ptr<Method>> methods;
  std::vector<Method*> played;
  for (const std::string& name : names) {
    methods.push_back(make_method(name, {parameters, field::truth_of(stage.scene)}));
    played.push_back(methods.back().get());
  }
  const field::Outcome outcome = field::play_field(stage, played, parameters);
  std::string rows;
  for (std::size_t m = 0; m < names.size(); ++m) {
    const field::Verdict verdict =
        outcome.verdicts.empty() ? field::Verdict{} : outcome.verdicts[m];
    rows += csv_row(names[m], c.name, field::to_string(stage.sensor->setup().kind), number,
                    outcome.unknown.empty() ? "-" : outcome.unknown, verdict.lost, verdict.right(),
                    verdict.behind, verdict.worst_ghost, verdict.numb, verdict.wrong_side,
                    verdict.worst_step,
                    verdict.shake < 0.0 ? "-" : fmt::format("{:.4g}", 1e3 * verdict.shake),
                    verdict.time, verdict.time_behind, verdict.alarmed, verdict.false_alarm,
                    verdict.times_behind, verdict.quick_returns, c.text(), stage.values);
  }
  return rows;
}

std::vector<Cell> cells_of(const field::CaseSet& set, const Experiment& experiment,
                           const ExperimentOptions& options) {
  const std::vector<std::string> names = methods_of(experiment, options);
  std::vector<Cell> cells;
  const auto add = [&](field::FieldCase c, int number) {
    for (const std::string& value : options.fixed) c.fixed += (c.fixed.empty() ? "" : "&") + value;
    cells.emplace_back(
        [=, parameters = options.parameters] { return rows_of(names, c, number, parameters); });
  };
  if (!options.case_text.empty()) {
    add(field::parse_field_case(options.case_text, set), 0);
    return cells;
  }
  std::vector<field::FieldClass> classes;
  for (const std::string& name : options.families)
    classes.push_back(field::find_field_class(name, set));
  if (classes.empty()) classes.assign(set.classes.begin(), set.classes.end());
  for (const field::FieldClass& of : classes) {
    for (int i = 0; i < options.cases.value_or(set.usual_cases); ++i)
      add(field::draw_field_case(of, options.seed, static_cast<std::uint64_t>(i), set), i);
  }
  return cells;
}

std::vector<Cell> field_cells(const Experiment& experiment, const ExperimentOptions& options) {
  return cells_of(field::field_set(), experiment, options);
}

std::vector<Cell> visits_cells(const Experiment& experiment, const ExperimentOptions& options) {
  return cells_of(field::visits_set(), experiment, options);
}

struct Sum {
  int known = 0;
  int unknown = 0;
  int held = 0;
  int right = 0;
  int ghost = 0;
  int numb = 0;
  int wrong = 0;
  double worst_ghost = 0.0;
  std::vector<double> steps;   // [N] of the cases that were held
  std::vector<double> shakes;  // [mm] of those in which hand and surface rest
  std::string first_not_right;
};

// Rounded down: 100.0 means all.
std::string percent(double share) {
  return fmt::format("{:.1f}", std::floor(1e3 * share + 1e-9) / 10.0);
}

std::string median_text(const std::vector<double>& values) {
  return values.empty() ? "-" : fmt::format("{:.2g}", median(values));
}

// What a set shows of each method beside the shares of held and right cases.
struct Extra {
  std::vector<std::string> columns;
  std::vector<std::string> (*values)(const Sum&);
  std::string_view note;
};

std::vector<std::string> step_values(const Sum& sum) { return {median_text(sum.steps)}; }

std::vector<std::string> rest_values(const Sum& sum) {
  const auto worst = std::max_element(sum.shakes.begin(), sum.shakes.end());
  return {sum.known == 0 ? "-" : percent(static_cast<double>(sum.numb) / sum.known),
          median_text(sum.shakes), worst == sum.shakes.end() ? "-" : fmt::format("{:.2g}", *worst)};
}

// In the order of the table: what appears first comes first.
using Sums = std::vector<std::pair<std::string, std::map<std::string, Sum>>>;

Sum& sum_of(Sums& sums, const std::string& name, const std::string& method) {
  auto found =
      std::find_if(sums.begin(), sums.end(), [&](const auto& one) { return one.first == name; });
  if (found != sums.end()) return found->second[method];
  return sums.emplace_back(name, std::map<std::string, Sum>()).second[method];
}

void add_row(const Table& table, std::size_t row, Sum& sum) {
  if (table.text(row, "unknown") != "-") {
    ++sum.unknown;
    return;
  }
  const bool lost = table.number(row, "lost") != 0.0;
  const bool right = table.number(row, "right") != 0.0;
  ++sum.known;
  sum.held += lost ? 0 : 1;
  sum.right += right ? 1 : 0;
  sum.ghost += table.number(row, "ghost_n") > 0.0 ? 1 : 0;
  sum.numb += table.number(row, "numb") != 0.0 ? 1 : 0;
  sum.wrong += table.number(row, "wrong_side") != 0.0 ? 1 : 0;
  sum.worst_ghost = std::max(sum.worst_ghost, table.number(row, "ghost_n"));
  if (!lost) sum.steps.push_back(table.number(row, "worst_step_n"));
  if (!lost && table.text(row, "shake_mm") != "-")
    sum.shakes.push_back(table.number(row, "shake_mm"));
  if (!right && sum.first_not_right.empty()) sum.first_not_right = table.text(row, "text");
}

std::vector<std::string> line_of(const std::string& name, std::map<std::string, Sum>& sums,
                                 const std::vector<std::string>& methods, const Extra& extra) {
  const Sum& any = sums[methods.front()];
  std::vector<std::string> line = {name, std::to_string(any.known), std::to_string(any.unknown)};
  for (const std::string& method : methods) {
    const Sum& sum = sums[method];
    const double known = sum.known;
    line.push_back(sum.known == 0 ? "-" : percent(sum.held / known));
    line.push_back(sum.known == 0 ? "-" : percent(sum.right / known));
    for (std::string& value : extra.values(sum)) line.push_back(std::move(value));
  }
  return line;
}

// How well a method knows itself that it is behind.
std::string alarm_text(const Table& table, const std::string& method) {
  const auto sum = [&](std::string_view column) {
    double total = 0.0;
    for (const double value : table.numbers(column, [&](std::size_t row) {
           return table.text(row, "method") == method && table.text(row, "unknown") == "-";
         }))
      total += value;
    return total;
  };
  const double behind = sum("time_behind_s");
  return fmt::format(
      "{}: behind for {:.1f} s of {:.0f} s, {:.1f} % of that flagged; false positives in {:.2f} "
      "% "
      "of the rest; {:.0f} of {:.0f} times in front again within 0.2 s",
      method, behind, sum("time_s"), behind > 0.0 ? 100.0 * sum("alarmed_s") / behind : 100.0,
      100.0 * sum("false_alarm_s") / std::max(sum("time_s") - behind, 1e-3), sum("quick_returns"),
      sum("times_behind"));
}

Scores scores_of(const Table& table, const Extra& extra) {
  const std::vector<std::string> methods = methods_in(table);
  Sums classes;
  Sums sensors;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string& method = table.text(row, "method");
    add_row(table, row, sum_of(classes, table.text(row, "class"), method));
    add_row(table, row, sum_of(sensors, table.text(row, "sensor"), method));
  }
  std::sort(sensors.begin(), sensors.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  Scores scores;
  scores.columns = {"class", "cases", "unknown"};
  for (const std::string& method : methods) {
    scores.columns.push_back(method + " held [%]");
    scores.columns.push_back("right [%]");
    scores.columns.insert(scores.columns.end(), extra.columns.begin(), extra.columns.end());
  }
  for (auto& [name, sums] : classes) scores.rows.push_back(line_of(name, sums, methods, extra));
  for (auto& [name, sums] : sensors)
    scores.rows.push_back(line_of("all before " + name, sums, methods, extra));
  scores.note = "The score is the mean over the classes of the shares, of the observable cases; " +
                std::string(extra.note) + " docs/field.md has the rules.";
  std::vector<std::string> last = {"score", "", ""};
  for (const std::string& method : methods) {
    double held = 0.0;
    double right = 0.0;
    int count = 0;
    for (auto& [name, sums] : classes) {
      const Sum& sum = sums[method];
      if (sum.known == 0) continue;
      held += static_cast<double>(sum.held) / sum.known;
      right += static_cast<double>(sum.right) / sum.known;
      ++count;
      if (sum.right == sum.known) continue;
      scores.note += fmt::format(
          "\n{}, {}: {} cases: {} popped through, {} with a force in free space (up to {:.2f} "
          "N), "
          "{} with a missing force, {} with a force in the opposite direction; palpate eval {} "
          "--methods {} --case '{}'",
          method, name, sum.known, sum.known - sum.held, sum.ghost, sum.worst_ghost, sum.numb,
          sum.wrong, sum.first_not_right.substr(0, sum.first_not_right.find(':')), method,
          sum.first_not_right);
    }
    last.push_back(count == 0 ? "-" : percent(held / count));
    last.push_back(count == 0 ? "-" : percent(right / count));
    last.resize(last.size() + extra.columns.size());
  }
  scores.rows.push_back(std::move(last));
  for (const std::string& method : methods) scores.note += "\n" + alarm_text(table, method);
  return scores;
}

Scores field_scores(const Table& table) {
  return scores_of(table, {{"step [N]"},
                           step_values,
                           "step is the median over the cases of the largest change of force in a "
                           "tick."});
}

Scores visits_scores(const Table& table) {
  return scores_of(table, {{"numb [%]", "shake [mm]", "worst"},
                           rest_values,
                           "shake is how far the proxy moves while hand and surface rest, the "
                           "median and the worst over the held cases."});
}

constexpr std::string_view header =
    "method,class,sensor,number,unknown,lost,right,behind_s,ghost_n,numb,wrong_side,worst_step_n,"
    "shake_mm,time_s,time_behind_s,alarmed_s,false_alarm_s,times_behind,quick_returns,text,"
    "values";

}  // namespace

Experiment field_experiment() {
  return {.name = "field",
          .summary =
              "the field set: independent scenes, sensors and HIP paths, which share no code with "
              "those of pop and feel",
          .header = header,
          .default_methods = {"paper", "sight"},
          .cells = field_cells,
          .scores = field_scores};
}

Experiment visits_experiment() {
  return {.name = "visits",
          .summary = "the visits set: what comes, goes and moves around a hand that rests or works",
          .header = header,
          .default_methods = {"sight", "direct", "paper"},
          .cells = visits_cells,
          .scores = visits_scores};
}

}  // namespace palpate::lab
