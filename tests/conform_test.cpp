// SPDX-License-Identifier: BSD-3-Clause
//
// A machine that keeps all requirements of docs/machine.md, and one for each that breaks it.
#include "ves/doctor/conform.hpp"
#include "ves/run/announcer.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <set>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "ves/bus/bus.hpp"

namespace ves {
namespace {

using Names = std::set<std::string>;

setup_t setup() {
  return toMessage(setupOf(test::experiment("puma_on_table_4_1"), false), header({1, 1}, 0, 0));
}

/// Two seconds of a good machine at `rate`, spoilt sample by sample. `spoil` may drop a sample
/// (false).
std::vector<Requirement> judged(const std::function<bool(int, sample_t&)>& spoil, double rate) {
  const setup_t s = setup();
  SampleJudge judge(s, 0);
  const auto period = static_cast<std::int64_t>(1e9 / rate);
  const int count = static_cast<int>(2.0 * rate);
  for (int i = 0; i < count; ++i) {
    sample_t m{};
    const std::int64_t now = i * period;
    m.header = header({42, 5}, 100 + i, 7'000'000'000 + now);
    m.answers = -1;
    for (int k = 0; k < 6; ++k) m.adc[k] = (i + k) % 5;
    m.adc[6] = (s.pressure_min + s.pressure_max) / 2;
    for (int k = 0; k < 6; ++k) m.legs[k] = s.leg_home[k] + i % 2;
    m.switches = static_cast<int>(kAllSwitchesClosed);
    m.temperature = 20.0;
    m.legs_time_ns = m.wrench_time_ns = m.joints_time_ns = m.header.time_ns - 1'000'000;
    m.command_source = s.header.source;
    if (!spoil(i, m)) continue;
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
    m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    judge.take(bytes.data(), std::ssize(bytes), now);
  }
  return judge.verdict(2'000'000'000);
}

/// What is not kept.
Names broken(const std::function<bool(int, sample_t&)>& spoil, double rate = 500.0) {
  Names out;
  for (const Requirement& r : judged(spoil, rate))
    if (!r.kept) out.insert(r.name);
  return out;
}

TEST(Conform, AGoodMachineKeepsAll) {
  const auto good = [](int, sample_t&) { return true; };
  for (const double rate : {95.0, 100.0, 200.0, 500.0, 1000.0})
    EXPECT_EQ(broken(good, rate), Names());
}

/// What is said of a requirement when every sample is spoilt so.
std::string said(const std::string& name, const std::function<void(sample_t&)>& spoil) {
  for (const Requirement& r : judged(
           [&](int, sample_t& m) {
             spoil(m);
             return true;
           },
           500.0))
    if (r.name == name) return r.found;
  return "(nothing)";
}

TEST(Conform, SaysWhichValueIsOutOfRange) {
  const setup_t s = setup();
  const auto nothing = [](sample_t&) {};
  EXPECT_EQ(said("ranges", nothing), "all within");
  EXPECT_EQ(said("joints", nothing), "all");
  EXPECT_EQ(said("force sensor", nothing), "0 channels stand");
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.adc[0] = -32769; }), "adc[0] -32769");
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.adc[6] = 32768; }), "adc[6] 32768");
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.legs[0] = -1; }), "legs[0] -1");
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.legs[5] = kMaxLegCount + 1; }),
            fmt::format("legs[5] {}", kMaxLegCount + 1));
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.q[0] = NAN; }), "q[0] nan");
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.q[kMaxJoints - 1] = -2e3; }),
            fmt::format("q[{}] -2000", kMaxJoints - 1));
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.faults = 8; }), "faults 8");
  EXPECT_EQ(said("ranges", [](sample_t& m) { m.temperature = NAN; }), "temperature nan");
  EXPECT_EQ(said("joints", [](sample_t& m) { m.q[6] = 0.5; }),
            "q[6] 0.5 of a joint that is not there");
  EXPECT_EQ(said("joints", [](sample_t& m) { m.q[0] = 10.0; }),
            fmt::format("q[0] 10, limits [{:.4g}, {:.4g}]", s.joint_min[0], s.joint_max[0]));
  // A stroke has two ends, of every leg; the ends themselves belong to it.
  for (int i : {0, 5}) {
    const auto at = [&](std::int64_t count) {
      return broken([&](int, sample_t& m) {
        m.legs[i] = static_cast<std::int32_t>(count);
        return true;
      });
    };
    EXPECT_EQ(at(s.leg_min[i]), Names());
    EXPECT_EQ(at(s.leg_max[i]), Names());
    EXPECT_EQ(at(s.leg_min[i] - 1), Names({"stroke"}));
    EXPECT_EQ(at(s.leg_max[i] + 1), Names({"stroke"}));
  }
}

TEST(Conform, SaysHowManyWereLostAndHowManyWereNotNewer) {
  SampleJudge judge(setup(), 0);
  for (const int sequence : {10, 11, 15, 16, 16, 14, 17, 20}) {
    sample_t m{};
    m.header = header({42, 5}, sequence, 7'000'000'000 + 2'000'000 * sequence);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
    m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    judge.take(bytes.data(), std::ssize(bytes), 2'000'000 * sequence);
  }
  std::string found;
  for (const Requirement& r : judge.verdict(50'000'000))
    if (r.name == "sequence") found = r.found;
  // 12 to 14; 15 and 16, counted from the 14 that came last; 18 and 19.
  EXPECT_EQ(found, "2 not newer; 7 lost on the way");
}

TEST(Conform, WhatIsNotKeptIsNamedAndNothingElse) {
  const auto at = [](int when, const std::function<void(sample_t&)>& spoil) {
    return [=](int i, sample_t& m) {
      if (i == when) spoil(m);
      return true;
    };
  };
  EXPECT_EQ(broken([](int, sample_t&) { return true; }, 80.0), Names({"ticks in a row"}));
  EXPECT_EQ(broken([](int i, sample_t&) { return i < 400 || i > 500; }), Names({"longest gap"}));
  EXPECT_EQ(broken([](int i, sample_t&) { return i < 900; }), Names({"longest gap"}));
  EXPECT_EQ(broken([](int i, sample_t&) { return i % 3 != 0; }), Names());  // lost on the way
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.header.sequence -= 50; })), Names({"sequence"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.header.source = 43; })), Names({"source"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.header.epoch = 6; })), Names({"source"}));
  EXPECT_EQ(broken([](int, sample_t& m) {
              m.header.epoch = 0;
              return true;
            }),
            Names({"epoch"}));
  EXPECT_EQ(broken([](int i, sample_t& m) {
              if (i > 400) m.header.time_ns = 1;
              m.legs_time_ns = m.wrench_time_ns = m.joints_time_ns = 0;
              return true;
            }),
            Names({"clock"}));
  EXPECT_EQ(broken([](int i, sample_t& m) {
              m.header.time_ns += i * 100'000;  // 5 % fast
              m.legs_time_ns = m.wrench_time_ns = m.joints_time_ns = 0;
              return true;
            }),
            Names({"clock"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.adc[2] = 40000; })), Names({"ranges"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.q[1] = NAN; })), Names({"ranges", "joints"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.temperature = NAN; })), Names({"ranges"}));
  const std::int64_t longest = setup().stale_ticks * setup().period_ns;
  for (std::int64_t sample_t::*stamp :
       {&sample_t::legs_time_ns, &sample_t::wrench_time_ns, &sample_t::joints_time_ns}) {
    EXPECT_EQ(broken(at(500, [&](sample_t& m) { m.*stamp = m.header.time_ns + 1; })),
              Names({"ranges"}));
    EXPECT_EQ(broken(at(500, [&](sample_t& m) { m.*stamp = m.header.time_ns - longest; })),
              Names({"pieces"}));
    EXPECT_EQ(broken(at(500, [&](sample_t& m) { m.*stamp = m.header.time_ns - longest + 1; })),
              Names());
    EXPECT_EQ(broken(at(500, [&](sample_t& m) { m.*stamp = 0; })), Names());  // with the sample
  }
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.faults = 2; })), Names({"faults"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.faults = 8; })), Names({"ranges", "faults"}));
  EXPECT_EQ(broken([](int, sample_t& m) {
              m.command_source = 7;
              return true;
            }),
            Names({"names commands"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.switches = 1; })), Names({"safety loops"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.adc[6] = 0; })), Names({"pressure"}));
  EXPECT_EQ(broken([](int, sample_t& m) {
              std::fill(m.adc, m.adc + 6, 12);
              return true;
            }),
            Names({"force sensor"}));
  EXPECT_EQ(broken([](int, sample_t& m) {
              std::fill(m.adc, m.adc + 5, 12);  // one lives
              return true;
            }),
            Names());
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.legs[3] += 3; })), Names({"legs at rest"}));
  EXPECT_EQ(broken([](int, sample_t& m) {
              m.legs[5] = 16000;
              return true;
            }),
            Names({"stroke"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.q[6] = 0.1; })), Names({"joints"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.q[0] = 10.0; })), Names({"joints"}));
  EXPECT_EQ(broken(at(500, [](sample_t& m) { m.answers = 3; })), Names({"answers"}));
  EXPECT_EQ(broken([](int, sample_t&) { return false; }), Names({"samples"}));
}

TEST(Conform, BytesThatAreNoSampleAreCounted) {
  SampleJudge judge(setup(), 0);
  judge.take("nothing", 7, 5);
  const std::vector<Requirement> all = judge.verdict(1'000'000'000);
  ASSERT_EQ(all.size(), 2u);
  EXPECT_FALSE(all[0].kept);
  EXPECT_FALSE(all[1].kept);
  EXPECT_EQ(all[1].found, "1 malformed");
}

/// Told from home away in two seconds and held there; row i of `as` answers leg i, late by `ticks`,
/// and samples come every `every` ticks.
std::string whichLeg(const std::array<int, 6>& as, int ticks, int every = 1,
                     std::int64_t period = 10'000'000) {
  const Vec6 home = Vec6::Constant(1.4);
  Vec6 away;
  away << 0.012, 0.030, 0.027, 0.008, 0.016, 0.005;
  const auto told = [&](int tick) -> Vec6 {
    return home + away * std::clamp(0.5e-9 * static_cast<double>(tick * period), 0.0, 1.0);
  };
  LegJudge judge(period);
  for (int tick = 0; tick * period < 4'000'000'000; ++tick) {
    TickState s;
    s.command.engaged = true;
    s.sample_sequence = tick / every;
    s.legs.L = told(tick);
    const Vec6 late = told(tick / every * every - ticks);
    for (int i = 0; i < 6; ++i) s.L_measured(i) = late(as[static_cast<std::size_t>(i)]) + 4e-4;
    judge.take(s);
  }
  return judge.verdict().kept ? "" : judge.verdict().found;
}

TEST(Conform, AMachineThatAnswersLateStillMovesTheLegsItIsTold) {
  for (const int late : {0, 10, 50}) {
    EXPECT_EQ(whichLeg({0, 1, 2, 3, 4, 5}, late), "") << late;
    EXPECT_EQ(whichLeg({0, 2, 1, 3, 4, 5}, late),
              "leg 2 goes as leg 3 is told, leg 3 goes as leg 2 is told")
        << late;
    EXPECT_EQ(whichLeg({5, 1, 2, 3, 4, 0}, late),
              "leg 1 goes as leg 6 is told, leg 6 goes as leg 1 is told")
        << late;
  }
  EXPECT_EQ(whichLeg({0, 1, 2, 3, 4, 5}, 40, 3), "");
  for (const std::int64_t period :
       {1'000'000, 50'000'000, 1'000'000'000})  // the rates that there are
    EXPECT_EQ(whichLeg({0, 1, 2, 3, 4, 5}, period < 10'000'000 ? 400 : 0, 1, period), "") << period;
  // Too few samples came while it rested: nothing is known.
  EXPECT_EQ(whichLeg({0, 1, 2, 3, 4, 5}, 40, 5), "never at rest away from home");
}

/// On a loaded machine a machine in Python sleeps through its samples now and then; ten in a row
/// come seldom.
class ConformProgram : public test::Programs {
 protected:
  static std::string patient() {
    return test::Programs::patient() + "--set controller.arming_samples=3 ";
  }
};

TEST_F(ConformProgram, OurOwnPlantKeepsAllAndMoves) {
  enterPrivateBus();
  const std::string conform = app("conform") + "z_sine " + patient();
  const test::Output none = test::sh(conform + " --move");
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.text.find("NO samples"), std::string::npos) << none.text;
  EXPECT_NE(none.text.find("nothing was moved"), std::string::npos) << none.text;
  EXPECT_NE(none.text.find("start yours, or ./ves plant z_sine"), std::string::npos) << none.text;
  Process plant = start("plant", {"z_sine"});
  const test::Output all = test::sh(conform + " --move");
  EXPECT_EQ(all.status, 0) << all.text;
  EXPECT_EQ(all.text.find("NO "), std::string::npos) << all.text;
  EXPECT_NE(all.text.find("parked after"), std::string::npos) << all.text;
}

/// Somebody's machine in Python: our template, and one that does one thing wrong.
using PythonMachine = ConformProgram;

TEST_F(PythonMachine, TheTemplateKeepsAllAndMoves) {
  enterPrivateBus();
  Process machine = python("apps/examples/machine.py", {"--rate", "110"});
  const test::Output all = test::sh(app("conform") + "z_sine --move " + patient());
  EXPECT_EQ(all.status, 0) << all.text;
}

TEST_F(PythonMachine, TheTemplateKeepsAllAndMovesWhileThirtyPercentIsLost) {
  enterPrivateBus();
  Process machine = python("apps/examples/machine.py", {"--rate", "500"}, "0.3");
  const test::Output all = test::sh(app("conform") + "z_sine --move " + patient());
  EXPECT_EQ(all.status, 0) << all.text;
}

TEST_F(PythonMachine, TheTemplateIsMeasured) {
  // Its legs follow with a lag of the first order, of 0.05 s.
  enterPrivateBus();
  Process machine = python("apps/examples/machine.py", {"--rate", "200"});
  const test::Output all = test::sh(app("accept") +
                                    "z_sine --move --coordinates z --tests sines --frequencies 2 "
                                    "--amplitudes 1 " +
                                    patient() + out("a"));
  ASSERT_EQ(all.status, 0) << all.text;
  std::ifstream csv(file("a/accept.csv"));
  double gain = NAN;
  for (std::string line; std::getline(csv, line);)
    if (line.starts_with("z,gain,1,")) gain = std::stod(line.substr(9));
  EXPECT_NEAR(gain, 1.0 / std::hypot(1.0, 2.0 * M_PI * 2.0 * 0.05), 0.05);
}

struct Wrong {
  const char* what;
  const char* named;  // requirement
};
std::ostream& operator<<(std::ostream& out, const Wrong& wrong) { return out << wrong.what; }

class WrongMachine : public PythonMachine, public testing::WithParamInterface<Wrong> {};

TEST_P(WrongMachine, IsNamed) {
  enterPrivateBus();
  Process machine = python("tests/support/python/broken_machine.py", {GetParam().what});
  const test::Output all = test::sh(app("conform") + "z_sine --move " + patient());
  EXPECT_EQ(all.status, 1) << all.text;
  std::istringstream lines(all.text);
  std::string line, not_kept;
  while (std::getline(lines, line))
    if (line.rfind("NO ", 0) == 0) not_kept += line + "\n";
  EXPECT_EQ(not_kept.rfind(std::string("NO ") + GetParam().named, 0), 0u) << all.text;
}

INSTANTIATE_TEST_SUITE_P(One, WrongMachine,
                         testing::Values(Wrong{"restart", "source"},
                                         Wrong{"stalled clock", "clock"}, Wrong{"NaN", "ranges"},
                                         Wrong{"epoch 0", "epoch"},
                                         Wrong{"ADC out of range", "ranges"},
                                         Wrong{"keeps its reference", "silence"},
                                         Wrong{"swapped legs", "which leg"}));

}  // namespace
}  // namespace ves
