// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lab/method.hpp"
#include "lab/table.hpp"
#include "palpate/kernel/core/parameters.hpp"

namespace palpate::lab {

enum class Noise { white, correlated };

/// What an experiment is run with.
struct ExperimentOptions {
  std::vector<std::string> methods;         ///< empty: those that the experiment compares
  std::uint64_t seed = 1;                   ///< of all noise
  std::optional<std::pair<int, int>> grid;  ///< sizes of its two axes, where it has two
  Noise noise = Noise::white;
  std::string recording;  ///< a source's URI where an experiment takes one; empty: a simulation
  Parameters parameters;  ///< Table 2 unless set

  // The benches `pop` and `field`.
  std::optional<int> cases;           ///< how many of each family or class
  std::vector<std::string> families;  ///< of pop; classes of field, scenes of fidelity; or all
  std::vector<std::string> fixed;     ///< KEY=VALUE: not drawn at random
  std::string case_text;              ///< one case, as a run printed it, and nothing else
  /// Methods besides those of the lab, of whoever calls; `pop`, `fidelity` and `real` know them.
  std::vector<OwnMethod> own_methods;

  /// Is a family, class or scene asked for?
  [[nodiscard]] bool wants(std::string_view family) const {
    return families.empty() ||
           std::find(families.begin(), families.end(), family) != families.end();
  }
};

/// A piece of an experiment that needs no other: its rows of the CSV, each ended by a newline.
using Cell = std::function<std::string()>;

/// One sentence of the paper next to what we measured.
struct Claim {
  std::string where;    ///< section or figure
  std::string words;    ///< what the paper says
  std::string paper;    ///< its number
  std::string ours;     ///< our number
  std::string verdict;  ///< "reproduced", or "differs: " and why
};

/// What a bench comes to: a table in which methods stand side by side.
struct Scores {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;  ///< each as long as `columns`
  std::string note;                            ///< beneath it, a sentence or a command a line
};

/// An experiment that can be asked for by name. Deterministic: the same options give the same CSV,
/// byte for byte, however its cells are spread over threads and machines.
struct Experiment {
  std::string_view name;
  std::string_view summary;                            ///< one line, with the paper's section
  std::string_view header;                             ///< of the CSV
  std::vector<std::string_view> default_methods = {};  ///< empty: it compares none
  std::vector<Cell> (*cells)(const Experiment&, const ExperimentOptions&);
  std::vector<Claim> (*claims)(const Table&) = nullptr;  ///< of what redraws the paper
  Scores (*scores)(const Table&) = nullptr;              ///< of a bench
  bool has_grid = false;                                 ///< takes --grid
  bool takes_recording = false;                          ///< takes --recording
  bool plays_programs = false;                           ///< takes methods `pipe:COMMAND`
};

/// All experiments, in the order of the report.
const std::vector<Experiment>& known_experiments();

/// @throws Error for an unknown name, naming the nearest and listing all.
const Experiment& find_experiment(std::string_view name);

/// The methods to run: those asked for, else the experiment's own.
/// @throws Error for an unknown one.
std::vector<std::string> methods_of(const Experiment& experiment, const ExperimentOptions& options);

/// The cells of an experiment that has one for each method, whose rows are `rows`.
template <std::string (*rows)(const std::string& method, const ExperimentOptions&)>
std::vector<Cell> by_method(const Experiment& experiment, const ExperimentOptions& options) {
  std::vector<Cell> cells;
  for (const std::string& name : methods_of(experiment, options))
    cells.emplace_back([=] { return rows(name, options); });
  return cells;
}

/// @param what  such as "feel has no such scene"  @param known  all names that --families takes
/// @throws Error for another, naming the nearest.
void check_families(const ExperimentOptions& options, std::string_view what,
                    std::span<const std::string_view> known);

/// A column of scores: its title, and what it says of a group of the CSV's rows.
struct Column {
  std::string title;
  std::function<std::string(const Table& group)> text;
};

/// Numbers of the CSV, those of several columns side by side.
/// @param format  of a number, such as "{:.2f}"  @param unit  by which it is multiplied
/// @param of      what stands for the numbers of a group's rows
Column shown(std::string title, std::vector<std::string_view> columns, std::string_view format,
             double unit = 1.0, double (*of)(std::span<const double>) = first);

/// A line for each group of rows: the text that they share in the columns `keys`, and `columns`.
Scores scores_of(const std::vector<Table>& groups, const std::vector<std::string_view>& keys,
                 const std::vector<Column>& columns, std::string note);
/// The same of the groups by these keys.
Scores scores_by(const Table& table, const std::vector<std::string_view>& keys,
                 const std::vector<Column>& columns, std::string note);

/// A line of aim_scores.
struct AimLine {
  Where where;                ///< the columns that tell it, the last of them "measure"
  std::string_view unit;      ///< of the measure; may be empty
  std::optional<double> aim;  ///< upper bound of the column "value"; none: it is only shown
};
/// Scores of a bench that measures methods beside aims: a line a measure, a column a method. What
/// misses its aim, or cannot be measured, is marked, and the last line counts the aims met.
/// Scenes (the first column of a line) that were not played are left out.
/// @param exact  what is below counts as 0
Scores aim_scores(const Table& table, const std::vector<AimLine>& lines, std::string note,
                  double exact = 0.0);

}  // namespace palpate::lab
