// SPDX-License-Identifier: BSD-3-Clause
#include "ves/sweep/sweep.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/file.h>
#include <tbb/parallel_for_each.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <mutex>
#include <span>
#include <stdexcept>

#include "row.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

/// Refuses a folder in which another sweep was begun; else leaves there what this one is.
void requireSame(const SweepPlan& plan, const SweepOptions& options, bool simulates_subsets) {
  Value first = loadDocument(options.scenario);
  for (const std::string& one : options.overrides) applyOverride(first, one);
  plan.put(plan.overrides(0), first);
  const std::string asked =
      options.figure ? fmt::format("towards {}\n", options.figure->question()) : std::string();
  const std::string text = plan.text() + (simulates_subsets ? asked : "") +
                           fmt::format("set {}\nscenario of run 0: {}\n",
                                       fmt::join(options.overrides, " "), fingerprint(emit(first)));
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
  const std::size_t columns = csvFields(header).size();
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
    if (!number || run < 0 || run >= runs || csvFields(row).size() != columns)
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

/// Of the rows from the first on, as far as there is one after the other.
class FigureWatch {
 public:
  static constexpr std::int64_t kEach = 50;  // [-] rows, after which it is looked at

  FigureWatch(const SweepOptions& options, const std::string& header)
      : figure_(options.figure), until_(options.until) {
    if (figure_) figure_->find(csvFields(header));
  }
  /// Enough rows: from this run on none is needed.
  bool enough(const std::map<std::int64_t, std::string>& rows) {
    constexpr std::int64_t kLeast = 100;  // [-] values that an interval is told of
    if (!figure_ || enough_) return enough_;
    for (auto row = rows.find(next_); row != rows.end() && row->first == next_; ++row) {
      figure_->add(csvFields(row->second));
      ++next_;
      if (!(until_ > 0.0) || next_ % kEach != 0) continue;
      const Figure::Estimate now = figure_->estimate();
      enough_ = now.of >= kLeast && now.half() <= until_;
      if (enough_) return true;
    }
    return false;
  }
  std::optional<Figure::Estimate> estimate() const {
    return figure_ ? std::optional(figure_->estimate()) : std::nullopt;
  }

 private:
  std::optional<Figure> figure_;
  double until_;
  std::int64_t next_ = 0;
  bool enough_ = false;
};

fs::path partOf(const SweepOptions& options, int rank) {
  if (options.ranks == 1) return options.file;
  return fmt::format("{}.rank{}", options.file.string(), rank);
}

/// Makes runs, as many at a time as there are workers, and appends their rows to the file.
class Runner {
 public:
  Runner(const SweepPlan& plan, const SweepOptions& options, const fs::path& file,
         std::map<std::int64_t, std::string>& rows,
         const std::function<void(const SweepProgress&)>& shown, const std::function<bool()>& stop)
      : plan_(plan),
        file_(file),
        scenario_(loadDocument(options.scenario)),
        out_(file, std::ios::binary | std::ios::app),
        rows_(rows),
        shown_(shown),
        stop_(stop),
        workers_(options.workers) {
    for (const std::string& one : options.overrides) applyOverride(scenario_, one);
    progress_.done = std::ssize(rows);
  }
  void make(std::span<const std::int64_t> runs, std::int64_t of) {
    progress_.of = of;
    workers_.execute([&] {
      tbb::parallel_for_each(runs.begin(), runs.end(), [&](std::int64_t run) {
        if (stop_()) return;
        const std::string row = rowOf(plan_, scenario_, run, shared_);
        const std::lock_guard lock_rows(writing_);
        out_ << row << '\n' << std::flush;
        if (!out_) throw InputError(file_.string() + ": cannot be written");
        rows_[run] = row;
        ++progress_.done;
        ++progress_.run_now;
        progress_.elapsed = static_cast<double>(monotonicNow() - start_) * kSecondPerNanosecond;
        if (shown_) shown_(progress_);
      });
    });
  }

 private:
  const SweepPlan& plan_;
  const fs::path& file_;
  Value scenario_;
  std::ofstream out_;
  std::map<std::int64_t, std::string>& rows_;
  const std::function<void(const SweepProgress&)>& shown_;
  const std::function<bool()>& stop_;
  tbb::task_arena workers_;
  SharedByRuns shared_;
  std::mutex writing_;
  SweepProgress progress_;
  const std::int64_t start_ = monotonicNow();
};

/// Level after level, until it is done or stopped.
void simulateSubsets(SubsetSimulation& subset, const Figure& figure, Runner& runner,
                     const std::map<std::int64_t, std::string>& rows) {
  for (auto batch = subset.next(); batch.size > 0; batch = subset.next()) {
    const std::int64_t end = batch.first + batch.size;
    std::vector<std::int64_t> missing;
    for (std::int64_t run = batch.first; run < end; ++run)
      if (!rows.count(run)) missing.push_back(run);
    runner.make(missing, end);
    std::vector<double> beyond;
    for (std::int64_t run = batch.first; run < end; ++run) {
      const auto row = rows.find(run);
      if (row == rows.end()) return;
      beyond.push_back(figure.beyond(csvFields(row->second)));
    }
    if (std::all_of(beyond.begin(), beyond.end(), [](double x) { return std::isnan(x); }) &&
        batch.first == 0)
      throw InputError(fmt::format("--figure '{}': no run has a number there", figure.question()));
    try {
      subset.take(beyond);
    } catch (const std::domain_error& error) {
      throw InputError(fmt::format("--figure: {}; it takes too few values", error.what()));
    }
  }
}

}  // namespace

void requireFigure(const SweepPlan& plan, const SweepOptions& options) {
  for (const std::string_view words : kWords)
    if (options.figure && options.figure->column() == words)
      throw InputError(fmt::format("--figure: '{}' has words, want a column of numbers", words));
  if (auto figure = options.figure) figure->find(csvFields(headerOf(plan)));
  if (!plan.subset()) return;
  if (!options.figure || !options.figure->counts())
    throw InputError("--design subset: want --figure 'COLUMN>LIMIT', or <");
  if (options.ranks > 1)
    throw InputError("--design subset: one level after the other, want one process");
}

SweepResult sweep(SweepPlan& plan, const SweepOptions& options,
                  const std::function<void(const SweepProgress&)>& shown,
                  const std::function<bool()>& stop) {
  requireFigure(plan, options);
  SubsetSimulation* const subset = plan.subset();
  const std::int64_t runs = plan.size();
  const std::string header = headerOf(plan);
  FigureWatch watch(options, header);
  const fs::path part = partOf(options, options.rank);
  // Two of them in one file would run everything twice.
  const int lock = open((part.string() + ".lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  if (lock < 0) throw InputError(fmt::format("{}: {}", part.string(), std::strerror(errno)));
  if (flock(lock, LOCK_EX | LOCK_NB) != 0)
    throw InputError(fmt::format("{}: another sweep is writing here", part.string()));
  requireSame(plan, options, subset != nullptr);
  std::map<std::int64_t, std::string> rows = readRows(part, header, runs);
  writeRows(part, header, rows);
  Runner runner(plan, options, part, rows, shown, stop);
  if (subset) {
    Figure figure = *options.figure;
    figure.find(csvFields(header));
    simulateSubsets(*subset, figure, runner, rows);
  } else {
    std::vector<std::int64_t> missing;
    std::int64_t of = 0;
    for (std::int64_t run = options.rank; run < runs; run += options.ranks) {
      ++of;
      if (!rows.count(run)) missing.push_back(run);
    }
    const std::size_t each = options.until > 0.0 ? FigureWatch::kEach : missing.size();
    for (std::span<const std::int64_t> left = missing;
         !left.empty() && !watch.enough(rows) && !stop();) {
      const std::size_t now = std::min(each, left.size());
      runner.make(left.first(now), of);
      left = left.subspan(now);
    }
  }

  // In order, and of all ranks when the others are done too.
  rows = readRows(part, header, runs);
  const bool enough = watch.enough(rows);
  writeRows(part, header, rows);
  if (options.ranks > 1) {
    rows.clear();
    for (int rank = 0; rank < options.ranks; ++rank)
      rows.merge(readRows(partOf(options, rank), header, runs));
    if (std::ssize(rows) == runs) writeRows(options.file, header, rows);
  }
  SweepResult result;
  result.rows = std::ssize(rows);
  result.complete = subset ? subset->next().size == 0 : enough || result.rows == runs;
  if (options.ranks > 1 && result.complete) watch.enough(rows);
  result.figure = watch.estimate();
  if (subset) result.levels = subset->estimate().levels;
  if (result.levels > 1) {  // of one level it is a share as any other
    const SubsetSimulation::Estimate& e = subset->estimate();
    result.figure->value = e.probability;
    result.figure->low = e.low;
    result.figure->high = e.high;
  }
  for (const auto& [run, row] : rows) result.not_good += !good(row);
  close(lock);
  if (options.ranks == 1 || result.complete) unlink((part.string() + ".lock").c_str());
  return result;
}

}  // namespace ves
