// SPDX-License-Identifier: BSD-3-Clause
//
// Inverse and forward kinematics of a hexapod of one's own.
#include <cmath>
#include <cstdio>
#include <ves/kinematics/stewart.hpp>

int main() {
  // Ball joints 15 degrees beside 0, 120 and 240 below, beside 60, 180 and 300 above.
  ves::Geometry hexapod;
  hexapod.home_height = 0.12;  // [m]
  for (int i = 0; i < ves::kLegs; ++i) {
    const double side = i % 2 == 0 ? 1.0 : -1.0, middle = 120.0 * (i / 2),
                 below = (middle + 15.0 * side) * M_PI / 180.0,
                 above = (middle + 45.0 * side) * M_PI / 180.0;
    const auto k = static_cast<std::size_t>(i);
    hexapod.p_IBi_I[k] = {0.10 * std::cos(below), 0.10 * std::sin(below), 0.0};
    hexapod.p_PPi_P[k] = {0.06 * std::cos(above), 0.06 * std::sin(above), 0.0};
  }

  const ves::Pose pose{{0.005, -0.010, 0.008}, {0.05, -0.03, 0.10}};  // [m], [rad] about home
  const ves::Vec6 L = ves::legLengths(hexapod, hexapod.fromHome(pose));
  const ves::ForwardSolution found = ves::forwardPose(hexapod, L, hexapod.fromHome({}));
  if (!found.ok()) return 1;
  const ves::Vec6 back = hexapod.toHome(found.X_IP).stacked();
  for (int i = 0; i < ves::kLegs; ++i)
    std::printf("leg %d %8.3f mm    coordinate %d %10.6f, found again %10.6f\n", i + 1, 1e3 * L(i),
                i + 1, pose.stacked()(i), back(i));
  std::printf("%d steps, conditioned %.1f\n", found.iterations,
              ves::conditionNumber(hexapod, found.X_IP));
  return (back - pose.stacked()).norm() < 1e-8 ? 0 : 1;
}
