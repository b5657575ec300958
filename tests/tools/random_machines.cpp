// SPDX-License-Identifier: BSD-3-Clause
//
// Compensated emulations on machines that are not as the controller believes.
//
//   random_machines emulation N [SEED [SET...]]   the DOSS on the Shuttle's arm, six modes: gains,
//       masses, centres of mass and tau off by up to 10 %, samples 0 to 3 ticks late, read and
//       commanded up to 2 ms before and after their ticks; a third of them in space, on Earth, and
//       on Earth with masses and centres that are known, as after an identification
//   random_machines masses N [SEED [SET...]]      DOSS and PUMA on four bases, aided, noise on:
//       every body's mass and centre off by up to 10 %, by its own draw and a common one; masses as
//       believed at first, learnt, and learnt with a tilt after the calibration
//   random_machines late N [SEED [SET...]]        the same machine as believed, N ticks late
//   random_machines gate N [SEED [SET...]]        a PUMA on bases near the limit of stability, off
//       by what the gate allows for: what it admits beside what then grows
//
// SET is as for --set of ves run. All with the three parts of the compensation.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <deque>
#include <map>

#include "machines.hpp"
#include "support/misbelief.hpp"
#include "support/rig.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/run/truth.hpp"

namespace ves {
namespace {

using test::Dice;
using test::forEach;
using test::Sets;
using test::with;

const Sets kCompensated = {"controller.compensation.feed_forward=true",
                           "controller.compensation.observer=true",
                           "controller.compensation.inertia=true", "sensor.noise=false"};

constexpr const char* kArms[] = {"unberth", "low_hover", "deploy", "capture"};

struct Ended {
  Series series;
  Phase phase = Phase::kDisarmed;
  Check cause = Check::kCount;
  bool begun = false;  // admittance control
};

/// Lockstep but for the times: samples are read up to `jitter` [ns] before their tick and used
/// `late` ticks after it, commands come up to `jitter` after theirs.
Ended run(const Experiment& e, std::int64_t jitter, std::size_t late, unsigned seed) {
  Dice dice(seed);
  Ended out;
  out.series.experiment = e;
  TestPlatform platform(e.controller);
  plant::Plant plant(e.plant);
  TickInput in;
  std::deque<std::pair<Sample, truth_t>> on_the_way;
  std::int64_t command_time = 0;
  const auto some = [&] {
    return static_cast<std::int64_t>(dice.between(0.0, static_cast<double>(jitter)));
  };
  in.order.request = Request::kStart;
  for (bool done = false; !done; ++in.tick) {
    in.time = in.tick * e.controller.period;
    if (in.tick > 0) plant.advance(std::max(plant.time(), in.time - some()));
    Sample sample = plant.sample();
    sample.command_tick = in.tick - 1;
    sample.command_time = command_time;
    on_the_way.emplace_back(
        sample, toMessage(plant.truth(), header({2, 0}, sample.sequence, plant.time())));
    if (on_the_way.size() > late + 1) on_the_way.pop_front();
    in.sample = on_the_way.front().first;
    const TickState& state = platform.tick(in);
    in.order = {};
    Row row;
    row.t = static_cast<double>(in.time) * kSecondPerNanosecond;
    row.state = toMessage(state, header({1, 0}, in.tick, in.time));
    row.truth = on_the_way.front().second;
    row.has_truth = true;
    out.series.rows.push_back(row);
    out.begun = out.begun || state.kind == SegmentKind::kAdmittance;
    command_time = in.time + some();
    plant.advance(command_time);
    plant.command(state.command);
    done = test::done(state) || (!state.command.engaged && in.tick > 2000) || state.aborted;
    out.phase = state.phase;
    out.cause = state.cause;
  }
  return out;
}

double at(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values.empty()
             ? NAN
             : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

double offOf(const Ended& ended) {
  const std::optional<Emulation> found = emulation(ended.series);
  return distance(found->platform, found->base).rms_position / travel(found->base).peak_position;
}

int late(int ticks, unsigned seed, const Sets& set) {
  for (const char* arm : kArms) {
    const Experiment e = test::experiment(std::string("srms_") + arm + "_doss",
                                          with(with(kCompensated, {"base.keep_modes=6"}), set));
    const Ended ended = run(e, 0, static_cast<std::size_t>(ticks), seed);
    fmt::print("{}, {} ticks late: {}\n", arm, ticks,
               ended.phase == Phase::kParked && ended.begun
                   ? fmt::format("{:.2f} %", 100.0 * offOf(ended))
                   : fmt::format("{} by {}", name(ended.phase), name(ended.cause)));
  }
  return 0;
}

/// [-] of travel, rms, in position and rotation.
struct Off {
  std::vector<double> position, rotation;
  int refused = 0;  // [-] by the calibration, or stopped
};

Off masses(const std::string& scenario, const char* joint, int to, int draws, unsigned seed,
           const Sets& set, bool wrong, bool tilt) {
  Off out;
  out.position.assign(static_cast<std::size_t>(draws), NAN);
  out.rotation = out.position;
  forEach(draws, [&](int i) {
    const unsigned own = seed + static_cast<unsigned>(i);
    Experiment e = test::experiment(
        scenario,
        with(with(kCompensated,
                  {"sensor.noise=true", "sensor.readings_per_tick=4", "base.keep_modes=6",
                   "controller.compensation.wrench=aided", fmt::format("seed={}", own),
                   fmt::format("program=[{{move: {{}}}}, {{calibration: {{}}}}, {}{{admittance: "
                               "{{duration_s: 20}}, robot: [{{at_s: 0, duration_s: 5, joint: {}, "
                               "to_deg_or_m: {}}}]}}]",
                               tilt ? "{excite: {tilt_deg: 4, duration_s: 9}}, " : "", joint, to)}),
             set));
    std::mt19937 random(own);
    if (wrong) test::misbelieve(e.controller.payload, random);
    const Ended ended = run(e, 0, 0, own);
    if (ended.phase != Phase::kParked || !ended.begun) return;
    const auto found = emulation(ended.series);
    const Distance off = distance(found->platform, found->base);
    const Distance all = travel(found->base);
    out.position[static_cast<std::size_t>(i)] = off.rms_position / all.peak_position;
    out.rotation[static_cast<std::size_t>(i)] = off.rms_attitude / all.peak_attitude;
  });
  for (std::vector<double>* values : {&out.position, &out.rotation})
    std::erase_if(*values, [](double v) { return !std::isfinite(v); });
  out.refused = draws - static_cast<int>(out.position.size());
  return out;
}

int allMasses(int draws, unsigned seed, const Sets& set) {
  fmt::print("median, worst of position and rotation [% of travel, rms]\n");
  const auto cells = [](const Off& off) {
    std::string out;
    for (const std::vector<double>* values : {&off.position, &off.rotation})
      out += fmt::format("{}{:.2f}, {:.2f}", out.empty() ? "" : " / ", 100.0 * at(*values, 0.5),
                         100.0 * at(*values, 1.0));
    return out + (off.refused > 0 ? fmt::format(" ({} refused)", off.refused) : "");
  };
  for (const auto& [robot, joint, to] :
       {std::tuple{"doss", "joint_3", -60}, std::tuple{"puma", "joint_1", 30}})
    for (const char* arm : kArms)
      for (const char* gravity : {"0", "9.81"}) {
        const std::string scenario = fmt::format("srms_{}_{}", arm, robot);
        const Sets here = with(set, {std::string("gravity_m_per_s2=") + gravity}),
                   learns = with(here, {"controller.compensation.mass_error=0.1",
                                        "controller.compensation.learns_masses=true"});
        const auto off = [&, joint = joint, to = to](const Sets& sets, int n, bool wrong,
                                                     bool tilt) {
          return cells(masses(scenario, joint, to, n, seed, sets, wrong, tilt));
        };
        constexpr int kExact = 2;  // [-] seeds of the noise, which it keeps out
        fmt::print("{} {} m/s^2: exact {}; off {}; learnt {}; with tilt {}\n", scenario, gravity,
                   off(here, std::min(draws, kExact), false, false), off(here, draws, true, false),
                   off(learns, draws, true, false), off(learns, draws, true, true));
        std::fflush(stdout);
      }
  return 0;
}

constexpr const char* kWhere[] = {"0 g", "on Earth", "on Earth, masses known"};

int emulations(int n, unsigned seed, const Sets& set) {
  struct One {
    int where = 0;  // of kWhere
    int late = 0;
    std::string ended;
    double off = NAN;  // [-] rms over peak
  };
  std::vector<One> ones(static_cast<std::size_t>(n));
  forEach(n, [&](int i) {
    Dice dice(seed + static_cast<unsigned>(i));
    One& one = ones[static_cast<std::size_t>(i)];
    one.where = i % 3;
    const std::string arm = kArms[dice.whole(0, 3)];
    const auto factor = [&] { return dice.between(0.9, 1.1); };
    const double extend = factor(), retract = factor(), tau = factor(), mass = factor(),
                 center = factor();
    const bool known = one.where == 2;
    const Sets machine = {
        fmt::format("plant_mismatch={{gain_extend: {}, gain_retract: {}, tau: {}, mass: {}, "
                    "center: {}}}",
                    extend, retract, tau, known ? 1.0 : mass, known ? 1.0 : center),
        fmt::format("gravity_m_per_s2={}", one.where > 0 ? 9.81 : 0.0), "base.keep_modes=6"};
    one.late = dice.whole(0, 3);
    const auto jitter = static_cast<std::int64_t>(dice.between(0.0, 2e6));
    const Experiment e =
        test::experiment("srms_" + arm + "_doss", with(with(kCompensated, machine), set));
    const Ended ended =
        run(e, jitter, static_cast<std::size_t>(one.late), seed + static_cast<unsigned>(i));
    if (ended.phase == Phase::kParked && ended.begun) {
      one.off = offOf(ended);
    } else {
      one.ended = fmt::format("{}: {}", ended.begun ? "stopped" : "did not begin",
                              ended.cause == Check::kCount ? "no check" : name(ended.cause));
    }
  });
  for (int where = 0; where < 3; ++where) {
    std::vector<double> off;
    std::map<std::string, int> others;
    std::map<int, std::vector<double>> by_late;
    for (const One& one : ones) {
      if (one.where != where) continue;
      if (one.ended.empty()) {
        off.push_back(one.off);
        by_late[one.late].push_back(one.off);
      } else {
        ++others[one.ended];
      }
    }
    fmt::print("{}: {} ran; rms over peak: median {:.2f} %, 90 % below {:.2f} %, worst {:.2f} %\n",
               kWhere[where], off.size(), 100 * at(off, 0.5), 100 * at(off, 0.9),
               100 * at(off, 1.0));
    for (const auto& [late, values] : by_late)
      fmt::print("  {} ticks late: {} ran, median {:.2f} %, worst {:.2f} %\n", late, values.size(),
                 100 * at(values, 0.5), 100 * at(values, 1.0));
    for (const auto& [what, count] : others) fmt::print("  {} {}\n", count, what);
  }
  return 0;
}

/// Legs by chance, from those that every prototype has to those that nobody would build.
Sets legsByChance(Dice& dice) {
  const double seals = dice.between(0.0, 500.0), valve = dice.between(40.0, 120.0);
  constexpr const char* kCutoffs[] = {"20", "20", "8", "3"};
  return {
      "legs.model=hydraulic",
      std::string("legs.hydraulic.circuit=") + (dice.whole(0, 1) == 0 ? "three_way" : "four_way"),
      fmt::format("legs.hydraulic.bulk_modulus_mpa={}", dice.between(500.0, 1800.0)),
      fmt::format("legs.hydraulic.hose_volume_cm3={}", dice.between(5.0, 100.0)),
      fmt::format("legs.hydraulic.valve_hz={}", valve),
      fmt::format("legs.hydraulic.valve_damping={}", 0.88 / 60.0 * valve),  // as late as believed
      fmt::format("legs.hydraulic.valve_opening_ma={}", dice.between(-0.2, 0.4)),
      fmt::format("legs.hydraulic.coulomb_n={}", seals),
      fmt::format("legs.hydraulic.breakaway_n={}", 1.5 * seals),
      fmt::format("legs.hydraulic.viscous_n_s_per_m={}", dice.between(200.0, 3000.0)),
      fmt::format("legs.hydraulic.pressure_feedback_ma_per_mpa={}", dice.between(0.0, 3.0)),
      fmt::format("legs.hydraulic.plate.mass_kg={}", dice.between(80.0, 200.0)),
      fmt::format("sensor.cutoff_hz={}", kCutoffs[dice.whole(0, 3)])};
}

int gates(int n, unsigned seed, const Sets& set, bool oil) {
  struct One {
    bool admitted = false, begun = false, grows = false;
    std::string what;
  };
  std::vector<One> ones(static_cast<std::size_t>(n));
  forEach(n, [&](int i) {
    Dice dice(seed + static_cast<unsigned>(i));
    One& one = ones[static_cast<std::size_t>(i)];
    const double ratio = oil ? dice.between(0.5, 5.0) : dice.between(1.0, 20.0),
                 hertz = std::exp(dice.between(-0.7, oil ? 1.6 : 3.0)),
                 zeta = dice.between(0.005, 0.05), w = 2.0 * M_PI * hertz,
                 amplitude = std::min(0.03, 1.0 / (w * w));
    std::vector<double> m, c, k;
    for (int j = 0; j < 6; ++j) {
      m.push_back((j < 3 ? 73.45 : 40.0) / ratio);
      c.push_back(2.0 * zeta * w * m.back());
      k.push_back(w * w * m.back());
    }
    const Sets base = {
        "gravity_m_per_s2=0",
        fmt::format(
            "base={{mass_diagonal: [{}], damping_diagonal: [{}], stiffness_diagonal: [{}]}}",
            fmt::join(m, ","), fmt::join(c, ","), fmt::join(k, ",")),
        fmt::format("program=[{{move: {{}}}}, {{calibration: {{}}}}, {{move: {{to: {{x_m: {}, z_m: "
                    "{}}}}}}}, {{admittance: {{duration_s: 15}}}}]",
                    amplitude, 0.75 * amplitude)};
    const Sets legs = oil ? legsByChance(dice) : Sets();
    const Sets all_of = with(with(with(kCompensated, base), legs), set);
    Experiment asked = test::unassessed("puma_on_table_4_1", all_of);
    one.admitted = isStable(asked.controller, asked.plant.task);

    const Compensation& by = asked.controller.compensation;
    const auto wrong = [&](double most) { return 1.0 + dice.between(-most, most); };
    Experiment e = test::experiment(
        "puma_on_table_4_1",
        with(all_of, {fmt::format("plant_mismatch={{mass: {}}}", wrong(by.mass_error))}));
    const double gain = wrong(0.05), later = dice.between(-1.0, 1.0) * 0.0005;
    e.plant.actuator.gain_extend *= gain;
    e.plant.actuator.gain_retract *= gain;
    if (e.plant.hydraulic) {
      e.plant.hydraulic->leg.flow *= gain;
      e.plant.hydraulic->leg.oil.bulk_modulus *= wrong(0.1);
    }
    const double cutoff = e.plant.sensor.cutoff;
    e.plant.sensor.cutoff = M_SQRT2 / (M_SQRT2 / cutoff + later);
    const Ended ended = run(e, 0, 0, seed);
    // Growth: the last third moves more than the first.
    double first = 0.0, last = 0.0;
    std::vector<double> moved;
    for (const Row& row : ended.series.rows)
      if (inAdmittance(row.state)) moved.push_back(Vec6::Map(row.state.x_dot).norm());
    for (std::size_t j = 0; j < moved.size(); ++j) {
      if (3 * j < moved.size()) first = std::max(first, moved[j]);
      if (3 * j > 2 * moved.size()) last = std::max(last, moved[j]);
    }
    one.begun = ended.begun;
    one.grows = ended.phase != Phase::kParked || !(last < 1.05 * first);
    one.what = fmt::format(
        "mass ratio {:.1f}, {:.2f} Hz, damping {:.3f}, gain {:.3f}, {:+.2f} ms: "
        "{}{}, rate {:.2g} then {:.2g}",
        ratio, hertz, zeta, gain, 1e3 * later, oil ? fmt::format("{}, ", fmt::join(legs, " ")) : "",
        name(ended.cause), first, last);
  });
  int counts[2][2] = {}, never = 0;
  for (const One& one : ones) {
    if (!one.begun) {
      ++never;
      continue;
    }
    ++counts[one.admitted][one.grows];
    if (one.admitted && one.grows) fmt::print("admitted, and grows: {}\n", one.what);
  }
  fmt::print("admitted: {} decay, {} grow; refused: {} grow, {} decay; {} were never calibrated\n",
             counts[1][0], counts[1][1], counts[0][1], counts[0][0], never);
  return counts[1][1] == 0 ? 0 : 1;
}

}  // namespace
}  // namespace ves

int main(int argc, char** argv) {
  const std::string what = argc > 2 ? argv[1] : "";
  if (what != "emulation" && what != "gate" && what != "oil" && what != "late" &&
      what != "masses") {
    fmt::print(
        stderr,
        "random_machines: want emulation, masses, gate, oil or late, a number, then seed and "
        "settings\n");
    return 2;
  }
  try {
    const int n = std::stoi(argv[2]);
    const auto seed = static_cast<unsigned>(argc > 3 ? std::stoi(argv[3]) : 1);
    const ves::Sets set(argv + std::min(4, argc), argv + argc);
    if (what == "masses") return ves::allMasses(n, seed, set);
    if (what == "late") return ves::late(n, seed, set);
    if (what == "emulation") return ves::emulations(n, seed, set);
    return ves::gates(n, seed, set, what == "oil");
  } catch (const std::exception& error) {
    fmt::print(stderr, "random_machines: {}\n", error.what());
    return 2;
  }
}
