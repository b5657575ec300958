// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/servo_identification.hpp"

#include <array>
#include <cmath>
#include <stdexcept>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr std::size_t kMost = 5;
using Parameters = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;

/// What is looked for, in steps of differences that counts do not drown: a share of it, or [s | m].
struct Parameter {
  Vec6 ServoModel::*value;
  double share, step;
  double size;  // [s | m] that conditioning is counted in; 0: as believed
  double least, most;
};
constexpr double kMostDelay = 0.02, kLeastTau = 1e-3;            // [s]
constexpr double kOpenStep = 3e-5, kFirst = 1e-4, kOpen = 5e-3;  // [m]
constexpr Parameter kParameters[kMost] = {{&ServoModel::extend, 0.02, 0.0, 0.0, 0.0, HUGE_VAL},
                                          {&ServoModel::retract, 0.02, 0.0, 0.0, 0.0, HUGE_VAL},
                                          {&ServoModel::tau, 0.05, 0.0, 0.0, kLeastTau, HUGE_VAL},
                                          {&ServoModel::delay, 0.0, 2e-4, 1e-3, 0.0, kMostDelay},
                                          {&ServoModel::opening, 0.0, kOpenStep, 1e-4, 0.0, kOpen}};

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

/// Of LegSlaves whose updates had this phase at the start; the first `count` parameters.
ServoEstimate fit(const ServoModel& nominal, double period, double phase, const LegRecord& record,
                  std::size_t count) {
  constexpr int kTurns = 12, kBlocks = 10;
  const auto n = static_cast<Eigen::Index>(record.length.size()),
             size_of = static_cast<Eigen::Index>(count);
  ServoEstimate out;
  out.servo = nominal;
  out.deviation = nominal;
  out.deviation.opening.setZero();
  out.deviation.sensor_delay = out.deviation.sensor_scale = 0.0;  // not looked at
  for (int turn = 0; turn <= kTurns; ++turn) {
    const std::vector<Vec6> now = foretold(out.servo, period, phase, record);
    std::array<std::vector<Vec6>, kMost> changed;
    std::array<Vec6, kMost> by;
    for (std::size_t p = 0; p < count; ++p) {
      const Parameter& one = kParameters[p];
      ServoModel other = out.servo;
      Vec6& value = other.*one.value;
      const Vec6 step = one.share * value + Vec6::Constant(one.step);
      value += step;
      changed[p] = foretold(other, period, phase, record);
      value = (value - 2.0 * step).cwiseMax(one.least);
      const std::vector<Vec6> down = foretold(other, period, phase, record);
      by[p] = out.servo.*one.value + step - value;
      for (std::size_t k = 0; k < changed[p].size(); ++k) changed[p][k] -= down[k];
    }
    for (int leg = 0; leg < kLegs; ++leg) {
      Square JJ = Square::Zero(size_of, size_of);
      Eigen::Matrix<double, Eigen::Dynamic, kBlocks, 0, kMost, kBlocks> Je =
          decltype(Je)::Zero(size_of, kBlocks);
      double squares = 0.0;
      for (std::size_t k = 0; k < now.size(); ++k) {
        Parameters J(size_of);
        for (std::size_t p = 0; p < count; ++p)
          J(static_cast<Eigen::Index>(p)) = changed[p][k](leg) / by[p](leg);
        const double e = record.length[k](leg) - now[k](leg);
        JJ += J * J.transpose();
        Je.col(static_cast<Eigen::Index>(k * kBlocks / now.size())) += J * e;
        squares += e * e;
      }
      // In units of the parameters' own size, so that conditioning means something.
      Parameters size(size_of);
      for (std::size_t p = 0; p < count; ++p)
        size(static_cast<Eigen::Index>(p)) =
            kParameters[p].size > 0.0 ? kParameters[p].size : (nominal.*kParameters[p].value)(leg);
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
          (out.deviation.*kParameters[p].value)(leg) = deviation(static_cast<Eigen::Index>(p));
        continue;
      }
      const Parameters change =
          size.asDiagonal() * solvePositive(scaled, size.asDiagonal() * Je.rowwise().sum());
      for (std::size_t p = 0; p < count; ++p) {
        double& value = (out.servo.*kParameters[p].value)(leg);
        value = std::clamp(value + change(static_cast<Eigen::Index>(p)), kParameters[p].least,
                           kParameters[p].most);
      }
    }
  }
  return out;
}

/// Over the phases that the LegSlaves may have had.
ServoEstimate fitAll(const ServoModel& nominal, double period, const LegRecord& record,
                     std::size_t count) {
  constexpr std::array<double, 5> kPhases = {0.1, 0.3, 0.5, 0.7, 0.9};
  std::vector<ServoEstimate> all;
  for (const double phase : kPhases) all.push_back(fit(nominal, period, phase, record, count));
  ServoEstimate out = all.front();
  const double n = kPhases.size();
  out.residual.setZero();
  for (const ServoEstimate& one : all) out.residual += one.residual / n;
  for (std::size_t p = 0; p < count; ++p) {
    const auto value = kParameters[p].value;
    Vec6 mean = Vec6::Zero(), variance = Vec6::Zero();
    for (const ServoEstimate& one : all) mean += one.servo.*value / n;
    for (const ServoEstimate& one : all)
      variance += ((one.servo.*value - mean).cwiseAbs2() + (one.deviation.*value).cwiseAbs2()) / n;
    out.servo.*value = mean;
    out.deviation.*value = variance.cwiseSqrt();
  }
  return out;
}

}  // namespace

ServoEstimate identifyServo(const ServoModel& nominal, double period, const LegRecord& record) {
  if (record.length.size() < 50)
    throw std::domain_error("fewer than 50 ticks, want a run that moves the legs");
  constexpr double kBetter = 0.9;      // [-] of the residual,
  constexpr double kDeviations = 3.0;  // [-] and so far from none: then a valve is open at null
  ServoModel closed = nominal;
  closed.opening.setZero();
  const ServoEstimate out = fitAll(closed, period, record, kMost - 1);
  ServoModel open = out.servo;
  open.opening.setConstant(kFirst);
  try {
    const ServoEstimate other = fitAll(open, period, record, kMost);
    const Vec6 sure = other.servo.opening - kDeviations * other.deviation.opening;
    if (other.residual.mean() < kBetter * out.residual.mean() && sure.mean() > 0.0) return other;
  } catch (const std::domain_error&) {  // it moves too little to tell
  }
  return out;
}

}  // namespace ves
