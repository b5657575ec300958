// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/one_leg.hpp"

#include <cmath>
#include <complex>

namespace ves {

OneLeg::OneLeg(const plant::LegSlaveGains& gains, const plant::ActuatorModel& actuator,
               const plant::Temposonics& transducer, double length)
    : transducer_(transducer),
      actuator_(actuator, length),
      slave_(gains, transducer.count(length)),
      decay_(std::exp(-kStep / actuator.tau)) {}

void OneLeg::step(double reference) noexcept {
  slave_.read(transducer_.count(actuator_.length()), transducer_.count(reference));
  actuator_.advance(slave_.current(), kStep, decay_);
}

FrequencyResponse respond(const plant::PlantConfig& p, double gain, double frequency,
                          double amplitude) {
  plant::ActuatorModel model = p.actuator;
  model.gain_extend = model.gain_retract = gain;
  const double middle = 0.5 * (model.length_min + model.length_max);
  OneLeg leg(p.leg_slave, model, p.transducer, middle);
  const double w = 2.0 * M_PI * frequency;
  const int settle = static_cast<int>(1.0 / OneLeg::kStep);
  const auto periods = std::ceil(2.0 * frequency);
  const int last = settle + static_cast<int>(std::lround(periods / frequency / OneLeg::kStep));
  std::complex<double> sum = 0.0;
  for (int n = 0; n < last; ++n) {
    const double t = n * OneLeg::kStep;
    if (n >= settle) sum += (leg.length() - middle) * std::polar(1.0, -w * t);
    leg.step(middle + amplitude * std::sin(w * t));
  }
  // sin = Im e^{iwt}: what is in phase with it lies on -i.
  const std::complex<double> z =
      sum * std::complex<double>(0.0, 1.0) * 2.0 / (amplitude * (last - settle));
  return {std::abs(z), std::arg(z)};
}

}  // namespace ves
