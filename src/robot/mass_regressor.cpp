// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/mass_regressor.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

/// Mass, first moment and inertia about the link's origin: what momentum and weight are linear in.
struct Moments {
  double mass = 0.0;      // [kg]
  Vec3 s = Vec3::Zero();  // [kg m]
  Mat3 I = Mat3::Zero();  // [kg m^2]
};

Moments momentsOf(const RigidBody& body) {
  const Vec3& c = body.p_BoBcm_B;
  return {body.mass, body.mass * c,
          body.I_Bcm_B + body.mass * (c.squaredNorm() * Mat3::Identity() - c * c.transpose())};
}

/// Per parameter: of density, or of a shift of the centre along an axis, as far as linear.
Moments momentsPer(const RigidBody& body, int parameter) {
  if (parameter == 0) return momentsOf(body);
  const Vec3 e = Vec3::Unit(parameter - 1), &c = body.p_BoBcm_B;
  return {0.0, body.mass * e,
          body.mass *
              (2.0 * c(parameter - 1) * Mat3::Identity() - e * c.transpose() - c * e.transpose())};
}

}  // namespace

MassRegressor::MassRegressor(const RobotModel& robot, const Hand& hand) : robot_(robot) {
  std::array<int, kMaxLinks + 1> all{};
  int size = 0;
  for (int i = -1; i < robot.size; ++i)
    if (robot_.bodyOf(i).mass > 0.0) all[static_cast<std::size_t>(size++)] = i;
  std::stable_sort(all.begin(), all.begin() + size,
                   [&](int a, int b) { return robot_.bodyOf(a).mass > robot_.bodyOf(b).mass; });
  count_ = std::min(size, kMaxUncertain - 1);
  std::sort(all.begin(), all.begin() + count_);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    links_[i] = all[i];
    body_[i] = robot_.bodyOf(all[i]);
  }
  if (hand.link < -1) return;
  hand_ = 4 * count_;
  links_[static_cast<std::size_t>(count_)] = hand.link;
  body_[static_cast<std::size_t>(count_++)] = {1.0, hand.p_LT_L, Mat3::Zero()};
}

MassVector MassRegressor::deviations(double share) const noexcept {
  MassVector out(size());
  for (int i = 0; i < count_; ++i) {
    if (4 * i == hand_) share = 0.0;  // the last
    out(4 * i) = share;
    out.segment<3>(4 * i + 1).setConstant(share *
                                          body_[static_cast<std::size_t>(i)].p_BoBcm_B.norm());
  }
  return out;
}

void MassRegressor::evaluate(const Transform& X_PL0, const Vec3& g_I, const State& at,
                             MassColumns& momentum, MassColumns& weight) const noexcept {
  // Motion of each link on a base at rest, in its own axes.
  std::array<Mat3, kMaxLinks> R;        // link in L0
  std::array<Vec3, kMaxLinks> p, v, w;  // origin in L0
  const auto links = static_cast<std::size_t>(robot_.size);
  for (std::size_t k = 0; k < links; ++k) {
    const Link& link = robot_.links[k];
    const double rate = link.ratio * at.q_dot(link.joint);
    setLinkPose(link, link.at(at.q(link.joint)), R[k], p[k]);
    if (link.parent < 0) {
      w[k].setZero();
      v[k].setZero();
    } else {
      const auto c = static_cast<std::size_t>(link.parent);
      w[k] = R[k].transpose() * w[c];
      v[k] = R[k].transpose() * (v[c] + w[c].cross(p[k]));
      p[k] = p[c] + R[c] * p[k];
      R[k] = (R[c] * R[k]).eval();
    }
    (link.type == JointType::kRevolute ? w[k] : v[k]) += rate * link.axis;
  }

  momentum.resize(6, size());
  weight.resize(6, size());
  const Transform X_IL0{at.R_IP * X_PL0.R, at.R_IP * X_PL0.p};  // about Po
  for (int i = 0; i < count_; ++i) {
    const int link = links_[static_cast<std::size_t>(i)];
    const RigidBody& body = body_[static_cast<std::size_t>(i)];
    const auto k = static_cast<std::size_t>(std::max(0, link));
    const Transform X_IL = link < 0 ? X_IL0 : Transform{X_IL0.R * R[k], X_IL0.p + X_IL0.R * p[k]};
    const Mat3 R_LI = X_IL.R.transpose();
    Vec3 turns = R_LI * at.w, moves = R_LI * (at.v + at.w.cross(X_IL.p));
    if (link >= 0) {
      turns += w[k];
      moves += v[k];
    }
    const Vec3 g = R_LI * g_I;
    for (int j = 0; j < 4; ++j) {
      const Moments m = momentsPer(body, j);
      const auto set = [&](MassColumns& columns, const Vec3& linear, const Vec3& angular) {
        const Vec3 f = X_IL.R * linear;
        columns.col(4 * i + j) << f, X_IL.R * angular + X_IL.p.cross(f);
      };
      set(momentum, m.mass * moves + turns.cross(m.s), m.I * turns + m.s.cross(moves));
      set(weight, m.mass * g, m.s.cross(g));
    }
  }
}

BodyMasses MassRegressor::described(const MassVector& parameters,
                                    const MassCovariance& P) const noexcept {
  BodyMasses out;
  for (int i = 0; i < count_; ++i) {
    const RigidBody& body = body_[static_cast<std::size_t>(i)];
    const bool in_hand = 4 * i == hand_;  // nobody told of it: only what was found is there
    const Eigen::Vector4d found = parameters.segment<4>(4 * i);
    const Eigen::Matrix4d of = P.block<4, 4>(4 * i, 4 * i);
    const Vec3 c = in_hand ? Vec3(Vec3::Zero()) : body.p_BoBcm_B;
    out.mass(i) = body.mass * ((in_hand ? 0.0 : 1.0) + found(0));
    out.mass_deviation(i) = body.mass * std::sqrt(std::max(0.0, of(0, 0)));
    for (int k = 0; k < 3; ++k) {
      const double variance = c(k) * c(k) * of(0, 0) + 2.0 * c(k) * of(0, k + 1) + of(k + 1, k + 1);
      out.moment(3 * i + k) = out.mass(i) * c(k) + body.mass * found(k + 1);
      out.moment_deviation(3 * i + k) = body.mass * std::sqrt(std::max(0.0, variance));
    }
  }
  return out;
}

RobotModel MassRegressor::changed(const MassVector& parameters) const noexcept {
  RobotModel out = robot_;
  for (int i = 0; i < count_; ++i) {
    RigidBody& carrier = out.bodyOf(links_[static_cast<std::size_t>(i)]);
    Moments sum = momentsOf(carrier);
    for (int j = 0; j < 4; ++j) {
      const Moments m = momentsPer(body_[static_cast<std::size_t>(i)], j);
      const double by = parameters(4 * i + j);
      sum.mass += by * m.mass;
      sum.s += by * m.s;
      sum.I += by * m.I;
    }
    if (!(sum.mass > 0.0)) continue;
    const Vec3 c = sum.s / sum.mass;
    carrier = {sum.mass, c,
               sum.I - sum.mass * (c.squaredNorm() * Mat3::Identity() - c * c.transpose())};
  }
  return out;
}

}  // namespace ves
