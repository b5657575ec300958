// SPDX-License-Identifier: BSD-3-Clause
#include "life.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "ves/core/coordinates.hpp"

namespace ves::swarm {
namespace {

constexpr const char* kKinds[] = {"do",         "fault",   "samples",  "commands", "stall",
                                  "controller", "machine", "intruder", "disk"};
static_assert(std::size(kKinds) == static_cast<std::size_t>(Kind::kCount));

/// Chance, the same on every machine for one seed.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  double between(double a, double b) {
    return a + (b - a) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  int whole(int a, int b) {
    return a + static_cast<int>(engine_() % static_cast<std::uint64_t>(b - a + 1));
  }
  bool chance(double p) { return between(0.0, 1.0) < p; }
  template <typename T, std::size_t N>
  const T& of(const T (&all)[N]) {
    return all[engine_() % N];
  }

 private:
  std::mt19937_64 engine_;
};

struct Scenario {
  const char* name;
  bool robot, arm;  // has a robot; its base is the Shuttle's arm

  bool floats() const { return std::string_view(name).starts_with("satellite"); }
  bool ship() const { return name == std::string_view("ship_arm"); }
  /// On a base that may give way under the robot's weight.
  bool leans() const { return ship() || std::string_view(name).ends_with("_on_table_4_1"); }
};
constexpr Scenario kScenarios[] = {
    {"z_sine", false, false},
    {"alpha_sine", false, false},
    {"puma_on_table_4_1", true, false},
    {"puma_on_table_4_1", true, false},
    {"doss_on_table_4_1", true, false},
    {"puma_tilt", true, false},
    {"free_decay", false, false},
    {"arm_on_desk", true, false},
    {"puma_on_hall", true, false},
    {"srms_capture_puma", true, true},
    {"srms_low_hover_doss", true, true},
    {"contact_board_puma", true, true},
    {"contact_capture_puma", true, true},
    {"satellite_puma", true, false},
    {"satellite_hold", true, false},
    {"satellite_tumbling", true, false},
    {"ship_arm", true, false},
    {"deck_puma", true, false},
};

std::vector<std::string> drawSettings(Dice& dice, const Scenario& scenario) {
  std::vector<std::string> set;
  const auto put = [&](const std::string& key, const std::string& value) {
    set.push_back(key + "=" + value);
  };
  const auto maybe = [&](double p, const std::string& key, const std::string& value) {
    if (dice.chance(p)) put(key, value);
  };
  const std::string c = "controller.compensation.";
  bool aided = false, learns = false, compensated = scenario.ship();
  if (dice.chance(0.7)) {
    put(c + "feed_forward", dice.chance(0.8) ? "true" : "false");
    const bool observer = dice.chance(0.7), inertia = observer && dice.chance(0.7);
    compensated = inertia;
    put(c + "observer", observer ? "true" : "false");
    put(c + "inertia", inertia ? "true" : "false");
    put(c + "wrench", "raw");
    if (observer) maybe(0.3, c + "adaptation", "true");
    if (inertia && dice.chance(scenario.floats() ? 0.8 : 0.4)) {
      aided = true;
      put(c + "wrench", "aided");
      learns = dice.chance(0.5);
      if (learns) put(c + "learns_masses", "true");
    }
    if (inertia) maybe(0.3, c + "mass_update_ticks", std::to_string(dice.whole(2, 40)));
    maybe(0.5, c + "ramp_s", fmt::format("{:.2f}", std::exp(dice.between(-4.0, 1.6))));
  }
  if (scenario.floats()) {
    const bool flies = aided && dice.chance(0.7);
    put("controller.moving_frame.enabled", flies ? "true" : "false");
    maybe(0.3, "controller.moving_frame.steady_in_contact", "true");
    if (flies) maybe(0.3, "base.free.velocity_m_per_s", "[20, -3, 0]");
    maybe(0.3, "base.free.orbital_rate_deg_per_s", "0.5");
    maybe(0.3, "base.free.wheels",
          "[{axis: [1, 0, 2], most_nms: 20, torques_s_nm: [[1.003, 3, 2], [4, 6, -2]]}]");
  }
  maybe(0.2, "controller.passivity.enabled", "true");
  if (dice.chance(0.3)) {
    constexpr const char* kPeriods[] = {"20000000", "5000000", "4000000", "13333333"};
    put("controller.period_ns", dice.of(kPeriods));
  }
  maybe(0.3, "sensor.readings_per_tick", "4");
  // The cylinders of config/ves.yaml are none of a desk's, and none of a hall's.
  const bool own_size = scenario.name != std::string_view("arm_on_desk") &&
                        scenario.name != std::string_view("puma_on_hall");
  if (own_size && dice.chance(0.2)) {
    put("legs.model", "hydraulic");
    put("legs.hydraulic.circuit", dice.chance(0.7) ? "three_way" : "four_way");
    // On the Shuttle's arm soft oil diverges within a second; what then stops is no longer a law's.
    if (!scenario.arm) maybe(0.3, "legs.hydraulic.bulk_modulus_mpa", "690");
    maybe(0.3, "legs.hydraulic.play_m", "0.0001");
    if (dice.chance(0.3)) {
      put("legs.hydraulic.coulomb_n", "500");
      put("legs.hydraulic.breakaway_n", "750");
    }
    maybe(0.3, "legs.hydraulic.reading_noise_m", "0.00002");
    // What a servo identification says of it: gains of the data sheet, valves that are open at null
    // or overlap, seals that take something.
    if (dice.chance(0.5)) {
      const auto all = [](const char* key, double value, double deviation) {
        return fmt::format(
            "{0}: [{1}, {1}, {1}, {1}, {1}, {1}], {0}_deviation: [{2}, {2}, {2}, {2}, "
            "{2}, {2}], ",
            key, value, deviation);
      };
      put("servo", "{date: \"2026-11-21T07:40:12Z\", " + all("extend_per_s", 17.4, 0.1) +
                       all("retract_per_s", 11.35, 0.1) + all("tau_s", 0.0064, 1e-4) +
                       all("delay_s", 0.0, 1e-4) +
                       all("opening_m", dice.between(-3e-4, 3e-4), 1e-5) +
                       (dice.chance(0.5) ? all("friction_m", dice.between(1e-5, 1.2e-3), 1e-5) +
                                               fmt::format("friction_s: {}, friction_way_m: {}",
                                                           dice.chance(0.5) ? 0.03 : 0.1,
                                                           dice.chance(0.5) ? 1e-4 : 2.5e-4)
                                         : "") +
                       "}");
    }
  } else {
    maybe(0.25, "legs.filters", "outputs");
  }
  maybe(0.2, "sensor.noise", "false");
  const bool in_space = dice.chance(0.3);
  if (in_space) put("gravity_m_per_s2", "0");
  if (scenario.leans()) {
    const bool may = compensated && !learns && !in_space;
    put("base.weight", may && dice.chance(0.5) ? "felt" : "removed");
  }
  if (dice.chance(0.3))
    put("plant_mismatch",
        fmt::format("{{gain_extend: {:.3f}, gain_retract: {:.3f}, mass: {:.3f}}}",
                    dice.between(0.85, 1.15), dice.between(0.85, 1.15), dice.between(0.9, 1.1)));
  if (scenario.arm) put("base.keep_modes", dice.chance(0.7) ? "6" : "12");
  // Short, so that a life has time for them.
  put("legs.watchdog.park_after_s", fmt::format("{:.1f}", dice.between(0.6, 3.0)));
  put("legs.watchdog.park_time_s", fmt::format("{:.1f}", dice.between(5.0, 12.0)));
  put("seed", std::to_string(dice.whole(0, 1'000'000)));
  return set;
}

std::string drawRun(Dice& dice, const Experiment& e) {
  const SafetyLimits& limits = e.controller.safety;
  const auto reach = [&](int i) {
    return (i < 3 ? limits.translation : limits.rotation) * coordinate(i).shown;
  };
  const int what = dice.whole(0, 11);
  if (what < 4) {
    std::string text = fmt::format("trajectory {:.2f}", dice.between(0.3, 8.0));
    for (int i = 0; i < 6; ++i) {
      if (!dice.chance(0.35)) continue;
      if (dice.chance(0.75)) {
        const double amplitude = reach(i) * dice.between(0.0, 0.7),
                     hertz = std::exp(dice.between(-2.0, 0.7));
        text += fmt::format(" {} sine {:.2f} {:.3f}", coordinate(i).name, amplitude, hertz);
      } else {
        text +=
            fmt::format(" {} ramp {:.2f}", coordinate(i).name, reach(i) * dice.between(-.5, .5));
      }
    }
    return text;
  }
  if (what < 6) {
    std::string text = "move";
    for (int i = 0; i < 6; ++i)
      if (dice.chance(0.4))
        text += fmt::format(" {} {:.2f}", coordinate(i).name, reach(i) * dice.between(-0.4, 0.4));
    if (dice.chance(0.3)) text += fmt::format(" in {:.1f}", dice.between(1.0, 6.0));
    return text;
  }
  if (what < 7) return "calibration";
  return fmt::format("admittance {:.1f}", dice.between(1.0, 20.0));
}

std::string drawRobot(Dice& dice, const Experiment& e) {
  const int what = dice.whole(0, 9);
  if (e.robot.tool() && what == 0) return fmt::format("grasp {:.1f}", dice.between(0.1, 5.0));
  if (e.robot.tool() && what == 1) return "release";
  if (what == 3)
    return fmt::format("push {} {:.0f} {:.0f} {:.0f} {:.2f}",
                       e.robot.tool() && dice.chance(0.5) ? "tool" : "platform",
                       dice.between(-60.0, 60.0), dice.between(-60.0, 60.0),
                       dice.between(-60.0, 60.0), dice.between(0.05, 1.0));
  if (e.robot.tool() && what == 2)
    return fmt::format("tool by {:.0f} {:.0f} {:.0f} {:.1f}", dice.between(-50.0, 50.0),
                       dice.between(-50.0, 50.0), dice.between(-50.0, 50.0),
                       dice.between(1.0, 4.0));
  const auto& names = e.robot.joint_names;
  const int joint = dice.whole(0, static_cast<int>(names.size()) - 1);
  const Link& link = e.controller.payload.robot.jointLink(joint);
  const double unit = link.type == JointType::kRevolute ? kDegree : 1e-3;
  const double q = e.plant.task.initial_joints(joint) + 0.3 * dice.between(-1.0, 1.0);
  return fmt::format("robot {} {:.2f} {:.1f}", names[static_cast<std::size_t>(joint)],
                     std::clamp(q, link.lower + 0.01, link.upper - 0.01) / unit,
                     dice.between(0.5, 3.0));
}

Event drawFault(Dice& dice) {
  // The valves' are the table's: nothing the controller sends stops a leg whose valve is open.
  constexpr plant::Fault kFaults[] = {
      plant::Fault::kWrenchFrozen, plant::Fault::kWrenchRail,    plant::Fault::kWrenchStep,
      plant::Fault::kPressure,     plant::Fault::kLegFrozen,     plant::Fault::kLegJump,
      plant::Fault::kJointsLost,   plant::Fault::kLegOutOfRange, plant::Fault::kLost,
      plant::Fault::kLate,         plant::Fault::kShuffled,      plant::Fault::kPanicButton,
      plant::Fault::kPanicButton,  plant::Fault::kFloorMat};
  Event event;
  event.kind = Kind::kFault;
  const plant::Fault fault = dice.of(kFaults);
  event.what = name(fault);
  event.which = dice.whole(0, 5);
  event.amount = std::round(dice.between(-1500.0, 1500.0));
  if (fault == plant::Fault::kPressure) event.amount = 1.0;
  if (fault == plant::Fault::kLegJump) event.amount = std::round(dice.between(-400.0, 400.0));
  if (fault == plant::Fault::kLate) event.amount = dice.whole(1, 6);
  event.ticks = 1 << dice.whole(0, 8);
  return event;
}

Event drawTrouble(Dice& dice) {
  Event event;
  const int what = dice.whole(0, 19);
  constexpr const char* kTroubles[] = {"lost", "late", "twice"};
  if (what < 12) {
    event.kind = what < 6 ? Kind::kSamples : Kind::kCommands;
    event.what = dice.of(kTroubles);
    event.ticks = 1 << dice.whole(0, 6);
    event.amount = dice.whole(1, 5);
  } else if (what < 14) {
    event.kind = Kind::kStall;
    event.ticks = dice.whole(1, dice.chance(0.5) ? 4 : dice.chance(0.7) ? 40 : 1600);
  } else if (what < 16) {
    event.kind = Kind::kController;
    event.ticks = dice.whole(1, dice.chance(0.5) ? 60 : 1600);
  } else if (what < 17) {
    event.kind = Kind::kMachine;
    event.ticks = dice.whole(1, 100);
  } else if (what < 19) {
    event.kind = Kind::kIntruder;
    event.what = dice.chance(0.5) ? "ghost" : "second";
    event.ticks = 1 << dice.whole(0, 7);
  } else {
    event.kind = Kind::kDisk;
    event.ticks = dice.whole(50, 500);
  }
  return event;
}

}  // namespace

Experiment experimentOf(const Life& life, const std::filesystem::path& config) {
  std::vector<std::string> set = life.set;
  set.insert(set.begin(),
             {"controller.stability=forced", "controller.stability_uncompensated=forced"});
  return loadExperiment(config / "scenarios" / (life.scenario + ".yaml"), set);
}

Life draw(std::uint64_t seed, const std::filesystem::path& config) {
  Dice dice(seed * 0x9e3779b97f4a7c15u + 1);
  Life life;
  life.seed = seed;
  const Scenario& scenario = dice.of(kScenarios);
  life.scenario = scenario.name;
  life.set = drawSettings(dice, scenario);
  const Experiment e = experimentOf(life, config);
  const double period = e.controller.periodSeconds();
  const auto ticksOf = [&](double seconds) {
    return static_cast<std::int64_t>(std::ceil(seconds / period));
  };
  life.ticks = ticksOf(dice.between(20.0, 120.0));
  constexpr std::int64_t kLoops[] = {10'000'000, 10'000'000, 5'000'000, 2'000'000};
  life.sample_period = std::min(dice.of(kLoops), e.controller.period);
  life.machine_phase =
      static_cast<std::int64_t>(dice.between(0.0, static_cast<double>(life.sample_period)));
  life.latency = static_cast<std::int64_t>(std::exp(dice.between(10.0, 14.0)));
  life.clock_offset = dice.chance(0.5) ? 0 : static_cast<std::int64_t>(dice.between(0.0, 1e12));
  life.logged = dice.chance(0.15);

  const bool has_robot = scenario.robot && !e.robot.joint_names.empty();
  const auto ask = [](std::int64_t tick, std::string line) {
    return Event{tick, Kind::kDo, std::move(line), 0, 0.0, 1};
  };
  // A calm life has no troubles: more happens in it.
  const double trouble = dice.chance(0.4) ? 0.0 : dice.between(0.02, 0.4);
  std::int64_t tick = dice.whole(25, 60);
  life.events.push_back(ask(tick, "arm"));
  for (;;) {
    if (!dice.chance(0.1))
      tick += 1 + ticksOf(dice.chance(0.2) ? dice.between(0.0, 0.1) : dice.between(0.0, 4.0));
    if (tick >= life.ticks) break;
    // The button falls just when something begins.
    const bool arming = !life.events.empty() && life.events.back().tick + 20 > tick &&
                        (life.events.back().what == "arm" || life.events.back().what == "program");
    if (arming && trouble > 0.0 && dice.chance(0.3)) {
      const std::int64_t button = life.events.back().tick + dice.whole(0, 15);
      life.events.push_back({button, Kind::kFault, "panic_button", 0, 0.0, dice.whole(1, 4)});
      tick = button + dice.whole(5, 60);
      life.events.push_back(ask(tick, "reset"));
      continue;
    }
    if (dice.chance(trouble)) {
      Event event = dice.chance(0.5) ? drawFault(dice) : drawTrouble(dice);
      event.tick = tick;
      life.events.push_back(event);
      // One that comes back, looks, and is gone again.
      if (event.kind == Kind::kController && dice.chance(0.4)) {
        event.tick += event.ticks + dice.whole(5, 60);
        event.ticks = dice.whole(200, 1600);
        life.events.push_back(event);
        tick = event.tick + event.ticks;
      }
      if (dice.chance(0.6)) {
        tick += event.ticks + dice.whole(0, 200);
        life.events.push_back(ask(tick, "reset"));
        life.events.push_back(ask(tick + dice.whole(1, 60), "arm"));
      }
      continue;
    }
    const int what = dice.whole(0, 99);
    // Some orders are meant to be waited for.
    if (dice.chance(0.3)) tick += ticksOf(dice.between(2.0, 12.0));
    if (tick >= life.ticks) break;
    if (what < 50) {
      life.events.push_back(ask(tick, drawRun(dice, e)));
    } else if (what < 62) {
      life.events.push_back(ask(tick, "hold"));
    } else if (what < 66) {
      life.events.push_back(ask(tick, "stop"));
    } else if (what < 68) {
      life.events.push_back(ask(tick, "tare"));
    } else if (what < 70) {
      const auto factor = [&] { return std::exp2(dice.between(-1.0, 1.0)); };
      std::string text =
          fmt::format("vehicle in {:.1f} mass {:.2f}", dice.between(0.0, 3.0), factor());
      if (!scenario.floats())
        text += fmt::format(" damping {:.2f} stiffness {:.2f}", factor(), factor());
      life.events.push_back(ask(tick, text));
    } else if (what < 74) {
      life.events.push_back(ask(tick, "compensate"));
    } else if (what < 78) {
      life.events.push_back(ask(tick, "uncompensate"));
    } else if (what < 82) {
      life.events.push_back(ask(tick, "program"));
    } else if (what < 84) {
      life.events.push_back(ask(tick, "reset"));
    } else if (what < 86) {
      const int jets = propulsionOf(e.controller.vehicle).size;
      life.events.push_back(
          ask(tick, jets > 0 ? fmt::format("thrust {:.3f} {}", dice.between(0.005, 1.0),
                                           dice.whole(0, jets - 1))
                             : "gripper"));
    } else if (what < 92) {
      life.events.push_back(ask(tick, "arm"));
    } else if (has_robot) {
      life.events.push_back(ask(tick, drawRobot(dice, e)));
    }
  }
  std::stable_sort(life.events.begin(), life.events.end(),
                   [](const Event& a, const Event& b) { return a.tick < b.tick; });
  return life;
}

std::string write(const Life& life, const std::string& comment) {
  std::string out = comment.empty() ? "" : fmt::format("# {}\n", comment);
  out += fmt::format("seed: {}\nscenario: {}\nset:", life.seed, life.scenario);
  if (life.set.empty()) out += " []";
  for (const std::string& set : life.set) out += fmt::format("\n  - '{}'", set);
  out += fmt::format(
      "\nticks: {}\nsample_period_ns: {}\nmachine_phase_ns: {}\nlatency_ns: {}\n"
      "clock_offset_ns: {}\nlogged: {}\nevents:",
      life.ticks, life.sample_period, life.machine_phase, life.latency, life.clock_offset,
      life.logged);
  if (life.events.empty()) out += " []";
  for (const Event& e : life.events) {
    out +=
        fmt::format("\n  - {{tick: {}, {}: '{}'", e.tick, kKinds[static_cast<int>(e.kind)], e.what);
    if (e.which != 0) out += fmt::format(", which: {}", e.which);
    if (e.amount != 0.0) out += fmt::format(", amount: {}", e.amount);
    if (e.ticks != 1) out += fmt::format(", ticks: {}", e.ticks);
    out += "}";
  }
  return out + "\n";
}

Life read(const std::filesystem::path& file) {
  const Value document = loadDocument(file);
  Section root(document, "");
  constexpr auto kMost = std::int64_t{1} << 50;
  Life life;
  life.seed = static_cast<std::uint64_t>(root.integer("seed", 0, kMost));
  life.scenario = root.text("scenario");
  life.set = root.texts("set");
  life.ticks = root.integer("ticks", 1, kMost);
  life.sample_period = root.integer("sample_period_ns", 1'000'000, 1'000'000'000);
  life.machine_phase = root.integer("machine_phase_ns", 0, 1'000'000'000);
  life.latency = root.integer("latency_ns", 0, 1'000'000'000);
  life.clock_offset = root.integer("clock_offset_ns", 0, kMost);
  life.logged = root.flag("logged");
  for (Section s : root.list("events")) {
    Event e;
    e.tick = s.integer("tick", 0, kMost);
    for (int kind = 0; kind < static_cast<int>(Kind::kCount); ++kind)
      if (s.has(kKinds[kind])) {
        e.kind = static_cast<Kind>(kind);
        e.what = s.text(kKinds[kind]);
      }
    if (e.kind == Kind::kCount)
      s.fail("tick", fmt::format("nothing happens, want one of {}", fmt::join(kKinds, ", ")));
    if (s.has("which")) e.which = static_cast<int>(s.integer("which", 0, 5));
    if (s.has("amount")) e.amount = s.number("amount", -1e6, 1e6);
    if (s.has("ticks")) e.ticks = s.integer("ticks", 1, kMost);
    s.finish();
    life.events.push_back(e);
  }
  root.finish();
  return life;
}

}  // namespace ves::swarm
