// SPDX-License-Identifier: BSD-3-Clause
#include <gsl/gsl_eigen.h>
#include <gsl/gsl_linalg.h>
#include <gtest/gtest.h>

#include <kdl/frames.hpp>
#include <ostream>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "support/poses.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/math/butterworth.hpp"
#include "ves/math/dense.hpp"
#include "ves/math/frames.hpp"
#include "ves/math/lu6.hpp"
#include "ves/math/quintic.hpp"
#include "ves/math/second_order.hpp"

namespace ves {
namespace {

TEST(Rotation, IsTheFixedAngleRotationOfKdl) {
  for (const Pose& x : test::poses()) {
    const KDL::Rotation oracle = KDL::Rotation::RPY(x.rpy(0), x.rpy(1), x.rpy(2));
    const Mat3 R = rotation(x.rpy);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) ASSERT_NEAR(R(i, j), oracle(i, j), 1e-15);
  }
}

TEST(Rotation, FixedAnglesComeBack) {
  for (const Pose& x : test::poses())
    ASSERT_LT((fixedAngles(rotation(x.rpy)) - x.rpy).norm(), 1e-14);
}

TEST(AngleRates, MatchTheDerivativeOfTheRotation) {
  const test::Swing swing(3);
  const double h = 1e-5;
  for (double t = 0.0; t < 3.0; t += 0.1) {
    const Mat3 R = rotation(swing.x(t).tail<3>());
    const Mat3 R_dot =
        (rotation(swing.x(t + h).tail<3>()) - rotation(swing.x(t - h).tail<3>())) / (2.0 * h);
    const Mat3 W = R_dot * R.transpose();  // skew(w_IP_I)
    const Vec3 w = angleRateMap(swing.x(t).tail<3>()) * swing.xDot(t).tail<3>();
    ASSERT_LT((Vec3(W(2, 1), W(0, 2), W(1, 0)) - w).norm(), 1e-8);
  }
}

TEST(AngleRates, MapDerivativeMatchesFiniteDifferences) {
  const test::Swing swing(4);
  const double h = 1e-5;
  for (double t = 0.0; t < 3.0; t += 0.1) {
    const Mat3 oracle =
        (angleRateMap(swing.x(t + h).tail<3>()) - angleRateMap(swing.x(t - h).tail<3>())) /
        (2.0 * h);
    const Mat3 E_dot = angleRateMapDerivative(swing.x(t).tail<3>(), swing.xDot(t).tail<3>());
    ASSERT_LT((oracle - E_dot).norm(), 1e-8);
  }
}

TEST(Wrench, ShiftAndTransferKeepPower) {
  for (const Pose& x : test::poses(200)) {
    const Transform X_AB{rotation(x.rpy), x.p};
    const Wrench F_Bo_B{Vec3(1.0, -2.0, 3.0), Vec3(0.3, 0.2, -0.1)};
    const Vec3 v_A(0.4, -0.3, 0.2), w_A(-0.1, 0.5, 0.7);  // twist of Ao, one rigid body
    const Vec3 v_B = X_AB.R.transpose() * (v_A + w_A.cross(X_AB.p)), w_B = X_AB.R.transpose() * w_A;
    const Wrench F_Ao_A = transfer(X_AB, F_Bo_B);
    ASSERT_NEAR(F_Ao_A.f.dot(v_A) + F_Ao_A.n.dot(w_A), F_Bo_B.f.dot(v_B) + F_Bo_B.n.dot(w_B),
                1e-12);
  }
}

struct Mode {
  const char* name;
  double k, c, T;
};
std::ostream& operator<<(std::ostream& out, const Mode& mode) { return out << mode.name; }

class Discretise : public testing::TestWithParam<Mode> {};

TEST_P(Discretise, MatchesTheMatrixExponential) {  // van Loan: exp([A B; 0 0] T)
  const auto [name, k, c, T] = GetParam();
  using Wide = Eigen::Matrix<long double, 3, 3>;
  Wide M = Wide::Zero();
  M.topLeftCorner<2, 2>() << 0, 1, -k, -c;
  M(1, 2) = 1.0;
  const Wide wide = (M * static_cast<long double>(T)).exp();
  const Eigen::Matrix3d oracle = wide.cast<double>();
  const SecondOrderHold hold = discretise(k, c, T);
  EXPECT_LT((hold.Phi - oracle.topLeftCorner<2, 2>()).norm(), 1e-12 * hold.Phi.norm());
  EXPECT_NEAR(hold.Gamma(0), oracle(0, 2), 1e-12 * std::abs(oracle(0, 2)));
  EXPECT_NEAR(hold.Gamma(1), oracle(1, 2), 1e-12 * std::abs(oracle(1, 2)) + 1e-18);
}

INSTANTIATE_TEST_SUITE_P(
    Modes, Discretise,
    testing::Values(Mode{"table_4_1_x", 3.0, 1.0, 0.01}, Mode{"srms", 0.5, 0.028, 0.01},
                    Mode{"undamped", 40.0, 0.0, 0.01}, Mode{"undamped_long", 40.0, 0.0, 3.0},
                    Mode{"critical", 100.0, 20.0, 0.01}, Mode{"critical_long", 100.0, 20.0, 0.5},
                    Mode{"just_over", 100.0, 20.0 * (1 + 1e-9), 0.01},
                    Mode{"just_under", 100.0, 20.0 * (1 - 1e-9), 0.01},
                    Mode{"overdamped", 4.0, 50.0, 0.01}, Mode{"overdamped_long", 4.0, 50.0, 5.0},
                    Mode{"weak_spring_strong_damper", 1e-9, 300.0, 0.1},
                    Mode{"free", 0.0, 0.0, 0.01}, Mode{"free_damped", 0.0, 2.0, 0.01},
                    Mode{"free_stiff_damper", 0.0, 2000.0, 0.01},
                    Mode{"very_slow", 1e-12, 1e-8, 0.001}, Mode{"fast", 1e6, 60.0, 0.01},
                    Mode{"step_of_one", 1.0, 0.1, 1.0}, Mode{"edge_series", 1.0001, 1.9, 1.0}),
    [](const auto& test) { return test.param.name; });

TEST(Discretise, NearCriticalDampingIsExactFromEitherSide) {
  // cos and sin/q continued to q^2 <= 0, in long double, where neither cancels.
  const double a = 10.0, T = 0.01;
  for (const double x : {-0.02, -0.0101, -0.0099, -4e-3, -1e-3, -1e-5, -1e-8, 0.0, 1e-8, 1e-5,
                         0.99e-4, 1.01e-4, 1.2e-4, 1e-3, 1e-2}) {  // (qT)^2
    const double k = x / (T * T) + a * a, c = 2.0 * a;
    const long double q2 = static_cast<long double>(k) - static_cast<long double>(a) * a;
    const long double q = std::sqrt(std::abs(q2)),
                      decay = std::exp(-static_cast<long double>(a) * T);
    const long double cosine = decay * (q2 < 0 ? std::cosh(q * T) : std::cos(q * T));
    const long double sine =
        q == 0 ? decay * T : decay * (q2 < 0 ? std::sinh(q * T) : std::sin(q * T)) / q;
    const SecondOrderHold hold = discretise(k, c, T);
    EXPECT_NEAR(hold.Phi(0, 1), static_cast<double>(sine), 3e-15 * T) << x;
    EXPECT_NEAR(hold.Phi(1, 1), static_cast<double>(cosine - a * sine), 3e-15) << x;
    EXPECT_NEAR(hold.Phi(0, 0), static_cast<double>(cosine + a * sine), 3e-15) << x;
  }
}

/// State space of a Butterworth filter, driven by a straight line: exp on the state beside the
/// line.
template <int Order>
double exactRamp(double w, double y_rest, double u0, double u1, double dt) {
  // Companion form of the denominator; states are y and its derivatives.
  using Wide = long double;
  Eigen::Matrix<Wide, Order + 2, Order + 2> M = Eigen::Matrix<Wide, Order + 2, Order + 2>::Zero();
  const double coefficients2[] = {w * w, M_SQRT2 * w},
               coefficients3[] = {w * w * w, 2 * w * w, 2 * w};
  for (int i = 0; i + 1 < Order; ++i) M(i, i + 1) = 1.0;
  for (int i = 0; i < Order; ++i)
    M(Order - 1, i) = -(Order == 2 ? coefficients2 : coefficients3)[i];
  M(Order - 1, Order) = std::pow(w, Order);  // input u
  M(Order, Order + 1) = 1.0;                 // u' = slope
  Eigen::Matrix<Wide, Order + 2, 1> state = Eigen::Matrix<Wide, Order + 2, 1>::Zero();
  state(0) = y_rest;
  state(Order) = u0;
  state(Order + 1) = (u1 - u0) / dt;
  return static_cast<double>(((M * static_cast<Wide>(dt)).exp() * state)(0));
}

TEST(Butterworth, FollowsAStraightLineExactly) {
  const double w = 2 * M_PI * 20, rest = 0.4, u1 = 1.7;
  for (double dt : {1e-6, 1.023e-3, 0.02, 0.3}) {
    Butterworth2<1> second(w);
    Butterworth3<1> third(w);
    const Eigen::Array<double, 1, 1> start(rest), end(u1);
    second.settle(start);
    third.settle(start);
    second.advance(second.prepare(dt), end);
    third.advance(third.prepare(dt), end);
    // A jump within a microsecond is a slope of 10^6: its lag cancels, four digits go.
    EXPECT_NEAR(second.output()(0), exactRamp<2>(w, rest, rest, u1, dt), 1e-11) << dt;
    EXPECT_NEAR(third.output()(0), exactRamp<3>(w, rest, rest, u1, dt), 1e-11) << dt;
  }
}

TEST(Butterworth, StepsOfAnyLengthAgree) {  // one long straight line, cut anywhere
  const double w = 30.0;
  Butterworth2<1> one2(w), many2(w);
  Butterworth3<1> one3(w), many3(w);
  const auto u = [](double t) { return Eigen::Array<double, 1, 1>(0.5 + 2.0 * t); };
  for (auto* f : {&one2, &many2}) f->settle(u(0));
  for (auto* f : {&one3, &many3}) f->settle(u(0));
  one2.advance(one2.prepare(0.2), u(0.2));
  one3.advance(one3.prepare(0.2), u(0.2));
  double t = 0.0;
  for (double dt : {0.001, 0.05, 0.0003, 0.1, 0.0487}) {
    t += dt;
    many2.advance(many2.prepare(dt), u(t));
    many3.advance(many3.prepare(dt), u(t));
  }
  EXPECT_NEAR(one2.output()(0), many2.output()(0), 1e-12);
  EXPECT_NEAR(one3.output()(0), many3.output()(0), 1e-12);
}

TEST(Butterworth, HeldInputHasUnitGain) {
  Butterworth2<1> filter(50.0);
  const Eigen::Array<double, 1, 1> zero(0.0), held(2.5);
  for (int i = 0; i < 1000; ++i) filter.advance(filter.prepare(0.001), zero, held);
  EXPECT_NEAR(filter.output()(0), 2.5, 1e-12);
}

TEST(Quintic, MeetsBothEnds) {
  PathPoint<2> from;
  from.x << 0.3, -1.0;
  from.x_dot << 0.5, 2.0;
  from.x_ddot << -1.0, 4.0;
  const Eigen::Vector2d to(1.0, 0.5);
  const Quintic<2> path(from, to, 2.5);
  const PathPoint<2> a = path.at(0.0), b = path.at(2.5 * (1 - 1e-12)), after = path.at(9.0);
  EXPECT_LT((a.x - from.x).norm() + (a.x_dot - from.x_dot).norm() + (a.x_ddot - from.x_ddot).norm(),
            1e-14);
  EXPECT_LT((b.x - to).norm() + b.x_dot.norm() + b.x_ddot.norm(), 1e-9);
  EXPECT_EQ(after.x, to);
  EXPECT_EQ(after.x_dot.norm(), 0.0);
}

TEST(Quintic, RatesAreDerivatives) {
  PathPoint<1> from;
  from.x_dot(0) = 1.0;
  const Quintic<1> path(from, Eigen::Matrix<double, 1, 1>(2.0), 3.0);
  const double h = 1e-5;
  for (double t = 0.1; t < 2.9; t += 0.1) {
    EXPECT_NEAR(path.at(t).x_dot(0), (path.at(t + h).x(0) - path.at(t - h).x(0)) / (2 * h), 1e-8);
    EXPECT_NEAR(path.at(t).x_ddot(0), (path.at(t + h).x_dot(0) - path.at(t - h).x_dot(0)) / (2 * h),
                1e-8);
  }
}

// --- Dense linear algebra, beside GSL's ----------------------------------------------------------

class Dense : public testing::TestWithParam<int> {
 protected:
  static Eigen::MatrixXd draw(Eigen::Index rows, Eigen::Index cols) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> one(-1.0, 1.0);
    return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return one(random); });
  }
  static gsl_matrix* copy(const Eigen::MatrixXd& A) {
    gsl_matrix* out =
        gsl_matrix_alloc(static_cast<std::size_t>(A.rows()), static_cast<std::size_t>(A.cols()));
    for (Eigen::Index i = 0; i < A.rows(); ++i)
      for (Eigen::Index j = 0; j < A.cols(); ++j)
        gsl_matrix_set(out, static_cast<std::size_t>(i), static_cast<std::size_t>(j), A(i, j));
    return out;
  }
  const Eigen::Index n = GetParam();
};

TEST_P(Dense, EigenvaluesAndTheirVectors) {
  const Eigen::MatrixXd A = draw(n, n);
  gsl_matrix* a = copy(A);
  const auto size = static_cast<std::size_t>(n);
  gsl_vector_complex* values = gsl_vector_complex_alloc(size);
  gsl_eigen_nonsymm_workspace* work = gsl_eigen_nonsymm_alloc(size);
  gsl_eigen_nonsymm(a, values, work);
  const Eigen::VectorXcd found = eigenvalues(A);
  for (std::size_t i = 0; i < size; ++i) {
    const gsl_complex z = gsl_vector_complex_get(values, i);
    const std::complex<double> expected(GSL_REAL(z), GSL_IMAG(z));
    EXPECT_LT((found.array() - expected).abs().minCoeff(), 1e-12);
    const Eigen::VectorXcd v = eigenvector(A, expected);
    EXPECT_NEAR(v.norm(), 1.0, 1e-12);
    EXPECT_LT((A * v - expected * v).norm(), 1e-8);
  }
  gsl_eigen_nonsymm_free(work);
  gsl_vector_complex_free(values);
  gsl_matrix_free(a);
}

TEST_P(Dense, SymmetricEigenvaluesTheSmallestFirst) {
  const Eigen::MatrixXd half = draw(n, n), A = half + half.transpose();
  gsl_matrix* a = copy(A);
  gsl_vector* values = gsl_vector_alloc(static_cast<std::size_t>(n));
  gsl_eigen_symm_workspace* work = gsl_eigen_symm_alloc(static_cast<std::size_t>(n));
  gsl_eigen_symm(a, values, work);
  std::vector<double> expected(values->data, values->data + n);
  std::sort(expected.begin(), expected.end());
  const Eigen::VectorXd found = symmetricEigenvalues(A);
  for (Eigen::Index i = 0; i < n; ++i)
    EXPECT_NEAR(found(i), expected[static_cast<std::size_t>(i)], 1e-12);
  gsl_eigen_symm_free(work);
  gsl_vector_free(values);
  gsl_matrix_free(a);
}

TEST_P(Dense, Exponential) {
  const Eigen::MatrixXd A = draw(n, n);
  gsl_matrix *a = copy(A), *e = copy(A);
  gsl_linalg_exponential_ss(a, e, GSL_PREC_DOUBLE);
  const Eigen::MatrixXd found = exponential(A);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      EXPECT_NEAR(found(i, j),
                  gsl_matrix_get(e, static_cast<std::size_t>(i), static_cast<std::size_t>(j)),
                  1e-11 * found.norm());
  gsl_matrix_free(e);
  gsl_matrix_free(a);
}

TEST_P(Dense, LeastSquaresOfAnyRank) {
  // B's part in the column space is met, and X lies in the row space: Penrose's conditions.
  for (const Eigen::Index rank : {Eigen::Index{1}, n - 1, n}) {
    const Eigen::MatrixXd A = draw(2 * n, rank) * draw(rank, n), B = draw(2 * n, 3);
    const Eigen::MatrixXd X = leastSquares(A, B);
    EXPECT_LT((A.transpose() * (A * X - B)).norm(), 1e-11) << rank;
    const Eigen::MatrixXd P = leastSquares(A, Eigen::MatrixXd::Identity(2 * n, 2 * n));
    EXPECT_LT((P * A * X - X).norm(), 1e-10 * X.norm()) << rank;
    EXPECT_LT((P * A - (P * A).transpose()).norm(), 1e-10) << rank;
  }
}

TEST_P(Dense, SolvePositive) {
  const Eigen::MatrixXd half = draw(n, n), B = draw(n, 2);
  const Eigen::MatrixXd A = half * half.transpose() + Eigen::MatrixXd::Identity(n, n);
  EXPECT_LT((A * solvePositive(A, B) - B).norm(), 1e-11);
}

/// Rows that have to be exchanged, by a first column of zeros above an entry, and in no order.
TEST(Lu6, SolvesWhatEigenSolves) {
  std::mt19937 generator(11);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 200; ++n) {
    Mat6 A = Mat6::NullaryExpr([&] { return normal(generator); });
    if (n % 2) A.topLeftCorner(5, 1).setZero();
    const Motions B = Motions::NullaryExpr([&] { return normal(generator); });
    const Eigen::ColPivHouseholderQR<Mat6> qr(A);
    const double tolerance = 1e-14 * A.norm() * qr.inverse().norm();
    const Lu6 lu(A);
    ASSERT_TRUE(lu.regular());
    EXPECT_LT((lu.solve(B) - qr.solve(B)).norm(), tolerance * qr.solve(B).norm());
    EXPECT_LT((lu.inverse() * A - Mat6::Identity()).norm(), 6.0 * tolerance);
  }
}

TEST(Lu6, KnowsAMatrixThatHasNoInverse) {
  std::mt19937 generator(12);
  std::normal_distribution<double> normal;
  const Mat6 whole = Mat6::NullaryExpr([&] { return normal(generator); });
  EXPECT_FALSE(Lu6(Mat6::Zero()).regular());
  for (int i = 0; i < 6; ++i) {
    Mat6 A = whole;
    A.col(i) = A.col((i + 1) % 6) + 2.0 * A.col((i + 2) % 6);
    EXPECT_FALSE(Lu6(A).regular()) << i;
    for (int j = 0; j < 6; ++j) {
      A = whole;
      A(i, j) = NAN;
      EXPECT_FALSE(Lu6(A).regular()) << i << j;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, Dense, testing::Values(2, 6, 40));

}  // namespace
}  // namespace ves
