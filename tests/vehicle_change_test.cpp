// SPDX-License-Identifier: BSD-3-Clause
//
// Another vehicle in operation: no energy is put in, nothing steps, and the stability check is
// asked.
#include "ves/control/vehicle_change.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <random>
#include <thread>

#include "support/rig.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/control/hindsight.hpp"
#include "ves/math/dense.hpp"
#include "ves/run/replay.hpp"
#include "ves/run/run.hpp"
#include "ves/run/vehicle_judge.hpp"

namespace ves {
namespace {

using test::Rig;

constexpr double kTickSeconds = 0.01;  // [s]

Mat6 diagonal(const Vec6& values) { return values.asDiagonal(); }

struct VehicleMatrices {
  Mat6 M, C, K;
};
VehicleMatrices matrices(bool coupled) {
  VehicleMatrices m{diagonal((Vec6() << 900, 700, 800, 120, 90, 60).finished()),
                    diagonal((Vec6() << 40, 10, 60, 4, 2, 3).finished()),
                    diagonal((Vec6() << 9e3, 4e3, 2e4, 2e3, 900, 3e3).finished())};
  m.M(0, 4) = m.M(4, 0) = 50.0;
  m.K(1, 3) = m.K(3, 1) = -300.0;
  if (coupled) m.C(0, 1) = m.C(1, 0) = 15.0;
  return m;
}

/// The vehicle's energy by its matrices, from where the platform is led.
double energy(const VehicleMatrices& m, const VehicleFactors& f, const PathPoint<6>& at) {
  return 0.5 * f.mass * at.x_dot.dot(m.M * at.x_dot) + 0.5 * f.stiffness * at.x.dot(m.K * at.x);
}

// What a floating base would have done for a momentum p that was learnt late: each change of p
// moves it by that over the mass of its time, and a change of its mass leaves its velocity alone.
TEST(VehicleChange, LeavesWhatIsLearntLateItsVelocity) {
  constexpr double kTwice = 2.0;
  const Mat6 M = matrices(false).M, none = Mat6::Zero();
  AdmittanceModel base(modesOf(M, none, none), kTickSeconds);
  base.reset(Vec6::Zero());
  Hindsight hindsight(kTickSeconds);
  Lesson lesson;
  lesson.momentum = MassColumns::Zero(6, 4);
  hindsight.reset(base, lesson);
  const Vec6 p1 = (Vec6() << 3.0, -1.0, 2.0, 0.4, 0.3, -0.2).finished(), p2 = -0.5 * p1;
  constexpr int kMoves = 50, kSlides = 40;  // [-] ticks
  Vec6 x = Vec6::Zero(), expected = Vec6::Zero();
  const auto step = [&](const Vec6& p, const Vec6& x_dot) {
    lesson.momentum.col(0) = p;
    hindsight.step(base, none, kTickSeconds, lesson);
    expected += kTickSeconds * x_dot;
  };
  const Vec6 v1 = -inverse(M) * p1, v2 = v1 - inverse(M) * (p2 - p1) / kTwice;
  step(Vec6::Zero(), Vec6::Zero());  // what it is let go with
  for (int k = 0; k < kMoves; ++k) step(p1, v1);
  base.become({kTwice, 1.0, 1.0});
  for (int k = 0; k < kMoves; ++k) step(p1, v1);
  for (int k = 0; k < kMoves; ++k) step(p2, v2);
  for (int k = 0; k < kSlides; ++k) {
    lesson.learnt = k == 0 ? MassVector(MassVector::Unit(4, 0)) : MassVector();
    step(p2, v2);
    if (!hindsight.any()) continue;
    const double rest = (kSlides - 1 - k) * kTickSeconds;
    x += base.dynamics().Phi() * (hindsight.due().eta + rest * hindsight.due().eta_dot);
  }
  EXPECT_LT((x - expected).norm(), 1e-12 + 1e-9 * expected.norm());
}

TEST(VehicleChange, LeadsToTheVehicleThatItsMatricesDescribe) {
  for (const bool coupled : {false, true}) {
    const VehicleMatrices m = matrices(coupled);
    const VehicleFactors f{1.7, 0.4, 2.6};
    AdmittanceModel changed(modesOf(m.M, m.C, m.K), kTickSeconds);
    AdmittanceModel built(modesOf(f.mass * m.M, f.damping * m.C, f.stiffness * m.K), kTickSeconds);
    AdmittanceModel scaled_base(scaled(modesOf(m.M, m.C, m.K), f), kTickSeconds);
    changed.become(f);
    const Mat6 M_1 = diagonal((Vec6() << 60, 60, 60, 5, 5, 2).finished());
    for (const bool with_robot : {false, true}) {
      const Vec6 start = (Vec6() << 0.02, -0.01, 0.03, 0.05, -0.02, 0.01).finished();
      for (AdmittanceModel* one : {&changed, &built, &scaled_base}) one->reset(start);
      for (int k = 0; k < 300; ++k) {
        const Wrench F{Vec3(20.0 * std::sin(0.1 * k), 5.0, -8.0), Vec3(1.0, -2.0, 0.5)};
        for (AdmittanceModel* one : {&changed, &built, &scaled_base})
          with_robot ? one->step(F, M_1, kTickSeconds, 0.004) : one->step(F);
        ASSERT_TRUE(changed.motion().x.isApprox(built.motion().x, 1e-9)) << coupled << " " << k;
        ASSERT_TRUE(changed.motion().x_dot.isApprox(built.motion().x_dot, 1e-9));
        ASSERT_TRUE(scaled_base.motion().x.isApprox(built.motion().x, 1e-9));
        ASSERT_NEAR(changed.energy(), built.energy(), 1e-9 * (1.0 + built.energy()));
        ASSERT_NEAR(changed.taken(F), built.taken(F), 1e-10);
      }
    }
    changed.become({});
    AdmittanceModel never(modesOf(m.M, m.C, m.K), kTickSeconds);
    changed.reset(Vec6::Constant(0.01));
    never.reset(Vec6::Constant(0.01));
    for (int k = 0; k < 50; ++k) {
      changed.step({});
      never.step({});
      EXPECT_EQ(changed.motion().x, never.motion().x);  // to the bit
    }
  }
}

/// A swinging vehicle under a wrench, its factors ordered at random moments: in each step it gains
/// no more than the wrench does on it, and its motion goes on as it was.
void expectPassive(bool coupled, bool with_robot, unsigned seed) {
  std::mt19937 dice(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const VehicleMatrices m = matrices(coupled);
  AdmittanceModel model(modesOf(m.M, m.C, m.K), kTickSeconds);
  VehicleChange change(kTickSeconds, 10.0);
  const Mat6 M_1 =
      with_robot ? diagonal((Vec6() << 60, 60, 60, 5, 5, 2).finished()) : Mat6(Mat6::Zero());
  model.reset((Vec6() << 0.05, -0.03, 0.04, 0.1, -0.05, 0.06).finished());
  const auto whole = [&] {  // with the robot's body
    const PathPoint<6>& at = model.motion();
    return energy(m, model.factors(), at) + 0.5 * at.x_dot.dot(M_1 * at.x_dot);
  };
  int until = 0, changes = 0;
  bool doubled = false;
  for (int k = 0; changes < 10 || k < until; ++k) {
    if (k >= until && changes < 10) {
      VehicleOrder order;
      order.to.stiffness = (doubled = !doubled) ? 2.0 : 1.0;
      if (uniform(dice) < 0.5) order.to.mass = std::exp2(2.0 * uniform(dice) - 1.0);
      if (uniform(dice) < 0.3) order.to.damping = std::exp2(2.0 * uniform(dice) - 1.0);
      order.over = 2.0 * uniform(dice);
      change.begin(order, model);
      ++changes;
      until = k + 50 + static_cast<int>(300.0 * uniform(dice));
    }
    Wrench F{Vec3(15.0 * std::sin(0.07 * k), -9.0 * std::sin(0.05 * k), 0.0),
             Vec3(0.0, 3.0 * std::cos(0.03 * k), 0.0)};
    // Of some seeds a load that is put on and taken off, which turns the vehicle within a step.
    if (seed % 2 == 1 && k / 40 % 2 == 1) F.f.z() = 2000.0;
    const double before = whole(), gained_before = change.energy();
    const PathPoint<6> from = model.motion();
    const VehicleFactors was = model.factors();
    change.advance(model);
    with_robot ? model.step(F, M_1, kTickSeconds, 0.0, change.damping())
               : model.step(F, change.damping());
    change.pay(model.damped());
    const PathPoint<6>& at = model.motion();
    // The step's own gain, less the wrench's work, is the change's, of which the damping pays; the
    // vehicle's own damping only takes.
    const double gain = whole() - before - F.stacked().dot(at.x - from.x);
    ASSERT_LE(gain, change.energy() - gained_before + 1e-9 * (1.0 + before)) << seed << " " << k;
    ASSERT_LE(change.energy(), 1e-12) << seed << " " << k;
    // No step: what a tick does to the speed is what its accelerations do, and damping that comes
    // or goes by 2 1/s a tick.
    const double most = (1.5 * std::max(from.x_ddot.norm(), at.x_ddot.norm()) +
                         2.0 * std::max(from.x_dot.norm(), at.x_dot.norm())) *
                            kTickSeconds +
                        1e-6;
    ASSERT_LE((at.x_dot - from.x_dot).norm(), most) << seed << " " << k;
    ASSERT_LE((at.x - from.x).norm(),
              1.1 * std::max(from.x_dot.norm(), at.x_dot.norm()) * kTickSeconds);
    const double ratio = model.factors().stiffness / was.stiffness;
    ASSERT_LT(std::abs(std::log(ratio)), 0.4);
  }
  EXPECT_EQ(changes, 10);
}

TEST(VehicleChange, PutsNoEnergyInAndMakesNoStep) {
  for (unsigned seed = 0; seed < 20; ++seed)
    for (const bool coupled : {false, true})
      for (const bool with_robot : {false, true}) expectPassive(coupled, with_robot, seed);
}

// What nothing swings on changes at once, and owes nothing.
TEST(VehicleChange, ThatIsFinishedTakesAndOwesNothing) {
  const VehicleMatrices m = matrices(false);
  AdmittanceModel model(modesOf(m.M, m.C, m.K), kTickSeconds);
  model.reset(Vec6::Constant(0.05));
  VehicleChange change(kTickSeconds, 10.0);
  VehicleOrder order;
  order.to.mass = 3.0;
  order.to.stiffness = 2.0;
  order.over = 5.0;
  change.begin(order, model);
  for (int k = 0; k < 20; ++k) change.advance(model);
  change.finish(model);
  EXPECT_EQ(change.energy(), 0.0);
  EXPECT_EQ(change.damping(), 0.0);
  EXPECT_EQ(model.factors(), (VehicleFactors{3.0, 1.0, 2.0}));
  for (int k = 0; k < 20; ++k) {
    change.advance(model);
    EXPECT_EQ(change.damping(), 0.0);
  }
}

// Every factor is as far on its way as the others, from where it was.
TEST(VehicleChange, FactorsGoTogether) {
  const VehicleMatrices m = matrices(false);
  AdmittanceModel model(modesOf(m.M, m.C, m.K), kTickSeconds);
  model.become({2.0, 0.5, 4.0});
  model.reset(Vec6::Constant(0.03));
  VehicleChange change(kTickSeconds, 10.0);
  change.begin({{5.0, 1.5, 2.0}, 1.0}, model);
  int between = 0;
  double before = 0.0;
  for (int k = 0; k < 400; ++k) {
    change.advance(model);
    model.step({}, change.damping());
    change.pay(model.damped());
    const VehicleFactors& f = model.factors();
    const double share = (f.mass - 2.0) / 3.0;
    EXPECT_NEAR(f.damping - 0.5, share * 1.0, 1e-12);
    EXPECT_NEAR(f.stiffness - 4.0, share * -2.0, 1e-12);
    EXPECT_GE(share, before);
    before = share;
    between += share > 0.0 && share < 1.0;
  }
  EXPECT_GT(between, 50);
  EXPECT_EQ(before, 1.0);
}

// Who asks for it at once gets it over a tenth of a second: nothing steps.
TEST(VehicleChange, TakesATenthOfASecondAtLeast) {
  const VehicleMatrices m = matrices(false);
  AdmittanceModel model(modesOf(m.M, m.C, m.K), kTickSeconds);
  VehicleChange change(kTickSeconds, 10.0);
  model.reset(Vec6::Zero());
  change.begin({{2.0, 3.0, 0.5}, 0.0}, model);
  for (int k = 1; k <= 12; ++k) {
    change.advance(model);
    EXPECT_NEAR(model.factors().stiffness, 1.0 - 0.5 * std::min(1.0, 0.1 * k), 1e-12) << k;
  }
}

TEST(VehicleChange, ArrivesInItsTimeWhereTheVehicleSwings) {
  const VehicleMatrices m = matrices(false);
  AdmittanceModel model(modesOf(m.M, m.C, m.K), kTickSeconds);
  VehicleChange change(kTickSeconds, 10.0);
  model.reset(Vec6::Constant(0.03));
  change.begin({{2.0, 0.0, 2.0}, 1.5}, model);
  int k = 0;
  for (; k < 400 && model.factors() != VehicleFactors{2.0, 1.0, 2.0}; ++k) {
    change.advance(model);
    model.step({}, change.damping());
    change.pay(model.damped());
  }
  EXPECT_GE(k, 150);
  EXPECT_LE(k, 200);  // what is owed at the end is paid within a swing
}

// Stiffening would lift the load that a base rests under. What takes energy out does not wait.
TEST(VehicleChange, WaitsUnderALoadAtRestAndGoesOnWhenItMoves) {
  const VehicleMatrices m = matrices(false);
  AdmittanceModel model(modesOf(m.M, m.C, m.K), kTickSeconds);
  VehicleChange change(kTickSeconds, 10.0);
  const Wrench load{Vec3(0.0, 0.0, 200.0), Vec3::Zero()};
  const auto run = [&](int ticks, const Wrench& F) {
    for (int k = 0; k < ticks; ++k) {
      change.advance(model);
      model.step(F, change.damping());
      change.pay(model.damped());
    }
  };
  model.reset(m.K.ldlt().solve(load.stacked()));
  change.begin({{0.0, 0.0, 2.0}, 0.5}, model);
  run(300, load);
  EXPECT_EQ(model.factors().stiffness, 1.0);
  EXPECT_NEAR(model.motion().x(2), 0.01, 1e-6);
  run(300, {});  // let go
  EXPECT_EQ(model.factors().stiffness, 2.0);
  run(3000, {});
  model.reset(m.K.ldlt().solve(load.stacked()) / 2.0);
  change.begin({{0.0, 0.0, 1.0}, 0.5}, model);
  run(60, load);
  EXPECT_EQ(model.factors().stiffness, 1.0);
}

// --- In the controller ---------------------------------------------------------------------------

Order vehicleOrder(const VehicleFactors& to, double over,
                   Stability compensated = Stability::kStable,
                   Stability uncompensated = Stability::kStable) {
  Order order;
  order.request = Request::kVehicle;
  order.vehicle = {to, over};
  order.verdict = {compensated, uncompensated};
  return order;
}

// What is judged is where the vehicle goes, not where it is on the way there.
TEST(VehicleOrder, IsJudgedBesideWhatWasOrderedBefore) {
  const Experiment e = test::unassessed("puma_on_table_4_1");
  const VehicleFactors to{0.05, 0.1, 50.0};
  const auto ordered = [](const VehicleFactors& factors) {
    Order order;
    order.request = Request::kVehicle;
    order.vehicle = {factors, 1000.0};
    return order;
  };
  TickState state;
  EXPECT_EQ(judged(ordered(to), e, state).verdict.uncompensated, Stability::kUnstable);

  Rig rig(test::experiment("puma_on_table_4_1"));
  rig.arm();
  rig.order(Request::kRun, test::segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 30.0));
  rig.run(20);
  VehicleFactors said;
  for (const VehicleFactors& one : {VehicleFactors{to.mass, 0, 0}, VehicleFactors{0, to.damping, 0},
                                    VehicleFactors{0, 0, 50}}) {
    const Order order = judged(ordered(one), e, rig.state());
    said = one.stiffness > 0 ? said : order.vehicle.appliedTo(said);
    rig.give(order);
    EXPECT_EQ(rig.state().refusal, one.stiffness > 0 ? Refusal::kUnstable : Refusal::kNone);
    EXPECT_EQ(rig.state().vehicle_ordered, said);
    EXPECT_GT(rig.run(20).vehicle.mass, 0.9);  // hardly begun
  }
}

TEST(VehicleOrder, IsTakenWhereTheGateLetsItAndLeavesAllElseAsItIs) {
  Rig rig(test::experiment("free_decay"));
  const auto give = [&](const Order& order) { return rig.give(order).refusal; };
  const VehicleFactors before;
  EXPECT_EQ(give(vehicleOrder({0, 0, 2}, 1.0)), Refusal::kNotArmed);
  rig.arm();
  EXPECT_EQ(give(vehicleOrder({0, 0, 2}, 1.0, Stability::kUnknown, Stability::kUnknown)),
            Refusal::kUnassessed);
  EXPECT_EQ(give(vehicleOrder({0, 0, 2}, 1.0, Stability::kUnstable, Stability::kUnstable)),
            Refusal::kUnstable);
  EXPECT_EQ(rig.state().vehicle, before);
  // Nothing is emulated: at once.
  EXPECT_EQ(give(vehicleOrder({0, 0, 2}, 1.0)), Refusal::kNone);
  EXPECT_EQ(rig.tick().vehicle, (VehicleFactors{1, 1, 2}));
  EXPECT_EQ(give(vehicleOrder({0.5, 0, 0}, 1.0)), Refusal::kNone);
  EXPECT_EQ(rig.tick().vehicle, (VehicleFactors{0.5, 1, 2}));
  EXPECT_EQ(give(vehicleOrder({0.1, 0, 0}, 1.0, Stability::kUnstable, Stability::kUnstable)),
            Refusal::kUnstable);  // and what was stable still is
  rig.order(Request::kRun, test::segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 20.0));
  ASSERT_EQ(rig.run(50).kind, SegmentKind::kAdmittance);
  EXPECT_EQ(rig.state().vehicle, (VehicleFactors{0.5, 1, 2}));
}

// What is stable with the compensation out may not be with it in.
TEST(VehicleOrder, ClosesTheWayBackToALoopThatWouldDiverge) {
  Rig rig(test::experiment("puma_on_table_4_1", test::kCompensated));
  rig.arm();
  const auto give = [&](const Order& order) { return rig.give(order).refusal; };
  rig.order(Request::kRun, test::segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  EXPECT_EQ(give(vehicleOrder({0.5, 0, 0}, 1.0, Stability::kStable, Stability::kUnstable)),
            Refusal::kNone);
  rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 20.0));
  ASSERT_EQ(rig.run(50).kind, SegmentKind::kAdmittance);
  EXPECT_EQ(rig.tick(Request::kUncompensate).refusal, Refusal::kUnstable);
  EXPECT_EQ(give(vehicleOrder({1, 0, 0}, 1.0)), Refusal::kNone);
  EXPECT_EQ(rig.tick(Request::kUncompensate).refusal, Refusal::kNone);
}

TEST(VehicleOrder, IsRefusedWhereAStepWouldTakeTooLong) {
  Rig rig(test::experiment("puma_on_table_4_1", test::kCompensated));
  rig.arm();
  EXPECT_EQ(rig.give(vehicleOrder({0.01, 100, 100}, 1.0)).refusal, Refusal::kTooFast);
}

/// The free decay of six oscillators, its stiffness doubled and halved at ten random moments: by
/// the platform's own commanded motion no energy is put in, and nothing steps.
TEST(VehicleOrder, DoublesAndHalvesTheStiffnessInOperation) {
  for (const bool compensated : {false, true}) {
    const Experiment e =
        test::experiment("puma_on_table_4_1",
                         {"program=[{calibration: {}}, {move: {to: {x_m: 0.05, z_m: 0.04, "
                          "beta_deg: 4}, duration_s: 2.5}}, {admittance: {duration_s: 30}}]"},
                         compensated ? test::kCompensated : std::vector<std::string>{});
    Rig rig(e);
    rig.run(20);
    rig.tick(Request::kStart);
    rig.until([](const TickState& s) {
      return s.phase == Phase::kRunning && s.kind == SegmentKind::kAdmittance;
    });
    std::mt19937 dice(7);
    const ModalModel base = linearised(e.controller.vehicle);
    const Mat6 to_modes = base.Phi.inverse();
    const auto inVehicle = [&](const TickState& s) {  // [J]
      const Vec6 eta = to_modes * s.motion.x, rate = to_modes * s.motion.x_dot;
      return 0.5 * s.vehicle.mass * rate.squaredNorm() +
             0.5 * s.vehicle.stiffness * base.stiffness.dot(eta.cwiseAbs2());
    };
    TickState last = rig.state();
    int changes = 0, whole = 0, next = 40;
    for (int k = 0; k < 2900; ++k) {
      Order order;
      if (k == next && changes < 10) {
        order = vehicleOrder({0, 0, ++changes % 2 ? 2.0 : 1.0}, 1.0);
        next += 150 + static_cast<int>(dice() % 120);
      }
      const TickState& s = rig.give(order);
      ASSERT_EQ(s.phase, Phase::kRunning) << k;
      ASSERT_EQ(s.refusal, Refusal::kNone);
      ASSERT_LE(s.vehicle_energy, 1e-12) << k;
      // The raw one books the wrench itself; compensated, the robot's body is on the base, too.
      if (!compensated) {
        const double of_change =
            s.vehicle_energy - (s.request == Request::kVehicle ? 0.0 : last.vehicle_energy);
        ASSERT_LE(inVehicle(s) - inVehicle(last),
                  s.dynamic.stacked().dot(s.motion.x - last.motion.x) + of_change + 1e-9)
            << k;
      }
      ASSERT_LE((s.motion.x_dot - last.motion.x_dot).norm(), 0.05) << k;
      whole += s.vehicle.stiffness == 2.0;
      last = s;
    }
    EXPECT_EQ(changes, 10);
    EXPECT_GT(whole, 300);
    EXPECT_EQ(last.vehicle, VehicleFactors());
  }
}

// --- The gate ------------------------------------------------------------------------------------

TEST(VehicleVerdict, IsTheStabilityChecksOfTheVehicleThatIsMeant) {
  const Experiment e = test::unassessed(
      "puma_on_table_4_1", {"program=[{admittance: {duration_s: 5}}]", test::kCompensated[0],
                            test::kCompensated[1], test::kCompensated[2]});
  const VehicleFactors light{0.02, 1.0, 1.0}, heavy{2.0, 1.0, 1.0};
  ControllerConfig changed = e.controller;
  changed.compensation = {};
  changed.vehicle = scaled(linearised(e.controller.vehicle), light);
  ASSERT_FALSE(isStable(changed, e.plant.task));  // a robot too heavy for it
  const VehicleVerdict down = assessChange(e.controller, e.plant.task, {}, light);
  EXPECT_EQ(down.uncompensated, Stability::kUnstable);
  const VehicleVerdict up = assessChange(e.controller, e.plant.task, {}, heavy);
  EXPECT_EQ(up.uncompensated, Stability::kStable);
  EXPECT_EQ(up.compensated, Stability::kStable);
  // Also where only the way leads through what would diverge.
  const VehicleFactors stiff{0.01, 1.0, 100.0};
  changed.vehicle = scaled(linearised(e.controller.vehicle), stiff);
  ASSERT_TRUE(isStable(changed, e.plant.task));
  EXPECT_EQ(assessChange(e.controller, e.plant.task, {}, stiff).uncompensated,
            Stability::kUnstable);
  EXPECT_EQ(assessChange(e.controller, e.plant.task, light, heavy).uncompensated,
            Stability::kUnstable);
  ControllerConfig forced = e.controller;
  forced.stability = Stability::kForced;
  EXPECT_EQ(assessChange(forced, e.plant.task, {}, light).compensated, Stability::kForced);
}

TEST(VehicleJudge, AnswersLaterLetsTheRestPassAndIsOvertakenByAHold) {
  const Experiment e = test::experiment("free_decay");
  VehicleJudge judge(e);
  const TickState state;
  const auto answer = [&] {
    Order got;
    for (int i = 0; i < 10'000 && got.request == Request::kNone; ++i) {
      got = judge.pass({}, state);
      if (got.request == Request::kNone) std::this_thread::yield(), usleep(1000);
    }
    return got;
  };
  Order order = vehicleOrder({0, 0, 2}, 1.0, Stability::kUnknown, Stability::kUnknown);
  order.id = {3, 4};
  EXPECT_EQ(judge.pass(order, state).request, Request::kNone);
  EXPECT_EQ(judge.pass({Request::kTare, {}, {}}, state).request, Request::kTare);
  // One at a time: a second one passes without a verdict, which is refused.
  EXPECT_EQ(judge.pass(order, state).verdict.compensated, Stability::kUnknown);
  Order got = answer();
  EXPECT_EQ(got.request, Request::kVehicle);
  EXPECT_EQ(got.id.sequence, 4);
  EXPECT_EQ(got.verdict.compensated, Stability::kForced);
  EXPECT_EQ(judge.pass({}, state).request, Request::kNone);

  judge.pass(order, state);
  EXPECT_EQ(judge.pass({Request::kHold, {}, {}}, state).request, Request::kHold);
  EXPECT_EQ(answer().request, Request::kOvertaken);
  judge.pass(order, state);  // and the next one is not
  EXPECT_EQ(answer().request, Request::kVehicle);
}

TEST(VehicleOrder, IsInTheLogAndReplaysExactly) {
  const std::string log =
      (std::filesystem::temp_directory_path() / ("ves_vehicle_" + std::to_string(getpid())))
          .string();
  {
    LogWriter writer(log);
    int n = 0;
    const auto operate = [&](const TickState& state) -> Order {
      if (state.kind == SegmentKind::kAdmittance && ++n % 200 == 0)
        return vehicleOrder({n % 400 ? 2.0 : 1.0, 0, n % 400 ? 3.0 : 1.0}, 0.5, Stability::kUnknown,
                            Stability::kUnknown);
      return {};
    };
    EXPECT_TRUE(runLockstep(test::unassessed("free_decay", {"controller.stability=stable",
                                                            "controller.stability_uncompensated="
                                                            "stable"}),
                            &writer, operate)
                    .good());
  }
  double most = 0.0;
  const ReplayResult r =
      replay(log, {}, [&](const TickState& s) { most = std::max(most, s.vehicle.stiffness); });
  EXPECT_EQ(most, 3.0);
  EXPECT_EQ(r.different, 0);
  std::filesystem::remove(log);
}

}  // namespace
}  // namespace ves
