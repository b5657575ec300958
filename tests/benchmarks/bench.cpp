// SPDX-License-Identifier: BSD-3-Clause
//
// Speed of the hot paths. KDL's fixed-base solver stands beside ours; table.cpp prints the ratios.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "support/under_way.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/key.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/replay.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using test::experiment;
using test::UnderWay;

// Kinematics

/// Legs of random poses of the whole workspace, with a start `share` of the way out from home.
void forward(benchmark::State& state, double share, int poses) {
  const Geometry g = test::geometry();
  std::vector<std::pair<Vec6, Transform>> cases;
  for (const Pose& x : test::poses(poses))
    cases.emplace_back(legLengths(g, g.fromHome(x)), g.fromHome(Pose::from(share * x.stacked())));
  std::int64_t iterations = 0, failures = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    const auto& [L, guess] = cases[i++ % cases.size()];
    const ForwardSolution found = forwardPose(g, L, guess);
    iterations += found.iterations;
    failures += !found.ok();
    benchmark::DoNotOptimize(found);
  }
  state.counters["iterations"] =
      static_cast<double>(iterations) / static_cast<double>(state.iterations());
  state.counters["failures"] = static_cast<double>(failures);
}
void ForwardPoseCold(benchmark::State& state) { forward(state, 0.0, 4096); }
void ForwardPoseWarm(benchmark::State& state) {
  forward(state, 0.98, 4096);
}  // 2 % off, as peers measure
BENCHMARK(ForwardPoseCold);
BENCHMARK(ForwardPoseWarm);
/// Each once: what counts is the failures.
void ForwardPoseMillion(benchmark::State& state) { forward(state, 0.98, 1'000'000); }
BENCHMARK(ForwardPoseMillion)->Iterations(1'000'000)->Repetitions(1);

void InverseKinematics(benchmark::State& state) {
  const Geometry g = test::geometry();
  Transform X = g.fromHome({});
  for (auto _ : state) {
    benchmark::DoNotOptimize(X);
    benchmark::DoNotOptimize(legLengths(g, X));
  }
}
BENCHMARK(InverseKinematics);

void ForwardRatesAndAccelerations(benchmark::State& state) {
  const Geometry g = test::geometry();
  const BodyMotion P = test::Swing(1).motion(0.3);
  LegMotion legs = legMotion(g, P);
  for (auto _ : state) {
    BodyMotion found;
    benchmark::DoNotOptimize(legs);
    benchmark::DoNotOptimize(forwardMotion(g, P.X, legs, found));
    benchmark::DoNotOptimize(found);
  }
}
BENCHMARK(ForwardRatesAndAccelerations);

// Dynamics

void newtonEulerOf(benchmark::State& state, const RobotModel& robot) {
  const BodyMotion P = test::Swing(1).motion(0.3);
  JointState q;
  q.q.setConstant(0.3);
  q.q_dot.setConstant(0.5);
  q.q_ddot.setConstant(-0.2);
  for (auto _ : state) {
    benchmark::DoNotOptimize(q);
    benchmark::DoNotOptimize(newtonEuler(robot, q, properMotion(P, {}, {0.0, 0.0, -9.81})));
  }
}
void NewtonEulerMovingBasePuma(benchmark::State& state) {
  newtonEulerOf(state, test::robot("puma560").model);
}
void NewtonEulerMovingBaseDoss(benchmark::State& state) {
  newtonEulerOf(state, test::robot("doss").model);
}
/// Two PUMAs on one base: twelve joints.
void NewtonEulerMovingBaseTwoArms(benchmark::State& state) {
  RobotModel both = test::robot("puma560").model;
  const RobotModel other = both;
  for (int i = 0; i < other.size; ++i) {
    Link link = other.link(i);
    link.parent = i == 0 ? -1 : both.size - 1;
    if (i == 0) link.X_parent.p.y() += 0.8;
    both.add(link);
  }
  newtonEulerOf(state, both);
}
BENCHMARK(NewtonEulerMovingBasePuma);
BENCHMARK(NewtonEulerMovingBaseDoss);
BENCHMARK(NewtonEulerMovingBaseTwoArms);

void kdl(benchmark::State& state, const char* name) {
  const KDL::Chain chain = test::kdlChain(name);
  KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(0, 0, -9.81));
  const unsigned n = chain.getNrOfJoints();
  KDL::JntArray q(n), qd(n), qdd(n), tau(n);
  for (unsigned i = 0; i < n; ++i) {
    q(i) = 0.3;
    qd(i) = 0.5;
    qdd(i) = -0.2;
  }
  const KDL::Wrenches none(chain.getNrOfSegments(), KDL::Wrench::Zero());
  for (auto _ : state) {
    solver.CartToJnt(q, qd, qdd, none, tau);
    benchmark::DoNotOptimize(tau.data);
  }
}
void KdlFixedBasePuma(benchmark::State& state) { kdl(state, "puma560"); }
void KdlFixedBaseDoss(benchmark::State& state) { kdl(state, "doss"); }
BENCHMARK(KdlFixedBasePuma);
BENCHMARK(KdlFixedBaseDoss);

void GravityCompensationPuma(benchmark::State& state) {
  const Experiment e = experiment("puma_on_table_4_1");
  Mat3 R = rotation({0.1, 0.2, 0.3});
  for (auto _ : state) {
    benchmark::DoNotOptimize(R);
    benchmark::DoNotOptimize(gravityCompensation(
        e.controller.payload, R,
        staticWrench(e.controller.payload, e.plant.task.initial_joints, R, e.controller.gravity)));
  }
}
BENCHMARK(GravityCompensationPuma);

void AdmittanceStep(benchmark::State& state) {
  const auto k = static_cast<int>(state.range(0));
  ModalModel model;
  model.Phi = Eigen::MatrixXd::Random(6, k);
  model.stiffness = Eigen::VectorXd::LinSpaced(k, 1.0, 1000.0);
  model.damping = Eigen::MatrixXd::Identity(k, k) * 0.1;
  AdmittanceModel admittance(model, 0.01);
  const Wrench W{Vec3(1.0, 2.0, 3.0), Vec3(0.1, 0.2, 0.3)};
  for (auto _ : state) {
    admittance.step(W);
    benchmark::DoNotOptimize(admittance.motion());
  }
}
BENCHMARK(AdmittanceStep)->Arg(6)->Arg(20)->Arg(132);

void SafetyChecks(benchmark::State& state) {  // those of pose and lengths
  const Experiment e = experiment("puma_on_table_4_1");
  const Geometry& g = e.controller.geometry;
  const PathChecks checks(e.controller.safety, g);
  Pose x{{0.1, 0.05, -0.1}, {0.1, -0.1, 0.2}};
  const Transform X = g.fromHome(x);
  const Vec6 L = legLengths(g, X), L_last = L - Vec6::Constant(1e-3);
  for (auto _ : state) {
    benchmark::DoNotOptimize(x);
    Tripped t = checks.pose(X, x, L) | checks.step(L, L_last, 0.01);
    benchmark::DoNotOptimize(t);
  }
}
BENCHMARK(SafetyChecks);

// Whole

const test::TickCase& caseOf(const std::string& name) {
  for (const test::TickCase& one : test::tickCases())
    if (one.name == name) return one;
  throw std::logic_error(name);
}

/// Inputs of a closed loop, again and again from the same state.
void tick(benchmark::State& state, const test::TickCase& one) {
  UnderWay run(one.set, one.scenario);
  const TestPlatform before = run.platform;
  std::vector<TickInput> inputs;
  while (inputs.size() < 500) {
    run.step();
    inputs.push_back(run.used);
  }
  for (auto _ : state) {
    TestPlatform platform = before;
    for (const TickInput& in : inputs) benchmark::DoNotOptimize(platform.tick(in));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(inputs.size()));
}
void ControllerTick(benchmark::State& state) { tick(state, caseOf("published")); }
void ControllerTickCompensated(benchmark::State& state) { tick(state, caseOf("compensated")); }
void ControllerTickLearningAided(benchmark::State& state) {
  tick(state, caseOf("adaptation_aided"));
}
void ControllerTickLearningMasses(benchmark::State& state) {
  tick(state, caseOf("learning_masses"));
}
BENCHMARK(ControllerTick);
BENCHMARK(ControllerTickCompensated);
BENCHMARK(ControllerTickLearningAided);
BENCHMARK(ControllerTickLearningMasses);

/// Each tick by itself, in the closed loop: median and 99.9th percentile, the clock's reading
/// included.
void tail(benchmark::State& state, const std::vector<std::string>& set) {
  std::vector<double> all;
  for (auto _ : state) {
    UnderWay run(set);
    for (int i = 0; i < 1000; ++i) {
      run.in.sample = run.plant.sample();
      run.in.time = run.plant.time();
      const std::int64_t before = monotonicNow();
      const TickState& told = run.platform.tick(run.in);
      all.push_back(static_cast<double>(monotonicNow() - before));
      run.plant.command(told.command);
      run.plant.advance(++run.in.tick * run.e.controller.period);
    }
  }
  std::sort(all.begin(), all.end());
  const auto at = [&](double share) {
    return all[static_cast<std::size_t>(share * static_cast<double>(all.size() - 1))];
  };
  state.counters["median_us"] = 1e-3 * at(0.5);
  state.counters["p999_us"] = 1e-3 * at(0.999);
  state.counters["p999_over_median"] = at(0.999) / at(0.5);
}
void ControllerTickTail(benchmark::State& state) { tail(state, {}); }
void ControllerTickTailCompensated(benchmark::State& state) {
  tail(state, caseOf("compensated").set);
}
BENCHMARK(ControllerTickTail)->Iterations(20)->Unit(benchmark::kMillisecond);
BENCHMARK(ControllerTickTailCompensated)->Iterations(20)->Unit(benchmark::kMillisecond);

void LegSlavePeriod(benchmark::State& state) {  // 1023 us of one leg
  plant::LegSlave leg({}, 8000);
  std::int32_t count = 8000;
  for (auto _ : state) {
    benchmark::DoNotOptimize(count);
    for (int i = 0; i < kReadingsPerUpdate; ++i) leg.read(count, 8010);
    benchmark::DoNotOptimize(leg.code());
  }
}
BENCHMARK(LegSlavePeriod);

/// 10 ms of the machine with a PUMA.
void plantPeriod(benchmark::State& state, const char* legs) {
  const Experiment e = experiment("puma_on_table_4_1", {std::string("legs.model=") + legs});
  plant::Plant plant(e.plant);
  std::int64_t t = 0;
  for (auto _ : state) {
    plant.advance(t += 10'000'000);
    benchmark::DoNotOptimize(plant.sample());
  }
}
void PlantPeriod(benchmark::State& state) { plantPeriod(state, "ideal"); }
void PlantPeriodHydraulic(benchmark::State& state) { plantPeriod(state, "hydraulic"); }
BENCHMARK(PlantPeriod);
BENCHMARK(PlantPeriodHydraulic);

/// One on every core at once: of each, as a rollout has them.
void PlantPeriodsOnAllCores(benchmark::State& state) { plantPeriod(state, "hydraulic"); }
BENCHMARK(PlantPeriodsOnAllCores)->ThreadPerCpu()->UseRealTime();

void rates(benchmark::State& state, double simulated, std::int64_t ticks) {
  state.counters["x_real_time"] = benchmark::Counter(simulated, benchmark::Counter::kIsRate);
  state.counters["ticks_per_s"] =
      benchmark::Counter(static_cast<double>(ticks), benchmark::Counter::kIsRate);
}

void LockstepDemo(benchmark::State& state) {
  const Experiment e = experiment("puma_on_table_4_1");
  double simulated = 0.0;
  std::int64_t ticks = 0;
  for (auto _ : state) {
    const RunResult result = runLockstep(e, nullptr, nullptr);
    simulated += result.simulated;
    ticks += result.ticks;
  }
  rates(state, simulated, ticks);
}
BENCHMARK(LockstepDemo)->Unit(benchmark::kMillisecond);

/// The same with the plant as another process, over LCM.
void LockstepDemoOverTheBus(benchmark::State& state) {
  const Experiment e = experiment("puma_on_table_4_1");
  ProcessOptions options;
  options.lockstep = true;
  options.start = true;
  if (!busWorks(options.url)) {
    state.SkipWithError("no bus: run as root, or see ./ves doctor");
    return;
  }
  const pid_t parent = getpid(), plant = fork();
  if (plant == 0) {
    runPlant(e, options, [&] { return getppid() != parent; });
    _exit(0);
  }
  double simulated = 0.0;
  std::int64_t ticks = 0;
  for (auto _ : state) {
    const RunResult result = runController(e, options, [](const TickState&) { return Order(); });
    simulated += result.simulated;
    ticks += result.ticks;
  }
  kill(plant, SIGTERM);
  waitpid(plant, nullptr, 0);
  rates(state, simulated, ticks);
}
BENCHMARK(LockstepDemoOverTheBus)->UseRealTime()->Iterations(1)->Unit(benchmark::kMillisecond);

/// What a key costs the controller in a tick: command, state and timing signed, five samples
/// checked.
void SignAndCheckATick(benchmark::State& state) {
  const std::string file =
      std::filesystem::temp_directory_path() / fmt::format("ves-bench-{}.key", getpid());
  std::ofstream(file) << std::string(64, '5');
  std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  const Key key(file);
  std::filesystem::remove(file);
  const auto encoded = [](const auto& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    return bytes;
  };
  std::vector<std::uint8_t> command = encoded(leg_command_t{}), told = encoded(state_t{}),
                            timing = encoded(timing_t{}), sample = encoded(sample_t{});
  key.sign(channel::kSample, sample.data(), sample.size());
  ReplayGuard guard;
  for (auto _ : state) {
    key.sign(channel::kLegCommand, command.data(), command.size());
    key.sign(channel::kState, told.data(), told.size());
    key.sign(channel::kTiming, timing.data(), timing.size());
    bool good = true;
    for (int i = 0; i < 5; ++i)
      good = good && key.signedBy(channel::kSample, sample.data(), sample.size()) &&
             guard.fresh(channel::kSample, sample.data());
    benchmark::DoNotOptimize(good);
  }
}
BENCHMARK(SignAndCheckATick);

void ReplayDemo(benchmark::State& state) {
  const std::string log =
      std::filesystem::temp_directory_path() / fmt::format("ves-bench-{}.lcmlog", getpid());
  {
    LogWriter writer(log);
    runLockstep(experiment("puma_on_table_4_1"), &writer, nullptr);
  }
  std::int64_t ticks = 0, different = 0;
  for (auto _ : state) {
    const ReplayResult result = replay(log, {}, [](const TickState&) {});
    ticks += result.ticks;
    different += result.different;
  }
  std::filesystem::remove(log);
  state.counters["ticks_per_s"] =
      benchmark::Counter(static_cast<double>(ticks), benchmark::Counter::kIsRate);
  state.counters["different"] = static_cast<double>(different);
}
BENCHMARK(ReplayDemo)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace ves
