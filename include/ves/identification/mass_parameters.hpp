// SPDX-License-Identifier: BSD-3-Clause
//
// Mass parameters of a robot from static wrenches (Appendix B). Every body has four, its mass and
// its first moment about the origin of its own frame, {m, m x, m y, m z}; an n-joint robot has
// 4(n+1), link 0 first. The static wrench is linear in them, so forces and all three moments are
// used, where (B.8) stacks two moments and inverts. Only combinations of them can be told apart.
#pragma once

#include <string>
#include <vector>

#include "ves/robot/robot_model.hpp"

namespace ves {

/// 4(n+1): {m, m x, m y, m z} of link 0, then of every link. [kg, kg m]
Eigen::VectorXd massParameters(const RobotModel& robot);

/// 6 x 4(n+1): the static wrench F_Bo_B that the robot, its base link posed in B and gravity g_B,
/// puts on B is this times massParameters(). (B.7) for all six components, its indices set right.
Eigen::MatrixXd staticRegressor(const RobotModel& robot, const Transform& X_BL0,
                                const JointVector& q, const Vec3& g_B);

/// What a robot's static wrench can tell of its parameters.
struct SeparableCombinations {
  Eigen::MatrixXd C;               // r x 4(n+1), beta = C * parameters [kg, kg m]
  std::vector<int> leads;          // r: the parameter that leads each, with coefficient 1
  std::vector<std::string> names;  // r: "m1 y1 - m2 z2 + 0.2435 (m2 + m3)"

  Eigen::Index rank() const { return C.rows(); }
};

/// By the singular values of the regressor over many poses, which decide the rank. Parameters
/// nearer the base lead; what cannot be told from them is added to them. On a base that tilts about
/// two axes.
SeparableCombinations separableCombinations(const RobotModel& robot);

/// The sensor's reading at rest.
struct StaticInterval {
  double t = 0.0;                       // [s] middle
  double duration = 0.0;                // [s]
  JointVector q = JointVector::Zero();  // [rad | m]
  Vec3 rpy = Vec3::Zero();              // [rad] of the platform, measured
  Vec6 counts = Vec6::Zero();           // [count] mean
};

struct MassEstimate {
  Eigen::VectorXd beta;                // of SeparableCombinations [kg, kg m]
  Eigen::VectorXd standard_deviation;  // of each
  /// How many times larger than if all else were known. Poorly observed above kMixed.
  Eigen::VectorXd inflation;
  Vec6 bias = Vec6::Zero();        // [count] in the middle of the rests
  Vec6 bias_drift = Vec6::Zero();  // [count/s]
  Vec6 residual = Vec6::Zero();    // [count] rms of a channel, degrees of freedom allowed for
  double condition = 0.0;          // [-] of the scaled regressor
  double deviation = 0.0;          // [-] standard, of the weight's readings, as a share of them
  static constexpr double kMixed = 10.0;
};

/// What stands still: the sensor and how robot and gravity meet it.
struct StaticSetup {
  RobotModel robot;  // kinematics; the plates count into link 0
  Transform X_SL0;   // of the robot's base link in the sensor
  Mat3 R_PS;         // of the sensor's axes in the platform
  Mat6 S_proc;       // [count/N | count/(N m)]
  Vec3 g_I;          // [m/s^2]
};

/// Regressor of a rest's counts: 6 x 4(n+1).
Eigen::MatrixXd countRegressor(const StaticSetup& setup, const JointVector& q, const Vec3& rpy);

/// Weighted least squares for the combinations, six biases and their drift in time;
/// channels weigh by their own residual. Throws std::domain_error when the rests are too few or do
/// not determine them.
MassEstimate estimateMasses(const StaticSetup& setup, const SeparableCombinations& combinations,
                            const std::vector<StaticInterval>& rests);

/// A full set of parameters that has these combinations: masses that are told only together share
/// their sum as in `prior` (equally when it has none), and so do their first moments; what leads a
/// combination takes what is left. The
/// same static wrench in every pose; single values mean little.
Eigen::VectorXd completed(const SeparableCombinations& combinations, const Eigen::VectorXd& beta,
                          const Eigen::VectorXd& prior);

}  // namespace ves
