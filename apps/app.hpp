// SPDX-License-Identifier: BSD-3-Clause
//
// What the commands share: their options, Ctrl-C, and the three exit statuses.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "help.hpp"
#include "outputs.hpp"
#include "ves/analysis/leaning.hpp"
#include "ves/config/experiment.hpp"
#include "ves/core/build.hpp"
#include "ves/core/spelling.hpp"
#include "ves/evaluation/evidence.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"

namespace ves::app {

inline constexpr int kDone = 0;     // the run went well
inline constexpr int kTripped = 1;  // a check stopped it, or a comparison failed
inline constexpr int kBadInput = 2;

inline volatile std::sig_atomic_t stop_requested = 0;

/// A number in [lo, hi]; CLI11's own range lets NaN through.
inline CLI::Validator inRange(double lo, double hi) {
  return {[lo, hi](std::string& text) {
            double x = NAN;
            const bool number = CLI::detail::lexical_cast(text, x);
            return number && x >= lo && x <= hi
                       ? std::string()
                       : fmt::format("'{}', want a number in [{}, {}]", text, lo, hi);
          },
          fmt::format("in [{}, {}]", lo, hi)};
}

inline CLI::Validator aboveZero() {
  return {[](std::string& text) {
            double x = NAN;
            const bool number = CLI::detail::lexical_cast(text, x);
            return number && x > 0.0 ? std::string()
                                     : fmt::format("'{}', want a number above 0", text);
          },
          "above 0"};
}

/// A file that is written is called what it is.
inline CLI::Validator endsWith(std::vector<std::string> endings) {
  return {[endings](std::string& file) {
            const std::string ending = std::filesystem::path(file).extension().string();
            const bool is = std::find(endings.begin(), endings.end(), ending) != endings.end();
            return is ? std::string()
                      : fmt::format("'{}', want a name that ends in {}", file,
                                    fmt::join(endings, ", "));
          },
          ""};
}

/// What would be dropped in silence is refused: none of these options may be given `where`.
inline void refuse(const CLI::App& cli, std::initializer_list<const char*> options,
                   const std::string& where) {
  for (const char* option : options)
    if (cli.count(option) > 0) throw InputError(fmt::format("{}: means nothing {}", option, where));
}

inline int allCores() {
  return static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

/// LCM's own variable, where it is set; else `otherwise`.
inline std::string defaultUrl(const char* otherwise = kDefaultUrl) {
  const char* given = std::getenv("LCM_DEFAULT_URL");
  return given && *given ? given : otherwise;
}

inline void addUrl(CLI::App& cli, std::string& url,
                   const char* what = "LCM bus; &key=FILE: a key that signs its messages") {
  url = defaultUrl(url.c_str());
  cli.add_option("--url", url, what)->capture_default_str();
}

/// For programs that meet on one private bus.
inline void addJoin(CLI::App& cli, std::string& name) {
  cli.add_option("--join", name, "on the private bus of this name; the first to ask begins it");
}
inline void joinIfNamed(const std::string& name) {
  if (!name.empty()) joinPrivateBus(name);
}

inline void addWorkers(CLI::App& cli, int& workers, const std::string& what) {
  cli.add_option("--workers", workers, what)->check(CLI::Range(1, 1024))->capture_default_str();
}

/// Ctrl-C, SIGTERM, a terminal that closes and processor time that is used up ask for a gentle end.
/// A closed pipe ends nothing.
inline void catchSignals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested = 1; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGXCPU, &action, nullptr);
  action.sa_handler = [](int) {
    stop_requested = 1;
    const int nowhere = open("/dev/null", O_RDWR);
    for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
      if (isatty(fd)) dup2(nowhere, fd);
  };
  sigaction(SIGHUP, &action, nullptr);
  action.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &action, nullptr);
}

/// Where bases, robots and scenarios are: as VES_CONFIG_DIR says, here, or beside the installed
/// program.
inline std::filesystem::path configFolder() {
  if (const char* given = std::getenv("VES_CONFIG_DIR")) return given;
  std::error_code error;
  const auto installed = installedData() / "config";
  const bool here = std::filesystem::exists("config/ves.yaml", error);
  return here || !std::filesystem::exists(installed, error) ? "config" : installed;
}

/// The folder of the run that was made last; refused where there is none.
inline std::filesystem::path newestRun() {
  std::error_code error;
  std::filesystem::path newest;
  std::filesystem::file_time_type when;
  for (const auto& entry : std::filesystem::directory_iterator("ves-runs", error)) {
    const std::filesystem::path log = entry.path() / "run.lcmlog";
    const auto written = std::filesystem::last_write_time(log, error);
    if (error || (!newest.empty() && written <= when)) continue;
    newest = entry.path();
    when = written;
  }
  if (newest.empty()) throw CLI::ValidationError("newest: there is no run in ves-runs");
  return newest;
}

/// A run's folder stands for the log in it; `newest` for the run in ves-runs that was made last.
inline std::string logOf(const std::string& given) {
  std::error_code error;
  const bool named = given == "newest" && !std::filesystem::exists(given, error);
  const std::filesystem::path path = named ? newestRun() : std::filesystem::path(given);
  return std::filesystem::is_directory(path, error) ? (path / "run.lcmlog").string() : given;
}
inline CLI::Option* asLog(CLI::Option* option) { return option->transform(logOf); }

/// For logs of lcm-logger that began after the configuration was announced.
inline void addScenarioOfLog(CLI::App& cli, std::string& scenario) {
  cli.add_option("--scenario", scenario, "of a log without a configuration");
}
inline std::optional<Experiment> scenarioOfLog(const std::string& scenario) {
  if (scenario.empty()) return {};
  return loadExperiment(findScenario(scenario, configFolder()));
}

/// Which experiment, and on which bus.
struct Options {
  std::string scenario;
  std::vector<std::string> overrides;
  std::int64_t seed = -1;
  BeliefFiles belief;
  bool force = false;
  bool verbose = false, quiet = false;
  bool private_bus = false;
  std::string join;
  ProcessOptions process;

  void addExperiment(CLI::App& cli) {
    cli.add_option("scenario", scenario, "name in config/scenarios, or a .yaml file")->required();
    cli.add_option("--set", overrides, "KEY.PATH=VALUE as if it stood in the scenario")
        ->allow_extra_args(false);
    cli.add_option("--seed", seed, "of the plant's noise")
        ->check(CLI::Range(std::int64_t{0}, std::int64_t{UINT32_MAX}));
    cli.add_option("--belief", belief.belief, "file that a commissioning has left: all of these");
    cli.add_option("--calibration", belief.calibration, "file that a calibration has left");
    cli.add_option("--masses", belief.masses,
                   "file that an identification has left, for the controller");
    cli.add_option("--servo", belief.servo,
                   "file that a servo identification has left, for the controller");
    cli.add_flag("--verbose", verbose, "also what is known to be odd in the robot's file");
  }
  const CLI::Option* url = nullptr;

  void addForce(CLI::App& cli) {
    cli.add_flag("--force", force, "admittance control even where it would diverge");
  }
  void addBus(CLI::App& cli) {
    addUrl(cli, process.url);
    url = cli.get_option("--url");
    cli.add_flag("--lockstep", process.lockstep, "as fast as possible, nothing waits on a clock");
    cli.add_flag("--realtime", process.realtime, "insist on SCHED_FIFO and locked memory");
    auto* alone = cli.add_flag("--private-bus", private_bus, "on a network of this run's own");
    addJoin(cli, join);
    cli.get_option("--join")->excludes(alone);
  }
  /// After addBus().
  void addPace(CLI::App& cli) {
    cli.add_option("--pace", process.pace, "[-] of real time, in lockstep; `view` changes it")
        ->check(inRange(kLeastPace, kMostPace))
        ->needs(cli.get_option("--lockstep"));
  }
  /// Before any thread starts.
  void enterBus() const {
    if (private_bus) enterPrivateBus();
    joinIfNamed(join);
    const bool own = private_bus || !join.empty() || process.lockstep || (url && url->count() > 0);
    if (!own && process.url == defaultUrl(""))
      fmt::print(stderr, "bus: {} (LCM_DEFAULT_URL)\n", process.url);
  }

  /// The bus's key is the scenario's, unless --url names one.
  Experiment load() {
    std::vector<std::string> all = overrides;
    if (seed >= 0) all.push_back(fmt::format("seed={}", seed));
    if (force) all.push_back("controller.stability=forced");
    Experiment experiment = loadExperiment(findScenario(scenario, configFolder()), all, belief);
    process.url = withKey(process.url, experiment.key_file);
    return experiment;
  }
};

/// Says which contacts of the program are too stiff to be emulated well.
inline void warnOfContacts(const Experiment& experiment) {
  const auto stiff = [](const ContactVerdict& one) {
    return !one.grows && std::abs(one.impact.energy_error) > kMostEnergyError;
  };
  const auto all = assessContacts(experiment.controller, experiment.plant.task, false);
  if (!std::any_of(all.begin(), all.end(), stiff)) return;
  for (const ContactVerdict& one : assessContacts(experiment.controller, experiment.plant.task))
    if (stiff(one)) fmt::print(stderr, "warning: {}\n", explain(one));
}

/// Says that admittance control would diverge, and refuses a program that has it.
inline void warnOfInstability(Experiment& experiment) {
  const std::string why = requireStability(experiment);
  if (!why.empty()) fmt::print(stderr, "warning: {}\n", why);
  warnOfContacts(experiment);
}

/// Asks a command for the words that may be completed.
inline constexpr const char* kWords = "--words";

inline void printWords(const CLI::App& cli) {
  for (const CLI::App* sub : cli.get_subcommands(nullptr)) {
    std::cout << sub->get_name() << " ";
    printWords(*sub);
  }
  for (const CLI::Option* option : cli.get_options())
    for (const std::string& name : option->get_lnames()) std::cout << "--" << name << " ";
}

/// Why a run of the controller is no success, empty where it is; its log knows more of it.
inline std::string whyNot(const RunResult& result, const std::string& log = "") {
  if (result.phase == Phase::kDisarmed)
    return fmt::format(
        "not armed: {}{}",
        result.cause == Check::kCount ? "no stream of new samples long enough" : name(result.cause),
        result.rejected.empty() ? "" : "; " + result.rejected);
  if (result.phase == Phase::kStopped)
    return fmt::format("stopped by the {} check in tick {}", name(result.cause), result.cause_tick);
  if (!result.aborted) return {};
  if (!log.empty()) return whyEarly(readSeries(log));
  return result.aborted_by == Refusal::kNone ? "the calibration was refused"
                                             : refusedSegment(result.aborted_by);
}

/// Environment: the token of a socket that `ves view` inherits. Arguments are for all to see.
inline constexpr const char* kViewToken = "VES_VIEW_TOKEN";

/// This very program, to start its other processes.
inline std::filesystem::path ownProgram() {
  return std::filesystem::read_symlink("/proc/self/exe");
}

/// One line that a person can read, whatever was quoted in it.
inline std::string shortened(std::string text) {
  constexpr std::size_t kHead = 300, kTail = 200;
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  if (text.size() <= kHead + kTail) return text;
  return text.substr(0, kHead) + " ... " + text.substr(text.size() - kTail);
}

/// What an unknown option was meant to be; empty where nothing is near.
inline std::string optionMeant(const CLI::App& cli, const std::string& said) {
  const std::size_t at = said.find("--");
  if (at == std::string::npos) return "";
  const std::string given = said.substr(at, said.find_first_of(" =", at) - at);
  std::vector<std::string> names;
  for (const CLI::App* one = &cli; one;
       one = one->get_subcommands().empty() ? nullptr : one->get_subcommands().front())
    for (const CLI::Option* option : one->get_options())
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  const std::string meant = nearest(given, names);
  return meant.empty() ? "" : fmt::format(", did you mean {}?", meant);
}

/// An option whose text is empty, as of a shell's variable that is not set; or no name.
inline std::string emptyOption(const CLI::App& cli) {
  for (const CLI::App* one = &cli; one;
       one = one->get_subcommands().empty() ? nullptr : one->get_subcommands().front())
    for (const CLI::Option* option : one->get_options())
      for (const std::string& text : option->results())
        if (text.empty()) return option->get_name();
  return "";
}

/// The names of its subcommands.
inline std::string partsOf(const CLI::App& cli) {
  std::string out;
  for (const CLI::App* sub : cli.get_subcommands([](const CLI::App*) { return true; }))
    out += (out.empty() ? "" : ", ") + sub->get_name();
  return out;
}

/// Parses, runs, and turns bad input into one line and status 2.
inline int run(CLI::App& cli, int argc, char** argv, const std::function<int()>& body) {
  cli.formatter(std::make_shared<EightyColumns>());
  for (CLI::App* sub : cli.get_subcommands({})) sub->formatter(cli.get_formatter());
  if (argc == 2 && std::string_view(argv[1]) == kWords) {
    printWords(cli);
    return kDone;
  }
  try {
    cli.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return cli.exit(error);  // --help
    const bool unknown = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
    if (const std::string parts = partsOf(cli); !parts.empty() && cli.get_subcommands().empty()) {
      const bool named = argc > 1 && argv[1][0] != '-';
      fmt::print(stderr, "{}: {}want one of {} (see --help)\n", cli.get_name(),
                 named ? fmt::format("'{}': ", shortened(argv[1])) : "", parts);
      return kBadInput;
    }
    fmt::print(stderr, "{}: {}{} (see --help)\n", cli.get_name(), shortened(error.what()),
               unknown ? optionMeant(cli, error.what()) : "");
    return kBadInput;
  }
  try {
    if (const std::string option = emptyOption(cli); !option.empty())
      throw InputError(option + ": is empty");
    const int status = body();
    std::cout.flush();
    if (std::fflush(stdout) != 0 || std::ferror(stdout) || !std::cout)
      throw InputError(fmt::format("standard output: {}", std::strerror(errno)));
    return status;
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", cli.get_name(), shortened(error.what()));
    return kBadInput;
  }
}

/// As a shell takes it for one word.
inline std::string asTyped(const std::string& word) {
  constexpr const char* kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=:,./@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

/// A title and columns beneath each other.
inline void printTable(const std::string& title, const std::vector<std::string>& header,
                       const std::vector<std::vector<std::string>>& rows) {
  fmt::print("{}\n", title);
  if (rows.empty()) fmt::print("  nothing\n");
  std::vector<std::size_t> widths(header.size());
  for (std::size_t i = 0; i < header.size(); ++i) {
    widths[i] = header[i].size();
    for (const auto& row : rows) widths[i] = std::max(widths[i], row[i].size());
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    fmt::print("  {:<{}}", cells[0], widths[0]);
    for (std::size_t i = 1; i < cells.size(); ++i) fmt::print("  {:>{}}", cells[i], widths[i]);
    fmt::print("\n");
  };
  if (!rows.empty()) line(header);
  for (const auto& row : rows) line(row);
  fmt::print("\n");
}

inline void printDamage(const Damage& damage) {
  for (const std::string& line : damage.lines()) fmt::print(stderr, "warning: {}\n", line);
}

/// What of it is damaged is said.
inline Series seriesOf(const std::string& log, const std::string& scenario) {
  const std::optional<Experiment> without = scenarioOfLog(scenario);
  Series series = readSeries(log, without ? &*without : nullptr);
  if (without && !series.version.empty())
    throw InputError(
        fmt::format("--scenario {}: {} has its own configuration; leave it out", scenario, log));
  printDamage(series.damage);
  return series;
}

inline void printWarnings(const Experiment& experiment, bool verbose = false) {
  if (verbose)
    for (const std::string& note : experiment.source.notes) fmt::print(stderr, "note: {}\n", note);
  for (const std::string& warning : experiment.source.warnings)
    fmt::print(stderr, "warning: {}\n", warning);
  if (experiment.source.calibration && age(*experiment.source.calibration) > kCalibrationKeeps)
    fmt::print(stderr,
               "warning: the calibration of {} is {:.1f} h old; its bias drifts, and keeps {} h\n",
               dateText(experiment.source.calibration->date), age(*experiment.source.calibration),
               kCalibrationKeeps);
}

}  // namespace ves::app
