// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/feel_scenes.hpp"

namespace palpate::lab {
namespace {

using Loops = std::vector<std::string_view>;

// A measure in some loops of a scene, with the aim (an upper bound) where one is meant.
struct Measure {
  std::string_view name;
  std::string_view unit;
  std::optional<double> aim;
  Loops loops;
};

struct FeelScene {
  std::string name;
  std::function<FeelFigures(const FeelOptions&)> play;
  std::vector<Measure> measures = {};
};

std::vector<FeelScene> all_scenes() {
  std::vector<FeelScene> all;
  const auto scene = [&all](std::string name, auto play, auto... more) {
    all.push_back(
        {std::move(name), [=](const FeelOptions& options) { return play(options, more...); }});
  };
  // The aim is meant for the first loops; the others have the figure alone.
  const auto measure = [&all](std::string_view name, std::string_view unit,
                              std::optional<double> aim, const Loops& aimed, const Loops& shown) {
    if (!aimed.empty()) all.back().measures.push_back({name, unit, aim, aimed});
    if (!shown.empty()) all.back().measures.push_back({name, unit, std::nullopt, shown});
  };
  constexpr std::array distances = {0.45, 0.7, 0.95};  // [m] of the camera
  constexpr std::array slide_aims = {std::array{10.0, 0.05, 5.0}, std::array{15.0, 0.08, 10.0},
                                     std::array{25.0, 0.12, 20.0}};
  for (std::size_t i = 0; i < distances.size(); ++i) {
    scene(fmt::format("slide-{}m", distances[i]), play_slide, distances[i]);
    measure("felt", "mN", slide_aims[i][0], {"path", "light", "firm"}, {"chain"});
    measure("step", "N", slide_aims[i][1], {"path", "light", "firm"}, {"chain"});
    measure("error", "%", slide_aims[i][2], {"path"}, {"light", "firm", "chain"});
  }
  scene("onset", play_onset);
  measure("overshoot", "times", 1.3, {"path", "light"}, {"chain"});
  measure("swing", "N", 0.3, {"path", "light"}, {"chain"});
  measure("swing-median", "N", {}, {}, {"path", "light", "chain"});
  for (const auto& [name, why] :
       {std::pair{"return-covered", Unseen::covered}, std::pair{"return-stopped", Unseen::stopped},
        std::pair{"return-dropped", Unseen::dropped}}) {
    scene(name, play_return, why);
    measure("kick", "mm/s", 40.0, {"free", "light"}, {"chain"});
  }
  for (const double distance : distances) {
    scene(fmt::format("rest-{}m", distance), play_rest, distance);
    measure("felt", "mN", 10.0, {"path"}, {"light", "firm", "chain"});
    measure("undamped", "mN", {}, {}, {"path"});
  }
  for (const double rate : {5.0, 9.0, 15.0, 30.0, 60.0, 90.0}) {
    scene(fmt::format("rate-{}Hz", rate), play_rate, rate);
    measure("buzz", "mN", 5.0, {"path", "light"}, {"chain"});
    measure("mean-error", "%", 5.0, {"path"}, {});
    if (rate != 30.0) continue;
    for (const std::string_view share : {"share-0s", "share-0.1s", "share-0.3s", "share-0.5s"})
      measure(share, "%", {}, {}, {"chain"});
  }
  scene("rub", play_rub);
  measure("ratio", "%", 5.0, {"path"}, {});
  for (const auto& [name, stroke] : {std::pair{"stick", 0.0}, std::pair{"stick-bob", 0.02}}) {
    scene(name, play_stick, stroke);
    measure("drift", "mm", 0.1, {"light"}, {});
  }
  const auto energy = [&](const std::string& name, double distance, const char* sensor) {
    scene(name, play_energy, distance, sensor);
    measure("above", "mJ", 0.1, {"light", "firm", "omega"}, {"chain"});
    for (const auto& [what, unit] :
         {std::pair{"above-99%", "mJ"}, std::pair{"above-median", "mJ"},
          std::pair{"over-0.1mJ", "%"}, std::pair{"made", "mJ"}, std::pair{"exact", "mJ"}})
      measure(what, unit, {}, {}, {"light", "firm", "omega", "chain"});
    measure("contacts", "", {}, {}, {"light"});
    measure("chain-above", "mJ", {}, {}, {"chain"});
  };
  energy("energy-exact", distances[0], "ideal");
  for (const double distance : distances)
    energy(fmt::format("energy-{}m", distance), distance, "d4xx");
  return all;
}

const std::vector<FeelScene>& scenes() {
  static const std::vector<FeelScene> all = all_scenes();
  return all;
}

std::string rows_of(const FeelScene& scene, const FeelFigures& figures) {
  std::string rows;
  for (const FeelFigure& figure : figures) {
    const auto measure =
        std::find_if(scene.measures.begin(), scene.measures.end(), [&](const Measure& one) {
          return one.name == figure.measure &&
                 std::find(one.loops.begin(), one.loops.end(), figure.loop) != one.loops.end();
        });
    // What the table does not show stands in the CSV.
    const bool shown = measure != scene.measures.end();
    rows +=
        csv_row(figure.method, scene.name, figure.loop, figure.measure, shown ? measure->unit : "",
                shown && measure->aim ? csv_field(*measure->aim) : "-", figure.value);
  }
  return rows;
}

// All methods play a scene in one cell, so that its frames are made but once.
std::vector<Cell> feel_cells(const Experiment& experiment, const ExperimentOptions& options) {
  check_families(options, "feel has no such scene", names_of(scenes()));
  FeelOptions feel;
  for (const std::string& name : methods_of(experiment, options))
    feel.contestants.push_back(
        {name, [name](const MethodSetup& setup) { return make_method(name, setup); }});
  feel.parameters = options.parameters;
  feel.seed = options.seed;
  if (options.grid) std::tie(feel.repeats, feel.phases) = *options.grid;
  std::vector<Cell> cells;
  for (const FeelScene& scene : scenes())
    if (options.wants(scene.name))
      cells.emplace_back([=, &scene] { return rows_of(scene, scene.play(feel)); });
  return cells;
}

Scores feel_scores(const Table& table) {
  std::vector<AimLine> lines;
  for (const FeelScene& scene : scenes())
    for (const Measure& measure : scene.measures)
      for (const std::string_view loop : measure.loops)
        lines.push_back({{{"scene", scene.name}, {"loop", loop}, {"measure", measure.name}},
                         measure.unit,
                         measure.aim});
  constexpr double exact = 1e-6;  // of any unit here: rounding
  return aim_scores(table, lines, "* misses the aim. Measures: docs/feel.md.", exact);
}

}  // namespace

Experiment feel_experiment() {
  return {
      .name = "feel",
      .summary = "force quality: open loop, with a device and a hand, and through the safety chain",
      .header = "method,scene,loop,measure,unit,aim,value",
      .default_methods = {"paper", "sight", "ideal"},
      .cells = feel_cells,
      .scores = feel_scores,
      .has_grid = true};
}

}  // namespace palpate::lab
