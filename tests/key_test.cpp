// SPDX-License-Identifier: BSD-3-Clause
//
// A bus with a key: what is forged, altered, moved or replayed is nobody's.
#include "ves/bus/key.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <lcm/lcm-cpp.hpp>
#include <random>

#include "support/programs.hpp"
#include "support/refusal.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

using Bytes = std::vector<std::uint8_t>;

template <typename Message>
Bytes encoded(const Message& m) {
  Bytes bytes(static_cast<std::size_t>(m.getEncodedSize()));
  m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

class KeyFile {
 public:
  explicit KeyFile(const std::string& text = std::string(64, 'a'), mode_t mode = 0600)
      : name(std::filesystem::temp_directory_path() /
             ("ves_key_" + std::to_string(getpid()) + "_" + std::to_string(count_++))) {
    std::ofstream(name) << text;
    chmod(name.c_str(), mode);
  }
  ~KeyFile() { std::filesystem::remove(name); }
  const std::string name;

 private:
  static inline int count_ = 0;
};

TEST(Key, FilesThatAreNoKeyOrForAllToReadAreRefused) {
  const auto refused = [](const KeyFile& file) {
    return test::refusal([&] { Key key(file.name); });
  };
  EXPECT_EQ(refused(KeyFile()), "");
  EXPECT_EQ(refused(KeyFile(std::string(64, 'A') + "\n")), "");
  EXPECT_EQ(refused(KeyFile(std::string(64, '0') + "\r\n")), "");  // from another system's editor
  EXPECT_NE(refused(KeyFile(std::string(64, 'a'), 0640)).find("mode 0640, want 0600"),
            std::string::npos);
  EXPECT_NE(refused(KeyFile(std::string(64, 'a'), 0604)).find("mode"), std::string::npos);
  for (const std::string& text :
       {std::string(), std::string(62, 'a'), std::string(63, 'a'), std::string(65, 'a'),
        std::string(66, 'a'), std::string(63, 'a') + "g", std::string(32, '\0')})
    EXPECT_NE(refused(KeyFile(text)).find("64 hexadecimal digits"), std::string::npos) << text;
  EXPECT_NE(test::refusal([] { Key key("/no/such.key"); }).find("No such file"), std::string::npos);
}

TEST(Key, TheSignatureIsKeyedBlake2b) {
  // hashlib.blake2b(b"VES_X\0" + m with bytes 40 to 55 zero, digest_size=16, key=bytes(range(32)))
  std::string digits;
  for (int i = 0; i < 32; ++i) digits += fmt::format("{:02x}", i);
  const KeyFile file(digits);
  Bytes m(64);
  for (std::size_t i = 0; i < m.size(); ++i) m[i] = static_cast<std::uint8_t>(3 * i + 1);
  Key(file.name).sign("VES_X", m.data(), m.size());
  std::string signature;
  for (std::size_t i = 40; i < 56; ++i) signature += fmt::format("{:02x}", m[i]);
  EXPECT_EQ(signature, "31b7be591797338b3b59511bdc685af8");
}

TEST(Key, EveryBitAndTheChannelAreSigned) {
  const KeyFile file, other(std::string(63, 'a') + "b");
  const Key key(file.name);
  Bytes m = encoded(toMessage(LegCommand(), header({1, 2}, 3, 4)));
  EXPECT_FALSE(key.signedBy("VES_LEG_COMMAND", m.data(), m.size()));
  key.sign("VES_LEG_COMMAND", m.data(), m.size());
  EXPECT_TRUE(key.signedBy("VES_LEG_COMMAND", m.data(), m.size()));
  EXPECT_FALSE(key.signedBy("VES_LEG_COMMANE", m.data(), m.size()));
  EXPECT_FALSE(Key(other.name).signedBy("VES_LEG_COMMAND", m.data(), m.size()));
  for (std::size_t bit = 0; bit < 8 * m.size(); ++bit) {
    Bytes altered = m;
    altered[bit / 8] = static_cast<std::uint8_t>(altered[bit / 8] ^ (1u << (bit % 8)));
    EXPECT_FALSE(key.signedBy("VES_LEG_COMMAND", altered.data(), altered.size())) << bit;
  }
  for (std::size_t size = 0; size < m.size(); ++size)
    EXPECT_FALSE(key.signedBy("VES_LEG_COMMAND", m.data(), size)) << size;
  m.push_back(0);
  EXPECT_FALSE(key.signedBy("VES_LEG_COMMAND", m.data(), m.size()));
}

TEST(Replay, NothingOlderOfASenderIsTakenAgain) {
  ReplayGuard guard;
  const auto fresh = [&](const char* channel, std::int64_t source, std::int64_t epoch,
                         std::int64_t sequence) {
    const Bytes m = encoded(toMessage(LegCommand(), header({source, epoch}, sequence, 0)));
    return guard.fresh(channel, m.data());
  };
  EXPECT_TRUE(fresh("VES_SAMPLE", 1, 5, 10));
  EXPECT_TRUE(fresh("VES_SAMPLE", 1, 5, 10));  // said again, as it was not heard
  EXPECT_FALSE(fresh("VES_SAMPLE", 1, 5, 9));
  EXPECT_TRUE(fresh("VES_STATE", 1, 5, 9));  // each channel counts for itself
  EXPECT_TRUE(fresh("VES_SAMPLE", 2, 5, 9));
  EXPECT_TRUE(fresh("VES_SAMPLE", 1, 6, 0));  // started anew
  EXPECT_FALSE(fresh("VES_SAMPLE", 1, 5, 11));
  EXPECT_TRUE(fresh("VES_ROBOT", 1, 5, 3));
  EXPECT_FALSE(fresh("VES_ROBOT", 1, 5, 3));  // one order, one motion
  EXPECT_TRUE(fresh("VES_ROBOT", 1, 5, 4));
  for (std::int64_t source = 0; source < 400; ++source) fresh("VES_STATE", 1000 + source, 5, 5);
  EXPECT_FALSE(fresh("VES_STATE", 5000, 5, 5));  // full: no stranger of the same time gets in
  EXPECT_TRUE(fresh("VES_SAMPLE", 1, 6, 1));
  EXPECT_FALSE(fresh("VES_SAMPLE", 1, 6, 0));
  // Newer ones take the place of who is most silent; those whom it forgets do not come back.
  for (std::int64_t k = 0; k < 300; ++k) {
    EXPECT_TRUE(fresh("VES_STATE", 9000 + k, 10 + k, 5));
    EXPECT_TRUE(fresh("VES_SAMPLE", 1, 6, 2 + k));  // it lives on
  }
  EXPECT_FALSE(fresh("VES_STATE", 1001, 5, 6));
  EXPECT_FALSE(fresh("VES_STATE", 9001, 11, 6));
  EXPECT_FALSE(fresh("VES_SAMPLE", 1, 6, 5));
  EXPECT_TRUE(fresh("VES_OPERATOR", 1, 400, 3));
  EXPECT_FALSE(fresh("VES_OPERATOR", 1, 400, 3));
}

// What was replaced had a later epoch than who is most silent now.
TEST(Replay, WhoWasForgottenStaysOutWhateverIsSilentSince) {
  ReplayGuard guard;
  const auto fresh = [&](std::int64_t source, std::int64_t epoch, std::int64_t sequence) {
    const Bytes m = encoded(toMessage(LegCommand(), header({source, epoch}, sequence, 0)));
    return guard.fresh("VES_STATE", m.data());
  };
  EXPECT_TRUE(fresh(1, 100, 1));
  std::int64_t senders = 1;
  while (fresh(1000 + senders, 5, 1)) ++senders;  // until there is no room
  EXPECT_GT(senders, 2);
  EXPECT_TRUE(fresh(2, 200, 1));
  EXPECT_FALSE(fresh(1, 100, 2));
  EXPECT_TRUE(fresh(3, 101, 1));
}

// --- Both ends of a bus with a key
// -----------------------------------------------------------------

class KeyedBus : public testing::Test {
 protected:
  static void SetUpTestSuite() { enterPrivateBus(); }
  std::string url() const { return std::string(kDefaultUrl) + "&key=" + key_.name; }

  /// Everything that is on its way has come.
  void settle(std::initializer_list<Bus*> buses) {
    for (int i = 0; i < 5; ++i)
      for (Bus* bus : buses) {
        bus->wait(20);
        bus->drain();
      }
  }
  const KeyFile key_;
};

sample_t sample(const Identity& machine, std::int64_t sequence, std::int64_t answers_to) {
  Sample s;
  s.sequence = sequence;
  s.time = monotonicNow();
  s.legs_time = s.wrench_time = s.joints_time = s.time;
  s.legs.fill(8000);
  sample_t m = toMessage(s, machine);
  m.command_source = answers_to;
  return m;
}

TEST_F(KeyedBus, OnlyAMachineThatAnswersIsTaken) {
  Bus machine(url()), controller(url()), stranger(kDefaultUrl);
  ControllerLink link(controller, {9, 9});
  stranger.publish(channel::kSample, sample({1, 50}, 5, 9));  // not signed
  machine.publish(channel::kSample, sample({2, 60}, 6, 8));   // recorded with another controller
  settle({&controller});
  EXPECT_EQ(link.sample().sequence, -1);
  EXPECT_EQ(controller.refused().forged, 1);
  EXPECT_FALSE(link.takeConflict());
  machine.publish(channel::kSample, sample({3, 55}, 7, 9));
  settle({&controller});
  EXPECT_EQ(link.sample().sequence, 7);
  EXPECT_EQ(link.machine(), 3);
  machine.publish(channel::kSample, sample({2, 60}, 8, 8));  // newer, and still no answer
  settle({&controller});
  EXPECT_EQ(link.machine(), 3);
  EXPECT_FALSE(link.takeConflict());
}

TEST_F(KeyedBus, CommandsAndOrdersThatAreForgedAlteredOrReplayedAreIgnored) {
  Bus machine(url()), controller(url()), stranger(kDefaultUrl);
  PlantLink link(machine, Identity{3, 3});
  lcm::LCM raw(kDefaultUrl);
  std::vector<std::pair<std::string, Bytes>> heard;
  stranger.subscribe({channel::kLegCommand, channel::kRobot},
                     [&](const std::string& channel, const void* data, std::uint32_t n) {
                       const auto* bytes = static_cast<const std::uint8_t*>(data);
                       heard.emplace_back(channel, Bytes(bytes, bytes + n));
                     });
  const auto command = [&](std::int64_t sequence, std::int64_t meant) {
    LegCommand c;
    c.engaged = true;
    c.counts.fill(static_cast<std::int32_t>(8000 + sequence));
    leg_command_t m = toMessage(c, header({9, 9}, sequence, monotonicNow()));
    m.machine = meant;
    return m;
  };
  controller.publish(channel::kLegCommand, command(0, 0));  // hello: it does not know us yet
  settle({&machine});
  EXPECT_FALSE(link.takeCommand());
  EXPECT_EQ(link.lastHeard().source, 9);                    // and our samples will say so
  controller.publish(channel::kLegCommand, command(1, 4));  // a recording, for an earlier machine
  settle({&machine});
  EXPECT_FALSE(link.takeCommand());
  for (std::int64_t k = 2; k < 6; ++k) controller.publish(channel::kLegCommand, command(k, 3));
  robot_command_t order = toMessage(RobotMove{1, 0.3, 1.0}, header({9, 9}, 1, 0));
  order.machine = 3;
  controller.publish(channel::kRobot, order);
  settle({&machine, &stranger});
  ASSERT_TRUE(link.takeCommand());
  EXPECT_EQ(link.takeRobotOrders().size(), 1u);
  ASSERT_EQ(heard.size(), 7u);

  stranger.publish(channel::kLegCommand,
                   command(1'000'000, 3));  // the live source and epoch, forged
  std::mt19937 random(1);
  for (int i = 0; i < 500; ++i) {
    auto [channel, bytes] = heard[random() % heard.size()];
    if (i % 2) bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
    raw.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size()));
    if (i % 50 == 0) settle({&machine});
  }
  settle({&machine});
  EXPECT_FALSE(link.takeCommand());
  EXPECT_TRUE(link.takeRobotOrders().empty());
  EXPECT_GT(machine.refused().forged, 240);
  EXPECT_GT(machine.refused().replayed, 150);
  // Recordings of what the same controller told another machine.
  controller.publish(channel::kLegCommand, command(6, 4));
  order = toMessage(RobotMove{1, 0.3, 1.0}, header({9, 9}, 2, 0));
  order.machine = 4;
  controller.publish(channel::kRobot, order);
  settle({&machine});
  EXPECT_FALSE(link.takeCommand());
  EXPECT_TRUE(link.takeRobotOrders().empty());
  controller.publish(channel::kLegCommand, command(7, 3));  // the true one's next is taken
  settle({&machine});
  ASSERT_TRUE(link.takeCommand());
}

// Whoever looks second would take it for a replay.
TEST_F(KeyedBus, EveryoneWhoSubscribedHearsAnOrderOnce) {
  Bus hearer(url()), sender(url());
  int first = 0, second = 0;
  for (int* count : {&first, &second})
    hearer.subscribe({channel::kOperator},
                     [count](const std::string&, const void*, std::uint32_t) { ++*count; });
  operator_t order{};
  order.header = header({9, 9}, 1, 0);
  sender.publish(channel::kOperator, order);
  settle({&hearer});
  EXPECT_EQ(first, 1);
  EXPECT_EQ(second, 1);
  EXPECT_EQ(hearer.refused().replayed, 0);
}

TEST_F(KeyedBus, TheConfigurationIsSignedTooAndReadableByAll) {
  Bus reader(url()), open(kDefaultUrl), sender(url());
  int keyed = 0, plain = 0;
  const auto count = [](int& n) {
    return [&n](const std::string&, const void* data, std::uint32_t size) {
      n += decode<experiment_t>(data, size).has_value();
    };
  };
  reader.subscribe({channel::kExperiment}, count(keyed));
  open.subscribe({channel::kExperiment}, count(plain));
  experiment_t m{};
  m.header = header({1, 1}, 0, 0);
  m.schema = kSchema;
  m.resolved = std::string(100'000, 'x');
  sender.publish(channel::kExperiment, m);
  settle({&reader, &open});
  EXPECT_EQ(keyed, 1);
  EXPECT_EQ(plain, 1);
  open.publish(channel::kExperiment, m);
  settle({&reader, &open});
  EXPECT_EQ(keyed, 1);
}

TEST(Bus, AddressesAreReadWholeOrRefused) {
  const BusAddress plain("udpm://239.255.76.67:7667");
  EXPECT_EQ(plain.ttl, 0);
  EXPECT_EQ(plain.lcm, "udpm://239.255.76.67:7667?ttl=0");
  const BusAddress all("udpm://239.255.76.67:7667?ttl=3&key=/a b/c.key");
  EXPECT_EQ(all.ttl, 3);
  EXPECT_EQ(all.key_file, "/a b/c.key");
  EXPECT_EQ(all.lcm, "udpm://239.255.76.67:7667?ttl=3");
  EXPECT_EQ(BusAddress("udpm://239.255.76.67:7667?key=k&ttl=1").key_file, "k");
  for (const char* bad : {"", "udpm://1.2.3.4:7667", "udpm://239.255.76.67",
                          "udpm://239.255.76.67:0", "udpm://239.255.76.67:7667?",
                          "udpm://239.255.76.67:7667?ttl=", "udpm://239.255.76.67:7667?ttl=-1",
                          "udpm://239.255.76.67:7667?ttl=256", "udpm://239.255.76.67:7667?ttl=1x",
                          "udpm://239.255.76.67:7667&ttl=1",
                          "udpm://239.255.76.67:7667?ttl=1?key=k", "udpm://239.255.76.67:7667?key=",
                          "udpm://239.255.76.67:7667?size=1", "udpm://239.255.76.67:7667x"})
    EXPECT_NE(test::refusal([&] { BusAddress address(bad); }).find("want udpm://"),
              std::string::npos)
        << bad;
  EXPECT_EQ(openBusWarning("udpm://239.255.76.67:7667?ttl=0"), "");
  EXPECT_EQ(openBusWarning("udpm://239.255.76.67:7667?ttl=1&key=k"), "");
  EXPECT_NE(openBusWarning("udpm://239.255.76.67:7667?ttl=1"), "");
}

// --- A whole run under attack
// -------------------------------------------------------------------------

class KeyedRun : public test::Programs {};

TEST_F(KeyedRun, ParksAndReplaysWhileEverythingOnTheBusIsForgedAlteredAndReplayed) {
  enterPrivateBus();
  const KeyFile key;
  const std::string url = std::string(kDefaultUrl) + "&key=" + key.name;
  untilNothingIsLost([&] {
    Bus attacker(kDefaultUrl);
    lcm::LCM raw(kDefaultUrl);
    std::vector<std::pair<std::string, Bytes>> heard;
    attacker.subscribe(
        {channel::kSample, channel::kLegCommand, channel::kOperator, channel::kRobot},
        [&](const std::string& channel, const void* data, std::uint32_t n) {
          const auto* bytes = static_cast<const std::uint8_t*>(data);
          if (heard.size() < 5000) heard.emplace_back(channel, Bytes(bytes, bytes + n));
        });
    Process run = start("run", {"z_sine", "--no-plots", "--quiet", "--url", url, "--out",
                                (folder_ / "run").string(), "--set", kShortProgram});
    std::mt19937 random(7);
    for (std::int64_t i = 0; run.running(); ++i) {
      attacker.drain();
      if (heard.empty() || i % 4 == 0) {
        attacker.wait(2);
        continue;
      }
      auto [channel, bytes] = heard[random() % heard.size()];
      if (channel == channel::kSample && i % 3 == 0) channel = channel::kLegCommand;
      if (i % 4 == 1)
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1 + random() % 255);
      if (i % 4 == 2 && bytes.size() > 23) bytes[20] = 0x7f;  // far ahead, by the live source
      raw.publish(channel, bytes.data(), static_cast<unsigned>(bytes.size()));
    }
    EXPECT_EQ(run.wait(), 0);
    return (folder_ / "run/run.lcmlog").string();
  });
  EXPECT_EQ(summary(folder_ / "run")["ended"], "parked");
}

}  // namespace
}  // namespace ves
