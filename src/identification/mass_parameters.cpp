// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/mass_parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Columns at length one; those that are zero stay so.
VectorXd normalise(MatrixXd& A) {
  VectorXd length = A.colwise().norm().transpose();
  length = (length.array() > 0.0).select(length, 1.0);
  A.array().rowwise() /= length.transpose().array();
  return length;
}

std::string symbol(Index parameter) {
  static constexpr const char* kAxis[] = {"", " x", " y", " z"};
  const Index body = parameter / 4, axis = parameter % 4;
  return axis == 0 ? fmt::format("m{}", body) : fmt::format("m{}{}{}", body, kAxis[axis], body);
}

/// "m1 y1 - m2 z2 + 0.2435 (m2 + m3)"
std::string nameOf(VectorXd coefficients) {
  std::string text;
  for (Index i = 0; i < coefficients.size(); ++i) {
    const double c = coefficients(i), size = std::abs(c);
    if (c == 0.0) continue;
    std::string terms;  // all that have this coefficient
    int count = 0;
    for (Index j = i; j < coefficients.size(); ++j) {
      if (!(std::abs(coefficients(j) - c) < 1e-9)) continue;
      terms += (count++ ? " + " : "") + symbol(j);
      coefficients(j) = 0.0;
    }
    const bool plain = std::abs(size - 1.0) < 1e-9;
    text += text.empty() ? (c < 0.0 ? "-" : "") : (c < 0.0 ? " - " : " + ");
    if (!plain) text += fmt::format("{:.4g} ", size);
    text += count > 1 && (!plain || c < 0.0) ? "(" + terms + ")" : terms;
  }
  return text;
}

}  // namespace

VectorXd massParameters(const RobotModel& robot) {
  VectorXd out(4 * (robot.size + 1));
  for (int i = 0; i <= robot.size; ++i) {
    const RigidBody& body = i == 0 ? robot.base : robot.link(i - 1).body;
    out.segment<4>(4 * i) << body.mass, body.mass * body.p_BoBcm_B;
  }
  return out;
}

MatrixXd staticRegressor(const RobotModel& robot, const Transform& X_BL0, const JointVector& q,
                         const Vec3& g_B) {
  MatrixXd Y = MatrixXd::Zero(6, 4 * (robot.size + 1));
  const LinkPoses X_L0L = linkPoses(robot, q);
  for (int i = 0; i <= robot.size; ++i) {
    const Transform X_BLi = i > 0 ? X_BL0 * X_L0L[i - 1] : X_BL0;
    Y.block<3, 1>(0, 4 * i) = g_B;
    Y.block<3, 1>(3, 4 * i) = X_BLi.p.cross(g_B);
    Y.block<3, 3>(3, 4 * i + 1) = -skew(g_B) * X_BLi.R;
  }
  return Y;
}

SeparableCombinations separableCombinations(const RobotModel& robot) {
  constexpr int kPoses = 80;
  constexpr double kTolerance = 1e-8;  // [-] of lengths that are one
  const Index all = 4 * (robot.size + 1);
  std::mt19937_64 draw(1);
  std::uniform_real_distribution<double> angle(-1.0, 1.0);
  MatrixXd Y(6 * kPoses, all);
  for (int k = 0; k < kPoses; ++k) {
    JointVector q = JointVector::Zero();
    for (int i = 0; i < robot.joints; ++i)
      q(i) = (robot.jointLink(i).type == JointType::kRevolute ? M_PI : 1.0) * angle(draw);
    const Vec3 g = rotation(Vec3(angle(draw), angle(draw), 0.0)).transpose() * Vec3(0, 0, -1);
    Y.middleRows(6 * k, 6) = staticRegressor(robot, {}, q, g);
  }
  MatrixXd scaled = Y;
  normalise(scaled);
  const VectorXd s = svd(scaled).s;
  const Index rank = (s.array() > kTolerance * s(0)).count();

  // Leaders, from the base outwards: columns that no earlier leader explains.
  SeparableCombinations out;
  MatrixXd Q(Y.rows(), 0);
  for (Index j = 0; j < all; ++j) {
    VectorXd rest = scaled.col(j);
    for (int twice = 0; twice < 2; ++twice) rest -= Q * (Q.transpose() * rest);
    if (!(rest.norm() > std::sqrt(kTolerance))) continue;
    Q.conservativeResize(Eigen::NoChange, Q.cols() + 1);
    Q.rightCols<1>() = rest.normalized();
    out.leads.push_back(static_cast<int>(j));
  }
  if (static_cast<Index>(out.leads.size()) != rank)
    throw std::domain_error("the robot's geometry leaves the rank in doubt");
  out.C = leastSquares(Y(Eigen::all, out.leads), Y);
  out.C = (out.C.array().abs() > 1e-9).select(out.C, 0.0).eval();
  for (Index i = 0; i < rank; ++i) out.names.push_back(nameOf(out.C.row(i).transpose()));
  return out;
}

MatrixXd countRegressor(const StaticSetup& setup, const JointVector& q, const Vec3& rpy) {
  const Vec3 g_S = setup.R_PS.transpose() * rotation(rpy).transpose() * setup.g_I;
  return setup.S_proc * staticRegressor(setup.robot, setup.X_SL0, q, g_S);
}

MassEstimate estimateMasses(const StaticSetup& setup, const SeparableCombinations& combinations,
                            const std::vector<StaticInterval>& rests) {
  const Index r = combinations.rank(), unknowns = r + 12, rows = 6 * std::ssize(rests);
  if (rows < unknowns + 6)
    throw std::domain_error(
        fmt::format("{} poses at rest give {} equations for {} unknowns; want "
                    "at least {} poses",
                    rests.size(), rows, unknowns, (unknowns + 11) / 6));
  double middle = 0.0, span = 1.0;
  for (const StaticInterval& rest : rests) middle += rest.t / static_cast<double>(rests.size());
  for (const StaticInterval& rest : rests) span = std::max(span, std::abs(rest.t - middle));

  MatrixXd A = MatrixXd::Zero(rows, unknowns);
  VectorXd b(rows);
  for (Index k = 0; k < std::ssize(rests); ++k) {
    const StaticInterval& rest = rests[static_cast<std::size_t>(k)];
    const MatrixXd Y = countRegressor(setup, rest.q, rest.rpy);
    A.block(6 * k, 0, 6, r) = Y(Eigen::all, combinations.leads);
    A.block(6 * k, r, 6, 6) = Mat6::Identity();
    A.block(6 * k, r + 6, 6, 6) = Mat6::Identity() * ((rest.t - middle) / span);
    b.segment<6>(6 * k) = rest.counts;
  }

  constexpr double kLeast = 0.05;  // [count] no mean of quantised readings is better known
  constexpr int kPasses = 4;
  Vec6 sigma = Vec6::Ones();
  MassEstimate out;
  for (int pass = 0; pass < kPasses; ++pass) {
    const VectorXd weight = sigma.cwiseInverse().replicate(std::ssize(rests), 1);
    MatrixXd scaled = weight.asDiagonal() * A;
    const VectorXd length = normalise(scaled);
    const Svd d = svd(scaled);
    constexpr double kDetermined = 1e-7;
    if (!(d.s(unknowns - 1) > kDetermined * d.s(0)))
      throw std::domain_error(
          "these poses do not determine the parameters; want more attitudes and joint angles");
    const VectorXd x = (d.V * (d.U.transpose() * (weight.asDiagonal() * b)).cwiseQuotient(d.s))
                           .cwiseQuotient(length);
    const VectorXd residual = b - A * x;
    const VectorXd deviation = (d.V * d.s.cwiseInverse().asDiagonal()).rowwise().norm();
    Vec6 squares = Vec6::Zero(), freedom = Vec6::Zero();
    for (Index i = 0; i < rows; ++i) {
      squares(i % 6) += residual(i) * residual(i);
      freedom(i % 6) += 1.0 - d.U.row(i).squaredNorm();
    }
    // Few looks tell a channel's variance poorly: that of all channels counts as kAlike more.
    constexpr double kAlike = 6.0;
    const Vec6 alone = squares.cwiseQuotient(freedom.cwiseMax(1.0)).cwiseMax(kLeast * kLeast);
    const double all = std::exp(alone.array().log().mean());
    sigma = ((squares.array() + kAlike * all) / (freedom.array() + kAlike)).sqrt().max(kLeast);
    out.beta = x.head(r);
    out.standard_deviation = deviation.cwiseQuotient(length).head(r);
    out.inflation = deviation.head(r);  // of columns of length one
    out.bias = x.segment<6>(r);
    out.bias_drift = x.segment<6>(r + 6) / span;
    out.residual = sigma;
    out.condition = d.s(0) / d.s(unknowns - 1);
    // What the masses explain of the readings, weighed, and its deviation.
    const MatrixXd spread = d.V.topRows(r) * d.s.cwiseInverse().asDiagonal();
    const MatrixXd weight_of = scaled.leftCols(r);  // columns of length one
    out.deviation =
        (weight_of * spread).norm() / (weight_of * x.head(r).cwiseProduct(length.head(r))).norm();
  }
  return out;
}

VectorXd completed(const SeparableCombinations& combinations, const VectorXd& beta,
                   const VectorXd& prior) {
  // Masses that are told only together share their sum as in the prior: those from one that leads
  // to before the next.
  const Index bodies = prior.size() / 4;
  VectorXd full = VectorXd::Zero(prior.size());
  for (Index row = 0; row < combinations.rank(); ++row) {
    const Index lead = combinations.leads[static_cast<std::size_t>(row)];
    if (lead % 4 != 0) continue;
    const Index begin = lead / 4;
    Index next = bodies;
    for (const int other : combinations.leads)
      if (other % 4 == 0 && other > lead) next = std::min<Index>(next, other / 4);
    double total = 0.0;
    for (Index i = begin; i < next; ++i) total += prior(4 * i);
    for (Index i = begin; i < next; ++i) {
      const double share =
          total > 0.0 ? prior(4 * i) / total : 1.0 / static_cast<double>(next - begin);
      full(4 * i) = share * beta(row);
      if (total > 0.0) full.segment<3>(4 * i + 1) = prior.segment<3>(4 * i + 1) * beta(row) / total;
    }
  }
  for (const int lead : combinations.leads) full(lead) = 0.0;
  full(combinations.leads) = (beta - combinations.C * full).eval();
  return full;
}

}  // namespace ves
