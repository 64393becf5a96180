// SPDX-License-Identifier: Apache-2.0
#include "lab/runner.hpp"

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <sstream>
#include <thread>

#include "palpate/kernel/core/error.hpp"

#ifdef PALPATE_MPI
// The C++ bindings that some MPIs still have don't compile without warnings.
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#include <mpi.h>
#endif

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

#ifdef PALPATE_MPI
constexpr int result_tag = 1;
constexpr int order_tag = 2;

// A message from a worker: the cell's number as eight bytes, then its rows. Number -1: none yet.
void serve_workers(Desk& desk) {
  int working = Ranks::size() - 1;
  while (working > 0) {
    int waiting = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, result_tag, MPI_COMM_WORLD, &waiting, &status);
    if (waiting == 0) {
      // MPI's own waiting would take a core from the cells.
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      continue;
    }
    int bytes = 0;
    MPI_Get_count(&status, MPI_CHAR, &bytes);
    std::string message(static_cast<std::size_t>(bytes), '\0');
    MPI_Recv(message.data(), bytes, MPI_CHAR, status.MPI_SOURCE, result_tag, MPI_COMM_WORLD,
             MPI_STATUS_IGNORE);
    std::int64_t index = -1;
    std::memcpy(&index, message.data(), sizeof index);
    if (index >= 0) desk.put(static_cast<std::size_t>(index), message.substr(sizeof index));
    const auto next = desk.next();
    std::int64_t order = next ? static_cast<std::int64_t>(*next) : -1;
    if (!next) --working;
    MPI_Send(&order, 1, MPI_INT64_T, status.MPI_SOURCE, order_tag, MPI_COMM_WORLD);
  }
}

void work_for_rank_0(const std::vector<Cell>& cells) {
  std::int64_t index = -1;
  std::string rows;
  for (;;) {
    std::string message(sizeof index, '\0');
    std::memcpy(message.data(), &index, sizeof index);
    message += rows;
    MPI_Send(message.data(), static_cast<int>(message.size()), MPI_CHAR, 0, result_tag,
             MPI_COMM_WORLD);
    MPI_Recv(&index, 1, MPI_INT64_T, 0, order_tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    if (index < 0) return;
    rows = cells[static_cast<std::size_t>(index)]();
  }
}
#endif

}  // namespace

std::string run_cells(const std::vector<Cell>& cells, const std::string& print,
                      const RunnerOptions& runner, const std::filesystem::path& file) {
#ifdef PALPATE_MPI
  if (Ranks::rank() != 0) {
    work_for_rank_0(cells);
    return {};
  }
#endif
  FinishedCells finished(file, print, runner.resume);
  Desk desk(cells, finished, runner);
  std::vector<std::thread> threads;
  for (int i = 0; i < runner.jobs; ++i) threads.emplace_back([&desk] { desk.work(); });
#ifdef PALPATE_MPI
  std::exception_ptr failure;
  try {
    serve_workers(desk);
  } catch (...) {
    failure = std::current_exception();
  }
#endif
  for (std::thread& thread : threads) thread.join();
#ifdef PALPATE_MPI
  if (failure) std::rethrow_exception(failure);
#endif
  desk.rethrow();
  std::string rows = finished.rows();
  finished.remove();
  return rows;
}

std::string run_experiment(const Experiment& experiment, const ExperimentOptions& options,
                           const RunnerOptions& runner, const std::filesystem::path& file) {
  const std::string rows = run_cells(experiment.cells(experiment, options),
                                     fingerprint(experiment, options), runner, file);
  if (Ranks::rank() != 0) return {};
  std::string csv = std::string(experiment.header) + '\n' + rows;
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out << csv << std::flush;
  if (!out)
    throw Error(file.string(), std::string("cannot be written: ") + std::strerror(errno),
                "use a folder with write permission and free disk space");
  return csv;
}

#ifdef PALPATE_MPI
Ranks::Ranks(int* argc, char*** argv) {
  // Started without mpirun there is one rank; MPI stays out of it.
  if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr && std::getenv("PMI_SIZE") == nullptr) return;
  int provided = 0;
  MPI_Init_thread(argc, argv, MPI_THREAD_FUNNELED, &provided);
}

Ranks::~Ranks() {
  int initialised = 0;
  MPI_Initialized(&initialised);
  if (initialised != 0) MPI_Finalize();
}

int Ranks::rank() {
  int initialised = 0;
  MPI_Initialized(&initialised);
  int rank = 0;
  if (initialised != 0) MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  return rank;
}

int Ranks::size() {
  int initialised = 0;
  MPI_Initialized(&initialised);
  int size = 1;
  if (initialised != 0) MPI_Comm_size(MPI_COMM_WORLD, &size);
  return size;
}

std::uint64_t Ranks::of_rank_0(std::uint64_t value) {
  if (size() > 1) MPI_Bcast(&value, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
  return value;
}

double Ranks::sum(double value) {
  double total = value;
  if (size() > 1) MPI_Reduce(&value, &total, 1, MPI_DOUBLE, MPI_SUM, 0, MPI_COMM_WORLD);
  return total;
}
#else
Ranks::Ranks(int* /*argc*/, char*** /*argv*/) {}
Ranks::~Ranks() = default;
int Ranks::rank() {
  return 0;
}
int Ranks::size() {
  return 1;
}
std::uint64_t Ranks::of_rank_0(std::uint64_t value) {
  return value;
}
double Ranks::sum(double value) {
  return value;
}
#endif

}  // namespace palpate::lab
