// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/loop.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "channel.hpp"
#include "ves/math/dense.hpp"
#include "ves/math/second_order.hpp"

namespace ves {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

/// Orthogonal, the first column along d.
Mat6 axesAlong(const Vec6& d) {
  Vec6 v = d.normalized();  // Householder's reflection that takes it to the first axis
  Mat6 H = Mat6::Identity();
  v(0) += v(0) < 0.0 ? -1.0 : 1.0;
  H -= 2.0 / v.squaredNorm() * v * v.transpose();
  if (H.col(0).dot(d) < 0.0) H = -H;
  return H;
}

/// The modes that the controller steps: the base's, with what of the robot is modelled on them.
ModalModel emulated(const Loop& loop) {
  const Loop::Model& own = loop.model;
  const bool weighs = !loop.gravity.isZero(0.0);
  if (!own.inertia && !weighs) return loop.base;
  const RigidBody& robot = own.robot_P;
  return withBody(loop.base, own.inertia ? own.M_1() : Mat6(Mat6::Zero()),
                  stiffnessOfWeight(loop.gravity, robot.mass * robot.p_BoBcm_B));
}

/// What of a loop does not depend on the robot.
struct Lifted {
  Channel channel;
  Channel leaning;               // where there is a contact
  Observer model;                // where the inertia is taken out
  Mat6 axes = Mat6::Identity();  // of the channels, which are equal; the first along the contact
};

Lifted liftedOf(const Loop& loop) {
  Lifted out{channelOf(loop, {}), {}, {}};
  if (loop.model.inertia) out.model = observerOf(loop);
  if (loop.contact) {
    out.leaning = channelOf(loop, loop.contact);
    out.axes = axesAlong(loop.contact->direction);
  }
  return out;
}

/// The whole loop over a period, of {eta, eta', six channels, six servo models where the inertia is
/// taken out, six late wrenches a tick of delay, six filtered ones where a low-pass is, six places
/// before they turned where friction is believed in}. With the inertia taken out the modes are
/// those of the base with the robot on it. `pushed` adds a column, last, of a reading of a force
/// along it.
MatrixXd systemOf(const Loop& loop, const Lifted& lifted, const Vec6* pushed = nullptr,
                  RowVectorXd* first_command = nullptr) {
  const Loop::Model& own = loop.model;
  const Observer& model = lifted.model;
  const auto channel = [&](Index i) -> const Channel& {
    return i == 0 && loop.contact ? lifted.leaning : lifted.channel;
  };
  const ModalModel base = emulated(loop);
  const Index n = lifted.channel.step.rows(), m = model.step.rows(), k = base.stiffness.size(),
              d = loop.delay;
  const MatrixXd& Phi = base.Phi;
  const double T = loop.period;
  const Index channels = 2 * k, models = channels + channel(0).step.rows() + 5 * n,
              late = models + 6 * m, filtered = late + 6 * d,
              turned = filtered + (loop.passes.isOnes(0.0) ? 0 : 6),
              reading = turned + (own.turning > 0.0 ? 6 : 0), size = reading + (pushed ? 1 : 0);
  const auto startOf = [&](Index i) { return i == 0 ? channels : models - (6 - i) * n; };
  MatrixXd S = MatrixXd::Zero(size, size);

  // The wrench of this tick: what the accelerations make of it, and the controller's own model.
  MatrixXd sampled = MatrixXd::Zero(6, size), modelled = MatrixXd::Zero(6, size);
  for (Index i = 0; i < 6; ++i) {
    sampled.block(i, startOf(i), 1, channel(i).felt.size()) = channel(i).felt;
    if (own.inertia) modelled.block(i, models + i * m, 1, m) = model.felt;
  }
  MatrixXd F = -spatialMass(loop.robot_P) * lifted.axes * sampled;
  if (own.inertia) F += own.M_1() * lifted.axes * modelled;
  if (pushed) F.col(reading) = *pushed;
  if (loop.contact && !pushed)
    F.middleCols(channels, channel(0).pressed.size()) +=
        loop.contact->direction * channel(0).pressed;
  if (d > 0) {
    S.middleRows(late, 6) = F;
    for (Index i = 1; i < d; ++i) S.block(late + 6 * i, late + 6 * (i - 1), 6, 6).setIdentity();
    F.setZero();
    F.middleCols(filtered - 6, 6).setIdentity();
  }
  if (turned > filtered) {
    F = loop.passes.asDiagonal() * F;
    F.middleCols(filtered, 6).diagonal() = Vec6::Ones() - loop.passes;
    S.middleRows(filtered, 6) = F;
  }
  F *= loop.felt;

  // Admittance model.
  const ModalHold hold = modalHold(base, T);
  MatrixXd before = MatrixXd::Zero(2 * k, size);
  before.leftCols(2 * k).setIdentity();
  const MatrixXd u = Phi.transpose() * F;
  S.topRows(2 * k) = hold.Phi * before + hold.Gamma * u;

  // The command, from where the model is at its own time or, ahead, at the legs'.
  MatrixXd told = S.topRows(2 * k);
  if (own.inertia) {
    constexpr Index kMost = 5;  // [periods] that WrenchTiming tells
    const double age = static_cast<double>(std::min(d, kMost)) * T;
    const ModalHold ahead = modalHold(base, age + wrenchDelay(own.servo, T));
    told = ahead.Phi * S.topRows(2 * k) + ahead.Gamma * u;
  }
  MatrixXd command = Phi * told.topRows(k);
  MatrixXd beyond = MatrixXd::Zero(6, size);  // of what its own servo model answers
  if (own.turning > 0.0) {
    const double kept = std::exp(-T / own.turning_time);
    S.middleRows(turned, 6) = (1.0 - kept) * command;
    S.block(turned, turned, 6, 6).diagonal().array() += kept;
    beyond = own.turning * command;
    beyond.middleCols(turned, 6).diagonal().array() -= own.turning;
  }
  if (own.feed_forward) {
    const MatrixXd x_dot = Phi * told.bottomRows(k);
    const MatrixXd x_ddot = Phi * (u - base.stiffness.asDiagonal() * told.topRows(k) -
                                   base.damping * told.bottomRows(k));
    LegMotion rate, acceleration;
    rate.L_dot.setOnes();
    acceleration.L_ddot.setOnes();
    command += feedForward(own.servo, rate, T, T, 1.0)(0) * x_dot +
               feedForward(own.servo, acceleration, T, T, 1.0)(0) * x_ddot;
    beyond += own.lapped * (x_dot + own.servo.tau(0) * x_ddot);
  }
  const MatrixXd foreseen = lifted.axes.transpose() * command;
  command = lifted.axes.transpose() * (command + beyond);
  if (first_command) *first_command = command.row(0);
  for (Index i = 0; i < 6; ++i) {
    const Index at = startOf(i), rows = channel(i).step.rows();
    S.middleRows(at, rows) = channel(i).from_command * command.row(i);
    S.block(at, at, rows, rows) += channel(i).step;
    if (!own.inertia) continue;
    const Index own_at = models + i * m;
    S.middleRows(own_at, m) = model.from_command * foreseen.row(i);
    S.block(own_at, own_at, m, m) += model.step;
    S.col(at + ChannelState::kLength).segment(own_at, m) += model.from_length;
  }
  return S;
}

std::complex<double> largestRoot(const MatrixXd& S) {
  const Eigen::VectorXcd roots = eigenvalues(S);
  Index at = 0;
  roots.cwiseAbs().maxCoeff(&at);
  return roots(at);
}

bool decays(const Loop& loop, const Lifted& lifted) {
  constexpr double kRounding = 1e-7;  // a free direction has a double root at one
  constexpr double kDriftRate = 2.0 * M_PI * 0.01, kDriftGrowth = 0.02;  // [rad/s], [1/s]
  const Eigen::VectorXcd roots = eigenvalues(systemOf(loop, lifted));
  return std::all_of(roots.begin(), roots.end(), [&](const std::complex<double>& root) {
    if (std::abs(root) <= std::exp(loop.allowed_growth * loop.period) + kRounding) return true;
    return std::abs(std::arg(root)) < kDriftRate * loop.period &&
           std::abs(root) < 1.0 + kDriftGrowth * loop.period;
  });
}

}  // namespace

const char* name(Direction direction) {
  switch (direction) {
    case Direction::kExtending: return "extending";
    case Direction::kRetracting: return "retracting";
    case Direction::kSwinging: return "swinging";
    case Direction::kNearNull: return "hardly moving";
    case Direction::kTurning: return "turning round";
  }
  return "";
}

std::vector<Direction> directionsOf(const ControllerConfig& controller) {
  std::vector<Direction> out = {Direction::kExtending, Direction::kRetracting};
  const ServoModel& servo = controller.servo;
  if (servo.opening.maxCoeff() > 0.0) out.push_back(Direction::kNearNull);
  if (controller.resonance.turning != 1.0) out.push_back(Direction::kSwinging);
  if (controller.compensation.feed_forward &&
      (servo.friction.maxCoeff() > 0.0 || servo.opening.minCoeff() < 0.0))
    out.push_back(Direction::kTurning);
  return out;
}

Loop loopOf(const ControllerConfig& controller, const JointVector& q, Direction direction) {
  Loop loop;
  loop.base = linearised(controller.vehicle);
  loop.gravity = controller.vehicle.gravity;
  loop.robot_P = lockedRobot(controller.payload, q);
  loop.period = static_cast<double>(controller.period) * kSecondPerNanosecond;
  Loop::Model& own = loop.model;
  own = {controller.compensation.feed_forward, controller.compensation.inertia, loop.robot_P,
         controller.servo};
  const double up = own.servo.extend.mean(), down = own.servo.retract.mean();
  double model = 2.0 * up * down / (up + down);
  if (direction == Direction::kExtending) model = up;
  if (direction == Direction::kRetracting) model = down;
  if (direction == Direction::kNearNull) model = up + down;
  if (direction == Direction::kTurning) {
    own.turning = own.servo.friction.maxCoeff() / own.servo.friction_way;
    own.turning_time = own.servo.friction_time;
    if (own.servo.opening.minCoeff() < 0.0) own.lapped = (kThroughLap - 1.0) / model;
  }
  own.servo.opening.setZero();  // that is in the gain
  own.servo.friction.setZero();
  own.setGain(model);
  own.servo.tau.setConstant(own.servo.tau.mean());
  own.servo.delay.setConstant(own.servo.delay.mean());
  own.servo.rail = HUGE_VAL;

  // The machine as it is believed: what the simulated one truly is, nobody can look up.
  loop.velocity_gain = model;
  loop.derivative_gain = model * own.servo.derivative / (ServoModel::kSpan * own.servo.update);
  loop.tau = own.servo.tau(0);
  loop.resonance = controller.resonance;
  if (direction != Direction::kSwinging) loop.resonance.turning = 1.0;
  loop.sensor_cutoff = own.servo.sensor_cutoff;
  loop.filter_cutoff = own.servo.filter_cutoff;
  loop.readings = own.servo.sensor_readings;
  loop.passes = controller.wrench_filter.passes(loop.period);
  return loop;
}

Loop carrying(Loop loop, const CarriedRobot& robot) {
  loop.robot_P = robot.robot_P;
  loop.model.robot_P = robot.known_P;
  return loop;
}

bool decays(const Loop& loop) { return decays(loop, liftedOf(loop)); }

bool decaysWithAll(const Loop& loop, const std::vector<CarriedRobot>& robots) {
  const Lifted lifted = liftedOf(loop);
  return std::all_of(robots.begin(), robots.end(), [&](const CarriedRobot& robot) {
    return decays(carrying(loop, robot), lifted);
  });
}

Eigen::VectorXcd roots(const Loop& loop) { return eigenvalues(systemOf(loop, liftedOf(loop))); }

PushedLoop pushedLoop(const Loop& loop) {
  const Vec6 direction = loop.contact->direction;
  Loop free = loop;
  free.contact.reset();
  Lifted lifted = liftedOf(free);
  lifted.axes = axesAlong(direction);
  MatrixXd places(PushedLoop::kSubsteps + 1, 0);
  channelOf(free, {}, &places);
  RowVectorXd command;
  PushedLoop out;
  out.step = systemOf(free, lifted, &direction, &command);
  const Index k = loop.base.stiffness.size(), n = lifted.channel.step.rows(),
              size = out.step.rows() - 1;
  out.step.conservativeResize(size, size + 1);
  out.places = places.rightCols(1) * command;
  out.places.middleCols(2 * k, n) += places.leftCols(n);
  out.places *= direction.norm();
  const bool inside = loop.model.inertia;  // the base's modes carry the robot
  const ModalModel base = emulated(loop);
  out.energy = MatrixXd::Zero(size, size);
  out.energy.diagonal().head(k) = 0.5 * base.stiffness;
  out.energy.diagonal().segment(k, k).setConstant(0.5);
  if (inside) return out;
  const Mat6 M = lifted.axes.transpose() * spatialMass(loop.robot_P) * lifted.axes;
  for (Index i = 0; i < 6; ++i)
    for (Index j = 0; j < 6; ++j)
      out.energy(2 * k + i * n + ChannelState::kSpeed, 2 * k + j * n + ChannelState::kSpeed) +=
          0.5 * M(i, j);
  return out;
}

double radius(const Loop& loop) { return std::abs(largestRoot(systemOf(loop, liftedOf(loop)))); }

DominantRoot dominantRoot(const Loop& loop) {
  const MatrixXd S = systemOf(loop, liftedOf(loop));
  const std::complex<double> root = largestRoot(S);
  DominantRoot out;
  out.radius = std::abs(root);
  out.growth = std::log(out.radius) / loop.period;
  out.frequency = std::abs(std::arg(root)) / (2.0 * M_PI * loop.period);
  const ModalModel base = emulated(loop);
  const Eigen::Matrix<std::complex<double>, 6, 1> x =
      base.Phi * eigenvector(S, root).head(base.stiffness.size());
  Index largest = 0;
  x.cwiseAbs().maxCoeff(&largest);
  out.shape = (x / x(largest)).real();
  return out;
}

Loop off(Loop loop, const Uncertainty& by, int timing, int gain) {
  loop.late += timing * by.timing;
  loop.velocity_gain *= 1.0 + gain * by.gain;
  loop.derivative_gain *= 1.0 + gain * by.gain;
  return loop;
}

Margins margins(const Loop& loop) {
  constexpr int kHalvings = 12;
  Margins out;
  const Lifted lifted = liftedOf(loop);
  /// The largest factor up to kMostGain that is borne.
  const auto factor = [](const auto& bears) {
    double lo = 1.0, hi = 1.0;
    while (lo < Margins::kMostGain && bears(hi = std::min(1.25 * lo, Margins::kMostGain))) lo = hi;
    for (int i = 0; i < kHalvings && lo < Margins::kMostGain; ++i) {
      const double mid = std::sqrt(lo * hi);
      (bears(mid) ? lo : hi) = mid;
    }
    return lo;
  };
  out.gain = factor([&](double times) {
    Loop some = loop;
    some.robot_P = scaledDensity(times, some.robot_P);
    return decays(some, lifted);
  });
  out.servo_gain = factor([&](double times) {
    return decays(off(loop, {0.0, times - 1.0, 0.0}, 0, 1));
  });
  const auto time = [&](int sign) {
    double lo = 0.0, hi = Margins::kMostTime;
    const auto bears = [&](double by) { return decays(off(loop, {by, 0.0, 0.0}, sign, 0)); };
    if (bears(hi)) return hi;
    for (int i = 0; i < kHalvings; ++i) (bears(0.5 * (lo + hi)) ? lo : hi) = 0.5 * (lo + hi);
    return lo;
  };
  out.early = time(-1);
  out.late = time(1);
  for (Loop some = loop; out.delay < Margins::kMostDelay; ++out.delay) {
    ++some.delay;
    if (!decays(some, lifted)) break;
  }
  return out;
}

/// xi = Q^T L^T eta, with 1 + Phi^T M_1 Phi = L L^T and L^-1 (K + Phi^T K_1 Phi) L^-T =
/// Q diag(stiffness) Q^T. What falls over has a negative one.
ModalModel withBody(const ModalModel& base, const Mat6& M_1, const Mat6& K_1) {
  const Index k = base.stiffness.size();
  const MatrixXd mass = MatrixXd::Identity(k, k) + base.Phi.transpose() * M_1 * base.Phi;
  const Eigen::LLT<MatrixXd> llt(mass);
  const MatrixXd half = base.stiffness.cwiseSqrt().asDiagonal();
  const MatrixXd A = llt.matrixL().solve(half);  // L^-1 K^(1/2)
  MatrixXd K = A * A.transpose();
  const bool weighs = !K_1.isZero(0.0);
  if (weighs) {
    const MatrixXd shapes = llt.matrixL().solve(base.Phi.transpose());
    K += shapes * K_1 * shapes.transpose();
  }
  auto [stiffness, Q] = symmetricEigen(K);
  if (!weighs) stiffness = stiffness.cwiseMax(0.0).eval();
  const MatrixXd shapes = llt.matrixU().solve(Q);  // eta = shapes xi
  return {base.Phi * shapes, stiffness, shapes.transpose() * base.damping * shapes};
}

ModalModel softest(const ModalModel& base, int k) {
  return {base.Phi.leftCols(k), base.stiffness.head(k), base.damping.topLeftCorner(k, k)};
}

int stableModes(const ControllerConfig& controller, const JointVector& q) {
  const auto all = static_cast<int>(linearised(controller.vehicle).stiffness.size());
  for (int k = 1; k <= all; ++k)
    for (const Direction direction : directionsOf(controller)) {
      Loop loop = loopOf(controller, q, direction);
      loop.base = softest(loop.base, k);
      if (!decays(loop)) return k - 1;
    }
  return all;
}

}  // namespace ves
