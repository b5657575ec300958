// SPDX-License-Identifier: BSD-3-Clause
//
// What is known of the robot's masses and the sensor's bias together: a Gaussian, sharpened by the
// means of residuals (Kalman).
#pragma once

#include "ves/robot/mass_regressor.hpp"

namespace ves {

/// A mean of residuals over a block of time is y = columns * parameters + bias + (e - e_before) / T
/// + noise: what the legs' momentum is off by at a block's end, e, is independent of the others,
/// and what it adds to a block it takes from the next.
class MassBelief {
 public:
  static constexpr int kMost = kMaxMassParameters + 12;
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMost, 1>;
  using Covariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMost, kMost>;

  MassBelief() { begin(MassVector(0), 0.0, 0.0); }
  /// Deviations of the parameters, of a density common to all bodies that have one [-] besides, and
  /// of each channel's bias [count].
  void begin(const MassVector& deviations, double common, double bias) noexcept {
    const Eigen::Index n = deviations.size();
    x_.setZero(n + 12);
    P_.setZero(n + 12, n + 12);
    P_.diagonal().head(n) = deviations.cwiseAbs2();
    for (Eigen::Index i = 0; i < n; i += 4)
      for (Eigen::Index j = 0; j < n; j += 4)
        if (deviations(i) > 0.0 && deviations(j) > 0.0) P_(i, j) += common * common;
    P_.diagonal().segment<6>(n).setConstant(bias * bias);
  }

  auto parameters() const noexcept { return x_.head(size()); }
  auto covariance() const noexcept { return P_.topLeftCorner(size(), size()); }
  Vec6 bias() const noexcept { return x_.segment<6>(size()); }  // [count] beyond what is taken out

  /// Four parameters from `first` on may have changed, by so much.
  void doubt(Eigen::Index first, const Eigen::Vector4d& deviations) noexcept {
    P_.diagonal().segment<4>(first) += deviations.cwiseAbs2();
  }
  /// So may the bias of every channel. [count]
  void doubtBias(double deviation) noexcept {
    P_.diagonal().segment<6>(size()).array() += deviation * deviation;
  }
  /// The bias that is taken out has changed by so much. [count]
  void moveBias(const Vec6& by) noexcept { x_.segment<6>(size()) -= by; }

  /// [count] of y, what is not explained.
  Vec6 unexplained(const MassColumns& columns, const Vec6& y) const noexcept {
    Vec6 out = y - bias();
    out.noalias() -= columns * x_.head(size());
    return out;
  }
  /// [count^2] variance of that for want of knowledge.
  Vec6 variance(const MassColumns& columns) const noexcept {
    const Eigen::Index n = size();
    Vec6 out;
    for (int i = 0; i < 6; ++i) {
      const auto row = columns.row(i);
      MassVector carried(n);
      carried.noalias() = P_.topLeftCorner(n, n) * row.transpose();
      carried += 2.0 * P_.col(n + i).head(n);
      out(i) = row.dot(carried) + P_(n + i, n + i);
    }
    return out;
  }

  /// Blocks follow that have none before them, or none that is known; e has these variances
  /// [count^2 s^2].
  void beginBlocks(const Vec6& momentum) noexcept {
    x_.tail<6>().setZero();
    P_.rightCols<6>().setZero();
    P_.bottomRows<6>().setZero();
    P_.diagonal().tail<6>() = momentum;
  }
  /// The next block, of T [s]; `noise` [count^2], channel by channel.
  void learn(const MassColumns& columns, const Vec6& y, const Vec6& noise, const Vec6& momentum,
             double T) noexcept {
    constexpr double kColumns = 0.03;  // [-] by which the columns may be wrong, in what they tell
    const Eigen::Index n = size();
    for (int i = 0; i < 6; ++i) {
      const Eigen::Index last = n + 6 + i;
      State h = State::Zero(x_.size());
      h.head(n) = columns.row(i).transpose();
      h(n + i) = 1.0;
      h(last) = -1.0 / T;
      const State Ph = P_ * h;
      const double of_new = momentum(i) / T;
      const double s = (1.0 + kColumns * kColumns) * h.dot(Ph) + of_new / T + noise(i);
      if (!(s > 0.0)) continue;
      const double off = (y(i) - h.dot(x_)) / s;
      x_.noalias() += off * Ph;
      P_.noalias() -= Ph * (Ph.transpose() / s);
      // The new e in the old one's place.
      x_(last) = off * of_new;
      P_.col(last) = -(of_new / s) * Ph;
      P_.row(last) = P_.col(last).transpose();
      P_(last, last) = momentum(i) - of_new * of_new / s;
    }
  }
  /// y at rest, as by a calibration.
  void learnAtRest(const MassColumns& columns, const Vec6& y, const Vec6& noise) noexcept {
    beginBlocks(Vec6::Zero());
    learn(columns, y, noise, Vec6::Zero(), 1.0);
  }

 private:
  Eigen::Index size() const noexcept { return x_.size() - 12; }

  State x_;
  Covariance P_;
};

}  // namespace ves
