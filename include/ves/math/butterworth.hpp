// SPDX-License-Identifier: BSD-3-Clause
//
// Low-pass Butterworth filters of second and third order for N channels side by side, advanced
// exactly over steps of any length while the input runs along a straight line. The report's sensor
// conditioner (two poles, 20 Hz, section 2.2) and Filters 1 to 3 (section 2.4) are analog: they
// have no sampling period of their own.
#pragma once

#include <cmath>

#include "ves/math/second_order.hpp"

namespace ves {

/// w^2 / (s^2 + sqrt(2) w s + w^2).
template <int N>
class Butterworth2 {
 public:
  using Channels = Eigen::Array<double, N, 1>;

  /// What one step length needs; compute once for a length that recurs.
  struct Step {
    Eigen::Matrix2d Phi;
    double dt;  // [s]
  };

  explicit Butterworth2(double cutoff) : w_(cutoff) {}  // [rad/s]

  Step prepare(double dt) const noexcept { return {discretise(w_ * w_, M_SQRT2 * w_, dt).Phi, dt}; }

  /// At rest under the constant input u.
  void settle(const Channels& u) noexcept {
    u_ = y_ = u;
    y_dot_.setZero();
  }

  /// The input runs from its last value to u over the step; `held` is added to it, constant.
  void advance(const Step& step, const Channels& u, const Channels& held) noexcept {
    const Channels slope = (u - u_) / step.dt;
    const Channels lag = M_SQRT2 / w_ * slope - held;
    // The ramp's own response is the ramp, late by sqrt(2)/w; what differs from it decays freely.
    const Channels e = y_ - (u_ - lag), e_dot = y_dot_ - slope;
    y_ = u - lag + step.Phi(0, 0) * e + step.Phi(0, 1) * e_dot;
    y_dot_ = slope + step.Phi(1, 0) * e + step.Phi(1, 1) * e_dot;
    u_ = u;
  }
  void advance(const Step& step, const Channels& u) noexcept { advance(step, u, Channels::Zero()); }

  /// The input is u from its beginning on.
  void advanceHeld(const Step& step, const Channels& u) noexcept {
    const Channels e = y_ - u, e_dot = y_dot_;
    y_ = u + step.Phi(0, 0) * e + step.Phi(0, 1) * e_dot;
    y_dot_ = step.Phi(1, 0) * e + step.Phi(1, 1) * e_dot;
    u_ = u;
  }

  /// The input runs to u along a parabola of the second derivative `curve`.
  void advanceAlong(const Step& step, const Channels& u, const Channels& curve) noexcept {
    const Channels chord = (u - u_) / step.dt, bend = 0.5 * step.dt * curve;
    // Its own response is u - sqrt(2)/w u' + u''/w^2.
    const auto response = [&](const Channels& at, const Channels& slope) -> Channels {
      return at - M_SQRT2 / w_ * slope + curve / (w_ * w_);
    };
    const Channels slope = chord + bend, late = M_SQRT2 / w_ * curve;
    const Channels e = y_ - response(u_, chord - bend), e_dot = y_dot_ - (chord - bend - late);
    y_ = response(u, slope) + step.Phi(0, 0) * e + step.Phi(0, 1) * e_dot;
    y_dot_ = slope - late + step.Phi(1, 0) * e + step.Phi(1, 1) * e_dot;
    u_ = u;
  }

  /// The input changes at once: the next step's is constant when it ends at u too.
  void jump(const Channels& u) noexcept { u_ = u; }

  /// As if everything so far had been more: the input by so much, the output, and its rate.
  void raise(const Channels& input, const Channels& output, const Channels& rate) noexcept {
    u_ += input;
    y_ += output;
    y_dot_ += rate;
  }
  void raise(const Channels& by) noexcept { raise(by, by, Channels::Zero()); }

  const Channels& output() const noexcept { return y_; }
  const Channels& rate() const noexcept { return y_dot_; }  // of the output
  Channels curve() const noexcept { return w_ * w_ * (u_ - y_) - M_SQRT2 * w_ * y_dot_; }

 private:
  double w_;                           // [rad/s]
  Channels u_ = Channels::Zero();      // last input
  Channels y_ = Channels::Zero();      // output
  Channels y_dot_ = Channels::Zero();  // its rate
};

/// w^3 / ((s + w)(s^2 + w s + w^2)).
template <int N>
class Butterworth3 {
 public:
  using Channels = Eigen::Array<double, N, 1>;

  struct Step {
    Eigen::Matrix2d Phi;  // of the pair
    double decay;         // of the real pole
    double dt;            // [s]
  };

  explicit Butterworth3(double cutoff) : w_(cutoff) {}  // [rad/s]

  Step prepare(double dt) const noexcept {
    return {discretise(w_ * w_, w_, dt).Phi, std::exp(-w_ * dt), dt};
  }

  void settle(const Channels& u) noexcept {
    u_ = x_ = y_ = u;
    y_dot_.setZero();
  }

  /// The input runs from its last value to u over the step.
  void advance(const Step& step, const Channels& u) noexcept {
    const Channels slope = (u - u_) / step.dt;
    const Channels lag = slope / w_;
    // The real pole gives x = ramp - lag + A e^{-wt}; the pair passes A e^{-wt} unchanged, because
    // w^2 / (s^2 + w s + w^2) is one at s = -w.
    const Channels A = x_ - (u_ - lag);
    const Channels e = y_ - (u_ - 2.0 * lag + A), e_dot = y_dot_ - (slope - w_ * A);
    x_ = u - lag + step.decay * A;
    y_ = u - 2.0 * lag + step.decay * A + step.Phi(0, 0) * e + step.Phi(0, 1) * e_dot;
    y_dot_ = slope - w_ * step.decay * A + step.Phi(1, 0) * e + step.Phi(1, 1) * e_dot;
    u_ = u;
  }

  /// The input changes at once: the next step's is constant when it ends at u too.
  void jump(const Channels& u) noexcept { u_ = u; }

  const Channels& output() const noexcept { return y_; }

 private:
  double w_;                           // [rad/s]
  Channels u_ = Channels::Zero();      // last input
  Channels x_ = Channels::Zero();      // after the real pole
  Channels y_ = Channels::Zero();      // output
  Channels y_dot_ = Channels::Zero();  // its rate
};

}  // namespace ves
