// SPDX-License-Identifier: BSD-3-Clause
//
// Speed of the hot paths; read as ratios within one run. KDL's fixed-base solver stands beside
// ours.
#include <benchmark/benchmark.h>

#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "support/poses.hpp"
#include "support/robots.hpp"
#include "ves/run/run.hpp"
#include "ves/srms/modes.hpp"

namespace ves {
namespace {

Experiment experiment(const std::string& name) {
  return loadExperiment(test::configDir() + "/scenarios/" + name + ".yaml");
}

// --- Kinematics
// -----------------------------------------------------------------------------------

/// Legs of random poses of the workspace, with a start `share` of the way out from home.
void forward(benchmark::State& state, double share) {
  const Geometry g = test::geometry();
  std::vector<std::pair<Vec6, Transform>> cases;
  for (const Pose& x : test::poses(4096))
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
void ForwardPoseCold(benchmark::State& state) { forward(state, 0.0); }
void ForwardPoseWarm(benchmark::State& state) {
  forward(state, 0.98);
}  // 2 % off, as peers measure
BENCHMARK(ForwardPoseCold);
BENCHMARK(ForwardPoseWarm);

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

// --- Dynamics
// ---------------------------------------------------------------------------------------

void newtonEulerOf(benchmark::State& state, const char* name) {
  const RobotModel robot = test::robot(name).model;
  const BodyMotion P = test::Swing(1).motion(0.3);
  JointState q;
  q.q.setConstant(0.3);
  q.q_dot.setConstant(0.5);
  q.q_ddot.setConstant(-0.2);
  for (auto _ : state) {
    benchmark::DoNotOptimize(q);
    benchmark::DoNotOptimize(newtonEuler(robot, q, feltMotion(P, {}, {0.0, 0.0, -9.81})));
  }
}
void NewtonEulerMovingBasePuma(benchmark::State& state) { newtonEulerOf(state, "puma560"); }
void NewtonEulerMovingBaseDoss(benchmark::State& state) { newtonEulerOf(state, "doss"); }
BENCHMARK(NewtonEulerMovingBasePuma);
BENCHMARK(NewtonEulerMovingBaseDoss);

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
    benchmark::DoNotOptimize(
        gravityCompensation(e.controller.payload, e.plant.initial_joints, R, e.controller.gravity));
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

// --- Whole
// -------------------------------------------------------------------------------------------

void ControllerTick(benchmark::State& state) {  // admittance control, PUMA, six modes
  const Experiment e = experiment("puma_on_table_4_1");
  TestPlatform platform(e.controller);
  plant::Plant plant(e.plant);
  TickInput in;
  in.order.request = Request::kStart;
  for (; in.tick < 700; ++in.tick) {  // into the admittance segment
    in.sample = plant.sample();
    plant.command(platform.tick(in).command);
    plant.advance((in.tick + 1) * e.controller.period);
  }
  for (auto _ : state) {
    TestPlatform copy = platform;  // so that the program never ends
    for (int k = 0; k < 500; ++k) {
      ++in.tick;
      ++in.sample.sequence;
      benchmark::DoNotOptimize(copy.tick(in));
    }
  }
  state.SetItemsProcessed(state.iterations() * 500);
}
BENCHMARK(ControllerTick)->Unit(benchmark::kMicrosecond);

void PlantPeriod(benchmark::State& state) {  // 10 ms of the machine with a PUMA
  const Experiment e = experiment("puma_on_table_4_1");
  plant::Plant plant(e.plant);
  std::int64_t t = 0;
  for (auto _ : state) {
    plant.advance(t += 10'000'000);
    benchmark::DoNotOptimize(plant.sample());
  }
}
BENCHMARK(PlantPeriod)->Unit(benchmark::kMicrosecond);

void LockstepDemo(benchmark::State& state) {
  const Experiment e = experiment("puma_on_table_4_1");
  double simulated = 0.0;
  for (auto _ : state) simulated += runLockstep(e, nullptr, nullptr).simulated;
  state.counters["x_real_time"] = benchmark::Counter(simulated, benchmark::Counter::kIsRate);
}
BENCHMARK(LockstepDemo)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace ves

BENCHMARK_MAIN();
