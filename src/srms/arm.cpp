// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/arm.hpp"

#include <algorithm>
#include <cmath>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

/// Builds the frame from root to tip.
struct Builder {
  double scale;
  BeamModel frame;
  Transform X_AB;  // the axes that the next part is given in
  BeamModel::Point at = BeamModel::ground(Vec3::Zero());
  std::vector<BeamModel::Point> ends = {at};

  void operator()(const ArmJoint& joint) {
    const Vec3 axis_A = X_AB.R * joint.axis;
    at = frame.hinge(at, axis_A, scale * joint.stiffness);
    X_AB.R = X_AB.R * Eigen::AngleAxisd(joint.angle, joint.axis).toRotationMatrix();
  }
  void operator()(const ArmBeam& beam) {
    BeamSection section = beam.section;
    section.EI *= scale;
    section.GJ *= scale;
    section.EA *= scale;
    for (int i = 0; i < beam.elements; ++i) {
      X_AB.p = X_AB * Vec3(beam.to / beam.elements);
      const BeamModel::Point next = frame.node(X_AB.p);
      frame.beam(at, next, section);
      at = next;
      ends.push_back(at);
    }
  }
  void operator()(const ArmHousing& housing) { frame.lump(at, rotated(X_AB.R, housing.body)); }
};

}  // namespace

ArmModel assemble(const ArmDescription& arm) {
  Builder build{arm.stiffness_scale, {}, {}};
  for (const ArmPart& part : arm.chain) std::visit(build, part);
  const Transform X_AP{build.X_AB.R * arm.R_TP, build.X_AB.p};
  build.frame.lump(build.at, rotated(X_AP.R, arm.payload_P));
  return {build.frame, build.at, X_AP, build.ends};
}

Eigen::MatrixXd tipDisplacement(const ArmModel& arm) {
  Eigen::MatrixXd D = arm.frame.displacement(arm.tip);
  const Mat3 R_PA = arm.X_AP.R.transpose();
  D.topRows<3>() = R_PA * D.topRows<3>();
  D.bottomRows<3>() = R_PA * D.bottomRows<3>();
  return D;
}

Mat6 tipCompliance(const ArmModel& arm) {
  const Eigen::MatrixXd D = tipDisplacement(arm);
  return D * solvePositive(arm.frame.K(), D.transpose());
}

Vec6 masslessFrequencies(const ArmModel& arm, const RigidBody& payload_P) {
  const Mat6 K = inverse(tipCompliance(arm));
  return eigenmodes(spatialMass(payload_P), 0.5 * (K + K.transpose())).stiffness.cwiseSqrt() /
         (2.0 * M_PI);
}

ArmModes armModes(const ArmModel& arm, double damping_ratio, int keep) {
  Eigenmodes modes = eigenmodes(arm.frame.M(), arm.frame.K());
  const Eigen::Index k =
      keep ? std::min<Eigen::Index>(keep, modes.stiffness.size()) : modes.stiffness.size();
  ArmModes out;
  out.tip.Phi = tipDisplacement(arm) * modes.shapes.leftCols(k);
  out.tip.stiffness = modes.stiffness.head(k);
  out.tip.damping = (2.0 * damping_ratio * out.tip.stiffness.cwiseSqrt()).asDiagonal();
  for (Eigen::Index i = 0; i < k; ++i) {  // a mode has no sign of its own: largest entry positive
    Eigen::Index largest = 0;
    out.tip.Phi.col(i).cwiseAbs().maxCoeff(&largest);
    if (out.tip.Phi(largest, i) >= 0.0) continue;
    out.tip.Phi.col(i) *= -1.0;
    modes.shapes.col(i) *= -1.0;
  }
  const Transform X_PA = inverse(arm.X_AP);
  for (const BeamModel::Point& end : arm.ends) {
    out.shape.points.push_back(X_PA * end.p);
    out.shape.displacements.push_back(X_PA.R * arm.frame.displacement(end).topRows<3>() *
                                      modes.shapes.leftCols(k));
  }
  return out;
}

}  // namespace ves
