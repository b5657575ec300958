// SPDX-License-Identifier: BSD-3-Clause
//
// Fifth-order polynomials between two states.
#pragma once

#include <Eigen/Core>

namespace ves {

/// Value, rate and acceleration of a path in N coordinates.
template <int N>
struct PathPoint {
  Eigen::Matrix<double, N, 1> x = Eigen::Matrix<double, N, 1>::Zero();
  Eigen::Matrix<double, N, 1> x_dot = Eigen::Matrix<double, N, 1>::Zero();
  Eigen::Matrix<double, N, 1> x_ddot = Eigen::Matrix<double, N, 1>::Zero();
};

/// Where to be, and when: `ahead` [s] after the tick that says so.
template <int N>
struct Waypoint : PathPoint<N> {
  double ahead = 0.0;
};

/// The fifth-order polynomial (report, chapter 3) from any state to any other; behind its end it
/// stays there.
template <int N>
class Quintic {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;

  Quintic() = default;
  Quintic(const PathPoint<N>& from, const PathPoint<N>& to, double duration) noexcept
      : T_(duration), end_(to.x) {
    const Vector h = to.x - from.x, v = from.x_dot * T_, a = from.x_ddot * (T_ * T_);
    const Vector w = to.x_dot * T_, b = to.x_ddot * (T_ * T_);
    c_.col(0) = from.x;
    c_.col(1) = v;
    c_.col(2) = 0.5 * a;
    c_.col(3) = 10.0 * h - 6.0 * v - 1.5 * a - 4.0 * w + 0.5 * b;
    c_.col(4) = -15.0 * h + 8.0 * v + 1.5 * a + 7.0 * w - b;
    c_.col(5) = 6.0 * h - 3.0 * v - 0.5 * a - 3.0 * w + 0.5 * b;
  }
  /// To rest.
  Quintic(const PathPoint<N>& from, const Vector& to, double duration) noexcept
      : Quintic(from, PathPoint<N>{to, Vector::Zero(), Vector::Zero()}, duration) {}

  PathPoint<N> at(double t) const noexcept {
    PathPoint<N> point;
    point.x = end_;
    if (!(t < T_)) return point;
    const double u = t < 0.0 ? 0.0 : t / T_;
    using Six = Eigen::Matrix<double, 6, 1>;
    point.x = c_ * (Six() << 1.0, u, u * u, u * u * u, u * u * u * u, u * u * u * u * u).finished();
    point.x_dot =
        c_ *
        (Six() << 0.0, 1.0, 2.0 * u, 3.0 * u * u, 4.0 * u * u * u, 5.0 * u * u * u * u).finished() /
        T_;
    point.x_ddot = c_ *
                   (Six() << 0.0, 0.0, 2.0, 6.0 * u, 12.0 * u * u, 20.0 * u * u * u).finished() /
                   (T_ * T_);
    return point;
  }

  double duration() const noexcept { return T_; }  // [s]
  /// The same way, taken so many times slower.
  Quintic slower(double times) const noexcept {
    Quintic out = *this;
    out.T_ *= times;
    return out;
  }
  bool operator==(const Quintic&) const = default;
  const Vector& end() const noexcept { return end_; }

 private:
  double T_ = 0.0;  // [s]
  Vector end_ = Vector::Zero();
  Eigen::Matrix<double, N, 6> c_ = Eigen::Matrix<double, N, 6>::Zero();  // powers of t/T
};

/// Peak rate of a rest-to-rest quintic over its mean rate.
inline constexpr double kQuinticPeakRate = 1.875;  // [-]

}  // namespace ves
