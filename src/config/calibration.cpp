// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/calibration.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <time.h>

#include <cmath>

namespace ves {
namespace {

std::string list(const Vec6& v) {
  return fmt::format("[{}]", fmt::join(v.data(), v.data() + v.size(), ", "));
}

}  // namespace

std::string dateText(std::int64_t seconds) {
  const time_t t = seconds;
  tm utc{};
  gmtime_r(&t, &utc);
  char text[32];
  strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

std::string write(const CalibrationRecord& r) {
  return fmt::format(
      "# Bias of the force-torque sensor, by the calibration routine. Counts of the A/D converter, "
      "in\n"
      "# the order Fx Fy Fz Mx My Mz of the sensor's own axes.\n"
      "date: {}\n"
      "setup: {}  # hash of the sensor, robot and gravity that it was taken with\n"
      "temperature_c: {}\n"
      "bias_count: {}\n"
      "deviation_count: {}       # of one sample\n"
      "standard_error_count: {}  # of the bias\n",
      dateText(r.date), r.setup, r.temperature, list(r.bias), list(r.deviation),
      list(r.standard_error));
}

std::int64_t readDate(Section& s) {
  const std::string date = s.text("date");
  tm utc{};
  const char* end = strptime(date.c_str(), "%Y-%m-%dT%H:%M:%SZ", &utc);
  if (!end || *end != 0)
    s.fail("date", fmt::format("'{}', want a date like 2026-11-21T07:40:12Z", date));
  return timegm(&utc);
}

CalibrationRecord readCalibration(Section s) {
  CalibrationRecord r;
  r.date = readDate(s);
  r.setup = s.text("setup");
  r.temperature = s.number("temperature_c", -273.15, 200.0);
  constexpr double kFullScale = 32768.0;
  r.bias = s.vector("bias_count", 6, -kFullScale, kFullScale);
  r.deviation = s.vector("deviation_count", 6, 0.0, kFullScale);
  r.standard_error = s.vector("standard_error_count", 6, 0.0, kFullScale);
  s.finish();
  return r;
}

double age(const CalibrationRecord& record) {
  return std::difftime(time(nullptr), record.date) / 3600.0;
}

}  // namespace ves
