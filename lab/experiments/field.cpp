// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/field/field_cases.hpp"
#include "lab/field/field_judge.hpp"
#include "lab/method.hpp"
#include "lab/statistics.hpp"
#include "palpate/kernel/core/sensor.hpp"

namespace palpate::lab {
namespace {

SensorKind declared(field::SensorKind kind) {
  constexpr std::array<SensorKind, field::sensor_kinds> kinds = {
      SensorKind::stereo, SensorKind::structured_light, SensorKind::time_of_flight,
      SensorKind::time_of_flight, SensorKind::unknown};
  return kinds[static_cast<std::size_t>(kind)];
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

// What a method's rows of a class, or before a sensor, come to.
struct Tally {
  Table known;  // rows of the cases that count
  Table held;
  std::size_t unknown;

  explicit Tally(const Table& rows)
      : known(rows.where({{"unknown", "-"}})),
        held(known.where({{"lost", "0"}})),
        unknown(rows.rows() - known.rows()) {}
  [[nodiscard]] std::size_t right() const { return known.where({{"right", "1"}}).rows(); }
  // Cases in which a column is above 0.
  [[nodiscard]] std::size_t count(std::string_view column) const {
    return known.numbers(column, [&](std::size_t row) { return known.number(row, column) > 0.0; })
        .size();
  }
  [[nodiscard]] double share(std::size_t some) const {
    return static_cast<double>(some) / static_cast<double>(known.rows());
  }
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
  std::vector<std::string> (*values)(const Tally&);
  std::string_view note;
};

std::vector<std::string> step_values(const Tally& of) {
  return {median_text(of.held.numbers("worst_step_n"))};
}

std::vector<std::string> rest_values(const Tally& of) {
  const std::vector<double> shakes = of.held.numbers(
      "shake_mm", [&](std::size_t row) { return of.held.text(row, "shake_mm") != "-"; });
  return {of.known.rows() == 0 ? "-" : percent(of.share(of.count("numb"))), median_text(shakes),
          shakes.empty() ? "-" : fmt::format("{:.2g}", largest(shakes))};
}

std::vector<std::string> line_of(const std::string& name, const Table& rows,
                                 const std::vector<std::string>& methods, const Extra& extra) {
  const Tally any(rows.where({{"method", methods.front()}}));
  std::vector<std::string> line = {name, std::to_string(any.known.rows()),
                                   std::to_string(any.unknown)};
  for (const std::string& method : methods) {
    const Tally of(rows.where({{"method", method}}));
    for (const std::size_t some : {of.held.rows(), of.right()})
      line.push_back(of.known.rows() == 0 ? "-" : percent(of.share(some)));
    for (std::string& value : extra.values(of)) line.push_back(std::move(value));
  }
  return line;
}

// How well a method knows itself that it is behind.
std::string alarm_text(const Table& table, const std::string& method) {
  const Table rows = table.where({{"method", method}, {"unknown", "-"}});
  const auto total = [&](std::string_view column) { return sum(rows.numbers(column)); };
  const double behind = total("time_behind_s");
  return fmt::format(
      "{}: behind for {:.1f} s of {:.0f} s, {:.1f} % of that flagged; false positives in {:.2f} "
      "% of the rest; {:.0f} of {:.0f} times in front again within 0.2 s",
      method, behind, total("time_s"), behind > 0.0 ? 100.0 * total("alarmed_s") / behind : 100.0,
      100.0 * total("false_alarm_s") / std::max(total("time_s") - behind, 1e-3),
      total("quick_returns"), total("times_behind"));
}

Scores scores_of(const Table& table, const Extra& extra) {
  const std::vector<std::string> methods = texts_in(table, "method");
  const std::vector<Table> classes = table.by({"class"});
  std::vector<Table> sensors = table.by({"sensor"});
  std::sort(sensors.begin(), sensors.end(), [](const Table& a, const Table& b) {
    return a.text(0, "sensor") < b.text(0, "sensor");
  });
  Scores scores;
  scores.columns = {"class", "cases", "unknown"};
  for (const std::string& method : methods) {
    scores.columns.push_back(method + " held [%]");
    scores.columns.push_back("right [%]");
    scores.columns.insert(scores.columns.end(), extra.columns.begin(), extra.columns.end());
  }
  for (const Table& rows : classes)
    scores.rows.push_back(line_of(rows.text(0, "class"), rows, methods, extra));
  for (const Table& rows : sensors)
    scores.rows.push_back(line_of("all before " + rows.text(0, "sensor"), rows, methods, extra));
  scores.note = "The score is the mean over the classes of the shares, of the observable cases; " +
                std::string(extra.note) + " docs/field.md has the rules.";
  std::vector<std::string> last = {"score", "", ""};
  for (const std::string& method : methods) {
    std::vector<double> held;
    std::vector<double> right;
    for (const Table& rows : classes) {
      const Tally of(rows.where({{"method", method}}));
      const std::size_t known = of.known.rows();
      if (known == 0) continue;
      held.push_back(of.share(of.held.rows()));
      right.push_back(of.share(of.right()));
      if (of.right() == known) continue;
      const std::string first = of.known.where({{"right", "0"}}).text(0, "text");
      scores.note += fmt::format(
          "\n{}, {}: {} cases: {} popped through, {} with a force in free space (up to {:.2f} N), "
          "{} with a missing force, {} with a force in the opposite direction; palpate eval {} "
          "--methods {} --case '{}'",
          method, rows.text(0, "class"), known, known - of.held.rows(), of.count("ghost_n"),
          largest(of.known.numbers("ghost_n")), of.count("numb"), of.count("wrong_side"),
          first.substr(0, first.find(':')), method, first);
    }
    for (const std::vector<double>& shares : {held, right})
      last.push_back(shares.empty() ? "-" : percent(mean(shares)));
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
