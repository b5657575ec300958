// SPDX-License-Identifier: BSD-3-Clause
#include "app.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <vector>

#include "help.hpp"
#include "ves/core/build.hpp"
#include "ves/core/errors.hpp"
#include "ves/core/spelling.hpp"

namespace ves::app {

void catchSignals() {
  struct sigaction action {};
  action.sa_flags = SA_RESTART;  // a write goes on: a stream holds an interrupted one for an error
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

std::filesystem::path configFolder() {
  if (const char* given = std::getenv("VES_CONFIG_DIR")) return given;
  std::error_code error;
  const auto installed = installedData() / "config";
  const bool here = std::filesystem::exists("config/ves.yaml", error);
  return here || !std::filesystem::exists(installed, error) ? "config" : installed;
}

std::filesystem::path ownProgram() { return std::filesystem::read_symlink("/proc/self/exe"); }

std::string shortened(std::string text) {
  constexpr std::size_t kHead = 300, kTail = 200;
  while (!text.empty() && text.back() == '\n') text.pop_back();
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  if (text.size() <= kHead + kTail) return text;
  return text.substr(0, kHead) + " ... " + text.substr(text.size() - kTail);
}

namespace {

void printWords(const CLI::App& cli) {
  for (const CLI::App* sub : cli.get_subcommands(nullptr)) {
    std::cout << sub->get_name() << " ";
    printWords(*sub);
  }
  for (const CLI::Option* option : cli.get_options())
    for (const std::string& name : option->get_lnames()) std::cout << "--" << name << " ";
}

/// What an unknown option was meant to be; empty where nothing is near.
std::string optionMeant(const CLI::App& cli, const std::string& said) {
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
std::string emptyOption(const CLI::App& cli) {
  for (const CLI::App* one = &cli; one;
       one = one->get_subcommands().empty() ? nullptr : one->get_subcommands().front())
    for (const CLI::Option* option : one->get_options())
      for (const std::string& text : option->results())
        if (text.empty()) return option->get_name();
  return "";
}

/// The names of its subcommands.
std::string partsOf(const CLI::App& cli) {
  std::string out;
  for (const CLI::App* sub : cli.get_subcommands([](const CLI::App*) { return true; }))
    out += (out.empty() ? "" : ", ") + sub->get_name();
  return out;
}

}  // namespace

int run(CLI::App& cli, int argc, char** argv, const std::function<int()>& body) {
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

}  // namespace ves::app
