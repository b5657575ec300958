// SPDX-License-Identifier: BSD-3-Clause
#include "options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "ves/core/errors.hpp"

namespace ves::app {

CLI::Validator inRange(double lo, double hi) {
  return {[lo, hi](std::string& text) {
            double x = NAN;
            const bool number = CLI::detail::lexical_cast(text, x);
            return number && x >= lo && x <= hi
                       ? std::string()
                       : fmt::format("'{}', want a number in [{}, {}]", text, lo, hi);
          },
          fmt::format("in [{}, {}]", lo, hi)};
}

CLI::Validator aboveZero() {
  return {[](std::string& text) {
            double x = NAN;
            const bool number = CLI::detail::lexical_cast(text, x);
            return number && x > 0.0 ? std::string()
                                     : fmt::format("'{}', want a number above 0", text);
          },
          "above 0"};
}

CLI::Validator endsWith(std::vector<std::string> endings) {
  return {[endings](std::string& file) {
            const std::string ending = std::filesystem::path(file).extension().string();
            const bool is = std::find(endings.begin(), endings.end(), ending) != endings.end();
            return is ? std::string()
                      : fmt::format("'{}', want a name that ends in {}", file,
                                    fmt::join(endings, ", "));
          },
          ""};
}

void refuse(const CLI::App& cli, std::initializer_list<const char*> options,
            const std::string& where) {
  for (const char* option : options)
    if (cli.count(option) > 0) throw InputError(fmt::format("{}: means nothing {}", option, where));
}

int allCores() { return static_cast<int>(std::max(1u, std::thread::hardware_concurrency())); }

std::string defaultUrl(const char* otherwise) {
  const char* given = std::getenv("LCM_DEFAULT_URL");
  return given && *given ? given : otherwise;
}

void addUrl(CLI::App& cli, std::string& url, const char* what) {
  url = defaultUrl(url.c_str());
  cli.add_option("--url", url, what)->capture_default_str();
}

void addJoin(CLI::App& cli, std::string& name) {
  cli.add_option("--join", name, "on the private bus of this name; the first to ask begins it");
}

void joinIfNamed(const std::string& name) {
  if (!name.empty()) joinPrivateBus(name);
}

void addWorkers(CLI::App& cli, int& workers, const std::string& what) {
  cli.add_option("--workers", workers, what)->check(CLI::Range(1, 1024))->capture_default_str();
}

void Options::addExperiment(CLI::App& cli) {
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

void Options::addForce(CLI::App& cli) {
  cli.add_flag("--force", force, "admittance control even where it would diverge");
}

void Options::addBus(CLI::App& cli) {
  addUrl(cli, process.url);
  url = cli.get_option("--url");
  cli.add_flag("--lockstep", process.lockstep, "as fast as possible, nothing waits on a clock");
  cli.add_flag("--realtime", process.realtime, "insist on SCHED_FIFO and locked memory");
  auto* alone = cli.add_flag("--private-bus", private_bus, "on a network of this run's own");
  addJoin(cli, join);
  cli.get_option("--join")->excludes(alone);
}

void Options::addPace(CLI::App& cli) {
  cli.add_option("--pace", process.pace, "[-] of real time, in lockstep; `view` changes it")
      ->check(inRange(kLeastPace, kMostPace))
      ->needs(cli.get_option("--lockstep"));
}

void Options::enterBus() const {
  if (private_bus) enterPrivateBus();
  joinIfNamed(join);
  const bool own = private_bus || !join.empty() || process.lockstep || (url && url->count() > 0);
  if (!own && process.url == defaultUrl(""))
    fmt::print(stderr, "bus: {} (LCM_DEFAULT_URL)\n", process.url);
}

Experiment Options::load() {
  std::vector<std::string> all = overrides;
  const bool set = std::any_of(all.begin(), all.end(),
                               [](const std::string& one) { return one.rfind("seed=", 0) == 0; });
  if (seed >= 0 && set) throw InputError("--seed: beside --set seed=; want one of them");
  if (seed >= 0) all.push_back(fmt::format("seed={}", seed));
  if (force) all.push_back("controller.stability=forced");
  Experiment experiment = loadExperiment(findScenario(scenario, configFolder()), all, belief);
  process.url = withKey(process.url, experiment.key_file);
  return experiment;
}

}  // namespace ves::app
