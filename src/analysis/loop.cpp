// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/loop.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "ves/math/dense.hpp"
#include "ves/math/second_order.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Leg and sensor of one direction, between two updates: x' = A x + B v_end, where v_end is the
/// speed that the valve's current leads to. x = {length, speed, Filter 3 (3), sensor (2)}.
struct Mechanics {
  static constexpr Index kSize = 7, kLength = 0, kSpeed = 1, kFilter = 2, kSensor = 5;
  MatrixXd A = MatrixXd::Zero(kSize, kSize);
  VectorXd B = VectorXd::Zero(kSize);
};

Mechanics mechanicsOf(const Loop& loop) {
  Mechanics m;
  constexpr Index y = Mechanics::kLength, v = Mechanics::kSpeed, f = Mechanics::kFilter,
                  s = Mechanics::kSensor;
  m.A(y, v) = 1.0;
  m.A(v, v) = -1.0 / loop.tau;
  m.B(v) = 1.0 / loop.tau;
  // The acceleration (v_end - v) / tau goes into Filter 3, a real pole and a pair, or past it.
  const double w3 = loop.filter_cutoff, w = loop.sensor_cutoff;
  const bool filtered = w3 > 0.0;
  if (filtered) {
    m.A(f, f) = -w3;
    m.A(f, v) = -w3 / loop.tau;
    m.B(f) = w3 / loop.tau;
    m.A(f + 1, f + 2) = 1.0;
    m.A(f + 2, f) = w3 * w3;
    m.A(f + 2, f + 1) = -w3 * w3;
    m.A(f + 2, f + 2) = -w3;
  } else  // states that nothing reads, and that must not be roots
    m.A.block<3, 3>(f, f) = -w * Mat3::Identity();
  m.A(s, s + 1) = 1.0;
  m.A(s + 1, s) = -w * w;
  m.A(s + 1, s + 1) = -M_SQRT2 * w;
  if (filtered) {
    m.A(s + 1, f + 1) = w * w;
  } else {
    m.A(s + 1, v) = -w * w / loop.tau;
    m.B(s + 1) = w * w / loop.tau;
  }
  return m;
}

/// One direction over a controller period: z <- step z + from_command u. z = {mechanics, v_end, the
/// first reading of the pair to come, X(k-1) .. X(k-4)}, without what nothing reads: Filter 3 where
/// it is absent, and the earlier readings where there is no derivative gain.
struct Channel {
  MatrixXd step;
  VectorXd from_command;
  Index sensor = 0;  // of the sensor's output in z; the length is the first
};

Channel channelOf(const Loop& loop) {
  using plant::kTransducerPeriod, plant::kUpdatePeriod;
  constexpr Index kHeld = Mechanics::kSize, kFirst = kHeld + 1, kHistory = kFirst + 1,
                  kSize = kHistory + 4,
                  kCommand = kSize;  // the command stands for itself at the end
  const Mechanics m = mechanicsOf(loop);
  const double update = static_cast<double>(kUpdatePeriod) * kSecondPerNanosecond;
  const int updates = std::max(1, static_cast<int>(std::lround(loop.period / update)));
  const double h = loop.period / updates;
  const double between =
      h * static_cast<double>(kTransducerPeriod) / static_cast<double>(kUpdatePeriod);

  MatrixXd generator = MatrixXd::Zero(kSize + 1, kSize + 1);
  generator.topLeftCorner(Mechanics::kSize, Mechanics::kSize) = m.A;
  generator.block(0, kHeld, Mechanics::kSize, 1) = m.B;
  const auto pass = [&](double dt) { return exponential(generator * dt); };

  // Update: the pair's second reading is now.
  MatrixXd X = MatrixXd::Zero(1, kSize + 1);
  X(0, Mechanics::kLength) = 0.5;
  X(0, kFirst) = 0.5;
  MatrixXd next = MatrixXd::Identity(kSize + 1, kSize + 1);
  next.row(kHeld) = -(loop.velocity_gain + loop.derivative_gain) * X;
  next(kHeld, kCommand) += loop.velocity_gain;
  next(kHeld, kHistory + 3) += loop.derivative_gain;
  next.row(kHistory) = X;
  for (Index i = 1; i < 4; ++i)
    next.row(kHistory + i) = MatrixXd::Identity(kSize + 1, kSize + 1).row(kHistory + i - 1);
  // The pair's first reading, `between` before the next update.
  MatrixXd read = MatrixXd::Identity(kSize + 1, kSize + 1);
  read.row(kFirst) = read.row(Mechanics::kLength).eval();

  // The controller's tick falls anywhere between two updates: in the middle, here. The pair's
  // first reading comes after the tick, two thirds of the way to the next update.
  const double before = h - between;  // from an update to the first reading
  MatrixXd all = MatrixXd::Identity(kSize + 1, kSize + 1);
  const double to_tick = 0.5 * h;
  all = pass(between) * read * pass(before - to_tick) * all;
  for (int k = 0; k + 1 < updates; ++k) all = pass(between) * read * pass(before) * next * all;
  all = next * all;
  all = pass(to_tick) * all;
  std::vector<Index> read_states;
  for (Index i = 0; i < kSize; ++i) {
    const bool filter = i >= Mechanics::kFilter && i < Mechanics::kSensor;
    if ((!filter || loop.filter_cutoff > 0.0) && (i < kHistory || loop.derivative_gain > 0.0))
      read_states.push_back(i);
  }
  const auto sensor = std::find(read_states.begin(), read_states.end(), Mechanics::kSensor);
  return {all(read_states, read_states), all(read_states, kCommand), sensor - read_states.begin()};
}

/// The controller's servo model of one direction over a period: z <- step z + from_command u. z =
/// {length, speed, v_end, sensor (2)}; a reading replaces the length at every tick.
Channel observerOf(const Loop& loop) {
  constexpr Index kLength = 0, kSpeed = 1, kHeld = 2, kSensor = 3, kSize = 5, kCommand = kSize;
  const ServoModel& servo = loop.model.servo;
  const double w = servo.sensor_cutoff, tau = servo.tau(0), K = servo.extend(0);
  const int updates = std::max(1, static_cast<int>(std::lround(loop.period / servo.update)));
  const double h = loop.period / updates;

  MatrixXd generator = MatrixXd::Zero(kSize + 1, kSize + 1);
  generator(kLength, kSpeed) = 1.0;
  generator(kSpeed, kSpeed) = -1.0 / tau;
  generator(kSpeed, kHeld) = 1.0 / tau;
  generator(kSensor, kSensor + 1) = 1.0;
  generator(kSensor + 1, kSensor) = -w * w;
  generator(kSensor + 1, kSensor + 1) = -M_SQRT2 * w;
  generator.row(kSensor + 1) += w * w * generator.row(kSpeed);
  MatrixXd next = MatrixXd::Identity(kSize + 1, kSize + 1);
  next.row(kHeld).setZero();
  next(kHeld, kLength) = -K;
  next(kHeld, kSpeed) = K * (servo.reading_age - servo.derivative);
  next(kHeld, kCommand) = K;

  const MatrixXd half = exponential(generator * 0.5 * h), whole = half * half;
  MatrixXd all = half;
  for (int k = 0; k < updates; ++k) all = (k + 1 < updates ? whole : half) * next * all;
  return {all.topLeftCorner(kSize, kSize), all.block(0, kCommand, kSize, 1), kSensor};
}

/// What of a loop does not depend on the robot.
struct Lifted {
  Channel channel;
  Channel model;          // where the inertia is taken out
  ModalHold hold, ahead;  // over a period; to the legs' own time
};

Lifted liftedOf(const Loop& loop) {
  const ServoModel& servo = loop.model.servo;
  Lifted out{channelOf(loop), {}, modalHold(loop.base, loop.period), {}};
  if (!loop.model.inertia) return out;
  out.model = observerOf(loop);
  out.ahead = modalHold(loop.base, wrenchDelay(servo, loop.period));
  return out;
}

/// The whole loop over a period, of {eta, eta', six channels, six servo models where the inertia is
/// taken out, six late wrenches a tick of delay}.
MatrixXd systemOf(const Loop& loop, const Lifted& lifted) {
  const Loop::Model& own = loop.model;
  const Channel &channel = lifted.channel, &model = lifted.model;
  const Index n = channel.step.rows(), m = model.step.rows(), k = loop.base.stiffness.size(),
              d = loop.delay;
  const MatrixXd& Phi = loop.base.Phi;
  const double T = loop.period;
  const Index channels = 2 * k, models = channels + 6 * n, late = models + 6 * m,
              size = late + 6 * d;
  MatrixXd S = MatrixXd::Zero(size, size);

  // What the controller is given: of the accelerations, and of its own model of them.
  MatrixXd sampled = MatrixXd::Zero(6, size), modelled = MatrixXd::Zero(6, size);
  for (Index i = 0; i < 6; ++i) {
    sampled(i, channels + i * n + channel.sensor) = 1.0;
    if (own.inertia) modelled(i, models + i * m + model.sensor) = 1.0;
  }
  MatrixXd used = sampled;
  if (d > 0) {
    used.setZero();
    used.rightCols(6).setIdentity();
    S.middleRows(late, 6) = sampled;
    for (Index i = 1; i < d; ++i) S.block(late + 6 * i, late + 6 * (i - 1), 6, 6).setIdentity();
  }
  MatrixXd F = -spatialMass(loop.robot_P) * used;

  // Admittance model.
  const ModalHold& hold = lifted.hold;
  MatrixXd before = MatrixXd::Zero(2 * k, size);
  before.leftCols(2 * k).setIdentity();
  if (own.inertia) {
    const Mat6 M_1 = spatialMass(own.robot_P);
    F += M_1 * modelled;
    const MatrixXd rate = Phi * hold.Gamma.bottomRows(k) * Phi.transpose();
    const MatrixXd change =
        Phi * ((hold.Phi * before).bottomRows(k) - before.bottomRows(k)) + rate * F;
    F -= M_1 * (T * Mat6::Identity() + rate * M_1).partialPivLu().solve(change);
  }
  const MatrixXd u = Phi.transpose() * F;
  S.topRows(2 * k) = hold.Phi * before + hold.Gamma * u;

  // The command, from where the model is at its own time or, ahead, at the legs'.
  MatrixXd told = S.topRows(2 * k);
  if (own.inertia) told = lifted.ahead.Phi * S.topRows(2 * k) + lifted.ahead.Gamma * u;
  MatrixXd command = Phi * told.topRows(k);
  if (own.feed_forward) {
    const MatrixXd x_dot = Phi * told.bottomRows(k);
    const MatrixXd x_ddot = Phi * (u - loop.base.stiffness.asDiagonal() * told.topRows(k) -
                                   loop.base.damping * told.bottomRows(k));
    LegMotion rate, acceleration;
    rate.L_dot.setOnes();
    acceleration.L_ddot.setOnes();
    command += feedForward(own.servo, rate, T, T, 1.0)(0) * x_dot +
               feedForward(own.servo, acceleration, T, T, 1.0)(0) * x_ddot;
  }
  for (Index i = 0; i < 6; ++i) {
    const Index at = channels + i * n;
    S.middleRows(at, n) = channel.from_command * command.row(i);
    S.block(at, at, n, n) += channel.step;
    if (!own.inertia) continue;
    const Index own_at = models + i * m;
    S.middleRows(own_at, m) = model.from_command * command.row(i);
    S.block(own_at, own_at + 1, m, m - 1) += model.step.rightCols(m - 1);
    S.col(at + Mechanics::kLength).segment(own_at, m) += model.step.col(0);  // as read
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
    if (std::abs(root) <= 1.0 + kRounding) return true;
    return std::abs(std::arg(root)) < kDriftRate * loop.period &&
           std::abs(root) < 1.0 + kDriftGrowth * loop.period;
  });
}

}  // namespace

RigidBody lockedRobot(const ControllerConfig& controller, const JointVector& q) {
  return combine(RigidBody{}, controller.payload.X_PL0(),
                 compositeBody(carried(controller.payload), q));
}

Loop loopOf(const ControllerConfig& controller, const plant::PlantConfig& p, const JointVector& q,
            Direction direction) {
  Loop loop;
  loop.base = controller.admittance;
  loop.robot_P = lockedRobot(controller, q);
  loop.period = static_cast<double>(controller.period) * kSecondPerNanosecond;
  const double extend = p.actuator.gain_extend, retract = p.actuator.gain_retract;
  double K = 2.0 * extend * retract / (extend + retract);
  if (direction == Direction::kExtending) K = extend;
  if (direction == Direction::kRetracting) K = retract;
  loop.velocity_gain = plant::velocityGain(K, p.leg_slave, p.transducer);
  loop.derivative_gain = loop.velocity_gain * p.leg_slave.K_D / p.leg_slave.K_P;
  loop.tau = p.actuator.tau;
  loop.filter_cutoff = p.filters == plant::LegFilters::kOutputs ? p.filter_cutoff : 0.0;
  loop.sensor_cutoff = p.sensor.cutoff;

  Loop::Model& own = loop.model;
  own = {controller.compensation.feed_forward, controller.compensation.inertia, loop.robot_P,
         controller.servo};
  const double up = own.servo.extend.mean(), down = own.servo.retract.mean();
  double model = 2.0 * up * down / (up + down);
  if (direction == Direction::kExtending) model = up;
  if (direction == Direction::kRetracting) model = down;
  own.setGain(model);
  own.servo.tau.setConstant(own.servo.tau.mean());
  own.servo.delay.setConstant(own.servo.delay.mean());
  own.servo.rail = HUGE_VAL;
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

double radius(const Loop& loop) { return std::abs(largestRoot(systemOf(loop, liftedOf(loop)))); }

DominantRoot dominantRoot(const Loop& loop) {
  const MatrixXd S = systemOf(loop, liftedOf(loop));
  const std::complex<double> root = largestRoot(S);
  DominantRoot out;
  out.radius = std::abs(root);
  out.growth = std::log(out.radius) / loop.period;
  out.frequency = std::abs(std::arg(root)) / (2.0 * M_PI * loop.period);
  const Eigen::Matrix<std::complex<double>, 6, 1> x =
      loop.base.Phi * eigenvector(S, root).head(loop.base.stiffness.size());
  Index largest = 0;
  x.cwiseAbs().maxCoeff(&largest);
  out.shape = (x / x(largest)).real();
  return out;
}

Margins margins(const Loop& loop) {
  Margins out;
  const Lifted lifted = liftedOf(loop);
  const auto bears = [&](double factor) {
    Loop some = loop;
    some.robot_P = heavier(factor, some.robot_P);
    return decays(some, lifted);
  };
  double lo = 1.0, hi = 1.0;
  while (lo < Margins::kMostGain && bears(hi = std::min(1.25 * lo, Margins::kMostGain))) lo = hi;
  for (int i = 0; i < 12 && lo < Margins::kMostGain; ++i) {
    const double mid = std::sqrt(lo * hi);
    (bears(mid) ? lo : hi) = mid;
  }
  out.gain = lo;
  for (Loop some = loop; out.delay < Margins::kMostDelay; ++out.delay) {
    ++some.delay;
    if (!decays(some, lifted)) break;
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
      if (!decays(loop)) return k - 1;
    }
  return all;
}

}  // namespace ves
