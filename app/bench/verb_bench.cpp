// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "app/machine.hpp"
#include "app/options.hpp"
#include "app/progress.hpp"
#include "app/verbs.hpp"
#include "palpate/io/sources/source.hpp"
#include "palpate/kernel/core/error.hpp"
#include "palpate/kernel/core/vectorise.hpp"
#include "palpate/kernel/methods/methods.hpp"

#include "bench/costs.hpp"

namespace palpate::app {
namespace {

using Json = nlohmann::ordered_json;
using bench::Distribution;
using bench::Hand;
using bench::KernelCosts;
using bench::SearchCosts;
using bench::Subject;

// The scene that the summary's figures are from.
constexpr double summary_distance = 1.0;
constexpr double focal_length = 525.0;  // [px] of a 640x480 image, as a Kinect has it

struct BenchOptions {
  MethodOptions method;
  std::optional<std::string> camera;
  bool json = false;
  bool quick = false;
  bool growth = false;
  std::string out = ".";
};

double budget_of(const BenchOptions& options) { return options.quick ? 0.001 : 0.25; }

// Resident memory of this process [bytes].
std::size_t resident() {
  std::ifstream in("/proc/self/statm");
  std::size_t total = 0;
  std::size_t pages = 0;
  in >> total >> pages;
  return pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

Json to_json(const Distribution& d) {
  return {{"median_us", d.median}, {"p99_us", d.p99},      {"p999_us", d.p999},
          {"max_us", d.max},       {"samples", d.samples}, {"batch", d.batch}};
}

Json to_json(const KernelCosts& costs) {
  return {{"points_per_patch", costs.points},
          {"steps_per_tick", costs.steps},
          {"gathers_per_tick", costs.gathers},
          {"step", to_json(costs.step)},
          {"steps_per_second", 1e6 / std::max(costs.step.median, 1e-6)},
          {"tick", to_json(costs.tick)},
          {"tick_after_frame", to_json(costs.tick_after_frame)},
          {"frame", to_json(costs.frame)},
          {"gather", to_json(costs.gather)}};
}

Json to_json(const SearchCosts& costs) {
  Json json = {{"method", costs.name}, {"found", costs.found}, {"query", to_json(costs.query)}};
  json["build"] = costs.build ? to_json(*costs.build) : Json();
  return json;
}

struct Row {
  std::string name;
  KernelCosts kernel;
  std::vector<SearchCosts> search;
};

bench::MethodChoice choice_of(const BenchOptions& options) {
  const SessionConfig config = options.method.session(standard_methods());
  return {config.method, config.parameters};
}

std::vector<Row> measure_all(const BenchOptions& options, const bench::MethodChoice& method) {
  struct Scene {
    std::string name;
    std::function<Subject()> make;
  };
  std::vector<Scene> scenes;
  for (const auto& [width, height] : {std::pair{640, 480}, std::pair{1280, 720}}) {
    for (const double distance : {0.3, 0.5, summary_distance, 2.0}) {
      // The same field of view across: twice the pixels see twice as finely.
      const double focal = focal_length * width / 640.0;
      scenes.push_back(
          {fmt::format("{}x{} at {} m", width, height, distance),
           [=, w = width, h = height] { return bench::noisy_plane(w, h, focal, distance); }});
    }
  }
  if (options.camera)
    scenes.push_back({*options.camera, [&options] {
                        const auto frame = open_source(*options.camera)->next();
                        if (!frame)
                          throw Error(*options.camera, "it has no frames",
                                      "give a source with at least one");
                        return bench::recorded(*options.camera, frame->cloud);
                      }});
  if (options.quick) scenes.erase(scenes.begin() + 3, scenes.begin() + 8);

  Progress progress("bench", scenes.size());
  std::vector<Row> rows;
  for (const Scene& scene : scenes) {
    const Subject subject = scene.make();
    rows.push_back({scene.name, bench::kernel_costs(subject, method, Hand{}, budget_of(options)),
                    bench::search_costs(subject, method.parameters, budget_of(options))});
    progress.advance();
  }
  progress.finish();
  return rows;
}

// How much a session grows once it is warm [bytes].
std::size_t growth_of_memory(const bench::MethodChoice& method, double budget) {
  const Subject subject = bench::noisy_plane(640, 480, focal_length, summary_distance);
  bench::kernel_costs(subject, method, Hand{}, budget);
  const std::size_t before = resident();
  bench::kernel_costs(subject, method, Hand{}, budget);
  const std::size_t after = resident();
  return after > before ? after - before : 0;
}

int report(const BenchOptions& options) {
  const bench::MethodChoice method = choice_of(options);
  const std::vector<Row> rows = measure_all(options, method);
  const Row& one_metre = rows[2];  // 640x480 at summary_distance
  const SearchCosts& tree =
      *std::find_if(one_metre.search.begin(), one_metre.search.end(),
                    [](const SearchCosts& costs) { return costs.name == "nanoflann"; });
  const std::size_t growth = growth_of_memory(method, budget_of(options));
  const std::string known = look_at_machine().processor;
  const std::string processor = known.empty() ? "unknown processor" : known;

  if (options.json) {
    const KernelCosts& kernel = one_metre.kernel;
    Json json = {{"processor", processor},
                 {"vector_set", vector_set_in_use()},
                 {"step_us_median", kernel.step.median},
                 {"steps_per_second", 1e6 / std::max(kernel.step.median, 1e-6)},
                 {"tick_us_median", kernel.tick.median},
                 {"tick_us_p99", kernel.tick.p99},
                 {"tick_us_p999", kernel.tick.p999},
                 {"tick_us_max", kernel.tick.max},
                 {"frame_us_median", kernel.frame.median},
                 {"gather_us_median", kernel.gather.median},
                 {"kdtree_query_us_median", tree.query.median},
                 {"kdtree_build_us_median", tree.build->median},
                 {"resident_bytes", resident()},
                 {"resident_growth_bytes", growth},
                 {"scenes", Json::array()}};
    for (const Row& row : rows) {
      Json search = Json::array();
      for (const SearchCosts& costs : row.search) search.push_back(to_json(costs));
      json["scenes"].push_back(
          {{"name", row.name}, {"kernel", to_json(row.kernel)}, {"search", search}});
    }
    fmt::print("{}\n", json.dump(2));
    return 0;
  }

  fmt::print("{}, loops in {}; microseconds of the thread's own time\n\n", processor,
             vector_set_in_use());
  fmt::print("{:<20}{:>7}{:>7}{:>8}{:>8}{:>8}{:>8}{:>9}{:>9}{:>8}\n", "the kernel", "points",
             "steps", "step", "gather", "tick", "p99", "p99.9", "max", "frame");
  for (const Row& row : rows) {
    const KernelCosts& k = row.kernel;
    fmt::print("{:<20}{:>7.0f}{:>7.2f}{:>8.3f}{:>8.3f}{:>8.3f}{:>8.2f}{:>9.2f}{:>9.2f}{:>8.4f}\n",
               row.name, k.points, k.steps, k.step.median, k.gather.median, k.tick.median,
               k.tick.p99, k.tick.p999, k.tick.max, k.frame.median);
  }
  fmt::print(
      "\nstep, gather and frame are means over batches of 64; ticks are timed one by one.\n");
  fmt::print("\n{:<20}{:<14}{:>14}{:>12}{:>10}{:>8}\n", "the search", "method", "build a frame",
             "query", "p99", "found");
  for (const Row& row : rows) {
    for (const SearchCosts& costs : row.search)
      fmt::print("{:<20}{:<14}{:>14}{:>12.3f}{:>10.3f}{:>8}\n", row.name, costs.name,
                 costs.build ? fmt::format("{:.0f}", costs.build->median) : "-", costs.query.median,
                 costs.query.p99, costs.found);
  }
  const KernelCosts& k = one_metre.kernel;
  fmt::print(
      "\n{}: {:.0f} proxy steps per millisecond; a whole tick takes {:.2f} of one nanoflann "
      "query,\nand passing a frame on 1/{:.0f} of building its tree. After warm-up, memory grew by "
      "{} bytes.\n",
      one_metre.name, 1e3 / std::max(k.step.median, 1e-6),
      k.tick.median / std::max(tree.query.median, 1e-6),
      tree.build->median / std::max(k.frame.median, 1e-6), growth);
  return 0;
}

// How a tick's cost grows with each thing that could make it grow: one CSV.
int report_growth(const BenchOptions& options) {
  const bench::MethodChoice method = choice_of(options);
  const std::filesystem::path file = std::filesystem::path(options.out) / "growth.csv";
  std::filesystem::create_directories(options.out);
  std::ofstream csv(file);
  csv << "series,x,points,steps,gathers,tick_us,tick_p999_us,gather_us,build_us\n";
  const double budget = budget_of(options);
  const auto add = [&](const std::string& series, double x, const Subject& subject,
                       const Hand& hand, double build_us) {
    const KernelCosts k = bench::kernel_costs(subject, method, hand, budget);
    csv << fmt::format("{},{:g},{:.1f},{:.3f},{:.4f},{:.4f},{:.4f},{:.4f},{:.1f}\n", series, x,
                       k.points, k.steps, k.gathers, k.tick.median, k.tick.p999, k.gather.median,
                       build_us);
  };
  const Hand hand;
  for (const int width : {320, 640, 1280, 1920})
    add("image_width", width, bench::noisy_plane(width, width * 3 / 4, focal_length, 1.0), hand, 0);
  for (const double focal : {150.0, 300.0, 600.0, 1200.0, 2400.0})
    add("focal_length", focal, bench::noisy_plane(640, 480, focal, 1.0), hand, 0);
  for (const int cameras : {1, 2, 3, 4, 6, 8})
    add("cameras", cameras, bench::noisy_plane(640, 480, focal_length, 1.0, cameras), hand, 0);
  for (const double rate : {15.0, 30.0, 60.0, 120.0, 240.0})
    add("frame_rate", rate, bench::noisy_plane(640, 480, focal_length, 1.0),
        Hand{.frame_rate = rate}, 0);
  for (const double depth : {-0.02, -0.005, 0.0, 0.002, 0.005, 0.01})
    add("depth_mm", 1e3 * depth, bench::noisy_plane(640, 480, focal_length, 1.0),
        Hand{.depth = depth}, 0);
  const std::size_t largest = options.quick ? 10000 : 10000000;
  for (std::size_t points = 10000; points <= largest; points *= 10) {
    constexpr double spacing = 1.5e-3;  // [m], 0.3 r_c
    const double begin = bench::thread_time();
    const Subject subject = bench::noisy_points(points, spacing);
    // Making the points is a small part of it.
    add("unorganised", static_cast<double>(points), subject, hand, bench::thread_time() - begin);
  }
  csv.flush();
  if (!csv) throw std::runtime_error(file.string() + ": cannot be written");
  fmt::print("{}\n", file.string());
  return 0;
}

}  // namespace

Verb add_bench(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "bench", "measure the time per tick on this computer, compared with alternatives");
  const auto options = std::make_shared<BenchOptions>();
  options->method.add_to(*command);
  command->add_option("--camera", options->camera,
                      "also measure on the first frame of this source");
  command->add_flag("--json", options->json, "print a JSON object");
  command->add_flag("--quick", options->quick,
                    "few repetitions: a quick test without accurate times");
  command->add_flag("--growth", options->growth,
                    "measure how the time per tick grows, as DIR/growth.csv");
  command->add_option("--out", options->out, "folder for --growth")->type_name("DIR");
  return {command,
          [options] { return options->growth ? report_growth(*options) : report(*options); }};
}

}  // namespace palpate::app
