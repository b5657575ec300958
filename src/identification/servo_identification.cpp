// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/servo_identification.hpp"

#include <array>
#include <cmath>
#include <future>
#include <optional>
#include <stdexcept>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr std::size_t kMost = 6;
using Row = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;

/// What is looked for, in steps of differences that counts do not drown: a share of it, or [s | m].
struct Parameter {
  Vec6 ServoModel::*value;
  double share, step;
  double size;  // [s | m] that conditioning is counted in; 0: as believed
  double least, most;
};
constexpr double kMostDelay = 0.02, kLeastTau = 1e-3;           // [s]
constexpr double kStep = 3e-5, kFirst = 1e-4, kMostWay = 5e-3;  // [m] opening and friction
using Parameters = std::vector<Parameter>;
constexpr Parameter kAlways[] = {{&ServoModel::extend, 0.02, 0.0, 0.0, 0.0, HUGE_VAL},
                                 {&ServoModel::retract, 0.02, 0.0, 0.0, 0.0, HUGE_VAL},
                                 {&ServoModel::tau, 0.05, 0.0, 0.0, kLeastTau, HUGE_VAL},
                                 {&ServoModel::delay, 0.0, 2e-4, 1e-3, 0.0, kMostDelay}};
constexpr Parameter kOpen = {&ServoModel::opening, 0.0, kStep, kFirst, 0.0, kMostWay};
constexpr Parameter kLapped = {&ServoModel::opening, 0.0, kStep, kFirst, -kMostWay, 0.0};
constexpr Parameter kFriction = {&ServoModel::friction, 0.0, kStep, kFirst, 0.0, kMostWay};

/// Lengths that the model foretells, the first reading given.
std::vector<Vec6> foretold(const ServoModel& servo, double period, double phase,
                           const LegRecord& record) {
  ModelledServos model(servo, period, phase);
  model.reset(record.length.front(), record.read.front());
  std::vector<Vec6> out = {record.length.front()};
  for (std::size_t n = 0; n + 1 < record.length.size(); ++n) {
    model.send(record.reference[n], static_cast<std::int64_t>(n), record.sent[n]);
    model.advance(record.read[n + 1]);
    out.push_back(model.length());
  }
  return out;
}

/// Of LegSlaves whose updates had this phase at the start.
ServoEstimate fit(const ServoModel& nominal, double period, double phase, const LegRecord& record,
                  const Parameters& wanted) {
  constexpr int kTurns = 12, kBlocks = 10;
  const std::size_t count = wanted.size();
  const auto n = static_cast<Eigen::Index>(record.length.size()),
             size_of = static_cast<Eigen::Index>(count);
  ServoEstimate out;
  out.servo = nominal;
  out.deviation = nominal;
  out.deviation.opening.setZero();
  out.deviation.friction.setZero();
  out.deviation.sensor_delay = out.deviation.sensor_scale = 0.0;  // not looked at
  for (int turn = 0; turn <= kTurns; ++turn) {
    const std::vector<Vec6> now = foretold(out.servo, period, phase, record);
    std::array<std::vector<Vec6>, kMost> changed;
    std::array<Vec6, kMost> by;
    for (std::size_t p = 0; p < count; ++p) {
      const Parameter& one = wanted[p];
      ServoModel other = out.servo;
      Vec6& value = other.*one.value;
      const Vec6 step = one.share * value + Vec6::Constant(one.step);
      value = (value + step).cwiseMin(one.most);
      by[p] = value;
      changed[p] = foretold(other, period, phase, record);
      value = (out.servo.*one.value - step).cwiseMax(one.least);
      const std::vector<Vec6> down = foretold(other, period, phase, record);
      by[p] -= value;
      for (std::size_t k = 0; k < changed[p].size(); ++k) changed[p][k] -= down[k];
    }
    for (int leg = 0; leg < kLegs; ++leg) {
      Square JJ = Square::Zero(size_of, size_of);
      Eigen::Matrix<double, Eigen::Dynamic, kBlocks, 0, kMost, kBlocks> Je =
          decltype(Je)::Zero(size_of, kBlocks);
      double squares = 0.0;
      for (std::size_t k = 0; k < now.size(); ++k) {
        Row J(size_of);
        for (std::size_t p = 0; p < count; ++p)
          J(static_cast<Eigen::Index>(p)) = changed[p][k](leg) / by[p](leg);
        const double e = record.length[k](leg) - now[k](leg);
        JJ += J * J.transpose();
        Je.col(static_cast<Eigen::Index>(k * kBlocks / now.size())) += J * e;
        squares += e * e;
      }
      // In units of the parameters' own size, so that conditioning means something.
      Row size(size_of);
      for (std::size_t p = 0; p < count; ++p)
        size(static_cast<Eigen::Index>(p)) =
            wanted[p].size > 0.0 ? wanted[p].size : (nominal.*wanted[p].value)(leg);
      const Square scaled = size.asDiagonal() * JJ * size.asDiagonal();
      const Eigen::VectorXd eigenvalues = symmetricEigenvalues(scaled);
      if (!(eigenvalues(0) > 1e-9 * eigenvalues(size_of - 1)))
        throw std::domain_error("leg " + std::to_string(leg + 1) +
                                " moves too little to tell gains, lag and delay apart");
      out.residual(leg) = std::sqrt(squares / static_cast<double>(n));
      if (turn == kTurns) {
        // Residuals are correlated over many ticks, because counts are rounded and the model runs
        // by itself: the covariance is taken from sums over blocks (clustered sandwich estimator).
        const Eigen::MatrixXd by_block =
            size.asDiagonal() * solvePositive(scaled, size.asDiagonal() * Je);
        const Eigen::VectorXd deviation =
            by_block.rowwise().norm() * std::sqrt(kBlocks / (kBlocks - 1.0));
        for (std::size_t p = 0; p < count; ++p)
          (out.deviation.*wanted[p].value)(leg) = deviation(static_cast<Eigen::Index>(p));
        continue;
      }
      const Row change =
          size.asDiagonal() * solvePositive(scaled, size.asDiagonal() * Je.rowwise().sum());
      for (std::size_t p = 0; p < count; ++p) {
        double& value = (out.servo.*wanted[p].value)(leg);
        value = std::clamp(value + change(static_cast<Eigen::Index>(p)), wanted[p].least,
                           wanted[p].most);
      }
    }
  }
  return out;
}

/// Over the phases that the LegSlaves may have had.
ServoEstimate fitAll(const ServoModel& nominal, double period, const LegRecord& record,
                     const Parameters& wanted) {
  constexpr std::array<double, 5> kPhases = {0.1, 0.3, 0.5, 0.7, 0.9};
  std::vector<std::future<ServoEstimate>> running;
  for (const double phase : kPhases)
    running.push_back(std::async(
        std::launch::async, [&, phase] { return fit(nominal, period, phase, record, wanted); }));
  std::vector<ServoEstimate> all;
  for (std::future<ServoEstimate>& one : running) all.push_back(one.get());
  ServoEstimate out = all.front();
  const double n = kPhases.size();
  out.residual.setZero();
  for (const ServoEstimate& one : all) out.residual += one.residual / n;
  for (const Parameter& parameter : wanted) {
    const auto value = parameter.value;
    Vec6 mean = Vec6::Zero(), variance = Vec6::Zero();
    for (const ServoEstimate& one : all) mean += one.servo.*value / n;
    for (const ServoEstimate& one : all)
      variance += ((one.servo.*value - mean).cwiseAbs2() + (one.deviation.*value).cwiseAbs2()) / n;
    out.servo.*value = mean;
    out.deviation.*value = variance.cwiseSqrt();
  }
  return out;
}

/// With the last parameter too, from `begin`; nothing where it fits no better than `without`.
std::optional<ServoEstimate> better(const ServoEstimate& without, const ServoModel& begin,
                                    double period, const LegRecord& record,
                                    const Parameters& wanted) {
  constexpr double kBetter = 0.9;      // [-] of the residual,
  constexpr double kDeviations = 3.0;  // [-] and so far from none
  const auto value = wanted.back().value;
  try {
    const ServoEstimate out = fitAll(begin, period, record, wanted);
    const Vec6 sure = (out.servo.*value).cwiseAbs() - kDeviations * out.deviation.*value;
    if (out.residual.mean() < kBetter * without.residual.mean() && sure.mean() > 0.0) return out;
  } catch (const std::domain_error&) {  // it moves too little to tell
  }
  return {};
}

/// [s] for which a turn is felt: of a few, with which friction fits best.
double turnTime(const ServoModel& begin, double period, const LegRecord& record,
                Parameters wanted) {
  wanted.push_back(kFriction);
  double out = begin.friction_time, least = HUGE_VAL;
  for (const double time : {0.01, 0.02, 0.03, 0.05, 0.1}) {
    ServoModel servo = begin;
    servo.friction.setConstant(kFirst);
    servo.friction_time = time;
    try {
      const double residual = fit(servo, period, 0.5, record, wanted).residual.mean();
      if (residual < least) out = time;
      least = std::min(least, residual);
    } catch (const std::domain_error&) {  // it moves too little to tell
    }
  }
  return out;
}

}  // namespace

ServoEstimate identifyServo(const ServoModel& nominal, double period, const LegRecord& record) {
  if (record.length.size() < 50)
    throw std::domain_error("fewer than 50 ticks, want a run that moves the legs");
  ServoModel plain = nominal;
  plain.opening.setZero();
  plain.friction.setZero();
  Parameters wanted(std::begin(kAlways), std::end(kAlways));
  ServoEstimate out = fitAll(plain, period, record, wanted);
  const double rounding = nominal.readings.scale.mean() / std::sqrt(12.0);  // [m] rms
  if (out.residual.mean() < 1.2 * rounding) return out;  // nothing is left to explain
  const auto with = [&](ServoModel begin, const Parameter& one, double first) {
    (begin.*one.value).setConstant(first);
    wanted.push_back(one);
    const auto found = better(out, begin, period, record, wanted);
    if (found)
      out = *found;
    else
      wanted.pop_back();
    return found.has_value();
  };
  if (!with(out.servo, kOpen, kFirst)) with(out.servo, kLapped, -kFirst);
  ServoModel turns = out.servo;
  turns.friction_time = turnTime(turns, period, record, wanted);
  if (!with(turns, kFriction, kFirst)) return out;
  // Small motions would be amplified by more, were there no friction.
  constexpr double kLoudest = 5.0;  // [-]
  const double way = out.servo.friction.maxCoeff() / kLoudest;
  if (way <= out.servo.friction_way) return out;
  ServoModel gentle = out.servo;
  gentle.friction_way = way;
  return fitAll(gentle, period, record, wanted);
}

}  // namespace ves
