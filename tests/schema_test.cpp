// SPDX-License-Identifier: BSD-3-Clause
//
// The one description of what travels (contract/schema.hpp): a value of its own in every field
// comes out of the bus, a log, the table, MCAP and Python as it went in.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/fields.hpp"
#include "ves/export/lcm_definition.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

/// Every number of a struct by the name of its field, as "x[2]".
using Numbers = std::vector<std::pair<std::string, double>>;

template <typename S>
Numbers numbersOf(const S& s) {
  Numbers out;
  schema::forEach(s, [&](const auto& field) {
    const auto add = [&](const auto& values) {
      int i = 0;
      for (const auto& value : values)
        out.emplace_back(field.name + ("[" + std::to_string(i++) + "]"),
                         static_cast<double>(value));
    };
    using V = std::remove_cvref_t<decltype(field.value)>;
    if constexpr (std::same_as<V, Wrench> || std::same_as<V, Pose>)
      add(field.value.stacked().eval());
    else if constexpr (std::same_as<V, Tripped>)
      out.emplace_back(field.name, field.value.bits());
    else if constexpr (std::same_as<V, Mat6> || std::same_as<V, Mat3>) {
      const int n = static_cast<int>(field.value.cols());
      for (int i = 0; i < n * n; ++i)
        out.emplace_back(field.name + ("[" + std::to_string(i) + "]"), field.value(i / n, i % n));
    } else if constexpr (requires { std::size(field.value); })
      add(field.value);
    else
      out.emplace_back(field.name, static_cast<double>(field.value));
  });
  return out;
}

/// Another value in every number; of enumerations and flags, not the one they begin with.
template <typename S>
S filled() {
  S s;
  int n = 0;
  const auto set = [&](auto& to) {
    using V = std::remove_cvref_t<decltype(to)>;
    ++n;
    if constexpr (std::same_as<V, bool>)
      to = !to;
    else if constexpr (std::is_enum_v<V>)
      to = static_cast<V>((static_cast<int>(to) + 1) % static_cast<int>(V::kCount));
    else if constexpr (std::is_floating_point_v<V>)
      to = n + 0.5;
    else
      to = static_cast<V>(n);
  };
  schema::forEach(s, [&](const auto& field) {
    auto& value = field.value;
    using V = std::remove_cvref_t<decltype(value)>;
    if constexpr (std::same_as<V, Wrench>) {
      for (Vec3* half : {&value.f, &value.n})
        for (double& x : *half) set(x);
    } else if constexpr (std::same_as<V, Pose>) {
      for (Vec3* half : {&value.p, &value.rpy})
        for (double& x : *half) set(x);
    } else if constexpr (std::same_as<V, Mat6> || std::same_as<V, Mat3>) {
      for (auto row : value.rowwise())
        for (double& x : row) set(x);
    } else if constexpr (std::same_as<V, Tripped>) {
      value = Tripped(static_cast<std::uint32_t>(++n));
    } else if constexpr (requires { std::begin(value); }) {
      for (auto& x : value) set(x);
    } else {
      set(value);
    }
  });
  return s;
}

Sample filledSample() {
  auto s = filled<Sample>();
  s.sequence = 3;
  s.time = 1'000'000;
  s.switches = kFloorMatClosed;
  s.faults = kLegsPiece | kRobotPiece;
  return s;
}

MachineSetup filledSetup() {
  auto s = filled<MachineSetup>();
  s.legs.scale *= 1e-3;
  s.joint_max += s.joint_max;
  s.joints = 7;
  return s;
}

Order filledOrder() {
  auto o = filled<Order>();
  o.request = Request::kRun;
  o.id = {1, 3};
  Segment& s = o.segment;
  s.target = Pose::from(0.1 * s.target.stacked());
  s.trajectory.final *= 0.1;
  s.trajectory.amplitude *= 0.1;
  return o;
}

template <typename Message>
std::vector<std::uint8_t> bytesOf(const Message& m) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
  m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

TEST(Schema, NoTwoNumbersOfAFilledStateAreAlike) {  // so that an exchange shows
  std::set<double> seen;
  const TickState nothing;
  const Numbers before = numbersOf(nothing), numbers = numbersOf(filled<TickState>());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    EXPECT_NE(numbers[i].second, before[i].second) << numbers[i].first;
    if (numbers[i].second > 22.0) {
      EXPECT_TRUE(seen.insert(numbers[i].second).second) << numbers[i].first;
    }
  }
  EXPECT_GT(seen.size(), 140u);
}

TEST(Schema, EveryFieldComesOutOfItsMessage) {
  const auto goes = [](const auto& s, const auto& message) {
    const auto back = fromMessage(message);
    ASSERT_TRUE(back);
    EXPECT_EQ(numbersOf(*back), numbersOf(s));
  };
  goes(filledSample(), toMessage(filledSample(), {1, 2}));
  LegCommand command = filled<LegCommand>();
  command.laboratory.E_H.X.R = rotationOf({0.3, -0.7, 2.0});
  goes(command, toMessage(command, header({1, 2}, 3, 4)));
  command.laboratory.E_H.X.R(1, 2) += 1e-3;  // which turns nothing
  EXPECT_FALSE(fromMessage(toMessage(command, header({1, 2}, 3, 4))));
  goes(filledSetup(), toMessage(filledSetup(), header({1, 2}, 3, 4)));
  goes(filled<TickState>(), toMessage(filled<TickState>(), header({1, 2}, 3, 4)));
  goes(filledOrder(), toMessage(filledOrder(), header({1, 2}, 3, 4)));
}

TEST(Schema, WhatAnOrderDoesNotNeedCannotMakeItUnheard) {
  operator_t m = toMessage(filledOrder(), header({1, 2}, 3, 4));
  m.request = static_cast<int>(Request::kHold);
  m.kind = m.motion[3] = 99;
  m.duration = m.final[2] = NAN;
  const auto order = fromMessage(m);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->request, Request::kHold);
  EXPECT_EQ(order->controller, m.controller);
}

TEST(Schema, AStateThatNamesNoSuchPhaseIsNone) {
  const auto with = [](auto change) {
    state_t m = toMessage(filled<TickState>(), header({1, 2}, 3, 4));
    change(m);
    return fromMessage(m).has_value();
  };
  EXPECT_TRUE(with([](state_t&) {}));
  EXPECT_FALSE(with([](state_t& m) { m.phase = static_cast<int>(Phase::kCount) + 1; }));
  EXPECT_FALSE(with([](state_t& m) { m.refusal = -1; }));
  EXPECT_FALSE(with([](state_t& m) { m.tripped = 1 << static_cast<int>(Check::kCount); }));
  EXPECT_FALSE(with([](state_t& m) { m.engaged = 2; }));
}

TEST(Schema, ASetupThatNoDriverCanKeepIsNone) {
  const auto with = [](auto change) {
    setup_t m = toMessage(filledSetup(), header({1, 2}, 3, 4));
    change(m);
    return fromMessage(m).has_value();
  };
  EXPECT_TRUE(with([](setup_t&) {}));
  for (void (*change)(setup_t&) :
       {+[](setup_t& m) { m.leg_scale[3] = 0.0; }, +[](setup_t& m) { m.leg_offset[5] = NAN; },
        +[](setup_t& m) { m.leg_home[0] = kMaxLegCount + 1; },
        +[](setup_t& m) { m.hold_after_ns = 0; }, +[](setup_t& m) { m.joints = kMaxJoints + 1; },
        +[](setup_t& m) { m.leg_velocity = NAN; }, +[](setup_t& m) { m.joint_max[2] = NAN; },
        +[](setup_t& m) { m.wrench_per_count[35] = INFINITY; }})
    EXPECT_FALSE(with(change));
}

TEST(Schema, EveryFieldComesOutOfTheBus) {
  enterPrivateBus();
  Bus controller(kDefaultUrl), listener(kDefaultUrl);
  std::optional<TickState> heard;
  listener.subscribe({channel::kState},
                     [&](const std::string&, const void* data, std::uint32_t size) {
                       if (const auto m = decode<state_t>(data, size)) heard = fromMessage(*m);
                     });
  controller.publish(channel::kState, toMessage(filled<TickState>(), header({1, 2}, 3, 4)));
  for (int i = 0; i < 50 && !heard; ++i) listener.wait(100);
  ASSERT_TRUE(heard);
  EXPECT_EQ(heard->tick, 3);
  EXPECT_EQ(numbersOf(*heard), numbersOf(filled<TickState>()));
}

TEST(Schema, EveryFieldComesOutOfALog) {
  const fs::path file = fs::temp_directory_path() / fmt::format("ves_schema_{}.lcmlog", getpid());
  {
    LogWriter log(file.string());
    log.write(channel::kState, toMessage(filled<TickState>(), header({1, 2}, 3, 4)), 0);
  }
  LogReader log(file.string());
  LogEvent event;
  ASSERT_TRUE(log.next(event));
  const auto state = fromMessage(event.require<state_t>(file.string()));
  fs::remove(file);
  ASSERT_TRUE(state);
  EXPECT_EQ(numbersOf(*state), numbersOf(filled<TickState>()));
}

/// With a mass in link 0, so that there are as many uncertain bodies as a state has room for.
Experiment ninebodied(Experiment e) {
  for (RobotModel* robot : {&e.controller.payload.robot, &e.plant.payload.robot})
    robot->base = {20.0, Vec3(0.01, 0.02, 0.1), Mat3::Identity()};
  return e;
}

/// Runs in which everything happens that a state can tell.
std::set<std::string> everTold() {
  const Numbers before = numbersOf(TickState());
  std::set<std::string> told;
  const auto look = [&](const TickState& s) {
    const Numbers now = numbersOf(s);
    for (std::size_t i = 0; i < now.size(); ++i)
      if (now[i].second != before[i].second) told.insert(now[i].first);
  };
  std::string jets;
  for (int i = 0; i < kMostThrusters; ++i)
    jets += std::string(i ? ", " : "") + "{at_m: [0.1, 0, 0], force_n: [0, 0, 0.1]}";
  std::int64_t orders = 0;
  const auto run = [&](Lockstep& loop, int ticks) {
    for (int i = 0; i < ticks; ++i) look(loop.step());
  };
  const auto order = [&](Lockstep& loop, Request request, int ticks, const Segment& segment = {}) {
    look(loop.step({request, segment, {7, ++orders}}));
    run(loop, ticks);
  };
  const auto loopOf = [](const std::string& scenario, const std::vector<std::string>& set) {
    const Experiment e = test::experiment(scenario, set);
    return Lockstep(e.controller, e.plant);
  };
  {  // a motion of the robot with everything that compensates, and a push into the envelope
    std::vector<std::string> set = test::kCompensated;
    set.insert(set.end(),
               {"controller.compensation.wrench=aided", "controller.compensation.adaptation=true"});
    Lockstep loop = loopOf("puma_on_table_4_1", set);
    order(loop, Request::kStart, 700);
    Order another{Request::kVehicle, {}, {7, ++orders}};
    another.vehicle = {{2.0, 0.5, 3.0}, 1.0};
    another.verdict = {Stability::kStable, Stability::kStable};
    look(loop.step(another));
    run(loop, 1800);
    Lockstep pushed = loopOf("puma_on_table_4_1", {"base.stiffness_diagonal=[150, 250, 400, "
                                                   "1500, 1000, 2000]"});
    pushed.disturb = [](Sample& s) {
      if (s.sequence > 600)
        s.adc[2] = std::min(s.adc[2] + 8 * static_cast<int>(s.sequence - 600), 20'000);
    };
    order(pushed, Request::kStart, 1500);
  }
  {  // masses and what is in hand, of as many bodies as there may be
    std::vector<std::string> set = test::kCompensated;
    set.insert(set.end(), {"controller.compensation.wrench=aided",
                           "controller.compensation.learns_masses=true", "sensor.noise=false"});
    const Experiment e = ninebodied(test::experiment("srms_capture_doss", set));
    Lockstep loop(e.controller, e.plant);
    order(loop, Request::kStart, 600);
    order(loop, Request::kGripper, 200);
  }
  {  // as published, where the energy that is put in has to be paid
    Lockstep loop = loopOf("srms_low_hover_puma",
                           {"controller.passivity.enabled=true", "controller.passivity.reserve_j=0",
                            "controller.passivity.damping_per_s=5"});
    order(loop, Request::kStart, 2500);
  }
  {  // a laboratory that flies along
    Lockstep loop = loopOf("satellite_tumbling", {});
    order(loop, Request::kStart, 500);
  }
  {  // a vehicle that floats, its thrusters on by schedule, orders and attitude hold
    Lockstep loop = loopOf("satellite_hold", {"base.free.thrusters=[" + jets + "]"});
    order(loop, Request::kStart, 600);
    Order fired{Request::kThrust, {}, {7, ++orders}};
    fired.thrust.setConstant(0.5);
    look(loop.step(fired));
    run(loop, 20);
  }
  {  // calibrations, a monitor segment, refusals and a trip, ticks missed, a node that conflicts
    Lockstep loop = loopOf("puma_on_table_4_1", {});
    run(loop, 20);
    order(loop, Request::kArm, 20);
    order(loop, Request::kRun, 100, test::sine(1, 0.02, 1.0, 0.5));
    loop.disturb = [](Sample& s) { s.q(1) += 1e-2 * static_cast<double>(s.sequence % 2); };
    order(loop, Request::kRun, 700, test::segment(SegmentKind::kCalibration));
    loop.disturb = {};
    Segment monitor = test::segment(SegmentKind::kMonitor, 60.0);
    monitor.interval = 20.0;
    order(loop, Request::kRun, 300, monitor);
    order(loop, Request::kHold, 50);
    Segment outside = test::segment(SegmentKind::kMove);
    outside.target.p.z() = 9.0;
    order(loop, Request::kRun, 50, outside);
    loop.advance(3);
    run(loop, 2);
    loop.disturb = [](Sample& s) { s.sequence = 5; };
    run(loop, 2);
    loop.disturb = {};
    loop.input.conflicting_node = true;
    run(loop, 2);
  }
  {  // a program that cannot start its admittance control
    Lockstep loop = loopOf("puma_on_table_4_1", {"safety.start_force_n=0.001"});
    order(loop, Request::kStart, 2500);
  }
  return told;
}

TEST(Schema, NoFieldOfAStateStaysAsItBegan) {
  const std::set<std::string> told = everTold();
  std::string silent;
  for (const auto& [name, value] : numbersOf(TickState()))
    if (!told.contains(name)) silent += " " + name;
  EXPECT_EQ(silent, "");
}

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> out(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
}

TEST(Schema, EveryFieldHasItsColumnsWithTheirUnits) {
  Experiment e = ninebodied(test::experiment("srms_capture_doss"));
  Compensation& compensation = e.controller.compensation;
  compensation.aided = compensation.adaptation = compensation.learns_masses = true;
  e.controller.moving_frame.enabled = true;
  FreeBodyModel floats;
  floats.propulsion.size = kMostThrusters;
  e.controller.vehicle = floats;
  Row row{};
  row.state = toMessage(filled<TickState>(), header({1, 2}, 3, 4));
  const std::vector<Column> all = columns(e);
  const std::vector<std::string> names = cells(csvHeader(all)), values = cells(csvRow(all, row));
  ASSERT_EQ(names.size(), values.size());
  std::map<std::string, std::string> table;
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_TRUE(table.emplace(names[i], values[i]).second) << names[i] << " stands there twice";
    EXPECT_FALSE(all[i].meaning.empty()) << names[i];
  }
  // Every number is somewhere, and nowhere twice.
  std::multiset<double> told;
  for (const auto& [name, value] : table)
    if (value.find_first_not_of("0123456789.") == std::string::npos) told.insert(std::stod(value));
  for (const auto& [name, value] : numbersOf(filled<TickState>()))
    if (value > 22.0 && name != "tripped" && name != "latched") {
      EXPECT_EQ(told.count(value), 1u) << name;
    }
  // Some by hand: of each kind one, with its unit.
  const TickState s = filled<TickState>();
  const auto number = [&](const std::string& name) { return std::stod(table.at(name)); };
  EXPECT_EQ(number("fz_total_n"), s.total.f.z());
  EXPECT_EQ(number("mx_static_nm"), s.static_wrench.n.x());
  EXPECT_EQ(number("gamma_commanded_rad"), s.motion.x(5));
  EXPECT_EQ(number("x_commanded_rate_m_per_s"), s.motion.x_dot(0));
  EXPECT_EQ(number("alpha_commanded_acceleration_rad_per_s2"), s.motion.x_ddot(3));
  EXPECT_EQ(number("beta_measured_rad"), s.measured.rpy.y());
  EXPECT_EQ(number("leg6_measured_m"), s.L_measured(5));
  EXPECT_EQ(number("leg2_gain_extend_per_s"), s.servo.extend(1));
  EXPECT_EQ(number("link_0_learnt_mass_kg"), s.learnt.mass(0));
  EXPECT_EQ(number("hand_learnt_mass_deviation_kg"), s.learnt.mass_deviation(8));
  EXPECT_EQ(number("link_2_y_learnt_moment_kgm"), s.learnt.moment(7));
  EXPECT_EQ(number("fy_bias_count"), s.bias(1));
  EXPECT_EQ(number("leg3_rest_count"), s.command.rest[2]);
  EXPECT_EQ(number("energy_paid_j"), s.energy_paid);
  EXPECT_EQ(number("passivity_damping_per_s"), s.passivity_damping);
  EXPECT_EQ(number("ahead_ns"), static_cast<double>(s.command.ahead));
  EXPECT_EQ(number("r32_laboratory"), s.command.laboratory.E_H.X.R(2, 1));
  EXPECT_EQ(number("y_laboratory_rate_rad_per_s"), s.command.laboratory.E_H.w(1));
  EXPECT_EQ(table.at("phase"), "armed");
  EXPECT_EQ(table.at("kind"), "move");
  EXPECT_EQ(table.at("cause"), "floor mat");
  EXPECT_EQ(table.at("refusal"), "the legs are not armed");
  std::string set;
  s.tripped.forEach([&](Check c) { set += (set.empty() ? "" : "+") + std::string(name(c)); });
  EXPECT_EQ(table.at("tripped"), set);
}

TEST(Schema, WhatIsOffHasNoColumns) {
  const auto namesWith = [](const std::function<void(Experiment&)>& change) {
    Experiment e = ninebodied(test::experiment("srms_capture_doss"));
    Compensation& compensation = e.controller.compensation;
    compensation.aided = compensation.adaptation = compensation.learns_masses = true;
    e.controller.moving_frame.enabled = true;
    FreeBodyModel floats;
    floats.propulsion.size = 1;
    e.controller.vehicle = floats;
    change(e);
    const std::vector<std::string> names = cells(csvHeader(columns(e)));
    return std::set<std::string>(names.begin(), names.end());
  };
  const std::set<std::string> all = namesWith([](Experiment&) {});
  struct Off {
    std::function<void(Experiment&)> change;
    std::vector<std::string> parts;  // of the names of its columns
  };
  const std::vector<Off> offs = {
      {[](Experiment& e) { e.controller.compensation.aided = false; }, {"_reaction_"}},
      {[](Experiment& e) { e.controller.compensation.adaptation = false; },
       {"_gain_extend_", "_gain_retract_", "_servo_delay_"}},
      {[](Experiment& e) { e.controller.compensation.learns_masses = false; }, {"_learnt_"}},
      {[](Experiment& e) { e.controller.moving_frame.enabled = false; },
       {"laboratory", "emulated_"}},
      {[](Experiment& e) { e.controller.vehicle = FreeBodyModel(); },
       {"vehicle_time_", "thruster"}}};
  for (const Off& off : offs) {
    const std::set<std::string> left = namesWith(off.change);
    for (const std::string& name : all) {
      const bool of_it = std::any_of(
          off.parts.begin(), off.parts.end(),
          [&](const std::string& part) { return name.find(part) != std::string::npos; });
      EXPECT_EQ(left.count(name), of_it ? 0u : 1u) << name << " without " << off.parts[0];
    }
  }
}

/// Numbers of a message as ROS 2 has it, read by its definition's text.
Numbers rosNumbers(const std::string& definition, const std::string& cdr) {
  Numbers out;
  std::size_t at = 4;  // after the encapsulation's header
  std::istringstream lines(definition);
  const std::map<std::string, std::size_t> sizes = {
      {"int8", 1}, {"int32", 4}, {"int64", 8}, {"float64", 8}};
  for (std::string line; std::getline(lines, line) && line[0] != '=';) {
    std::istringstream words(line);
    std::string type, name;
    words >> type >> name;
    if (type == "ves_msgs/Header") {
      at += 48;
      continue;
    }
    int count = 1;
    const std::size_t open = type.find('[');
    if (open != std::string::npos) {
      count = std::stoi(type.substr(open + 1));
      type.erase(open);
    }
    const std::size_t size = sizes.at(type);
    for (int i = 0; i < count; ++i) {
      at = 4 + (at - 4 + size - 1) / size * size;
      double value = 0.0;
      const auto read = [&](auto number) {
        std::memcpy(&number, cdr.data() + at, sizeof number);
        value = static_cast<double>(number);
      };
      if (type == "int8") read(std::int8_t{});
      if (type == "int32") read(std::int32_t{});
      if (type == "int64") read(std::int64_t{});
      if (type == "float64") read(double{});
      at += size;
      out.emplace_back(open == std::string::npos ? name : fmt::format("{}[{}]", name, i), value);
    }
  }
  EXPECT_EQ(at, cdr.size());
  return out;
}

TEST(Schema, EveryFieldComesOutOfMcap) {
  const auto goes = [](const auto& s, const auto& message) {
    const LcmDefinition definition = LcmDefinition::of(message.getTypeName());
    EXPECT_EQ(rosNumbers(definition.ros2(), definition.cdr(bytesOf(message))), numbersOf(s));
  };
  goes(filled<TickState>(), toMessage(filled<TickState>(), header({1, 2}, 3, 4)));
  goes(filledSample(), toMessage(filledSample(), {1, 2}));
  goes(filledSetup(), toMessage(filledSetup(), header({1, 2}, 3, 4)));
}

TEST(Schema, EveryFieldComesOutOfPython) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("ves_schema_{}", getpid());
  fs::create_directories(folder);
  const auto goes = [&](const auto& s, const auto& message) {
    const std::vector<std::uint8_t> bytes = bytesOf(message);
    std::ofstream(folder / "message", std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
    std::ofstream(folder / "read.py") << fmt::format(
        "import sys\n"
        "sys.path.insert(0, '{}/../python')\n"
        "from ves import {} as kind\n"
        "m = kind.decode(open('{}/message', 'rb').read())\n"
        "for name in kind.__slots__[1:]:\n"
        "    value = getattr(m, name)\n"
        "    for i, x in enumerate(value if hasattr(value, '__len__') else [value]):\n"
        "        print(name + (f'[{{i}}]' if hasattr(value, '__len__') else ''), repr(float(x)))\n",
        VES_TEST_APP_DIR, message.getTypeName(), folder.string());
    std::istringstream said(test::sh(fmt::format("python3 {}/read.py", folder.string())).text);
    Numbers told;
    for (std::string name, value; said >> name >> value;) told.emplace_back(name, std::stod(value));
    EXPECT_EQ(told, numbersOf(s));
  };
  goes(filled<TickState>(), toMessage(filled<TickState>(), header({1, 2}, 3, 4)));
  goes(filled<LegCommand>(), toMessage(filled<LegCommand>(), header({1, 2}, 3, 4)));
  goes(filledSample(), toMessage(filledSample(), {1, 2}));
  fs::remove_all(folder);
}

/// Lines of a file.
std::vector<std::string> linesOf(const fs::path& file) {
  std::ifstream in(file);
  std::vector<std::string> out;
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

// The definitions of messages, the lists of their fields and their table, as the build writes them.
class Describe : public test::Programs {
 protected:
  template <typename S>
  void goes(const std::string& values, const std::vector<std::string>& table) {
    const S s{};
    const schema::Message& message = schema::kMessage<S>;
    const auto lcm = linesOf(folder_ / (std::string(message.name) + ".lcm"));
    ASSERT_FALSE(lcm.empty()) << message.name;
    EXPECT_EQ(lcm.front(), "package ves;");
    EXPECT_EQ(lcm.back(), "}");
    std::string about;  // in lines that fit
    auto line = lcm.begin() + 2;
    for (; line->starts_with("// "); ++line) {
      EXPECT_LE(line->size(), 100u) << *line;
      about += line->substr(2);
    }
    EXPECT_EQ(about, " " + std::string(message.about));
    EXPECT_EQ(*line++, "struct " + std::string(message.name) + " {");
    EXPECT_EQ(*line++, "  header_t header;");
    auto row = std::find(table.begin(), table.end(), "## " + std::string(message.name));
    ASSERT_NE(row, table.end());
    EXPECT_EQ(*(row + 2), message.about);
    row += 6;
    std::string list;
    schema::forEach(s, [&](const auto& field) {
      // "  double x[6];  // [m | rad] what it means", and the same as a row.
      const std::string name = field.name, unit = "[" + std::string(field.unit) + "]";
      EXPECT_NE(line->find(" " + name + (line->find(name + "[") == std::string::npos ? ";" : "[")),
                std::string::npos)
          << *line;
      EXPECT_NE(
          line->find(";  // " + unit + (*field.meaning ? " " + std::string(field.meaning) : "")),
          std::string::npos)
          << *line;
      if (!*field.meaning) {
        EXPECT_TRUE(line->ends_with("]") || line->find("; 0 ") != std::string::npos);
      }
      EXPECT_TRUE(row->starts_with("| `" + name + "` | ")) << *row;
      EXPECT_NE(row->find(" | " + std::string(field.unit) + " | " + field.meaning),
                std::string::npos)
          << *row;
      list += (list.empty() ? "m." : ", m.") + name;
      ++line;
      ++row;
    });
    EXPECT_EQ(*line, "}");
    for (const std::string qualifier : {"", "const "})
      EXPECT_NE(values.find("void values(" + qualifier + message.name + "& m, auto&& f) { f(" +
                            list + "); }\n"),
                std::string::npos)
          << message.name;
    EXPECT_NE(values.find("#include <ves/" + std::string(message.name) + ".hpp>\n"),
              std::string::npos);
  }
};

TEST_F(Describe, EveryFieldHasItsLineItsRowAndItsPlaceInTheList) {
  fs::create_directories(folder_ / "ves");
  const test::Output made =
      test::sh(std::string("'") + VES_TEST_APP_DIR + "/../src/ves_describe' " + folder_.string());
  ASSERT_EQ(made.status, 0) << made.text;
  std::stringstream values;
  values << std::ifstream(folder_ / "ves" / "values.hpp").rdbuf();
  const auto table = linesOf(folder_ / "messages.md");
  goes<Sample>(values.str(), table);
  goes<LegCommand>(values.str(), table);
  goes<MachineSetup>(values.str(), table);
  goes<Order>(values.str(), table);
  goes<TickState>(values.str(), table);
  const auto phase = std::find_if(table.begin(), table.end(), [](const std::string& row) {
    return row.starts_with("| `phase` |");
  });
  ASSERT_NE(phase, table.end());
  EXPECT_NE(phase->find("0 disarmed, 1 armed, 2 running"), std::string::npos) << *phase;
  EXPECT_EQ(test::sh(std::string("'") + VES_TEST_APP_DIR + "/../src/ves_describe'").status, 2);
}

}  // namespace
}  // namespace ves
