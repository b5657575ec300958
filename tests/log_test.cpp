// SPDX-License-Identifier: BSD-3-Clause
//
// Logs: what is written comes back; what is damaged is named, and the rest is used.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

using test::refusal;

Sample restingSample() {
  Sample s;
  s.sequence = 7;
  s.legs.fill(8000);
  s.switches = kAllSwitchesClosed;
  return s;
}

class Log : public testing::Test {
 protected:
  void SetUp() override {
    file_ = fs::temp_directory_path() / ("ves_log_" + std::to_string(getpid()) + ".lcmlog");
    LogWriter writer(file_.string());
    for (int i = 0; i < 5; ++i) {
      Sample s = restingSample();
      s.sequence = i;
      writer.write(channel::kSample, toMessage(s, {1, 2}), 1'000'000LL * i);
    }
  }
  void TearDown() override { fs::remove(file_); }

  std::string read() {
    return refusal([&] {
      LogReader reader(file_.string());
      LogEvent event;
      while (reader.next(event)) {
      }
    });
  }
  std::vector<char> bytes() {
    std::ifstream in(file_, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void put(const std::vector<char>& bytes) {
    std::ofstream(file_, std::ios::binary).write(bytes.data(), static_cast<long>(bytes.size()));
  }
  fs::path file_;
};

TEST_F(Log, ReadsWhatWasWritten) {
  LogReader reader(file_.string());
  LogEvent event;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(reader.next(event));
    EXPECT_EQ(event.channel, "VES_SAMPLE");
    EXPECT_EQ(event.time_us, 1000 * i);
    const auto sample = event.as<sample_t>();
    ASSERT_TRUE(sample);
    EXPECT_EQ(sample->header.sequence, i);
  }
  EXPECT_FALSE(reader.next(event));
}

TEST_F(Log, DamageIsNamedWithItsByte) {
  const std::vector<char> good = bytes();
  const std::size_t size = good.size() / 5;  // of an event
  EXPECT_EQ(read(), "");

  std::vector<char> bad = good;
  bad[size] = 'x';  // the second sync word
  put(bad);
  EXPECT_NE(read().find("byte " + std::to_string(size) + ": sync word"), std::string::npos);

  bad = good;
  std::memset(&bad[20], 0x7f, 4);  // length of a channel name that crashes LCM's reader
  put(bad);
  EXPECT_NE(read().find("byte 20: channel name of"), std::string::npos);

  bad = good;
  std::memset(&bad[24], 0xff, 4);
  put(bad);
  EXPECT_NE(read().find("byte 24: message of 4294967295 bytes"), std::string::npos);

  bad.assign(good.begin(), good.end() - 3);
  put(bad);
  EXPECT_NE(read().find("cut short"), std::string::npos);
  bad.assign(good.begin(), good.begin() + 10);
  put(bad);
  EXPECT_NE(read().find("byte 0: 10 bytes left"), std::string::npos);
  put({});
  EXPECT_NE(read().find("empty"), std::string::npos);
  EXPECT_NE(refusal([&] { LogReader(fs::temp_directory_path().string()); }).find("not a file"),
            std::string::npos);
  EXPECT_NE(refusal([&] { LogReader("/no/such.lcmlog"); }).find("no such file"), std::string::npos);
}

// Whatever there is of it, as many places are told as there were.
TEST(Damage, IsCountedWhereItIsNotTold) {
  for (int places = 0; places < 30; ++places) {
    Damage damage;
    for (int i = 0; i < places; ++i) damage.add("place " + std::to_string(i));
    const auto lines = damage.lines();
    int told = static_cast<int>(lines.size());
    if (!lines.empty() && lines.back().starts_with("and "))
      told += std::stoi(lines.back().substr(4)) - 1;
    EXPECT_EQ(told, places);
    EXPECT_LE(lines.size(), 12u);
  }
}

TEST(Recent, KeepsTheLastThousandsAndNoMore) {
  Recent<int> recent;
  for (int i = 0; i < 10'000; ++i) {
    recent.put(i, 2 * i);
    recent.put(i, 3 * i);  // said again
  }
  ASSERT_TRUE(recent.find(9999));
  EXPECT_EQ(*recent.find(9999), 3 * 9999);
  EXPECT_TRUE(recent.find(9000));
  EXPECT_FALSE(recent.find(1000));
}

TEST_F(Log, NoDamageEverCrashesTheReader) {
  const std::vector<char> good = bytes();
  std::mt19937 random(1);
  for (int k = 0; k < 2000; ++k) {
    std::vector<char> bad = good;
    for (unsigned flips = 1 + random() % 8; flips > 0; --flips)
      bad[random() % bad.size()] = static_cast<char>(random());
    if (random() % 3 == 0) bad.resize(random() % bad.size());
    put(bad);
    const std::string message = read();
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

/// The sequences of the samples that can be read, passing over damage.
std::vector<std::int64_t> sequences(const fs::path& file, Damage& damage) {
  std::vector<std::int64_t> out;
  LogReader reader(file.string(), &damage);
  LogEvent event;
  while (reader.next(event)) out.push_back(event.require<sample_t>(file.string()).header.sequence);
  return out;
}

TEST_F(Log, WhatIsWholeIsUsedAndTheRestIsTold) {
  const std::vector<char> good = bytes();
  const std::size_t size = good.size() / 5;
  std::vector<char> bad = good;
  bad[size] = 'x';  // the second sync word
  put(bad);
  Damage damage;
  EXPECT_EQ(sequences(file_, damage), (std::vector<std::int64_t>{0, 2, 3, 4}));
  ASSERT_EQ(damage.lines().size(), 1u);
  EXPECT_NE(damage.first().find("byte " + std::to_string(size) + ": sync word"), std::string::npos);
  EXPECT_NE(damage.first().find(std::to_string(size) + " bytes left out"), std::string::npos);

  bad.assign(good.begin(), good.end() - 3);
  put(bad);
  Damage cut;
  EXPECT_EQ(sequences(file_, cut), (std::vector<std::int64_t>{0, 1, 2, 3}));
  EXPECT_NE(cut.first().find("cut short"), std::string::npos) << cut.first();
}

TEST_F(Log, AFullDiskLosesWholeEventsAndKeepsTheFileWhole) {
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  constexpr std::int64_t kRoom = 25'000;  // [B]
  const rlimit small{kRoom, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  std::int64_t lost = 0, written = 0;
  std::string trouble;
  {
    LogWriter writer(file_.string());
    for (int i = 0; i < 1000; ++i) {
      Sample s = restingSample();
      s.sequence = i;
      writer.write(channel::kSample, toMessage(s, {1, 2}), 10'000'000LL * i);
      if (writer.lost() == 0) written = i + 1;
    }
    writer.flush();
    lost = writer.lost();
    trouble = writer.trouble();
  }
  setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(trouble, std::strerror(EFBIG));
  EXPECT_LT(written, 200);  // noticed at once, not at the end
  EXPECT_EQ(read(), "");
  Damage none;
  const std::vector<std::int64_t> left = sequences(file_, none);
  EXPECT_FALSE(none.any());
  EXPECT_GT(left.size(), 0u);
  EXPECT_EQ(std::ssize(left) + lost, 1000);
}

TEST_F(Log, AFileThatCannotBeIsRefusedWithItsReason) {
  EXPECT_EQ(test::refusal([] { LogWriter("/nonexistent/a.lcmlog"); }),
            "/nonexistent/a.lcmlog: cannot be written: No such file or directory");
}

TEST_F(Log, AnEventReachesTheFileWithinHalfASecondOfLaterOnes) {  // a kill takes no more
  LogWriter writer(file_.string());
  for (int i = 0; i <= 500; ++i) {
    Sample s = restingSample();
    s.sequence = i;
    writer.write(channel::kSample, toMessage(s, {1, 2}), 1'000'000'000'000 + 10'000'000LL * i);
  }
  Damage damage;
  EXPECT_GE(sequences(file_, damage).back(), 450);
}

// --- Series of a run -----------------------------------------------------------------------------

class SeriesOf : public Log {
 protected:
  void SetUp() override {
    Log::SetUp();
    record(0.01);
  }
  void record(double amplitude) {
    LogWriter writer(file_.string());
    runLockstep(test::experiment(
                    "z_sine", {fmt::format("program=[{{trajectory: {{duration_s: 0.5, z: {{sine: "
                                           "{{amplitude_m: {}, frequency_hz: 1}}}}}}}}]",
                                           amplitude)}),
                &writer, nullptr);
  }
  /// Ticks, and what is wrong.
  std::pair<std::size_t, std::string> rows() {
    const Series series = readSeries(file_.string());
    return {series.rows.size(), series.damage.any() ? series.damage.first() : ""};
  }
};

TEST_F(SeriesOf, ACutLogIsItsBeginning) {
  const std::vector<char> good = bytes();
  const auto [all, none] = rows();
  ASSERT_EQ(none, "");
  put({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(good.size() / 2)});
  const auto [half, why] = rows();
  EXPECT_NEAR(static_cast<double>(half), 0.5 * static_cast<double>(all),
              0.1 * static_cast<double>(all));
  EXPECT_NE(why.find("bytes left out"), std::string::npos) << why;
}

TEST_F(SeriesOf, TwoLogsPutTogetherAreTheFirst) {  // in lockstep both controllers have one name
  std::vector<char> both = bytes();
  const std::size_t all = rows().first;
  record(0.02);
  const std::vector<char> second = bytes();
  both.insert(both.end(), second.begin(), second.end());
  put(both);
  const auto [ticks, why] = rows();
  EXPECT_EQ(ticks, all);
  EXPECT_NE(why.find("another controller's run begins here"), std::string::npos) << why;
}

TEST_F(SeriesOf, AMessageThatIsNoneIsPassedOver) {
  const std::size_t all = rows().first;
  {
    LogReader reader(file_.string());
    LogWriter writer(file_.string() + "2");
    LogEvent event;
    for (int n = 0; reader.next(event); ++n) {
      writer.write(event.channel, event.data.data(), std::ssize(event.data), event.time_us * 1000);
      if (n == 100) writer.write(channel::kSample, "abc", 3, event.time_us * 1000);
      if (n == 101) writer.write(channel::kTiming, "abc", 3, event.time_us * 1000);
    }
  }
  fs::rename(file_.string() + "2", file_);
  const auto [ticks, why] = rows();
  EXPECT_EQ(ticks, all);
  EXPECT_NE(why.find("this is no sample_t"), std::string::npos) << why;
}

TEST_F(SeriesOf, NothingUsableIsRefused) {
  put({'n', 'o', ' ', 'l', 'o', 'g'});
  EXPECT_NE(refusal([&] { rows(); }).find("byte 0"), std::string::npos);
}

}  // namespace
}  // namespace ves
