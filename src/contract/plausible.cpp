// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contract/plausible.hpp"

#include <algorithm>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr std::int64_t kMaxTime = INT64_MAX / 8;        // [ns] 36 years
constexpr double kMaxJointValue = 1e3;                  // [rad | m]
constexpr double kColdest = -273.15, kHottest = 200.0;  // [C]
constexpr std::int32_t kAdcMin = -32768, kAdcMax = 32767;
constexpr std::int64_t kMostAhead = 1'000'000'000;  // [ns] the longest period
constexpr double kMaxOrderTime = 1e6;               // [s]
constexpr double kMaxTranslation = 10.0;            // [m]
constexpr double kMaxRotation = 10.0;               // [rad]
constexpr double kMaxPathTime = 1e4;                // [s] of a tool path
constexpr double kMaxToolSpeed = 100.0;             // [m/s]
constexpr double kMaxReach = 100.0;                 // [m] of a tool
constexpr double kMaxLoad = 1e6;                    // [kg]
constexpr double kMaxLoadInertia = 1e7;             // [kg m^2]

constexpr double kMaxWrenchPerCount = 1e6;  // [N | N m]

constexpr double kMaxFlight = 1e9;   // [m], and per s, of the laboratory
constexpr double kMaxTurning = 1e4;  // [rad/s]

template <typename T>
bool inRange(T x, T lo, T hi) {
  return x >= lo && x <= hi;
}

template <typename E>
bool known(E e) {
  return inRange(static_cast<int>(e), 0, static_cast<int>(E::kCount) - 1);
}

/// Every value within +- most.
template <typename Values, typename T>
bool within(const Values& values, T most) {
  return std::all_of(values.begin(), values.end(), [&](T x) { return inRange(x, -most, most); });
}

bool legCounts(const LegCounts& counts) {
  return std::all_of(counts.begin(), counts.end(),
                     [](std::int32_t n) { return inRange(n, 0, kMaxLegCount); });
}

bool plausible(const RobotMove& move) {
  return inRange(move.joint, 0, kMaxJoints - 1) &&
         inRange(move.target, -kMaxJointValue, kMaxJointValue) && inRange(move.duration, 1e-3, 1e6);
}

/// By duration or by speed; a via alone leads nowhere.
bool plausible(const ToolOrder& order) {
  const auto part = [](const std::optional<Vec3>& values, double most) {
    return !values || within(*values, most);
  };
  return inRange(order.duration, 0.0, kMaxPathTime) && inRange(order.speed, 0.0, kMaxToolSpeed) &&
         (order.duration > 0.0) != (order.speed > 0.0) &&
         (order.duration > 0.0 ? order.duration >= 1e-2 : order.speed >= 1e-5) &&
         inRange(static_cast<int>(order.in), 0, 2) && (order.position || order.rpy) &&
         part(order.position, kMaxReach) && part(order.rpy, kMaxRotation) &&
         part(order.via, kMaxReach);
}

/// With moments of inertia that a body can have.
bool plausible(const HandOrder& order) {
  const RigidBody& body = order.body_T;
  return inRange(body.mass, 0.0, kMaxLoad) && within(body.p_BoBcm_B, kMaxReach) &&
         within(body.I_Bcm_B.reshaped(), kMaxLoadInertia) &&
         symmetricEigenvalues(body.I_Bcm_B)(0) >= -1e-9 * body.I_Bcm_B.norm();
}

bool plausible(const Release&) { return true; }

bool plausible(const PushOrder& order) {
  return inRange(static_cast<int>(order.on), 0, 2) && within(order.point, kMaxReach) &&
         within(order.force_I, kMostPush) && order.force_I.norm() <= kMostPush &&
         inRange(order.duration, kShortestPush, kLongestPush);
}

bool plausible(const Laboratory& lab) {
  const BodyMotion& H = lab.E_H;
  return inRange<std::int64_t>(lab.time, 0, kMaxTime) && within(H.X.p, kMaxFlight) &&
         (H.X.R * H.X.R.transpose() - Mat3::Identity()).norm() <= 1e-6 && within(H.v, kMaxFlight) &&
         within(H.w, kMaxTurning) && within(H.a, kMaxFlight) && within(H.alpha, kMaxTurning);
}

bool plausible(const VehicleOrder& order) {
  for (const double factor : {order.to.mass, order.to.damping, order.to.stiffness})
    if (!(factor == 0.0 || inRange(factor, kLeastVehicleFactor, kMostVehicleFactor))) return false;
  return inRange(order.over, 0.0, kMaxOrderTime);
}

bool plausible(const ThrustOrder& order) {
  return within(order, kLongestThrust) && order.minCoeff() >= 0.0 && order.sum() > 0.0;
}

}  // namespace

bool plausible(const Sample& s) noexcept {
  bool good = inRange<std::int64_t>(s.sequence, 0, kMaxSequence) && s.time <= kMaxTime;
  for (const std::int32_t count : s.adc) good = good && inRange(count, kAdcMin, kAdcMax);
  for (const std::int64_t t : {s.legs_time, s.wrench_time, s.joints_time})
    good = good && inRange<std::int64_t>(t, 0, s.time);
  return good && legCounts(s.legs) && within(s.q, kMaxJointValue) &&
         inRange<std::int64_t>(s.command_time, 0, kMaxTime) && s.faults <= kAllPieces &&
         inRange(s.temperature, kColdest, kHottest);
}

bool plausible(const LegCommand& c) noexcept {
  return inRange(c.segment, -1, kMaxSegments) && inRange<std::int64_t>(c.ahead, 0, kMostAhead) &&
         legCounts(c.counts) && legCounts(c.rest) && plausible(c.laboratory);
}

bool plausible(const RobotOrder& order) noexcept {
  return std::visit([](const auto& one) { return plausible(one); }, order);
}

bool plausible(const Order& order) noexcept {
  const Request request = order.request;
  if (!known(request) || request == Request::kNone || request == Request::kOvertaken) return false;
  if (order.id.sequence < 0) return false;
  if (request == Request::kVehicle) return plausible(order.vehicle);
  if (request == Request::kThrust) return plausible(order.thrust);
  if (request != Request::kRun) return true;
  const Segment& s = order.segment;
  const bool takes_time = s.kind == SegmentKind::kTrajectory || s.kind == SegmentKind::kAdmittance;
  if (!known(s.kind) || s.kind == SegmentKind::kPath || (takes_time && !(s.duration > 0.0)))
    return false;
  bool good = inRange(s.duration, 0.0, kMaxOrderTime) && inRange(s.interval, 0.0, kMaxOrderTime);
  for (const AxisMotion motion : s.trajectory.motion) good = good && known(motion);
  for (int i = 0; i < 6; ++i) {
    const double reach = i < 3 ? kMaxTranslation : kMaxRotation;
    good = good && inRange(s.target.stacked()(i), -reach, reach);
    for (const MotionMeaning& motion : kMotions)
      for (const MotionNumber& number : motion.numbers)
        if (number.value) {
          const double x = (s.trajectory.*number.value)(i);
          good = good &&
                 (number.most > 0.0 ? inRange(x, 0.0, number.most) : inRange(x, -reach, reach));
        }
  }
  return good;
}

bool plausible(const MachineSetup& s) noexcept {
  bool good = s.period > 0 && inRange(s.joints, 0, kMaxJoints) && legCounts(s.leg_home) &&
              s.watchdog.hold_after > 0 && s.watchdog.park_after > 0 && s.watchdog.park_time > 0;
  for (const double scale : s.legs.scale) good = good && inRange(scale, 1e-9, 1.0);
  for (int i = 0; i < kMaxJoints; ++i)  // a joint may turn without end
    good = good && s.joint_min(i) <= s.joint_max(i);
  return good && within(s.legs.offset, kMaxReach) && inRange(s.leg_velocity, 0.0, kMaxToolSpeed) &&
         within(s.wrench_per_count.reshaped(), kMaxWrenchPerCount);
}

}  // namespace ves
