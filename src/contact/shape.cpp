// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contact/shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ves {
namespace {

using Vec2 = Eigen::Vector2d;

Proximity near(const HalfSpace&, const Vec3& p) { return {p.z(), Vec3::UnitZ()}; }

Proximity near(const Ball& ball, const Vec3& p) {
  const double far = p.norm();
  return {far - ball.radius, far > 0.0 ? Vec3(p / far) : Vec3::UnitZ()};
}

Proximity near(const Box& box, const Vec3& p) {
  const Vec3 beyond = p.cwiseAbs() - 0.5 * box.size;
  const Vec3 side = p.unaryExpr([](double x) { return std::copysign(1.0, x); });
  Eigen::Index face = 0;
  if (beyond.maxCoeff(&face) <= 0.0) return {beyond(face), Vec3(side(face) * Vec3::Unit(face))};
  const Vec3 outside = beyond.cwiseMax(0.0);
  const double far = outside.norm();
  return {far, outside.cwiseProduct(side) / far};
}

/// The profile in the half plane {r, z}, as lines from the plate's top into the hole; solid to the
/// right of the way. Outside and in the hole the nearest line decides; in the solid too.
Proximity near(const Socket& socket, const Vec3& p) {
  const double r = p.head<2>().norm();
  const Vec2 at(r, p.z());
  constexpr double kFar = 1e3;  // [m]
  const std::array<Vec2, 5> way = {Vec2(kFar, 0.0), Vec2(socket.radius + socket.chamfer, 0.0),
                                   Vec2(socket.radius, -socket.chamfer),
                                   Vec2(socket.radius, -socket.depth), Vec2(0.0, -socket.depth)};
  double least = HUGE_VAL;
  Vec2 out = Vec2::UnitY();
  bool inside = false;
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    const Vec2 along = way[i + 1] - way[i];
    if (!(along.norm() > 0.0)) continue;
    const double s = std::clamp((at - way[i]).dot(along) / along.squaredNorm(), 0.0, 1.0);
    const Vec2 from = at - way[i] - s * along;
    const double far = from.norm();
    const Vec2 normal = Vec2(along.y(), -along.x()).normalized();  // out of the solid
    // At a corner two lines are equally near; the one that is seen more squarely knows the side.
    const bool nearer = far < least - 1e-12;
    const bool squarer =
        far < least + 1e-12 && std::abs(from.dot(normal)) > std::abs(from.dot(out));
    if (!nearer && !squarer) continue;
    least = std::min(least, far);
    inside = from.dot(normal) < 0.0;
    out = far > 1e-12 ? Vec2((inside ? -1.0 : 1.0) * from / far) : normal;
  }
  const Vec3 radial = r > 0.0 ? Vec3(p.x() / r, p.y() / r, 0.0) : Vec3::UnitX();
  return {inside ? -least : least, out.x() * radial + out.y() * Vec3::UnitZ()};
}

}  // namespace

Proximity proximity(const Shape& shape, const Vec3& p_BQ_B) noexcept {
  return std::visit([&](const auto& s) { return near(s, p_BQ_B); }, shape);
}

}  // namespace ves
