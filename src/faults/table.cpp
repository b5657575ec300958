// SPDX-License-Identifier: BSD-3-Clause
#include "ves/faults/table.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <random>

#include "ves/config/experiment.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/process.hpp"
#include "ves/run/run.hpp"
#include "ves/transport/channels.hpp"
#include "ves/transport/event_log.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;
using Sets = std::vector<std::string>;

/// The segment in which faults come, two seconds after it began.
constexpr int kSegment = 2;
constexpr double kInjection = 2.0;  // [s]

constexpr const char* kSwing =
    "{trajectory: {duration_s: 8, z: {sine: {amplitude_m: 0.2, "
    "frequency_hz: 0.5}}}, faults: [{at_s: 2, ";
constexpr const char* kEmulate = "{admittance: {duration_s: 8}, faults: [{at_s: 2, ";
constexpr const char* kTilt =
    "{trajectory: {duration_s: 8, alpha: {sine: {amplitude_deg: 15, "
    "frequency_hz: 0.25}}}, faults: [{at_s: 2, ";

std::string program(const std::string& segment, const std::string& fault) {
  return "program=[{calibration: {}}, {move: {to: {x_m: 0.02}, duration_s: 1}}, " + segment +
         fault + "}]}]";
}

/// What a lockstep run should come to.
struct Expect {
  Phase phase = Phase::kParked;
  Check cause = Check::kCount;
  int within = 0;                // [-] ticks from injection to detection
  std::vector<Check> also = {};  // other causes that are as good
  bool cut_short = false;
};

class Lockstep {
 public:
  Lockstep(fs::path config, std::string scenario)
      : config_(std::move(config)), scenario_(std::move(scenario)) {}

  Experiment experiment(const Sets& sets) const {
    return loadExperiment(config_ / "scenarios" / (scenario_ + ".yaml"), sets);
  }

  Seen run(const Sets& sets, const Expect& expect) const {
    const Experiment e = experiment(sets);
    const double period = static_cast<double>(e.controller.period) * kSecondPerNanosecond;
    Seen seen;
    seen.period = period;
    std::int64_t injected = -1, detected = -1;
    Phase worst = Phase::kDisarmed;
    Tripped latched;
    const RunResult result = runLockstep(e, nullptr, [&](const TickState& s) {
      if (injected < 0 && s.segment == kSegment && s.phase == Phase::kRunning)
        injected = s.tick + static_cast<std::int64_t>(kInjection / period);
      if (detected < 0 && s.latched.any()) detected = s.tick;
      latched = s.latched;
      if (s.phase == Phase::kStopping) worst = Phase::kStopping;
      if (injected >= 0 && s.tick >= injected)
        seen.peak_deviation =
            std::max(seen.peak_deviation, (s.due.head<3>() - s.measured.p).norm());
      return Order();
    });
    const bool cause = result.cause == expect.cause ||
                       std::count(expect.also.begin(), expect.also.end(), result.cause) > 0;
    if (result.phase == Phase::kStopped) {
      seen.ticks = injected < 0 ? -1 : detected - injected;
      seen.what = fmt::format(
          "{}{}", worst == Phase::kStopping ? "controlled stop: " : "freeze: ", names(latched));
    } else {
      seen.what =
          std::string(name(result.phase)) + (result.cut_short ? ", cut short" : ", no trip");
    }
    seen.as_expected = result.phase == expect.phase && cause &&
                       result.cut_short == expect.cut_short &&
                       (expect.within == 0 || (seen.ticks >= 0 && seen.ticks <= expect.within));
    return seen;
  }

 private:
  fs::path config_;
  std::string scenario_;
};

/// An operator's hands on controller and plant, tick by tick.
class Bench {
 public:
  explicit Bench(const Experiment& e) : e_(e), platform_(e.controller), plant_(e.plant) {}

  const TickState& tick(Request request = Request::kNone, const Segment& segment = {}) {
    in_.order = {request, segment, {}};
    const Sample sample = plant_.sample();
    if (disturb)
      disturb(in_, sample);
    else
      in_.sample = sample;
    state_ = &platform_.tick(in_);
    if (!mute) plant_.command(state_->command);
    ++in_.tick;
    time_ += e_.controller.period;
    plant_.advance(time_);
    return *state_;
  }
  const TickState& run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
    return *state_;
  }
  const TickState& arm() {
    run(20);
    tick(Request::kArm);
    for (int i = 0; i < 200 && tick().phase != Phase::kArmed; ++i) {
    }
    return *state_;
  }
  const TickState& state() const { return *state_; }
  plant::Plant& plant() { return plant_; }
  TickInput& in() { return in_; }

  std::function<void(TickInput&, const Sample&)> disturb;  // puts the sample into the input
  bool mute = false;                                       // commands do not reach the legs

 private:
  Experiment e_;
  TestPlatform platform_;
  plant::Plant plant_;
  TickInput in_;
  std::int64_t time_ = 0;
  const TickState* state_ = nullptr;
};

Segment sine(double amplitude, double frequency, double duration) {
  Segment s;
  s.kind = SegmentKind::kTrajectory;
  s.duration = duration;
  s.trajectory[2] = {AxisMotion::kSine, 0.0, amplitude, frequency};
  return s;
}

Seen verdict(bool good, std::string what, std::int64_t ticks = -1) {
  Seen seen;
  seen.as_expected = good;
  seen.what = std::move(what);
  seen.ticks = ticks;
  seen.period = 0.01;
  return seen;
}

/// How many of `tries` are refused with a line that begins as it should.
Seen refusals(const std::vector<std::function<void()>>& tries) {
  std::size_t refused = 0;
  for (const auto& attempt : tries) {
    try {
      attempt();
    } catch (const InputError&) {
      ++refused;
    }
  }
  return verdict(refused == tries.size(), fmt::format("{} of {} refused", refused, tries.size()));
}

fs::path temporary(const std::string& name) {
  return fs::temp_directory_path() / fmt::format("ves_faults_{}_{}", getpid(), name);
}

/// What is heard of legs and controllers on the bus.
struct Witness {
  Bus bus{kDefaultUrl};
  std::int64_t engaged = 0, states = 0, truths = 0, controller = 0;
  Phase phase = Phase::kDisarmed;
  Check cause = Check::kCount;
  Vec6 legs = Vec6::Zero();
  double low = HUGE_VAL, high = 0.0;  // [m] of all legs so far

  Witness() {
    bus.subscribe("VES_(STATE|LEG_COMMAND|TRUTH)",
                  [this](const std::string&, const void* data, std::uint32_t size) {
                    if (const auto m = decode<truth_t>(data, size)) {
                      ++truths;
                      legs = Vec6::Map(m->leg);
                      low = std::min(low, legs.minCoeff());
                      high = std::max(high, legs.maxCoeff());
                    }
                    if (const auto m = decode<leg_command_t>(data, size)) engaged += m->engaged;
                    if (const auto m = decode<state_t>(data, size)) {
                      ++states;
                      controller = m->header.source;
                      phase = static_cast<Phase>(m->phase);
                      cause = static_cast<Check>(m->cause);
                    }
                  });
  }
  bool until(const std::function<bool()>& what, double seconds = 15.0) {
    const std::int64_t end = monotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
    bool yes = what();
    while (!yes && monotonicNow() < end) {
      bus.wait(20);
      yes = what();
    }
    return yes;
  }
  /// The legs come to rest: 100 messages of the plant in a row.
  bool rests() {
    Vec6 last = legs;
    std::int64_t still = 0, seen = truths;
    return until([&] {
      if (truths == seen) return false;
      still = (legs - last).cwiseAbs().maxCoeff() < 1e-5 ? still + truths - seen : 0;
      seen = truths;
      last = legs;
      return still > 100;
    });
  }
  bool inside(const SafetyLimits& limits) const {
    return low >= limits.leg_min - 0.01 && high <= limits.leg_max + 0.01;
  }
};

/// A controller and a plant as processes, the controller in full swing.
class Pair {
 public:
  Pair(const fs::path& config, const fs::path& programs, const std::string& scenario)
      : programs_(programs),
        limits_(loadExperiment(config / "scenarios" / (scenario + ".yaml")).controller.safety),
        file_((config / "scenarios" / (scenario + ".yaml")).string()) {
    plant = std::make_unique<Process>(programs / "ves-plant", Sets{file_});
    startController({"--start"});
  }
  void startController(Sets arguments) {
    arguments.insert(arguments.begin(), file_);
    // The machine may be busy; what a row injects is not that.
    for (const char* set : {"safety.stall_ticks=60", "safety.overruns_per_second=50"})
      arguments.insert(arguments.end(), {"--set", set});
    controller = std::make_unique<Process>(programs_ / "ves-controller", arguments);
  }
  bool swinging(Witness& w, std::int64_t commands = 300) {
    const std::int64_t from = w.engaged;
    return w.until([&] { return w.engaged > from + commands; });
  }
  const SafetyLimits& limits() const { return limits_; }

  std::unique_ptr<Process> plant, controller;

 private:
  fs::path programs_;
  SafetyLimits limits_;
  std::string file_;
};

/// Datagrams at the bus's address that are no LCM messages, or broken ones.
void throwRubbish(int count) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7667);
  to.sin_addr.s_addr = inet_addr("239.255.76.67");
  std::mt19937 random(1);
  std::vector<std::uint8_t> packet(1400);
  for (int i = 0; i < count; ++i) {
    const std::size_t size = random() % packet.size();
    for (std::size_t k = 0; k < size; ++k) packet[k] = static_cast<std::uint8_t>(random());
    if (i % 3 && size > 16) {  // LCM's short-message magic, then a channel name of ours
      const std::uint8_t head[] = {'L', 'C', '0', '2', 0, 0, 0, 1};
      std::copy(std::begin(head), std::end(head), packet.begin());
      const char channel[] = "VES_LEG_COMMAND";
      if (size > 8 + sizeof channel && i % 3 == 1)
        std::copy(std::begin(channel), std::end(channel), packet.begin() + 8);
    }
    sendto(fd, packet.data(), size, 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    if (i % 200 == 0) usleep(2000);
  }
  close(fd);
}

}  // namespace

std::vector<FaultRow> faultTable(const fs::path& config, const fs::path& programs) {
  const Lockstep puma(config, "puma_on_table_4_1");
  const auto inject = [puma](const char* segment, const std::string& fault, const Expect& expect,
                             const Sets& more = {}) {
    Sets sets = {program(segment, fault)};
    sets.insert(sets.end(), more.begin(), more.end());
    return [=] { return puma.run(sets, expect); };
  };
  const Expect goes_on{};
  const auto stops = [](Check cause, int within, std::vector<Check> also = {}) {
    return Expect{Phase::kStopped, cause, within, std::move(also), false};
  };
  const auto bench = [puma](const Sets& sets = {}) { return Bench(puma.experiment(sets)); };

  std::vector<FaultRow> rows;
  const auto row = [&](const char* id, const char* fault, const char* expected,
                       std::function<Seen()> run, bool processes = false) {
    rows.push_back({id, fault, expected, processes, std::move(run)});
  };

  row("F1", "a sample that is no number, once", "not let in; the run goes on",
      inject(kEmulate, "duration_s: 0.01, fault: joints_lost", goes_on));
  row("F2", "samples that are no numbers, from now on", "controlled stop: sample age",
      inject(kEmulate, "duration_s: 60, fault: joints_lost", stops(Check::kStale, 5)));
  row("F3", "wrench frozen while the robot's weight turns", "controlled stop: sensor frozen",
      inject(kTilt, "duration_s: 60, fault: wrench_frozen", stops(Check::kSensorFrozen, 60)));
  row("F4", "wrench channel at the converter's end", "controlled stop: sensor saturated",
      inject(kEmulate, "duration_s: 60, fault: wrench_rail, which: 3",
             stops(Check::kSensorSaturated, 1)));
  row("F5", "the bias steps by 150 N between calibration and admittance control", "not begun; home",
      [puma] {
        return puma.run(
            {"program=[{calibration: {}}, {trajectory: {duration_s: 2}, faults: [{at_s: "
             "1, duration_s: 60, fault: wrench_step, which: 3, counts: 840}]}, "
             "{admittance: {duration_s: 5}}]"},
            Expect{Phase::kParked, Check::kCount, 0, {}, true});
      });
  row("F6", "a force axis wired the other way round", "calibration refused; home", [puma] {
    Experiment e = puma.experiment({});
    e.controller.sensor.C_proc.row(2) *= -1.0;
    const RunResult r = runLockstep(e, nullptr, nullptr);
    return verdict(r.cut_short && r.phase == Phase::kParked, "calibration refused, parked at home");
  });
  row("F7", "samples two calls late, then shuffled", "the run goes on", [puma] {
    return puma.run({program(kEmulate,
                             "duration_s: 1, fault: samples_late, samples: 2}, {at_s: "
                             "4, duration_s: 1, fault: samples_shuffled")},
                    Expect{});
  });
  row("F8", "samples stop", "controlled stop: sample age",
      inject(kEmulate, "duration_s: 60, fault: samples_lost", stops(Check::kStale, 5)));
  row("F9", "joint angles lost while the arm is out", "controlled stop: sample age",
      inject(kTilt, "duration_s: 60, fault: joints_lost", stops(Check::kStale, 5)));
  row("F10", "a leg's counter out of range", "not let in; controlled stop: sample age",
      inject(kSwing, "duration_s: 60, fault: leg_out_of_range, which: 2", stops(Check::kStale, 5)));
  row("F10b", "a leg's counter wraps", "freeze: leg reading",
      inject(kSwing, "duration_s: 60, fault: leg_jump, which: 4, counts: -4096",
             stops(Check::kLegReading, 2)));
  row("F11", "a leg reads 10 mm more, once", "not believed; the run goes on",
      inject(kEmulate, "duration_s: 0.01, fault: leg_jump, which: 1, counts: 143", goes_on));
  row("F11b", "a leg reads 10 mm more, from now on", "freeze: leg reading",
      inject(kEmulate, "duration_s: 60, fault: leg_jump, which: 1, counts: 143",
             stops(Check::kLegReading, 2)));
  row("F12", "a leg is stuck (valve shut)", "freeze of all six: position error",
      inject(kSwing, "duration_s: 60, fault: valve_stuck, which: 5",
             stops(Check::kPositionError, 40, {Check::kForwardKinematics})));
  row("F12b", "a leg's reading is stuck", "freeze of all six: position error",
      inject(kSwing, "duration_s: 60, fault: leg_frozen, which: 5",
             stops(Check::kPositionError, 40, {Check::kForwardKinematics, Check::kLegReading})));
  row("F13", "a leg runs away (valve open)",
      "stopped by what shows first; the open valve is the pump's to cut",
      inject(kEmulate, "duration_s: 60, fault: runaway, which: 6",
             stops(Check::kLegReading, 4, {Check::kPositionError, Check::kSensorSaturated})));
  row(
      "F14", "the machine's process is killed", "controlled stop: sample age",
      [=] {
        Witness w;
        Pair pair(config, programs, "z_sine");
        if (!pair.swinging(w)) return verdict(false, "never in swing");
        pair.plant->signal(SIGKILL);
        pair.plant->wait();
        const bool stopped = w.until([&] { return w.phase == Phase::kStopped; });
        const Check cause = w.cause;
        return verdict(stopped && cause == Check::kStale && pair.controller->wait() == 1,
                       fmt::format("{}: {}", name(w.phase), name(cause)));
      },
      true);
  row(
      "F15", "the controller is killed",
      "legs come to rest inside their limits; its successor waits",
      [=] {
        Witness w;
        Pair pair(config, programs, "z_sine");
        if (!pair.swinging(w, 5 + static_cast<std::int64_t>(std::random_device{}() % 700)))
          return verdict(false, "never in swing");
        pair.controller->signal(SIGKILL);
        pair.controller->wait();
        const bool rests = w.rests();
        const std::int64_t engaged = w.engaged, dead = w.controller;
        pair.startController({"--no-menu"});
        std::int64_t states = 0;
        const bool waits = w.until([&] {
          if (w.controller != dead && states == 0) states = w.states;
          return states > 0 && w.states > states + 100;
        });
        return verdict(rests && waits && w.engaged == engaged && w.inside(pair.limits()),
                       fmt::format("legs {}, successor {}", rests ? "rest" : "MOVE",
                                   w.engaged == engaged ? "waits" : "MOVES"));
      },
      true);
  row("F15b", "the controller falls silent for 40 s", "legs hold; after 10 s they go home slowly",
      [bench] {
        Bench b = bench();
        b.arm();
        b.tick(Request::kRun, sine(0.1, 0.5, 10.0));
        b.run(130);
        b.mute = true;
        b.run(200);
        const Vec6 held = b.plant().truth().legs.L;
        b.run(700);
        const bool holds = (b.plant().truth().legs.L - held).cwiseAbs().maxCoeff() < 2e-4;
        double fastest = 0.0;
        for (int i = 0; i < 2500; ++i) {
          b.tick();
          fastest = std::max(fastest, b.plant().truth().legs.L_dot.cwiseAbs().maxCoeff());
        }
        const double away = b.plant().truth().x.stacked().norm();
        return verdict(holds && fastest < 0.05 && away < 1e-3,
                       fmt::format("held, then home at {:.0f} mm/s", fastest * 1e3));
      });
  row("F16", "the controller stalls for 500 ms", "controlled stop: tick overrun; no burst",
      [bench] {
        Bench b = bench();
        b.arm();
        b.tick(Request::kRun, sine(0.2, 0.5, 10.0));
        b.run(200);
        const Vec6 L = b.state().legs.L;
        b.in().tick += 50;
        b.tick();
        const double step = (b.state().legs.L - L).cwiseAbs().maxCoeff();
        return verdict(b.state().cause == Check::kOverrun && step < 0.0075,
                       fmt::format("{}; next step {:.1f} mm", name(b.state().cause), step * 1e3),
                       1);
      });
  row("F17", "one tick is 15 ms late", "counted; the run goes on", [bench] {
    Bench b = bench();
    b.arm();
    b.tick(Request::kRun, sine(0.1, 0.5, 10.0));
    b.run(100);
    b.in().tick += 1;
    b.run(100);
    return verdict(b.state().phase == Phase::kRunning && b.state().late_ticks == 1,
                   fmt::format("{}, {} late", name(b.state().phase), b.state().late_ticks));
  });
  row("F17b", "six late ticks in a second", "controlled stop: tick overrun", [bench] {
    Bench b = bench();
    b.arm();
    b.tick(Request::kRun, sine(0.1, 0.5, 10.0));
    b.run(100);
    for (int i = 0; i < 6; ++i) {
      b.run(8);
      b.in().tick += 1;
    }
    b.tick();
    return verdict(b.state().cause == Check::kOverrun, std::string(name(b.state().cause)), 1);
  });
  row("F18", "the wall clock steps", "no effect: neither loop reads one (CLOCK_MONOTONIC only)",
      [] { return verdict(true, "cannot apply: not injected"); });
  row("F19", "a second controller commands while we wait", "does not arm", [bench] {
    Bench b = bench();
    b.disturb = [](TickInput& in, const Sample& s) {
      in.sample = s;
      in.rival = true;
    };
    b.run(20);
    b.tick(Request::kArm);
    b.run(300);
    return verdict(b.state().phase == Phase::kDisarmed, std::string(name(b.state().phase)));
  });
  row("F19b", "a second controller commands while we do", "freeze: second controller", [bench] {
    Bench b = bench();
    b.arm();
    b.tick(Request::kRun, sine(0.1, 0.5, 10.0));
    b.run(100);
    b.in().rival = true;
    b.tick();
    return verdict(b.state().cause == Check::kRival && b.state().phase == Phase::kStopped,
                   std::string(name(b.state().cause)), 1);
  });
  row("F20", "started with the platform 200 mm and 5 deg away", "first command is where it is",
      [puma] {
        const Experiment e =
            puma.experiment({"initial_pose={x_m: 0.12, z_m: -0.16, gamma_deg: 5}"});
        Bench b(e);
        b.arm();
        const double jump = (b.state().legs.L - b.plant().truth().legs.L).cwiseAbs().maxCoeff();
        return verdict(jump < 2e-4, fmt::format("first command {:.2f} mm away", jump * 1e3));
      });
  row(
      "F21", "100000 datagrams of rubbish on the bus", "the run goes on, or the legs rest",
      [=] {
        Witness w;
        Pair pair(config, programs, "z_sine");
        if (!pair.swinging(w, 100)) return verdict(false, "never in swing");
        throwRubbish(100'000);
        const bool alive = pair.plant->running();
        const int status = pair.controller->wait();
        const bool safe = w.inside(pair.limits()) && (!alive || w.rests());
        return verdict(safe, fmt::format("plant {}, controller {}", alive ? "alive" : "dead",
                                         status == 0   ? std::string("parked")
                                         : status == 1 ? fmt::format("stopped: {}", name(w.cause))
                                                       : fmt::format("status {}", status)));
      },
      true);
  row("F22", "strings of hostile length in a message", "not decoded", [puma] {
    const experiment_t m = describe(puma.experiment({}), {1, 2}, 0);
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
    m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    int taken = 0;
    for (std::uint32_t length : {0x7fffffffu, 0xffffffffu, 0u, 0x40000000u}) {
      auto bad = bytes;
      for (int i = 0; i < 4; ++i)
        bad[40 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(length >> (24 - 8 * i));
      taken += decode<experiment_t>(bad.data(), static_cast<std::int64_t>(bad.size())).has_value();
    }
    return verdict(taken == 0, fmt::format("{} of 4 taken", taken));
  });
  row("F23", "a message of another version", "not decoded", [] {
    const sample_t m{};
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
    m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    int taken = 0;
    for (std::size_t bit = 0; bit < 64; ++bit) {
      auto other = bytes;
      other[bit / 8] = static_cast<std::uint8_t>(other[bit / 8] ^ (1u << (bit % 8)));
      taken += decode<sample_t>(other.data(), static_cast<std::int64_t>(other.size())).has_value();
    }
    return verdict(taken == 0, fmt::format("{} of 64 taken", taken));
  });
  row("F24", "logs that are empty, cut short, out of step, absurd, or a folder",
      "one line with the byte", [] {
        const fs::path file = temporary("log");
        const auto reading = [&](std::function<void(std::vector<char>&)> edit) {
          return [=] {
            {
              LogWriter writer(file.string());
              for (int i = 0; i < 3; ++i) writer.write(channel::kSample, sample_t{}, i * 1000);
            }
            std::ifstream in(file, std::ios::binary);
            std::vector<char> bytes{std::istreambuf_iterator<char>(in), {}};
            edit(bytes);
            std::ofstream(file, std::ios::binary)
                .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
            LogReader reader(file.string());
            LogEvent event;
            while (reader.next(event)) {
            }
          };
        };
        Seen seen = refusals(
            {reading([](auto& b) { b.clear(); }), reading([](auto& b) { b.resize(b.size() - 5); }),
             reading([](auto& b) { b.resize(13); }), reading([](auto& b) { b[0] ^= 1; }),
             reading([](auto& b) { b[24] = 0x7f; }), reading([](auto& b) { b[20] = 0x7f; }),
             [] { LogReader reader("/"); }});
        fs::remove(file);
        return seen;
      });
  row("F25", "configurations that are wrong", "one line with file and line", [puma] {
    std::vector<std::function<void()>> tries;
    for (const char* set :
         {"legs.tau_s=nan", "legs.tau_s=-1", "controller.period_ns=0", "nonsense=1",
          "base.mass_diagonal=[1,1,1,1,1,-1]", "robot.joints_deg_or_m=[0]", "program=[]",
          "safety.leg_min_m=inf", "sensor.gain=[0,0,0,0,0,0]", "seed=x", "gravity_m_per_s2={}"})
      tries.push_back([=] { puma.experiment({set}); });
    tries.push_back([] { loadExperiment("/no/such/file.yaml"); });
    tries.push_back([] { parseDocument("a: [", "x.yaml"); });
    return refusals(tries);
  });
  row("F26", "a base that the loop feeds (mass ratio 6 at 4 Hz)",
      "controlled stop: growing oscillation", [puma] {
        return puma.run({"base={mass_diagonal: [12.5, 12.5, 12.5, 12.5, 12.5, 12.5], "
                         "damping_diagonal: [2, 2, 2, 1, 1, 1], stiffness_diagonal: [7900, 7900, "
                         "7900, 7900, 7900, 7900]}",
                         "program=[{calibration: {}},{move: {to: {x_m: 0.002}}},{admittance: "
                         "{duration_s: 30}}]"},
                        Expect{Phase::kStopped, Check::kOscillation, 0, {}, false});
      });
  row("F27", "a force that drives the platform to its limits", "slowed to rest inside; no trip",
      [puma] {
        return puma.run({program("{admittance: {duration_s: 8}, faults: [{at_s: 2, ",
                                 "duration_s: 60, fault: wrench_step, which: 3, counts: -2200"),
                         "base.stiffness_diagonal=[150, 250, 400, 1500, 1000, 2000]"},
                        Expect{});
      });
  row("F28", "a trajectory ordered that leaves the workspace, or is too fast", "refused beforehand",
      [bench] {
        Bench b = bench();
        b.arm();
        b.tick(Request::kRun, sine(0.4, 0.2, 5.0));
        const Check first = b.state().refused_by;
        b.tick(Request::kRun, sine(0.2, 3.0, 5.0));
        return verdict(first == Check::kMotionLimits && b.state().refused_by == Check::kVelocity &&
                           b.state().phase == Phase::kArmed,
                       fmt::format("{}; {}", name(first), name(b.state().refused_by)));
      });
  row("F29", "a program through a near-singular pose, or legs too close", "freeze, by name",
      [puma] {
        const Seen a = puma.run(
            {program(kSwing, "duration_s: 0, fault: panic_button"), "safety.condition_number=1.45"},
            Expect{Phase::kStopped, Check::kConditioning, 0, {}, false});
        const Seen b =
            puma.run({"program=[{trajectory: {duration_s: 4, alpha: {ramp: {to_deg: 29.9}}}}]",
                      "initial_pose={}", "safety.leg_clearance_m=0.1530"},
                     Expect{Phase::kStopped, Check::kCollide, 0, {}, false});
        return verdict(a.as_expected && b.as_expected, a.what + "; " + b.what);
      });
  row("F30", "the wrench is fed back twice as strong", "stop before 50 mm", [puma] {
    Experiment e =
        puma.experiment({"program=[{calibration: {}},{move: {to: {x_m: 0.01}}},"
                         "{admittance: {duration_s: 30}}]",
                         "base={mass_diagonal: [30, 30, 30, 30, 30, 30], "
                         "damping_diagonal: [2, 2, 2, 1, 1, 1], stiffness_diagonal: "
                         "[19000, 19000, 19000, 19000, 19000, 19000]}"});
    e.plant.sensor.S *= 3.0;
    e.controller.stillness.bias = 1e9;
    double far = 0.0;
    const RunResult r = runLockstep(e, nullptr, [&](const TickState& s) {
      far = std::max(far, s.motion.x.head<3>().norm());
      return Order();
    });
    return verdict(r.phase == Phase::kStopped && far < 0.05,
                   fmt::format("{}: {}, {:.0f} mm", name(r.phase), name(r.cause), far * 1e3));
  });
  row("F31", "hydraulic pressure falls", "controlled stop: pressure",
      inject(kSwing, "duration_s: 60, fault: pressure, volts: 1.0", stops(Check::kPressure, 1)));
  row("F31b", "pressure is low at the start", "does not arm", [bench] {
    Bench b = bench({"sensor.pressure_v=1.0"});
    b.run(20);
    b.tick(Request::kStart);
    b.run(300);
    return verdict(b.state().phase == Phase::kDisarmed && b.state().tripped.has(Check::kPressure),
                   "disarmed: pressure");
  });
  row("F32", "panic button", "freeze within a tick",
      inject(kSwing, "duration_s: 60, fault: panic_button", stops(Check::kPanicButton, 1)));
  row("F32b", "floor mat, for one sample", "freeze within a tick, latched",
      inject(kSwing, "duration_s: 0.01, fault: floor_mat", stops(Check::kFloorMat, 1)));
  row("F32c", "panic button held, reset asked for", "refused until released, then disarmed",
      [bench] {
        Bench b = bench();
        b.arm();
        b.disturb = [](TickInput& in, const Sample& s) {
          in.sample = s;
          in.sample.switches = 0;  // both, as with a cut cable
        };
        b.run(3);
        const Refusal held = b.tick(Request::kReset).refusal;
        b.disturb = nullptr;
        b.run(3);
        b.tick(Request::kReset);
        return verdict(held == Refusal::kCauseRemains && b.state().phase == Phase::kDisarmed,
                       fmt::format("{}; then {}", name(held), name(b.state().phase)));
      });
  row("F33", "resumed after a stop in full swing", "from where it stands, no step", [bench] {
    Bench b = bench();
    b.arm();
    b.tick(Request::kRun, sine(0.2, 0.5, 10.0));
    b.run(230);
    b.disturb = [](TickInput& in, const Sample& s) {
      in.sample = s;
      in.sample.switches = 0;
    };
    b.run(100);
    b.disturb = nullptr;
    b.run(50);
    b.tick(Request::kReset);
    b.arm();
    const double step = (b.state().legs.L - b.plant().truth().legs.L).cwiseAbs().maxCoeff();
    return verdict(b.state().phase == Phase::kArmed && step < 2e-4,
                   fmt::format("armed, first command {:.2f} mm away", step * 1e3));
  });
  row("F34", "a parameter changed while moving", "cannot be: a run's configuration is fixed",
      [] { return verdict(true, "cannot apply: not injected"); });
  row("F35", "the disk is full", "control unaffected, loss counted", [puma] {
    LogWriter log("/dev/full");
    const RunResult with = runLockstep(puma.experiment({}), &log, nullptr);
    const RunResult without = runLockstep(puma.experiment({}), nullptr, nullptr);
    return verdict(with.good() && with.lost > 0 && with.ticks == without.ticks,
                   fmt::format("parked, {} events lost", with.lost));
  });
  row("F36", "five minutes of random faults and recoveries, twice",
      "no law broken, same hash again", [config] {
        const SoakResult a = soak(config, 30'000, 1, nullptr), b = soak(config, 30'000, 1, nullptr);
        return verdict(a.violated.empty() && a.hash == b.hash && a.stops > 5,
                       a.violated.empty() ? fmt::format("{} faults, {} stops, {} recoveries",
                                                        a.faults, a.stops, a.recoveries)
                                          : a.violated);
      });
  row(
      "F37", "both processors hogged", "the run goes on, or a stop by name",
      [=] {
        Witness w;
        Process hog1("/bin/sh", {"-c", "while :; do :; done"});
        Process hog2("/bin/sh", {"-c", "while :; do :; done"});
        Pair pair(config, programs, "z_sine");
        const int status = pair.controller->wait();
        w.bus.drain();
        return verdict(
            (status == 0 || status == 1) && w.inside(pair.limits()),
            status == 0 ? std::string("parked") : fmt::format("stopped: {}", name(w.cause)));
      },
      true);
  row("F38", "floor mat and pressure in the same tick", "both recorded, the mat is the cause",
      [puma] {
        Seen seen = puma.run({program(kSwing,
                                      "duration_s: 60, fault: pressure, volts: 1.0}, {at_s: 2, "
                                      "duration_s: 60, fault: floor_mat")},
                             Expect{Phase::kStopped, Check::kFloorMat, 1, {}, false});
        seen.as_expected = seen.as_expected && seen.what.find("pressure") != std::string::npos;
        return seen;
      });
  return rows;
}

SoakResult soak(const fs::path& config, std::int64_t ticks, std::uint32_t seed,
                const std::function<void(std::int64_t)>& progress) {
  const Experiment e = loadExperiment(config / "scenarios" / "puma_on_table_4_1.yaml",
                                      {fmt::format("seed={}", seed)});
  const SafetyLimits& limits = e.controller.safety;
  const double period = static_cast<double>(e.controller.period) * kSecondPerNanosecond;
  SoakResult out;
  out.hash = 0xcbf29ce484222325u;
  std::mt19937 random(seed);
  const auto chance = [&](double p) {
    return std::uniform_real_distribution<double>(0.0, 1.0)(random) < p;
  };
  const auto pick = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };

  // One machine for the whole time; a fault is put on its samples from outside.
  TestPlatform platform(e.controller);
  plant::Plant plant(e.plant);
  plant::Injector injector;
  plant::FaultEvent fault;
  std::int64_t fault_until = -1;
  TickInput in;
  Vec6 last = Vec6::Zero();
  bool was_engaged = false;
  std::int64_t time = 0;
  Phase before = Phase::kDisarmed;
  for (; out.ticks < ticks && out.violated.empty(); ++out.ticks) {
    if (out.ticks > fault_until && chance(0.002)) {
      ++out.faults;
      fault.fault = static_cast<plant::Fault>(pick(static_cast<int>(plant::Fault::kCount)));
      fault.index = pick(6);
      fault.amount = fault.fault == plant::Fault::kPressure ? 1.0 : 100.0 * (pick(40) - 20);
      if (fault.fault == plant::Fault::kLate) fault.amount = 1 + pick(5);
      fault_until = out.ticks + (1 << pick(8));
    }
    Sample sample = plant.sample();
    injector.apply(fault, out.ticks <= fault_until, e.plant.sensor.volts_per_count, sample);
    if (const auto let_in = fromMessage(toMessage(sample, {2, 0}, in.tick - 1)))
      in.sample = *let_in;
    in.rival = chance(1e-5);

    const TickState& s = platform.tick(in);
    in.order = {};
    switch (s.phase) {
      case Phase::kDisarmed:
        if (chance(0.05)) in.order.request = Request::kArm;
        break;
      case Phase::kArmed:
        if (before == Phase::kDisarmed && out.stops > 0) ++out.recoveries;
        if (chance(0.05)) {
          in.order.request = Request::kRun;
          Segment& segment = in.order.segment;
          segment = {};
          segment.kind = static_cast<SegmentKind>(pick(4));
          segment.duration = 0.5 + 0.01 * pick(500);
          Vec6 target;
          for (int i = 0; i < 6; ++i) {
            target(i) = (i < 3 ? 0.3 : 0.5) * (pick(2001) - 1000) * 1e-3;
            segment.trajectory[static_cast<std::size_t>(i)] = {static_cast<AxisMotion>(pick(3)),
                                                               0.3 * target(i), 0.3 * target(i),
                                                               0.01 * pick(100)};
          }
          segment.target = Pose::from(0.5 * target);
          if (segment.kind == SegmentKind::kMove) segment.duration = 0.0;
        }
        break;
      case Phase::kRunning:
        if (chance(0.002)) in.order.request = Request::kHold;
        if (chance(0.001)) in.order.request = Request::kTare;
        if (chance(0.005))
          plant.moveRobot({pick(6), 0.5 * (pick(2001) - 1000) * 1e-3, 0.5 + 0.01 * pick(300)});
        break;
      case Phase::kStopped:
        if (before != Phase::kStopped) ++out.stops;
        if (chance(0.02)) in.order.request = Request::kReset;
        break;
      default: break;
    }
    before = s.phase;

    // The laws: whatever came in, what leaves is inside the limits and near what left before.
    if (s.command.engaged) {
      const Vec6 L = legLengths(e.controller.legs, s.command.counts);
      const double count = e.plant.transducer.scale;
      if (!(L.minCoeff() >= limits.leg_min - count && L.maxCoeff() <= limits.leg_max + count))
        out.violated = fmt::format("tick {}: a leg outside its limits", in.tick);
      if (was_engaged &&
          !((L - last).cwiseAbs().maxCoeff() <= limits.leg_velocity * period + 2.0 * count))
        out.violated = fmt::format("tick {}: a leg faster than its limit", in.tick);
      last = L;
    }
    was_engaged = s.command.engaged;
    for (const std::int32_t c : s.command.counts)
      out.hash = (out.hash ^ static_cast<std::uint64_t>(c)) * 0x100000001b3u;
    out.hash = (out.hash ^ static_cast<std::uint64_t>(s.phase)) * 0x100000001b3u;

    plant.command(s.command);
    in.tick += 1 + s.idle;
    time += (1 + s.idle) * e.controller.period;
    plant.advance(time);
    if (progress && out.ticks % 100'000 == 0) progress(out.ticks);
  }
  return out;
}

}  // namespace ves
