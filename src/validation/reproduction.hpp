// SPDX-License-Identifier: BSD-3-Clause
//
// What the sections of the page share: runs in lockstep, named numbers, claims, lines of figures.
// Parts of it are written at once, each a piece of its own, and put together in their order.
#pragma once

#include <fmt/format.h>

#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "ves/core/coordinates.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/validation/chapter4.hpp"
#include "ves/validation/claims.hpp"
#include "ves/validation/page.hpp"

namespace ves {

using Numbers = nlohmann::ordered_json;
using Overrides = std::vector<std::string>;
using TableRow = std::vector<std::string>;
using TableRows = std::vector<TableRow>;

inline constexpr const char* kSinceSegment = "time since the segment began [s]";
inline constexpr const char* kSinceAdmittance = "time since admittance control began [s]";
inline constexpr double kMilli = 1e3;  // [1/m] millimetres
inline constexpr const char* kConfigurations[] = {"unberth", "low_hover", "deploy", "capture"};
inline constexpr const char* kRobots[] = {"puma", "doss"};
/// [-] of 4.3, in its order
inline constexpr std::size_t kRuns = std::size(kConfigurations) * std::size(kRobots);
struct Run43 {
  std::string configuration, robot;
};
inline Run43 runOf(std::size_t i) {
  return {kConfigurations[i % std::size(kConfigurations)], kRobots[i / std::size(kConfigurations)]};
}

inline std::string mm(double x) { return fmt::format("{:.2f}", x * kMilli); }
inline std::string percent(double x) { return fmt::format("{:.2f}", 100.0 * x); }
/// "low hover, DOSS"
std::string title(const std::string& configuration, const std::string& robot);
/// a, then b.
Overrides with(Overrides a, const Overrides& b);

class Reproduction {
 public:
  using Run = RecordedRun;

  /// Told each run's name and number, and how many parts of those begun are done, by one thread at
  /// a time.
  using Progress = std::function<void(const std::string&, int run, int done, int of)>;

  /// Throws InputError where `config` has no claims.yaml.
  Reproduction(std::filesystem::path config, const std::filesystem::path& folder,
               const Progress& progress);

  /// Calls write(piece, i) for every i below n, on all workers, and appends the pieces in order.
  void parts(std::size_t n, const std::function<void(Reproduction&, std::size_t)>& write);

  /// A scenario with changes, its stability checked.
  Experiment load(const std::string& scenario, const Overrides& set = {}) const;
  Run run(const std::string& scenario, const Overrides& set = {}) {
    return record(scenario, load(scenario, set));
  }
  Run record(const std::string& name, const Experiment& e);
  /// The platform beside its base, where the base's motion is known from other runs too.
  std::optional<Emulation> emulation(const Series& series) {
    return ves::emulation(series, shared_->references);
  }

  /// Puts the claim with these numbers onto the page.
  void claim(const std::string& id, const Quantities& measured) {
    page.claim(shared_->claims.judge(id, measured));
    judged.insert(id);
  }
  std::vector<std::string> openClaims() const;

  std::filesystem::path config;   // folder of the scenarios
  std::filesystem::path scratch;  // folder for what lies between
  Page page;
  Numbers numbers;
  std::set<std::string> judged;  // claims
  int substitutes = 0;           // [-] most in a run

 private:
  /// Of all pieces.
  struct Shared {
    Shared(Claims c, Progress p) : claims(std::move(c)), progress(std::move(p)) {}

    Claims claims;
    Progress progress;
    std::mutex mutex;
    int runs = 0, parts_done = 0, parts = 0;
    ReferenceMotions references;
  };
  Reproduction piece() const;  // empty, of the same whole
  void append(const Reproduction& piece);

  std::shared_ptr<Shared> shared_;
};

/// A line of a panel: what the rows of segments of one kind show.
Line lineOf(const std::string& name, const Series& series, SegmentKind kind, int colour,
            const std::function<double(const Row&)>& value, bool dashed = false);
/// Commanded and actual coordinates, a panel each.
std::vector<Panel> tracking(const Series& series, SegmentKind kind, const std::vector<int>& which);

/// A program that lets one mode of base and robot go from a centimetre and a half.
std::string letGo(const CoupledMode& mode);

// The sections, in their order.
void sensorSection(Reproduction& r);        // 4.1, calibration of 2.3
void ratesSection(Reproduction& r);         // 2.3, 2.4
void motionSection(Reproduction& r);        // 4.2
void imperfectSection(Reproduction& r);     // 4.2 on hydraulic legs
void shuttleArmSection(Reproduction& r);    // 4.3
void stabilitySection(Reproduction& r);     // Appendix E
void massesSection(Reproduction& r);        // Appendix B
void compensationSection(Reproduction& r);  // beyond the report
void contactSection(Reproduction& r);       // the same

}  // namespace ves
