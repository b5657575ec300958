// SPDX-License-Identifier: BSD-3-Clause
#include "channel.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>
#include <vector>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::VectorXd;

/// Leg and sensor of one direction, between two updates: x' = A x + B v_end, where v_end is the
/// speed that the valve's current leads to. x = {length, speed, what the valve has let in, its rate
/// and what of it pressure feedback takes for lasting (3), z, Filter 3 (3), sensor (2)}. A machine
/// that gives way follows its oil as
///   length'' = w^2 (oil - length) - 2 zeta w length'
/// and a leg that has just turned is quicker by r for a while T:
///   tau v' = r v_end + (1 - r) z - v,  T z' = v_end - z
struct Mechanics {
  static constexpr Index kSize = 11, kLength = 0, kSpeed = 1, kOil = 2, kTurned = 5, kFilter = 6,
                         kSensor = 9;
  MatrixXd A = MatrixXd::Zero(kSize, kSize);
  VectorXd B = VectorXd::Zero(kSize);
};

Mechanics mechanicsOf(const Loop& loop) {
  Mechanics m;
  constexpr Index y = Mechanics::kLength, v = Mechanics::kSpeed, q = Mechanics::kOil,
                  t = Mechanics::kTurned, f = Mechanics::kFilter, s = Mechanics::kSensor;
  m.A(y, v) = 1.0;
  const Resonance& o = loop.resonance;
  const double w_o = o.frequency;
  const bool gives = w_o > 0.0;
  const Index driven = gives ? q + 1 : v;
  m.A(driven, driven) = -1.0 / loop.tau;
  m.B(driven) = o.turning / loop.tau;
  m.A(driven, t) = (1.0 - o.turning) / loop.tau;
  m.A(t, t) = -1.0 / o.turning_time;
  m.B(t) = 1.0 / o.turning_time;
  if (gives) {
    m.A(q, q + 1) = 1.0;
    m.A(v, q) = w_o * w_o;
    m.A(v, y) = -w_o * w_o;
    m.A(v, v) = -2.0 * o.damping * w_o;
    // tau oil'' + oil' = v_end - feedback HP(oil - length)
    m.A(q + 1, q) = -o.feedback / loop.tau;
    m.A(q + 1, y) = m.A(q + 1, q + 2) = o.feedback / loop.tau;
    m.A(q + 2, q) = 1.0 / o.feedback_time;
    m.A(q + 2, y) = m.A(q + 2, q + 2) = -1.0 / o.feedback_time;
  }
  // The acceleration goes into Filter 3, a real pole and a pair, or past it.
  const double w3 = loop.filter_cutoff, w = loop.sensor_cutoff;
  const bool filtered = w3 > 0.0;
  const RowVectorXd acceleration = m.A.row(v);
  if (filtered) {
    m.A.row(f) = w3 * acceleration;
    m.A(f, f) = -w3;
    m.B(f) = w3 * m.B(v);
    m.A(f + 1, f + 2) = 1.0;
    m.A(f + 2, f) = w3 * w3;
    m.A(f + 2, f + 1) = -w3 * w3;
    m.A(f + 2, f + 2) = -w3;
    m.A(s + 1, f + 1) = w * w;
  } else {
    m.A.row(s + 1) = w * w * acceleration;
    m.B(s + 1) = w * w * m.B(v);
  }
  m.A(s, s + 1) = 1.0;
  m.A(s + 1, s) = -w * w;
  m.A(s + 1, s + 1) = -M_SQRT2 * w;
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

/// From a tick to the next one, through the events. `places`, where it is asked for, gets the first
/// state at equal shares of the period, a row each.
MatrixXd throughPeriod(double period, std::vector<Event> events, const MatrixXd& generator,
                       MatrixXd* places = nullptr) {
  std::stable_sort(events.begin(), events.end(),
                   [](const Event& a, const Event& b) { return a.time < b.time; });
  Passes passes(generator);
  MatrixXd all = MatrixXd::Identity(generator.rows(), generator.cols());
  double now = 0.0;
  Index looked = 0;
  if (places) places->resize(places->rows(), generator.cols());
  const auto look = [&](double until) {
    if (!places) return;
    const double share = period / static_cast<double>(places->rows() - 1);
    MatrixXd row;  // of the first state, from `now`
    for (; looked < places->rows(); ++looked) {
      const double time = share * static_cast<double>(looked);
      if (time > until) return;
      row = row.size() == 0 ? MatrixXd(exponential(generator * (time - now)).topRows(1))
                            : MatrixXd(row * passes.over(share));
      places->row(looked) = row * all;
    }
  };
  for (const Event& event : events) {
    look(event.time);
    all = event.change * passes.over(event.time - now) * all;
    now = event.time;
  }
  look(HUGE_VAL);
  return passes.over(period - now) * all;
}

}  // namespace

/// z = {mechanics, v_end, the first reading of the pair to come, X(k-1) .. X(k-4), the converter's
/// sum, and of a contact {place, speed of what it leans on, sensor (2), the converter's sum}},
/// without what nothing reads after the tick: the first reading, which is new before the pair's
/// second; the oil of a machine that does not give way, Filter 3 where it is absent, the earlier
/// readings where there is no derivative gain, the sums where the converter is read once.
Channel channelOf(const Loop& loop, const std::optional<Leaning>& contact, MatrixXd* places) {
  constexpr Index kHeld = Mechanics::kSize, kFirst = kHeld + 1, kHistory = kFirst + 1,
                  kSum = kHistory + 4, kOther = kSum + 1, kForce = kOther + 2,
                  kForceSum = kForce + 2, kSize = kForceSum + 1,
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
  if (contact) {
    const double w = loop.sensor_cutoff, along = contact->direction.norm();
    RowVectorXd force = RowVectorXd::Zero(kSize + 1);  // on the platform
    force(Mechanics::kLength) = -contact->stiffness * along;
    force(Mechanics::kSpeed) = -contact->damping * along;
    force(kOther) = contact->stiffness;
    force(kOther + 1) = contact->damping;
    generator(kOther, kOther + 1) = 1.0;
    generator.row(kOther + 1) = -contact->inverse_mass * force;
    generator(kForce, kForce + 1) = 1.0;
    generator.row(kForce + 1) = w * w * force;
    generator(kForce + 1, kForce) = -w * w;
    generator(kForce + 1, kForce + 1) = -M_SQRT2 * w;
  }

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
  RowVectorXd felt = RowVectorXd::Zero(kSize + 1), pressed = felt;
  felt(Mechanics::kSensor) = pressed(kForce) = 1.0;
  felt(Mechanics::kSensor + 1) = pressed(kForce + 1) = -loop.late;

  // The controller's tick falls anywhere between two updates: in the middle, here.
  std::vector<Event> events;
  for (int k = 0; k < updates; ++k) {
    events.push_back({(k + 0.5) * h - between, read});
    events.push_back({(k + 0.5) * h, next});
  }
  if (loop.readings > 1) {
    MatrixXd empty = same, add = same;
    empty.row(kSum).setZero();
    empty.row(kForceSum).setZero();
    add.row(kSum) += felt / loop.readings;
    add.row(kForceSum) += pressed / loop.readings;
    events.insert(events.begin(), {0.0, empty});
    for (int k = 0; k < loop.readings; ++k)
      events.push_back({(k + 0.5) * loop.period / loop.readings, add});
    felt = same.row(kSum);
    pressed = same.row(kForceSum);
  }
  const MatrixXd all = throughPeriod(loop.period, events, generator, places);
  std::vector<Index> kept;
  for (Index i = 0; i < kSize; ++i) {
    const bool oil = i >= Mechanics::kOil && i < Mechanics::kTurned,
               lasting = i == Mechanics::kOil + 2, turned = i == Mechanics::kTurned,
               filter = i >= Mechanics::kFilter && i < Mechanics::kSensor,
               history = i >= kHistory && i < kSum, sum = i == kSum || i == kForceSum;
    if (i != kFirst && (!oil || loop.resonance.frequency > 0.0) &&
        (!lasting || loop.resonance.feedback > 0.0) && (!turned || loop.resonance.turning != 1.0) &&
        (!filter || loop.filter_cutoff > 0.0) && (!history || loop.derivative_gain > 0.0) &&
        (!sum || loop.readings > 1) && (i < kOther || contact) &&
        (i < kOther || i >= kForce || contact->inverse_mass > 0.0))
      kept.push_back(i);
  }
  if (places) {
    std::vector<Index> columns = kept;
    columns.push_back(kCommand);
    *places = MatrixXd((*places)(Eigen::all, columns));
  }
  return {all(kept, kept), all(kept, kCommand), felt(kept), pressed(kept)};
}

/// The controller's servo model of one direction. z = {speed, v_end, sensor (2), where a delay is
/// believed the command before, where the readings are averaged the filtered speed of the tick
/// before}; a reading replaces the length at every tick.
Observer observerOf(const Loop& loop) {
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
    if (i != kLength && (i != kBefore || waits) && (i != kMean || averages)) kept.push_back(i);
  return {{all(kept, kept), all(kept, kCommand), felt(kept), {}}, all(kept, kLength)};
}

}  // namespace ves
