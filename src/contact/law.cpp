// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contact/law.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

double normalForce(const ContactLaw& law, double d, double d_dot) noexcept {
  if (!(d > 0.0)) return 0.0;
  return std::max(0.0, law.stiffness * std::pow(d, law.exponent) * (1.0 + law.damping * d_dot));
}

Vec3 contactForce(const ContactLaw& law, double d, const Vec3& n, const Vec3& v) noexcept {
  const double normal_speed = n.dot(v);
  const double F = normalForce(law, d, -normal_speed);
  if (!(F > 0.0)) return Vec3::Zero();
  const Vec3 slip = v - normal_speed * n;
  return F * (n - law.friction / std::hypot(slip.norm(), law.slip_speed) * slip);
}

double restitution(const ContactLaw& law, double speed) noexcept {
  const double c = law.damping;
  if (!(c * speed > 1e-6)) return 1.0;
  const auto integral = [c](double v) { return v / c - std::log1p(c * v) / (c * c); };
  double low = 0.0, high = std::min(speed, 1.0 / c);
  constexpr int kHalvings = 60;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (integral(-middle) < integral(speed) ? low : high) = middle;
  }
  return low / speed;
}

double springLike(const ContactLaw& law, double mass, double speed) noexcept {
  const double n = law.exponent;
  if (n == 1.0 || !(speed > 0.0)) return law.stiffness;
  const double deepest =
      std::pow((n + 1.0) * mass * speed * speed / (2.0 * law.stiffness), 1.0 / (n + 1.0));
  const double peak = law.stiffness * std::pow(deepest, n);
  return peak * peak / (mass * speed * speed);
}

double storedEnergy(const ContactLaw& law, double d) noexcept {
  return d > 0.0 ? law.stiffness * std::pow(d, law.exponent + 1.0) / (law.exponent + 1.0) : 0.0;
}

}  // namespace ves
