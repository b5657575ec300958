// SPDX-License-Identifier: BSD-3-Clause
#include "texts.hpp"

#include <fmt/format.h>

#include "ves/core/coordinates.hpp"
#include "ves/evaluation/let_go.hpp"

namespace ves {

std::string coordinateText(int i, double x) {
  return fmt::format("{:+.{}f}", x * coordinate(i).shown, i < 3 ? 1 : 2);
}

std::string poseText(const double (&x)[6]) {
  return fmt::format("x {}  y {}  z {} mm   alpha {}  beta {}  gamma {} deg",
                     coordinateText(0, x[0]), coordinateText(1, x[1]), coordinateText(2, x[2]),
                     coordinateText(3, x[3]), coordinateText(4, x[4]), coordinateText(5, x[5]));
}

std::string failing(std::int32_t bits) { return names(Tripped(static_cast<std::uint32_t>(bits))); }

std::string statusText(const Status& status) {
  const state_t& s = status.state;
  const auto kind = static_cast<SegmentKind>(s.kind);
  std::string out = fmt::format(
      "  phase      {}{}\n  commanded  {}\n  measured   {}\n"
      "  wrench     {:+.2f} {:+.2f} {:+.2f} N   {:+.3f} {:+.3f} {:+.3f} N m, gravity taken out{}\n",
      name(static_cast<Phase>(s.phase)),
      kind == SegmentKind::kCount ? "" : fmt::format(", {}", name(kind)), poseText(s.x),
      poseText(s.x_measured), s.dynamic[0], s.dynamic[1], s.dynamic[2], s.dynamic[3], s.dynamic[4],
      s.dynamic[5], status.calibration ? "" : ", the sensor's bias in it");
  if (status.calibration) {
    const CalibrationRecord& record = *status.calibration;
    out += fmt::format("  bias       of {}, {:.1f} h old, at {:.1f} C; now {:.1f} C{}\n",
                       dateText(record.date), age(record), record.temperature, status.temperature,
                       age(record) > kCalibrationKeeps ? "; calibrate again" : "");
  } else {
    out += "  bias       none: not calibrated\n";
  }
  if (!ofConfiguredVehicle(s))
    out += fmt::format(
        "  vehicle    mass {:.3g}, damping {:.3g}, stiffness {:.3g} times the scenario's\n",
        s.vehicle_mass, s.vehicle_damping, s.vehicle_stiffness);
  out += fmt::format("  checks     {}", s.tripped ? failing(s.tripped) + " failing" : "all pass");
  if (status.timing)
    out += fmt::format(
        "\n  timing     woke {:.0f} us late, computed {:.0f} us; sample {:.1f} ms old; {} ticks "
        "missed",
        static_cast<double>(status.timing->late_ns) * 1e-3,
        static_cast<double>(status.timing->compute_ns) * 1e-3,
        static_cast<double>(status.timing->sample_age_ns) * 1e-6, status.timing->missed);
  return out;
}

}  // namespace ves
