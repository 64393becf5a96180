// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "lab/experiment.hpp"
#include "lab/experiments/feel_scenes.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {
namespace {

// Measures, their scenes and loops, and their aims (upper bounds).
struct Measure {
  std::string_view scene;
  std::string_view name;
  std::string_view unit;
  std::optional<double> aim;
  std::vector<std::string_view> loops;
};

// The loops of a scene for which an aim is meant; the others have the figure alone.
std::vector<Measure> all_measures() {
  std::vector<Measure> all;
  const std::optional<double> none;
  const auto add = [&all](std::string_view scene, std::string_view name, std::string_view unit,
                          std::optional<double> aim, const std::vector<std::string_view>& aimed,
                          const std::vector<std::string_view>& shown) {
    if (aim && !aimed.empty()) all.push_back({scene, name, unit, aim, aimed});
    if (!shown.empty()) all.push_back({scene, name, unit, std::nullopt, shown});
  };
  constexpr std::array slides = {std::pair{"slide-0.45m", std::array{10.0, 0.05, 5.0}},
                                 std::pair{"slide-0.7m", std::array{15.0, 0.08, 10.0}},
                                 std::pair{"slide-0.95m", std::array{25.0, 0.12, 20.0}}};
  for (const auto& [scene, aims] : slides) {
    add(scene, "felt", "mN", aims[0], {"path", "light", "firm"}, {"chain"});
    add(scene, "step", "N", aims[1], {"path", "light", "firm"}, {"chain"});
    add(scene, "error", "%", aims[2], {"path"}, {"light", "firm", "chain"});
  }
  add("onset", "overshoot", "times", 1.3, {"path", "light"}, {"chain"});
  add("onset", "swing", "N", 0.3, {"path", "light"}, {"chain"});
  add("onset", "swing-median", "N", none, {}, {"path", "light", "chain"});
  for (const std::string_view scene : {"return-covered", "return-stopped", "return-dropped"})
    add(scene, "kick", "mm/s", 40.0, {"free", "light"}, {"chain"});
  for (const std::string_view scene : {"rest-0.45m", "rest-0.7m", "rest-0.95m"}) {
    add(scene, "felt", "mN", 10.0, {"path"}, {"light", "firm", "chain"});
    add(scene, "undamped", "mN", none, {}, {"path"});
  }
  for (const std::string_view scene :
       {"rate-5Hz", "rate-9Hz", "rate-15Hz", "rate-30Hz", "rate-60Hz", "rate-90Hz"}) {
    add(scene, "buzz", "mN", 5.0, {"path", "light"}, {"chain"});
    add(scene, "mean-error", "%", 5.0, {"path"}, {});
    if (scene != "rate-30Hz") continue;
    for (const std::string_view share : {"share-0s", "share-0.1s", "share-0.3s", "share-0.5s"})
      add(scene, share, "%", none, {}, {"chain"});
  }
  add("rub", "ratio", "%", 5.0, {"path"}, {});
  add("stick", "drift", "mm", 0.1, {"light"}, {});
  add("stick-bob", "drift", "mm", 0.1, {"light"}, {});
  for (const std::string_view scene :
       {"energy-exact", "energy-0.45m", "energy-0.7m", "energy-0.95m"}) {
    const std::vector<std::string_view> loops = {"light", "firm", "omega", "chain"};
    add(scene, "above", "mJ", 0.1, {"light", "firm", "omega"}, {"chain"});
    add(scene, "above-99%", "mJ", none, {}, loops);
    add(scene, "above-median", "mJ", none, {}, loops);
    add(scene, "over-0.1mJ", "%", none, {}, loops);
    add(scene, "made", "mJ", none, {}, loops);
    add(scene, "exact", "mJ", none, {}, loops);
    add(scene, "contacts", "", none, {}, {"light"});
    add(scene, "chain-above", "mJ", none, {}, {"chain"});
  }
  return all;
}

const std::vector<Measure>& measures() {
  static const std::vector<Measure> all = all_measures();
  return all;
}
const Measure* find_measure(std::string_view scene, std::string_view name, std::string_view loop) {
  for (const Measure& measure : measures()) {
    if (measure.scene == scene && measure.name == name &&
        std::find(measure.loops.begin(), measure.loops.end(), loop) != measure.loops.end())
      return &measure;
  }
  return nullptr;
}

std::string rows_of(std::string_view scene, const FeelFigures& figures) {
  std::string rows;
  for (const FeelFigure& figure : figures) {
    // What the table does not show stands in the CSV.
    const Measure* measure = find_measure(scene, figure.measure, figure.loop);
    const std::optional<double> aim = measure != nullptr ? measure->aim : std::nullopt;
    rows +=
        csv_row(figure.method, scene, figure.loop, figure.measure,
                measure != nullptr ? measure->unit : "", aim ? csv_field(*aim) : "-", figure.value);
  }
  return rows;
}

// All methods play a scene in one cell, so that its frames are made but once.
std::vector<Cell> feel_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<std::string_view> scenes;
  for (const Measure& measure : measures()) {
    if (scenes.empty() || scenes.back() != measure.scene) scenes.push_back(measure.scene);
  }
  check_families(options, "feel has no such scene", scenes);
  std::vector<OwnMethod> contestants;
  for (const std::string& name : methods_of(experiment, options))
    contestants.push_back(
        {name, [name](const MethodSetup& setup) { return make_method(name, setup); }});
  FeelOptions feel;
  feel.parameters = options.parameters;
  feel.seed = options.seed;
  if (options.grid) std::tie(feel.repeats, feel.phases) = *options.grid;

  std::vector<Cell> cells;
  const auto add = [&](std::string_view scene, auto play, auto... more) {
    if (options.wants(scene))
      cells.emplace_back([=] { return rows_of(scene, play(contestants, feel, more...)); });
  };
  add("slide-0.45m", play_slide, 0.45);
  add("slide-0.7m", play_slide, 0.7);
  add("slide-0.95m", play_slide, 0.95);
  add("onset", play_onset);
  add("return-covered", play_return, Unseen::covered);
  add("return-stopped", play_return, Unseen::stopped);
  add("return-dropped", play_return, Unseen::dropped);
  add("rest-0.45m", play_rest, 0.45);
  add("rest-0.7m", play_rest, 0.7);
  add("rest-0.95m", play_rest, 0.95);
  add("rate-5Hz", play_rate, 5.0);
  add("rate-9Hz", play_rate, 9.0);
  add("rate-15Hz", play_rate, 15.0);
  add("rate-30Hz", play_rate, 30.0);
  add("rate-60Hz", play_rate, 60.0);
  add("rate-90Hz", play_rate, 90.0);
  add("rub", play_rub);
  add("stick", play_stick, 0.0);
  add("stick-bob", play_stick, 0.02);
  add("energy-exact", play_energy, 0.45, "ideal");
  add("energy-0.45m", play_energy, 0.45, "d4xx");
  add("energy-0.7m", play_energy, 0.7, "d4xx");
  add("energy-0.95m", play_energy, 0.95, "d4xx");
  return cells;
}

// A row a measure and loop.
Scores feel_scores(const Table& table) {
  AimTable scores({"scene", "loop", "measure"}, methods_in(table));
  for (const Measure& measure : measures()) {
    for (const std::string_view loop : measure.loops) {
      std::vector<std::optional<double>> values;
      for (const std::string& method : scores.methods()) {
        const std::vector<double> rows = table.numbers("value", {{"method", method},
                                                                 {"scene", measure.scene},
                                                                 {"loop", loop},
                                                                 {"measure", measure.name}});
        constexpr double exact = 1e-6;  // of any unit here: rounding
        if (!rows.empty()) values.emplace_back(rows.front() < exact ? 0.0 : rows.front());
      }
      if (values.empty()) continue;
      values.resize(scores.methods().size());  // all methods play a scene
      scores.add(
          {std::string(measure.scene), std::string(loop), measure_text(measure.name, measure.unit)},
          measure.aim, values);
    }
  }
  return scores.scores("* misses the aim. Measures: docs/feel.md.");
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
