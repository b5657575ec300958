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

double storedEnergy(const ContactLaw& law, double d) noexcept {
  return d > 0.0 ? law.stiffness * std::pow(d, law.exponent + 1.0) / (law.exponent + 1.0) : 0.0;
}

}  // namespace ves
