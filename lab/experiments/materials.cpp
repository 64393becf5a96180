// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/materials.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <fmt/format.h>

#include "lab/signal.hpp"
#include "lab/table.hpp"
#include "palpate/cloud/material_map.hpp"
#include "palpate/devices/scripted_device.hpp"
#include "palpate/methods/methods.hpp"
#include "palpate/servo/cycle.hpp"
#include "palpate/sources/source.hpp"

namespace palpate::lab {
namespace {

constexpr double period = 1e-3;        // [s] of a tick
constexpr double engaged = 1.8;        // [s] frames are in use, and the chain's ramp is over
constexpr double strike = 0.15;        // [m/s]
constexpr double above = 0.02;         // [m]
constexpr double struck = 3e-3;        // [m] as deep as a strike and a stroke go
constexpr double press_from = 2.6;     // [s]
constexpr double press_for = 1.0;      // [s]
constexpr double pressed = 5e-3;       // [m]
constexpr double stroke_from = 4.2;    // [s]
constexpr double stroke_speed = 0.06;  // [m/s]
constexpr double stroke_length = 0.04;
constexpr double stroke_for = stroke_length / stroke_speed;
constexpr double rest_for = 0.5;  // [s] after a stroke
constexpr double duration = stroke_from + stroke_for + rest_for;

// Depths are those of the HIP below the surface: there its force begins.
HipPath way() {
  const auto at = [](double along, double depth) { return Vec3(along, 0.0, -depth); };
  const double hits = engaged + (above + struck) / strike;
  return HipPath({{0.0, at(0.0, -above)},
                  {engaged, at(0.0, -above)},
                  {hits, at(0.0, struck)},
                  {hits + 0.4, at(0.0, struck)},
                  {press_from, at(0.0, 0.0)},
                  {press_from + press_for, at(0.0, pressed)},
                  {stroke_from - 0.2, at(0.0, struck)},
                  {stroke_from, at(0.0, struck)},
                  {stroke_from + stroke_for, at(stroke_length, struck)},
                  {duration, at(stroke_length, struck)}});
}

std::string rows_of(const std::string& material, const Parameters& parameters) {
  const auto source = open_source("synthetic:plane?size=160x120&material=" + material);
  ScriptedDevice device(way(), false);
  ServoSettings settings;
  settings.parameters = parameters;
  settings.safety.initial_heat = 0.0;
  constexpr std::size_t ring = 4;  // read after each tick
  Cycle cycle(make_method("sight", {parameters, nullptr}), device, settings, ring);
  auto ticks = cycle.reader();
  std::optional<Frame> next = source->next();
  std::string rows;
  const auto count = static_cast<std::int64_t>(std::llround(duration / period));
  for (std::int64_t i = 0; i <= count; ++i) {
    const double t = static_cast<double>(i) * period;
    for (; next && next->stamp <= t; next = source->next())
      cycle.put_frame(next->cloud, next->stamp, t);
    cycle.run({.t = t});
    ServoTick felt;
    if (!ticks.try_pop(felt) || t < engaged) continue;
    rows += Row()
                .add(material)
                .add(t)
                .add(-1e3 * felt.tick.hip.z())
                .add(1e3 * felt.tick.hip.x())
                .add(felt.force.z())
                .add(-felt.force.x())
                .done();
  }
  return rows;
}

std::vector<Cell> material_cells(const Experiment& /*experiment*/,
                                 const ExperimentOptions& options) {
  std::vector<std::string> names = options.families;
  if (names.empty()) {
    for (const NamedMaterial& one : standard_materials().materials) names.push_back(one.name);
  }
  std::vector<Cell> cells;
  for (const std::string& name : names) {
    static_cast<void>(standard_material(name));  // throws, naming the nearest
    cells.emplace_back(
        [name, parameters = options.parameters] { return rows_of(name, parameters); });
  }
  return cells;
}

Scores material_scores(const Table& table) {
  Scores scores;
  scores.columns = {"material",     "stiffness [N/m]", "strike [N]",
                    "friction [-]", "stroke [mN]",     "rest [mN]"};
  std::vector<std::string> names;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (names.empty() || names.back() != table.text(row, "material"))
      names.push_back(table.text(row, "material"));
  }
  for (const std::string& name : names) {
    const auto during = [&](std::string_view column, double from, double to) {
      return table.numbers(column, [&](std::size_t row) {
        const double t = table.number(row, "t");
        return table.text(row, "material") == name && t >= from - 1e-9 && t < to - 1e-9;
      });
    };
    const auto mean = [&](std::string_view column, double from, double to) {
      const std::vector<double> values = during(column, from, to);
      double sum = 0.0;
      for (const double value : values) sum += value;
      return sum / static_cast<double>(values.size());
    };
    // Between 1 and 4 mm of the slow press.
    const auto press_at = [](double depth) { return press_from + depth / pressed * press_for; };
    const double stiffness = (mean("normal", press_at(4e-3), press_at(4e-3) + 0.01) -
                              mean("normal", press_at(1e-3), press_at(1e-3) + 0.01)) /
                             3e-3;
    const double hits = engaged + above / strike;
    const std::vector<double> blow = during("normal", hits, hits + 0.06);
    const double held = mean("normal", hits + 0.3, hits + 0.4);
    const double slides = stroke_from + 0.2;
    const double stops = stroke_from + stroke_for;
    const double rests = stops + 0.1;
    const auto shaking = [&](double from, double to) {
      return 1e3 * std::hypot(felt_rms_of_all(during("normal", from, to)),
                              felt_rms_of_all(during("tangential", from, to)));
    };
    scores.rows.push_back(
        {name, fmt::format("{:.0f}", stiffness),
         fmt::format("{:.2f}", *std::max_element(blow.begin(), blow.end()) - held),
         fmt::format("{:.2f}", mean("tangential", slides, stops) / mean("normal", slides, stops)),
         fmt::format("{:.1f}", shaking(slides, stops)),
         fmt::format("{:.1f}", shaking(rests, duration))});
  }
  scores.note = fmt::format(
      "Strike: the force beyond what is held afterwards, at {} m/s. Friction: tangential over "
      "normal "
      "force at {} m/s. Stroke and rest: the force from 20 to 400 Hz. docs/materials.md.",
      strike, stroke_speed);
  return scores;
}

constexpr std::string_view material_plot = R"gp(
names = "ice metal wood sandpaper rubber foam"
of(m, from, to) = sprintf("< awk -F, '$1 == \"%s\" && $2 >= %g && $2 < %g' %s", m, from, to, csv)
set multiplot layout 2,2
set key outside right top noenhanced
set grid
set title "a strike at 0.15 m/s"
set xlabel "time [ms]"
set ylabel "normal force [N]"
plot for [m in names] of(m, 1.925, 2.0) using (1e3*($2-1.9333)):5 with lines lw 1.5 title m
set title "a slow press"
set xlabel "depth of the hand [mm]"
plot for [m in names] of(m, 2.6, 3.6) using 3:5 with lines lw 1.5 notitle
set title "a stroke at 60 mm/s, held 3 mm deep"
set xlabel "way of the hand [mm]"
set ylabel "force along the surface [N]"
plot for [m in names] of(m, 4.2, 4.866) using 4:6 with lines lw 1.5 notitle
set title "the same, a tenth of a second of it"
set xlabel "time [ms]"
set ylabel "normal force, less its mean [N]"
set yrange [-3.2:0.7]
mean(m) = real(system(sprintf("awk -F, '$1 == \"%s\" && $2 >= 4.6 && $2 < 4.7 {s += $5; n++} END {print s / n}' %s", m, csv)))
plot for [i=1:words(names)] of(word(names, i), 4.6, 4.7) using (1e3*($2-4.6)):($5-mean(word(names, i))-0.5*(i-1)) with lines lw 1.5 lc i notitle
unset multiplot
)gp";

}  // namespace

Experiment materials_experiment() {
  return {"materials",
          "what a strike, a press and a stroke feel like on each standard material",
          "material,t,depth,along,normal,tangential",
          {},
          false,
          material_cells,
          material_plot,
          no_claims,
          material_scores};
}

}  // namespace palpate::lab
