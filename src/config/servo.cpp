// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/servo.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "ves/config/calibration.hpp"

namespace ves {
namespace {

template <class T>
struct Key {
  const char* name;
  T ServoModel::*value;
  double lo, hi;
  const char* what;
};
constexpr Key<Vec6> kKeys[] = {
    {"extend_per_s", &ServoModel::extend, 0.1, 1e3, "velocity gain, extending"},
    {"retract_per_s", &ServoModel::retract, 0.1, 1e3, "and retracting"},
    {"tau_s", &ServoModel::tau, 1e-4, 1.0, "of the cylinder"},
    {"delay_s", &ServoModel::delay, -0.01, 0.1, "from a tick to the LegSlave"}};

/// Where they were found.
constexpr Key<Vec6> kFound[] = {
    {"opening_m", &ServoModel::opening, -0.01, 0.01,
     "of both edges at null, as a difference of length; below zero: they overlap"},
    {"friction_m", &ServoModel::friction, 0.0, 0.01,
     "difference of length that seals take as a leg turns round"}};
/// With friction.
constexpr Key<double> kFriction[] = {
    {"friction_s", &ServoModel::friction_time, 1e-3, 1.0, "for which a turn is felt"},
    {"friction_way_m", &ServoModel::friction_way, 1e-5, 0.01, "over which it comes"}};

/// Of the force-torque sensor; files of earlier versions have none.
constexpr Key<double> kSensorKeys[] = {
    {"sensor_delay_s", &ServoModel::sensor_delay, -0.01, 0.01, "of the wrench, beyond its filter"},
    {"sensor_scale", &ServoModel::sensor_scale, 0.5, 2.0, "of the robot's inertia that it shows"}};

}  // namespace

std::string write(const ServoRecord& r) {
  std::string text = fmt::format(
      "# What a servo identification has found of each leg, and its standard deviation.\ndate: "
      "{}\n",
      dateText(r.date));
  const auto line = [&](const std::string& name, const Vec6& v, const std::string& what) {
    text += fmt::format("{}: [{}]{}\n", name, fmt::join(v.data(), v.data() + v.size(), ", "), what);
  };
  for (const Key<Vec6>& key : kKeys) {
    line(key.name, r.servo.*key.value, fmt::format("  # {}", key.what));
    line(fmt::format("{}_deviation", key.name), r.deviation.*key.value, "");
  }
  for (const Key<Vec6>& key : kFound) {
    if ((r.servo.*key.value).isZero(0.0)) continue;
    line(key.name, r.servo.*key.value, fmt::format("  # {}", key.what));
    line(fmt::format("{}_deviation", key.name), r.deviation.*key.value, "");
  }
  if (!r.servo.friction.isZero(0.0))
    for (const Key<double>& key : kFriction)
      text += fmt::format("{}: {}  # {}\n", key.name, r.servo.*key.value, key.what);
  for (const Key<double>& key : kSensorKeys)
    if (r.deviation.*key.value > 0.0)
      text += fmt::format("{0}: {1}  # {2}\n{0}_deviation: {3}\n", key.name, r.servo.*key.value,
                          key.what, r.deviation.*key.value);
  return text;
}

ServoRecord readServo(Section s) {
  ServoRecord r;
  r.date = readDate(s);
  for (const Key<Vec6>& key : kKeys) {
    r.servo.*key.value = s.vector(key.name, kLegs, key.lo, key.hi);
    r.deviation.*key.value = s.vector(fmt::format("{}_deviation", key.name), kLegs, 0.0, 1e3);
  }
  for (const Key<Vec6>& key : kFound) {
    (r.deviation.*key.value).setZero();
    if (!s.has(key.name)) continue;
    r.servo.*key.value = s.vector(key.name, kLegs, key.lo, key.hi);
    r.deviation.*key.value = s.vector(fmt::format("{}_deviation", key.name), kLegs, 0.0, key.hi);
  }
  if (!r.servo.friction.isZero(0.0))
    for (const Key<double>& key : kFriction)
      if (s.has(key.name)) r.servo.*key.value = s.number(key.name, key.lo, key.hi);
  for (const Key<double>& key : kSensorKeys) {
    r.deviation.*key.value = 0.0;
    if (!s.has(key.name)) continue;
    r.servo.*key.value = s.number(key.name, key.lo, key.hi);
    r.deviation.*key.value = s.number(fmt::format("{}_deviation", key.name), 0.0, 1.0);
  }
  s.finish();
  return r;
}

ServoModel withRecord(ServoModel nominal, const ServoRecord& record) {
  for (const Key<Vec6>& key : kKeys) nominal.*key.value = record.servo.*key.value;
  for (const Key<Vec6>& key : kFound) nominal.*key.value = record.servo.*key.value;
  for (const Key<double>& key : kFriction) nominal.*key.value = record.servo.*key.value;
  for (const Key<double>& key : kSensorKeys) nominal.*key.value = record.servo.*key.value;
  return nominal;
}

Compensation withRecord(Compensation nominal, const ServoRecord& record) {
  constexpr double kDeviations = 3.0;  // [-]
  const auto share = [&](Vec6 ServoModel::*value) {
    return (record.deviation.*value).cwiseQuotient(record.servo.*value).maxCoeff();
  };
  // What may be learnt needs the room that was given for it.
  const auto take = [&](double& value, double deviation) {
    const double found = kDeviations * deviation;
    if (deviation > 0.0) value = nominal.adaptation ? std::max(value, found) : found;
  };
  take(nominal.gain_error, std::max(share(&ServoModel::extend), share(&ServoModel::retract)));
  take(nominal.timing_error, record.deviation.sensor_delay);
  take(nominal.mass_error, record.deviation.sensor_scale);
  return nominal;
}

}  // namespace ves
