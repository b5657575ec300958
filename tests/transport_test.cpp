// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <random>

#include "support/ether.hpp"
#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/bus/asking.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/fields.hpp"
#include "ves/config/document.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/announcer.hpp"

namespace ves {
namespace {

using test::refusal;

Sample goodSample() {
  Sample s;
  s.sequence = 7;
  s.time = 123;
  s.adc = {1, -2, 32767, -32768, 5, 6, 7};
  s.legs = {0, 16383, 8000, 8001, 8002, 8003};
  s.q.head<3>() << 0.1, -0.2, 0.3;
  s.switches = kAllSwitches;
  return s;
}

TEST(Gate, LetsNothingOutOfRangeIn) {
  const auto with = [](auto change) {
    sample_t m = toMessage(goodSample(), {1, 2});
    change(m);
    return fromMessage(m).has_value();
  };
  EXPECT_TRUE(with([](sample_t&) {}));
  EXPECT_FALSE(with([](sample_t& m) { m.adc[6] = 32768; }));
  EXPECT_FALSE(with([](sample_t& m) { m.adc[0] = -32769; }));
  EXPECT_FALSE(with([](sample_t& m) { m.legs[5] = 16384; }));
  EXPECT_FALSE(with([](sample_t& m) { m.legs[0] = -1; }));
  EXPECT_FALSE(with([](sample_t& m) { m.q[11] = NAN; }));
  EXPECT_FALSE(with([](sample_t& m) { m.q[0] = INFINITY; }));
  EXPECT_FALSE(with([](sample_t& m) { m.q[0] = 1e9; }));
  EXPECT_FALSE(with([](sample_t& m) { m.header.sequence = -1; }));

  LegCommand command;
  const auto command_with = [&](auto change) {
    leg_command_t m = toMessage(command, header({1, 2}, 0, 0));
    change(m);
    return fromMessage(m).has_value();
  };
  EXPECT_TRUE(command_with([](leg_command_t&) {}));
  EXPECT_FALSE(command_with([](leg_command_t& m) { m.counts[3] = 16384; }));
  EXPECT_FALSE(command_with([](leg_command_t& m) { m.counts[3] = -1; }));
  EXPECT_FALSE(command_with([](leg_command_t& m) { m.engaged = 2; }));
  EXPECT_FALSE(command_with([](leg_command_t& m) { m.segment = 1 << 20; }));

  robot_command_t move{};
  move.duration = 1.0;
  EXPECT_TRUE(fromMessage(move));
  move.target = NAN;
  EXPECT_FALSE(fromMessage(move));
  ToolOrder tool;
  tool.by = true;
  tool.in = ToolOrder::Frame::kInertial;
  tool.position = Vec3(0.1, -0.2, 0.3);
  tool.via = Vec3(0.0, 0.1, 0.0);
  tool.speed = 0.1;
  const auto tool_with = [&](auto change) {
    robot_command_t m = toMessage(tool, header({1, 2}, 0, 0));
    change(m);
    return fromMessage(m);
  };
  const auto same = tool_with([](robot_command_t&) {});
  ASSERT_TRUE(same);
  const auto& back = std::get<ToolOrder>(*same);
  EXPECT_TRUE(back.by);
  EXPECT_EQ(back.in, tool.in);
  EXPECT_EQ(*back.position, *tool.position);
  EXPECT_EQ(*back.via, *tool.via);
  EXPECT_FALSE(back.rpy);
  EXPECT_EQ(back.speed, 0.1);
  for (const auto change : std::initializer_list<void (*)(robot_command_t&)>{
           [](robot_command_t& m) { m.kind = 6; }, [](robot_command_t& m) { m.kind = -1; },
           [](robot_command_t& m) { m.duration = 1.0; }, [](robot_command_t& m) { m.speed = 0.0; },
           [](robot_command_t& m) { m.speed = NAN; }, [](robot_command_t& m) { m.speed = -0.1; },
           [](robot_command_t& m) { m.frame = 3; }, [](robot_command_t& m) { m.frame = -1; },
           [](robot_command_t& m) { m.parts = 0; }, [](robot_command_t& m) { m.parts = 4; },
           [](robot_command_t& m) { m.parts = 8; }, [](robot_command_t& m) { m.position[1] = NAN; },
           [](robot_command_t& m) { m.via[2] = 1e9; }})
    EXPECT_FALSE(tool_with(change));
  const RigidBody box{3.0, Vec3(0.0, 0.0, 0.1), Vec3(0.3, 0.2, 0.1).asDiagonal()};
  const auto load_with = [&](auto change) {
    robot_command_t m = toMessage(HandOrder{box}, header({1, 2}, 0, 0));
    change(m);
    return fromMessage(m);
  };
  const auto load = load_with([](robot_command_t&) {});
  ASSERT_TRUE(load);
  EXPECT_EQ(std::get<HandOrder>(*load).body_T, box);
  for (const auto change : std::initializer_list<void (*)(robot_command_t&)>{
           [](robot_command_t& m) { m.mass = -1.0; }, [](robot_command_t& m) { m.mass = NAN; },
           [](robot_command_t& m) { m.com[0] = INFINITY; },
           [](robot_command_t& m) { m.inertia[0] = -0.1; },
           [](robot_command_t& m) { m.inertia[3] = 0.4; },
           [](robot_command_t& m) { m.inertia[5] = NAN; },
           // Every two axes are possible, all three together are not.
           [](robot_command_t& m) {
             for (int i = 0; i < 6; ++i) m.inertia[i] = i < 3 ? 1.0 : -0.9;
           }})
    EXPECT_FALSE(load_with(change));
  EXPECT_TRUE(
      std::holds_alternative<Release>(*fromMessage(toMessage(Release{}, header({1, 2}, 0, 0)))));
  const PushOrder push{PushOrder::On::kTarget, Vec3(0.1, -0.2, 0.3), Vec3(20, -30, 40), 0.2};
  const auto push_with = [&](auto change) {
    robot_command_t m = toMessage(push, header({1, 2}, 0, 0));
    change(m);
    return fromMessage(m);
  };
  const auto same_push = push_with([](robot_command_t&) {});
  ASSERT_TRUE(same_push);
  EXPECT_EQ(std::get<PushOrder>(*same_push), push);
  for (const auto change : std::initializer_list<void (*)(robot_command_t&)>{
           [](robot_command_t& m) { m.on = 3; }, [](robot_command_t& m) { m.on = -1; },
           [](robot_command_t& m) { m.force[0] = 196.0; },
           [](robot_command_t& m) { m.force[1] = NAN; },
           [](robot_command_t& m) { m.position[2] = INFINITY; },
           [](robot_command_t& m) { m.position[2] = 1e9; },
           [](robot_command_t& m) { m.duration = 0.0; },
           [](robot_command_t& m) { m.duration = 61.0; },
           [](robot_command_t& m) { m.duration = NAN; }})
    EXPECT_FALSE(push_with(change));
  const auto order_with = [](auto change) {
    Order order;
    order.request = Request::kRun;
    order.segment.duration = 3.0;
    order.segment.trajectory = test::sine(2, 0.2, 0.5, 1.0).trajectory;
    operator_t m = toMessage(order, header({1, 2}, 7, 0));
    change(m);
    return fromMessage(m);
  };
  const auto order = order_with([](operator_t&) {});
  ASSERT_TRUE(order);
  EXPECT_EQ(order->id.source, 1);
  EXPECT_EQ(order->id.sequence, 7);
  EXPECT_EQ(order->segment.trajectory.amplitude(2), 0.2);
  EXPECT_EQ(order->segment.trajectory.motion[2], AxisMotion::kSine);
  for (const auto change : std::initializer_list<void (*)(operator_t&)>{
           [](operator_t& m) { m.request = 0; },
           [](operator_t& m) { m.request = static_cast<int>(Request::kCount); },
           [](operator_t& m) { m.kind = 5; }, [](operator_t& m) { m.kind = -1; },
           [](operator_t& m) { m.duration = 0.0; }, [](operator_t& m) { m.duration = NAN; },
           [](operator_t& m) { m.interval = -1.0; }, [](operator_t& m) { m.target[3] = INFINITY; },
           [](operator_t& m) { m.motion[5] = 3; }, [](operator_t& m) { m.final[0] = 1e9; },
           [](operator_t& m) { m.amplitude[1] = NAN; }, [](operator_t& m) { m.frequency[1] = -1; },
           [](operator_t& m) { m.header.sequence = -1; }})
    EXPECT_FALSE(order_with(change));
}

TEST(Decode, TakesExactlyOneMessage) {
  const sample_t m = toMessage(goodSample(), {1, 2});
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
  m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  const auto n = static_cast<std::int64_t>(bytes.size());
  EXPECT_TRUE(decode<sample_t>(bytes.data(), n));
  for (std::int64_t k = 0; k < n; ++k) EXPECT_FALSE(decode<sample_t>(bytes.data(), k)) << k;
  bytes.push_back(0);
  EXPECT_FALSE(decode<sample_t>(bytes.data(), n + 1));
  bytes[0] = static_cast<std::uint8_t>(bytes[0] ^ 1);  // of another version
  EXPECT_FALSE(decode<sample_t>(bytes.data(), n));
  EXPECT_FALSE(decode<leg_command_t>(bytes.data(), n));
}

// --- Links, on a bus in memory -------------------------------------------------------------------

/// Two hosts, nothing late and nothing lost.
struct InMemory {
  InMemory() {
    ether.fate = [](const std::string&) { return test::Ether::Fate{}; };
  }
  test::Ether ether;
  Bus here{std::make_unique<test::MemoryWire>(ether, 0)},
      there{std::make_unique<test::MemoryWire>(ether, 0)};
};

TEST(Link, AHoldOvertakesWhatWaitsAndAllOfItIsAnswered) {
  for (const Request at_once : {Request::kHold, Request::kStop}) {
    InMemory bus;
    ControllerLink link(bus.here, {9, 9});
    std::int64_t sequence = 0;
    const auto give = [&](Request request) {
      bus.there.publish(channel::kOperator,
                        toMessage({request, {}, {}, 9}, header({5, 1}, sequence++, 0)));
    };
    give(Request::kArm);
    give(Request::kTare);
    give(at_once);
    bus.here.drain();
    const Order first = link.takeOrder();
    EXPECT_EQ(first.request, at_once);
    EXPECT_EQ(first.id.sequence, 2);
    for (const std::int64_t overtaken : {0, 1}) {
      const Order order = link.takeOrder();
      EXPECT_EQ(order.request, Request::kOvertaken);
      EXPECT_EQ(order.id.sequence, overtaken);
    }
    EXPECT_EQ(link.takeOrder().request, Request::kNone);
  }
}

TEST(Link, AHoldFindsRoomWhereTheQueueIsFull) {
  InMemory bus;
  ControllerLink link(bus.here, {9, 9});
  for (std::int64_t sequence = 0; sequence < 40; ++sequence)
    bus.there.publish(channel::kOperator,
                      toMessage({Request::kTare, {}, {}, 9}, header({5, 1}, sequence, 0)));
  bus.there.publish(channel::kOperator,
                    toMessage({Request::kHold, {}, {}, 9}, header({5, 1}, 40, 0)));
  bus.here.drain();
  EXPECT_EQ(link.takeOrder().request, Request::kHold);
  int waited = 0;
  while (link.takeOrder().request == Request::kOvertaken) ++waited;
  EXPECT_EQ(waited, 16);
  EXPECT_EQ(link.rejected(), 40 - 16);
}

TEST(Link, NobodyFillsAMachinesMemoryWithOrdersToItsRobot) {
  InMemory bus;
  PlantLink link(bus.here, Identity{1, 1});
  for (int k = 0; k < 1000; ++k)
    bus.there.publish(channel::kRobot,
                      toMessage(RobotOrder(RobotMove{0, 0.1, 1.0}), header({5, 1}, k, 0)));
  bus.here.drain();
  EXPECT_EQ(link.takeRobotOrders().size(), PlantLink::kRobotOrders);
  EXPECT_EQ(link.rejected(), 1000 - static_cast<std::int64_t>(PlantLink::kRobotOrders));
  EXPECT_EQ(link.refusedRobotOrders(), link.rejected());
  // One that cannot be is refused; one for another machine is its own affair.
  robot_command_t order = toMessage(RobotOrder(RobotMove{0, 0.1, -1.0}), header({5, 1}, 0, 0));
  bus.there.publish(channel::kRobot, order);
  order.machine = 7;
  bus.there.publish(channel::kRobot, order);
  bus.here.drain();
  EXPECT_EQ(link.refusedRobotOrders(), 1001 - static_cast<std::int64_t>(PlantLink::kRobotOrders));
}

TEST(Bus, WhatAHandlerThrowsComesUpInTheLoopThatReads) {
  InMemory bus;
  int heard = 0;
  bus.here.subscribe({channel::kTiming}, [&](const std::string&, const void*, std::uint32_t) {
    ++heard;
    throw InputError("the disk is full");
  });
  for (int k = 0; k < 3; ++k) bus.there.publish(channel::kTiming, timing_t{});
  bus.here.drain();
  EXPECT_EQ(heard, 3);  // one that throws keeps nothing from the others
  EXPECT_THROW(bus.here.rethrow(), InputError);
  EXPECT_NO_THROW(bus.here.rethrow());
}

/// A client in time steps of 10 ms, and what the controller hears of it.
struct Client {
  explicit Client(Request request) : asking({request, {}, {}, 9}, {5, 1}, 3) {
    bus.here.subscribe({channel::kOperator},
                       [this](const std::string&, const void* data, std::uint32_t size) {
                         const auto m = decode<operator_t>(data, size);
                         ASSERT_TRUE(m);
                         EXPECT_EQ(m->header.source, 5);
                         EXPECT_EQ(m->header.sequence, 3);
                         EXPECT_EQ(m->controller, 9);
                         ++heard;
                       });
  }
  void pass(double seconds) {
    for (int k = 0; k < std::lround(100.0 * seconds); ++k) {
      asking.say(bus.there, now);
      now += 10'000'000;
      bus.here.drain();
    }
  }
  void answer(std::int64_t controller, std::int64_t to, std::int64_t sequence, Refusal refusal) {
    state_t state{};
    state.header.source = controller;
    state.order_source = to;
    state.order_sequence = sequence;
    state.refusal = static_cast<decltype(state.refusal)>(refusal);
    asking.hear(state);
  }

  InMemory bus;
  Asking asking;
  std::int64_t now = 7'000'000'000;  // [ns]
  int heard = 0;
};

TEST(Asking, SaysAnOrderFiveTimesASecondUntilItIsAnswered) {
  Client client(Request::kArm);
  client.pass(1.0);
  EXPECT_EQ(client.heard, 5);
  client.answer(9, 6, 3, Refusal::kNone);      // to another
  client.answer(9, 5, 2, Refusal::kNone);      // to an earlier one
  client.answer(8, 5, 3, Refusal::kNone);      // by another
  client.answer(9, 5, 3, Refusal::kChecking);  // no answer yet
  EXPECT_TRUE(client.asking.underWay());
  EXPECT_FALSE(client.asking.answer());
  client.answer(9, 5, 3, Refusal::kBusy);
  client.answer(9, 6, 0, Refusal::kNone);  // what comes after it takes nothing of it
  EXPECT_FALSE(client.asking.underWay());
  EXPECT_EQ(client.asking.answer(), Refusal::kBusy);
  client.pass(1.0);
  EXPECT_EQ(client.heard, 5);
}

TEST(Asking, GivesUpAfterTwoSecondsAndOfAVehicleAfterFiveMinutes) {
  for (const auto& [request, seconds] :
       {std::pair{Request::kTare, 2.0}, std::pair{Request::kVehicle, 300.0}}) {
    Client client(request);
    client.pass(seconds);
    EXPECT_TRUE(client.asking.underWay());
    EXPECT_EQ(client.heard, std::lround(5.0 * seconds));
    client.pass(1.0);
    EXPECT_FALSE(client.asking.underWay());
    EXPECT_FALSE(client.asking.answer());
    EXPECT_EQ(client.heard, std::lround(5.0 * seconds));
    client.answer(9, 5, 3, Refusal::kNone);  // late, and true all the same
    EXPECT_EQ(client.asking.answer(), Refusal::kNone);
  }
}

TEST(Bus, WhoOnlySpeaksWaitsForNothing) {
  InMemory bus;
  EXPECT_FALSE(bus.there.wait(0));
  EXPECT_FALSE(bus.there.waitAwake(0));
}

// --- Bus: inside a network of its own ------------------------------------------------------------

class PrivateBus : public testing::Test {
 protected:
  static void SetUpTestSuite() { enterPrivateBus(); }

  /// Lets both ends hear each other.
  static void settle(Bus& a, Bus& b, const std::function<bool()>& done) {
    for (int i = 0; i < 100 && !done(); ++i) {
      a.wait(10);
      b.wait(10);
    }
    ASSERT_TRUE(done());
  }
};

TEST_F(PrivateBus, ControllerKeepsTheNewestSampleOfTheNewestPlant) {
  Bus machine(kDefaultUrl), controller(kDefaultUrl);
  ControllerLink link(controller, {9, 9});
  const auto send = [&](std::int64_t sequence, std::int64_t epoch) {
    Sample s = goodSample();
    s.sequence = sequence;
    machine.publish(channel::kSample, toMessage(s, {1, epoch}));
  };
  send(5, 100);
  settle(machine, controller, [&] { return link.sample().sequence == 5; });
  send(4, 100);  // late
  send(9, 50);   // a ghost
  sample_t broken = toMessage(goodSample(), {1, 100});
  broken.header.sequence = 8;
  broken.q[0] = NAN;
  machine.publish(channel::kSample, broken);
  settle(machine, controller, [&] { return link.rejected() == 3; });
  EXPECT_EQ(link.sample().sequence, 5);
  link.takeConflict();
  send(0, 200);  // the plant was started anew
  settle(machine, controller, [&] { return link.sample().sequence == 0; });
  EXPECT_FALSE(link.takeConflict());

  leg_command_t engaged = toMessage(LegCommand{}, header({9, 9}, 0, 0));
  engaged.engaged = 1;
  link.send(engaged);
  send(77, 300);  // another machine, while we have the legs of this one
  settle(machine, controller, [&] { return link.rejected() == 4; });
  EXPECT_EQ(link.sample().sequence, 0);
  EXPECT_TRUE(link.takeConflict());
}

TEST_F(PrivateBus, SamplesThatAreNotTakenAreCountedByTheirCause) {
  Bus machine(kDefaultUrl), controller(kDefaultUrl);
  ControllerLink link(controller, {9, 9});
  std::int64_t sent = 0;
  const auto send = [&](std::int64_t sequence, const Identity& from, const auto& spoil) {
    Sample s = goodSample();
    s.sequence = sequence;
    sample_t m = toMessage(s, from);
    spoil(m);
    machine.publish(channel::kSample, m);
    ++sent;
  };
  const auto as_it_is = [](sample_t&) {};
  send(5, {1, 100}, as_it_is);
  settle(machine, controller, [&] { return link.sample().sequence == 5; });
  for (int i = 0; i < 2; ++i) send(6, {1, 100}, [](sample_t& m) { m.temperature = 1e9; });
  for (int i = 0; i < 3; ++i) send(7, {2, 50}, as_it_is);
  for (int i = 0; i < 4; ++i) send(4, {1, 100}, as_it_is);
  settle(machine, controller, [&] { return link.rejected() == sent - 1; });
  EXPECT_EQ(link.samplesRejected().malformed, 0);
  EXPECT_EQ(link.samplesRejected().out_of_range, 2);
  EXPECT_EQ(link.samplesRejected().of_another, 3);
  EXPECT_EQ(link.samplesRejected().old, 4);
}

TEST(Rejections, AreToldByTheirCauses) {
  EXPECT_EQ(Rejections().text(), "");
  Rejections of;
  of.malformed = 1;
  of.out_of_range = 2;
  of.of_another = 3;
  of.old = 4;
  const std::string text = of.text();
  for (const char* told : {"10 samples", "1 malformed", "2 with a value out of range",
                           "3 of another", "4 of an earlier sequence"})
    EXPECT_NE(text.find(told), std::string::npos) << text;
}

TEST_F(PrivateBus, WhoWaitsForNothingWaitsAsLongAsTold) {
  Bus bus(kDefaultUrl);
  bus.subscribe({channel::kTiming}, [](const std::string&, const void*, std::uint32_t) {});
  for (const auto wait : {&Bus::wait, &Bus::waitAwake}) {
    const std::int64_t start = monotonicNow();
    EXPECT_FALSE((bus.*wait)(30));
    EXPECT_GE(monotonicNow() - start, 30'000'000);
  }
}

TEST_F(PrivateBus, AMachinesClockIsKnownFromWhatGoesToAndFro) {
  Bus machine(kDefaultUrl), controller(kDefaultUrl);
  const Identity self{9, 9};
  ControllerLink link(controller, self);
  PlantLink plant(machine, std::nullopt);
  std::int64_t tick = 0;
  // Hosts whose clocks are an hour ahead, then a machine on another one, two hours behind.
  for (const auto& [epoch, ahead] :
       {std::pair{100LL, 3'600'000'000'000LL}, {200LL, -7'200'000'000'000LL}}) {
    const std::int64_t theirs = ahead + 100'000'000'000'000;
    for (std::int64_t i = 0; i < 20; ++i, ++tick) {
      link.send(toMessage(LegCommand{}, header(self, tick, monotonicNow())));
      settle(machine, controller, [&] { return plant.lastHeard().sequence == tick; });
      Sample s = goodSample();
      s.sequence = i;
      s.time = monotonicNow() + theirs;
      s.legs_time = s.wrench_time = s.joints_time = s.time;
      sample_t m = toMessage(s, {1, epoch});
      m.command_source = plant.lastHeard().source;
      m.command_sequence = plant.lastHeard().sequence;
      m.command_time_ns = plant.lastHeard().time + theirs;
      machine.publish(channel::kSample, m);
      settle(machine, controller, [&] { return link.sampleTime() == s.time; });
    }
    const std::int64_t now = monotonicNow();
    EXPECT_LE(std::abs(link.clock().offset(now) - theirs), link.clock().uncertainty(now));
    EXPECT_LT(link.clock().uncertainty(now), 50'000'000);
  }
}

TEST_F(PrivateBus, WhoComesLateHearsTheConfiguration) {
  Bus late(kDefaultUrl), controller(kDefaultUrl);
  const std::int64_t begun = monotonicNow();
  std::int64_t heard = 0, sequence = -1, told = 0;
  late.subscribe({channel::kExperiment},
                 [&](const std::string&, const void* data, std::uint32_t size) {
                   const auto m = decode<experiment_t>(data, size);
                   ASSERT_TRUE(m);
                   EXPECT_EQ(m->resolved, "name: x");
                   EXPECT_GT(m->header.sequence, sequence);
                   sequence = m->header.sequence;
                   EXPECT_GT(m->header.time_ns, std::max(told, begun - 1));
                   told = m->header.time_ns;
                   EXPECT_LE(told, monotonicNow());
                   ++heard;
                 });
  experiment_t experiment;
  experiment.header = header({7, 8}, 0, 0);
  experiment.schema = kSchema;
  experiment.resolved = "name: x";
  MachineSetup setup;
  setup.arming_samples = 77;
  std::int64_t setups = 0;
  late.subscribe({channel::kSetup}, [&](const std::string&, const void* data, std::uint32_t size) {
    const auto m = decode<setup_t>(data, size);
    ASSERT_TRUE(m);
    EXPECT_EQ(m->arming_samples, 77);
    EXPECT_EQ(m->header.source, 7);
    EXPECT_EQ(m->header.sequence, sequence);  // after the configuration it belongs to
    EXPECT_EQ(m->header.time_ns, told);
    ++setups;
  });
  Announcer announcer(controller, kDefaultUrl, experiment, setup);
  while (setups < 3 && late.wait(5000)) {
  }
  EXPECT_EQ(heard, 3);
  announcer.tell(Phase::kRunning);  // one may be under way
  while (late.wait(1500)) {
  }
  EXPECT_LE(heard, 4);
  const std::int64_t before = heard;
  for (int i = 0; i < 100; ++i) {
    query_t query;
    query.header = header({1, 1}, i, 0);
    late.publish(channel::kQuery, query);
  }
  controller.drain();
  while (late.wait(1500)) {
  }
  EXPECT_GT(heard, before);
  EXPECT_LE(heard, before + 2);  // however often it is asked
  EXPECT_EQ(setups, heard);
}

TEST_F(PrivateBus, OneControllerHasTheLegs) {
  Bus machine(kDefaultUrl), bus(kDefaultUrl);
  PlantLink link(machine, Identity{1, 1});
  ControllerLink first(bus, {1, 1}), second(bus, {2, 1});
  std::int64_t now = 0;
  const auto send = [&](std::int64_t source, std::int64_t sequence, bool engaged) {
    LegCommand c;
    c.engaged = engaged;
    c.counts.fill(static_cast<std::int32_t>(1000 * source));
    bus.publish(channel::kLegCommand, toMessage(c, header({source, 1}, sequence, 0)));
  };
  const auto taken = [&] {
    for (int i = 0; i < 20; ++i) machine.wait(10);
    link.setTime(now);
    const auto command = link.takeCommand();
    return command ? command->first.counts[0] : 0;
  };
  send(1, 0, true);
  EXPECT_EQ(taken(), 1000);
  send(2, 0, true);
  EXPECT_EQ(taken(), 0);  // refused
  send(2, 1, false);
  send(1, 1, true);
  EXPECT_EQ(taken(), 1000);
  send(1, 0, true);  // out of order
  EXPECT_EQ(taken(), 0);
  now += PlantLink::kSilence + 1;
  link.setTime(now);
  send(2, 2, true);  // the first is silent
  EXPECT_EQ(taken(), 2000);
  for (int i = 0; i < 20; ++i) bus.wait(10);
  EXPECT_TRUE(first.takeConflict());
  EXPECT_TRUE(second.takeConflict());
  EXPECT_FALSE(first.takeConflict());
}

TEST_F(PrivateBus, RandomBytesOnEveryChannelAreNobodys) {
  Bus machine(kDefaultUrl), bus(kDefaultUrl);
  PlantLink plant(machine, Identity{1, 1});
  ControllerLink controller(bus, {1, 1});
  lcm::LCM raw(kDefaultUrl);
  std::mt19937 random(3);
  std::int64_t sent = 0;
  for (int k = 0; k < 3000; ++k) {
    std::vector<std::uint8_t> noise(random() % 600);
    for (auto& b : noise) b = static_cast<std::uint8_t>(random());
    for (const std::string& channel :
         {channel::kSample, channel::kLegCommand, channel::kOperator, channel::kRobot}) {
      raw.publish(channel, noise.data(), static_cast<unsigned>(noise.size()));
      ++sent;
    }
    for (int tries = 0; tries < 50 && plant.rejected() + controller.rejected() < sent; ++tries) {
      machine.wait(1);
      bus.wait(1);
    }
  }
  EXPECT_GT(plant.rejected() + controller.rejected(), sent / 2);
  EXPECT_FALSE(plant.takeCommand());
  EXPECT_EQ(controller.sample().sequence, -1);
}

TEST(Messages, OfAnotherSchemaAreNotDecoded) {
  for (const std::int32_t schema : {kSchema - 1, kSchema, kSchema + 1}) {
    experiment_t m{};
    m.schema = schema;
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
    m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    EXPECT_EQ(
        decode<experiment_t>(bytes.data(), static_cast<std::int64_t>(bytes.size())).has_value(),
        schema == kSchema);
  }
}

TEST(Messages, EveryOrderToTheRobotComesOutAsItWentIn) {
  const auto through = [](const RobotOrder& order) {
    const auto out = fromMessage(toMessage(order, header({1, 2}, 3, 4)));
    EXPECT_TRUE(out);
    return out.value_or(RobotOrder(Release()));
  };
  const RobotMove move{2, -0.3, 1.5};
  EXPECT_EQ(std::get<RobotMove>(through(move)), move);
  EXPECT_TRUE(std::holds_alternative<Release>(through(Release())));
  for (const auto on : {PushOrder::On::kPlatform, PushOrder::On::kTool, PushOrder::On::kTarget}) {
    const PushOrder push{on, {0.1, -0.2, 0.3}, {11.0, -12.0, 13.0}, 2.5};
    EXPECT_EQ(std::get<PushOrder>(through(push)), push);
  }
  HandOrder hand;
  hand.body_T = {2.0, {0.01, -0.02, 0.03}, Mat3::Zero()};
  hand.body_T.I_Bcm_B << 0.04, 0.001, 0.002, 0.001, 0.05, 0.003, 0.002, 0.003, 0.06;
  EXPECT_EQ(std::get<HandOrder>(through(hand)).body_T, hand.body_T);
  for (int parts = 1; parts < 8; ++parts)
    for (const auto in :
         {ToolOrder::Frame::kRobot, ToolOrder::Frame::kPlatform, ToolOrder::Frame::kInertial}) {
      ToolOrder tool;
      tool.by = parts % 2 == 0;
      tool.in = in;
      if (parts & 1) tool.position = Vec3(0.1, 0.2, 0.3);
      if (parts & 2) tool.rpy = Vec3(0.4, 0.5, 0.6);
      if (parts & 4) tool.via = Vec3(0.7, 0.8, 0.9);
      (parts & 1 ? tool.duration : tool.speed) = 0.25;
      const auto sent = toMessage(tool, header({1, 2}, 3, 4));
      const auto came = fromMessage(sent);
      if (!came) {
        EXPECT_TRUE(tool.via && !tool.position) << parts;  // a way to nowhere
        continue;
      }
      const auto& out = std::get<ToolOrder>(*came);
      EXPECT_EQ(out.by, tool.by);
      EXPECT_EQ(out.in, tool.in);
      EXPECT_EQ(out.position, tool.position);
      EXPECT_EQ(out.rpy, tool.rpy);
      EXPECT_EQ(out.via, tool.via);
      EXPECT_EQ(out.duration, tool.duration);
      EXPECT_EQ(out.speed, tool.speed);
    }
}

// The visitor names every byte of an encoding: nothing is left out, nothing counted twice.
TEST(Messages, FieldsCoverEveryByteOfTheirEncoding) {
  const auto covers = [](const auto& m) {
    std::size_t bytes = kFingerprintSize + kHeaderSize;
    forEachField(m, [&](const char*, const auto& value) { bytes += sizeof value; });
    EXPECT_EQ(bytes, static_cast<std::size_t>(m.getEncodedSize())) << m.getTypeName();
  };
  covers(state_t{});
  covers(leg_command_t{});
  // Found by another route: a byte that a known field alone sets.
  state_t a{}, b{};
  b.x_ddot[4] = 1.0;
  std::vector<std::uint8_t> left(static_cast<std::size_t>(a.getEncodedSize())), right(left.size());
  a.encode(left.data(), 0, static_cast<int>(left.size()));
  b.encode(right.data(), 0, static_cast<int>(right.size()));
  const auto at = std::mismatch(left.begin(), left.end(), right.begin()).first - left.begin();
  EXPECT_EQ(fieldAt<state_t>(static_cast<std::size_t>(at)), "state_t.x_ddot[4]");
}

}  // namespace
}  // namespace ves
