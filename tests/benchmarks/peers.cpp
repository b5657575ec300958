// SPDX-License-Identifier: BSD-3-Clause
//
// Others at the same work, in the same run: Pinocchio, MuJoCo, and the algorithm of LinuxCNC's
// genhexkins, written anew. Each is compared with ours first, and not timed where it differs
// (`./ves bench --page`).
#include <mujoco/mujoco.h>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <memory>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

constexpr double kSame = 1e-9;  // [-] of the largest effort

const Vec3 kGravity(0.0, 0.0, -9.81);  // [m/s^2]

/// What the benchmarks of ours are timed with too.
JointState moving() {
  JointState q;
  q.q.setConstant(0.3);
  q.q_dot.setConstant(0.5);
  q.q_ddot.setConstant(-0.2);
  return q;
}

/// Empty where the two are the same.
std::string difference(const Eigen::VectorXd& theirs, const Eigen::VectorXd& ours, double most) {
  const double off = (theirs - ours).norm() / ours.norm();
  return off <= most ? "" : fmt::format("off by {:.2g} of our efforts", off);
}

// Pinocchio

pinocchio::Inertia inertia(const RigidBody& body) {
  return {body.mass, body.p_BoBcm_B, body.I_Bcm_B};
}

/// With a free flyer under link 0, or not.
pinocchio::Model pinocchioModel(const RobotModel& robot, bool moves) {
  pinocchio::Model model;
  model.gravity.linear(kGravity);
  pinocchio::JointIndex below = 0;
  if (moves) {
    below = model.addJoint(0, pinocchio::JointModelFreeFlyer(), pinocchio::SE3::Identity(), "base");
    model.appendBodyToJoint(below, inertia(robot.base), pinocchio::SE3::Identity());
  }
  for (int i = 0; i < robot.size; ++i) {
    const Link& link = robot.link(i);
    below = model.addJoint(below, pinocchio::JointModelRevoluteUnaligned(link.axis),
                           {link.X_parent.R, link.X_parent.p}, fmt::format("joint_{}", i));
    model.appendBodyToJoint(below, inertia(link.body), pinocchio::SE3::Identity());
  }
  return model;
}

void PinocchioFixedBasePuma(benchmark::State& state) {
  const RobotModel robot = test::robot("puma560").model;
  const pinocchio::Model model = pinocchioModel(robot, false);
  pinocchio::Data data(model);
  const JointState q = moving();
  const Eigen::VectorXd x = q.q.head(model.nq), v = q.q_dot.head(model.nv),
                        a = q.q_ddot.head(model.nv);
  const auto ours = newtonEuler(robot, q, properMotion({}, {}, kGravity));
  const std::string off =
      difference(pinocchio::rnea(model, data, x, v, a), ours.tau.head(model.nv), kSame);
  if (!off.empty()) return state.SkipWithError(off.c_str());
  for (auto _ : state) benchmark::DoNotOptimize(pinocchio::rnea(model, data, x, v, a).data());
}
BENCHMARK(PinocchioFixedBasePuma);

void PinocchioMovingBasePuma(benchmark::State& state) {
  const RobotModel robot = test::robot("puma560").model;
  const pinocchio::Model model = pinocchioModel(robot, true);
  pinocchio::Data data(model);
  const BodyMotion P = test::Swing(1).motion(0.3);
  const JointState q = moving();
  Eigen::VectorXd x(model.nq), v(model.nv), a(model.nv);
  const Mat3 R_PI = P.X.R.transpose();
  x << P.X.p, Eigen::Quaterniond(P.X.R).coeffs(), q.q.head(robot.joints);
  v << R_PI * P.v, R_PI * P.w, q.q_dot.head(robot.joints);
  // Its acceleration is that of a field: what the point feels, less w x v.
  a << R_PI * (P.a - P.w.cross(P.v)), R_PI * P.alpha, q.q_ddot.head(robot.joints);
  const auto ours = newtonEuler(robot, q, properMotion(P, {}, kGravity));
  Eigen::VectorXd all(model.nv);
  all << ours.F_L0o_L0.stacked(), ours.tau.head(robot.joints);
  const std::string off = difference(pinocchio::rnea(model, data, x, v, a), all, kSame);
  if (!off.empty()) return state.SkipWithError(off.c_str());
  for (auto _ : state) benchmark::DoNotOptimize(pinocchio::rnea(model, data, x, v, a).data());
}
BENCHMARK(PinocchioMovingBasePuma);

// MuJoCo

std::string numbers(const auto& v) {
  std::string out;
  for (Eigen::Index i = 0; i < v.size(); ++i) out += fmt::format("{:.17g} ", v(i));
  return out;
}

std::string placed(const Transform& X) {
  const Eigen::Quaterniond q(X.R);
  return fmt::format("pos=\"{}\" quat=\"{:.17g} {:.17g} {:.17g} {:.17g}\"", numbers(X.p), q.w(),
                     q.x(), q.y(), q.z());
}

/// Principal axes. The moments are set behind the parser, which refuses those of the PUMA's links:
/// no body has them (they are a motor's, about its axis).
std::string inertial(const RigidBody& body) {
  const Eigen::SelfAdjointEigenSolver<Mat3> principal(body.I_Bcm_B);
  Mat3 R = principal.eigenvectors();
  if (R.determinant() < 0.0) R.col(0) = -R.col(0);
  return fmt::format("<inertial mass=\"{:.17g}\" {} diaginertia=\"1 1 1\"/>", body.mass,
                     placed({R, body.p_BoBcm_B}));
}

/// The arm's bodies, one in the other.
std::string arm(const RobotModel& robot) {
  std::string out, end;
  for (int i = 0; i < robot.size; ++i) {
    const Link& link = robot.link(i);
    out += fmt::format(
        "<body name=\"link_{}\" {}>{}<joint name=\"joint_{}\" type=\"hinge\" axis=\"{}\"/>", i,
        placed(link.X_parent), inertial(link.body), i, numbers(link.axis));
    end += "</body>";
  }
  return out + end;
}

void setMoments(mjModel& model, const char* name, const RigidBody& body) {
  const int at = mj_name2id(&model, mjOBJ_BODY, name);
  Vec3::Map(model.body_inertia + 3 * at) =
      Eigen::SelfAdjointEigenSolver<Mat3>(body.I_Bcm_B).eigenvalues();
}

/// Fails loudly: a benchmark without its model is none.
std::shared_ptr<mjModel> mujocoModel(const RobotModel& robot, const std::string& bodies,
                                     const std::string& rest) {
  const std::string text = fmt::format(
      "<mujoco><compiler angle=\"radian\" autolimits=\"true\"/><option timestep=\"0.001\" "
      "integrator=\"implicitfast\" gravity=\"{}\"><flag contact=\"disable\"/></option>"
      "<worldbody>{}</worldbody>{}</mujoco>",
      numbers(kGravity), bodies, rest);
  mjVFS files;
  mj_defaultVFS(&files);
  mj_addBufferVFS(&files, "model.xml", text.data(), static_cast<int>(text.size()));
  char why[1000] = "";
  std::shared_ptr<mjModel> model(mj_loadXML("model.xml", &files, why, sizeof why), mj_deleteModel);
  mj_deleteVFS(&files);
  if (!model) throw std::runtime_error(why);
  for (int i = 0; i < robot.size; ++i)
    setMoments(*model, fmt::format("link_{}", i).c_str(), robot.link(i).body);
  return model;
}

std::shared_ptr<mjData> dataOf(const std::shared_ptr<mjModel>& model) {
  return {mj_makeData(model.get()), mj_deleteData};
}

void MujocoFixedBasePuma(benchmark::State& state) {
  const RobotModel robot = test::robot("puma560").model;
  const auto model = mujocoModel(robot, arm(robot), "");
  const auto data = dataOf(model);
  const JointState q = moving();
  for (int i = 0; i < robot.joints; ++i) {
    data->qpos[i] = q.q(i);
    data->qvel[i] = q.q_dot(i);
    data->qacc[i] = q.q_ddot(i);
  }
  mj_inverse(model.get(), data.get());
  const auto ours = newtonEuler(robot, q, properMotion({}, {}, kGravity));
  const std::string off = difference(Eigen::VectorXd::Map(data->qfrc_inverse, robot.joints),
                                     ours.tau.head(robot.joints), kSame);
  if (!off.empty()) return state.SkipWithError(off.c_str());
  for (auto _ : state) {
    mj_inverse(model.get(), data.get());
    benchmark::DoNotOptimize(data->qfrc_inverse);
  }
}
BENCHMARK(MujocoFixedBasePuma);

/// A Stewart platform that carries a PUMA: each leg turns about two axes at its foot and slides,
/// and holds its length by a stiff servo; its end is tied to the platform.
std::shared_ptr<mjModel> stewart(const Geometry& g, const RobotModel& robot) {
  const Transform home = g.fromHome({});
  std::string bodies, ties, servos;
  bodies += fmt::format(
      "<body name=\"platform\" {}><freejoint/><inertial mass=\"{}\" pos=\"0 0 0\" "
      "diaginertia=\"60 60 110\"/>{}</body>",
      placed(home), 400.0 + robot.base.mass, arm(robot));
  const Vec6 L = legLengths(g, home);
  for (int i = 0; i < kLegs; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Vec3 foot = g.p_IBi_I[at], way = home * g.p_PPi_P[at] - foot;
    const char* tube = R"(<inertial mass="40" pos="0 0 0.5" diaginertia="4 4 0.1"/>)";
    const char* rod = R"(<inertial mass="15" pos="0 0 -0.4" diaginertia="1 1 0.05"/>)";
    bodies += fmt::format(
        "<body pos=\"{}\" zaxis=\"{}\">{}<joint type=\"hinge\" axis=\"1 0 0\"/><joint "
        "type=\"hinge\" axis=\"0 1 0\"/><body name=\"rod_{}\" pos=\"0 0 {:.17g}\">{}<joint "
        "name=\"leg_{}\" type=\"slide\" axis=\"0 0 1\"/></body></body>",
        numbers(foot), numbers(way), tube, i, L(i), rod, i);
    ties += fmt::format("<connect body1=\"rod_{}\" body2=\"platform\" anchor=\"0 0 0\"/>", i);
    servos += fmt::format("<position joint=\"leg_{}\" kp=\"2e6\" kv=\"4e4\"/>", i);
  }
  for (int i = 0; i < robot.joints; ++i)
    servos += fmt::format("<position joint=\"joint_{}\" kp=\"2e4\" kv=\"5e2\"/>", i);
  return mujocoModel(robot, bodies,
                     "<equality>" + ties + "</equality><actuator>" + servos + "</actuator>");
}

void MujocoPlantPeriod(benchmark::State& state) {  // 10 ms, in steps of one
  const Geometry g = test::geometry();
  static const auto model = stewart(g, test::robot("puma560").model);  // one of all threads
  const auto data = dataOf(model);
  const double home = data->qpos[2];
  for (int i = 0; i < 1000; ++i) mj_step(model.get(), data.get());
  if (const double off = std::abs(data->qpos[2] - home); !(off < 5e-3))
    return state.SkipWithError(fmt::format("sinks by {} m", off).c_str());
  for (auto _ : state) {
    for (int i = 0; i < 10; ++i) mj_step(model.get(), data.get());
    benchmark::DoNotOptimize(data->qpos);
  }
}
BENCHMARK(MujocoPlantPeriod);
void MujocoPlantPeriodsOnAllCores(benchmark::State& state) { MujocoPlantPeriod(state); }
BENCHMARK(MujocoPlantPeriodsOnAllCores)->ThreadPerCpu()->UseRealTime();

// genhexkins

struct AngleNewton {
  Transform X;
  int iterations = 0;
};

/// The Jacobian of the platform's velocity and angular velocity; what it finds is taken from the
/// fixed angles as if the angular velocity were their rates.
AngleNewton angleNewton(const Geometry& g, const Vec6& L, const Pose& guess) {
  constexpr int kMost = 100;  // [-]
  Vec6 x = guess.stacked();
  AngleNewton out;
  for (; out.iterations < kMost; ++out.iterations) {
    out.X = g.fromHome(Pose::from(x));
    Mat6 J;
    Vec6 off;
    for (int i = 0; i < kLegs; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const Vec3 arm = out.X.R * g.p_PPi_P[at], leg = out.X.p + arm - g.p_IBi_I[at];
      const double length = leg.norm();
      const Vec3 u = leg / length;
      J.row(i) << u.transpose(), arm.cross(u).transpose();
      off(i) = length - L(i);
    }
    if (off.cwiseAbs().maxCoeff() <= kForwardTolerance) break;
    x -= J.partialPivLu().solve(off);
  }
  return out;
}

void GenhexkinsForwardPose(benchmark::State& state) {  // 2 % off, as ForwardPoseWarm
  const Geometry g = test::geometry();
  std::vector<std::pair<Vec6, Pose>> cases;
  for (const Pose& x : test::poses(4096)) {
    cases.emplace_back(legLengths(g, g.fromHome(x)), Pose::from(0.98 * x.stacked()));
    const AngleNewton found = angleNewton(g, cases.back().first, cases.back().second);
    if (!((found.X.p - g.fromHome(x).p).norm() < 1e-6))
      return state.SkipWithError("another root than ours");
  }
  std::int64_t iterations = 0;
  std::size_t i = 0;
  for (auto _ : state) {
    const auto& [L, guess] = cases[i++ % cases.size()];
    const AngleNewton found = angleNewton(g, L, guess);
    iterations += found.iterations;
    benchmark::DoNotOptimize(found);
  }
  state.counters["iterations"] =
      static_cast<double>(iterations) / static_cast<double>(state.iterations());
}
BENCHMARK(GenhexkinsForwardPose);

}  // namespace
}  // namespace ves
