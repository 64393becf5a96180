// SPDX-License-Identifier: Apache-2.0
#include "lab/report.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include <fmt/format.h>

#include "lab/table.hpp"
#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {
namespace {

namespace fs = std::filesystem;

std::string command_line(const Experiment& experiment, const ExperimentOptions& options) {
  std::string line = "palpate eval " + std::string(experiment.name);
  if (!options.methods.empty()) {
    line += " --methods ";
    for (std::size_t i = 0; i < options.methods.size(); ++i)
      line += (i == 0 ? "" : ",") + options.methods[i];
  }
  if (options.grid) line += fmt::format(" --grid {}x{}", options.grid->first, options.grid->second);
  if (options.cases) line += fmt::format(" --cases {}", *options.cases);
  for (std::size_t i = 0; i < options.families.size(); ++i)
    line += (i == 0 ? " --families " : ",") + options.families[i];
  for (const std::string& value : options.fixed) line += " --fix " + value;
  if (!options.case_text.empty()) line += " --case '" + options.case_text + "'";
  if (options.noise == Noise::correlated) line += " --noise correlated";
  if (!options.recording.empty()) line += " --recording " + options.recording;
  if (options.seed != 1) line += fmt::format(" --seed {}", options.seed);
  return line;
}

std::string read(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string scores_as_text(const Scores& scores) {
  std::vector<std::size_t> widths;
  for (const std::string& column : scores.columns) widths.push_back(column.size());
  for (const auto& row : scores.rows) {
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  const auto line = [&widths](const std::vector<std::string>& row) {
    std::string text = " ";
    for (std::size_t i = 0; i < row.size(); ++i) text += fmt::format(" {:<{}}", row[i], widths[i]);
    return text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
  };
  std::string text = line(scores.columns);
  for (const auto& row : scores.rows) text += line(row);
  for (const std::string& sentence : lines_of(scores.note)) text += "  " + sentence + "\n";
  return text;
}

std::string scores_as_markdown(const Scores& scores) {
  const auto line = [](const std::vector<std::string>& row) {
    std::string text = "|";
    for (const std::string& field : row) text += " " + field + " |";
    return text + "\n";
  };
  std::string text = line(scores.columns) + "|";
  for (std::size_t i = 0; i < scores.columns.size(); ++i) text += "---|";
  text += "\n";
  for (const auto& row : scores.rows) text += line(row);
  text += "\n";
  for (const std::string& sentence : lines_of(scores.note)) text += sentence + "  \n";
  return text;
}

std::string scores_as_html(const Scores& scores) {
  const auto line = [](const std::vector<std::string>& row, std::string_view tag) {
    std::string text = "<tr>";
    for (const std::string& field : row) text += fmt::format("<{0}>{1}</{0}>", tag, escaped(field));
    return text + "</tr>\n";
  };
  std::string text = "<div class=\"wide\"><table>" + line(scores.columns, "th");
  for (const auto& row : scores.rows) text += line(row, "td");
  return text + "</table></div>\n<p class=\"note\">" + escaped(scores.note) + "</p>\n";
}

constexpr std::string_view page_head = R"(<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>palpate: experiments</title>
<style>
:root { color-scheme: light dark; --ink: #1c2430; --paper: #fbfaf7; --line: #d9d5cb; --good: #1b7f4b; --bad: #b4441f; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e4de; --paper: #16191e; --line: #3a3f48; --good: #58c48c; --bad: #ef8a62; } }
body { font: 16px/1.55 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 60rem; margin: 0 auto; padding: 2rem 1rem 5rem; }
h1 { font-size: 2rem; margin: 0 0 .5rem; } h2 { margin: 3rem 0 .3rem; border-top: 1px solid var(--line); padding-top: 1.5rem; }
figure { margin: 1rem 0; } figure svg { width: 100%; height: auto; border-radius: 6px; }
.wide { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th, td { text-align: left; vertical-align: top; padding: .45rem .6rem; border-bottom: 1px solid var(--line); }
code { font-size: .88em; } .note { white-space: pre-line; overflow-wrap: anywhere; } .good { color: var(--good); } .bad { color: var(--bad); }
</style></head><body>
)";

// Above experiments that redraw the paper.
constexpr std::string_view paper_head = R"(<h1>The paper, reproduced</h1>
<p>F. Rydén and H. J. Chizeck, <i>A Proxy Method for Real-Time 3-DOF Haptic Rendering of Streaming
Point Cloud Data</i>, IEEE Transactions on Haptics, 2013: its figures and claims beside ours.
Lengths are in units of r_c = 5 mm where the paper's are.</p>
)";

// Of what `bench --growth` writes: a tick against what might make it grow.
Figure growth_figure(const Table& table) {
  Figure figure{{}, 3};
  const auto add = [&](std::string_view series, std::string_view column, Axis x) {
    const Points ticks = points(table, {{"series", series}}, column, "tick_us");
    figure.panels.push_back({.x = std::move(x),
                             .y = {.label = "tick [µs]", .low = 0.0},
                             .series = {{"", ticks, Line::solid, Mark::disc, 0}}});
  };
  add("image_width", "x", {"image width [px]"});
  add("focal_length", "points", {"points in the patch"});
  add("cameras", "x", {"cameras"});
  add("frame_rate", "x", {"frame rate [Hz]"});
  add("depth_mm", "x", {"depth of the HIP [mm]"});
  add("unorganised", "x", {.label = "unorganised points", .log = true});
  return figure;
}

// Of what `trace` writes: heights and force along y, as in Fig. 16.
Figure slide_figure(const Table& table) {
  Panel height{.x = {"along y [m]"}, .y = {"height z [m]"}};
  Panel force{.x = height.x, .y = {"force [N]"}};
  height.series = {
      {"hand (HIP)", points(table, Where{}, "hip_y", "hip_z"), Line::dashed, Mark::none, grey},
      {"proxy", points(table, Where{}, "proxy_y", "proxy_z")}};
  Points felt;
  for (std::size_t row = 0; row < table.rows(); ++row)
    felt.push_back({table.number(row, "hip_y"),
                    std::hypot(table.number(row, "force_x"), table.number(row, "force_y"),
                               table.number(row, "force_z"))});
  force.series = {{"force", felt}};
  return {{height, force}};
}

}  // namespace

fs::path draw(const fs::path& csv) {
  const std::string name = csv.stem().string();
  const std::string text = read(csv);
  if (text.empty())
    throw Error(csv.string(), "there is no such file, or nothing in it",
                "give a CSV that eval, bench --growth or trace wrote");
  const Table table(csv.string(), text);
  const fs::path file = fs::path(csv).replace_extension(".svg");
  if (name == "growth")
    write_file(file, svg(growth_figure(table), "time per tick against possible influences"));
  else if (table.has("hip_x") && !table.has("method"))
    write_file(file, svg(slide_figure(table), "the HIP presses and slides"));
  else
    write_file(file, svg(find_experiment(name).figure(table), find_experiment(name).summary));
  return file;
}

Result make_result(const Experiment& experiment, const ExperimentOptions& options,
                   std::string_view csv, const fs::path& folder) {
  const Table table(std::string(experiment.name) + ".csv", csv);
  Result result{
      .experiment = &experiment,
      .command = command_line(experiment, options),
      .claims = experiment.claims != nullptr ? experiment.claims(table) : std::vector<Claim>(),
      .figure = folder / (std::string(experiment.name) + ".svg"),
      .scores = std::nullopt};
  write_file(result.figure, svg(experiment.figure(table), experiment.summary));
  if (experiment.scores != nullptr) result.scores = experiment.scores(table);
  return result;
}

std::string result_as_text(const Result& result) {
  std::string text = std::string(result.experiment->name) + "\n";
  for (const Claim& claim : result.claims)
    text += fmt::format("  {}: {}\n    paper: {}\n    ours:  {}\n    {}\n", claim.where,
                        claim.words, claim.paper, claim.ours, claim.verdict);
  if (result.scores) text += scores_as_text(*result.scores);
  return text + "  drawn in " + result.figure.string() + "\n";
}

fs::path write_report(const std::vector<Result>& results, const fs::path& folder) {
  std::string page(page_head);
  const bool redraws_the_paper = std::any_of(
      results.begin(), results.end(), [](const Result& result) { return !result.claims.empty(); });
  page += redraws_the_paper ? paper_head : "<h1>Methods, measured</h1>\n";
  std::string notes =
      "# The paper's claims and our results\n\nGenerated by `palpate eval all`; do not edit. "
      "[lab.md](lab.md) describes the experiments.\n\n| where | the paper's words | its number | "
      "ours | | command |\n|---|---|---|---|---|---|\n";
  std::string figures;
  std::string bench;
  for (const Result& result : results) {
    page += fmt::format("<h2>{}</h2>\n<p>{}<br><code>{}</code></p>\n", result.experiment->name,
                        escaped(result.experiment->summary), escaped(result.command));
    const std::string image = fmt::format("\n![{}](images/{})\n", result.experiment->name,
                                          result.figure.filename().string());
    page += "<figure>" + read(result.figure) + "</figure>\n";
    if (result.scores) {
      page += scores_as_html(*result.scores);
      bench += fmt::format("## {}\n\n{}: `{}`\n\n{}{}\n", result.experiment->name,
                           result.experiment->summary, result.command,
                           scores_as_markdown(*result.scores), image);
    } else {
      figures += fmt::format("\n## {}\n\n{}\n{}", result.experiment->name,
                             result.experiment->summary, image);
    }
    if (result.claims.empty()) continue;
    page +=
        "<div class=\"wide\"><table><tr><th>where</th><th>the paper's words</th>"
        "<th>its number</th><th>ours</th><th></th></tr>\n";
    for (const Claim& claim : result.claims) {
      const bool differs = claim.verdict.rfind("differs", 0) == 0;
      page += fmt::format(
          "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"{}\">{}</td></tr>\n",
          escaped(claim.where), escaped(claim.words), escaped(claim.paper), escaped(claim.ours),
          differs ? "bad" : "good", escaped(claim.verdict));
      notes += fmt::format("| {} | {} | {} | {} | {} | `{}` |\n", claim.where, claim.words,
                           claim.paper, claim.ours, claim.verdict, result.command);
    }
    page += "</table></div>\n";
  }
  page += "</body></html>\n";
  write_file(folder / "report.html", page);
  write_file(folder / "reproduction.md", notes + figures);
  if (!bench.empty())
    write_file(
        folder / "bench.md",
        "# Benchmark results\n\nGenerated by `palpate eval`; do not edit. [pop.md](pop.md), "
        "[field.md](field.md) and [feel.md](feel.md) describe the scenes, measures and rules.\n\n" +
            bench);
  return folder / "report.html";
}

}  // namespace palpate::lab
