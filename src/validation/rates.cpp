// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <cmath>

#include "ves/math/dense.hpp"
#include "ves/plant/one_leg.hpp"

namespace ves {
namespace {

constexpr double kAmplitude = 0.01;  // [m] of a leg's sine

void updateRate(Reproduction& r) {
  r.page.section("2.3 Update rate");
  double worst = 0.0;
  for (const std::int64_t period : {13'333'333, 11'428'571, 10'000'000}) {
    const Reproduction::Run run =
        r.run("free_decay", {fmt::format("controller.period_ns={}", period)});
    const Motion m = commanded(run.series);
    const ModalModel base = linearised(run.series.experiment.controller.vehicle);
    const Eigen::VectorXd eta0 = leastSquares(base.Phi, m.x.front());
    for (std::size_t n = 0; n < m.t.size(); ++n) {
      Eigen::VectorXd eta = eta0;
      for (Eigen::Index i = 0; i < eta.size(); ++i) {  // let go at rest, underdamped
        const double decay = 0.5 * base.damping(i, i);
        const double w = std::sqrt(base.stiffness(i) - decay * decay);
        eta(i) *=
            std::exp(-decay * m.t[n]) * (std::cos(w * m.t[n]) + decay / w * std::sin(w * m.t[n]));
      }
      worst = std::max(worst, (m.x[n] - base.Phi * eta).cwiseAbs().maxCoeff());
    }
  }
  r.numbers["update_rate"]["decay_error_max_m_or_rad"] = worst;
  r.claim("update_rate", {{"error", worst}});
}

void bandwidth(Reproduction& r) {
  r.page.section("2.4 Bandwidth of the actuators");
  const Experiment e = r.load("z_sine");
  std::vector<Panel> panels = {{"frequency [Hz]", "gain [-]", {}, true},
                               {"frequency [Hz]", "phase [deg]", {}, true}};
  double quarter[2] = {};
  for (const bool extends : {true, false}) {
    const int c = extends ? 0 : 1;
    Line gain{extends ? "extending" : "retracting", {}, {}, c, false}, phase = gain;
    const double K = extends ? e.plant.actuator.gain_extend : e.plant.actuator.gain_retract;
    double last_f = 0.0, last_phase = 0.0;
    for (double f = 0.5; f < 25.0; f *= 1.05) {
      const FrequencyResponse leg = respond(e.plant, K, f, kAmplitude);
      double degrees = leg.phase / kDegree;
      if (degrees > 30.0) degrees -= 360.0;
      gain.x.push_back(f);
      gain.y.push_back(leg.gain);
      phase.x.push_back(f);
      phase.y.push_back(degrees);
      if (degrees <= -90.0 && last_phase > -90.0 && quarter[c] == 0.0)
        quarter[c] = last_f + (f - last_f) * (last_phase + 90.0) / (last_phase - degrees);
      last_f = f;
      last_phase = degrees;
    }
    panels[0].lines.push_back(gain);
    panels[1].lines.push_back(phase);
  }
  r.numbers["servo"]["quarter_period_lag_extending_hz"] = quarter[0];
  r.numbers["servo"]["quarter_period_lag_retracting_hz"] = quarter[1];
  r.claim("bandwidth", {{"extending_hz", quarter[0]}, {"retracting_hz", quarter[1]}});
  r.page.figure(
      "One leg with its LegSlave under a sine of +-10 mm, with the gain of either "
      "direction in both.",
      panels, "./ves report");
}

}  // namespace

void ratesSection(Reproduction& r) {
  updateRate(r);
  bandwidth(r);
}

}  // namespace ves
