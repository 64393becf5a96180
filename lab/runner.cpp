// SPDX-License-Identifier: Apache-2.0
#include "lab/runner.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <thread>

#include "lab/table.hpp"
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

}  // namespace

int threads_of(int jobs) {
  if (jobs < 0 || jobs > 1024)
    throw Error("--jobs " + std::to_string(jobs), "the number of threads is out of range",
                "use 1 to 1024, or 0 for one per core");
  return jobs > 0 ? jobs : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

std::string run_cells(const std::vector<Cell>& cells, const std::string& print,
                      const RunnerOptions& runner, const std::filesystem::path& file) {
  FinishedCells finished(file, print, runner.resume);
  std::mutex mutex;
  std::size_t next = 0;        // guarded by mutex, as `finished` is
  std::exception_ptr failure;  // likewise: then nothing more is begun
  const auto next_cell = [&]() -> std::optional<std::size_t> {
    const std::lock_guard lock(mutex);
    while (next < cells.size() && finished.has(next)) ++next;
    if (failure || next == cells.size()) return std::nullopt;
    return next++;
  };
  const auto work = [&] {
    try {
      while (const auto index = next_cell()) {
        const std::string rows = cells[*index]();
        const std::lock_guard lock(mutex);
        finished.add(*index, rows);
        if (runner.progress) runner.progress(finished.count(), cells.size());
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  std::vector<std::thread> threads;
  for (int i = 0; i < runner.jobs; ++i) threads.emplace_back(work);
  for (std::thread& thread : threads) thread.join();
  if (failure) std::rethrow_exception(failure);
  std::string rows = finished.rows();
  finished.remove();
  return rows;
}

std::string run_experiment(const Experiment& experiment, const ExperimentOptions& options,
                           const RunnerOptions& runner, const std::filesystem::path& file) {
  const std::string rows = run_cells(experiment.cells(experiment, options),
                                     fingerprint(experiment, options), runner, file);
  std::string csv = std::string(experiment.header) + '\n' + rows;
  write_file(file, csv);
  return csv;
}

}  // namespace palpate::lab
