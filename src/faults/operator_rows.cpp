// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "rows.hpp"
#include "ves/faults/soak.hpp"
#include "ves/plant/lockstep.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using Sets = std::vector<std::string>;

constexpr double kMilli = 1e3;  // [mm/m]

/// Controller and plant, and how large this machine is.
struct Machine : Lockstep {
  Machine(const Experiment& e, const FaultBench& bench)
      : Lockstep(e.controller, e.plant),
        limits(e.controller.safety),
        scale(e.controller.safety, bench),
        counts(3.0 * e.plant.transducer.scale),
        tick(e.controller.periodSeconds()),
        park(static_cast<double>(e.plant.watchdog.park_time) * kSecondPerNanosecond) {}
  int ticks(double seconds) const { return static_cast<int>(std::lround(seconds / tick)); }

  SafetyLimits limits;
  WorkspaceScale scale;
  double counts;  // [m] between a command and the legs that rest there: three counts
  double tick;    // [s]
  double park;    // [s] that the legs take to go home alone
};

Order ask(Request request, const Segment& segment = {}) { return {request, segment, {}}; }

Segment sine(double amplitude, double frequency, double duration) {
  Segment s;
  s.kind = SegmentKind::kTrajectory;
  s.duration = duration;
  s.trajectory.motion[2] = AxisMotion::kSine;
  s.trajectory.amplitude(2) = amplitude;
  s.trajectory.frequency(2) = frequency;
  return s;
}

void run(Machine& loop, int ticks) {
  for (int i = 0; i < ticks; ++i) loop.step();
}

/// Ticks until `what` holds, looked at after each of at most `most`; -1 when it never does.
template <typename F>
std::int64_t ticksUntil(Machine& loop, const F& what, int most = 300) {
  for (int i = 1; i <= most; ++i)
    if (what(loop.step())) return i;
  return -1;
}

void arm(Machine& loop) {
  run(loop, 20);
  loop.step(ask(Request::kArm));
  ticksUntil(loop, [](const TickState& s) { return s.phase == Phase::kArmed; });
  loop.step();
}

/// In full swing, z, for so long; `amplitude` [m] in the report's workspace.
void swing(Machine& loop, double amplitude, double seconds) {
  arm(loop);
  loop.step(ask(Request::kRun, sine(amplitude * loop.scale.lengths, 0.5, 10.0)));
  run(loop, loop.ticks(seconds));
}

/// [m] from the legs to the command.
double legError(Machine& loop) {
  return (loop.state().legs.L - loop.plant().truth().legs.L).cwiseAbs().maxCoeff();
}

bool stopped(const TickState& s) { return s.cause != Check::kCount; }

FaultOutcome sensorReversed(Experiment e) {
  e.controller.sensor.C_proc.row(2) *= -1.0;
  CalibrationStatus calibration = CalibrationStatus::kNone;
  double seen = 0.0;  // [N]
  const RunResult r = runLockstep(e, nullptr, [&](const TickState& s) {
    calibration = s.calibration;
    seen = std::max(seen, s.dynamic.f.norm());
    return Order();
  });
  return outcome(
      calibration == CalibrationStatus::kRefused && r.aborted && r.phase == Phase::kParked,
      fmt::format("calibration {}, {}; {:.0f} N left of the weight",
                  calibration == CalibrationStatus::kRefused ? "refused" : "TAKEN", name(r.phase),
                  seen));
}

FaultOutcome controllerSilent(Machine loop) {
  swing(loop, 0.1, 1.3);
  loop.disconnected = true;
  run(loop, loop.ticks(2.0));
  const Vec6 held = loop.plant().truth().legs.L;
  run(loop, loop.ticks(7.0));
  const double moved = (loop.plant().truth().legs.L - held).cwiseAbs().maxCoeff();
  double fastest = 0.0;
  for (int i = 0; i < loop.ticks(5.0 + loop.park); ++i) {
    loop.step();
    fastest = std::max(fastest, loop.plant().truth().legs.L_dot.cwiseAbs().maxCoeff());
  }
  const double away = loop.plant().truth().x.stacked().norm();
  return outcome(
      moved < loop.counts && fastest < 0.05 * std::max(1.0, loop.scale.lengths) && away < 1e-3,
      fmt::format("held within {:.2f} mm, then home at {:.0f} mm/s, to {:.2f} mm", moved * kMilli,
                  fastest * kMilli, away * kMilli));
}

FaultOutcome stall(Machine loop) {
  swing(loop, 0.2, 2.0);
  const Vec6 L = loop.state().legs.L;
  loop.input.tick += 50;
  const std::int64_t detected = ticksUntil(loop, stopped);
  const double step = (loop.state().legs.L - L).cwiseAbs().maxCoeff();
  return outcome(
      loop.state().cause == Check::kOverrun && step <= loop.limits.leg_velocity * loop.tick,
      fmt::format("{}; next step {:.1f} mm", name(loop.state().cause), step * kMilli), detected);
}

FaultOutcome oneLateTick(Machine loop) {
  swing(loop, 0.1, 1.0);
  loop.input.tick += 1;
  run(loop, 100);
  const TickState& s = loop.state();
  return outcome(s.phase == Phase::kRunning && s.late_ticks == 1,
                 fmt::format("{}, {} late", name(s.phase), s.late_ticks));
}

FaultOutcome sixLateTicks(Machine loop) {
  swing(loop, 0.1, 1.0);
  int late = 0;
  while (late < 6 && !stopped(loop.state())) {
    run(loop, 8);
    loop.input.tick += 1;
    ++late;
  }
  const std::int64_t detected = ticksUntil(loop, stopped);
  return outcome(loop.state().cause == Check::kOverrun && late == 6,
                 fmt::format("{} after {} late ticks", name(loop.state().cause), late), detected);
}

FaultOutcome conflictBeforeArming(Machine loop) {
  run(loop, 20);
  loop.input.conflicting_node = true;
  loop.step(ask(Request::kArm));
  run(loop, 300);
  const TickState& s = loop.state();
  return outcome(s.phase == Phase::kDisarmed && s.tripped.has(Check::kConflictingNode),
                 fmt::format("{} for {} ticks: {}", name(s.phase), 300, name(s.tripped.first())));
}

FaultOutcome conflictInMotion(Machine loop) {
  swing(loop, 0.1, 1.0);
  loop.input.conflicting_node = true;
  const std::int64_t detected = ticksUntil(loop, stopped);
  const TickState& s = loop.state();
  return outcome(s.cause == Check::kConflictingNode && s.phase == Phase::kStopped,
                 fmt::format("{}: {}", name(s.phase), name(s.cause)), detected);
}

FaultOutcome farFromHome(Machine loop) {
  arm(loop);
  const double jump = legError(loop);
  return outcome(jump < loop.counts, fmt::format("first command {:.2f} mm away", jump * kMilli));
}

FaultOutcome pathRefused(Machine loop) {
  arm(loop);
  const auto refusedBy = [&](const Segment& path) {
    loop.step(ask(Request::kRun, path));
    ticksUntil(loop, [](const TickState& s) { return s.refusal != Refusal::kChecking; });
    return loop.state().refused_by;
  };
  const Check outside = refusedBy(sine(1.3 * loop.limits.translation, 0.2, 5.0));
  const Check fast = refusedBy(sine(0.5 * loop.limits.translation, 3.0, 5.0));
  const double moved = legError(loop);
  return outcome(
      outside == Check::kMotionLimits && fast == Check::kVelocity &&
          loop.state().phase == Phase::kArmed && moved < loop.counts,
      fmt::format("{}; {}; legs within {:.2f} mm", name(outside), name(fast), moved * kMilli));
}

FaultOutcome wrenchTooStrong(Experiment e) {
  e.plant.sensor.S *= 3.0;
  e.controller.stillness.bias = 1e9;
  double far = 0.0;
  const RunResult r = runLockstep(e, nullptr, [&](const TickState& s) {
    far = std::max(far, s.motion.x.head<3>().norm());
    return Order();
  });
  return outcome(r.phase == Phase::kStopped && far < 0.05,
                 fmt::format("{}: {}, {:.0f} mm", name(r.phase), name(r.cause), far * kMilli));
}

FaultOutcome pressureAtStart(Machine loop) {
  run(loop, 20);
  loop.step(ask(Request::kStart));
  run(loop, 300);
  const TickState& s = loop.state();
  return outcome(s.phase == Phase::kDisarmed && s.tripped.has(Check::kPressure),
                 fmt::format("{} after {} ticks: {}", name(s.phase), s.count, names(s.tripped)));
}

void pressSwitches(Sample& sample) { sample.switches = 0; }  // both, as with a cut cable

FaultOutcome resetWhileHeld(Machine loop) {
  arm(loop);
  loop.disturb = pressSwitches;
  const std::int64_t detected = ticksUntil(loop, stopped);
  const Refusal held = loop.step(ask(Request::kReset)).refusal;
  loop.disturb = nullptr;
  run(loop, 3);
  loop.step(ask(Request::kReset));
  return outcome(held == Refusal::kCauseRemains && loop.state().phase == Phase::kDisarmed,
                 fmt::format("{}; then {}", name(held), name(loop.state().phase)), detected);
}

FaultOutcome resumed(Machine loop) {
  swing(loop, 0.2, 2.3);
  loop.disturb = pressSwitches;
  const std::int64_t detected = ticksUntil(loop, stopped);
  run(loop, 99);
  loop.disturb = nullptr;
  run(loop, 50);
  loop.step(ask(Request::kReset));
  arm(loop);
  const double step = legError(loop);
  return outcome(
      loop.state().phase == Phase::kArmed && step < loop.counts,
      fmt::format("{}, first command {:.2f} mm away", name(loop.state().phase), step * kMilli),
      detected);
}

FaultOutcome shortSoak(const Experiment& e) {
  const SoakResult a = soak(e, 30'000, 1, nullptr), b = soak(e, 30'000, 1, nullptr);
  return outcome(a.violated.empty() && a.hash == b.hash && a.stops > 0,
                 a.violated.empty()
                     ? fmt::format("{} faults, {} stops, {} recoveries, hashes {}", a.faults,
                                   a.stops, a.recoveries, a.hash == b.hash ? "equal" : "DIFFER")
                     : a.violated);
}

}  // namespace

std::vector<FaultRow> operatorRows(const FaultBench& bench) {
  std::vector<FaultRow> rows;
  // Those with settings of their own, and the sensor's sign, are of the table's own machine.
  const auto row = [&](const char* id, const char* fault, const char* expected, auto body,
                       const Sets& sets = {}) {
    rows.push_back({id, fault, expected, false,
                    [=] {
                      const Experiment e = faultScenario(bench, sets);
                      if constexpr (std::is_invocable_v<decltype(body), Experiment>)
                        return body(e);
                      else
                        return body(Machine(e, bench));
                    },
                    sets.empty() && std::is_invocable_v<decltype(body), Machine>});
  };
  row("F6", "a force axis wired the other way round", "calibration refused; home", sensorReversed);
  row("F15b", "the controller falls silent for 34 s", "legs hold; after 10 s they go home slowly",
      controllerSilent);
  row("F16", "the controller stalls for 500 ms", "controlled stop: tick overrun; no burst", stall);
  row("F17", "one tick is 10 ms late", "counted; the run goes on", oneLateTick);
  row("F17b", "six late ticks in a second", "controlled stop: tick overrun", sixLateTicks);
  row("F19", "a second controller commands while we wait", "does not arm", conflictBeforeArming);
  row("F19b", "a second controller commands while we do", "freeze: second controller",
      conflictInMotion);
  row("F20", "started with the platform 200 mm and 5 deg away", "first command is where it is",
      farFromHome, {"initial_pose={x_m: 0.12, z_m: -0.16, gamma_deg: 5}"});
  row("F28", "a trajectory ordered that leaves the workspace, or is too fast", "refused beforehand",
      pathRefused);
  row("F30", "the wrench is fed back three times as strong", "stop before 50 mm", wrenchTooStrong,
      {"program=[{calibration: {}},{move: {to: {x_m: 0.01}}},{admittance: {duration_s: 30}}]",
       "base={mass_diagonal: [30, 30, 30, 30, 30, 30], damping_diagonal: [2, 2, 2, 1, 1, 1], "
       "stiffness_diagonal: [19000, 19000, 19000, 19000, 19000, 19000]}",
       "controller.stability=forced"});
  row("F31b", "pressure is low at the start", "does not arm", pressureAtStart,
      {"sensor.pressure_v=1.0"});
  row("F32c", "panic button held, reset asked for", "refused until released, then disarmed",
      resetWhileHeld);
  row("F33", "resumed after a stop in full swing", "from where it stands, no step", resumed);
  rows.push_back({"F36", "five minutes of random faults and recoveries, twice",
                  "no law broken, same hash again", false,
                  [=] { return shortSoak(faultScenario(bench)); }, true});
  return rows;
}

}  // namespace ves
