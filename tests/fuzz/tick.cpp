// SPDX-License-Identifier: BSD-3-Clause
//
// The whole tick, driven by arbitrary samples and orders: whatever comes in, every command that
// leaves lies inside the limits and near the one before.
#include <algorithm>
#include <cstdio>

#include "bytes.hpp"
#include "ves/bus/messages.hpp"
#include "ves/config/experiment.hpp"

namespace {

using namespace ves;

std::int64_t all_ticks = 0;

Segment segment(fuzz::Bytes& in) {
  Segment s;
  s.kind = static_cast<SegmentKind>(in.take<std::uint8_t>() % 5);
  s.duration = 0.01 * in.take<std::uint16_t>();
  s.interval = 0.1 * in.take<std::uint8_t>();
  Vec6 target;
  for (int i = 0; i < 6; ++i) {
    target(i) = 1e-5 * in.take<std::int16_t>();
    s.trajectory.motion[static_cast<std::size_t>(i)] =
        static_cast<AxisMotion>(in.take<std::uint8_t>() % static_cast<int>(AxisMotion::kCount));
    s.trajectory.final(i) = 1e-5 * in.take<std::int16_t>();
    s.trajectory.amplitude(i) = 1e-5 * in.take<std::int16_t>();
    s.trajectory.frequency(i) = 0.02 * in.take<std::uint8_t>();
  }
  s.target = Pose::from(target);
  return s;
}

VehicleOrder vehicle(fuzz::Bytes& in) {
  const auto factor = [&] { return in.take<std::uint8_t>() / 64.0; };  // [-] 0 to 4
  VehicleOrder order;
  order.to = {factor(), factor(), factor()};
  order.over = 0.1 * in.take<std::uint8_t>();
  return order;
}

Experiment experiment(std::vector<std::string> set) {
  set.insert(set.end(),
             {"controller.stability=forced", "controller.stability_uncompensated=forced"});
  return loadExperiment(VES_TEST_CONFIG_DIR "/scenarios/puma_on_table_4_1.yaml", set);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Experiment published = experiment({}),
                          compensated = experiment({"controller.compensation.feed_forward=true",
                                                    "controller.compensation.observer=true",
                                                    "controller.compensation.inertia=true",
                                                    "sensor.readings_per_tick=4"});
  const Experiment& e = size % 2 == 0 ? published : compensated;
  const double count = e.plant.transducer.scale;
  const SafetyLimits& limits = e.controller.safety;
  fuzz::Bytes in(data, size);
  TestPlatform platform(e.controller);
  TickInput input;
  Sample& s = input.sample;
  s.q = e.plant.task.initial_joints;
  s.switches = kAllSwitchesClosed;
  s.adc[6] = (limits.pressure_min + limits.pressure_max) / 2;
  s.sequence = 0;
  const Geometry& g = e.controller.geometry;
  s.legs = legCounts(e.controller.legs, legLengths(g, g.fromHome({})));
  Vec6 last = Vec6::Zero();
  bool was_engaged = false;

  const auto tick = [&] {
    const TickState& state = platform.tick(input);
    ++all_ticks;
    input.tick += 1;
    input.order = {};
    input.conflicting_node = false;
    if (state.command.engaged) {
      const Vec6 L = legLengths(e.controller.legs, state.command.counts);
      fuzz::require(L.minCoeff() >= limits.leg_min - count &&
                    L.maxCoeff() <= limits.leg_max + count);
      fuzz::require(!was_engaged ||
                    (L - last).cwiseAbs().maxCoeff() <= limits.leg_velocity * 0.01 + 2.0 * count);
      fuzz::require(state.motion.x.allFinite());
      last = L;
      s.legs = state.command.counts;  // a machine that follows, until the fuzzer says otherwise
    }
    was_engaged = state.command.engaged;
    s.sequence += 1;
    s.adc[0] ^= 1;
    input.time += e.controller.period;
    s.time = input.time;
    s.legs_time = s.wrench_time = s.joints_time = s.time;
  };

  // Armed first: a fuzzer seldom sends ten good samples in a row.
  for (int i = 0; i < 14; ++i) tick();
  input.order.request = Request::kArm;
  tick();
  tick();
  fuzz::require(was_engaged);
  while (!in.empty()) {
    const std::uint8_t what = in.take<std::uint8_t>();
    switch (what % 16) {
      case 0: s.adc[what / 16 % 7] = in.take<std::int16_t>(); break;
      case 1: s.legs[what / 16 % 6] += in.take<std::int8_t>(); break;
      case 2: s.legs[what / 16 % 6] = in.take<std::uint16_t>(); break;
      case 3: s.q(what / 16 % 12) = in.take<double>(); break;
      case 4: s.q(what / 16 % 6) += 1e-3 * in.take<std::int8_t>(); break;
      case 5: s.switches = what / 16; break;
      case 6: s.sequence += in.take<std::int8_t>(); break;
      case 7: s.temperature = in.take<double>(); break;
      case 8: input.conflicting_node = what & 16; break;
      case 9: input.tick += what / 16; break;
      case 10:
        input.order.request = Request::kRun;
        input.order.segment = segment(in);
        break;
      case 11:
        input.order.request = static_cast<Request>(what / 16 % static_cast<int>(Request::kCount));
        input.order.vehicle = vehicle(in);
        input.order.verdict = {Stability::kStable, Stability::kStable};
        break;
      case 12:
        s.switches = kAllSwitchesClosed;
        s.q = e.plant.task.initial_joints;
        s.adc[6] = (limits.pressure_min + limits.pressure_max) / 2;
        break;
      case 13: s.wrench_time += 1000 * in.take<std::int16_t>(); break;
      case 14:
        // As far off as the gate lets them be.
        s.legs_time = std::clamp<std::int64_t>(in.take<std::int64_t>(), 0, s.time);
        s.command_tick = input.tick - what / 16;
        s.command_time = std::clamp<std::int64_t>(in.take<std::int64_t>(), 0, INT64_MAX / 8);
        break;
      default:
        for (int i = 0; i < what / 4; ++i) tick();
    }
    // Half the time through the gate, as on the bus; else as it is, gate or not.
    if (what & 1) {
      if (const auto let_in = fromMessage(toMessage(s, {1, 1}))) s = *let_in;
    }
    tick();
  }
  if (size % 97 == 0 && all_ticks % 1024 < 64)
    std::fprintf(stderr, "%.2f million ticks\n", static_cast<double>(all_ticks) * 1e-6);
  return 0;
}
