// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

namespace ves {

plant::HydraulicModel readHydraulics(Section s, const plant::ActuatorModel& actuator) {
  constexpr double kCubicCentimetre = 1e-6, kSquareCentimetre = 1e-4;
  constexpr double kMilliampere = 1e-3, kMegapascal = 1e6;
  plant::HydraulicModel out;
  plant::ValveModel& valve = out.leg.valve;
  valve.circuit = s.choice("circuit", {"three_way", "four_way"}) == "three_way"
                      ? plant::Circuit::kThreeWay
                      : plant::Circuit::kFourWay;
  valve.frequency = 2.0 * M_PI * s.number("valve_hz", 1.0, 1e4);
  valve.damping = s.number("valve_damping", 0.05, 100.0);
  valve.limit = s.number("valve_limit_ma", 1.0, 1000.0) * kMilliampere;
  valve.opening = s.number("valve_opening_ma", -10.0, 10.0) * kMilliampere;
  valve.feedback =
      s.number("pressure_feedback_ma_per_mpa", 0.0, 1000.0) * kMilliampere / kMegapascal;
  valve.feedback_time = s.number("pressure_feedback_s", 1e-3, 10.0);
  out.fitted_at = s.number("gains_at_ma", 0.1, 1000.0) * kMilliampere;
  if (!(out.fitted_at + valve.opening > 0.0))
    s.fail("gains_at_ma", "is within the valve's overlap, want more current than opens it");

  plant::OilModel& oil = out.leg.oil;
  oil.supply = s.number("supply_mpa", 0.1, 100.0) * kMegapascal;
  oil.bulk_modulus = s.number("bulk_modulus_mpa", 10.0, 1e6) * kMegapascal;
  oil.hoses = s.number("hose_volume_cm3", 0.1, 1e5) * kCubicCentimetre;
  oil.leak = s.number("leak_l_per_min_mpa", 0.0, 100.0) * kOilFlow;

  plant::CylinderModel& cylinder = out.leg.cylinder;
  cylinder.bore = s.number("bore_area_cm2", 0.01, 1e4) * kSquareCentimetre;
  cylinder.length_min = actuator.length_min;
  cylinder.length_max = actuator.length_max;
  cylinder.stop = s.number("stop_n_per_m", 1e3, 1e10);
  cylinder.stop_damping = s.number("stop_n_s_per_m", 0.0, 1e8);
  cylinder.play = s.number("play_m", 0.0, 0.01);
  cylinder.seating = s.number("play_closes_at_n", 0.1, 1e5);

  plant::SealModel& seals = out.leg.seals;
  seals.coulomb = s.number("coulomb_n", 0.0, 1e5);
  seals.breakaway = s.number("breakaway_n", seals.coulomb, 1e5);
  seals.stribeck = s.number("stribeck_m_per_s", 1e-6, 1.0);
  seals.viscous = s.number("viscous_n_s_per_m", 0.0, 1e6);
  seals.bristle = seals.coulomb / s.number("presliding_m", 1e-7, 1e-2);
  seals.bristle_damping = s.number("presliding_n_s_per_m", 0.0, 1e6);

  out.reading.noise = s.number("reading_noise_m", 0.0, 0.01);
  out.reading.hysteresis = s.number("reading_hysteresis_m", 0.0, 0.01);
  out.plate_P = readBox(s.section("plate"));
  s.finish();
  return out;
}

}  // namespace ves
