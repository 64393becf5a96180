// SPDX-License-Identifier: Apache-2.0
#include "lab/experiments/methods.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>
#include <map>

#include <fmt/format.h>
#include <malloc.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lab/experiments/pop.hpp"
#include "lab/experiments/pop_cases.hpp"
#include "lab/method.hpp"
#include "palpate/core/error.hpp"
#include "palpate/sources/synthetic_camera.hpp"

namespace palpate::lab {
namespace {

constexpr int usual_cases = 5;  // of each family of pop
constexpr int usual_repeats = 3;

// A column of the table.
struct Measure {
  std::string_view name;   // in the CSV
  std::string_view title;  // with its unit
  int digits;
};

constexpr std::array measures = {
    Measure{"pop", "pop score [%]", 1},
    Measure{"occluder", "occluders held [%]", 0},
    Measure{"first_contact", "first contact [m/s]", 2},
    Measure{"hold_white", "hold, white [mm]", 1},
    Measure{"hold_correlated", "hold, correlated [mm]", 1},
    Measure{"hold_real", "hold, real, 0.7 m [%]", 0},
    Measure{"plane_white", "plane, white 1 mm [mm]", 2},
    Measure{"plane_real", "plane, real, 0.45 m [mm]", 2},
    Measure{"sphere_real", "sphere, real, 0.45 m [mm]", 2},
    Measure{"plane", "plane [mm]", 3},
    Measure{"relief", "relief [mm]", 2},
    Measure{"corners", "corners [mm]", 2},
    Measure{"step", "force step [N/ms]", 2},
    Measure{"frame", "frame [us]", 0},
    Measure{"tick", "tick [us]", 1},
    Measure{"memory", "memory [MB]", 2},
};

std::string row(std::string_view method, std::string_view measure, double value) {
  Row line;
  line.add(method).add(measure);
  if (std::isfinite(value))
    line.add(value);
  else
    line.add("-");
  return line.done();
}

// The rows of another experiment for one method, every `stride`-th of its cells.
Table run_part(std::string_view name, const ExperimentOptions& options, std::size_t stride = 1) {
  const Experiment& experiment = find_experiment(name);
  std::string csv = std::string(experiment.header) + "\n";
  const std::vector<Cell> cells = experiment.cells(experiment, options);
  for (std::size_t i = 0; i < cells.size(); i += stride) csv += cells[i]();
  return {name, csv};
}

ExperimentOptions only(const std::string& method, const ExperimentOptions& options) {
  ExperimentOptions part = options;
  part.methods = {method};
  part.grid.reset();
  return part;
}

std::string pop_rows(const std::string& method, const ExperimentOptions& options) {
  const int cases = options.cases.value_or(usual_cases);
  double sum = 0.0;
  double occluder = std::numeric_limits<double>::quiet_NaN();
  const std::vector<const PopFamily*> families = find_pop_families(options.families);
  for (const PopFamily* family : families) {
    int held = 0;
    for (int i = 0; i < cases; ++i)
      held += is_lost(method, draw_pop_case(*family, options.seed, static_cast<std::uint64_t>(i)),
                      options.parameters)
                  ? 0
                  : 1;
    const double share = 100.0 * held / cases;
    sum += share / static_cast<double>(families.size());
    if (family->name == "occluder") occluder = share;
  }
  return row(method, "pop", sum) + row(method, "occluder", occluder);
}

// The highest value of a column below the first at which something was lost; none if that is 0.
double held_below(const Table& table, std::string_view column, std::string_view noise) {
  double lost = std::numeric_limits<double>::infinity();
  double held = 0.0;
  const auto counts = [&](std::size_t i) {
    return noise.empty() || table.text(i, "noise") == noise;
  };
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (counts(i) && table.number(i, "popped") != 0.0)
      lost = std::min(lost, table.number(i, column));
  }
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const double value = table.number(i, column);
    if (counts(i) && value < lost) held = std::max(held, value);
  }
  return lost > 0.0 ? held : std::numeric_limits<double>::quiet_NaN();
}

std::string hold_rows(const std::string& method, const ExperimentOptions& options) {
  const int repeats = options.grid.value_or(std::pair{usual_repeats, usual_repeats}).first;
  // Of the twenty phases in which a surface comes, as many as are asked for.
  const Table contact = run_part("first-contact", only(method, options),
                                 static_cast<std::size_t>(std::max(1, 20 / std::max(repeats, 1))));
  ExperimentOptions hold = only(method, options);
  hold.grid = {7, repeats};
  const Table held = run_part("hold", hold);
  return row(method, "first_contact", held_below(contact, "speed", "")) +
         row(method, "hold_white", held_below(held, "sigma_mm", "white")) +
         row(method, "hold_correlated", held_below(held, "sigma_mm", "correlated"));
}

std::string contact_rows(const std::string& method, const ExperimentOptions& options) {
  ExperimentOptions part = only(method, options);
  part.grid = options.grid.value_or(std::pair{usual_repeats, usual_repeats});
  part.families = {"white-1mm",   "real-0.45m",   "real-0.7m", "sphere-0.45m",
                   "quiet-plane", "quiet-relief", "sine"};
  const Table fidelity = run_part("fidelity", part);
  const auto value = [&](std::string_view scene, std::string_view measure) {
    for (std::size_t i = 0; i < fidelity.rows(); ++i) {
      if (fidelity.text(i, "scene") == scene && fidelity.text(i, "measure") == measure)
        return fidelity.number(i, "value");
    }
    return std::numeric_limits<double>::quiet_NaN();  // lost in every repeat
  };
  const Table corners = run_part("corners", only(method, options));
  double squares = 0.0;
  for (std::size_t i = 0; i < corners.rows(); ++i) squares += std::pow(corners.number(i, "gap"), 2);
  return row(method, "hold_real", 100.0 - value("real-0.7m", "lost")) +
         row(method, "plane_white", value("white-1mm", "rms")) +
         row(method, "plane_real", value("real-0.45m", "rms")) +
         row(method, "sphere_real", value("sphere-0.45m", "rms")) +
         row(method, "plane", value("quiet-plane", "largest")) +
         row(method, "relief", value("quiet-relief", "rms")) +
         row(method, "corners",
             1e3 * std::sqrt(squares /
                             static_cast<double>(std::max<std::size_t>(corners.rows(), 1)))) +
         row(method, "step", value("sine", "step"));
}

struct Cost {
  double frame = 0.0, tick = 0.0;  // [s] median
  double memory = 0.0;             // [bytes] most at any time
};

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double allocated() {
  const struct mallinfo2 heap = mallinfo2();
  return static_cast<double>(heap.uordblks) + static_cast<double>(heap.hblkhd);
}

// A plane at 0.7 m in 640 x 480 with a D4xx's noise, the hand 10 mm below it: thirty frames. What a
// method puts off to the first tick of a frame is a cost of the frame.
Cost measure_cost(const std::string& name, const ExperimentOptions& options) {
  const auto camera = open_synthetic_camera(
      Uri("synthetic:plane?sensor=d4xx&distance=0.7m&seed=" + std::to_string(options.seed)));
  std::array<Frame, 8> frames;
  for (std::size_t k = 0; k < frames.size(); ++k)
    frames[k] = camera->capture(static_cast<double>(k) / 30.0, k);
  const Truth truth = truth_of(std::make_shared<const Scene>(camera->scene()));
  const double before = allocated();
  const auto method = make_method(name, {options.parameters, truth});
  method->seat(Vec3(0.0, 0.0, 0.03));
  std::vector<double> first;
  std::vector<double> others;
  Cost cost;
  for (int k = 0; k < 30; ++k) {
    const double stamp = k / 30.0;
    const double begin = thread_seconds();
    method->observe({*frames[static_cast<std::size_t>(k) % frames.size()].cloud, stamp});
    for (int i = 0; i < 33; ++i) {
      const double t = stamp + 1e-3 * i;
      const Vec3 hip(0.0, 0.0, std::max(0.03 - 0.1 * t, -0.010));
      const double tick_begin = i == 0 ? begin : thread_seconds();
      method->tick(hip, t);
      (i == 0 ? first : others).push_back(thread_seconds() - tick_begin);
    }
    cost.memory = std::max(cost.memory, allocated() - before);
  }
  cost.tick = median(others);
  cost.frame = std::max(median(first) - cost.tick, 0.0);
  return cost;
}

// In a process of its own: its heap is the method's alone.
std::string cost_rows(const std::string& method, const ExperimentOptions& options) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0)
    throw Error("methods", "no pipe can be made", "close some of the machine's files");
  const pid_t child = fork();
  if (child < 0)
    throw Error("methods", "no process can be started", "end some of the machine's processes");
  if (child == 0) {
    bool sent = false;
    try {
      const Cost cost = measure_cost(method, options);
      sent = write(ends[1], &cost, sizeof cost) == static_cast<ssize_t>(sizeof cost);
    } catch (const std::exception&) {
    }
    _exit(sent ? 0 : 1);
  }
  close(ends[1]);
  Cost cost;
  const bool whole = read(ends[0], &cost, sizeof cost) == static_cast<ssize_t>(sizeof cost);
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (!whole || status != 0)
    throw Error("methods", "the cost of '" + method + "' could not be measured",
                "see whether palpate run --headless --method " + method + " works");
  return row(method, "frame", 1e6 * cost.frame) + row(method, "tick", 1e6 * cost.tick) +
         row(method, "memory", 1e-6 * cost.memory);
}

std::vector<Cell> methods_cells(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<Cell> cells;
  for (const std::string& method : methods_of(experiment, options)) {
    cells.emplace_back([=] { return pop_rows(method, options); });
    cells.emplace_back([=] { return hold_rows(method, options); });
    cells.emplace_back([=] { return contact_rows(method, options); });
    cells.emplace_back([=] { return cost_rows(method, options); });
  }
  return cells;
}

Scores methods_scores(const Table& table) {
  Scores scores;
  scores.columns = {"method"};
  for (const Measure& measure : measures) scores.columns.emplace_back(measure.title);
  std::vector<std::string> order;
  std::map<std::string, std::map<std::string, std::size_t, std::less<>>> found;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const std::string& method = table.text(i, "method");
    if (found.find(method) == found.end()) order.push_back(method);
    found[method][table.text(i, "measure")] = i;
  }
  for (const std::string& method : order) {
    std::vector<std::string> line = {method};
    for (const Measure& measure : measures) {
      const auto at = found[method].find(measure.name);
      if (at == found[method].end() || table.text(at->second, "value") == "-")
        line.emplace_back("-");
      else
        line.push_back(fmt::format("{:.{}f}", table.number(at->second, "value"), measure.digits));
    }
    scores.rows.push_back(std::move(line));
  }
  scores.note = "- popped through in every repeat. The columns: docs/methods.md.";
  return scores;
}

Figure methods_figure(const Table& table) {
  constexpr double ticks = 33.0;  // of a frame
  Panel score{.x = {.label = "pop score [%]", .low = -2.0, .high = 102.0}};
  Panel cost{.x = {.label = "time of a frame and its ticks [µs]", .log = true}};
  score.series = {{"", {}, Line::none, Mark::disc, 0}};
  cost.series = score.series;
  for (const std::string& method : methods_in(table)) {
    std::map<std::string, double> found;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      if (table.text(row, "method") == method && table.text(row, "value") != "-")
        found[table.text(row, "measure")] = table.number(row, "value");
    }
    score.y.names.push_back(method);
    const auto place = static_cast<double>(score.y.names.size());
    score.series[0].points.push_back({found["pop"], place});
    cost.series[0].points.push_back({found["frame"] + ticks * found["tick"], place});
  }
  cost.y.names = score.y.names;
  return {{score, cost}, 2};
}

}  // namespace

Experiment methods_experiment() {
  Experiment experiment{"methods",
                        "all methods in one table: pop-through, accuracy, time",
                        "method,measure,value",
                        {},
                        true,
                        methods_cells,
                        methods_figure,
                        no_claims,
                        methods_scores};
  static const MethodRegistry all = methods();
  for (const MethodInfo& method : all.entries()) experiment.default_methods.push_back(method.name);
  return experiment;
}

}  // namespace palpate::lab
