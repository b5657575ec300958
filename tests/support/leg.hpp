// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "ves/plant/plant.hpp"

namespace ves::test {

/// One leg of the machine: LegSlave, valve, cylinder, counts, as the plant runs them.
struct Leg {
  explicit Leg(const plant::PlantConfig& p, double L)
      : config(p), actuator(p.actuator, L), slave(p.leg_slave, p.transducer.count(L)) {}

  /// On by `time` [s] with the reference [count].
  void run(std::int32_t reference, double time) {
    const double to = now + time;
    while (next_reading <= to) {
      pass(next_reading - now);
      slave.read(config.transducer.count(actuator.length()), reference);
      next_reading += 341e-6;
    }
    pass(to - now);
  }
  void pass(double dt) {
    actuator.advance(slave.current(), dt, std::exp(-dt / config.actuator.tau));
    now += dt;
  }

  plant::PlantConfig config;
  plant::Actuator actuator;
  plant::LegSlave slave;
  double now = 0.0, next_reading = 150e-6;
};

}  // namespace ves::test
