// SPDX-License-Identifier: BSD-3-Clause
//
// A space frame of beams, hinges and rigid bodies, as mass and stiffness matrices: the kind of
// model that NASTRAN made of the SRMS for the report.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "ves/robot/robot_model.hpp"

namespace ves {

/// A round tube: the same in every direction across.
struct BeamSection {
  double EI = 0.0;               // [N m^2] bending
  double GJ = 0.0;               // [N m^2] torsion
  double EA = 0.0;               // [N] stretch
  double mass_per_length = 0.0;  // [kg/m]
  double radius = 0.0;           // [m] of the wall; its mass resists torsion with m r^2

  bool operator==(const BeamSection&) const = default;
};

/// A frame under construction. Everything is expressed in one set of axes, A; small displacements
/// {u, theta} in m and rad.
class BeamModel {
 public:
  /// Something that moves, and can carry: a point p_A with displacements {u, theta} that are a
  /// linear combination of degrees of freedom. Of the ground, of none.
  struct Point {
    struct Share {
      int dof;
      Vec6 displacement;
    };
    Vec3 p;
    std::vector<Share> shares;
  };

  static Point ground(const Vec3& p_A) { return {p_A, {}}; }

  /// A node with six degrees of freedom.
  Point node(const Vec3& p_A);

  /// The far side of a hinge about `axis_A` (a unit vector) with a torsional spring [N m/rad]:
  /// moves with the near side but for one degree of freedom, so nothing has to be "very stiff".
  Point hinge(const Point& near, const Vec3& axis_A, double stiffness);

  /// Euler-Bernoulli beam with consistent mass; no shear, no rotary inertia across.
  void beam(const Point& a, const Point& b, const BeamSection& section);

  /// A body whose centre and inertia are given in A, from the point.
  void lump(const Point& at, const RigidBody& body_A);

  int dofs() const { return static_cast<int>(M_.rows()); }
  const Eigen::MatrixXd& M() const { return M_; }  // kg, kg m, kg m^2
  const Eigen::MatrixXd& K() const { return K_; }  // N/m, N, N m/rad

  /// 6 x dofs(): displacement of a point for each degree of freedom.
  Eigen::MatrixXd displacement(const Point& at) const;

 private:
  int grow();
  static void add(Eigen::MatrixXd& to, const Point& a, const Point& b, const Mat6& block);

  Eigen::MatrixXd M_, K_;
};

}  // namespace ves
