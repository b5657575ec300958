// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/wrench_filter.hpp"

#include <cmath>

namespace ves {

Vec6 WrenchFilterSettings::passes(double period) const noexcept {
  Vec6 out = Vec6::Ones();
  for (int i = 0; i < 6; ++i)
    if (low_pass(i) > 0.0) out(i) = -std::expm1(-2.0 * M_PI * low_pass(i) * period);
  return out;
}

Wrench WrenchFilter::update(const Wrench& F_Po_I) noexcept {
  if (!settings_.any()) return F_Po_I;
  const Vec6 F = F_Po_I.stacked();
  if (!F.allFinite()) {
    reset();
    return F_Po_I;
  }
  low_ = begun_ ? Vec6(low_ + passes_.cwiseProduct(F - low_)) : F;
  begun_ = true;
  Vec6 out;
  for (int i = 0; i < 6; ++i) {
    const double beyond = std::abs(low_(i)) - settings_.dead_band(i);
    out(i) = beyond > 0.0 ? std::copysign(beyond, low_(i)) : 0.0;
  }
  return Wrench::from(out);
}

Mat6 WrenchFilter::noise(const Mat6& covariance) const noexcept {
  const Vec6 passes = (settings_.dead_band.array() > 0.0).select(Vec6::Zero(), Vec6::Ones());
  return passes.asDiagonal() * covariance * passes.asDiagonal();
}

}  // namespace ves
