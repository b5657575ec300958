// SPDX-License-Identifier: BSD-3-Clause
//
// ves report: chapter 4 of the report once more, as a page and as numbers.
#include <fmt/format.h>
#include <unistd.h>

#include "commands.hpp"
#include "runner.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/validation/chapter4.hpp"

namespace ves::app {

int reportCommand(int argc, char** argv) {
  CLI::App cli(
      "Runs every scenario of the report's chapter 4 in lockstep and leaves report.html, one page "
      "that needs nothing beside it, and summary.json. The same bytes for any number of workers.",
      "ves report");
  std::string out = "ves-runs/report";
  cli.add_option("--out", out, "folder for the results")->capture_default_str();
  int workers = allCores();
  addWorkers(cli, workers, "threads");
  return run(cli, argc, argv, [&] {
    const std::filesystem::path folder = claimFolder(out);
    const bool terminal = isatty(STDERR_FILENO);
    const std::int64_t start = monotonicNow();
    const Chapter4 chapter = reproduceChapter4(
        configFolder(), folder, workers, [&](const std::string& what, int run, int done, int of) {
          fmt::print(stderr, "{}{:2} of {} parts, run {:3}  {:<32}{}", terminal ? "\r" : "", done,
                     of, run, what, terminal ? "" : "\n");
        });
    if (terminal) fmt::print(stderr, "\r{:70}\r", "");
    writeFile(folder / "report.html", chapter.html);
    writeSummary(chapter.summary, (folder / "summary.json").string());
    for (const auto& claim : chapter.summary["claims"])
      fmt::print("{:<28} {:<17} {}\n", claim["where"].get<std::string>(),
                 claim["verdict"].get<std::string>(), claim["reached"].get<std::string>());
    fmt::print("\n{:.0f} s; {}\n",
               static_cast<double>(monotonicNow() - start) * kSecondPerNanosecond,
               (folder / "report.html").string());
    return kDone;
  });
}

}  // namespace ves::app
