// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/pose_plan.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <utility>

#include "ves/control/path_checks.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Planner {
 public:
  Planner(const StaticSetup& setup, const SeparableCombinations& combinations,
          const ControllerConfig& controller, const JointVector& start,
          const PosePlanOptions& options)
      : setup_(setup),
        combinations_(combinations),
        controller_(controller),
        checks_(controller.safety, controller.geometry),
        masses_(massParameters(setup.robot)),
        start_(start),
        options_(options),
        draw_(options.seed) {}

  PosePlan plan() {
    PosePlan out;
    Stand at{Vec3::Zero(), start_};
    for (int i = 0; i < options_.attitudes; ++i) {
      PosePlan::Attitude a;
      a.rpy = attitude();
      for (int k = 0; k < options_.poses; ++k) {
        a.q.push_back(pose(a.rpy, at));
        at = {a.rpy, a.q.back()};
      }
      out.attitudes.push_back(a);
    }
    // Columns at their usual length.
    MatrixXd information = of(out);
    scale_ = information.diagonal().cwiseSqrt().cwiseInverse();
    takeTimes(out);
    out.condition = out.condition_random = condition(information);
    double least = cost(out);
    for (int i = 0; i < options_.exchanges; ++i) {
      const std::size_t which = below(out.attitudes.size());
      const PosePlan old = out;
      PosePlan::Attitude& changed = out.attitudes[which];
      if (i % (options_.poses + 1) == 0)
        changed.rpy = attitude();
      else
        changed.q[below(changed.q.size())] = pose();
      const MatrixXd next = information - of(old.attitudes[which]) + of(changed);
      out.condition = condition(next);
      takeTimes(out);
      if (cost(out) < least && passable(out, which)) {
        least = cost(out);
        information = next;
      } else {
        out = old;
      }
    }
    out.deviation = deviation(information, out.attitudes.size() * out.attitudes.front().q.size());
    return out;
  }

 private:
  double uniform() { return static_cast<double>(draw_() >> 11) * 0x1p-53; }
  std::size_t below(std::size_t n) {
    return std::min(n - 1, static_cast<std::size_t>(uniform() * static_cast<double>(n)));
  }
  double between(double low, double high) { return low + (high - low) * uniform(); }

  Vec3 attitude() {
    for (int i = 0; i < kPatience; ++i) {
      const Vec3 rpy(between(-options_.tilt, options_.tilt), between(-options_.tilt, options_.tilt),
                     0.0);
      const Pose x{Vec3::Zero(), rpy};
      const Transform X_IP = controller_.geometry.fromHome(x);
      if (!checks_.pose(X_IP, x, legLengths(controller_.geometry, X_IP)).any()) return rpy;
    }
    throw std::domain_error("no attitude within this tilt keeps the safety limits");
  }

  JointVector pose() {
    JointVector q = JointVector::Zero();
    for (int k = 0; k < setup_.robot.joints; ++k) {
      const Link& link = setup_.robot.jointLink(k);
      const double most = link.type == JointType::kRevolute ? M_PI : 1.0;
      constexpr double kInside = 0.45;  // [-] of the range, either way from its middle
      // Of a long range, what lies about its middle; of one without end, about zero.
      const bool ends = std::isfinite(link.lower) && std::isfinite(link.upper);
      const double middle = ends ? 0.5 * (link.lower + link.upper) : 0.0;
      const double half = ends ? std::min(kInside * (link.upper - link.lower), most) : most;
      q(k) = between(std::max(link.lower, middle - half), std::min(link.upper, middle + half));
    }
    return q;
  }

  struct Stand {
    Vec3 rpy;
    JointVector q;
  };

  JointVector pose(const Vec3& rpy, const Stand& from) {
    for (int i = 0; i < kPatience; ++i) {
      const Stand to{rpy, pose()};
      if (borne(from, to)) return to.q;
    }
    throw std::domain_error("no pose of the robot keeps the sensor within its range");
  }

  /// The sensor bears the weight all the way.
  bool borne(const Stand& from, const Stand& to) const {
    const double most = options_.most_range * 32768.0;  // [count]
    constexpr int kLooks = 8;
    for (int i = 1; i <= kLooks; ++i) {
      const double s = static_cast<double>(i) / kLooks;
      const Vec6 counts =
          countRegressor(setup_, from.q + s * (to.q - from.q), from.rpy + s * (to.rpy - from.rpy)) *
          masses_;
      if (!(counts.cwiseAbs().maxCoeff() < most)) return false;
    }
    return true;
  }

  /// From the attitude before `which`, through it, to the one after.
  bool passable(const PosePlan& plan, std::size_t which) const {
    Stand at{Vec3::Zero(), start_};
    if (which > 0) at = {plan.attitudes[which - 1].rpy, plan.attitudes[which - 1].q.back()};
    for (std::size_t i = which; i < std::min(which + 2, plan.attitudes.size()); ++i)
      for (const JointVector& q : plan.attitudes[i].q) {
        const Stand to{plan.attitudes[i].rpy, q};
        if (!borne(at, to)) return false;
        at = to;
      }
    return true;
  }

  /// Information on combinations and biases.
  MatrixXd of(const PosePlan::Attitude& a) const {
    const Eigen::Index r = combinations_.rank();
    MatrixXd sum = MatrixXd::Zero(r + 6, r + 6), Y(6, r + 6);
    Y.rightCols<6>().setIdentity();
    for (const JointVector& q : a.q) {
      Y.leftCols(r) = countRegressor(setup_, q, a.rpy)(Eigen::all, combinations_.leads);
      sum += Y.transpose() * Y;
    }
    return sum;
  }
  MatrixXd of(const PosePlan& plan) const {
    MatrixXd sum = MatrixXd::Zero(combinations_.rank() + 6, combinations_.rank() + 6);
    for (const PosePlan::Attitude& a : plan.attitudes) sum += of(a);
    return sum;
  }
  double condition(const MatrixXd& information) const {
    const VectorXd values =
        symmetricEigenvalues(scale_.asDiagonal() * information * scale_.asDiagonal());
    return values(0) > 0.0 ? std::sqrt(values(values.size() - 1) / values(0)) : HUGE_VAL;
  }

  double moving(const JointVector& from, const JointVector& to) const {
    double time = 1.0;
    for (int i = 0; i < setup_.robot.joints; ++i) {
      const bool turns = setup_.robot.jointLink(i).type == JointType::kRevolute;
      const double one = std::abs(to(i) - from(i)) / (options_.speed * (turns ? kDegree : 0.01));
      time = std::max(time, std::ceil(one * 10.0) / 10.0);
    }
    return time;
  }

  void takeTimes(PosePlan& plan) const {
    Stand at{Vec3::Zero(), start_};
    plan.seconds = 0.0;
    for (PosePlan::Attitude& a : plan.attitudes) {
      const double turning =
          kQuinticPeakRate * (a.rpy - at.rpy).norm() / controller_.gentle.rotation;
      a.moving.clear();
      for (const JointVector& q : a.q) {
        a.moving.push_back(moving(at.q, q));
        at.q = q;
      }
      a.moving.front() = std::max(std::ceil(turning * 10.0) / 10.0, a.moving.front());
      at.rpy = a.rpy;
      plan.seconds += PosePlan::kApproach;
      for (const double time : a.moving) plan.seconds += time + PosePlan::kLook;
    }
  }

  double cost(const PosePlan& plan) const {
    const double over = std::max(1.0, plan.seconds / options_.most_seconds);
    return plan.condition * over * over * over * over;
  }

  double deviation(const MatrixXd& information, std::size_t looks) const {
    const Eigen::Index r = combinations_.rank();
    const VectorXd beta = combinations_.C * masses_;
    const MatrixXd covariance =
        solvePositive(information, MatrixXd::Identity(r + 6, r + 6)).topLeftCorner(r, r);
    const MatrixXd square = information.topLeftCorner(r, r) / static_cast<double>(looks);
    return std::sqrt((covariance * square).trace() / beta.dot(square * beta));
  }

  static constexpr int kPatience = 10000;
  const StaticSetup& setup_;
  const SeparableCombinations& combinations_;
  const ControllerConfig& controller_;
  PathChecks checks_;
  VectorXd masses_;
  JointVector start_;
  PosePlanOptions options_;
  std::mt19937_64 draw_;
  VectorXd scale_;
};

}  // namespace

PosePlan planPoses(const StaticSetup& setup, const SeparableCombinations& combinations,
                   const ControllerConfig& controller, const JointVector& start,
                   const PosePlanOptions& options) {
  return Planner(setup, combinations, controller, start, options).plan();
}

PosePlan planFewestPoses(const StaticSetup& setup, const SeparableCombinations& combinations,
                         const ControllerConfig& controller, const JointVector& start,
                         const PosePlanOptions& options, double accuracy) {
  // So many equations for the combinations, six biases and their drift, and some to judge by.
  const int unknowns = static_cast<int>(combinations.rank()) + 12;
  PosePlanOptions few = options;
  few.attitudes = std::max(3, (unknowns + 12 + 6 * few.poses - 1) / (6 * few.poses));
  PosePlan best = planPoses(setup, combinations, controller, start, few);
  while (best.deviation > accuracy && ++few.attitudes <= options.attitudes) {
    PosePlan more = planPoses(setup, combinations, controller, start, few);
    if (more.seconds > options.most_seconds) break;
    if (more.deviation < best.deviation) best = std::move(more);
  }
  return best;
}

}  // namespace ves
