// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/truth.hpp"

#include "ves/contract/schema.hpp"

namespace ves {

truth_t toMessage(const plant::Truth& truth, const header_t& header) noexcept {
  truth_t m;
  m.header = header;
  schema::put(truth.x, m.x);
  schema::put(truth.P.v, m.v);
  schema::put(truth.P.w, m.w);
  schema::put(truth.P.a, m.a);
  schema::put(truth.P.alpha, m.alpha);
  schema::put(truth.F_Po_I, m.wrench);
  schema::put(truth.F_So_S, m.sensor);
  schema::put(truth.joints.q, m.q);
  schema::put(truth.joints.q_dot, m.q_dot);
  schema::put(truth.joints.q_ddot, m.q_ddot);
  schema::put(truth.legs.L, m.leg);
  schema::put(truth.legs.L_dot, m.leg_dot);
  schema::put(truth.current, m.current);
  m.parking = truth.parking ? 1 : 0;
  m.legs_agree = truth.legs_agree ? 1 : 0;
  m.clearance = truth.clearance;
  schema::put(truth.contact_To_I, m.contact);
  m.contacts = truth.contacts.count();
  m.touching = truth.contacts.touching() ? 1 : 0;
  const Contact& contact = truth.contacts.last();
  // By the header's clock, which need not begin with the plant's.
  m.contact_began =
      contact.began + static_cast<double>(header.time_ns - truth.time) * kSecondPerNanosecond;
  m.contact_duration = contact.duration;
  m.contact_peak = contact.peak;
  schema::put(contact.impulse, m.contact_impulse);
  m.contact_approach = contact.approach;
  m.contact_separation = contact.separation;
  schema::put(truth.target.p, m.target_p);
  schema::put(truth.target.q.coeffs(), m.target_q);
  schema::put(truth.target.v, m.target_v);
  schema::put(truth.target.w, m.target_w);
  m.gripped = truth.target.X_TB ? 1 : 0;
  m.pushes = truth.pushes;
  const BegunPush push = truth.push.value_or(BegunPush{});
  m.push_on = static_cast<std::int32_t>(push.push.on);
  m.push_link = push.push.link;
  schema::put(push.push.point, m.push_point);
  schema::put(push.push.force_I, m.push_force);
  m.push_began_ns = push.began + header.time_ns - truth.time;
  m.push_duration = push.push.duration;
  return m;
}

}  // namespace ves
