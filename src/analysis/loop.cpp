// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/loop.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <deque>
#include <utility>
#include <vector>

#include "ves/math/dense.hpp"
#include "ves/math/second_order.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
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

/// Passes of one generator over lengths of time, each computed once.
class Passes {
 public:
  explicit Passes(MatrixXd generator) : generator_(std::move(generator)) {}
  const MatrixXd& over(double dt) {
    constexpr double kSame = 1e-12;  // [s]
    const auto known = std::find_if(known_.begin(), known_.end(), [&](const auto& one) {
      return std::abs(one.first - dt) < kSame;
    });
    if (known != known_.end()) return known->second;
    return known_.emplace_back(dt, exponential(generator_ * dt)).second;
  }

 private:
  MatrixXd generator_;
  std::deque<std::pair<double, MatrixXd>> known_;
};

/// What happens at once, `time` [s] after a tick.
struct Event {
  double time;
  MatrixXd change;
};

/// From a tick to the next one, through the events.
MatrixXd throughPeriod(double period, std::vector<Event> events, const MatrixXd& generator) {
  std::stable_sort(events.begin(), events.end(),
                   [](const Event& a, const Event& b) { return a.time < b.time; });
  Passes passes(generator);
  MatrixXd all = MatrixXd::Identity(generator.rows(), generator.cols());
  double now = 0.0;
  for (const Event& event : events) {
    all = event.change * passes.over(event.time - now) * all;
    now = event.time;
  }
  return passes.over(period - now) * all;
}

/// One direction over a controller period: z <- step z + from_command u; the first of z is the
/// length. `felt` z is the acceleration as the wrench shows it at the tick.
struct Channel {
  MatrixXd step;
  VectorXd from_command;
  RowVectorXd felt;
};

/// z = {mechanics, v_end, the first reading of the pair to come, X(k-1) .. X(k-4), the converter's
/// sum}, without what nothing reads: Filter 3 where it is absent, the earlier readings where there
/// is no derivative gain, the sum where the converter is read once.
Channel channelOf(const Loop& loop) {
  using plant::kTransducerPeriod, plant::kUpdatePeriod;
  constexpr Index kHeld = Mechanics::kSize, kFirst = kHeld + 1, kHistory = kFirst + 1,
                  kSum = kHistory + 4, kSize = kSum + 1,
                  kCommand = kSize;  // the command stands for itself at the end
  const Mechanics m = mechanicsOf(loop);
  const double update = static_cast<double>(kUpdatePeriod) * kSecondPerNanosecond;
  const int updates = std::max(1, static_cast<int>(std::lround(loop.period / update)));
  const double h = loop.period / updates;
  const double between =
      h * static_cast<double>(kTransducerPeriod) / static_cast<double>(kUpdatePeriod);
  const MatrixXd same = MatrixXd::Identity(kSize + 1, kSize + 1);

  MatrixXd generator = MatrixXd::Zero(kSize + 1, kSize + 1);
  generator.topLeftCorner(Mechanics::kSize, Mechanics::kSize) = m.A;
  generator.block(0, kHeld, Mechanics::kSize, 1) = m.B;

  // Update: the pair's second reading is now.
  MatrixXd X = MatrixXd::Zero(1, kSize + 1);
  X(0, Mechanics::kLength) = 0.5;
  X(0, kFirst) = 0.5;
  MatrixXd next = same;
  next.row(kHeld) = -(loop.velocity_gain + loop.derivative_gain) * X;
  next(kHeld, kCommand) += loop.velocity_gain;
  next(kHeld, kHistory + 3) += loop.derivative_gain;
  next.row(kHistory) = X;
  for (Index i = 1; i < 4; ++i) next.row(kHistory + i) = same.row(kHistory + i - 1);
  // The pair's first reading, `between` before the update.
  MatrixXd read = same;
  read.row(kFirst) = same.row(Mechanics::kLength);
  // The converter: a sensor that is late by a little shows what was a little ago.
  RowVectorXd felt = RowVectorXd::Zero(kSize + 1);
  felt(Mechanics::kSensor) = 1.0;
  felt(Mechanics::kSensor + 1) = -loop.late;

  // The controller's tick falls anywhere between two updates: in the middle, here.
  std::vector<Event> events;
  for (int k = 0; k < updates; ++k) {
    events.push_back({(k + 0.5) * h - between, read});
    events.push_back({(k + 0.5) * h, next});
  }
  if (loop.readings > 1) {
    MatrixXd empty = same, add = same;
    empty.row(kSum).setZero();
    add.row(kSum) += felt / loop.readings;
    events.insert(events.begin(), {0.0, empty});
    for (int k = 0; k < loop.readings; ++k)
      events.push_back({(k + 0.5) * loop.period / loop.readings, add});
    felt = same.row(kSum);
  }
  const MatrixXd all = throughPeriod(loop.period, events, generator);
  std::vector<Index> kept;
  for (Index i = 0; i < kSize; ++i) {
    const bool filter = i >= Mechanics::kFilter && i < Mechanics::kSensor,
               history = i >= kHistory && i < kSum;
    if ((!filter || loop.filter_cutoff > 0.0) && (!history || loop.derivative_gain > 0.0) &&
        (i != kSum || loop.readings > 1))
      kept.push_back(i);
  }
  return {all(kept, kept), all(kept, kCommand), felt(kept)};
}

/// The controller's servo model of one direction. z = {length, speed, v_end, sensor (2), where a
/// delay is believed the command before, where the readings are averaged the filtered speed of the
/// tick before}; a reading replaces the length at every tick.
Channel observerOf(const Loop& loop) {
  constexpr Index kLength = 0, kSpeed = 1, kHeld = 2, kSensor = 3, kBefore = 5, kMean = 6,
                  kSize = 7, kCommand = kSize;
  const ServoModel& servo = loop.model.servo;
  const double w = servo.sensor_cutoff, tau = servo.tau(0), K = servo.extend(0);
  const int updates = std::max(1, static_cast<int>(std::lround(loop.period / servo.update)));
  const double h = loop.period / updates;
  const MatrixXd same = MatrixXd::Identity(kSize + 1, kSize + 1);

  MatrixXd generator = MatrixXd::Zero(kSize + 1, kSize + 1);
  generator(kLength, kSpeed) = 1.0;
  generator(kSpeed, kSpeed) = -1.0 / tau;
  generator(kSpeed, kHeld) = 1.0 / tau;
  generator(kSensor, kSensor + 1) = 1.0;
  generator(kSensor + 1, kSensor) = -w * w;
  generator(kSensor + 1, kSensor + 1) = -M_SQRT2 * w;
  generator.row(kSensor + 1) += w * w * generator.row(kSpeed);
  MatrixXd next = same, early = same;
  next.row(kHeld).setZero();
  next(kHeld, kLength) = -K;
  next(kHeld, kSpeed) = K * (servo.reading_age - servo.derivative);
  early.row(kHeld) = next.row(kHeld);
  next(kHeld, kCommand) = K;
  early(kHeld, kBefore) = K;

  // The acceleration behind the filter, or the filtered speed, sensor_delay ago.
  RowVectorXd felt = RowVectorXd::Zero(kSize + 1), speed = felt;
  felt(kSensor) = 1.0;
  felt(kSensor + 1) = -servo.sensor_delay;
  speed(kSpeed) = 1.0;
  speed(kSensor) = -M_SQRT2 / w - servo.sensor_delay;
  speed(kSensor + 1) = -1.0 / (w * w);
  std::vector<Event> events;
  const bool averages = servo.sensor_window > 0.0;
  if (averages) {
    MatrixXd keep = same;
    keep.row(kMean) = speed;
    events.push_back({0.0, keep});
    felt = (speed - same.row(kMean)) / servo.sensor_window;
  }
  bool waits = false;
  for (int k = 0; k < updates; ++k) {
    const double time = (k + 0.5) * h;
    const bool arrived = time >= servo.delay(0);
    waits = waits || !arrived;
    events.push_back({time, arrived ? next : early});
  }
  MatrixXd kept_command = same;
  kept_command.row(kBefore) = same.row(kCommand);
  events.push_back({loop.period, kept_command});
  const MatrixXd all = throughPeriod(loop.period, events, generator);
  std::vector<Index> kept;
  for (Index i = 0; i < kSize; ++i)
    if ((i != kBefore || waits) && (i != kMean || averages)) kept.push_back(i);
  return {all(kept, kept), all(kept, kCommand), felt(kept)};
}

/// What of a loop does not depend on the robot.
struct Lifted {
  Channel channel;
  Channel model;  // where the inertia is taken out
};

Lifted liftedOf(const Loop& loop) {
  Lifted out{channelOf(loop), {}};
  if (loop.model.inertia) out.model = observerOf(loop);
  return out;
}

/// The whole loop over a period, of {eta, eta', six channels, six servo models where the inertia is
/// taken out, six late wrenches a tick of delay}. With the inertia taken out the modes are those of
/// the base with the robot on it.
MatrixXd systemOf(const Loop& loop, const Lifted& lifted) {
  const Loop::Model& own = loop.model;
  const Channel &channel = lifted.channel, &model = lifted.model;
  const ModalModel base = own.inertia ? withBody(loop.base, own.M_1()) : loop.base;
  const Index n = channel.step.rows(), m = model.step.rows(), k = base.stiffness.size(),
              d = loop.delay;
  const MatrixXd& Phi = base.Phi;
  const double T = loop.period;
  const Index channels = 2 * k, models = channels + 6 * n, late = models + 6 * m,
              size = late + 6 * d;
  MatrixXd S = MatrixXd::Zero(size, size);

  // The wrench of this tick: what the accelerations make of it, and the controller's own model.
  MatrixXd sampled = MatrixXd::Zero(6, size), modelled = MatrixXd::Zero(6, size);
  for (Index i = 0; i < 6; ++i) {
    sampled.block(i, channels + i * n, 1, n) = channel.felt;
    if (own.inertia) modelled.block(i, models + i * m, 1, m) = model.felt;
  }
  MatrixXd F = -spatialMass(loop.robot_P) * sampled;
  if (own.inertia) F += own.M_1() * modelled;
  if (d > 0) {
    S.middleRows(late, 6) = F;
    for (Index i = 1; i < d; ++i) S.block(late + 6 * i, late + 6 * (i - 1), 6, 6).setIdentity();
    F.setZero();
    F.rightCols(6).setIdentity();
  }

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
  if (own.feed_forward) {
    const MatrixXd x_dot = Phi * told.bottomRows(k);
    const MatrixXd x_ddot = Phi * (u - base.stiffness.asDiagonal() * told.topRows(k) -
                                   base.damping * told.bottomRows(k));
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
  loop.readings = p.sensor_readings;

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
  const ModalModel base = loop.model.inertia ? withBody(loop.base, loop.model.M_1()) : loop.base;
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
    some.robot_P = heavier(times, some.robot_P);
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

/// xi = Q^T L^T eta, with 1 + Phi^T M_1 Phi = L L^T and L^-1 K L^-T = Q diag(stiffness) Q^T.
ModalModel withBody(const ModalModel& base, const Mat6& M_1) {
  const Index k = base.stiffness.size();
  const MatrixXd mass = MatrixXd::Identity(k, k) + base.Phi.transpose() * M_1 * base.Phi;
  const Eigen::LLT<MatrixXd> llt(mass);
  const MatrixXd half = base.stiffness.cwiseSqrt().asDiagonal();
  const MatrixXd A = llt.matrixL().solve(half);  // L^-1 K^(1/2)
  const auto [stiffness, Q] = symmetricEigen(A * A.transpose());
  const MatrixXd shapes = llt.matrixU().solve(Q);  // eta = shapes xi
  return {base.Phi * shapes, stiffness.cwiseMax(0.0), shapes.transpose() * base.damping * shapes};
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
