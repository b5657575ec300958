// SPDX-License-Identifier: BSD-3-Clause
//
// record_runs FOLDER [FIRST-LETTERS]: logs of everything that a controller can be made to do, in
// lockstep, one file a run. Two builds that behave alike leave the same files; compare_runs says
// where they part.
#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <iostream>
#include <random>
#include <set>

#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/config/experiment.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;
using Sets = std::vector<std::string>;

const Sets kCompensated = {"controller.compensation.feed_forward=true",
                           "controller.compensation.observer=true",
                           "controller.compensation.inertia=true"};

Sets operator+(Sets a, const Sets& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

/// An order given in the tick `at`.
struct Given {
  std::int64_t at;
  Order order;
};

Order ask(Request request, const Segment& segment = {}) { return {request, segment, {}}; }

Segment segment(SegmentKind kind, double duration = 0.0, const Pose& target = {}) {
  Segment s;
  s.kind = kind;
  s.duration = duration;
  s.target = target;
  return s;
}

Segment sine(int coordinate, double amplitude, double frequency, double duration) {
  Segment s = segment(SegmentKind::kTrajectory, duration);
  s.trajectory.motion[static_cast<std::size_t>(coordinate)] = AxisMotion::kSine;
  s.trajectory.amplitude(coordinate) = amplitude;
  s.trajectory.frequency(coordinate) = frequency;
  return s;
}

class Recorder {
 public:
  Recorder(fs::path folder, std::string only)
      : folder_(std::move(folder)), only_(std::move(only)), config_(VES_TEST_CONFIG_DIR) {
    fs::create_directories(folder_);
  }

  bool wanted(const std::string& name) const { return name.starts_with(only_); }

  Experiment experiment(const std::string& scenario, const Sets& sets) const {
    Experiment e = loadExperiment(config_ / "scenarios" / (scenario + ".yaml"), sets);
    applyStabilityCheck(e);
    return e;
  }

  void run(const std::string& name, const std::string& scenario, const Sets& sets = {},
           const std::vector<Given>& orders = {}, Request first = Request::kStart) const {
    if (!wanted(name)) return;
    const Experiment e = experiment(scenario, sets);
    LogWriter log((folder_ / (name + ".lcmlog")).string());
    auto next = orders.begin();
    runLockstep(
        e, &log,
        [&](const TickState& state) {
          return next != orders.end() && next->at <= state.tick ? (next++)->order : Order();
        },
        first);
  }

  /// Random faults, orders, rivals and missed ticks.
  void chaos(const std::string& name, const std::string& scenario, const Sets& sets,
             std::uint32_t seed, int ticks) const {
    if (!wanted(name)) return;
    const Experiment e = experiment(scenario, sets);
    LogWriter log((folder_ / (name + ".lcmlog")).string());
    std::mt19937 random(seed);
    const auto chance = [&](double p) { return static_cast<double>(random()) < p * 4294967296.0; };
    const auto pick = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
    TestPlatform platform(e.controller);
    plant::Plant plant(e.plant);
    plant::Injector injector;
    plant::FaultEvent fault;
    TickInput in;
    int fault_until = -1;
    for (int i = 0; i < ticks; ++i) {
      if (i > fault_until && chance(0.003)) {
        fault.fault = static_cast<plant::Fault>(pick(static_cast<int>(plant::Fault::kCount)));
        fault.index = pick(6);
        fault.amount = fault.fault == plant::Fault::kPressure ? 1.0 : 100.0 * (pick(40) - 20);
        if (fault.fault == plant::Fault::kLate) fault.amount = 1 + pick(5);
        fault_until = i + (1 << pick(7));
      }
      Sample sample = plant.sample();
      injector.apply(fault, i <= fault_until, e.plant.sensor.volts_per_count, sample);
      if (const auto let_in = fromMessage(toMessage(sample, {2, 0}))) in.sample = *let_in;
      in.conflicting_node = chance(2e-4);
      const TickState& s = platform.tick(in);
      const header_t h = header({1, 0}, in.tick, plant.time());
      log.write(channel::kState, toMessage(s, h), plant.time());
      log.write(channel::kLegCommand, toMessage(s.command, h), plant.time());
      in.order = {};
      if (chance(0.02)) {
        in.order.request = static_cast<Request>(1 + pick(static_cast<int>(Request::kCount) - 1));
        Segment& segment = in.order.segment;
        segment.kind = static_cast<SegmentKind>(pick(5));
        segment.duration = 0.5 + 0.01 * pick(500);
        segment.interval = 2.0;
        Vec6 target;
        for (int k = 0; k < 6; ++k) {
          target(k) = (k < 3 ? 0.3 : 0.5) * (pick(2001) - 1000) * 1e-3;
          segment.trajectory.motion[static_cast<std::size_t>(k)] = static_cast<AxisMotion>(pick(3));
          segment.trajectory.final(k) = segment.trajectory.amplitude(k) = 0.3 * target(k);
          segment.trajectory.frequency(k) = 0.01 * pick(100);
        }
        segment.target = Pose::from(0.5 * target);
        if (segment.kind == SegmentKind::kMove && chance(0.5)) segment.duration = 0.0;
        in.order.id = {7, i};
      }
      if (chance(0.005) && e.plant.payload.robot.joints > 0)
        plant.moveRobot(
            RobotMove{pick(6), 0.5 * (pick(2001) - 1000) * 1e-3, 0.5 + 0.01 * pick(300)});
      plant.command(s.command);
      in.tick += 1 + s.idle + (chance(0.003) ? 1 + pick(6) : 0);
      (void)chance(0.5);  // as many draws as ever
      plant.advance(in.tick * e.controller.period);
    }
  }

  const fs::path& config() const { return config_; }

 private:
  fs::path folder_;
  std::string only_;
  fs::path config_;
};

void recordScenarios(const Recorder& r) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(r.config() / "scenarios"))
    names.insert(entry.path().stem().string());
  for (const std::string& name : names) {
    r.run("scenario_" + name, name);
    if (name.starts_with("sensor_")) continue;
    r.run("compensated_" + name, name, kCompensated);
  }
  r.run("forced_six_modes", "srms_deploy_doss",
        {"base.keep_modes=6", "legs.filters=outputs", "controller.stability=forced"});
  r.run("refused_six_modes", "srms_deploy_doss", {"base.keep_modes=6", "legs.filters=outputs"});
  for (const char* period : {"13333333", "5000000", "2000000"})
    r.run(fmt::format("period_{}", period), "puma_on_table_4_1",
          {fmt::format("controller.period_ns={}", period)});
  r.run("coupled_damping", "free_decay",
        {"base={mass_diagonal: [150, 250, 400, 15, 10, 20], stiffness_diagonal: [150, 250, 400, "
         "150, 100, 200], damping: [[30, 5, 0, 0, 0, 0], [5, 40, 0, 0, 0, 0], [0, 0, 60, 0, 0, 0],"
         "[0, 0, 0, 3, 0, 0], [0, 0, 0, 0, 3, 0], [0, 0, 0, 0, 0, 3]]}"});
  std::string rows;
  for (int i = 0; i <= 200; ++i)
    rows += fmt::format("{}[{:.6f}, 0, {:.6f}, 0, {:.6f}, 0]", i ? ", " : "",
                        0.03 * (1.0 - std::cos(0.0314159 * i)), 0.0002 * i * (i < 100),
                        1.5 * std::sin(0.0314159 * i));
  r.run("recorded_path", "puma_on_table_4_1",
        {"program=[{calibration: {}}, {path: {rows_m_deg: [" + rows + "]}}]"});
}

void recordOrders(const Recorder& r) {
  const Segment trajectory = sine(2, 0.1, 0.5, 4.0), wide = sine(2, 0.4, 0.2, 5.0),
                fast = sine(2, 0.2, 3.0, 5.0), long_one = sine(0, 0.05, 0.2, 300.0);
  const Segment admittance = segment(SegmentKind::kAdmittance, 3.0);
  const Segment calibration = segment(SegmentKind::kCalibration);
  const Segment move = segment(SegmentKind::kMove, 0.0, {{0.02, 0.03, -0.04}, {0.02, 0.01, 0.05}});
  const Segment home = segment(SegmentKind::kMove, 2.0);
  const std::vector<Given> menu = {{5, ask(Request::kRun, trajectory)},
                                   {20, ask(Request::kHold)},
                                   {40, ask(Request::kArm)},
                                   {90, ask(Request::kRun, calibration)},
                                   {120, ask(Request::kTare)},
                                   {260, ask(Request::kRun, trajectory)},
                                   {300, ask(Request::kRun, move)},
                                   {330, ask(Request::kHold)},
                                   {400, ask(Request::kRun, wide)},
                                   {401, ask(Request::kRun, fast)},
                                   {402, ask(Request::kRun, move)},
                                   {403, ask(Request::kRun, admittance)},
                                   {800, ask(Request::kRun, admittance)},
                                   {850, ask(Request::kTare)},
                                   {860, ask(Request::kTare)},
                                   {900, ask(Request::kUncompensate)},
                                   {980, ask(Request::kCompensate)},
                                   {1040, ask(Request::kHold)},
                                   {1100, ask(Request::kReset)},
                                   {1150, ask(Request::kRun, long_one)},
                                   {1300, ask(Request::kHold)},
                                   {1400, ask(Request::kRun, home)},
                                   {1420, ask(Request::kArm)},
                                   {1500, ask(Request::kStart)},
                                   {1700, ask(Request::kStart)},
                                   {1710, ask(Request::kStop)}};
  for (const char* scenario : {"puma_on_table_4_1", "free_decay", "srms_capture_doss"}) {
    r.run(fmt::format("orders_{}", scenario), scenario, {}, menu, Request::kNone);
    r.run(fmt::format("orders_compensated_{}", scenario), scenario, kCompensated, menu,
          Request::kNone);
  }
  r.run("stopped_on_the_way", "z_sine", {}, {{250, ask(Request::kStop)}});
  r.run("started_after_arming", "z_sine", {},
        {{60, ask(Request::kStart)}, {500, ask(Request::kHold)}, {600, ask(Request::kStop)}},
        Request::kArm);
  r.run("calibration_refused", "puma_on_table_4_1", {"controller.still.deviation_counts=0.5"});
  r.run("tare_refused", "puma_on_table_4_1", {"controller.still.bias_v=0.01"},
        {{80, ask(Request::kTare)}, {300, ask(Request::kStop)}}, Request::kArm);
  r.run("loaded", "free_decay", {"program=[{admittance: {duration_s: 3}}]"});
  r.run("ends_in_motion", "free_decay",
        {"program=[{trajectory: {duration_s: 1.3, x: {sine: {amplitude_m: 0.05, frequency_hz: "
         "0.4}}}}, {monitor: {duration_s: 30, interval_s: 10}}, {trajectory: {duration_s: 1, beta: "
         "{ramp: {to_deg: 5}}}}]"});
}

void recordFaults(const Recorder& r) {
  const auto program = [](const std::string& segment, const std::string& fault) {
    return "program=[{calibration: {}}, {move: {to: {x_m: 0.02}, duration_s: 1}}, {" + segment +
           ", faults: [{at_s: 2, " + fault + "}]}]";
  };
  const std::string swing =
      "trajectory: {duration_s: 6, z: {sine: {amplitude_m: 0.2, frequency_hz: 0.5}}}";
  const std::string tilt =
      "trajectory: {duration_s: 6, alpha: {sine: {amplitude_deg: 15, frequency_hz: 0.25}}}";
  const std::string emulate = "admittance: {duration_s: 6}";
  const std::pair<const char*, const char*> faults[] = {{"wrench_frozen", ""},
                                                        {"wrench_rail", ", which: 3"},
                                                        {"wrench_step", ", which: 3, counts: 840"},
                                                        {"pressure", ", volts: 1.0"},
                                                        {"leg_frozen", ", which: 5"},
                                                        {"leg_jump", ", which: 1, counts: 143"},
                                                        {"leg_out_of_range", ", which: 2"},
                                                        {"valve_stuck", ", which: 5"},
                                                        {"runaway", ", which: 6"},
                                                        {"joints_lost", ""},
                                                        {"samples_lost", ""},
                                                        {"samples_late", ", samples: 2"},
                                                        {"samples_shuffled", ""},
                                                        {"panic_button", ""},
                                                        {"floor_mat", ""}};
  // After a stop: a reset that comes too soon, one that does not, and a motion.
  const std::vector<Given> recover = {{10, ask(Request::kHold)},
                                      {1000, ask(Request::kReset)},
                                      {1300, ask(Request::kReset)},
                                      {1310, ask(Request::kArm)},
                                      {1400, ask(Request::kRun, sine(2, 0.05, 0.5, 3.0))},
                                      {1750, ask(Request::kStop)},
                                      {2500, ask(Request::kStop)}};
  for (const auto& [name, more] : faults) {
    const std::string once = fmt::format("duration_s: 0.01, fault: {}{}", name, more);
    const std::string lasting = fmt::format("duration_s: 4, fault: {}{}", name, more);
    r.run(fmt::format("fault_once_{}", name), "puma_on_table_4_1", {program(emulate, once)});
    r.run(fmt::format("fault_swing_{}", name), "puma_on_table_4_1", {program(swing, lasting)},
          recover);
    r.run(fmt::format("fault_tilt_{}", name), "puma_on_table_4_1",
          Sets{program(tilt, lasting)} + kCompensated);
    r.run(fmt::format("fault_emulate_{}", name), "puma_on_table_4_1",
          Sets{program(emulate, lasting)} + kCompensated, recover);
  }
  r.run("oscillation", "puma_on_table_4_1",
        {"base={mass_diagonal: [12.5, 12.5, 12.5, 12.5, 12.5, 12.5], damping_diagonal: [2, 2, 2, "
         "1, 1, 1], stiffness_diagonal: [7900, 7900, 7900, 7900, 7900, 7900]}",
         "program=[{calibration: {}},{move: {to: {x_m: 0.002}}},{admittance: {duration_s: 30}}]",
         "controller.stability=forced"});
  r.run("envelope", "puma_on_table_4_1",
        {program(emulate, "duration_s: 60, fault: wrench_step, which: 3, counts: -2200"),
         "base.stiffness_diagonal=[150, 250, 400, 1500, 1000, 2000]"});
}

void recordChaos(const Recorder& r) {
  for (std::uint32_t seed = 1; seed <= 12; ++seed) {
    const char* scenario = seed % 3 == 0   ? "free_decay"
                           : seed % 3 == 1 ? "puma_on_table_4_1"
                                           : "srms_capture_doss";
    r.chaos(fmt::format("chaos_{}", seed), scenario, seed % 2 ? kCompensated : Sets{}, seed, 4000);
  }
}

}  // namespace
}  // namespace ves

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::cerr << "usage: record_runs FOLDER [FIRST-LETTERS of the runs' names]\n";
    return 2;
  }
  try {
    const ves::Recorder recorder(argv[1], argc > 2 ? argv[2] : "");
    ves::recordScenarios(recorder);
    ves::recordOrders(recorder);
    ves::recordFaults(recorder);
    ves::recordChaos(recorder);
  } catch (const std::exception& error) {
    std::cerr << "record_runs: " << error.what() << '\n';
    return 2;
  }
}
