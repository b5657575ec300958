// SPDX-License-Identifier: BSD-3-Clause
#include "ves/planning/tool_planner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <kdl/chain.hpp>
#include <kdl/chainiksolverpos_lma.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <kdl/path_circle.hpp>
#include <kdl/path_line.hpp>
#include <kdl/rotational_interpolation_sa.hpp>
#include <kdl/velocityprofile_trap.hpp>
#include <random>

#include "ves/core/errors.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr double kStep = 0.02;       // [s] between the ends of pieces
constexpr double kMostPieces = 2e3;  // [-] of each part of the profile
constexpr double kOnPath = 1e-9;     // [m | rad]
constexpr int kCorrections = 10;     // [-] of Newton's
constexpr double kReached = 1e-6;    // [m | rad]
constexpr int kStarts = 32;          // [-] of the search for a pose of the joints
constexpr double kShort = 1e-9;      // [m | rad]

KDL::Vector toKdl(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

KDL::Frame toKdl(const Transform& X) {
  const Mat3& R = X.R;
  return {KDL::Rotation(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1),
                        R(2, 2)),
          toKdl(X.p)};
}

Transform fromKdl(const KDL::Frame& F) {
  Transform X;
  for (int i = 0; i < 3; ++i) {
    X.p(i) = F.p(i);
    for (int k = 0; k < 3; ++k) X.R(i, k) = F.M(i, k);
  }
  return X;
}

Vec6 fromKdl(const KDL::Twist& t) {
  return (Vec6() << t.vel(0), t.vel(1), t.vel(2), t.rot(0), t.rot(1), t.rot(2)).finished();
}

/// [m, rad] from one pose to another, in their common axes.
Vec6 between(const Transform& from, const Transform& to) {
  const Eigen::AngleAxisd turn(Mat3(to.R * from.R.transpose()));
  return (Vec6() << to.p - from.p, turn.angle() * turn.axis()).finished();
}

std::unique_ptr<KDL::Path> lineOf(const Transform& from, const Transform& to) {
  // A translation sets the pace. A path that only turns is as long as its angle.
  const double radius = (to.p - from.p).norm() > kShort ? kShort : 1.0;
  return std::make_unique<KDL::Path_Line>(toKdl(from), toKdl(to),
                                          new KDL::RotationalInterpolation_SingleAxis(), radius);
}

/// Through `via`, which is met before the end.
std::unique_ptr<KDL::Path> arcOf(const Transform& from, const Vec3& via, const Transform& to) {
  const Vec3 a = via - from.p, b = to.p - from.p, n = a.cross(b);
  if (!(n.norm() > 1e-6 * a.norm() * b.norm()) || !((to.p - via).norm() > kShort))
    throw InputError("its start, via and its end are on one line, want three points of an arc");
  const Vec3 centre = from.p + (a.squaredNorm() * b.cross(n) + b.squaredNorm() * n.cross(a)) /
                                   (2.0 * n.squaredNorm());
  const Vec3 x = from.p - centre, end = to.p - centre, ahead = n.normalized().cross(x);
  double angle = std::atan2(end.dot(ahead), end.dot(x));
  if (angle <= 0.0) angle += 2.0 * M_PI;
  return std::make_unique<KDL::Path_Circle>(toKdl(from), toKdl(centre), toKdl(Vec3(centre + ahead)),
                                            toKdl(to).M, angle,
                                            new KDL::RotationalInterpolation_SingleAxis(), kShort);
}

}  // namespace

Transform baseIn(ToolOrder::Frame frame, const Transform& X_IP, const Transform& X_PL0) {
  switch (frame) {
    case ToolOrder::Frame::kPlatform: return X_PL0;
    case ToolOrder::Frame::kInertial: return X_IP * X_PL0;
    default: return {};
  }
}

ToolGoal goalOf(const ToolOrder& order, const Transform& X_FL0, const Transform& X_L0T) {
  const Transform X_FT = X_FL0 * X_L0T, X_L0F = inverse(X_FL0);
  const Vec3 from = order.by ? X_FT.p : Vec3(Vec3::Zero());
  Transform end = X_FT;
  if (order.position) end.p = from + *order.position;
  if (order.rpy) end.R = order.by ? Mat3(rotation(*order.rpy) * X_FT.R) : rotation(*order.rpy);
  ToolGoal goal{X_L0F * end, {}, order.duration, order.speed};
  if (order.via) goal.via_L0 = X_L0F * Vec3(from + *order.via);
  return goal;
}

class ToolPlanner::Impl {
 public:
  Impl(const RobotModel& robot, int link, const Transform& X_LinkT, const JointVector& fastest,
       const std::vector<std::string>& names, double singular)
      : robot_(robot),
        link_(link),
        X_LinkT_(X_LinkT),
        fastest_(fastest),
        names_(names),
        singular_(singular) {
    std::vector<int> way;
    for (int i = link; i >= 0; i = robot.link(i).parent) way.insert(way.begin(), i);
    if (way.empty()) throw InputError("no joint moves the tool");
    for (const int i : way) {
      const Link& l = robot.link(i);
      if (robot.own[static_cast<std::size_t>(l.joint)] != i)
        throw InputError(
            fmt::format("what follows joint '{}' moves the tool too, which no path is planned for",
                        nameOf(l.joint)));
      joints_.push_back(l.joint);
      const auto type =
          l.type == JointType::kRevolute ? KDL::Joint::RotAxis : KDL::Joint::TransAxis;
      chain_.addSegment(KDL::Segment(KDL::Joint(nameOf(l.joint), toKdl(l.X_parent.p),
                                                toKdl(Vec3(l.X_parent.R * l.axis)), type),
                                     toKdl(l.X_parent)));
      reach_ += l.X_parent.p.norm();
    }
    reach_ += X_LinkT.p.norm();
    if (!(reach_ > kShort)) reach_ = 1.0;
    chain_.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), toKdl(X_LinkT)));
    jacobian_solver_ = std::make_unique<KDL::ChainJntToJacSolver>(chain_);
  }

  Transform pose(const JointVector& q) const {
    return link_ < 0 ? X_LinkT_ : linkPoses(robot_, q)[link_] * X_LinkT_;
  }

  std::optional<JointVector> inverse(const Transform& X, const JointVector& near) const {
    KDL::ChainIkSolverPos_LMA solver(chain_, 1e-9, 200);
    std::mt19937 random(1);
    std::optional<JointVector> best;
    KDL::JntArray start = arrayOf(near), found = start;
    for (int i = 0; i < kStarts; ++i) {
      solver.CartToJnt(start, toKdl(X), found);
      const JointVector q = insideLimits(found, near);
      if (between(pose(q), X).cwiseAbs().maxCoeff() <= kReached && !outside(q) &&
          (!best || (q - near).norm() < (*best - near).norm()))
        best = q;
      for (std::size_t k = 0; k < joints_.size(); ++k) {
        const Link& l = linkOf(joints_[k]);
        const double least = std::max(l.lower, -M_PI), most = std::min(l.upper, M_PI);
        start(static_cast<unsigned>(k)) =
            least < most ? std::uniform_real_distribution<double>(least, most)(random) : l.lower;
      }
    }
    return best;
  }

  JointTrajectory plan(const JointVector& q0, const ToolGoal& goal) const {
    const Transform from = pose(q0);
    const std::unique_ptr<KDL::Path> path =
        goal.via_L0 ? arcOf(from, *goal.via_L0, goal.X_L0T) : lineOf(from, goal.X_L0T);
    const double length = path->PathLength();
    if (!(length > kShort)) throw InputError("the tool is there already");
    if (!(goal.duration > 0.0) && !((goal.X_L0T.p - from.p).norm() > kShort))
      throw InputError("the tool only turns, want duration_s");
    const double duration =
        goal.duration > 0.0 ? goal.duration : length / (goal.speed * (1.0 - kRamp));
    const double speed = length / (duration * (1.0 - kRamp));
    KDL::VelocityProfile_Trap profile(speed, speed / (duration * kRamp));
    profile.SetProfile(0.0, length);

    JointTrajectory out(q0);
    JointVector q = q0;
    const double ends[] = {duration * kRamp, duration * (1.0 - kRamp), duration};
    double t = 0.0;
    try {
      check(t, {q}, rates(q, fromKdl(path->Vel(0.0, 1.0))));
      for (const double end : ends) {
        const double begin = t;
        const int n =
            static_cast<int>(std::clamp(std::ceil((end - begin) / kStep), 4.0, kMostPieces));
        // The acceleration jumps from one part of the profile to the next.
        const double acceleration = profile.Acc(0.5 * (begin + end));
        for (int i = 1; i <= n; ++i) {
          const double next = begin + (end - begin) * i / n;
          const Way way{*path, profile, acceleration};
          const JointVector q_next = onPath(way, advance(way, q, t, next - t), next);
          const JointState to = stateAt(way, q_next, next);
          check(next, to, rates(way, q_next, profile.Pos(next), 1.0));
          out.add(stateAt(way, q, t), to, next - t);
          q = q_next;
          t = next;
        }
      }
    } catch (const InputError& error) {
      if (inverse(goal.X_L0T, q0)) throw;
      throw InputError(fmt::format("{}; where it leads cannot be reached", error.what()));
    }
    return out;
  }

 private:
  /// A path with its speed over time.
  struct Way {
    const KDL::Path& path;
    const KDL::VelocityProfile_Trap& profile;
    double acceleration;  // [m/s^2 | rad/s^2] along it, of this part of the profile
  };

  std::string nameOf(int joint) const { return names_[static_cast<std::size_t>(joint)]; }
  const Link& linkOf(int joint) const { return robot_.jointLink(joint); }

  KDL::JntArray arrayOf(const JointVector& q) const {
    KDL::JntArray out(static_cast<unsigned>(joints_.size()));
    for (std::size_t k = 0; k < joints_.size(); ++k) out(static_cast<unsigned>(k)) = q(joints_[k]);
    return out;
  }

  /// Whole turns taken out.
  JointVector insideLimits(const KDL::JntArray& found, JointVector q) const {
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const Link& l = linkOf(joints_[k]);
      double value = found(static_cast<unsigned>(k));
      if (l.type == JointType::kRevolute) {
        value = q(joints_[k]) + std::remainder(value - q(joints_[k]), 2.0 * M_PI);
        if (value > l.upper) value -= 2.0 * M_PI;
        if (value < l.lower) value += 2.0 * M_PI;
      }
      q(joints_[k]) = value;
    }
    return q;
  }

  /// The joint that is outside its limits.
  std::optional<int> outside(const JointVector& q) const {
    for (const int i : joints_)
      if (!(q(i) >= linkOf(i).lower - kReached && q(i) <= linkOf(i).upper + kReached)) return i;
    return {};
  }

  Eigen::MatrixXd jacobian(const JointVector& q) const {
    KDL::Jacobian J(static_cast<unsigned>(joints_.size()));
    jacobian_solver_->JntToJac(arrayOf(q), J);
    return J.data;
  }

  /// Rates of least norm that give the tool this twist [m/s, rad/s].
  JointVector rates(const JointVector& q, const Vec6& twist) const {
    const Eigen::VectorXd least = leastSquares(jacobian(q), twist);
    JointVector out = JointVector::Zero();
    for (std::size_t k = 0; k < joints_.size(); ++k)
      out(joints_[k]) = least(static_cast<Eigen::Index>(k));
    return out;
  }
  JointVector rates(const Way& way, const JointVector& q, double s, double s_dot) const {
    return rates(q, fromKdl(way.path.Vel(s, s_dot)));
  }
  JointVector rates(const Way& way, const JointVector& q, double t) const {
    return rates(way, q, way.profile.Pos(t), way.profile.Vel(t));
  }

  JointState stateAt(const Way& way, const JointVector& q, double t) const {
    const double s = way.profile.Pos(t), s_dot = way.profile.Vel(t), s_ddot = way.acceleration;
    JointState out;
    out.q = q;
    out.q_dot = rates(way, q, s, s_dot);
    // The rates' change along the way, by central differences.
    constexpr double h = 1e-5;  // [s]
    out.q_ddot = (rates(way, q + h * out.q_dot, s + h * s_dot, s_dot + h * s_ddot) -
                  rates(way, q - h * out.q_dot, s - h * s_dot, s_dot - h * s_ddot)) /
                 (2.0 * h);
    return out;
  }

  /// A step of Runge and Kutta's.
  JointVector advance(const Way& way, const JointVector& q, double t, double h) const {
    const JointVector a = rates(way, q, t), b = rates(way, q + 0.5 * h * a, t + 0.5 * h),
                      c = rates(way, q + 0.5 * h * b, t + 0.5 * h),
                      d = rates(way, q + h * c, t + h);
    return q + h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
  }

  JointVector onPath(const Way& way, JointVector q, double t) const {
    const Transform due = fromKdl(way.path.Pos(way.profile.Pos(t)));
    Vec6 off = between(pose(q), due);
    for (int i = 0; i < kCorrections && !(off.cwiseAbs().maxCoeff() <= kOnPath); ++i) {
      q += rates(q, off);
      off = between(pose(q), due);
    }
    if (!off.allFinite() || !(off.cwiseAbs().maxCoeff() <= kReached))
      throw InputError(fmt::format(
          "at {:.2f} s its {} joints cannot keep the tool on its path: {:.2g} m and {:.2g} rad off",
          t, joints_.size(), off.head<3>().norm(), off.tail<3>().norm()));
    return q;
  }

  /// `tangent`: rates for a unit of speed along the path.
  void check(double t, const JointState& state, const JointVector& tangent) const {
    const JointVector& q = state.q;
    if (const std::optional<int> i = outside(q)) {
      const Link& l = linkOf(*i);
      const double unit = jointUnit(l.type);
      throw InputError(fmt::format(
          "at {:.2f} s joint '{}' would be at {:.6g} {}, want [{:.6g}, {:.6g}]", t, nameOf(*i),
          q(*i) / unit, jointUnitName(l.type), l.lower / unit, l.upper / unit));
    }
    Eigen::MatrixXd J = jacobian(q);
    J.topRows<3>() /= reach_;
    if (J.cols() < 6) J.transposeInPlace();
    const Eigen::VectorXd squares = symmetricEigenvalues(J * J.transpose());
    const double least = std::sqrt(std::max(0.0, squares(0))),
                 most = std::sqrt(squares(squares.size() - 1));
    if (!(least > singular_ * most)) {
      Eigen::Index fastest = joints_.front();
      tangent.cwiseAbs().maxCoeff(&fastest);
      throw InputError(fmt::format(
          "at {:.2f} s the arm is singular (least over largest singular value {:.3g}, want more "
          "than {}), joint '{}' moves most there",
          t, least / most, singular_, nameOf(static_cast<int>(fastest))));
    }
    for (const int i : joints_)
      if (!(std::abs(state.q_dot(i)) <= fastest_(i))) {
        const JointType type = linkOf(i).type;
        throw InputError(
            fmt::format("at {:.2f} s joint '{}' would move at {:.4g} {}/s, want at most {:.4g}", t,
                        nameOf(i), std::abs(state.q_dot(i)) / jointUnit(type), jointUnitName(type),
                        fastest_(i) / jointUnit(type)));
      }
  }

  RobotModel robot_;
  int link_;
  Transform X_LinkT_;
  JointVector fastest_;
  std::vector<std::string> names_;
  double singular_;          // [-]
  std::vector<int> joints_;  // that move the tool, base first
  KDL::Chain chain_;
  double reach_ = 0.0;  // [m]
  std::unique_ptr<KDL::ChainJntToJacSolver> jacobian_solver_;
};

ToolPlanner::ToolPlanner(const RobotModel& robot, int link, const Transform& X_LinkT,
                         const JointVector& fastest, const std::vector<std::string>& names,
                         double singular)
    : impl_(std::make_unique<Impl>(robot, link, X_LinkT, fastest, names, singular)) {}
ToolPlanner::~ToolPlanner() = default;

Transform ToolPlanner::pose(const JointVector& q) const { return impl_->pose(q); }

std::optional<JointVector> ToolPlanner::inverse(const Transform& X_L0T,
                                                const JointVector& near) const {
  return impl_->inverse(X_L0T, near);
}

JointTrajectory ToolPlanner::plan(const JointVector& q0, const ToolGoal& goal) const {
  return impl_->plan(q0, goal);
}

}  // namespace ves
