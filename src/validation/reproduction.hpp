// SPDX-License-Identifier: BSD-3-Clause
//
// What the sections of the page share: runs in lockstep, named numbers, claims, lines of figures.
#pragma once

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "ves/base/coordinates.hpp"
#include "ves/results/comparison.hpp"
#include "ves/results/summary.hpp"
#include "ves/validation/chapter4.hpp"
#include "ves/validation/claims.hpp"
#include "ves/validation/page.hpp"

namespace ves {

using Numbers = nlohmann::ordered_json;
using Overrides = std::vector<std::string>;
using TableRows = std::vector<std::vector<std::string>>;

inline constexpr double kMilli = 1e3;  // [1/m] millimetres
inline constexpr const char* kConfigurations[] = {"unberth", "low_hover", "deploy", "capture"};
inline constexpr const char* kRobots[] = {"puma", "doss"};

inline std::string mm(double x) { return fmt::format("{:.2f}", x * kMilli); }
inline std::string percent(double x) { return fmt::format("{:.2f}", 100.0 * x); }
/// "low hover, DOSS"
std::string title(const std::string& configuration, const std::string& robot);
/// a, then b.
Overrides with(Overrides a, const Overrides& b);

class Reproduction {
 public:
  using Run = RecordedRun;

  /// Throws InputError where `config` has no claims.yaml.
  Reproduction(std::filesystem::path config, const std::filesystem::path& folder,
               std::function<void(const std::string&, int)> progress);

  /// A scenario with changes, its stability checked.
  Experiment load(const std::string& scenario, const Overrides& set = {}) const;
  Run run(const std::string& scenario, const Overrides& set = {}) {
    return record(scenario, load(scenario, set));
  }
  Run record(const std::string& name, const Experiment& e);

  /// Puts the claim with these numbers onto the page.
  void claim(const std::string& id, const Quantities& measured) {
    page.claim(claims.judge(id, measured));
  }

  std::filesystem::path config;   // folder of the scenarios
  std::filesystem::path scratch;  // folder for what lies between
  Page page;
  Claims claims;
  Numbers numbers;
  int substitutes = 0;  // [-] most in a run

 private:
  std::function<void(const std::string&, int)> progress_;
  int runs_ = 0;
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
void shuttleArmSection(Reproduction& r);    // 4.3
void stabilitySection(Reproduction& r);     // Appendix E
void massesSection(Reproduction& r);        // Appendix B
void compensationSection(Reproduction& r);  // beyond the report

}  // namespace ves
