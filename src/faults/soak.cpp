// SPDX-License-Identifier: BSD-3-Clause
#include "ves/faults/soak.hpp"

#include <fmt/format.h>

#include <random>

#include "ves/config/experiment.hpp"
#include "ves/plant/lockstep.hpp"

namespace ves {
namespace {

/// Chance, the same for one seed.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : random_(seed) {}
  bool chance(double p) { return std::uniform_real_distribution<double>(0.0, 1.0)(random_) < p; }
  int pick(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }

 private:
  std::mt19937 random_;
};

plant::FaultEvent drawFault(Dice& dice) {
  plant::FaultEvent fault;
  fault.fault = static_cast<plant::Fault>(dice.pick(static_cast<int>(plant::Fault::kCount)));
  fault.index = dice.pick(6);
  fault.amount = fault.fault == plant::Fault::kPressure ? 1.0 : 100.0 * (dice.pick(40) - 20);
  if (fault.fault == plant::Fault::kLate) fault.amount = 1 + dice.pick(5);
  return fault;
}

Segment drawSegment(Dice& dice) {
  Segment segment;
  segment.kind = static_cast<SegmentKind>(dice.pick(4));
  segment.duration = 0.5 + 0.01 * dice.pick(500);
  Vec6 target;
  for (int i = 0; i < 6; ++i) {
    target(i) = (i < 3 ? 0.3 : 0.5) * (dice.pick(2001) - 1000) * 1e-3;
    segment.trajectory.motion[static_cast<std::size_t>(i)] = static_cast<AxisMotion>(dice.pick(3));
    segment.trajectory.final(i) = segment.trajectory.amplitude(i) = 0.3 * target(i);
    segment.trajectory.frequency(i) = 0.01 * dice.pick(100);
  }
  segment.target = Pose::from(0.5 * target);
  if (segment.kind == SegmentKind::kMove) segment.duration = 0.0;
  return segment;
}

/// What an operator might ask in this phase.
Order drawOrder(Phase phase, Dice& dice) {
  switch (phase) {
    case Phase::kDisarmed: return {dice.chance(0.05) ? Request::kArm : Request::kNone, {}, {}};
    case Phase::kArmed:
      if (dice.chance(0.05)) return {Request::kRun, drawSegment(dice), {}};
      return {};
    case Phase::kRunning: {
      Order order;
      if (dice.chance(0.002)) order.request = Request::kHold;
      if (dice.chance(0.001)) order.request = Request::kTare;
      return order;
    }
    case Phase::kStopped: return {dice.chance(0.02) ? Request::kReset : Request::kNone, {}, {}};
    case Phase::kReturning:
    case Phase::kParked:
    case Phase::kStopping:
    case Phase::kCount: break;
  }
  return {};
}

/// The laws: whatever comes in, what leaves is inside the limits and near what left before.
class Laws {
 public:
  explicit Laws(const Experiment& e)
      : codec_(e.controller.legs),
        limits_(e.controller.safety),
        period_(e.controller.periodSeconds()),
        count_(e.plant.transducer.scale) {}

  /// The law that this command breaks; empty when it breaks none.
  std::string broken(const LegCommand& command) {
    std::string what;
    if (command.engaged) {
      const Vec6 told = legLengths(codec_, command.counts), L = legLengths(codec_, command.rest);
      if (!(told.minCoeff() >= limits_.leg_min - count_ &&
            told.maxCoeff() <= limits_.leg_max + count_))
        what = "a leg told to go outside its limits";
      if (!(L.minCoeff() >= limits_.leg_min - count_ && L.maxCoeff() <= limits_.leg_max + count_))
        what = "a leg outside its limits";
      const double step = (L - last_).cwiseAbs().maxCoeff();
      if (engaged_ && !(step <= limits_.leg_velocity * period_ + 2.0 * count_))
        what = "a leg faster than its limit";
      last_ = L;
    }
    engaged_ = command.engaged;
    return what;
  }

 private:
  LegCodec codec_;
  SafetyLimits limits_;
  double period_;  // [s]
  double count_;   // [m]
  Vec6 last_ = Vec6::Zero();
  bool engaged_ = false;
};

}  // namespace

SoakResult soak(const Experiment& experiment, std::int64_t ticks, std::uint32_t seed,
                const std::function<void(std::int64_t)>& progress) {
  Experiment e = experiment;
  e.plant.seed = seed;
  Dice dice(seed);
  Laws laws(e);
  Lockstep loop(e.controller, e.plant);
  SoakResult out;
  out.hash = 0xcbf29ce484222325u;
  const auto mix = [&](std::uint64_t value) { out.hash = (out.hash ^ value) * 0x100000001b3u; };

  // One machine for the whole time; a fault is put on its samples from outside.
  plant::Injector injector;
  plant::FaultEvent fault;
  std::int64_t fault_until = -1;
  loop.disturb = [&](Sample& sample) {
    injector.apply(fault, out.ticks <= fault_until, e.plant.sensor.volts_per_count, sample);
  };
  Phase before = Phase::kDisarmed;
  for (; out.ticks < ticks && out.violated.empty(); ++out.ticks) {
    if (out.ticks > fault_until && dice.chance(0.002)) {
      ++out.faults;
      fault = drawFault(dice);
      fault_until = out.ticks + (1 << dice.pick(8));
    }
    loop.input.conflicting_node = dice.chance(1e-5);
    const TickState& s = loop.tick();
    if (s.phase == Phase::kArmed && before == Phase::kDisarmed && out.stops > 0) ++out.recoveries;
    if (s.phase == Phase::kStopped && before != Phase::kStopped) ++out.stops;
    before = s.phase;
    loop.input.order = drawOrder(s.phase, dice);
    if (s.phase == Phase::kRunning && dice.chance(0.005))
      loop.plant().moveRobot(RobotMove{dice.pick(6), 0.5 * (dice.pick(2001) - 1000) * 1e-3,
                                       0.5 + 0.01 * dice.pick(300)});

    if (const std::string law = laws.broken(s.command); !law.empty())
      out.violated = fmt::format("tick {}: {}", s.tick, law);
    for (const std::int32_t c : s.command.counts) mix(static_cast<std::uint64_t>(c));
    mix(static_cast<std::uint64_t>(s.phase));
    loop.advance();
    if (progress && out.ticks % 100'000 == 0) progress(out.ticks);
  }
  return out;
}

}  // namespace ves
