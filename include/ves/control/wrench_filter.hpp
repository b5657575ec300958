// SPDX-License-Identifier: BSD-3-Clause
//
// Dead band and low-pass of the wrench that the admittance model takes, each component of F_Po_I
// for itself. Beyond the report, and off by default: what they cost in time and truth is in the
// stability check.
#pragma once

#include "ves/math/frames.hpp"

namespace ves {

struct WrenchFilterSettings {
  Vec6 dead_band = Vec6::Zero();  // [N | N m] below which a component counts as none; 0: none
  Vec6 low_pass = Vec6::Zero();   // [Hz] of the first order; 0: none

  bool any() const noexcept { return !dead_band.isZero(0.0) || !low_pass.isZero(0.0); }
  /// [-] of a new value that the low-pass lets through in a period [s], exact for a held input.
  Vec6 passes(double period) const noexcept;
};

class WrenchFilter {
 public:
  WrenchFilter(const WrenchFilterSettings& settings, double period) noexcept
      : settings_(settings), passes_(settings.passes(period)) {}

  /// Once a tick. The dead band takes its width from what is beyond it, so that nothing leaps. A
  /// wrench that is not finite passes as it is, and is forgotten.
  Wrench update(const Wrench& F_Po_I) noexcept;
  void reset() noexcept { begun_ = false; }

  /// Of noise of this covariance. What a low-pass takes from it in a sample it spreads over others;
  /// in a dead band it is lost.
  Mat6 noise(const Mat6& covariance) const noexcept;

 private:
  WrenchFilterSettings settings_;
  Vec6 passes_;
  bool begun_ = false;
  Vec6 low_ = Vec6::Zero();
};

}  // namespace ves
