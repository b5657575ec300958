// SPDX-License-Identifier: BSD-3-Clause
//
// Options that several commands have.
#pragma once

#include <CLI/CLI.hpp>
#include <initializer_list>
#include <string>
#include <vector>

#include "app.hpp"
#include "ves/bus/bus.hpp"
#include "ves/config/experiment.hpp"
#include "ves/run/run.hpp"

namespace ves::app {

/// A number in [lo, hi]; CLI11's own range lets NaN through.
CLI::Validator inRange(double lo, double hi);
CLI::Validator aboveZero();
/// A file that is written is called what it is.
CLI::Validator endsWith(std::vector<std::string> endings);

/// What would be dropped in silence is refused: none of these options may be given `where`.
void refuse(const CLI::App& cli, std::initializer_list<const char*> options,
            const std::string& where);

int allCores();
void addWorkers(CLI::App& cli, int& workers, const std::string& what);

/// LCM's own variable, where it is set; else `otherwise`.
std::string defaultUrl(const char* otherwise = kDefaultUrl);
void addUrl(CLI::App& cli, std::string& url,
            const char* what = "LCM bus; &key=FILE: a key that signs its messages");

/// For programs that meet on one private bus.
void addJoin(CLI::App& cli, std::string& name);
void joinIfNamed(const std::string& name);

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
  const CLI::Option* url = nullptr;

  void addExperiment(CLI::App& cli);
  void addForce(CLI::App& cli);
  void addBus(CLI::App& cli);
  /// After addBus().
  void addPace(CLI::App& cli);
  /// Before any thread starts.
  void enterBus() const;
  /// The bus's key is the scenario's, unless --url names one.
  Experiment load();
};

}  // namespace ves::app
