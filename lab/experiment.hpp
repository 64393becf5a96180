// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
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

/// Scores of a bench that measures methods beside aims, which are upper bounds: a row a measure, a
/// column a method. What misses its aim is marked, and the last row counts the aims met.
class AimTable {
 public:
  /// @param labels  names of the columns before that of the aim
  AimTable(std::vector<std::string> labels, std::vector<std::string> methods);

  [[nodiscard]] const std::vector<std::string>& methods() const { return methods_; }
  /// A row. @param labels  one a column before the aim's
  /// @param values  one a method; none where there is nothing to measure, which misses any aim
  void add(std::vector<std::string> labels, std::optional<double> aim,
           const std::vector<std::optional<double>>& values);
  [[nodiscard]] Scores scores(std::string note) const;

 private:
  std::vector<std::string> methods_;
  Scores scores_;
  std::vector<int> met_;  // aims, by each method
  int aims_ = 0;
};

/// A measure as the table names it. @param unit  empty where it has none
std::string measure_text(std::string_view name, std::string_view unit);

}  // namespace palpate::lab
