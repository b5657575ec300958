// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/sensor_timing.hpp"

#include <Eigen/LU>
#include <cmath>
#include <stdexcept>

#include "ves/control/gravity_compensation.hpp"
#include "ves/control/servo_observer.hpp"

namespace ves {
namespace {

/// A tick's wrenches on the platform, about Po in I.
struct Wrenches {
  std::vector<Vec6> measured;  // [N, N m] without the weight
  std::vector<Vec6> modelled;  // [N, N m] of the robot's inertia
};

Wrenches wrenchesOf(const ControllerConfig& c, const ShakeRecord& record) {
  ServoModel nominal = c.servo;
  nominal.sensor_delay = 0.0;
  ServoObserver servo(nominal, c.periodSeconds());
  const RobotModel robot = carried(c.payload);
  Transform X_IP = c.geometry.fromHome({});
  Wrenches out;
  for (std::size_t n = 0; n < record.sample.size(); ++n) {
    const Sample& s = record.sample[n];
    const Vec6 L = legLengths(c.legs, s.legs);
    if (n == 0) servo.reset(L, s.time);
    servo.arrived(s.command_tick, s.command_time);
    servo.advance(std::max(s.legs_time, s.wrench_time));
    servo.correct(L, s.legs_time);
    servo.send(record.reference[n], record.tick[n], record.time[n]);

    const ForwardSolution forward = forwardPose(c.geometry, L, X_IP);
    BodyMotion P;
    const LegMotion legs{L, servo.velocity(), servo.filteredAcceleration(s.wrench_time)};
    if (!forward.ok() || !forwardMotion(c.geometry, forward.X_IP, legs, P))
      throw std::domain_error("the legs' lengths fit no pose");
    X_IP = forward.X_IP;
    const RigidBody body = combine(RigidBody{}, c.payload.X_PL0(), compositeBody(robot, s.q));
    Vec6 acceleration;
    acceleration << P.a, P.alpha;
    out.modelled.push_back(spatialMass(rotated(X_IP.R, body)) * acceleration);
    const Wrench total = forceMeasurement(c.sensor, record.bias[n], s.adc, X_IP.R);
    const Wrench weight =
        gravityCompensation(c.payload, X_IP.R, staticWrench(c.payload, s.q, X_IP.R, c.gravity));
    out.measured.push_back((total - weight).stacked());
  }
  return out;
}

}  // namespace

SensorEstimate identifySensor(const ControllerConfig& c, const ShakeRecord& record) {
  constexpr std::size_t kSettling = 20;  // [-] ticks until the servo model has found the legs
  constexpr std::size_t kBlocks = 10;
  constexpr double kMostJointMotion = 1e-3;  // [rad | m]
  const std::size_t size = record.sample.size();
  if (size < kSettling + 100)
    throw std::domain_error("fewer than 120 ticks, want a run that shakes the platform");
  for (const Sample& s : record.sample)
    if (!((s.q - record.sample.front().q).cwiseAbs().maxCoeff() <= kMostJointMotion))
      throw std::domain_error("the robot moves, want a run that shakes it standing still");
  const Wrenches W = wrenchesOf(c, record);
  const double T = c.periodSeconds();

  // Normal equations of {scale, scale * delay, one offset a channel}, by block; the offset is what
  // bias and weight leave. Whitened by each channel's own residual, of a first turn without.
  struct Sums {
    Eigen::Matrix2d JJ = Eigen::Matrix2d::Zero();
    Eigen::Vector2d Jy = Eigen::Vector2d::Zero();
  };
  const auto regressor = [&](std::size_t n, int i) {
    const double rate = (W.modelled[n + 1](i) - W.modelled[n - 1](i)) / (2.0 * T);
    return Eigen::Vector2d(-W.modelled[n](i), rate);
  };
  Vec6 mean_y = Vec6::Zero();
  Eigen::Matrix<double, 2, 6> mean_J = Eigen::Matrix<double, 2, 6>::Zero();
  const std::size_t first = kSettling, last = size - 1;
  const auto count = static_cast<double>(last - first);
  for (std::size_t n = first; n < last; ++n)
    for (int i = 0; i < 6; ++i) {
      mean_y(i) += W.measured[n](i) / count;
      mean_J.col(i) += regressor(n, i) / count;
    }
  const auto sums = [&](const Vec6& weight, std::size_t without) {
    Sums s;
    for (std::size_t n = first; n < last; ++n) {
      if ((n - first) * kBlocks / (last - first) == without) continue;
      for (int i = 0; i < 6; ++i) {
        const Eigen::Vector2d J = regressor(n, i) - mean_J.col(i);
        s.JJ += weight(i) * J * J.transpose();
        s.Jy += weight(i) * J * (W.measured[n](i) - mean_y(i));
      }
    }
    return s;
  };
  const auto solve = [](const Sums& s) -> Eigen::Vector2d {
    return s.JJ.inverse() * s.Jy;  // two by two, and checked before
  };
  Vec6 weight = Vec6::Ones();
  Eigen::Vector2d found;
  for (int turn = 0; turn < 2; ++turn) {
    const Sums all = sums(weight, kBlocks);
    const double signal = all.JJ(0, 0);
    if (!(signal > 0.0) || !(all.JJ.determinant() > 1e-9 * signal * all.JJ(1, 1)))
      throw std::domain_error("the platform moves too little to tell the wrench's time");
    found = solve(all);
    Vec6 squares = Vec6::Zero();
    for (std::size_t n = first; n < last; ++n)
      for (int i = 0; i < 6; ++i) {
        const Eigen::Vector2d J = regressor(n, i) - mean_J.col(i);
        squares(i) += std::pow(W.measured[n](i) - mean_y(i) - J.dot(found), 2) / count;
      }
    weight = squares.cwiseMax(1e-12).cwiseInverse();
  }
  SensorEstimate out;
  const auto delayOf = [](const Eigen::Vector2d& p) { return p(1) / p(0); };
  out.scale = found(0);
  out.delay = delayOf(found);
  double scale_squares = 0.0, delay_squares = 0.0;
  for (std::size_t b = 0; b < kBlocks; ++b) {
    const Eigen::Vector2d without = solve(sums(weight, b));
    scale_squares += std::pow(without(0) - out.scale, 2);
    delay_squares += std::pow(delayOf(without) - out.delay, 2);
  }
  constexpr double kJackknife = (kBlocks - 1.0) / kBlocks;
  out.scale_deviation = std::sqrt(kJackknife * scale_squares);
  out.delay_deviation = std::sqrt(kJackknife * delay_squares);
  constexpr double kMostDeviation = 2e-3, kMostScale = 0.2;  // [s], [-]
  constexpr double kMostDelay = 0.01, kLargest = 2.0;        // [s], [-] as ServoRecord takes them
  if (!(out.delay_deviation < kMostDeviation && out.scale_deviation < kMostScale))
    throw std::domain_error("the platform moves too little to tell the wrench's time");
  if (!(std::abs(out.delay) <= kMostDelay && out.scale <= kLargest && out.scale >= 1.0 / kLargest))
    throw std::domain_error("it is far from what is believed of filter and robot");
  return out;
}

}  // namespace ves
