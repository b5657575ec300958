// SPDX-License-Identifier: BSD-3-Clause
#include "ves/sweep/sweep.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>

#include "ves/realtime/realtime.hpp"
#include "ves/results/summary.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

/// Numbers of a run's summary that make columns.
constexpr const char* kNumbers[] = {"simulated_s",
                                    "emulation_travel_m",
                                    "emulation_error_rms_m",
                                    "emulation_error_max_m",
                                    "emulation_error_rms_rad",
                                    "x_peak_to_peak_m",
                                    "x_error_max_m",
                                    "x_error_rms_m",
                                    "y_peak_to_peak_m",
                                    "y_error_max_m",
                                    "y_error_rms_m",
                                    "z_peak_to_peak_m",
                                    "z_error_max_m",
                                    "z_error_rms_m",
                                    "alpha_peak_to_peak_rad",
                                    "alpha_error_max_rad",
                                    "alpha_error_rms_rad",
                                    "beta_peak_to_peak_rad",
                                    "beta_error_max_rad",
                                    "beta_error_rms_rad",
                                    "gamma_peak_to_peak_rad",
                                    "gamma_error_max_rad",
                                    "gamma_error_rms_rad",
                                    "dynamic_force_max_still_n",
                                    "dynamic_moment_max_still_nm",
                                    "dynamic_force_max_moving_n",
                                    "dynamic_moment_max_moving_nm",
                                    "tracking_delay_s",
                                    "tracking_rms",
                                    "energy_put_in_max_j",
                                    "contacts",
                                    "contacts_free_space",
                                    "contact_peak_n",
                                    "contact_peak_free_space_n",
                                    "contact_restitution",
                                    "contact_restitution_free_space",
                                    "contact_energy_error"};

/// A cell of CSV.
std::string cell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c == '\n' ? ' ' : c);
  return out + "\"";
}

/// How many cells a line of CSV has.
std::ptrdiff_t cells(const std::string& line) {
  bool inside = false;
  return 1 + std::count_if(line.begin(), line.end(), [&](char c) {
           if (c == '"') inside = !inside;
           return c == ',' && !inside;
         });
}

std::string headerOf(const SweepPlan& plan) {
  std::string line = "run";
  for (const std::string& key : plan.keys()) line += fmt::format(",{}", cell(key));
  line += ",ended,first_cause,first_cause_tick";
  for (const char* number : kNumbers) line += fmt::format(",{}", number);
  return line;
}

/// One run, as its row.
std::string rowOf(const SweepPlan& plan, const Value& scenario, std::int64_t run,
                  ReferenceMotions& references) {
  std::vector<std::string> all;
  std::string row = fmt::format("{}", run);
  for (const std::string& one : plan.overrides(run)) {
    all.push_back(one);
    row += fmt::format(",{}", cell(one.substr(one.find('=') + 1)));
  }
  const std::string rest = std::string(std::size(kNumbers), ',');
  try {
    Experiment e = buildExperiment(scenario, all);
    const std::string diverges =
        wantsAdmittance(e.controller.program) ? applyStabilityCheck(e) : std::string();
    if (e.controller.stability == Stability::kUnstable)
      return row + ",refused," + cell(diverges) + "," + rest;
    const RecordedRun recorded = recordLockstep(e);
    const RunResult& result = recorded.result;
    const auto summary = summarise(recorded.series, result, references);
    row += fmt::format(",{},{},{}", result.aborted ? "aborted" : name(result.phase),
                       name(result.cause), result.cause_tick);
    for (const char* number : kNumbers)
      row += summary.contains(number) ? fmt::format(",{}", summary[number].get<double>()) : ",";
    return row;
  } catch (const InputError& error) {
    return row + ",invalid," + cell(error.what()) + "," + rest;
  }
}

/// Workers that take the next run from a counter they share, and send rows through one pipe.
class Workers {
 public:
  Workers(const SweepPlan& plan, const Value& scenario, int workers,
          const std::vector<std::int64_t>& missing, int lock)
      : next_(static_cast<std::atomic<std::size_t>*>(mmap(nullptr, sizeof(std::atomic<std::size_t>),
                                                          PROT_READ | PROT_WRITE,
                                                          MAP_SHARED | MAP_ANONYMOUS, -1, 0))) {
    if (next_ == MAP_FAILED || pipe2(pipe_, O_CLOEXEC) != 0)
      throw InputError(fmt::format("--workers: {}", std::strerror(errno)));
    new (next_) std::atomic<std::size_t>(0);
    for (int w = 0; w < workers; ++w) {
      const pid_t parent = getpid(), child = fork();
      if (child < 0) throw InputError(fmt::format("--workers: {}", std::strerror(errno)));
      if (child == 0) {
        // Ours alone: a child that outlives us must neither hold the lock nor a pipe open.
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        close(lock);
        close(pipe_[0]);
        work(plan, scenario, missing, parent);
      }
      children_.push_back(child);
    }
    close(pipe_[1]);
    pipe_[1] = -1;
  }
  ~Workers() {
    next_->store(SIZE_MAX / 2);  // no more
    if (pipe_[0] >= 0) close(pipe_[0]);
    for (const pid_t child : children_) waitpid(child, nullptr, 0);
    munmap(next_, sizeof *next_);
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// The next row; empty when there are no more.
  std::string row() {
    for (;;) {
      const std::size_t end = buffer_.find('\n');
      if (end != std::string::npos) {
        std::string line = buffer_.substr(0, end);
        buffer_.erase(0, end + 1);
        return line;
      }
      char block[4096];
      const ssize_t n = ::read(pipe_[0], block, sizeof block);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return {};
      buffer_.append(block, static_cast<std::size_t>(n));
    }
  }

 private:
  [[noreturn]] void work(const SweepPlan& plan, const Value& scenario,
                         const std::vector<std::int64_t>& missing, pid_t parent) {
    ::signal(SIGINT, SIG_IGN);  // the parent ends it, between two runs
    ::signal(SIGTERM, SIG_IGN);
    ::signal(SIGPIPE, SIG_IGN);
    ReferenceMotions references;
    try {
      for (std::size_t at; (at = next_->fetch_add(1)) < missing.size() && getppid() == parent;) {
        const std::string line = rowOf(plan, scenario, missing[at], references) + "\n";
        for (std::size_t sent = 0; sent < line.size();) {
          const ssize_t n = ::write(pipe_[1], line.data() + sent, line.size() - sent);
          if (n <= 0) _exit(1);  // nobody listens
          sent += static_cast<std::size_t>(n);
        }
      }
    } catch (const std::exception& error) {
      fmt::print(stderr, "ves sweep: a worker ended: {}\n", error.what());
    }
    _exit(0);
  }

  std::atomic<std::size_t>* next_;
  int pipe_[2] = {-1, -1};
  std::vector<pid_t> children_;
  std::string buffer_;
};

/// Refuses a folder in which another sweep was begun; else leaves there what this one is.
void requireSame(const SweepPlan& plan, const SweepOptions& options) {
  std::vector<std::string> all = options.overrides;
  for (const std::string& one : plan.overrides(0)) all.push_back(one);
  const std::string text =
      plan.text() + fmt::format("set {}\nconfiguration of run 0: {}\n",
                                fmt::join(options.overrides, " "),
                                loadExperiment(options.scenario, all).source.hash);
  const fs::path file = options.file.string() + ".plan";
  if (std::ifstream in(file, std::ios::binary); in) {
    const std::string there((std::istreambuf_iterator<char>(in)), {});
    // Another rank may be writing it.
    if (there.size() >= text.size() ? there != text : text.compare(0, there.size(), there) != 0)
      throw InputError(
          fmt::format("{}: another sweep was begun here; --out another folder", file.string()));
  }
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.flush();
  if (!out) throw InputError(file.string() + ": cannot be written");
}

/// Rows of a file by their run; a last line that a kill cut short is left out.
std::map<std::int64_t, std::string> readRows(const fs::path& file, const std::string& header,
                                             std::int64_t runs) {
  std::map<std::int64_t, std::string> rows;
  std::ifstream in(file, std::ios::binary);
  if (!in) return rows;
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  std::size_t at = 0;
  for (int line = 1; at < text.size(); ++line) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string::npos) break;
    const std::string row = text.substr(at, end - at);
    at = end + 1;
    if (line == 1) {
      if (row != header)
        throw InputError(fmt::format(
            "{}:1: has other columns than this sweep; --out another folder", file.string()));
      continue;
    }
    std::int64_t run = -1;
    const auto [stop, error] = std::from_chars(row.data(), row.data() + row.size(), run);
    const bool number = error == std::errc() && stop != row.data() + row.size() && *stop == ',';
    if (!number || run < 0 || run >= runs || cells(row) != cells(header))
      throw InputError(fmt::format("{}:{}: no row of this sweep of {} runs; --out another folder",
                                   file.string(), line, runs));
    rows[run] = row;
  }
  return rows;
}

void writeRows(const fs::path& file, const std::string& header,
               const std::map<std::int64_t, std::string>& rows) {
  const fs::path beside = fmt::format("{}.{}.new", file.string(), getpid());
  {
    std::ofstream out(beside, std::ios::binary);
    out << header << '\n';
    for (const auto& [run, row] : rows) out << row << '\n';
    out.flush();
    if (!out) throw InputError(beside.string() + ": cannot be written");
  }
  fs::rename(beside, file);
}

bool good(const std::string& row) { return row.find(",parked,none,") != std::string::npos; }

fs::path partOf(const SweepOptions& options, int rank) {
  if (options.ranks == 1) return options.file;
  return fmt::format("{}.rank{}", options.file.string(), rank);
}

}  // namespace

SweepResult sweep(const SweepPlan& plan, const SweepOptions& options,
                  const std::function<void(const SweepProgress&)>& shown,
                  const std::function<bool()>& stop) {
  const std::int64_t runs = plan.size();
  const std::string header = headerOf(plan);
  const fs::path part = partOf(options, options.rank);
  // Two of them in one file would run everything twice.
  const int lock = open((part.string() + ".lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  if (lock < 0) throw InputError(fmt::format("{}: {}", part.string(), std::strerror(errno)));
  if (flock(lock, LOCK_EX | LOCK_NB) != 0)
    throw InputError(fmt::format("{}: another sweep is writing here", part.string()));
  requireSame(plan, options);
  std::map<std::int64_t, std::string> rows = readRows(part, header, runs);

  std::vector<std::int64_t> missing;
  SweepProgress progress;
  for (std::int64_t run = options.rank; run < runs; run += options.ranks) {
    ++progress.of;
    if (!rows.count(run)) missing.push_back(run);
  }
  progress.done = progress.of - static_cast<std::int64_t>(missing.size());
  writeRows(part, header, rows);
  const std::int64_t start = monotonicNow();
  if (!missing.empty()) {
    std::ofstream out(part, std::ios::binary | std::ios::app);
    Value scenario = loadDocument(options.scenario);
    for (const std::string& one : options.overrides) applyOverride(scenario, one);
    Workers workers(plan, scenario, options.workers, missing, lock);
    while (!stop()) {
      const std::string row = workers.row();
      if (row.empty()) {
        if (progress.done < progress.of)
          throw InputError("--workers: they ended before their work did");
        break;
      }
      out << row << '\n' << std::flush;
      if (!out) throw InputError(part.string() + ": cannot be written");
      ++progress.done;
      ++progress.run_now;
      progress.elapsed = static_cast<double>(monotonicNow() - start) * kSecondPerNanosecond;
      if (shown) shown(progress);
    }
  }

  // In order, and of all ranks when the others are done too.
  rows = readRows(part, header, runs);
  writeRows(part, header, rows);
  if (options.ranks > 1) {
    rows.clear();
    for (int rank = 0; rank < options.ranks; ++rank)
      rows.merge(readRows(partOf(options, rank), header, runs));
    if (std::ssize(rows) == runs) writeRows(options.file, header, rows);
  }
  SweepResult result;
  result.rows = std::ssize(rows);
  result.complete = result.rows == runs;
  for (const auto& [run, row] : rows) result.not_good += !good(row);
  close(lock);
  if (options.ranks == 1 || result.complete) unlink((part.string() + ".lock").c_str());
  return result;
}

}  // namespace ves
