// SPDX-License-Identifier: BSD-3-Clause
//
// When a run is over and what it came to, the folders it leaves, the lines that it shows; that the
// table of faults says so where a machine does not react.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/faults/soak.hpp"
#include "ves/faults/table.hpp"
#include "ves/results/results.hpp"
#include "ves/run/flight_record.hpp"
#include "ves/run/run_monitor.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

/// A life as the controller tells it, a state a tick.
class Told {
 public:
  explicit Told(bool attended = false)
      : monitor_(test::experiment("z_sine").controller, attended) {}

  /// Ticks of this phase until the run is over, at most so many; -1 when it is not.
  int ticks(Phase phase, int most, Request request = Request::kNone) {
    for (int i = 1; i <= most; ++i) {
      state.phase = phase;
      const bool over = monitor_.reached(state, request);
      ++state.tick;
      if (over) return i;
    }
    return -1;
  }
  RunResult result() const { return monitor_.result(2'500'000'000); }

  TickState state;

 private:
  RunMonitor monitor_;
};

TEST(RunMonitor, ARunIsOverWhenItIsParked) {
  Told told;
  EXPECT_EQ(told.ticks(Phase::kDisarmed, 20), -1);
  EXPECT_EQ(told.result().cause_tick, 19);  // so far: what it waits for
  EXPECT_EQ(told.ticks(Phase::kRunning, 100), -1);
  EXPECT_EQ(told.result().cause_tick, -1);
  EXPECT_EQ(told.ticks(Phase::kParked, 5), 1);
  const RunResult r = told.result();
  EXPECT_TRUE(r.good());
  EXPECT_EQ(r.ticks, 121);
  EXPECT_NEAR(r.simulated, 1.21, 1e-12);
  EXPECT_NEAR(r.wall, 2.5, 1e-12);
  EXPECT_EQ(r.cause, Check::kCount);
  EXPECT_EQ(r.cause_tick, -1);
}

// A second of the hold is seen; who attends decides by himself.
TEST(RunMonitor, AStopEndsItASecondLater) {
  for (const bool attended : {false, true}) {
    Told told(attended);
    told.ticks(Phase::kRunning, 50);
    told.state.cause = Check::kPositionError;
    told.state.cause_tick = 50;
    EXPECT_EQ(told.ticks(Phase::kStopped, 500), attended ? -1 : 101);
    const RunResult r = told.result();
    EXPECT_FALSE(r.good());
    EXPECT_EQ(r.cause, Check::kPositionError);
    EXPECT_EQ(r.cause_tick, 50);
    EXPECT_EQ(told.ticks(Phase::kStopped, 5, Request::kStop), 1);
    // Reset: what it was stopped by is past, and one that is let go then has ended well.
    EXPECT_EQ(told.ticks(Phase::kDisarmed, 1, Request::kStop), 1);
    EXPECT_EQ(told.result().cause, Check::kCount);
    EXPECT_TRUE(told.result().good());
  }
}

TEST(RunMonitor, WhatNeverArmsIsGivenUpAndSaysWhy) {
  Told told;
  told.state.tripped.require(Check::kStale, false);
  EXPECT_EQ(told.ticks(Phase::kDisarmed, 2000), 501);
  EXPECT_FALSE(told.result().good());
  EXPECT_EQ(told.result().cause, Check::kStale);
  EXPECT_EQ(told.result().cause_tick, 500);
  // A hold was ordered: somebody is there.
  Told watched;
  watched.ticks(Phase::kDisarmed, 1, Request::kHold);
  EXPECT_EQ(watched.ticks(Phase::kDisarmed, 2000), -1);
}

class Folders : public testing::Test {
 protected:
  void SetUp() override { fs::create_directory(root_); }
  void TearDown() override { fs::remove_all(root_); }
  fs::path root_ = fs::temp_directory_path() / fmt::format("ves_run_{}", getpid());
};

TEST_F(Folders, ANewOneHasTheNameOrTheNextNumber) {
  EXPECT_EQ(claimNewFolder(root_ / "a" / "run"), root_ / "a" / "run");
  EXPECT_EQ(claimNewFolder(root_ / "a" / "run"), root_ / "a" / "run-2");
  EXPECT_EQ(claimNewFolder(root_ / "a" / "run"), root_ / "a" / "run-3");
  EXPECT_EQ(std::distance(fs::directory_iterator(root_ / "a"), {}), 3);
}

TEST_F(Folders, WhatIsInTheWayIsNamed) {
  std::ofstream(root_ / "file") << "1";
  const std::string file = (root_ / "file").string();
  EXPECT_NE(test::refusal([&] { makeFolder(file); }).find("--out " + file), std::string::npos);
  const std::string taken = (root_ / "run").string();
  claimFolder(taken);
  EXPECT_NE(test::refusal([&] { claimFolder(taken); }).find("another run is writing there"),
            std::string::npos);
}

// Where nobody watches, a line for each part of a run.
TEST(Progress, HasALineForEachPart) {
  if (isatty(STDERR_FILENO)) GTEST_SKIP() << "on a terminal it is one line";
  const Experiment e = test::experiment("z_sine");
  ASSERT_EQ(e.controller.program.segments[0].kind, SegmentKind::kMove);
  const double x[6] = {0.001, 0.0, -0.0203, 0.0, 0.0, M_PI / 6.0};
  testing::internal::CaptureStderr();
  Progress progress(e);
  for (int tick = 0; tick < 3; ++tick) progress.show(Phase::kArmed, -1, tick, x);
  for (int tick = 3; tick < 6; ++tick) progress.show(Phase::kRunning, 0, tick, x);
  for (int tick = 6; tick < 9; ++tick) progress.show(Phase::kRunning, 1, tick, x);
  progress.end();
  const std::string all = testing::internal::GetCapturedStderr();
  std::vector<std::string> lines;
  std::istringstream in(all);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 4U) << all;
  EXPECT_NE(lines[0].find("alpha"), std::string::npos);
  EXPECT_NE(lines[1].find("0.00 s armed"), std::string::npos);
  EXPECT_NE(lines[2].find("0.03 s move (1 of 2)"), std::string::npos) << lines[2];
  EXPECT_NE(lines[3].find("0.06 s"), std::string::npos);
  EXPECT_NE(lines[3].find("+1.0"), std::string::npos);
  EXPECT_NE(lines[3].find("-20.3 mm"), std::string::npos) << lines[3];
  EXPECT_NE(lines[3].find("+30.00 deg"), std::string::npos) << lines[3];
  // The numbers end where their names do.
  const auto end = [&](int line, const std::string& of) {
    return lines[static_cast<std::size_t>(line)].find(of) + of.size();
  };
  for (const auto& [name, number] : {std::pair{"x", "+1.0"}, {" z", "-20.3"}, {"gamma", "+30.00"}})
    EXPECT_EQ(end(0, name), end(3, number)) << name;
}

// Each stop has its own record, of the five seconds before it, oldest first.
TEST_F(Folders, AFlightRecordIsOfTheLastFiveSecondsOfEachStop) {
  const Experiment e = test::experiment("z_sine");
  {
    FlightRecord flight(e, root_);
    std::int64_t tick = 0;
    const auto live = [&](Phase phase, int ticks, std::int64_t cause) {
      for (int i = 0; i < ticks; ++i, ++tick) {
        state_t state{};
        sample_t sample{};
        state.header.sequence = state.count = tick;
        state.header.time_ns = tick * e.controller.period;
        sample.header.sequence = state.sample_sequence = tick;
        state.phase = static_cast<int>(phase);
        state.cause_tick = cause;
        flight.keep(state, sample);
      }
    };
    live(Phase::kRunning, 730, -1);
    live(Phase::kStopped, 40, 730);
    live(Phase::kRunning, 100, -1);
    live(Phase::kStopped, 10, 870);  // it ends before the moment is over
  }
  const auto ticks = [&](int stop) {
    std::vector<std::int64_t> out;
    for (const Row& row : readSeries((root_ / fmt::format("flight-{}.lcmlog", stop)).string()).rows)
      out.push_back(row.state.count);
    return out;
  };
  const std::vector<std::int64_t> first = ticks(730), second = ticks(870);
  ASSERT_EQ(first.size(), 500U);
  EXPECT_TRUE(std::is_sorted(first.begin(), first.end()));
  EXPECT_EQ(first.back(), 750);
  EXPECT_EQ(first.front(), 251);
  ASSERT_EQ(second.size(), 129U);  // since the record before
  EXPECT_EQ(second.front(), 751);
  EXPECT_EQ(second.back(), 879);
}

// --- The table of faults -------------------------------------------------------------------------

FaultOutcome outcomeOf(const std::string& id, const std::vector<std::string>& sets,
                       double amplitude = 1.0) {
  FaultBench bench;
  bench.config = test::configDir();
  bench.sets = sets;
  bench.amplitude = amplitude;
  for (const FaultRow& row : faultTable(bench))
    if (row.id == id) return row.run();
  ADD_FAILURE() << "no row " << id;
  return {};
}

// ctest runs the table on a machine that reacts to all of it; here each row meets one whose check
// is out of reach, or trips too soon.
TEST(FaultTable, SaysSoWhereTheReactionIsGone) {
  const std::string calm = "safety.position_error_m=9",
                    calm_at_rest = "safety.position_error_still_m=9";
  const std::vector<std::pair<const char*, std::vector<std::string>>> gone = {
      {"F1", {"safety.stale_ticks=0"}},
      {"F2", {"safety.stale_ticks=1000"}},
      {"F3", {"safety.frozen_samples=1000"}},
      {"F5", {"safety.start_force_n=10000"}},
      {"F8", {"safety.stale_ticks=1000"}},
      {"F8", {"safety.stale_ticks=6"}},  // stopped, but too late
      {"F10b", {"safety.reading_jump_m=9"}},
      {"F11", {"safety.reading_patience=0"}},
      {"F11b", {"safety.reading_jump_m=9"}},
      {"F12", {calm, calm_at_rest}},
      {"F16", {"safety.stall_ticks=1000"}},
      {"F16", {"safety.stall_ticks=1000", "safety.leg_velocity_m_per_s=10"}},  // no burst, no stop
      {"F17", {"safety.overruns_per_second=0"}},
      {"F17b", {"safety.overruns_per_second=1000"}},
      {"F28", {"safety.leg_velocity_m_per_s=10", "safety.flow_l_per_s=1000"}},
      {"F31", {"safety.pressure_min_v=-10"}},
      {"F31b", {"safety.pressure_min_v=-10"}},
      {"F38", {"safety.pressure_min_v=-10"}}};  // stopped, but pressure is not recorded
  for (const auto& [id, sets] : gone) {
    const FaultOutcome seen = outcomeOf(id, sets);
    EXPECT_FALSE(seen.as_expected) << id << " with " << sets.front() << ": " << seen.what;
  }
}

TEST(FaultTable, TellsWhatWasMeasured) {
  // Samples stop two seconds into the segment, with that tick's.
  for (const int limit : {2, 4}) {
    const FaultOutcome stale = outcomeOf("F8", {fmt::format("safety.stale_ticks={}", limit)});
    EXPECT_TRUE(stale.as_expected) << stale.what;
    EXPECT_EQ(stale.ticks, limit);
    EXPECT_EQ(stale.period, 0.01);
  }
  // A swing of 0.2 m times the share that is asked for; the legs lag in proportion.
  const double whole = outcomeOf("F31", {"safety.pressure_min_v=-10"}).peak_deviation;
  EXPECT_GT(whole, 0.02);
  EXPECT_LT(whole, 0.1);
  for (const double share : {0.5, 0.25}) {
    const FaultOutcome part = outcomeOf("F31", {"safety.pressure_min_v=-10"}, share);
    const std::size_t at = part.what.find("at most ");
    ASSERT_NE(at, std::string::npos) << part.what;
    EXPECT_NEAR(std::stod(part.what.substr(at + 8)), 200.0 * share, 2.0) << part.what;
    EXPECT_NEAR(part.peak_deviation, whole * share, 0.02 * whole * share) << share;
  }
}

TEST(Soak, IsTheSameForOneSeedAndCountsWhatItDid) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  std::vector<std::int64_t> told;
  const SoakResult first = soak(e, 5'000, 1, [&](std::int64_t tick) { told.push_back(tick); }),
                   again = soak(e, 5'000, 1, nullptr), other = soak(e, 5'000, 2, nullptr);
  EXPECT_EQ(told, std::vector<std::int64_t>({0}));
  EXPECT_EQ(first.ticks, 5'000);
  EXPECT_EQ(first.violated, "");
  EXPECT_GT(first.faults, 0);
  EXPECT_GE(first.stops, first.recoveries);
  EXPECT_GT(first.recoveries, 0);
  EXPECT_EQ(first.hash, again.hash);
  EXPECT_NE(first.hash, other.hash);
}

}  // namespace
}  // namespace ves
