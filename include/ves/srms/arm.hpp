// SPDX-License-Identifier: BSD-3-Clause
//
// An arm as a chain of joints, beams and housings; the SRMS is one (config/arms/srms.yaml). Frames:
// A at the arm's root, T at its tip, P at the tip with the axes of the platform that will pretend
// to be it.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "ves/srms/beam_model.hpp"
#include "ves/srms/modes.hpp"

namespace ves {

struct ArmJoint {
  std::string name;
  Vec3 axis = Vec3::UnitZ();  // [-] unit vector
  double angle = 0.0;         // [rad] locked there, with a spring
  double stiffness = 0.0;     // [N m/rad]

  bool operator==(const ArmJoint&) const = default;
};

struct ArmBeam {
  Vec3 to = Vec3::Zero();  // [m] its far end from its near one
  BeamSection section;
  int elements = 1;  // [-]

  bool operator==(const ArmBeam&) const = default;
};

struct ArmHousing {
  RigidBody body;

  bool operator==(const ArmHousing&) const = default;
};

/// Parts from root to tip, each in the axes that the joints before it leave.
using ArmPart = std::variant<ArmJoint, ArmBeam, ArmHousing>;

struct ArmDescription {
  std::vector<ArmPart> chain;
  double stiffness_scale = 1.0;  // [-] of every spring and beam
  double damping_ratio = 0.0;    // [-] zeta of every mode
  Mat3 R_TP = Mat3::Identity();
  RigidBody payload_P;  // carried at the tip beside what the platform carries

  bool operator==(const ArmDescription&) const = default;
};

struct ArmModel {
  BeamModel frame;
  BeamModel::Point tip;
  Transform X_AP;
  std::vector<BeamModel::Point> ends;  // of the beams' elements, the root first
};
ArmModel assemble(const ArmDescription& arm);

/// D in {u, theta}_P = D q, for q the frame's degrees of freedom; 6 x n.
Eigen::MatrixXd tipDisplacement(const ArmModel& arm);

/// What a unit wrench at Po does there, in P; m/N, rad/N, rad/(N m).
Mat6 tipCompliance(const ArmModel& arm);

/// [Hz] of a payload on the arm's compliance, the arm's own mass ignored.
Vec6 masslessFrequencies(const ArmModel& arm, const RigidBody& payload_P);

/// The line of an arm, in P where the tip is at rest: bent by eta, point i is at
/// points[i] + displacements[i] eta.
struct ArmShape {
  std::vector<Vec3> points;                     // [m] root first
  std::vector<Eigen::Matrix3Xd> displacements;  // [m] a modal coordinate, 3 x k
};

struct ArmModes {
  ModalModel tip;  // shapes of the tip, in P
  ArmShape shape;  // by the same coordinates
};

/// The softest `keep` modes (all when 0). Throws std::domain_error when something of the frame has
/// no mass.
ArmModes armModes(const ArmModel& arm, double damping_ratio, int keep = 0);

}  // namespace ves
