// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <cmath>

#include "ves/evaluation/drift_samples.hpp"

namespace ves {
namespace {

constexpr int kSeeds = 40;

void calibration(Reproduction& r) {
  double sum = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Reproduction::Run run = r.run("sensor_noise", {fmt::format("seed={}", seed)});
    const state_t& last = run.series.rows.back().state;
    const plant::ForceTorqueSensorModel& s = run.series.experiment.plant.sensor;
    for (int i = 0; i < 6; ++i) {
      const double z = (last.bias[i] - s.bias(i) / s.volts_per_count) / last.standard_error[i];
      sum += z * z / (6.0 * kSeeds);
    }
  }
  r.numbers["calibration"]["bias_error_rms_standard_errors"] = std::sqrt(sum);
  constexpr double kDegreesOfFreedom = 9.0;  // of ten batch means
  const double expected = std::sqrt(kDegreesOfFreedom / (kDegreesOfFreedom - 2.0));
  r.claim("calibration", {{"seeds", kSeeds}, {"rms", std::sqrt(sum)}, {"expected", expected}});
}

void drift(Reproduction& r) {
  r.page.section("4.1.2 Drift over 65 hours");
  const Reproduction::Run run = r.run("sensor_drift");
  Numbers summary = summarise(run.series, run.result);
  const std::vector<DriftSample> all = driftSamples(run.series);
  std::vector<Panel> panels = {{"time [h]", "force [N]", {}, false},
                               {"time [h]", "moment [N m]", {}, false},
                               {"time [h]", "temperature [C]", {{}}, false}};
  for (int i = 0; i < 6; ++i) {
    Line l{std::string(wrenchComponent(i).name), {}, {}, i % 3, false};
    for (const DriftSample& sample : all) {
      l.x.push_back(sample.t / 3600.0);
      l.y.push_back(sample.wrench(i));
    }
    panels[static_cast<std::size_t>(i / 3)].lines.push_back(l);
  }
  for (const DriftSample& sample : all) {
    panels[2].lines[0].x.push_back(sample.t / 3600.0);
    panels[2].lines[0].y.push_back(sample.temperature);
  }
  for (const char* key :
       {"drift_samples", "fz_drift_peak_to_peak_n", "fx_drift_peak_to_peak_n",
        "fz_drift_after_3h_max_n", "fz_drift_after_4h_max_n", "fz_drift_temperature_correlation"})
    r.numbers["sensor_drift"][key] = summary[key];
  r.claim("drift",
          {{"samples", summary["drift_samples"].get<double>()},
           {"fz_n", summary["fz_drift_peak_to_peak_n"].get<double>()},
           {"fx_n", summary["fx_drift_peak_to_peak_n"].get<double>()},
           {"correlation", std::abs(summary["fz_drift_temperature_correlation"].get<double>())},
           {"fz_4h_n", summary["fz_drift_after_4h_max_n"].get<double>()}});
  r.page.figure(
      "Figures 4.2 and 4.3: mean of each sample of the unloaded sensor, and the laboratory.",
      panels, "./ves run sensor_drift --lockstep");
}

}  // namespace

void sensorSection(Reproduction& r) {
  r.page.section("4.1.1 Noise of the force-torque sensor");
  const Reproduction::Run run = r.run("sensor_noise");
  std::vector<Panel> panels = {{"time [s]", "force [N]", {}, false},
                               {"time [s]", "moment [N m]", {}, false}};
  Vec6 peak = Vec6::Zero();
  for (int i = 0; i < 6; ++i) {
    Line l = lineOf(std::string(wrenchComponent(i).name), run.series, SegmentKind::kTrajectory,
                    i % 3, [i](const Row& row) { return row.state.dynamic[i]; });
    for (double y : l.y) peak(i) = std::max(peak(i), std::abs(y));
    panels[static_cast<std::size_t>(i / 3)].lines.push_back(l);
    r.numbers["sensor_noise"]
             [fmt::format("{}_max_{}", wrenchComponent(i).name, wrenchComponent(i).unit)] = peak(i);
  }
  r.claim("sensor_noise", {{"fx_n", peak(0)},
                           {"fy_n", peak(1)},
                           {"fz_n", peak(2)},
                           {"moment_nm", peak.tail<3>().maxCoeff()}});
  r.page.figure("Figure 4.1: the unloaded sensor for one second at 100 Hz.", panels,
                "./ves run sensor_noise --lockstep");

  calibration(r);
  drift(r);
}

}  // namespace ves
