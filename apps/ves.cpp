// SPDX-License-Identifier: BSD-3-Clause
//
// ves: every command of the project in one program.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <iostream>
#include <sstream>
#include <string_view>

#include "app.hpp"
#include "commands.hpp"
#include "ves/core/build.hpp"
#include "ves/core/spelling.hpp"

namespace ves::app {
namespace {

struct Command {
  const char* name;
  const char* purpose;
  int (*run)(int argc, char** argv);
};

constexpr Command kCommands[] = {
    {"demo", "watch it move: PUMA 560 on a compliant base, two processes, 20 s", demoCommand},
    {"run", "run one scenario of config/scenarios (--lockstep: as fast as possible)", runCommand},
    {"controller", "testPlatform, with its menu on a terminal", controllerCommand},
    {"plant", "the machine as a process, by hand", plantCommand},
    {"replay", "a recorded run through the controller again (--check: bit for bit)", replayCommand},
    {"collect", "variables of a log as CSV (--select, --rate, --list)", collectCommand},
    {"plot", "columns of a log as a picture (--select)", plotCommand},
    {"commission", "what a machine is: one command, one belief file, one page", commissionCommand},
    {"accept", "what a motion platform does, as AGARD-AR-144 measures it; limits kept or not",
     acceptCommand},
    {"compare", "runs side by side: configurations, results, curves", compareCommand},
    {"view", "a recorded run in three dimensions, as one file for a browser", viewCommand},
    {"keys", "what scenario files may say, with unit, range and default", keysCommand},
    {"report", "chapter 4 of the report once more, as one page", reportCommand},
    {"srms", "the flexible base, and the robot on it (chapter 3)", srmsCommand},
    {"stability", "whether the force feedback decays: this machine's, Appendix E's",
     stabilityCommand},
    {"identify", "the robot's masses and the legs' servos from logs", identifyCommand},
    {"sweep", "one scenario over many values, on all cores, one row a run", sweepCommand},
    {"faults", "inject the faults of the table, say what was expected and what happened",
     faultsCommand},
    {"platform", "joints, legs and limits of a Stewart platform, derived and in use",
     platformCommand},
    {"robot", "what a robot description holds, and what of it moves", robotCommand},
    {"conform", "does the machine on the bus keep its side of it", conformCommand},
    {"on-bus", "any program on a private bus that --join reaches", onBusCommand},
    {"netft-server", "the simulated force sensor as an ATI Net F/T", netftServerCommand},
    {"doctor", "can this machine keep the loop's time, and what to do where it cannot",
     doctorCommand},
};

constexpr const char* kExamples =
    "ves demo --view                            the main job, in a browser too\n"
    "ves run                                    what scenarios there are\n"
    "ves run srms_capture_doss --lockstep       one of them, as fast as it goes\n"
    "ves run ramp --set legs.filters=outputs    with another value; ves keys lists them\n"
    "ves view newest                            the last run in a browser\n"
    "ves view RUN --video run.mp4               as a film\n"
    "ves replay newest --check                  through the controller again, bit for bit\n"
    "ves compare RUN RUN                        what differs between two runs\n"
    "ves controller puma_on_table_4_1 --plant   by hand, from a menu\n"
    "ves sweep ramp --vary seed=1:100:100       one row a run\n";
constexpr const char* kFiles =
    "ves-runs/SCENARIO-DATE/     a run: experiment.yaml, run.lcmlog, series.csv, summary.json\n"
    "ves-runs/calibration.yaml   the last calibration from the menu\n"
    "/usr/share/ves/config/      bases, robots, platforms, scenarios as they are installed\n"
    "/usr/share/doc/ves/         the manual, examples, lessons\n"
    "/usr/share/ves/lcmtypes/    the messages on the bus\n";

/// What the command prints on that option.
std::string printed(const Command& command, std::string option) {
  std::string name = command.name;
  char* argv[] = {name.data(), option.data(), nullptr};
  std::ostringstream out;
  std::streambuf* const before = std::cout.rdbuf(out.rdbuf());
  command.run(2, argv);
  std::cout.rdbuf(before);
  return out.str();
}

/// Text of a manual page: no character of it is a request.
std::string forTroff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n')) out += "\\&";
    out += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
  }
  return out;
}

/// For bash: eval "$(ves completion)".
void printCompletion() {
  fmt::print(
      "_ves() {{\n  local words cur=${{COMP_WORDS[COMP_CWORD]}} command=${{COMP_WORDS[1]}}\n"
      "  if ((COMP_CWORD == 1)); then\n    words='");
  for (const Command& c : kCommands) fmt::print("{} ", c.name);
  fmt::print("test fuzz bench python lessons package help'\n  else\n    case $command in\n");
  for (const Command& c : kCommands)
    fmt::print("      {}) words='{}' ;;\n", c.name, printed(c, kWords));
  fmt::print(
      "    esac\n"
      "    case $command in run | controller | plant | sweep | stability | identify | srms)\n"
      "      local folder=${{VES_CONFIG_DIR-config}}\n"
      "      [[ -d $folder/scenarios ]] || folder=/usr/share/ves/config\n"
      "      words+=\" $(cd \"$folder/scenarios\" 2>/dev/null && "
      "printf '%s ' *.yaml | sed 's/\\.yaml//g')\" ;;\n"
      "    esac\n"
      "  fi\n  COMPREPLY=($(compgen -W \"$words\" -- \"$cur\"))\n"
      "  [[ $cur == -* ]] || COMPREPLY+=($(compgen -f -- \"$cur\"))\n}}\n"
      "complete -F _ves ves ./ves\n");
}

/// The manual page, for man -l -.
void printManual() {
  fmt::print(
      ".TH VES 1 \"\" \"{}\" \"Vehicle Emulation System\"\n.SH NAME\n"
      "ves \\- a Stewart platform that moves as a flexible arm under a robot would\n"
      ".SH SYNOPSIS\n.B ves\n.I COMMAND\n.RI [ ARGUMENT ...]\n.SH COMMANDS\n",
      describeBuild());
  for (const Command& c : kCommands) {
    const std::string help = printed(c, "--help");
    const std::size_t usage = help.find("Usage");
    fmt::print(".SS {}\n{}.PP\n.nf\n{}.fi\n", forTroff(c.name), forTroff(help.substr(0, usage)),
               forTroff(help.substr(usage)));
  }
  fmt::print(
      ".SH EXAMPLES\n.nf\n{}.fi\n.SH FILES\n.nf\n{}.fi\n"
      ".SH EXIT STATUS\n0: done. 1: a check stopped the run, or a comparison failed. 2: bad "
      "input, in one line.\n.SH ENVIRONMENT\nVES_CONFIG_DIR: the folder of bases, robots and "
      "scenarios.\n.br\nLCM_DEFAULT_URL: the bus, where \\-\\-url does not name one.\n",
      forTroff(kExamples), forTroff(kFiles));
}

void printUsage(FILE* to) {
  fmt::print(to, "usage: ves COMMAND [ARGUMENT...]\n\n");
  for (const Command& c : kCommands) fmt::print(to, "  {:<13}{}\n", c.name, c.purpose);
  fmt::print(to,
             "  {:<13}{}\n  {:<13}{}\n\n`ves COMMAND --help` tells the rest; --version: which "
             "build this is.\n",
             "completion", fmt::format("for bash: eval \"$({} completion)\"", frontDoor()), "man",
             fmt::format("the manual page: {} man | man -l -", frontDoor()));
}

/// None where the word is none.
const Command* commandOf(std::string_view word) {
  const auto at = std::find_if(std::begin(kCommands), std::end(kCommands),
                               [&](const Command& c) { return word == c.name; });
  return at == std::end(kCommands) ? nullptr : at;
}

int dispatch(int argc, char** argv) {
  std::string_view word = argc > 1 ? argv[1] : "";
  if (const Command* command = commandOf(word)) return command->run(argc - 1, argv + 1);
  const bool help = word == "help" || word == "--help" || word == "-h";
  if (help && argc == 3) {
    word = argv[2];
    if (const Command* command = commandOf(word)) {
      fmt::print("{}", printed(*command, "--help"));
      return kDone;
    }
  } else if (argc > 2 && (help || word == "--version" || word == "completion" || word == "man")) {
    fmt::print(stderr, "ves: '{}': want nothing after {}\n", argv[2], word);
    return kBadInput;
  }
  if (word == "--version") {
    fmt::print("ves {}\n", describeBuild());
  } else if (word == "completion") {
    printCompletion();
  } else if (word == "man") {
    printManual();
  } else if (help && argc == 2) {
    printUsage(stdout);
  } else {
    if (word.empty()) {
      printUsage(stderr);
      return kBadInput;
    }
    std::vector<std::string_view> names;
    for (const Command& c : kCommands) names.push_back(c.name);
    const std::string meant = nearest(word, names);
    fmt::print(stderr, "ves: unknown command '{}'{} (see ves help)\n", word,
               meant.empty() ? "" : fmt::format(", did you mean '{}'?", meant));
    return kBadInput;
  }
  return kDone;
}

}  // namespace
}  // namespace ves::app

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may grow no more is an error of its writer
  return ves::app::dispatch(argc, argv);
}
