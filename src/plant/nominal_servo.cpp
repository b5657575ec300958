// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/nominal_servo.hpp"

#include <cmath>

#include "ves/math/dense.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves::plant {
namespace {

constexpr double kFractional = 256.0;  // eight bits of U, (2.7a)
constexpr double kUpdate = static_cast<double>(kUpdatePeriod) * kSecondPerNanosecond;

/// [-] speed of a four-way leg without load that swings about `length` [m] so little that its
/// pressures stay, over the one that they lead to. In units of p_S and of k x sqrt(p_S)/A_1,
/// a = A_2/A_1:
///   A_1 v + (V_1/beta) p_1' = Q_1,  A_2 v - (V_2/beta) p_1'/a = Q_2   of (2.15), p_2 = p_1/a
/// They stay where both ways change them alike.
double turningOf(const HydraulicLegModel& leg, double length) {
  const double a = leg.cylinder.rod_side / leg.cylinder.bore, most = 1.0 + a * a * a;
  const double V_1 = boreVolume(leg, length), V_2 = rodVolume(leg, length),
               share = V_2 / (V_2 + a * a * V_1);
  double up = 0.0, down = 0.0, low = a * a * a / most, high = a / most;
  for (int n = 0; n < 60; ++n) {
    const double p_1 = 0.5 * (low + high), p_2 = p_1 / a;
    const double in_1 = std::sqrt(1.0 - p_1), out_1 = std::sqrt(p_1), in_2 = std::sqrt(1.0 - p_2),
                 out_2 = std::sqrt(p_2);
    up = share * in_1 + (1.0 - share) / a * out_2;
    down = share * out_1 + (1.0 - share) / a * in_2;
    (in_1 / up > out_1 / down ? low : high) = p_1;
  }
  // What either way leads to: v^2 (1 + a^3) = 1 and = a.
  const auto both = [](double v, double w) { return v * w / (v + w); };
  return both(up, down) * std::sqrt(most) / both(1.0, std::sqrt(a));
}

}  // namespace

double servoRail(const LegSlaveGains& gains, const Temposonics& transducer) {
  const double digits_per_count = gains.K_P / kFractional;
  return LegSlave::kFullScale / digits_per_count * transducer.scale;
}

double velocityGain(double gain, const LegSlaveGains& gains, const Temposonics& transducer) {
  const double current =  // [A] at the D/A converter's full scale
      LegSlave::kFullScale * LegSlave::kVoltsPerDigit * LegSlave::kAmperesPerVolt;
  return gain * current / servoRail(gains, transducer);
}

double derivativeTime(const LegSlaveGains& gains) {
  return ServoModel::kSpan * kUpdate * gains.K_D / gains.K_P;
}

ServoModel nominalServo(const LegSlaveGains& gains, const ActuatorModel& actuator,
                        const Temposonics& transducer) {
  ServoModel s;
  s.rail = servoRail(gains, transducer);
  s.extend.setConstant(velocityGain(actuator.gain_extend, gains, transducer));
  s.retract.setConstant(velocityGain(actuator.gain_retract, gains, transducer));
  s.tau.setConstant(actuator.tau);
  s.update = kUpdate;
  s.derivative = derivativeTime(gains);
  s.reading_age = 0.5 * static_cast<double>(kTransducerPeriod) * kSecondPerNanosecond;
  s.readings.offset.setConstant(transducer.offset);
  s.readings.scale.setConstant(transducer.scale);
  return s;
}

Resonance nominalResonance(const HydraulicModel& hydraulic, const ActuatorModel& gains,
                           const Geometry& geometry, const RigidBody& load_P) {
  const HydraulicLegModel& leg = hydraulic.leg;
  const CylinderModel& c = leg.cylinder;
  const LegLines home = legLines(geometry, geometry.fromHome({}));
  const Mat6 M = spatialMass(combine(hydraulic.plate_P, {}, load_P));
  // Modes of equal legs: J^T J v = lambda M v.
  const Eigen::LLT<Mat6> llt(M);
  const Mat6 half = llt.matrixL().solve(Mat6(home.J.transpose()));
  const Eigen::VectorXd lambda = symmetricEigenvalues(half * half.transpose());

  // A chamber's pressure changes by `stiffens` [Pa/m], and its orifices pass `passes` [m^3/s/Pa] of
  // it at null, where the spool is where as much flows in as out:
  //   k u_0 p_S / (sqrt(p_1) + sqrt(p_S - p_1)) / sqrt(p_1 (p_S - p_1))
  const double L = home.L.mean(), p_S = leg.oil.supply;
  const bool four_way = leg.valve.circuit == Circuit::kFourWay;
  const double stiffens[] = {
      leg.oil.bulk_modulus * c.bore / boreVolume(leg, L),
      four_way ? leg.oil.bulk_modulus * c.rod_side / rodVolume(leg, L) : 0.0};
  const double k = c.bore * stiffens[0] + c.rod_side * stiffens[1];  // [N/m]
  const double p_1 = p_S * c.rod_side / (four_way ? c.bore + c.rod_side : c.bore),
               root_1 = std::sqrt(p_1), root_2 = std::sqrt(p_S - p_1),
               passes = leg.flow * std::max(0.0, leg.valve.opening) * p_S /
                        ((root_1 + root_2) * root_1 * root_2);
  // [N/m/s] by which a leg's force on its oil falls when that is bent by a metre.
  const double both = stiffens[0] + stiffens[1],
               yields = passes * (stiffens[0] * stiffens[0] + stiffens[1] * stiffens[1]) +
                        leg.oil.leak * both * both;

  Resonance out;
  out.frequency = std::sqrt(k * lambda.minCoeff());
  out.damping = HUGE_VAL;
  for (const double one : lambda) {
    const double w = std::sqrt(k * one);
    out.damping = std::min(out.damping, 0.5 * (yields / k / w + leg.seals.viscous * w / k));
  }
  const double speed = 0.5 * (gains.gain_extend + gains.gain_retract);  // [m/s/A]
  out.feedback = speed * leg.valve.feedback * k / c.bore;
  out.feedback_time = leg.valve.feedback_time;
  if (four_way) out.turning = turningOf(leg, L);
  return out;
}

}  // namespace ves::plant
