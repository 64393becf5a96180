// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <fmt/format.h>

#include "lab/closed_loop.hpp"
#include "lab/experiment.hpp"
#include "lab/statistics.hpp"
#include "lab/table.hpp"
#include "palpate/io/devices/hip_path.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/cloud/material_map.hpp"

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
  const auto loop =
      safe_loop(make_method("sight", {parameters, nullptr}), on_path(way()), parameters);
  std::optional<Frame> next = source->next();
  std::string rows;
  const auto count = static_cast<std::int64_t>(std::llround(duration / period));
  for (std::int64_t i = 0; i <= count; ++i) {
    const double t = static_cast<double>(i) * period;
    for (; next && next->stamp <= t; next = source->next())
      loop->frame(next->cloud, next->stamp, t);
    const Felt felt = loop->tick(t);
    if (t < engaged) continue;
    rows += csv_row(material, t, -1e3 * felt.hip.z(), 1e3 * felt.hip.x(), felt.force.z(),
                    -felt.force.x());
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
  for (const Table& rows : table.by({"material"})) {
    const auto during = [&](std::string_view column, double from, double to) {
      return rows.numbers(column, [&](std::size_t row) {
        const double t = rows.number(row, "t");
        return t >= from - 1e-9 && t < to - 1e-9;
      });
    };
    // Between 1 and 4 mm of the slow press.
    const auto press_at = [](double depth) { return press_from + depth / pressed * press_for; };
    const double stiffness = (mean(during("normal", press_at(4e-3), press_at(4e-3) + 0.01)) -
                              mean(during("normal", press_at(1e-3), press_at(1e-3) + 0.01))) /
                             3e-3;
    const double hits = engaged + above / strike;
    const double blow = largest(during("normal", hits, hits + 0.06));
    const double held = mean(during("normal", hits + 0.3, hits + 0.4));
    const double slides = stroke_from + 0.2;
    const double stops = stroke_from + stroke_for;
    const double rests = stops + 0.1;
    const auto shaking = [&](double from, double to) {
      return 1e3 * std::hypot(felt_rms_of_all(during("normal", from, to)),
                              felt_rms_of_all(during("tangential", from, to)));
    };
    scores.rows.push_back({rows.text(0, "material"), fmt::format("{:.0f}", stiffness),
                           fmt::format("{:.2f}", blow - held),
                           fmt::format("{:.2f}", mean(during("tangential", slides, stops)) /
                                                     mean(during("normal", slides, stops))),
                           fmt::format("{:.1f}", shaking(slides, stops)),
                           fmt::format("{:.1f}", shaking(rests, duration))});
  }
  scores.note = fmt::format(
      "Strike: the force above the static force afterwards, at {} m/s. Friction: tangential over "
      "normal force at {} m/s. Stroke and rest: the force from 20 to 400 Hz. docs/materials.md.",
      strike, stroke_speed);
  return scores;
}

}  // namespace

Experiment materials_experiment() {
  return {.name = "materials",
          .summary = "force of an impact, a press and a slide on each standard material",
          .header = "material,t,depth,along,normal,tangential",
          .cells = material_cells,
          .scores = material_scores};
}

}  // namespace palpate::lab
