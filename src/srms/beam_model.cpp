// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/beam_model.hpp"

#include <cassert>

namespace ves {
namespace {

using Mat12 = Eigen::Matrix<double, 12, 12>;
using Mat4 = Eigen::Matrix4d;

/// Puts a plane's bending, of {w_a, phi_a, w_b, phi_b}, where its displacements and rotations are:
/// `w` and `phi` within {u, theta}; `sign` is that of phi = dw/dx beside the rotation's.
void addBending(Mat12& to, const Mat4& plane, int w, int phi, double sign) {
  const int at[] = {w, phi, w + 6, phi + 6};
  const double s[] = {1.0, sign, 1.0, sign};
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) to(at[i], at[j]) += s[i] * s[j] * plane(i, j);
}

/// `ends` on the diagonal of two ends' same displacement, `between` beside it.
void addPair(Mat12& to, int i, double ends, double between) {
  to(i, i) += ends;
  to(i + 6, i + 6) += ends;
  to(i, i + 6) += between;
  to(i + 6, i) += between;
}

enum { kX, kY, kZ, kTurnX, kTurnY, kTurnZ };

Mat12 assembled(double stretch_ends, double stretch_between, double twist_ends,
                double twist_between, const Mat4& bending) {
  Mat12 A = Mat12::Zero();
  addPair(A, kX, stretch_ends, stretch_between);
  addPair(A, kTurnX, twist_ends, twist_between);
  addBending(A, bending, kY, kTurnZ, 1.0);
  addBending(A, bending, kZ, kTurnY, -1.0);
  return A;
}

Mat12 beamStiffness(const BeamSection& s, double L) {
  Mat4 b;
  b << 12, 6 * L, -12, 6 * L,               //
      6 * L, 4 * L * L, -6 * L, 2 * L * L,  //
      -12, -6 * L, 12, -6 * L,              //
      6 * L, 2 * L * L, -6 * L, 4 * L * L;
  return assembled(s.EA / L, -s.EA / L, s.GJ / L, -s.GJ / L, s.EI / (L * L * L) * b);
}

Mat12 beamMass(const BeamSection& s, double L) {
  const double m = s.mass_per_length * L, twist = m * s.radius * s.radius;
  Mat4 b;
  b << 156, 22 * L, 54, -13 * L,              //
      22 * L, 4 * L * L, 13 * L, -3 * L * L,  //
      54, 13 * L, 156, -22 * L,               //
      -13 * L, -3 * L * L, -22 * L, 4 * L * L;
  return assembled(m / 3, m / 6, twist / 3, twist / 6, m / 420 * b);
}

/// Axes with x along the beam; a round section does not care about the others.
Mat3 along(const Vec3& x) {
  Mat3 R;
  R.col(0) = x.normalized();
  R.col(1) = R.col(0).unitOrthogonal();
  R.col(2) = R.col(0).cross(R.col(1));
  return R;
}

}  // namespace

int BeamModel::grow() {
  const Eigen::Index n = M_.rows();
  for (Eigen::MatrixXd* A : {&M_, &K_}) {
    A->conservativeResize(n + 1, n + 1);
    A->row(n).setZero();
    A->col(n).setZero();
  }
  return static_cast<int>(n);
}

BeamModel::Point BeamModel::node(const Vec3& p_A) {
  Point point{p_A, {}};
  for (int i = 0; i < 6; ++i) point.shares.push_back({grow(), Vec6::Unit(i)});
  return point;
}

BeamModel::Point BeamModel::hinge(const Point& near, const Vec3& axis_A, double stiffness) {
  Point far = near;
  const int dof = grow();
  Vec6 turn = Vec6::Zero();
  turn.tail<3>() = axis_A;
  far.shares.push_back({dof, turn});
  K_(dof, dof) += stiffness;
  return far;
}

void BeamModel::add(Eigen::MatrixXd& to, const Point& a, const Point& b, const Mat6& block) {
  for (const Point::Share& i : a.shares)
    for (const Point::Share& j : b.shares)
      to(i.dof, j.dof) += i.displacement.dot(block * j.displacement);
}

void BeamModel::beam(const Point& a, const Point& b, const BeamSection& section) {
  const double L = (b.p - a.p).norm();
  assert(L > 0.0);
  const Mat3 R = along(b.p - a.p);
  Mat12 T = Mat12::Zero();  // from A's axes to the beam's
  for (int i = 0; i < 4; ++i) T.block<3, 3>(3 * i, 3 * i) = R.transpose();
  const Mat12 K = T.transpose() * beamStiffness(section, L) * T;
  const Mat12 M = T.transpose() * beamMass(section, L) * T;
  const Point* ends[] = {&a, &b};
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      add(K_, *ends[i], *ends[j], K.block<6, 6>(6 * i, 6 * j));
      add(M_, *ends[i], *ends[j], M.block<6, 6>(6 * i, 6 * j));
    }
}

void BeamModel::lump(const Point& at, const RigidBody& body_A) {
  add(M_, at, at, spatialMass(body_A));
}

Eigen::MatrixXd BeamModel::displacement(const Point& at) const {
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(6, dofs());
  for (const Point::Share& s : at.shares) D.col(s.dof) += s.displacement;
  return D;
}

}  // namespace ves
