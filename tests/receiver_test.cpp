// SPDX-License-Identifier: BSD-3-Clause
//
// The oracle is liblcm, which sends; datagrams that it would never send are written byte by byte
// (LCM, "UDP Multicast Protocol Description").
#include "ves/bus/receiver.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <lcm/lcm-cpp.hpp>
#include <random>

#include "ves/bus/bus.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

using Datagram = std::string;

const char* const kGroup = "239.255.76.67";
constexpr std::uint16_t kPort = 7667;

Datagram bigEndian(std::uint32_t value, int bytes = 4) {
  Datagram out;
  for (int i = bytes - 1; i >= 0; --i) out += static_cast<char>(value >> 8 * i);
  return out;
}

Datagram whole(const std::string& channel, const std::string& data) {
  return "LC02" + bigEndian(0) + channel + '\0' + data;
}

struct Part {
  std::uint32_t sequence, size, offset, number, parts;
};

Datagram part(const Part& p, const std::string& rest) {
  return "LC03" + bigEndian(p.sequence) + bigEndian(p.size) + bigEndian(p.offset) +
         bigEndian(p.number, 2) + bigEndian(p.parts, 2) + rest;
}

const std::string kFirst = std::string("CHANNEL") + '\0';

/// Somebody on the bus who writes datagrams.
class Sender {
 public:
  Sender() {
    to_.sin_family = AF_INET;
    to_.sin_port = htons(kPort);
    inet_aton(kGroup, &to_.sin_addr);
  }
  ~Sender() { close(fd_); }
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  void send(const Datagram& datagram) {
    ASSERT_EQ(sendto(fd_, datagram.data(), datagram.size(), 0,
                     reinterpret_cast<const sockaddr*>(&to_), sizeof to_),
              static_cast<ssize_t>(datagram.size()));
  }

 private:
  int fd_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to_{};
};

class ReceiverOnABus : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { enterPrivateBus(); }

  ReceiverOnABus() { receiver_.hear("CHANNEL"); }

  /// What has come, as "channel:data"; a message that follows it says that nothing else will.
  std::vector<std::string> heard() {
    std::vector<std::string> out;
    receiver_.hear("LAST");
    end_.send(whole("LAST", ""));
    for (;;) {
      std::optional<Received> message;
      if (!receiver_.read(message) && !receiver_.readable(monotonicNow() + 10'000'000'000)) {
        ADD_FAILURE() << "a good message was not heard";
        return out;
      }
      if (!message) continue;
      if (message->channel == "LAST") return out;
      out.push_back(std::string(message->channel) + ':' +
                    std::string(reinterpret_cast<const char*>(message->data), message->size));
    }
  }

  Receiver receiver_{kGroup, kPort};
  Sender sender_, end_;
};

TEST_F(ReceiverOnABus, HearsWhatLcmSaysWholeAndInParts) {
  lcm::LCM lcm("udpm://239.255.76.67:7667?ttl=0");
  receiver_.hear("OTHER");
  std::mt19937 random(1);
  // Around what one datagram holds (65499 with the name), what two parts do, and many.
  constexpr std::size_t kSizes[] = {0,     1,       4,       1400,    65490,    65491,
                                    65492, 130'965, 130'966, 130'967, 1'000'000};
  for (const std::size_t size : kSizes) {
    std::string data(size, ' ');
    for (char& c : data) c = static_cast<char>(random());
    for (const std::string channel : {"CHANNEL", "OTHER", "NOBODYS", "CHANNEL2", "CHANNE"})
      lcm.publish(channel, data.data(), static_cast<unsigned>(size));
    const std::vector<std::string> all = heard();
    ASSERT_EQ(all.size(), 2) << size;
    EXPECT_TRUE(all[0] == "CHANNEL:" + data) << size;
    EXPECT_TRUE(all[1] == "OTHER:" + data) << size;
  }
}

TEST_F(ReceiverOnABus, TakesNoMoreOfAChannelThanItMayHave) {
  lcm::LCM lcm("udpm://239.255.76.67:7667?ttl=0");
  for (const std::size_t longest : {16u, 4096u, 1024u}) receiver_.hear("SHORT", longest);
  const std::string fits(4096, 'a'), longer(4097, 'b'), parts(1'000'000, 'c');
  for (const std::string& data : {parts, longer, fits})
    lcm.publish("SHORT", data.data(), static_cast<unsigned>(data.size()));
  const std::vector<std::string> all = heard();
  ASSERT_EQ(all.size(), 1u);
  EXPECT_TRUE(all[0] == "SHORT:" + fits);
}

TEST_F(ReceiverOnABus, NamesOfEveryLengthAreTheirOwn) {
  lcm::LCM lcm("udpm://239.255.76.67:7667?ttl=0");
  std::vector<std::string> names, expected;
  for (std::size_t length = 1; length <= 63; ++length) names.push_back(std::string(length, 'a'));
  for (std::size_t i = 0; i < names.size(); i += 2) receiver_.hear(names[i]);
  for (const std::string& name : names) lcm.publish(name, "x", 1);
  for (std::size_t i = 0; i < names.size(); i += 2) expected.push_back(names[i] + ":x");
  EXPECT_EQ(heard(), expected);
}

// The first two end liblcm 1.3.1 (lcm-proj/lcm#628): offset and size of a part wrap past 2^32.
TEST_F(ReceiverOnABus, MalformedDatagramsAreNobodys) {
  sender_.send(part({1, 100, 0, 0, 3}, kFirst + std::string(10, 'x')));
  sender_.send(part({1, 100, 0xfffffff0, 1, 3}, std::string(64, 'x')));
  EXPECT_TRUE(heard().empty());
  const std::string name(64, 'n');
  receiver_.hear(name);
  for (const Datagram& bad : std::vector<Datagram>{
           "", "L", "LC02", "LC03", "LC02" + bigEndian(0), "LC03" + bigEndian(0),
           "LC02" + bigEndian(0) + "CHANNEL", whole("", "x"), whole(name, "x"),
           "LC01" + whole("CHANNEL", "x").substr(4), part({1, 4, 0, 0, 1}, ""),
           part({1, 4, 0, 0, 1}, "CHANNEL"), part({1, 4, 0, 0, 1}, kFirst + "abcde"),
           part({1, 4, 1, 0, 1}, kFirst + "abc"), part({1, 4, 0, 1, 1}, "abcd"),
           part({1, 0xffffffff, 0, 0, 1}, kFirst + "abcd"),
           part({1, (4U << 20) + 1, 0, 0, 1}, kFirst + "abcd"),
           part({1, 4, 0, 0, 1}, std::string("CHANNE") + '\0' + "abcd")})
    sender_.send(bad);
  EXPECT_TRUE(heard().empty());
  sender_.send(part({1, 4, 0, 0, 1}, kFirst + "abcd"));
  EXPECT_EQ(heard(), std::vector<std::string>{"CHANNEL:abcd"});
}

TEST_F(ReceiverOnABus, OfPartsOnlyWhatIsWholeAndInOrderCounts) {
  const Datagram a = part({1, 9, 0, 0, 3}, kFirst + "abc"), b = part({1, 9, 3, 1, 3}, "def"),
                 c = part({1, 9, 6, 2, 3}, "ghi");
  const std::vector<std::string> good{"CHANNEL:abcdefghi"};
  const auto says = [&](const std::vector<Datagram>& datagrams) {
    for (const Datagram& d : datagrams) sender_.send(d);
    return heard();
  };
  EXPECT_EQ(says({a, b, c}), good);
  EXPECT_TRUE(says({a, c}).empty());
  EXPECT_TRUE(says({a, c, b}).empty());
  EXPECT_TRUE(says({b, c}).empty());
  EXPECT_TRUE(says({a, b, b, c}).empty());
  for (const Part& other : {Part{2, 9, 3, 1, 3}, Part{1, 8, 3, 1, 3}}) {  // of another message
    EXPECT_TRUE(says({a, part(other, "def"), c}).empty());
    EXPECT_TRUE(says({a, part(other, "def"), b, c}).empty());
  }
  EXPECT_TRUE(says({a, b, part({1, 9, 6, 2, 3}, "ghij")}).empty());
  EXPECT_EQ(says({part({2, 9, 0, 0, 3}, kFirst + "xyz"), a, b, c}), good);  // begun anew
  EXPECT_EQ(says({a, whole("CHANNEL", "now"), b, c}).size(), 2);  // a whole one between them
  EXPECT_TRUE(says({c}).empty());
}

TEST_F(ReceiverOnABus, SendersDoNotMixAndManyDoNotFillTheMemory) {
  Sender other;
  sender_.send(part({1, 4, 0, 0, 2}, kFirst + "ab"));
  other.send(part({1, 4, 0, 0, 2}, kFirst + "AB"));
  other.send(part({1, 4, 2, 1, 2}, "CD"));
  sender_.send(part({1, 4, 2, 1, 2}, "cd"));
  EXPECT_EQ(heard(), (std::vector<std::string>{"CHANNEL:ABCD", "CHANNEL:abcd"}));
  // Of many beginnings the last few can be completed.
  std::vector<Sender> crowd(40);
  for (Sender& s : crowd) s.send(part({1, 4, 0, 0, 2}, kFirst + "ab"));
  EXPECT_TRUE(heard().empty());
  for (Sender& s : crowd) s.send(part({1, 4, 2, 1, 2}, "cd"));
  const std::size_t completed = heard().size();
  EXPECT_GE(completed, 2);
  EXPECT_LE(completed, 8);
}

TEST_F(ReceiverOnABus, AMessageMayHaveFourMebibytes) {
  const std::string piece(1 << 15, 'x');
  for (const std::uint32_t size : {1U << 22, (1U << 22) + 1}) {
    const std::string last(size == 1U << 22 ? 0 : 1, 'x');
    const std::uint32_t number = size >> 15;
    std::size_t heard_of = 0;
    for (std::uint32_t i = 0; i < number; ++i) {
      sender_.send(part({1, size, i << 15, i, number + 1}, (i == 0 ? kFirst : "") + piece));
      if (i % 16 == 15) heard_of += heard().size();  // the kernel's buffer is smaller
    }
    sender_.send(part({1, size, number << 15, number, number + 1}, last));
    heard_of += heard().size();
    EXPECT_EQ(heard_of, size == 1U << 22 ? 1 : 0) << size;
  }
}

TEST_F(ReceiverOnABus, NoiseIsNobodysAndWhatIsGoodComesThrough) {
  std::mt19937 random(2);
  const Datagram good = part({1, 40, 0, 0, 2}, kFirst + std::string(20, 'x'));
  for (int i = 0; i < 3000; ++i) {
    Datagram d = i % 2 ? good : whole("CHANNEL", std::string(20, 'x'));
    for (int k = 0; k < 3; ++k) d[random() % 28] = static_cast<char>(random());
    sender_.send(d.substr(0, random() % (d.size() + 1)));
    if (i % 100 == 0) heard();
  }
  heard();
  sender_.send(whole("CHANNEL", "good"));
  EXPECT_EQ(heard(), std::vector<std::string>{"CHANNEL:good"});
}

// The kernel begins to stamp some time after it was asked to.
TEST_F(ReceiverOnABus, ArrivalIsWhenItCameNotWhenItIsRead) {
  std::int64_t sent = 0;
  std::optional<Received> message;
  for (int i = 0; i < 500 && (!message || message->arrival > sent); ++i) {
    sender_.send(whole("CHANNEL", "x"));
    sent = monotonicNow();
    while (monotonicNow() < sent + 2'000'000) {
    }
    ASSERT_TRUE(receiver_.read(message));
    ASSERT_TRUE(message);
  }
  EXPECT_LE(message->arrival, sent);
}

TEST(Receiver, RefusesAnAddressThatIsNotOne) {
  EXPECT_THROW(Receiver("239.255.76", 1), InputError);
  EXPECT_THROW(Receiver("10.1.2.3", 7667), InputError);
}

}  // namespace
}  // namespace ves
