// SPDX-License-Identifier: BSD-3-Clause
#include "ves/results/results.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "ves/core/build.hpp"
#include "ves/core/lines.hpp"
#include "ves/evaluation/contact_pairs.hpp"
#include "ves/evaluation/identified.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/evaluation/tool_motion.hpp"
#include "ves/pictures/plots.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {

std::filesystem::path makeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error || !std::filesystem::is_directory(folder, error))
    throw InputError(fmt::format("--out {}: cannot be a folder: {}", folder.string(),
                                 error ? error.message() : "something else is there"));
  return std::filesystem::absolute(folder);
}

std::filesystem::path claimFolder(const std::filesystem::path& folder) {
  const std::filesystem::path made = makeFolder(folder);
  const int fd = open(made.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);  // kept to the end
  if (fd < 0) throw InputError(fmt::format("--out {}: {}", folder.string(), strerror(errno)));
  if (flock(fd, LOCK_EX | LOCK_NB) == 0) return made;
  close(fd);
  throw InputError(fmt::format("--out {}: another run is writing there", folder.string()));
}

std::filesystem::path claimNewFolder(const std::filesystem::path& folder) {
  makeFolder(folder.parent_path());
  for (int n = 1;; ++n) {
    const std::filesystem::path named =
        n == 1 ? folder : std::filesystem::path(fmt::format("{}-{}", folder.string(), n));
    std::error_code error;
    if (std::filesystem::create_directory(named, error)) return claimFolder(named);
    if (error) throw InputError(fmt::format("{}: {}", named.string(), error.message()));
  }
}

std::string writeResults(const std::filesystem::path& folder, const RunResult& result, bool plots) {
  const Series series = readSeries((folder / "run.lcmlog").string());
  ReferenceMotions references;
  const std::optional<Emulation> e = emulation(series, references);
  const std::optional<ToolMotion> tool = toolMotion(series, e);
  std::vector<Column> more;
  if (e) more = columnsOf(series, *e);
  if (tool)
    for (const Column& column : columnsOf(*tool)) more.push_back(column);
  writeCsv(series, more, (folder / "series.csv").string());
  const auto summary = summarise(series, result, references);
  writeSummary(summary, (folder / "summary.json").string());
  std::string out = table(summary) + "\n";
  for (const std::string& line : series.damage.lines()) out += fmt::format("  {}\n", line);
  std::string files = "experiment.yaml, run.lcmlog, series.csv, summary.json";
  if (series.experiment.plant.task.world) {
    writeContacts(contactPairs(series, e), (folder / "contacts.csv").string());
    files += ", contacts.csv";
  }
  if (const auto masses = learntMasses(series)) {
    std::ofstream(folder / "masses.yaml") << write(
        *masses, "Masses that a run of " + series.experiment.name + " has learnt. For --masses.");
    files += ", masses.yaml";
  }
  if (plots)
    for (const std::filesystem::path& plot : drawPlots(series, e, tool, folder))
      files += ", " + plot.filename().string();
  const std::filesystem::path here = folder.lexically_relative(std::filesystem::current_path());
  const bool below = !here.empty() && *here.begin() != "..";
  const std::string shown = (below ? here : folder).string();
  constexpr std::size_t kColumns = 80, kBehindNames = 11;
  return folded(out + fmt::format("  {}\n    {}\n", shown, files), kColumns, kBehindNames) +
         fmt::format("  see it: {} view {}\n", frontDoor(), shown);
}

void Progress::show(Phase phase, int segment, std::int64_t tick, const double (&x)[6]) {
  constexpr std::int64_t kRefresh = 100'000'000;  // [ns]
  const std::int64_t now = monotonicNow();
  const bool changed = phase != phase_ || segment != segment_;
  const bool terminal = isatty(STDERR_FILENO);
  if (!changed && (!terminal || now - shown_at_ < kRefresh)) return;
  if (changed && open_) end();
  shown_at_ = now;
  phase_ = phase;
  segment_ = segment;
  std::string what(name(phase));
  if (phase == Phase::kRunning && segment >= 0 && segment < experiment_.controller.program.size)
    what = fmt::format(
        "{} ({} of {})",
        name(experiment_.controller.program.segments[static_cast<std::size_t>(segment)].kind),
        segment + 1, experiment_.controller.program.size);
  const double t = static_cast<double>(tick * experiment_.controller.period) * kSecondPerNanosecond;
  // Not fmt::print: it throws when nobody reads, and that must not end a run.
  const std::string line =
      fmt::format("{}{:7.2f} s {:<21}{:+6.1f}{:+7.1f}{:+7.1f} mm{:+7.2f}{:+7.2f}{:+7.2f} deg{}",
                  terminal ? "\r" : "", t, what, x[0] * 1e3, x[1] * 1e3, x[2] * 1e3, x[3] / kDegree,
                  x[4] / kDegree, x[5] / kDegree, terminal ? "" : "\n");
  if (!headed_)
    std::fputs(fmt::format("{:>9} {:<21}{:>6}{:>7}{:>7}{:>10}{:>7}{:>7}\n", "", "", "x", "y", "z",
                           "alpha", "beta", "gamma")
                   .c_str(),
               stderr);
  headed_ = true;
  std::fputs(line.c_str(), stderr);
  open_ = terminal;
}

void Progress::end() {
  if (open_) std::fputs("\n", stderr);
  open_ = false;
}

}  // namespace ves
