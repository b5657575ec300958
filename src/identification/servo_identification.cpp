// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/servo_identification.hpp"

#include <array>
#include <cmath>
#include <stdexcept>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

using Parameters = Eigen::Vector4d;
constexpr std::array<Vec6 ServoModel::*, 4> kParameters = {
    &ServoModel::extend, &ServoModel::retract, &ServoModel::tau, &ServoModel::delay};

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
ServoEstimate fit(const ServoModel& nominal, double period, double phase, const LegRecord& record) {
  constexpr int kTurns = 12, kBlocks = 10;
  // Steps of the differences: counts make the model's answer rough, so none is very small.
  const Parameters step(0.02, 0.02, 0.05, 0.0);
  constexpr double kDelayStep = 2e-4, kMostDelay = 0.02, kLeastTau = 1e-3;  // [s]
  const auto n = static_cast<Eigen::Index>(record.length.size());
  ServoEstimate out;
  out.servo = nominal;
  out.deviation = nominal;
  out.deviation.sensor_delay = out.deviation.sensor_scale = 0.0;  // not looked at
  for (int turn = 0; turn <= kTurns; ++turn) {
    const std::vector<Vec6> now = foretold(out.servo, period, phase, record);
    std::array<std::vector<Vec6>, 4> changed;
    std::array<Vec6, 4> by;
    for (std::size_t p = 0; p < 4; ++p) {
      ServoModel other = out.servo;
      const auto i = static_cast<Eigen::Index>(p);
      by[p] = p == 3 ? Vec6::Constant(kDelayStep) : Vec6(step(i) * out.servo.*kParameters[p]);
      other.*kParameters[p] += by[p];
      changed[p] = foretold(other, period, phase, record);
      other.*kParameters[p] -= 2.0 * by[p];
      if (p == 3) other.delay = other.delay.cwiseMax(0.0);
      const std::vector<Vec6> down = foretold(other, period, phase, record);
      by[p] = (out.servo.*kParameters[p] + by[p] - other.*kParameters[p]).eval();
      for (std::size_t k = 0; k < changed[p].size(); ++k) changed[p][k] -= down[k];
    }
    for (int leg = 0; leg < kLegs; ++leg) {
      Eigen::Matrix4d JJ = Eigen::Matrix4d::Zero();
      Eigen::Matrix<double, 4, kBlocks> Je = Eigen::Matrix<double, 4, kBlocks>::Zero();
      double squares = 0.0;
      for (std::size_t k = 0; k < now.size(); ++k) {
        Parameters J;
        for (std::size_t p = 0; p < 4; ++p)
          J(static_cast<Eigen::Index>(p)) = changed[p][k](leg) / by[p](leg);
        const double e = record.length[k](leg) - now[k](leg);
        JJ += J * J.transpose();
        Je.col(static_cast<Eigen::Index>(k * kBlocks / now.size())) += J * e;
        squares += e * e;
      }
      // In units of the parameters' own size, so that conditioning means something.
      const Parameters size(nominal.extend(leg), nominal.retract(leg), nominal.tau(leg), 1e-3);
      const Eigen::Matrix4d scaled = size.asDiagonal() * JJ * size.asDiagonal();
      const Eigen::VectorXd eigenvalues = symmetricEigenvalues(scaled);
      if (!(eigenvalues(0) > 1e-9 * eigenvalues(3)))
        throw std::domain_error("leg " + std::to_string(leg + 1) +
                                " moves too little to tell gains, lag and delay apart");
      out.residual(leg) = std::sqrt(squares / static_cast<double>(n));
      if (turn == kTurns) {
        // Residuals are correlated over many ticks, because counts are rounded and the model runs
        // by itself: the covariance is taken from sums over blocks (clustered sandwich estimator).
        const Eigen::Matrix<double, 4, kBlocks> by_block =
            size.asDiagonal() * solvePositive(scaled, size.asDiagonal() * Je);
        const Parameters deviation =
            by_block.rowwise().norm() * std::sqrt(kBlocks / (kBlocks - 1.0));
        for (std::size_t p = 0; p < 4; ++p)
          (out.deviation.*kParameters[p])(leg) = deviation(static_cast<Eigen::Index>(p));
        continue;
      }
      const Parameters change =
          size.asDiagonal() * solvePositive(scaled, size.asDiagonal() * Je.rowwise().sum());
      for (std::size_t p = 0; p < 4; ++p)
        (out.servo.*kParameters[p])(leg) += change(static_cast<Eigen::Index>(p));
      out.servo.tau(leg) = std::max(kLeastTau, out.servo.tau(leg));
      out.servo.delay(leg) = std::clamp(out.servo.delay(leg), 0.0, kMostDelay);
    }
  }
  return out;
}

}  // namespace

ServoEstimate identifyServo(const ServoModel& nominal, double period, const LegRecord& record) {
  if (record.length.size() < 50)
    throw std::domain_error("fewer than 50 ticks, want a run that moves the legs");
  constexpr std::array<double, 5> kPhases = {0.1, 0.3, 0.5, 0.7, 0.9};
  std::vector<ServoEstimate> all;
  for (const double phase : kPhases) all.push_back(fit(nominal, period, phase, record));
  ServoEstimate out = all.front();
  const double n = kPhases.size();
  out.residual.setZero();
  for (const ServoEstimate& one : all) out.residual += one.residual / n;
  for (const auto value : kParameters) {
    Vec6 mean = Vec6::Zero(), variance = Vec6::Zero();
    for (const ServoEstimate& one : all) mean += one.servo.*value / n;
    for (const ServoEstimate& one : all)
      variance += ((one.servo.*value - mean).cwiseAbs2() + (one.deviation.*value).cwiseAbs2()) / n;
    out.servo.*value = mean;
    out.deviation.*value = variance.cwiseSqrt();
  }
  return out;
}

}  // namespace ves
