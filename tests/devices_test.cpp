// SPDX-License-Identifier: BSD-3-Clause
//
// Pieces of the machine that are real: a Net F/T sensor, drivers on the bus, other hosts' clocks.
#include "ves/devices/machine.hpp"
#include "ves/run/announcer.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <Eigen/QR>
#include <fstream>
#include <random>

#include "support/programs.hpp"
#include "support/rdt_sensor.hpp"
#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/bus/channels.hpp"
#include "ves/devices/force_stream.hpp"
#include "ves/devices/net_ft.hpp"
#include "ves/devices/net_ft_server.hpp"
#include "ves/devices/on_bus.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves::devices {
namespace {

using rdt_test::bytesOf;
using rdt_test::Record;

// --- Clocks --------------------------------------------------------------------------------------

TEST(ClockOffset, TheTruthIsWithinItsUncertaintyWhateverTheDelays) {
  constexpr std::int64_t kAhead = 7'123'456'789'000;
  std::mt19937_64 random(3);
  for (int trial = 0; trial < 200; ++trial) {
    ClockOffset clock;
    std::int64_t now = 1'000'000'000;
    for (int i = 0; i < 50; ++i) {
      const auto go = static_cast<std::int64_t>(random() % 5'000'000);
      const auto wait = static_cast<std::int64_t>(random() % 3'000'000);
      const auto come = static_cast<std::int64_t>(random() % 5'000'000);
      const std::int64_t t1 = now, t2 = t1 + go + kAhead, t3 = t2 + wait, t4 = t3 - kAhead + come;
      clock.take(t1, t2, t3, t4);
      now = t4 + 1'000'000;
      ASSERT_LE(std::abs(clock.offset(now) - kAhead), clock.uncertainty(now));
    }
    // The best of fifty: a round trip of 10 ms at most, of 1 or 2 ms among so many.
    EXPECT_LT(clock.uncertainty(now), 2'000'000);
  }
}

TEST(ClockOffset, OneClockIsTakenAsOneAndDriftWidensTheBounds) {
  ClockOffset same;
  EXPECT_EQ(same.uncertainty(5), -1);
  EXPECT_EQ(same.offset(5), 0);
  same.take(100'000, 180'000, 200'000, 220'000);  // 80 us there, 20 us back
  EXPECT_EQ(same.offset(220'000), 0);
  EXPECT_EQ(same.uncertainty(220'000), 50'000);
  EXPECT_EQ(same.uncertainty(10'000'220'000), 50'000 + 1'000'000);  // 1e-4 of 10 s
  // A worse round trip counts once the better one is old enough.
  same.take(20'000'000'000, 20'000'900'000, 20'000'900'000, 20'001'800'000);
  EXPECT_EQ(same.uncertainty(20'001'800'000), 900'000);
}

TEST(ClockOffset, WhatCannotBeCountsForNothing) {
  ClockOffset clock;
  clock.take(100, 200, 150, 300);   // answered before it came
  clock.take(300, 200, 210, 100);   // heard before it was sent
  clock.take(100, 200, 2000, 300);  // took longer there than altogether
  clock.take(INT64_MIN, INT64_MAX, INT64_MAX, INT64_MAX);
  clock.take(-5, 0, 0, 5);
  EXPECT_FALSE(clock.known());
}

// --- Following ---------------------------------------------------------------------------------

TEST(Tracker, HasNoLagWhileTheAccelerationIsConstant) {
  Tracker<1> tracker(60.0);
  const auto x = [](double t) { return 0.3 - 0.2 * t + 0.5 * 0.7 * t * t; };
  std::int64_t t = 0;
  for (int i = 0; i < 600; ++i, t += 3'000'000)
    tracker.take(Eigen::Matrix<double, 1, 1>(x(1e-9 * static_cast<double>(t))), t);
  t += 1'000'000;
  const auto m = tracker.at(t);
  const double s = 1e-9 * static_cast<double>(t);
  EXPECT_NEAR(m.x(0), x(s), 1e-9);
  EXPECT_NEAR(m.v(0), -0.2 + 0.7 * s, 1e-8);
  EXPECT_NEAR(m.a(0), 0.7, 1e-6);
  // An older reading is none.
  tracker.take(Eigen::Matrix<double, 1, 1>(7.0), t - 500'000'000);
  EXPECT_EQ(tracker.at(t).x(0), m.x(0));
  // What is silent is at rest where it was going, not on its way to infinity.
  const auto later = tracker.at(t + 60'000'000'000);
  EXPECT_EQ(later.v(0), 0.0);
  EXPECT_NEAR(later.x(0), x(s), 0.1);
}

TEST(Tracker, IsTheParabolaOfLeastSquaresOverAFadingMemory) {
  constexpr double kBandwidth = 40.0, kPeriod = 0.004;  // [1/s], [s]
  const double theta = std::exp(-kBandwidth * kPeriod);
  Tracker<1> tracker(kBandwidth);
  std::mt19937 random(5);
  std::normal_distribution<double> noise;
  std::vector<double> x;
  for (int i = 0; i < 400; ++i) {
    x.push_back(0.1 * std::sin(0.05 * i) + 0.01 * noise(random));
    tracker.take(Eigen::Matrix<double, 1, 1>(x.back()), i * 4'000'000LL);
  }
  // Weights theta^age; the 400th is worth 1e-28.
  Eigen::MatrixXd A(400, 3);
  Eigen::VectorXd b(400);
  for (int age = 0; age < 400; ++age) {
    const double w = std::sqrt(std::pow(theta, age)), t = -age * kPeriod;
    A.row(age) << w, w * t, w * t * t / 2.0;
    b(age) = w * x[static_cast<std::size_t>(399 - age)];
  }
  const Eigen::Vector3d fit = A.colPivHouseholderQr().solve(b);
  const auto m = tracker.at(399 * 4'000'000LL);
  EXPECT_NEAR(m.x(0), fit(0), 1e-10);
  EXPECT_NEAR(m.v(0), fit(1), 1e-9);
  EXPECT_NEAR(m.a(0), fit(2), 1e-7);
}

// --- RDT ---------------------------------------------------------------------------------------

/// Ten converter counts a newton, twenty a newton metre.
Mat6 proc() {
  Vec6 gain;
  gain << 10, 10, 10, 20, 20, 20;
  return gain.asDiagonal();
}
const NetFtCalibration kCalibration{1e6, 2e6, "FT27462"};

struct Stream {
  RdtStream stream{kCalibration, proc(), 0};
  std::int64_t now = 0;
  void take(const Record& r) {
    const auto bytes = bytesOf(r);
    stream.take(bytes.data(), bytes.size(), ++now);
  }
  int fx() const {
    WrenchReading w;
    return stream.read(w) ? w.counts[0] : -1;
  }
};

TEST(Rdt, CountsAreScaledByTheSensorsOwnCalibration) {
  Stream s;
  WrenchReading w;
  EXPECT_FALSE(s.stream.read(w));
  // 3 N, -5 N, 100 N; 1 N m, -2 N m, 0.03 N m
  s.take({1, 9, 0, {3'000'000, -5'000'000, 100'000'000, 2'000'000, -4'000'000, 60'000}});
  ASSERT_TRUE(s.stream.read(w));
  EXPECT_EQ(w.counts, (std::array<std::int32_t, 6>{30, -50, 1000, 20, -40, 1}));
  EXPECT_EQ(w.time, 1);
  EXPECT_FALSE(w.fault);
  // Beyond the 16 bits of the converter: its end, which the controller knows as saturated.
  s.take({2, 10, 0, {2'147'483'647, -2'147'483'647 - 1, 0, 0, 0, 0}});
  RdtStream steep(kCalibration, 100.0 * proc(), 0);
  const auto bytes = bytesOf({1, 1, 0, {2'147'483'647, -2'147'483'647 - 1, 0, 0, 0, 0}});
  steep.take(bytes.data(), bytes.size(), 1);
  ASSERT_TRUE(steep.read(w));
  EXPECT_EQ(w.counts[0], 32767);
  EXPECT_EQ(w.counts[1], -32768);
}

// 36 bytes, the most significant first: three counters and six counts.
TEST(Rdt, RecordsAreTheirBytes) {
  RdtRecord record;
  record.sequence = 0x01020304;
  record.sensor_sequence = 0x05060708;
  record.status = 0x80000001;
  record.counts = {1, -1, 0x0a0b0c0d, INT32_MIN, INT32_MAX, 7};
  const auto bytes = encode(record);
  const std::vector<int> wanted = {1,    2, 3, 4, 5,    6,    7,    8,    0x80, 0,    0,    1,
                                   0,    0, 0, 1, 0xff, 0xff, 0xff, 0xff, 0x0a, 0x0b, 0x0c, 0x0d,
                                   0x80, 0, 0, 0, 0x7f, 0xff, 0xff, 0xff, 0,    0,    0,    7};
  EXPECT_EQ(std::vector<int>(bytes.begin(), bytes.end()), wanted);
  const auto back = rdtRecord(bytes.data(), bytes.size());
  ASSERT_TRUE(back);
  EXPECT_EQ(back->sequence, record.sequence);
  EXPECT_EQ(back->sensor_sequence, record.sensor_sequence);
  EXPECT_EQ(back->status, record.status);
  EXPECT_EQ(back->counts, record.counts);
  EXPECT_FALSE(rdtRecord(bytes.data(), bytes.size() - 1));
}

TEST(Rdt, AWindowIsTheMeanOfItsRecordsAndAsFaultyAsTheWorst) {
  RdtStream stream(kCalibration, proc(), 10'000'000);
  const auto take = [&](std::uint32_t n, int newtons, std::uint32_t status = 0) {
    const auto bytes = bytesOf({n, n, status, {newtons * 1'000'000, 0, 0, 0, 0, 0}});
    stream.take(bytes.data(), bytes.size(), n * 1'000'000);
  };
  WrenchReading w;
  take(1, 8);
  ASSERT_TRUE(stream.read(w));
  EXPECT_EQ(w.counts[0], 80);  // of what there is
  for (std::uint32_t n = 2; n <= 40; ++n) take(n, static_cast<int>(n) * (n % 2 == 0 ? 2 : 0));
  ASSERT_TRUE(stream.read(w));
  EXPECT_EQ(w.counts[0], 360);  // 32, 34, .. 40 twice, and five zeros: the newest ten
  EXPECT_EQ(w.time, 40'000'000);
  EXPECT_FALSE(w.fault);
  take(41, 0, 0x80020000);
  for (std::uint32_t n = 42; n <= 52; ++n) {
    ASSERT_TRUE(stream.read(w));
    EXPECT_EQ(w.fault, n <= 51) << n;
    take(n, 0);
  }
  take(80, 5);  // after a gap that one alone
  ASSERT_TRUE(stream.read(w));
  EXPECT_EQ(w.counts[0], 50);
  EXPECT_FALSE(w.fault);
}

TEST(Rdt, LossRepetitionDisorderAndTheWrapAreCounted) {
  Stream s;
  const auto record = [](std::uint32_t sequence, int newtons) {
    return Record{sequence, sequence, 0, {newtons * 1'000'000, 0, 0, 0, 0, 0}};
  };
  s.take(record(0xfffffffd, 1));
  s.take(record(0xfffffffe, 2));
  s.take(record(1, 3));  // 0xffffffff and 0 lost, across the wrap
  EXPECT_EQ(s.fx(), 30);
  EXPECT_EQ(s.stream.counters().lost, 2);
  s.take(record(1, 7));           // again
  s.take(record(0xffffffff, 8));  // late
  EXPECT_EQ(s.fx(), 30);
  EXPECT_EQ(s.stream.counters().repeated, 1);
  EXPECT_EQ(s.stream.counters().late, 1);
  auto cut = bytesOf(record(2, 9));
  cut.pop_back();
  s.stream.take(cut.data(), cut.size(), 50);
  EXPECT_EQ(s.stream.counters().malformed, 1);
  EXPECT_EQ(s.fx(), 30);
  WrenchReading w;
  s.stream.read(w);
  EXPECT_EQ(w.time, 3);  // of the record that counts
  // A sensor that was switched off counts from one again, and is not believed until it is asked
  // anew.
  s.take(record(2, 4));
  s.take(record(1, 5));
  EXPECT_EQ(s.fx(), 40);
  s.stream.restart();
  s.take(record(1, 6));
  EXPECT_EQ(s.fx(), 60);
  EXPECT_EQ(s.stream.counters().records, 5);
}

TEST(Rdt, EveryErrorOfTheStatusIsAFaultAndTheThresholdsLatchIsNone) {
  const auto fault = [](std::uint32_t status) {
    Stream s;
    s.take({1, 1, status, {}});
    WrenchReading w;
    return s.stream.read(w) && w.fault;
  };
  EXPECT_FALSE(fault(0));
  EXPECT_FALSE(fault(0x00010000));
  EXPECT_FALSE(fault(0x80010000));
  EXPECT_TRUE(fault(0x80000000));
  for (int bit = 0; bit < 31; ++bit) {
    if (bit == 16) continue;
    EXPECT_TRUE(fault(1u << bit)) << bit;
    EXPECT_TRUE(fault(0x80010000u | 1u << bit)) << bit;
  }
}

TEST(Rdt, CalibrationIsReadInTheSensorsUnitsOrRefusedByItsTag) {
  const std::string good =
      "<netft><cfgcalsn>FT1</cfgcalsn><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><cfgcpf>1000000</cfgcpf>"
      "<cfgcpt>2000000</cfgcpt></netft>";
  EXPECT_EQ(netFtCalibration(good), (NetFtCalibration{1e6, 2e6, "FT1", {}}));
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return text;
  };
  // One pound of force is 4.4482216152605 N, one pound foot 1.3558179483314 N m.
  EXPECT_NEAR(netFtCalibration(with(">N<", ">lbf<")).counts_per_newton, 1e6 / 4.4482216152605,
              1e-6);
  EXPECT_NEAR(netFtCalibration(with(">Nm<", ">lbf-ft<")).counts_per_newton_metre,
              2e6 / 1.3558179483314004, 1e-6);
  EXPECT_NEAR(netFtCalibration(with(">Nm<", ">N-mm<")).counts_per_newton_metre, 2e9, 1e-3);
  for (const auto& [text, tag] : {std::pair{with("1000000", "0"), "cfgcpf"},
                                  {with("1000000", "-1"), "cfgcpf"},
                                  {with("1000000", "nan"), "cfgcpf"},
                                  {with("1000000", "inf"), "cfgcpf"},
                                  {with("1000000", "1e6x"), "cfgcpf"},
                                  {with("2000000", ""), "cfgcpt"},
                                  {with(">N<", ">stone<"), "scfgfu"},
                                  {with("<scfgtu>Nm</scfgtu>", ""), "scfgtu"},
                                  {with("</netft>", ""), "not well-formed"},
                                  {std::string(), "not well-formed"}})
    EXPECT_NE(test::refusal([&, t = text] { netFtCalibration(t); }).find(tag), std::string::npos)
        << text;
}

TEST(Rdt, AToolTransformIsTakenOutAndAFilterIsRefused) {
  const auto page = [](const std::string& more) {
    return "<netft><cfgcalsn>\n FT1 </cfgcalsn><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><cfgcpf "
           "a=\"b\"> 1000 </cfgcpf><cfgcpt>1000</cfgcpt>" +
           more + "</netft>";
  };
  const auto with = [&](const char* tool) {
    return page(
        fmt::format("<cfgtfx>{}</cfgtfx><scfgtdu>mm</scfgtdu><scfgtau>degrees</scfgtau>", tool));
  };
  EXPECT_EQ(netFtCalibration(with("0;0;0;0;0;0")).X_ST, Transform());
  // A force through a point of the sensor, as it feels it, and as the box says it of a frame 100 mm
  // along z that is turned by 90 degrees about z: x there is y here.
  const Vec3 f(3.0, -2.0, 5.0), r(0.02, 0.03, -0.04), p(0.0, 0.0, 0.1);
  const Vec3 n = r.cross(f), n_T = (r - p).cross(f);
  const Vec3 f_T(f.y(), -f.x(), f.z()), m_T(n_T.y(), -n_T.x(), n_T.z());
  for (const bool turned : {false, true}) {
    const NetFtCalibration c = netFtCalibration(with(turned ? "0;0;100;0;0;90" : "0;0;100;0;0;0"));
    const Mat6 S_proc = 1e3 * Mat6::Identity();
    RdtStream stream(c, S_proc, 0);
    RdtRecord record;
    record.sequence = 1;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto k = static_cast<int>(i);
      record.counts[i] = static_cast<int>(std::lround(1e3 * (turned ? f_T : f)(k)));
      record.counts[i + 3] = static_cast<int>(std::lround(1e3 * (turned ? m_T : n_T)(k)));
    }
    const auto bytes = encode(record);
    stream.take(bytes.data(), bytes.size(), 1);
    WrenchReading w;
    ASSERT_TRUE(stream.read(w));
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(w.counts[static_cast<std::size_t>(i)], 1e3 * f(i), 1.0);
      EXPECT_NEAR(w.counts[static_cast<std::size_t>(i + 3)], 1e3 * n(i), 1.0);
    }
  }
  for (const auto& [text, says] :
       {std::pair{with("0;0;1;10;20;0"), "cfgtfx: '0;0;1;10;20;0' turns about more than one axis"},
        {with("0;0;1"), "want six numbers"},
        {with("0;0;x;0;0;0"), "want numbers"},
        {page("<cfgtfx>0;0;1;0;0;0</cfgtfx>"), "scfgtdu: missing"},
        {page("<setuserfilter>3</setuserfilter>"), "setuserfilter: '3'"}}) {
    const std::string said = test::refusal([&, t = text] { netFtCalibration(t); });
    EXPECT_NE(said.find(says), std::string::npos) << said;
  }
}

// --- Streams that a scenario describes -----------------------------------------------------------

StreamSource streamOf(const std::vector<std::string>& set) {
  std::vector<std::string> all = {"machine.force_sensor=stream"};
  for (const std::string& one : set) all.push_back("machine.stream." + one);
  return std::get<StreamSource>(test::experiment("z_sine", all).machine.force_sensor);
}

/// Bit by bit, most significant first on reflected data: another way than the driver's.
std::uint16_t crcByBits(const std::vector<std::uint8_t>& data, std::uint16_t poly,
                        std::uint16_t out) {
  std::uint16_t crc = 0xffff;
  for (const std::uint8_t byte : data)
    for (int bit = 0; bit < 8; ++bit) {
      const bool carry = (crc & 0x8000) != 0;
      crc = static_cast<std::uint16_t>(crc << 1);
      if (carry != ((byte >> bit & 1) != 0)) crc ^= poly;
    }
  std::uint16_t reflected = 0;
  for (int bit = 0; bit < 16; ++bit)
    if (crc >> bit & 1) reflected = static_cast<std::uint16_t>(reflected | 0x8000 >> bit);
  return reflected ^ out;
}

/// Robotiq's FT 300: 20 4e, six int16 in 1/100 N and 1/1000 N m, a Modbus sum.
std::vector<std::uint8_t> robotiq(const std::array<int, 6>& values) {
  std::vector<std::uint8_t> out = {0x20, 0x4e};
  for (const int v : values)
    for (int shift : {0, 8}) out.push_back(static_cast<std::uint8_t>(v >> shift));
  const std::uint16_t crc = crcByBits(out, 0x8005, 0);
  out.push_back(static_cast<std::uint8_t>(crc));
  out.push_back(static_cast<std::uint8_t>(crc >> 8));
  return out;
}

/// Bota's serial frames: aa, a status, six floats, a time, a temperature, and an X.25 sum of these.
std::vector<std::uint8_t> bota(const std::array<float, 6>& values) {
  std::vector<std::uint8_t> data = {0, 0};
  const auto put = [&](const void* from) {
    const auto* bytes = static_cast<const std::uint8_t*>(from);
    data.insert(data.end(), bytes, bytes + 4);
  };
  for (const float v : values) put(&v);
  const std::uint32_t time = 1234;
  const float temperature = 25.0f;
  put(&time);
  put(&temperature);
  const std::uint16_t crc = crcByBits(data, 0x1021, 0xffff);
  data.insert(data.begin(), 0xaa);
  data.push_back(static_cast<std::uint8_t>(crc));
  data.push_back(static_cast<std::uint8_t>(crc >> 8));
  return data;
}
const std::vector<std::string> kBota = {"values=float32",     "sync=[170]",
                                        "length=37",          "first=3",
                                        "checksum=crc16_x25", "checksum_over=[1, 35]",
                                        "checksum_at=35",     "scale=[1, 1, 1, 1, 1, 1]"};

/// Every wrench of bytes that come in pieces of `piece`.
std::vector<Vec6> parsed(StreamParser& parser, const std::vector<std::uint8_t>& bytes,
                         std::size_t piece) {
  std::vector<Vec6> out;
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    parser.take(bytes.data() + at, std::min(piece, bytes.size() - at),
                [&](const Vec6& wrench) { out.push_back(wrench); });
  return out;
}

TEST(StreamParser, FindsFramesInPiecesOfAnySizeAndAfterNoise) {
  for (const bool is_bota : {false, true})
    for (const std::size_t piece : {1u, 5u, 16u, 100u, 4000u}) {
      StreamParser parser(streamOf(is_bota ? kBota : std::vector<std::string>{}));
      std::vector<std::uint8_t> bytes = {0x20, 0x4e, 0xaa, 7, 0x20};  // the end of one that was cut
      for (int k = 0; k < 20; ++k) {
        std::vector<std::uint8_t> frame =
            is_bota ? bota({1.5f * float(k), -2.0f, 3.0f, 0.25f, -0.5f, 0.125f})
                    : robotiq({150 * k, -200, 300, 250, -500, 125});
        if (k == 7) frame[5] ^= 0x40;  // damaged on the way
        bytes.insert(bytes.end(), frame.begin(), frame.end());
      }
      const std::vector<Vec6> wrenches = parsed(parser, bytes, piece);
      ASSERT_EQ(wrenches.size(), 19u) << piece;
      EXPECT_GE(parser.malformed(), 1);
      Vec6 want;
      want << 1.5 * 19, -2.0, 3.0, 0.25, -0.5, 0.125;
      EXPECT_LT((wrenches.back() - want).norm(), 1e-12) << wrenches.back().transpose();
    }
}

// What catalogues of checksums give for the digits from 1 to 9.
TEST(StreamParser, EveryChecksumIsTheOneOfItsName) {
  const std::string digits = "123456789";
  for (const auto& [name, sum, size] : {std::tuple{"sum8", 0xddu, 1},
                                        {"xor8", 0x31u, 1},
                                        {"crc16_modbus", 0x4b37u, 2},
                                        {"crc16_x25", 0x906eu, 2},
                                        {"crc32", 0xcbf43926u, 4}})
    for (const bool big : {false, true}) {
      const auto frame = [&, size = size](std::uint32_t with) {
        std::vector<std::uint8_t> out(13, 0);
        out[0] = 1;
        out[big ? 2 : 1] = 100;  // the first value
        out.insert(out.end(), digits.begin(), digits.end());
        for (int i = 0; i < size; ++i)
          out.push_back(static_cast<std::uint8_t>(with >> 8 * (big ? size - 1 - i : i)));
        return out;
      };
      StreamParser parser(
          streamOf({fmt::format("checksum={}", name), "sync=[1]", "first=1",
                    fmt::format("length={}", 22 + size), "checksum_over=[13, 22]", "checksum_at=22",
                    fmt::format("byte_order={}", big ? "big" : "little")}));
      EXPECT_TRUE(parsed(parser, frame(sum ^ 1u), 4).empty()) << name;
      const auto got = parsed(parser, frame(sum), 4);
      ASSERT_EQ(got.size(), 1u) << name << big;
      EXPECT_NEAR(got[0](0), 1.0, 1e-12);
      EXPECT_EQ(parser.malformed(), 1);
    }
}

TEST(StreamParser, ValuesAreReadInTheirKindAndOrder) {
  for (const std::string kind : {"int16", "int32", "float32"})
    for (const bool big : {false, true}) {
      const int size = kind == "int16" ? 2 : 4;
      std::vector<std::uint8_t> frame = {1};
      for (int k = 0; k < 6; ++k) {
        const int number = k % 2 ? -300 * (k + 1) : 300 * (k + 1);
        std::uint32_t raw = static_cast<std::uint32_t>(number);
        if (kind == "float32") {
          const auto real = static_cast<float>(number);
          std::memcpy(&raw, &real, 4);
        }
        for (int i = 0; i < size; ++i)
          frame.push_back(static_cast<std::uint8_t>(raw >> 8 * (big ? size - 1 - i : i)));
      }
      StreamParser parser(
          streamOf({"values=" + kind, "checksum=none", "sync=[1]", "first=1",
                    fmt::format("length={}", frame.size()), "scale=[1, 1, 1, 1, 1, 1]",
                    fmt::format("byte_order={}", big ? "big" : "little")}));
      const auto got = parsed(parser, frame, 3);
      ASSERT_EQ(got.size(), 1u) << kind << big;
      EXPECT_EQ(got[0], (Vec6() << 300, -600, 900, -1200, 1500, -1800).finished()) << kind << big;
    }
}

// What the default description says of a checksum counts for nothing then.
TEST(StreamParser, FramesWithoutAChecksumMayBeShort) {
  StreamParser parser(streamOf({"checksum=none", "length=12", "first=0", "sync=[1]"}));
  std::vector<std::uint8_t> bytes(12, 0);
  bytes[0] = 1;
  const std::vector<Vec6> got = parsed(parser, bytes, 12);
  ASSERT_EQ(got.size(), 1u);
  EXPECT_NEAR(got[0](0), 0.01, 1e-15);
}

TEST(StreamParser, ReadsLinesWithAnyChannelsAndSigns) {
  StreamParser parser(streamOf({"values=text", "first=1", "separators=;", "checksum=none",
                                "channels=[fz, fx, fy, mz, mx, my]", "scale=[-1, 1, 1, 2, 1, 1]"}));
  const std::string text = "17; 1.5;+2;3e0;4;5;-6;99\r\nno numbers\n18;1;2;3\n19 1 2 3 4 5 nan\n";
  const std::vector<Vec6> got = parsed(parser, {text.begin(), text.end()}, 7);
  ASSERT_EQ(got.size(), 1u);
  Vec6 want;
  want << 2, 3, -1.5, 5, -6, 8;
  EXPECT_EQ(got[0], want);
  EXPECT_EQ(parser.malformed(), 3);
}

TEST(StreamParser, WhatCannotBeAFrameIsRefused) {
  for (const auto& [set, says] :
       {std::pair{"length=8", "stream.length: 8 bytes, want 14 at least"},
        {"source=usb", "stream.source: 'usb', want serial:DEVICE, udp:PORT or pipe:FILE"},
        {"source=udp:99999", "stream.source"},
        {"channels=[fx, fx, fz, mx, my, mz]", "'fx', want each of fx, fy"},
        {"checksum_over=[4, 4]", "stream.checksum_over"},
        {"scale=[1,1,1,1,1,0]", "stream.scale: has a 0"}}) {
    const std::string said = test::refusal([&, s = set] { streamOf({s}); });
    EXPECT_NE(said.find(says), std::string::npos) << said;
  }
}

TEST(ForceStream, IsReadFromASerialLineUdpAndAPipe) {
  const Mat6 S_proc = 100.0 * Mat6::Identity();
  const auto reads = [&](const StreamSource& source, const std::function<void()>& send) {
    ForceStream sensor(source, S_proc, 0);
    WrenchReading w;
    EXPECT_FALSE(sensor.read(w));
    send();
    const std::int64_t until = monotonicNow() + 10'000'000'000;
    while (!sensor.read(w) && monotonicNow() < until) usleep(500);
    EXPECT_EQ(w.counts[0], 150);
    EXPECT_EQ(w.counts[4], -50);
    EXPECT_FALSE(w.fault);
  };
  const auto frame = robotiq({150, -200, 300, 250, -500, 125});
  int master = -1, slave = -1;
  char name[64];
  ASSERT_EQ(openpty(&master, &slave, name, nullptr, nullptr), 0);
  reads(streamOf({std::string("source=serial:") + name}),
        [&] { ASSERT_EQ(::write(master, frame.data(), frame.size()), std::ssize(frame)); });
  close(master);
  close(slave);

  const int out = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof to;
  ASSERT_EQ(bind(out, reinterpret_cast<sockaddr*>(&to), sizeof to), 0);  // a port that is free
  getsockname(out, reinterpret_cast<sockaddr*>(&to), &size);
  close(out);
  std::vector<std::string> set = kBota;
  set.push_back(fmt::format("source=udp:{}", ntohs(to.sin_port)));
  reads(streamOf(set), [&] {
    const auto f = bota({1.5f, -2.0f, 3.0f, 0.25f, -0.5f, 0.125f});
    const int from = socket(AF_INET, SOCK_DGRAM, 0);
    sendto(from, f.data(), f.size(), 0, reinterpret_cast<sockaddr*>(&to), sizeof to);
    close(from);
  });

  const std::string pipe = "/tmp/ves_pipe_" + std::to_string(getpid());
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  reads(streamOf({"source=pipe:" + pipe, "values=text", "first=0", "scale=[1, 1, 1, 1, 1, 1]"}),
        [&] { std::ofstream(pipe) << "1.5, -2, 3, 0.25, -0.5, 0.125\n"; });
  unlink(pipe.c_str());
  EXPECT_NE(test::refusal([&] {
              ForceStream(streamOf({"source=serial:/dev/null"}), S_proc, 0);
            }).find("force sensor /dev/null: is no serial line"),
            std::string::npos);
}

// --- The driver against a sensor written apart from it -------------------------------------------

/// Reads until `done`, for at most ten seconds.
template <typename Done>
bool until(NetFt& driver, WrenchReading& w, Done done) {
  const std::int64_t end = monotonicNow() + 10'000'000'000;
  while (monotonicNow() < end) {
    if (driver.read(w) && done()) return true;
    usleep(500);
  }
  return false;
}

NetFtAddress addressOf(const rdt_test::Sensor& sensor) {
  return {"127.0.0.1", sensor.port(), sensor.httpPort()};
}

TEST(NetFt, ReadsRecordsWithTheirTimeAsksAgainAndNeverTakesABias) {
  rdt_test::Sensor sensor;
  sensor.configure({});
  WrenchReading w;
  {
    NetFt driver(addressOf(sensor), proc(), 0);
    while (!sensor.streaming()) usleep(500);
    EXPECT_FALSE(driver.read(w));
    const std::int64_t before = monotonicNow();
    sensor.send({41, 1, 0, {7'000'000, 0, 0, 0, 0, 0}});
    ASSERT_TRUE(until(driver, w, [] { return true; }));
    EXPECT_EQ(w.counts[0], 70);
    EXPECT_GE(w.time, before - 1'000'000);
    EXPECT_LE(w.time, monotonicNow());
    // Switched off and on again: it counts from one, and knows of no client.
    const sockaddr_in asked = *sensor.client();
    sensor.forgetClient();
    const std::int64_t stamp = w.time;
    while (!sensor.streaming()) {
      sensor.sendBytesTo(asked, {1, 2, 3});  // no record, and no sign of life
      driver.read(w);
      EXPECT_EQ(w.time, stamp);  // what is old says so
      usleep(500);
    }
    sensor.send({1, 1, 0, {8'000'000, 0, 0, 0, 0, 0}});
    ASSERT_TRUE(until(driver, w, [&] { return w.counts[0] == 80; }));
    sensor.send({2, 2, 0x80020000, {8'000'000, 0, 0, 0, 0, 0}});
    ASSERT_TRUE(until(driver, w, [&] { return w.fault; }));
    sensor.send({3, 3, 0, {9'000'000, 0, 0, 0, 0, 0}});
    ASSERT_TRUE(until(driver, w, [&] { return w.counts[0] == 90; }));
    EXPECT_FALSE(w.fault);
    // Another tool was mounted, and its calibration chosen.
    sensor.setHttpStatus(503);  // busy: no fault
    const int pages = sensor.pages();
    while (sensor.pages() == pages) usleep(1000);
    sensor.send({4, 4, 0, {}});
    ASSERT_TRUE(until(driver, w, [&] { return w.counts[0] == 0; }));
    EXPECT_FALSE(w.fault);
    sensor.configure({.serial = "FT99999"});
    sensor.setHttpStatus(200);
    ASSERT_TRUE(until(driver, w, [&] {
      sensor.send({5, 5, 0, {}});
      return w.fault;
    }));
  }
  while (sensor.streaming()) usleep(500);  // it is told to stop
  for (const int command : sensor.commands()) EXPECT_TRUE(command == 2 || command == 0) << command;
}

TEST(NetFt, WhoIsNoSensorIsRefusedInOneLine) {
  rdt_test::Sensor sensor;
  const auto refused = [&] {
    return test::refusal([&] { NetFt driver(addressOf(sensor), proc(), 0); });
  };
  sensor.setXml("<netft></netft>");
  EXPECT_NE(refused().find("cfgcpf: missing"), std::string::npos) << refused();
  sensor.configure({});
  sensor.setHttpStatus(404);
  EXPECT_NE(refused().find("answers 404"), std::string::npos) << refused();
  sensor.setHttpStatus(200);
  sensor.setXml(std::string(100'000, 'x'));
  EXPECT_NE(refused().find("longer than 64 kB"), std::string::npos) << refused();
  const NetFtAddress nobody{"127.0.0.1", 9, 9};
  EXPECT_NE(test::refusal([&] { NetFt driver(nobody, proc(), 0); }).find("127.0.0.1:9"),
            std::string::npos);
}

// --- The server, read by bytes -------------------------------------------------------------------

class Client {
 public:
  explicit Client(int port) : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connect(fd_, reinterpret_cast<sockaddr*>(&to), sizeof to);
  }
  ~Client() { close(fd_); }
  void ask(std::uint8_t command, std::uint8_t count) {
    const std::uint8_t request[] = {0x12, 0x34, 0, command, 0, 0, 0, count};
    ASSERT_EQ(send(fd_, request, sizeof request, 0), 8);
  }
  /// Numbers of the next record, in order; empty: none.
  std::vector<std::int64_t> next() {
    std::uint8_t b[64];
    if (recv(fd_, b, sizeof b, 0) != 36) return {};
    std::vector<std::int64_t> out;
    for (int i = 0; i < 9; ++i) {
      std::uint32_t n = 0;
      for (int k = 0; k < 4; ++k) n = n << 8 | b[4 * i + k];
      out.push_back(i < 3 ? static_cast<std::int64_t>(n) : static_cast<std::int32_t>(n));
    }
    return out;
  }

 private:
  int fd_;
};

TEST(NetFtServer, SendsEveryRecordThatIsDueAndSaysWhatItCannot) {
  NetFtServer server({"127.0.0.1", 0, 0, 1000, {1e5, 2e5, "A1"}});
  Client client(server.port());
  server.set(Wrench{Vec3(1, -2, 3), Vec3(0.1, -0.2, 0.3)});
  server.serve(1'000'000'000);
  EXPECT_TRUE(client.next().empty());  // nobody has asked
  client.ask(2, 0);
  server.serve(1'010'000'000);  // ten of a thousand a second
  for (std::int64_t i = 1; i <= 10; ++i) {
    const auto r = client.next();
    ASSERT_EQ(r.size(), 9u) << i;
    EXPECT_EQ(r[0], i);
    EXPECT_EQ(r[2], 0);
    EXPECT_EQ(std::vector<std::int64_t>(r.begin() + 3, r.end()),
              (std::vector<std::int64_t>{100'000, -200'000, 300'000, 20'000, -40'000, 60'000}));
  }
  EXPECT_TRUE(client.next().empty());
  client.ask(0, 0);
  server.serve(1'020'000'000);
  EXPECT_TRUE(client.next().empty());
  client.ask(2, 3);  // three, and no more
  server.serve(1'030'000'000);
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(client.next().at(0), i);
  EXPECT_TRUE(client.next().empty());
  client.ask(0x42, 0);  // a bias of its own
  client.ask(2, 1);
  server.serve(1'040'000'000);
  const auto unbiased = client.next();
  ASSERT_EQ(unbiased.size(), 9u);
  for (std::size_t i = 3; i < 9; ++i) EXPECT_EQ(unbiased[i], 0);
  client.ask(2, 1);
  server.set(Wrench{Vec3(1e6, 0, 0), Vec3(0, 0, 0)});  // more than 32 bits hold
  server.serve(1'050'000'000);
  EXPECT_EQ(client.next().at(2), 0x80020000);
}

TEST(NetFtServer, ItsPageIsWhatTheDriverReads) {
  NetFtServer server({"127.0.0.1", 0, 0, 7000, {1e5, 2.5e5, "VES7"}});
  std::jthread serving([&](std::stop_token stop) {
    for (; !stop.stop_requested(); usleep(200)) server.serve(monotonicNow());
  });
  const std::string xml = fetchNetFtXml({"127.0.0.1", server.port(), server.httpPort()}, 2000).xml;
  EXPECT_EQ(netFtCalibration(xml), (NetFtCalibration{1e5, 2.5e5, "VES7", {}}));
}

// --- What the controller makes of it
// ----------------------------------------------------------------

TEST(Pieces, OneThatIsTooOldOrAtFaultStopsTheRunByName) {
  const auto stoppedBy = [](const std::function<void(Sample&)>& spoil) {
    const Experiment e = test::experiment("z_sine");
    Lockstep loop(e.controller, e.plant);
    loop.step({Request::kStart, {}, {}});
    for (int i = 0; i < 3000 && !test::done(loop.state()); ++i) {
      if (i == 300) loop.disturb = spoil;
      loop.step();
    }
    return loop.state().phase == Phase::kStopped ? loop.state().cause : Check::kCount;
  };
  constexpr std::int64_t kTick = 10'000'000;
  const int most = test::experiment("z_sine").controller.safety.stale_ticks;
  for (std::int64_t Sample::*stamp :
       {&Sample::legs_time, &Sample::wrench_time, &Sample::joints_time}) {
    EXPECT_EQ(stoppedBy([&](Sample& s) { s.*stamp = s.time - most * kTick; }), Check::kCount);
    EXPECT_EQ(stoppedBy([&](Sample& s) { s.*stamp = s.time - most * kTick - 1'000; }),
              Check::kStale);
    // From the future, or before the clock began: no sample of a machine, let in by nobody.
    EXPECT_EQ(stoppedBy([&](Sample& s) { s.*stamp = s.time + 1; }), Check::kStale);
    EXPECT_EQ(stoppedBy([&](Sample& s) { s.*stamp = -1; }), Check::kStale);
  }
  for (const std::uint32_t piece : {kLegsPiece, kSensorPiece, kRobotPiece})
    EXPECT_EQ(stoppedBy([&](Sample& s) { s.faults = piece; }), Check::kDevice);
  EXPECT_EQ(stoppedBy([&](Sample& s) { s.faults = 8; }), Check::kStale);  // nobody's bit
  // A clock that stands still while samples come: none of them is new.
  EXPECT_EQ(stoppedBy([&](Sample& s) {
              s.time = s.legs_time = s.wrench_time = s.joints_time = 2'000'000'000;
            }),
            Check::kStale);
}

// --- A machine with drivers on the bus -----------------------------------------------------------

class Composed : public testing::Test {
 protected:
  static void SetUpTestSuite() { enterPrivateBus(); }

  static void publish(Bus& driver, const std::string& channel, sample_t m) {
    m.header = header({5, 5}, ++sequence_, monotonicNow());
    m.temperature = 20.0;
    driver.publish(channel, m);
  }
  static void hear(Bus& bus, Machine& machine, const std::function<bool(const Sample&)>& done) {
    for (int i = 0; i < 500; ++i) {
      bus.wait(10);
      machine.advance(i * 2'000'000, monotonicNow());
      if (machine.sample() && done(*machine.sample())) return;
    }
    FAIL() << "waits for " << machine.waitsFor();
  }
  static inline std::int64_t sequence_ = 0;
};

TEST_F(Composed, EachPieceComesFromItsDriverAndTheRestIsSimulated) {
  const Experiment alone = test::experiment("puma_on_table_4_1");
  const setup_t setup = toMessage(setupOf(alone, false), header({1, 1}, 0, 0));
  plant::Plant simulated(alone.plant);
  const Sample rest = simulated.sample();
  const auto composed = [&](const std::string& piece, const std::string& channel) {
    Bus bus(kDefaultUrl), driver(kDefaultUrl);
    Machine machine(test::experiment("puma_on_table_4_1",
                                     {"machine." + piece + "=external", "sensor.noise=false"}),
                    bus);
    machine.advance(0, monotonicNow());
    EXPECT_FALSE(machine.sample()) << piece;
    EXPECT_FALSE(machine.waitsFor().empty());
    sample_t m{};
    std::copy_n(setup.leg_home, 6, m.legs);
    for (int i = 0; i < 6; ++i) m.adc[i] = 11 * i + 5;
    m.adc[6] = 777;
    m.q[1] = 0.25;
    m.switches = 1;
    m.faults = static_cast<int>(kAllPieces);
    const std::int64_t before = monotonicNow();
    publish(driver, channel, m);
    hear(bus, machine, [](const Sample&) { return true; });
    machine.advance(2'000'000'000, monotonicNow());  // until the sensor's filter has settled
    const Sample s = machine.sample().value_or(Sample());
    EXPECT_GE(s.oldest(), 0);
    EXPECT_LE(s.oldest(), monotonicNow() - before);
    return s;
  };
  const std::array<std::int32_t, 6> theirs = {5, 16, 27, 38, 49, 60};
  const auto wrenchIs = [](const Sample& s, const auto& wrench) {
    return std::equal(wrench.begin(), wrench.begin() + 6, s.adc.begin());
  };
  const Sample legs = composed("legs", channel::kLegs);
  EXPECT_TRUE(std::equal(legs.legs.begin(), legs.legs.end(), setup.leg_home));
  EXPECT_EQ(legs.adc[6], 777);  // the pressure is the legs'
  EXPECT_EQ(legs.q, rest.q);
  EXPECT_EQ(legs.switches, kAllSwitchesClosed);
  EXPECT_EQ(legs.faults, kLegsPiece);
  const Sample sensor = composed("force_sensor", channel::kWrench);
  EXPECT_TRUE(wrenchIs(sensor, theirs));
  EXPECT_EQ(sensor.legs, rest.legs);
  EXPECT_EQ(sensor.adc[6], rest.adc[6]);
  EXPECT_EQ(sensor.faults, kSensorPiece);
  const Sample robot = composed("robot", channel::kJoints);
  EXPECT_EQ(robot.q(1), 0.25);
  EXPECT_EQ(robot.legs, rest.legs);
  EXPECT_EQ(robot.faults, kRobotPiece);
  // The simulated sensor feels the weight of the robot where its joints really are.
  plant::Plant there(
      test::experiment("puma_on_table_4_1",
                       {fmt::format("robot.joints_deg_or_m=[0, {}, 0, 0, 0, 0]", 0.25 / kDegree),
                        "sensor.noise=false"})
          .plant);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(robot.adc[i], there.sample().adc[i], 1.0) << i;
  EXPECT_FALSE(wrenchIs(robot, rest.adc));
  const Sample switches = composed("switches", channel::kSwitches);
  EXPECT_EQ(switches.switches, 1u);
  EXPECT_EQ(switches.q, rest.q);
  EXPECT_EQ(switches.faults, 0u);
}

TEST_F(Composed, ASilentPieceGrowsOldSilentSwitchesOpenAndAGhostIsNobody) {
  Bus bus(kDefaultUrl), driver(kDefaultUrl);
  Machine machine(
      test::experiment("z_sine", {"machine.force_sensor=external", "machine.switches=external"}),
      bus);
  sample_t m{};
  m.adc[0] = 4;
  m.switches = 3;
  publish(driver, channel::kWrench, m);
  publish(driver, channel::kSwitches, m);
  hear(bus, machine, [](const Sample& s) { return s.switches == kAllSwitchesClosed; });
  hear(bus, machine, [](const Sample& s) { return s.switches == 0; });
  EXPECT_GE(machine.sample()->oldest(), SwitchesOnBus::kSilence - 10'000'000);
  // Of an earlier process, and of an earlier sequence: nobody. Then its successor.
  m.adc[0] = 9;
  m.temperature = 20.0;
  m.header = header({6, 4}, 1000, monotonicNow());
  driver.publish(channel::kWrench, m);
  m.header = header({5, 5}, 0, monotonicNow());
  driver.publish(channel::kWrench, m);
  m.adc[0] = 7;
  m.header = header({6, 6}, 0, monotonicNow());
  driver.publish(channel::kWrench, m);
  hear(bus, machine, [](const Sample& s) { return s.adc[0] != 4; });
  EXPECT_EQ(machine.sample()->adc[0], 7);
}

TEST_F(Composed, StampsOfAnotherHostsClockAreTheTimeOfArrival) {
  Bus bus(kDefaultUrl), driver(kDefaultUrl);
  Machine machine(test::experiment("z_sine", {"machine.robot=external"}), bus);
  // A host that booted later than this one, and one that booted long before.
  for (const std::int64_t off : {-monotonicNow() / 2, std::int64_t{3'600'000'000'000}}) {
    sample_t m{};
    m.q[0] = off > 0 ? 0.1 : 0.2;
    m.temperature = 20.0;
    m.header = header({5, 5}, ++sequence_, monotonicNow() + off);
    m.joints_time_ns = m.header.time_ns;
    const std::int64_t before = monotonicNow();
    driver.publish(channel::kJoints, m);
    hear(bus, machine, [&](const Sample& s) { return s.q(0) == m.q[0]; });
    EXPECT_GE(machine.sample()->joints_time, before - 1'000'000);
    EXPECT_LE(machine.sample()->joints_time, monotonicNow());
  }
}

TEST_F(Composed, AReadingThatTheDriverCallsOldIsOldWhateverItsClock) {
  Bus bus(kDefaultUrl), driver(kDefaultUrl);
  Machine machine(test::experiment("z_sine", {"machine.robot=external"}), bus);
  constexpr std::int64_t kOld = 250'000'000;
  for (const std::int64_t off : {std::int64_t{0}, std::int64_t{3'600'000'000'000}}) {
    sample_t m{};
    m.q[0] = off > 0 ? 0.3 : 0.4;
    m.temperature = 20.0;
    m.header = header({5, 5}, ++sequence_, monotonicNow() + off);
    m.joints_time_ns = m.header.time_ns - kOld;
    driver.publish(channel::kJoints, m);
    hear(bus, machine, [&](const Sample& s) { return s.q(0) == m.q[0]; });
    EXPECT_GE(machine.sample()->oldest(), kOld);
  }
}

TEST(RealLegs, CarryThePlatformOfTheSimulatedRobot) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const Geometry& g = e.controller.geometry;
  plant::Plant plant(e.plant);
  Tracker<kLegs> tracker(e.machine.follow);
  // Read to the count every 2 ms while the platform goes z = 20 mm sin(2 pi t).
  constexpr double kAmplitude = 0.02, kOmega = 2.0 * M_PI;
  double position = 0.0, square = 0.0;  // [m], [m^2/s^4] off
  for (int i = 1; i <= 1500; ++i) {
    const std::int64_t now = i * 2'000'000LL;
    const double z = kAmplitude * std::sin(kOmega * 1e-9 * static_cast<double>(now));
    const Vec6 L = legLengths(g, g.fromHome(Pose{Vec3(0.0, 0.0, z), Vec3::Zero()}));
    tracker.take(legLengths(e.controller.legs, legCounts(e.controller.legs, L)), now);
    const auto m = tracker.at(now);
    plant.follow(LegMotion{m.x, m.v, m.a});
    plant.advance(now);
    plant.sample();
    if (i < 300) continue;
    position = std::max(position, std::abs(plant.truth().x.p.z() - z));
    square += std::pow(plant.truth().P.a.z() + kOmega * kOmega * z, 2) / 1201.0;
  }
  EXPECT_LT(position, 2.0 * e.controller.legs.scale(0));
  // A count is 70 um: its second derivative is rough, and its smoothing late.
  EXPECT_LT(std::sqrt(square), 0.25 * kAmplitude * kOmega * kOmega);
}

// --- Whole runs with a real piece
// ------------------------------------------------------------------

class ComposedRun : public test::Programs {
 protected:
  /// Ends parked, with these pieces.
  void parks(std::vector<std::string> sets) {
    std::vector<std::string> arguments = {"z_sine",
                                          "--no-plots",
                                          "--quiet",
                                          "--set",
                                          kShortProgram,
                                          "--out",
                                          (folder_ / "run").string()};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    Process run = start("run", arguments);
    EXPECT_EQ(run.wait(), 0);
    EXPECT_EQ(summary(folder_ / "run")["ended"], "parked");
  }
};

TEST_F(ComposedRun, ParksOnLegsOfTheCppTemplate) {
  enterPrivateBus();
  Process legs(std::string(VES_TEST_APP_DIR) + "/examples/legs_driver", {});
  parks({"machine.legs=external"});
  // The controller measures what these legs did; nobody knows a truth.
  EXPECT_GT(summary(folder_ / "run")["ticks"].get<int>(), 300);
  legs.signal(SIGTERM);
  EXPECT_EQ(legs.wait(), 0);
}

TEST_F(ComposedRun, ParksWithItsForceSensorOverTheNetwork) {
  enterPrivateBus();
  Process sensor = start("netft-server", {"z_sine", "--port", "50001", "--http-port", "50002"});
  const NetFtAddress address{"127.0.0.1", 50001, 50002};
  for (int i = 0; i < 100; ++i) {
    if (test::refusal([&] { fetchNetFtXml(address, 1000); }).empty()) break;
    usleep(50'000);
  }
  parks({"machine.force_sensor=net_ft", "machine.net_ft.host=127.0.0.1",
         "machine.net_ft.port=50001", "machine.net_ft.http_port=50002"});
  const auto s = summary(folder_ / "run");
  EXPECT_NEAR(s["z_peak_to_peak_m"].get<double>(), 0.04, 2e-3);  // simulated legs go as they did
  EXPECT_LT(s["wrench_age_median_s"].get<double>(), 0.02);
  EXPECT_TRUE(s.contains("clock_uncertainty_s"));  // the machine named our commands
  sensor.signal(SIGTERM);
  EXPECT_EQ(sensor.wait(), 0);
}

TEST_F(ComposedRun, AMissingPieceIsNamedAndLockstepRefuses) {
  enterPrivateBus();
  const test::Output lockstep =
      run("z_sine --lockstep --no-plots --set machine.legs=external" + out("a"));
  EXPECT_EQ(lockstep.status, 2);
  EXPECT_NE(lockstep.text.find("runs in real time"), std::string::npos) << lockstep.text;
  const test::Output nobody = run(
      "z_sine --no-plots --set machine.force_sensor=net_ft --set machine.net_ft.host=127.0.0.1" +
      out("b"));
  EXPECT_EQ(nobody.status, 2);
  EXPECT_NE(nobody.text.find("force sensor 127.0.0.1:80"), std::string::npos) << nobody.text;
  const test::Output silent = run("z_sine --no-plots --set machine.robot=external" + out("c"));
  EXPECT_EQ(silent.status, 2);
  EXPECT_NE(silent.text.find("waiting for the robot's joints (VES_JOINTS)"), std::string::npos)
      << silent.text;
}

}  // namespace
}  // namespace ves::devices
