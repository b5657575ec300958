// SPDX-License-Identifier: BSD-3-Clause
//
// Acceptance of a motion platform as AGARD-AR-144 measures it: one coordinate after the other is
// moved alone by a program, and what the transducers and the force sensor say is held against what
// was told. ICAO 9625 (OMCT) and 14 CFR 60 appendix A ask for parts of the same.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "ves/acceptance/measures.hpp"
#include "ves/analysis/platform.hpp"
#include "ves/series/series.hpp"
#include "ves/validation/page.hpp"

namespace ves {

struct AcceptanceOptions {
  std::vector<double> frequencies = {0.2, 0.5, 1, 2, 3, 5, 7, 10};  // [Hz] rising
  std::vector<double> amplitudes = {1.0, 0.3, 0.1};  // [-] of the largest at each frequency
  double share = 0.5;   // [-] of what travel, legs' speed and the sensor's range allow, at most
  double slow = 0.001;  // [m/s] of the slower triangles; of a rotation, at the joints' radius
  double step = 0.1;    // [m/s^2] of a step of acceleration; the same
  bool sines = true, passes = true, steps = true;  // which tests; it always stands first
};

/// What one coordinate goes through, and within which limits.
struct AcceptanceTest {
  struct Sine {
    int segment = 0;
    double frequency = 0.0;  // [Hz]
    double amplitude = 0.0;  // [m | rad]
    double level = 0.0;      // [-] of the largest, as in the options
    double settles = 0.0;    // [s] before it is looked at,
    double ends = 0.0;       // [s] and after
  };
  struct Ramp {
    int segment = 0;
    bool up = true, fast = false;
  };
  int coordinate = 0;
  Experiment experiment;
  double seconds = 0.0;  // [s] of the machine's time, about
  double radius = 0.0;   // [m] of the joints: of a rotation, times this is a way
  Travel down, up;       // from home, [m | rad]
  double fastest = 0.0;  // [m/s | rad/s] within the legs' commanded speed
  double hardest = 0.0;  // [m/s^2 | rad/s^2] within the sensor's range; 0: nothing on it
  double slow = 0.0;     // [m/s | rad/s] of the slower triangles
  double step = 0.0;     // [m/s^2 | rad/s^2]
  int rest_segment = -1, step_segment = -1;  // -1: not asked for
  std::vector<Sine> sines;
  std::vector<std::string> skipped;  // sines that are too small to be measured
  std::vector<Ramp> ramps;
};

/// For `coordinate` 0..5. Whatever is about in the scenario's workspace is left out. Throws
/// InputError where the machine's limits leave no room.
AcceptanceTest acceptanceTest(const Experiment& scenario, int coordinate,
                              const AcceptanceOptions& options);

/// What is measured, in the order of kQuantities.
enum class Quantity {
  kGain,
  kPhase,
  kCrosstalk,
  kHarmonics,
  kRoughness,
  kPeak,
  kTurnAround,
  kCorner,
  kHysteresis,
  kOffset,
  kLag,
  kThreshold,
  kRestPosition,
  kRestAcceleration,
  kCount
};

enum class Per { kOne, kAngle, kSecond, kHertz, kWay, kAcceleration };

struct QuantityMeaning {
  const char* name;
  Per unit;
  bool of_sine;  // one at each frequency and amplitude
  const char* meaning;
};
inline constexpr QuantityMeaning kQuantities[] = {
    {"gain", Per::kOne, true, "fundamental done over fundamental told"},
    {"phase", Per::kAngle, true, "of that; negative: late"},
    {"crosstalk", Per::kOne, true,
     "fundamental of the worst other coordinate over the one told, rotations as ways at the "
     "joints' radius"},
    {"harmonics", Per::kOne, true,
     "rms of 2nd and 3rd harmonic over that of the fundamental, of "
     "the acceleration"},
    {"roughness", Per::kOne, true, "the same of what remains"},
    {"peak_noise", Per::kOne, true,
     "largest of all that is not the fundamental over its amplitude, "
     "of the acceleration"},
    {"turn_around", Per::kAcceleration, true,
     "bump of the acceleration where the motion turns, mean over the cycles"},
    {"corner_hz", Per::kHertz, false, "where the phase is -90 deg at the largest amplitudes"},
    {"hysteresis", Per::kWay, false, "width between both ways, at standstill"},
    {"offset", Per::kWay, false, "done less told, half way between both ways"},
    {"lag", Per::kSecond, false, "behind a steady speed"},
    {"threshold", Per::kSecond, false, "after a step of acceleration, until 63 % of it is felt"},
    {"rest_position", Per::kWay, false, "standard deviation at rest"},
    {"rest_acceleration", Per::kAcceleration, false, "the same of the acceleration"},
};
static_assert(std::size(kQuantities) == static_cast<std::size_t>(Quantity::kCount));
/// The part of a test that measures it: sines, passes, steps; empty: all.
const char* partOf(Quantity quantity) noexcept;

/// One number. `of` is a coordinate's name, or leg_1..leg_6 in the test of z. SI; phase in rad.
struct Measurement {
  std::string of;
  Quantity quantity = Quantity::kCount;
  Estimate estimate;
  double frequency = NAN;  // [Hz] of a sine
  double amplitude = NAN;  // [m | rad]
  double level = NAN;      // [-]
  std::string note;        // "worst: beta"
};

/// A quantity's unit: in tables, "" where it has none, and how many of it one of SI is; in the CSV;
/// at the end of a limit's keys, and how much SI one of that is.
struct Unit {
  const char* name = "";
  double per_si = 1.0;
  const char* si = "1";
  const char* key = "";
  double key_si = 1.0;
};
/// Of a rotation or not.
Unit unitOf(Quantity quantity, bool turns);
/// Whether a coordinate's name is that of a rotation; a leg's is not.
bool turns(std::string_view of);
inline Unit unitOf(const Measurement& m) { return unitOf(m.quantity, turns(m.of)); }

/// What a coordinate's run shows.
struct CoordinateResult {
  int coordinate = 0;
  std::vector<Measurement> all;
  std::vector<std::string> missing;  // what could not be measured, and why
  Track loop_up, loop_down;          // [m | rad] done less told over told, the last slow pass each
  Track step_told, step_felt;        // [m/s^2 | rad/s^2] over [s], mean of the repetitions
};
CoordinateResult measurementsOf(const Series& series, const AcceptanceTest& test);

/// What a user asks of the machine.
struct AcceptanceLimit {
  Quantity quantity = Quantity::kCount;
  std::vector<std::string> of;                // empty: every coordinate that was tested
  double least = -HUGE_VAL, most = HUGE_VAL;  // SI
  double from = 0.0, up_to = HUGE_VAL;        // [Hz]
  std::string text;                           // as it is shown
};
/// A YAML file: a list `limits`. Throws InputError where it is none.
std::vector<AcceptanceLimit> readLimits(const std::filesystem::path& file);

/// The worst number that a limit is about.
struct AcceptanceVerdict {
  AcceptanceLimit limit;
  std::optional<Measurement> worst;  // none: it was not measured
  /// kept: the whole interval is within; open: a part of it is; broken: none of it is.
  enum class Is { kKept, kOpen, kBroken, kNotMeasured } is = Is::kNotMeasured;
};
std::vector<AcceptanceVerdict> judge(const std::vector<AcceptanceLimit>& limits,
                                     const std::vector<CoordinateResult>& found);
const char* name(AcceptanceVerdict::Is is);

/// A table of every number: RFC 4180, SI.
std::string acceptanceCsv(const std::vector<CoordinateResult>& found);

/// One line a coordinate (and a leg), for the terminal and the page's top.
Table acceptanceSummary(const std::vector<CoordinateResult>& found);
Table verdictTable(const std::vector<AcceptanceVerdict>& verdicts);

/// `conditions`: one line each, said on top.
Page acceptancePage(const std::vector<AcceptanceTest>& tests,
                    const std::vector<CoordinateResult>& found,
                    const std::vector<AcceptanceVerdict>& verdicts,
                    const std::vector<std::string>& conditions, const std::string& command);

}  // namespace ves
