// SPDX-License-Identifier: BSD-3-Clause
#include "ves/math/second_order.hpp"

#include <cmath>

namespace ves {
namespace {

/// Integral of e^{x t} over 0..T, smooth through x = 0.
double integralOfExp(double x, double T) { return x == 0.0 ? T : std::expm1(x * T) / x; }

/// Gamma(1), the response of y to a unit step after T, as a power series in T: for steps so short
/// beside the mode that 1 - Phi(1,1) would cancel.
double stepResponseSeries(double k, double c, double T) {
  double g_now = 0.0;           // the term in T^n
  double g_next = 0.5 * T * T;  // the term in T^(n+1)
  double sum = g_next;
  for (int n = 1; n <= 16; ++n) {
    const double g = (-c * T * (n + 1) * g_next - k * T * T * g_now) / ((n + 2) * (n + 1));
    g_now = g_next;
    g_next = g;
    sum += g;
  }
  return sum;
}

}  // namespace

SecondOrderHold discretise(double k, double c, double T) noexcept {
  const double a = 0.5 * c;     // zeta omega
  const double q2 = k - a * a;  // omega_d^2, negative when overdamped
  double cosine, sine_over_q;   // e^{-aT} cos(qT), e^{-aT} sin(qT)/q, continued to q2 <= 0
  double y_step;                // y after T under u = 1
  if (q2 * T * T < -0.01) {
    // Overdamped: the two real roots; the slow one without cancellation.
    const double p = std::sqrt(-q2);
    const double slow = -k / (a + p), fast = -(a + p);
    const double e_slow = std::exp(slow * T), e_fast = std::exp(fast * T);
    cosine = 0.5 * (e_slow + e_fast);
    sine_over_q = (e_slow - e_fast) / (2.0 * p);
    y_step = (integralOfExp(slow, T) - integralOfExp(fast, T)) / (2.0 * p);
  } else {
    const double decay = std::exp(-a * T);
    const double x = q2 * T * T;  // (qT)^2
    if (x > 1e-4) {
      const double q = std::sqrt(q2);
      cosine = decay * std::cos(q * T);
      sine_over_q = decay * std::sin(q * T) / q;
    } else {
      // Near critical damping, from either side: the common power series.
      cosine = decay * (1.0 - x / 2.0 * (1.0 - x / 12.0 * (1.0 - x / 30.0 * (1.0 - x / 56.0))));
      sine_over_q =
          decay * T * (1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0))));
    }
    y_step = k * T * T > 1.0 ? (1.0 - (cosine + a * sine_over_q)) / k : stepResponseSeries(k, c, T);
  }
  SecondOrderHold hold;
  // (D.6) with (D.7): phi_1 = cosine - a sine/q, phi_2 = c sine/q, phi_3 = sine/q, phi_4 = -k
  // sine/q.
  hold.Phi << cosine + a * sine_over_q, sine_over_q,  //
      -k * sine_over_q, cosine - a * sine_over_q;
  // Gamma = -A^-1 (I - Phi) B. (D.8) prints A^-1(1,2) as -1/omega; it is -1/omega^2. The second
  // entry needs no division; the first is computed so that omega -> 0 costs no digits.
  hold.Gamma << y_step, sine_over_q;
  return hold;
}

}  // namespace ves
