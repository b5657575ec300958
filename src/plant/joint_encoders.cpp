// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/joint_encoders.hpp"

#include <cmath>

namespace ves::plant {

JointVector JointEncoders::read(const JointVector& q) noexcept {
  if (model_.exact()) return q;
  const JointVector half = 0.5 * model_.play;
  turned_ = turned_.cwiseMax(q - half).cwiseMin(q + half).eval();
  JointVector out = turned_;
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    if (model_.noise(i) > 0.0) out(i) += model_.noise(i) * noise_.normal();
    const double count = model_.count(i);
    if (count > 0.0) out(i) = count * std::round(out(i) / count);
  }
  return out;
}

}  // namespace ves::plant
