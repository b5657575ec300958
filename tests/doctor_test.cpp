// SPDX-License-Identifier: BSD-3-Clause
//
// What the doctor makes of what it measures.
#include "ves/doctor/doctor.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <functional>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

// What it waited for and what it passed over are all periods since it began, whatever else the
// machine does meanwhile.
TEST(Ticker, CountsEveryPeriodOnceAndSaysHowLateItWoke) {
  constexpr std::int64_t kPeriod = 4'000'000;  // [ns]
  const std::int64_t before = monotonicNow();
  Ticker ticker(kPeriod);
  const std::int64_t begun = monotonicNow();
  std::int64_t periods = 0, missed = 0;
  for (int i = 0; i < 12; ++i) {
    const std::int64_t over = monotonicNow();
    if (i % 4 == 3)  // a tick that takes three and a half
      while (monotonicNow() < over + 7 * kPeriod / 2) {
      }
    const std::int64_t passed = ticker.wait();
    const std::int64_t now = monotonicNow();
    if (i % 4 == 3) {
      EXPECT_GE(passed, 2);
    }
    missed += passed;
    periods += passed + 1;
    EXPECT_EQ(ticker.missed(), missed);
    EXPECT_GE(now, before + periods * kPeriod);  // never too soon
    EXPECT_GE(ticker.late(), 0);
    EXPECT_LE(ticker.late(), now - (before + periods * kPeriod));
    EXPECT_GE(ticker.late(), over - (begun + periods * kPeriod));
    // The next one's time has not come yet, or it would have been passed over.
    EXPECT_LE(over, begun + periods * kPeriod + kPeriod);
  }
}

/// In a process of its own, without the right to either: 0 where claimRealtime() did as it should.
int refusedRealtime() {
  const rlimit none{0, 0};
  setrlimit(RLIMIT_RTPRIO, &none);
  setrlimit(RLIMIT_MEMLOCK, &none);
  if (geteuid() == 0 && setuid(65534) != 0) return 77;
  const std::string said = claimRealtime(80, false);
  if (said.find("SCHED_FIFO refused: ") != 0) return 1;
#ifndef VES_SANITIZE  // under whose sanitizers nobody locks memory, nor is refused it
  if (said.find("; locked memory refused: ") == std::string::npos) return 1;
#endif
  try {
    claimRealtime(80, true);
  } catch (const InputError& error) {
    return error.what() == "--realtime: " + said + " (see ulimit -r and -l, or run as root)" ? 0
                                                                                             : 2;
  }
  return 3;
}

TEST(ClaimRealtime, SaysAllThatIsRefusedAndThrowsWhereItIsRequired) {
  EXPECT_EXIT(_exit(refusedRealtime()), testing::ExitedWithCode(0), "");
}

TEST(Latency, IsTheOrderStatistics) {
  std::vector<double> all;
  for (int i = 1000; i >= 0; --i) all.push_back(i * 1e-6);
  const Latency l = latencyOf(all);
  EXPECT_EQ(l.n, 1001);
  EXPECT_DOUBLE_EQ(l.median, 500e-6);
  EXPECT_DOUBLE_EQ(l.p99, 990e-6);
  EXPECT_DOUBLE_EQ(l.max, 1000e-6);
  EXPECT_EQ(latencyOf({}).n, 0);
}

TEST(Cyclictest, HistogramIsReadWithWhatOverflowedIt) {
  const auto l = cyclictestLatency(
      "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000010 000090\n"
      "000020 000008\n# Total: 000000098\n# Min Latencies: 00010\n# Avg Latencies: 00011\n"
      "# Max Latencies: 02425\n# Histogram Overflows: 00002\n");
  ASSERT_TRUE(l.has_value());
  EXPECT_EQ(l->n, 100);
  EXPECT_DOUBLE_EQ(l->median, 10e-6);
  EXPECT_DOUBLE_EQ(l->p99, 2425e-6);
  EXPECT_DOUBLE_EQ(l->max, 2425e-6);
  EXPECT_FALSE(cyclictestLatency("").has_value());
  EXPECT_FALSE(cyclictestLatency("unable to set scheduling\n000010 -1\n").has_value());
}

/// Of a machine that lacks nothing, but for what `change` takes from it.
Finding found(const std::string& what, const std::function<void(MachineFacts&)>& change) {
  MachineFacts m{"Linux 6, RT", true, 2,       "performance",  1, "tsc", true,
                 true,          99,   1 << 30, 2 * 1024 * 1024};
  for (const Finding& f : examine(m)) {
    EXPECT_EQ(f.state, Finding::State::kGood) << f.what;
    EXPECT_EQ(f.remedy, "") << f.what;
  }
  change(m);
  Finding out;
  for (const Finding& f : examine(m)) {
    if (f.what == what) {
      out = f;
      continue;
    }
    EXPECT_EQ(f.state, Finding::State::kGood) << f.what << " beside " << what;
  }
  EXPECT_EQ(out.state == Finding::State::kGood, out.remedy.empty()) << what;
  return out;
}

TEST(Examination, OneThingThatIsMissingIsSaidWithItsRemedy) {
  using State = Finding::State;
  struct Case {
    const char* what;
    std::function<void(MachineFacts&)> change;
    State state;
    const char *said, *remedy;
  };
  const Case cases[] = {
      {"kernel", [](auto& m) { m.real_time_kernel = false; }, State::kAdvice, "Linux 6, RT",
       "linux-image-rt"},
      {"processors", [](auto& m) { m.processors = 1; }, State::kAdvice, "1, governor performance",
       "share one core"},
      {"processors", [](auto& m) { m.governor = "powersave"; }, State::kAdvice,
       "2, governor powersave", "frequency-set -g performance"},
      {"processors", [](auto& m) { m.governor = ""; }, State::kGood, "2", ""},
      {"clock", [](auto& m) { m.clock_resolution = 1001; }, State::kBad,
       "monotonic, 1001 ns, source tsc", "highres=off"},
      {"clock", [](auto& m) { m.clock_resolution = 1000; }, State::kGood, "1000 ns", ""},
      {"clock", [](auto& m) { m.clock_resolution = 4'000'000; }, State::kBad, "4000000 ns",
       "highres=off"},
      {"clock", [](auto& m) { m.clock_source = "hpet"; }, State::kAdvice, "source hpet",
       "clocksource=tsc"},
      {"clock", [](auto& m) { m.clock_source = "acpi_pm"; }, State::kAdvice, "source acpi_pm",
       "clocksource=tsc"},
      {"clock", [](auto& m) { m.clock_source = ""; }, State::kGood, "1 ns", ""},
      {"scheduler", [](auto& m) { m.fifo = false; }, State::kAdvice, "ulimit -r is 99",
       "rtprio 99"},
      {"memory", [](auto& m) { m.lockable = false; }, State::kAdvice, "1048576 KiB",
       "memlock unlimited"},
      {"socket buffers", [](auto& m) { m.socket_buffer = 2 * 1024 * 1024 - 1; }, State::kAdvice,
       "2047 KiB", "rmem_max=2097152"},
  };
  for (const Case& c : cases) {
    const Finding f = found(c.what, c.change);
    EXPECT_EQ(f.state, c.state) << c.what << ": " << f.found;
    EXPECT_NE(f.found.find(c.said), std::string::npos) << f.found;
    EXPECT_NE(f.remedy.find(c.remedy), std::string::npos) << f.remedy;
  }
}

TEST(Examination, ReadsWhatTheShellSays) {
  const MachineFacts m = readMachineFacts();
  const auto said = [](const std::string& command) {
    std::string text = test::sh(command).text;
    while (!text.empty() && text.back() == '\n') text.pop_back();
    return text;
  };
  EXPECT_EQ(m.kernel, said("uname -s") + " " + said("uname -r") + ", " + said("uname -v"));
  EXPECT_EQ(std::to_string(m.processors), said("nproc"));
  // Where there is no such file, nothing is known.
  const auto standing = [&](const std::string& file) {
    return said("cat " + file + " 2>/dev/null || true");
  };
  EXPECT_EQ(m.socket_buffer, std::atol(standing("/proc/sys/net/core/rmem_max").c_str()));
  EXPECT_EQ(m.clock_source,
            standing("/sys/devices/system/clocksource/clocksource0/current_clocksource"));
  const auto limit = [&](const char* option, std::uint64_t unit) {
    const std::string text = said(std::string("ulimit ") + option);
    return text == "unlimited" ? UINT64_MAX / unit : std::stoull(text);
  };
  EXPECT_EQ(m.priority_limit, limit("-r", 1));
  EXPECT_EQ(m.lock_limit / 1024, limit("-l", 1024));
  EXPECT_EQ(m.fifo, test::sh("chrt -f 80 true").status == 0);
}

// Asked for so many, there are so many, and none is longer than the whole took.
TEST(BusTimes, AreOfAsManyAsWereAskedFor) {
  const std::int64_t began = monotonicNow();
  const auto all = [&](const char* what, const Latency& l, int n) {
    EXPECT_EQ(l.n, n) << what;
    EXPECT_GT(l.median, 0.0) << what;
    EXPECT_GE(l.p99, l.median) << what;
    EXPECT_GE(l.max, l.p99) << what;
    EXPECT_LT(l.max, static_cast<double>(monotonicNow() - began) * kSecondPerNanosecond) << what;
  };
  constexpr std::int64_t kPeriod = 2'000'000;  // [ns]
  all("wakes", wakeUp(0.1, kPeriod), 50);
  EXPECT_GT(monotonicNow() - began, 50 * kPeriod);  // it does wait
  enterPrivateBus();
  all("echo", echo(kDefaultUrl, 30), 30);
  all("response", response(test::experiment("z_sine"), kDefaultUrl, 30), 30);
}

class Doctor : public test::Programs {};

TEST_F(Doctor, RefusesTimesThatAreNone) {
  EXPECT_EQ(test::sh(app("doctor") + "--seconds nan").status, 2);
  EXPECT_EQ(test::sh(app("doctor") + "--seconds 0").status, 2);
}

TEST_F(Doctor, SaysWhatItFoundAndWhatToDo) {
  const test::Output o = test::sh(app("doctor") + "--seconds 0.3");
  // The status says whether anything printed is bad.
  EXPECT_EQ(o.status, o.text.find("BAD") == std::string::npos ? 0 : 1) << o.text;
  for (const char* line :
       {"kernel", "processors", "clock", "scheduler", "memory", "socket buffers", "bus"})
    EXPECT_NE(o.text.find(line), std::string::npos) << o.text;
  if (o.text.find("BAD    bus") != std::string::npos) return;
  for (const char* line : {"a bare ticker wakes", "cyclictest", "LCM there and back"})
    EXPECT_NE(o.text.find(line), std::string::npos) << o.text;
}

}  // namespace
}  // namespace ves
