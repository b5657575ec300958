// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <random>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/ordered_log.hpp"
#include "ves/run/flight_record.hpp"
#include "ves/run/replay.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

class Replay : public testing::Test {
 protected:
  void SetUp() override {
    log_ = temporary("log");
    edited_ = temporary("edited");
    LogWriter writer(log_);
    runLockstep(experiment("puma_on_table_4_1"), &writer, nullptr);
  }
  void TearDown() override {
    fs::remove(log_);
    fs::remove(edited_);
  }
  static std::string temporary(const char* what) {
    return (fs::temp_directory_path() / ("ves_replay_" + std::to_string(getpid()) + what)).string();
  }
  static Experiment experiment(const std::string& name, const std::vector<std::string>& set = {}) {
    return test::experiment(name, set);
  }

  /// Copies the log, event by event; `edit` may change an event, or drop it by returning false.
  void copy(const std::function<bool(LogEvent&)>& edit) {
    LogReader reader(log_);
    LogWriter writer(edited_);
    LogEvent event;
    while (reader.next(event))
      if (edit(event))
        writer.write(event.channel, event.data.data(), static_cast<std::int64_t>(event.data.size()),
                     event.time_us * 1000);
  }
  static std::string refusal(const std::string& log) {
    return test::refusal([&] { replay(log, {}, nullptr); });
  }
  std::string log_, edited_;
};

TEST_F(Replay, RepeatsEveryStateAndCommand) {
  const ReplayResult r = replay(log_, {}, nullptr);
  EXPECT_GT(r.ticks, 1900);
  EXPECT_EQ(r.messages, 2 * r.ticks);
  EXPECT_EQ(r.different, 0);
  EXPECT_TRUE(r.pose_difference.isZero(0.0));
  EXPECT_EQ(r.phase, Phase::kParked);
}

// Two loggers' files put together, a network that delays: repeats and order are told by sequences.
TEST_F(Replay, RepeatsALogWhoseEventsCameTwiceOrLate) {
  std::vector<LogEvent> events;
  copy([&](LogEvent& event) {
    events.push_back(event);
    return false;
  });
  std::vector<std::pair<double, LogEvent>> late;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> delay(0.0, 8.0);  // [-] events
  for (std::size_t i = 0; i < events.size(); ++i)
    for (int copies = 0; copies < 2; ++copies)
      late.emplace_back(static_cast<double>(i) + (i > 10 ? delay(random) : 0.0), events[i]);
  std::stable_sort(late.begin(), late.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  {
    LogWriter writer(edited_);
    for (const auto& [when, event] : late)
      writer.write(event.channel, event.data.data(), static_cast<std::int64_t>(event.data.size()),
                   event.time_us * 1000);
  }
  const ReplayResult whole = replay(log_, {}, nullptr), r = replay(edited_, {}, nullptr);
  EXPECT_EQ(r.ticks, whole.ticks);
  EXPECT_EQ(r.messages, whole.messages);
  EXPECT_EQ(r.different, 0);
  const Series straight = readSeries(log_), put_right = readSeries(edited_);
  ASSERT_EQ(put_right.rows.size(), straight.rows.size());
  const std::vector<Column> all = columns(straight.experiment);
  for (std::size_t i = 0; i < straight.rows.size(); ++i)
    ASSERT_EQ(csvRow(all, put_right.rows[i]), csvRow(all, straight.rows[i])) << i;
}

// Who reads along does not wait for good for a tick that is lost.
TEST_F(Replay, ALostTickIsWaitedForNoLongerThanSixtyFour) {
  std::int64_t ticks = 0;
  copy([&](const LogEvent& event) {
    if (event.channel != channel::kState) return true;
    ++ticks;
    return event.as<state_t>()->count != 5;
  });
  std::int64_t given = 0, sample = 0, furthest = 0;
  OrderedLog reader(edited_);
  for (LogEvent event; reader.next(event);) {
    if (event.channel == channel::kState) {
      given = event.as<state_t>()->count;
      EXPECT_NE(given, 5);
    }
    if (event.channel == channel::kSample) sample = event.as<sample_t>()->header.sequence;
    furthest = std::max(furthest, sample - given);
  }
  EXPECT_EQ(given, ticks - 1);
  EXPECT_GT(furthest, 60);
  EXPECT_LT(furthest, 70);
}

// A tick whose sample is late runs on that of the tick before.
TEST(FlightRecord, HoldsASampleOnceHoweverManyTicksRanOnIt) {
  constexpr int kTicks = 40, kStop = 3;
  const fs::path folder = fs::temp_directory_path() / ("ves_flight_" + std::to_string(getpid()));
  fs::create_directory(folder);
  const Experiment e = test::experiment("z_sine");
  std::optional<FlightRecord> flight(std::in_place, e, folder);
  for (int k = 0; k < kTicks; ++k) {
    state_t state{};
    sample_t sample{};
    state.header.sequence = state.count = k;
    state.header.time_ns = k * e.controller.period;
    sample.header.sequence = state.sample_sequence = k - k % 3;
    if (k >= kStop) state.phase = static_cast<int>(Phase::kStopped);
    state.cause_tick = kStop;
    flight->keep(state, sample);
  }
  flight.reset();
  const Series series = readSeries((folder / "flight-3.lcmlog").string());
  EXPECT_FALSE(series.damage.any()) << series.damage.first();
  EXPECT_EQ(series.rows.size(), kStop + 21u);
  for (const Row& row : series.rows) EXPECT_TRUE(row.has_sample) << row.state.count;
  fs::remove_all(folder);
}

TEST_F(Replay, ALogWithoutAConfigurationIsReadWithOne) {
  copy([](const LogEvent& event) { return event.channel != channel::kExperiment; });
  EXPECT_NE(test::refusal([&] { readSeries(edited_); }).find("--scenario"), std::string::npos);
  const Experiment e = experiment("puma_on_table_4_1");
  EXPECT_EQ(readSeries(edited_, &e).rows.size(), readSeries(log_).rows.size());
}

TEST_F(Replay, RepeatsARunWithEverythingBeyondTheReport) {  // with times that are not the tick's
  const Experiment e = experiment(
      "srms_capture_doss",
      {"controller.compensation.feed_forward=true", "controller.compensation.observer=true",
       "controller.compensation.inertia=true", "controller.compensation.adaptation=true",
       "controller.compensation.wrench=aided", "sensor.readings_per_tick=4",
       "program=[{move: {}, faults: [{at_s: 0, duration_s: 100, fault: samples_late, samples: 2}]},"
       " {calibration: {}}, {admittance: {duration_s: 3}, robot: [{at_s: 0, duration_s: 2, joint: "
       "joint_3, to_deg_or_m: -30}]}]"});
  {
    LogWriter writer(log_);
    runLockstep(e, &writer, nullptr);
  }
  const ReplayResult r = replay(log_, {}, nullptr);
  EXPECT_GT(r.ticks, 500);
  EXPECT_EQ(r.different, 0);
  EXPECT_EQ(r.phase, Phase::kParked);
}

TEST_F(Replay, OneFlippedBitInASampleIsFoundInItsTick) {
  for (std::int64_t tick : {300, 700, 1500}) {
    copy([&](LogEvent& event) {
      if (event.channel != channel::kSample) return true;
      auto m = *event.as<sample_t>();
      if (m.answers != tick - 1) return true;
      m.adc[2] ^= 1;
      m.encode(event.data.data(), 0, static_cast<int>(event.data.size()));
      return true;
    });
    const ReplayResult r = replay(edited_, {}, nullptr);
    ASSERT_TRUE(r.first) << tick;
    EXPECT_EQ(r.first->tick, tick);
    EXPECT_EQ(r.first->field.rfind("state_t.total", 0), 0u) << r.first->field;
    EXPECT_NE(r.first->recorded, r.first->replayed);
  }
}

TEST_F(Replay, OneFlippedBitInACommandIsFoundInItsTick) {
  copy([&](LogEvent& event) {
    if (event.channel != channel::kLegCommand) return true;
    auto m = *event.as<leg_command_t>();
    if (m.header.sequence == 1234) m.counts[4] ^= 1;
    m.encode(event.data.data(), 0, static_cast<int>(event.data.size()));
    return true;
  });
  const ReplayResult r = replay(edited_, {}, nullptr);
  EXPECT_EQ(r.different, 1);
  ASSERT_TRUE(r.first);
  EXPECT_EQ(r.first->tick, 1234);
  EXPECT_EQ(r.first->field, "leg_command_t.counts[4]");
}

TEST_F(Replay, SaysWhatALogLacks) {
  copy([](LogEvent& event) { return event.channel != channel::kExperiment; });
  EXPECT_NE(refusal(edited_).find("before any configuration"), std::string::npos);
  copy([](LogEvent& event) { return event.channel != channel::kState; });
  EXPECT_NE(refusal(edited_).find("no tick of a controller"), std::string::npos);
  int n = 0;
  copy([&](LogEvent& event) { return event.channel != channel::kState || ++n > 57; });
  EXPECT_NE(refusal(edited_).find("begins 57 ticks after its controller"), std::string::npos);
  n = 0;
  copy([&](LogEvent& event) { return event.channel != channel::kState || ++n != 57; });
  EXPECT_NE(refusal(edited_).find("1 ticks before tick 57 are missing"), std::string::npos);
  n = 0;
  copy([&](LogEvent& event) { return event.channel != channel::kSample || ++n != 57; });
  EXPECT_NE(refusal(edited_).find("tick 56 used sample 56, which is not in this log"),
            std::string::npos);
}

TEST_F(Replay, AnotherConfigurationShowsWhatItWouldHaveDone) {
  // A base twice as stiff in x, under the same measured wrenches.
  const Experiment other = experiment(
      "puma_on_table_4_1", {"base.stiffness_diagonal=[3000, 2500, 4000, 1500, 1000, 2000]"});
  ReplayOptions options;
  options.with = &other;
  const ReplayResult r = replay(log_, options, nullptr);
  EXPECT_GT(r.pose_difference(0), 0.01);
  EXPECT_LT(r.pose_difference(2), 1e-3);
}

}  // namespace
}  // namespace ves
