// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/servo.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "ves/config/calibration.hpp"

namespace ves {
namespace {

struct Key {
  const char* name;
  Vec6 ServoModel::*value;
  double lo, hi;
  const char* what;
};
constexpr Key kKeys[] = {
    {"extend_per_s", &ServoModel::extend, 0.1, 1e3, "velocity gain, extending"},
    {"retract_per_s", &ServoModel::retract, 0.1, 1e3, "and retracting"},
    {"tau_s", &ServoModel::tau, 1e-4, 1.0, "of the cylinder"},
    {"delay_s", &ServoModel::delay, -0.01, 0.1, "from a tick to the LegSlave"}};

}  // namespace

std::string write(const ServoRecord& r) {
  std::string text = fmt::format(
      "# What a servo identification has found of each leg, and its standard deviation.\ndate: "
      "{}\n",
      dateText(r.date));
  const auto line = [&](const std::string& name, const Vec6& v, const std::string& what) {
    text += fmt::format("{}: [{}]{}\n", name, fmt::join(v.data(), v.data() + v.size(), ", "), what);
  };
  for (const Key& key : kKeys) {
    line(key.name, r.servo.*key.value, fmt::format("  # {}", key.what));
    line(fmt::format("{}_deviation", key.name), r.deviation.*key.value, "");
  }
  return text;
}

ServoRecord readServo(Section s) {
  ServoRecord r;
  r.date = readDate(s);
  for (const Key& key : kKeys) {
    r.servo.*key.value = s.vector(key.name, kLegs, key.lo, key.hi);
    r.deviation.*key.value = s.vector(fmt::format("{}_deviation", key.name), kLegs, 0.0, 1e3);
  }
  s.finish();
  return r;
}

ServoModel withRecord(ServoModel nominal, const ServoRecord& record) {
  for (const Key& key : kKeys) nominal.*key.value = record.servo.*key.value;
  return nominal;
}

}  // namespace ves
