// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/loop.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/MatrixFunctions>

#include "ves/math/second_order.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Eigen::Index kCommand = 2;

/// One direction from held command to sampled, filtered acceleration: x' = A x, y = C x; the
/// command is the state kCommand.
struct Channel {
  MatrixXd A;
  Eigen::RowVectorXd C;
};

/// Behind `before`: y'' + c y' + k y = k u.
Channel behind(const Channel& before, double k, double c) {
  const Eigen::Index n = before.A.rows();
  Channel out{MatrixXd::Zero(n + 2, n + 2), Eigen::RowVectorXd::Unit(n + 2, n)};
  out.A.topLeftCorner(n, n) = before.A;
  out.A(n, n + 1) = 1.0;
  out.A.row(n + 1) << k * before.C, -k, -c;
  return out;
}

/// Behind `before`: y' = w (u - y).
Channel behind(const Channel& before, double w) {
  const Eigen::Index n = before.A.rows();
  Channel out{MatrixXd::Zero(n + 1, n + 1), Eigen::RowVectorXd::Unit(n + 1, n)};
  out.A.topLeftCorner(n, n) = before.A;
  out.A.row(n) << w * before.C, -w;
  return out;
}

Channel channelOf(const Loop& loop) {
  // The servo tau y'' + y' = K_v (u - y), then its acceleration, which u drives directly: the held
  // command is a state that stays, so that everything behind it is driven by states alone.
  const double k = loop.velocity_gain / loop.tau, c = 1.0 / loop.tau;
  Channel servo{MatrixXd::Zero(3, 3), Eigen::RowVectorXd(3)};
  servo.A(0, 1) = 1.0;
  servo.A.row(1) << -k, -c, k;
  servo.C << -k, -c, k;
  Channel all = servo;
  if (loop.filter_cutoff > 0.0) {  // Butterworth of third order: a real pole and a pair
    const double w = loop.filter_cutoff;
    all = behind(behind(all, w), w * w, w);
  }
  const double w = loop.sensor_cutoff;
  return behind(all, w * w, M_SQRT2 * w);
}

}  // namespace

Loop loopOf(const ControllerConfig& controller, const plant::PlantConfig& p, const JointVector& q,
            Direction direction) {
  Loop loop;
  loop.base = controller.admittance;
  loop.robot_P = combine(RigidBody{}, p.payload.X_PL0(), locked(carried(p.payload), q));
  loop.period = static_cast<double>(controller.period) * kSecondPerNanosecond;
  constexpr double kFractional = 256.0;  // eight bits of U, (2.7a)
  const double amperes_per_metre = p.leg_slave.K_P / kFractional / p.transducer.scale *
                                   plant::LegSlave::kVoltsPerDigit *
                                   plant::LegSlave::kAmperesPerVolt;
  loop.velocity_gain =
      amperes_per_metre *
      (direction == Direction::kExtending ? p.actuator.gain_extend : p.actuator.gain_retract);
  loop.tau = p.actuator.tau;
  loop.filter_cutoff = p.filters == plant::LegFilters::kOutputs ? p.filter_cutoff : 0.0;
  loop.sensor_cutoff = p.sensor.cutoff;
  return loop;
}

Slowest slowest(const Loop& loop) {
  const Channel channel = channelOf(loop);
  const Eigen::Index n = channel.A.rows(), k = loop.base.stiffness.size();
  // The held command is replaced at each sample: written, not stepped.
  MatrixXd Ad = (channel.A * loop.period).exp();
  const VectorXd from_command = Ad.col(kCommand);
  Ad.col(kCommand).setZero();

  // State {eta, eta', six channels}.
  MatrixXd hold = MatrixXd::Zero(2 * k, 2 * k), Gamma = MatrixXd::Zero(2 * k, k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const SecondOrderHold h =
        discretise(loop.base.stiffness(i), loop.base.damping(i, i), loop.period);
    hold(i, i) = h.Phi(0, 0);
    hold(i, k + i) = h.Phi(0, 1);
    hold(k + i, i) = h.Phi(1, 0);
    hold(k + i, k + i) = h.Phi(1, 1);
    Gamma(i, i) = h.Gamma(0);
    Gamma(k + i, i) = h.Gamma(1);
  }
  const MatrixXd& Phi = loop.base.Phi;
  const Eigen::Index size = 2 * k + 6 * n;
  MatrixXd S = MatrixXd::Zero(size, size);
  S.topLeftCorner(2 * k, 2 * k) = hold;
  const MatrixXd felt = -Gamma * Phi.transpose() * spatialMass(loop.robot_P);  // 2k x 6
  for (Eigen::Index d = 0; d < 6; ++d)
    S.block(0, 2 * k + d * n, 2 * k, n) = felt.col(d) * channel.C;
  const MatrixXd eta_next = S.topRows(k);
  for (Eigen::Index d = 0; d < 6; ++d) {
    S.middleRows(2 * k + d * n, n) = from_command * (Phi.row(d) * eta_next);
    S.block(2 * k + d * n, 2 * k + d * n, n, n) += Ad;
  }

  Slowest out;
  const Eigen::VectorXcd roots = Eigen::EigenSolver<MatrixXd>(S, false).eigenvalues();
  for (const std::complex<double>& root : roots) {
    if (!(std::abs(root) > out.radius)) continue;
    out.radius = std::abs(root);
    out.growth = std::log(out.radius) / loop.period;
    out.frequency = std::abs(std::arg(root)) / (2.0 * M_PI * loop.period);
  }
  return out;
}

ModalModel softest(const ModalModel& base, int k) {
  return {base.Phi.leftCols(k), base.stiffness.head(k), base.damping.topLeftCorner(k, k)};
}

int stableModes(const ControllerConfig& controller, const plant::PlantConfig& plant,
                const JointVector& q) {
  const auto all = static_cast<int>(controller.admittance.stiffness.size());
  for (int k = 1; k <= all; ++k)
    for (const Direction direction : {Direction::kExtending, Direction::kRetracting}) {
      Loop loop = loopOf(controller, plant, q, direction);
      loop.base = softest(loop.base, k);
      if (!(slowest(loop).radius < 1.0)) return k - 1;
    }
  return all;
}

}  // namespace ves
