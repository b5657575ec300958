// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/hydraulic_leg.hpp"

#include <algorithm>
#include <cmath>

namespace ves::plant {
namespace {

constexpr double kSmooth = 1e4;  // [Pa] below which an orifice's root becomes a line

/// sqrt(|p|) with p's sign, and its derivative; a line through zero.
struct Root {
  double value, rate;
};
Root root(double p) noexcept {
  const double s = p * p + kSmooth * kSmooth, fourth = 1.0 / std::sqrt(std::sqrt(s));
  return {p * fourth, fourth * (1.0 - 0.5 * p * p / s)};
}

/// [Pa] enthalpy that a m^3 (without pressure) of oil carries.
double enthalpy(double p, double beta) noexcept { return -beta * std::expm1(-p / beta); }

/// [J] that oil of the volume N without pressure stores in the volume V.
double oilEnergy(double N, double V, double beta) noexcept {
  return N > V ? beta * (N - V - V * std::log(N / V)) : 0.0;
}

double pressureOf(double N, double V, double beta) noexcept {
  return N > V ? beta * std::log(N / V) : 0.0;
}

/// [N] that the seals take at the steady speed v.
double steadyFriction(const SealModel& s, double v) noexcept {
  const double slip = v / s.stribeck;
  return s.coulomb + (s.breakaway - s.coulomb) * std::exp(-slip * slip);
}

}  // namespace

bool fit(HydraulicLegModel& leg, const ActuatorModel& gains, double current, double load) {
  const double v_e = gains.gain_extend * current, v_r = gains.gain_retract * current,
               open = current + leg.valve.opening;
  const double p_S = leg.oil.supply, A_1 = leg.cylinder.bore, beta = leg.oil.bulk_modulus;
  // The oil's force at either speed.
  const double F_e = load + steadyFriction(leg.seals, v_e) + leg.seals.viscous * v_e,
               F_r = load - steadyFriction(leg.seals, v_r) - leg.seals.viscous * v_r;
  double& A_2 = leg.cylinder.rod_side;
  double& k = leg.flow;
  A_2 = 0.4 * A_1;
  k = 0.0;
  // Speeds of the oil as it flows, without pressure: higher than the pistons' by what the chambers'
  // pressures compress it, which depends on the areas only a little.
  const auto swelling = [&](double p) { return std::exp(p / beta); };
  for (int n = 0; n < 20; ++n) switch (leg.valve.circuit) {
      case Circuit::kThreeWay: {
        // A_1 p_1 = A_2 p_S + F,  A_1 v_e = k x sqrt(p_S - p_1),  A_1 v_r = k x sqrt(p_1)
        const double p_e = (A_2 * p_S + F_e) / A_1, u_e = v_e * swelling(p_e),
                     u_r = v_r * swelling((A_2 * p_S + F_r) / A_1), ratio = u_e * u_e / (u_r * u_r);
        A_2 = (A_1 - (F_e + ratio * F_r) / p_S) / (1.0 + ratio);
        k = A_1 * u_e / (open * std::sqrt(p_S - (A_2 * p_S + F_e) / A_1));
        break;
      }
      case Circuit::kFourWay: {
        // p_S - p_1 = (A_1 v/k x)^2, p_2 = (A_2 v/k x)^2 extending; p_1 and p_S - p_2 retracting;
        // A_1 p_1 - A_2 p_2 = F.
        const auto drop = [&](double A, double v, double p) {
          const double u = k > 0.0 ? A * v * swelling(p) / (k * open) : 0.0;
          return u * u;
        };
        const double s_e1 = swelling(p_S - drop(A_1, v_e, p_S)), s_e2 = swelling(drop(A_2, v_e, 0)),
                     s_r1 = swelling(drop(A_1, v_r, 0)), s_r2 = swelling(p_S - drop(A_2, v_r, p_S));
        const auto cubes = [&](double one, double two) {
          return A_1 * A_1 * A_1 * one * one + A_2 * A_2 * A_2 * two * two;
        };
        const double ratio = v_e * v_e * cubes(s_e1, s_e2) / (v_r * v_r * cubes(s_r1, s_r2));
        k = v_e / open * std::sqrt(cubes(s_e1, s_e2) / (A_1 * p_S - F_e));
        A_2 = (A_1 - F_e / p_S) / ratio - F_r / p_S;
        break;
      }
    }
  if (!(A_2 > 0.0 && A_2 < A_1 && leg.flow > 0.0)) return false;
  leg.valve.null = 0.0;
  const double middle = 0.5 * (leg.cylinder.length_min + leg.cylinder.length_max);
  leg.valve.null = HydraulicLeg(leg, middle, load).spool();
  return true;
}

HydraulicLeg::HydraulicLeg(const HydraulicLegModel& model, double length, double load) noexcept
    : metered_(model.valve.circuit == Circuit::kThreeWay ? 1 : 2), y_(length) {
  use(model);
  const CylinderModel& c = model_.cylinder;
  const double p_S = model_.oil.supply, beta = model_.oil.bulk_modulus;
  if (c.play > 0.0) y_ += 0.5 * c.play * std::clamp(load / c.seating, -1.0, 1.0);
  // What one chamber of two loses the other gains, when their pressures add up to the supply's.
  p_[0] = metered_ == 1 ? (load + c.rod_side * p_S) / c.bore
                        : (load + c.rod_side * p_S) / (c.bore + c.rod_side);
  p_[1] = metered_ == 1 ? p_S : p_S - p_[0];
  for (std::size_t k = 0; k < 2; ++k) oil_[k] = volume(k, y_) * std::exp(p_[k] / beta);
  // Where as much flows in as out.
  double lo = -model_.valve.limit, hi = model_.valve.limit;
  for (int n = 0; n < 60; ++n) {
    const double x = 0.5 * (lo + hi);
    const Flow flow = through(x, p_[0]);
    (flow.in - flow.out + model_.oil.leak * (p_[1] - p_[0]) > 0.0 ? hi : lo) = x;
  }
  eta_ << 0.5 * (lo + hi), 0.0;
  pressed_ = loadPressure();
}

void HydraulicLeg::use(const HydraulicLegModel& model) noexcept {
  model_ = model;
  swelling_S_ = std::exp(model_.oil.supply / model_.oil.bulk_modulus);
  h_S_ = enthalpy(model_.oil.supply, model_.oil.bulk_modulus);
  friction_ = steadyFriction(model_.seals, v_);
}

void HydraulicLeg::become(const HydraulicLegModel& model) noexcept {
  use(model);
  if (metered_ == 1) p_[1] = model_.oil.supply;
  for (std::size_t k = 0; k < 2; ++k)
    oil_[k] = volume(k, y_) * std::exp(p_[k] / model_.oil.bulk_modulus);
}

SecondOrderHold HydraulicLeg::prepare(double dt) const noexcept {
  const double w = model_.valve.frequency;
  return discretise(w * w, 2.0 * model_.valve.damping * w, dt);
}

double boreVolume(const HydraulicLegModel& leg, double length) noexcept {
  return leg.oil.hoses + leg.cylinder.bore * (length - leg.cylinder.length_min);
}

double rodVolume(const HydraulicLegModel& leg, double length) noexcept {
  return leg.oil.hoses + leg.cylinder.rod_side * (leg.cylinder.length_max - length);
}

double HydraulicLeg::volume(std::size_t chamber, double y) const noexcept {
  return chamber == 0 ? boreVolume(model_, y) : rodVolume(model_, y);
}

/// (2.11) of a chamber at the pressure p, its spool `towards` the supply.
HydraulicLeg::Flow HydraulicLeg::through(double towards, double p) const noexcept {
  const double in = model_.flow * std::max(0.0, model_.valve.opening + towards),
               out = model_.flow * std::max(0.0, model_.valve.opening - towards);
  const Root supply = root(model_.oil.supply - p), back = root(p);
  return {in * supply.value, out * back.value, -in * supply.rate, out * back.rate, 0.0};
}

/// [N] of oil and bristles, that the joints carry.
double HydraulicLeg::jointForce(const std::array<double, 2>& p, double z) const noexcept {
  return model_.cylinder.bore * p[0] - model_.cylinder.rod_side * p[1] - model_.seals.bristle * z;
}

double HydraulicLeg::stopForce() const noexcept {
  const CylinderModel& c = model_.cylinder;
  return c.stop * (std::max(0.0, c.length_min - y_) - std::max(0.0, y_ - c.length_max));
}

double HydraulicLeg::loadPressure() const noexcept {
  return p_[0] - model_.cylinder.rod_side / model_.cylinder.bore * p_[1];
}

double HydraulicLeg::openSpool(double current, double dt, const SecondOrderHold& spool) noexcept {
  const ValveModel& valve = model_.valve;
  if (valve.stuck) return eta_(0);
  pressed_ += dt / (valve.feedback_time + dt) * (loadPressure() - pressed_);
  const double asked = current - valve.feedback * (loadPressure() - pressed_),
               wanted = std::clamp(asked, -valve.limit, valve.limit) + valve.null;
  const double from = eta_(0);
  eta_ = spool.Phi * eta_ + spool.Gamma * (valve.frequency * valve.frequency * wanted);
  return 0.5 * (from + eta_(0));
}

/// What the piston's way dy does to chambers and seals. Linearly implicit in the chambers' own
/// flow: p' = beta (N'/N - V'/V), N' = net + rate p'. A void has no pressure to fall.
HydraulicLeg::Moved HydraulicLeg::moved(double dy, double dt,
                                        const std::array<Flow, 2>& flow) const noexcept {
  const double beta = model_.oil.bulk_modulus;
  const std::array<double, 2> area = {model_.cylinder.bore, -model_.cylinder.rod_side};
  Moved out;
  out.dy = dy;
  for (std::size_t k = 0; k < 2; ++k) {
    const double V = volume(k, y_), dV = area[k] * dy;
    if (k == 1 && metered_ == 1) {  // the rod's side is open to the supply
      out.p[k] = model_.oil.supply;
      out.dN[k] = dV * swelling_S_;
      continue;
    }
    const double rate = oil_[k] > V ? flow[k].in_rate - flow[k].out_rate : 0.0;
    out.dN[k] = dt * (flow[k].in - flow[k].out + flow[k].past - rate * beta * dV / V) /
                (1.0 - dt * rate * beta / oil_[k]);
    if (rate != 0.0) out.change[k] = beta * (out.dN[k] / oil_[k] - dV / V);
    out.p[k] = pressureOf(oil_[k] + out.dN[k], V + dV, beta);
  }
  // The bristles, exactly while the speed stays.
  const SealModel& s = model_.seals;
  out.z = z_;
  if (s.bristle > 0.0) {
    out.friction = steadyFriction(s, dy / dt);
    const double end = std::copysign(out.friction / s.bristle, dy);
    if (dy != 0.0) out.z = end + (z_ - end) * std::exp(-std::abs(dy / end));
  }
  return out;
}

/// moved() of a piston whose joints have play: y = L + s f, with the play as the spring s until
/// they are seated. Mostly they are and stay, and the end where they were is all that is looked at;
/// else by bisection and regula falsi (Illinois): the seats are kinks.
HydraulicLeg::Moved HydraulicLeg::movedThroughPlay(double length, double dt,
                                                   const std::array<Flow, 2>& flow) const noexcept {
  constexpr double kClose = 1e-13;  // [m]
  const double seat = model_.cylinder.seating, s = 0.5 * model_.cylinder.play / seat;
  struct End {
    Moved moved;
    double off;  // [m] at most 0 at the lower end, at least 0 at the upper one
  };
  const auto at = [&](double dy) {
    const Moved m = moved(dy, dt, flow);
    return End{m, y_ + dy - length - s * std::clamp(jointForce(m.p, m.z), -seat, seat)};
  };
  const double lowest = length - s * seat - y_, highest = length + s * seat - y_;
  End hi, lo;
  if (jointForce(p_, z_) > 0.0) {
    hi = at(highest);
    if (hi.off <= kClose) return hi.moved;
    lo = at(lowest);
  } else {
    lo = at(lowest);
    if (lo.off >= 0.0) return lo.moved;
    hi = at(highest);
  }
  for (int n = 0; n < 60 && hi.moved.dy - lo.moved.dy > kClose && lo.off < 0.0 && hi.off > 0.0;
       ++n) {
    const End next = at(lo.moved.dy + (hi.moved.dy - lo.moved.dy) * lo.off / (lo.off - hi.off));
    if (std::abs(next.off) < kClose) return next.moved;
    if (next.off < 0.0) {
      lo = next;
      hi.off *= 0.5;
    } else {
      hi = next;
      lo.off *= 0.5;
    }
  }
  return hi.off <= kClose ? hi.moved : lo.moved;
}

void HydraulicLeg::drift(double current, double length, double dt,
                         const SecondOrderHold& spool) noexcept {
  const double x = openSpool(current, dt, spool);
  const double past = model_.oil.leak * (p_[1] - p_[0]),  // the piston, into the bore
      lost = model_.oil.outside * p_[0];
  std::array<Flow, 2> flow;
  flow[0] = through(x, p_[0]);
  flow[0].past = past - lost;
  if (metered_ == 2) {
    flow[1] = through(-x, p_[1]);
    flow[1].past = -past;
  }
  const Moved m = model_.cylinder.play > 0.0 ? movedThroughPlay(length, dt, flow)
                                             : moved(length - y_, dt, flow);

  const double beta = model_.oil.bulk_modulus;
  std::array<double, 2> h;
  for (std::size_t k = 0; k < 2; ++k) {
    h[k] = k < static_cast<std::size_t>(metered_) ? enthalpy(0.5 * (p_[k] + m.p[k]), beta) : h_S_;
    const double in = dt * (flow[k].in + flow[k].in_rate * m.change[k]),
                 out = dt * (flow[k].out + flow[k].out_rate * m.change[k]);
    losses_.supplied += h_S_ * in;
    losses_.valve += in * (h_S_ - h[k]) + out * h[k];
  }
  if (metered_ == 1) losses_.supplied += h_S_ * (m.dN[1] + dt * past);
  losses_.leak += dt * (past * (h[1] - h[0]) + lost * h[0]);
  const double bent = m.z - z_;
  losses_.seals += 0.5 * model_.seals.bristle * (m.z + z_) * (m.dy - bent);

  v_ = m.dy / dt;
  friction_ = m.friction;
  y_ += m.dy;
  z_ = m.z;
  p_ = m.p;
  for (std::size_t k = 0; k < 2; ++k) oil_[k] += m.dN[k];
}

double HydraulicLeg::force() const noexcept { return jointForce(p_, z_) + stopForce(); }

double HydraulicLeg::damping() const noexcept {
  const SealModel& s = model_.seals;
  double D = s.viscous;
  if (s.bristle > 0.0) {
    const double part = s.bristle * z_ * std::copysign(1.0, v_) / friction_;
    D += s.bristle_damping * std::max(0.0, 1.0 - part);
  }
  return D + (stopForce() != 0.0 ? model_.cylinder.stop_damping : 0.0);
}

void HydraulicLeg::book(double v, double dt) noexcept {
  const double stops = stopForce() != 0.0 ? model_.cylinder.stop_damping : 0.0;
  losses_.stops += stops * v * v * dt;
  losses_.seals += (damping() - stops) * v * v * dt;
}

double HydraulicLeg::stored() const noexcept {
  const double beta = model_.oil.bulk_modulus, stop = stopForce();
  double E = 0.5 * model_.seals.bristle * z_ * z_;
  if (stop != 0.0) E += 0.5 * stop * stop / model_.cylinder.stop;
  if (const CylinderModel& c = model_.cylinder; c.play > 0.0) {
    const double f = std::clamp(jointForce(p_, z_), -c.seating, c.seating);
    E += 0.25 * c.play / c.seating * f * f;
  }
  for (std::size_t k = 0; k < 2; ++k) E += oilEnergy(oil_[k], volume(k, y_), beta);
  return E;
}

}  // namespace ves::plant
