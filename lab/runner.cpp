// SPDX-License-Identifier: Apache-2.0
#include "lab/runner.hpp"

#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <thread>

#include "palpate/kernel/core/error.hpp"

namespace palpate::lab {
namespace {

namespace fs = std::filesystem;

// Identifies a run by its options: resuming under other options would mix two runs.
std::string fingerprint(const Experiment& experiment, const ExperimentOptions& options) {
  std::ostringstream text;
  text << "palpate experiment " << experiment.name << " seed " << options.seed << " noise "
       << static_cast<int>(options.noise);
  if (options.grid) text << " grid " << options.grid->first << 'x' << options.grid->second;
  if (!options.recording.empty()) text << " recording " << options.recording;
  for (const std::string& name : methods_of(experiment, options)) text << ' ' << name;
  if (options.cases) text << " cases " << *options.cases;
  for (const std::string& name : options.families) text << ' ' << name;
  for (const std::string& value : options.fixed) text << ' ' << value;
  text << ' ' << options.case_text;
  text.precision(17);
  for (const ParameterInfo& row : parameter_table()) text << ' ' << row.get(options.parameters);
  return text.str();
}

// The finished cells of a run, in memory and in FILE.part: a line with the fingerprint, then for
// each cell a line `INDEX BYTES` and its rows.
class FinishedCells {
 public:
  FinishedCells(const fs::path& file, const std::string& print, bool resume) : path_(file) {
    path_ += ".part";
    if (resume) load(print);
    out_.open(path_, std::ios::binary | std::ios::trunc);
    out_ << print << '\n';
    for (const auto& [index, rows] : rows_) append(index, rows);
    check();
  }

  [[nodiscard]] bool has(std::size_t index) const { return rows_.count(index) != 0; }
  [[nodiscard]] std::size_t count() const { return rows_.size(); }

  void add(std::size_t index, const std::string& rows) {
    append(index, rows);
    check();
    rows_[index] = rows;
  }

  [[nodiscard]] std::string rows() const {
    std::string text;
    for (const auto& [index, rows] : rows_) text += rows;
    return text;
  }

  void remove() {
    out_.close();
    fs::remove(path_);
  }

 private:
  void load(const std::string& print) {
    std::ifstream in(path_, std::ios::binary);
    if (!in) return;  // nothing was begun: start
    std::string line;
    std::getline(in, line);
    if (line != print)
      throw Error(path_.string(), "it was left by a run with other options",
                  "use the same options, or run without --resume");
    while (std::getline(in, line)) {
      std::istringstream head(line);
      std::size_t index = 0;
      std::size_t bytes = 0;
      if (!(head >> index >> bytes) || bytes > (1U << 30U)) return;
      std::string rows(bytes, '\0');
      if (!in.read(rows.data(), static_cast<std::streamsize>(bytes))) return;  // cut off: run again
      rows_[index] = std::move(rows);
    }
  }

  void append(std::size_t index, const std::string& rows) {
    out_ << index << ' ' << rows.size() << '\n' << rows << std::flush;
  }

  void check() const {
    if (!out_)
      throw Error(path_.string(), std::string("cannot be written: ") + std::strerror(errno),
                  "use a folder with write permission and free disk space");
  }

  fs::path path_;
  std::ofstream out_;
  std::map<std::size_t, std::string> rows_;
};

// Hands out cells and takes their results, from several threads.
class Desk {
 public:
  Desk(const std::vector<Cell>& cells, FinishedCells& finished, const RunnerOptions& runner)
      : cells_(cells), finished_(finished), runner_(runner) {}

  // The next cell to run; none: all are handed out, or one has failed.
  std::optional<std::size_t> next() {
    const std::lock_guard lock(mutex_);
    while (next_ < cells_.size() && finished_.has(next_)) ++next_;
    if (failure_ || next_ == cells_.size()) return std::nullopt;
    return next_++;
  }

  void put(std::size_t index, const std::string& rows) {
    const std::lock_guard lock(mutex_);
    finished_.add(index, rows);
    if (runner_.progress) runner_.progress(finished_.count(), cells_.size());
  }

  // Runs cells until there are none left.
  void work() {
    try {
      while (const auto index = next()) put(*index, cells_[*index]());
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!failure_) failure_ = std::current_exception();
    }
  }

  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  const std::vector<Cell>& cells_;
  FinishedCells& finished_;
  const RunnerOptions& runner_;
  std::mutex mutex_;
  std::size_t next_ = 0;
  std::exception_ptr failure_;
};

}  // namespace

std::string run_cells(const std::vector<Cell>& cells, const std::string& print,
                      const RunnerOptions& runner, const std::filesystem::path& file) {
  FinishedCells finished(file, print, runner.resume);
  Desk desk(cells, finished, runner);
  std::vector<std::thread> threads;
  for (int i = 0; i < runner.jobs; ++i) threads.emplace_back([&desk] { desk.work(); });
  for (std::thread& thread : threads) thread.join();
  desk.rethrow();
  std::string rows = finished.rows();
  finished.remove();
  return rows;
}

std::string run_experiment(const Experiment& experiment, const ExperimentOptions& options,
                           const RunnerOptions& runner, const std::filesystem::path& file) {
  const std::string rows = run_cells(experiment.cells(experiment, options),
                                     fingerprint(experiment, options), runner, file);
  std::string csv = std::string(experiment.header) + '\n' + rows;
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << csv << std::flush;
  if (!out)
    throw Error(file.string(), std::string("cannot be written: ") + std::strerror(errno),
                "use a folder with write permission and free disk space");
  return csv;
}

}  // namespace palpate::lab
