// SPDX-License-Identifier: BSD-3-Clause
//
// The simulated pieces: views of one plant.
#pragma once

#include "ves/devices/devices.hpp"
#include "ves/plant/plant.hpp"

namespace ves::devices {

class Simulation {
 public:
  explicit Simulation(const plant::PlantConfig& config)
      : plant_(config), legs_(*this), sensor_(*this), robot_(*this), switches_(*this) {}
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  /// On to `until` of the plant's clock, which `now` is on the host's [ns]; then the pieces can be
  /// read.
  void advance(std::int64_t until, std::int64_t now) noexcept {
    plant_.advance(until);
    sample_ = plant_.sample();
    shift_ = now - plant_.time();
  }
  /// To the plant, which has a clock of its own.
  void command(LegCommand command) noexcept {
    if (command.laboratory.flies()) command.laboratory.time -= shift_;
    plant_.command(command);
  }
  plant::Plant& plant() noexcept { return plant_; }
  /// Of the last advance(), by the plant's clock.
  const Sample& sample() const noexcept { return sample_; }

  Legs& legs() noexcept { return legs_; }
  ForceSensor& sensor() noexcept { return sensor_; }
  Robot& robot() noexcept { return robot_; }
  Switches& switches() noexcept { return switches_; }

 private:
  struct SimulatedLegs : Legs {
    explicit SimulatedLegs(Simulation& s) : all(s) {}
    void command(const LegCommand& c) noexcept override { all.command(c); }
    bool read(LegReading& out) noexcept override {
      out = {all.sample_.legs, all.sample_.adc[kWrenchChannels], all.sample_.legs_time + all.shift_,
             (all.sample_.faults & kLegsPiece) != 0};
      return true;
    }
    Simulation& all;
  };
  struct SimulatedSensor : ForceSensor {
    explicit SimulatedSensor(Simulation& s) : all(s) {}
    bool read(WrenchReading& out) noexcept override {
      std::copy_n(all.sample_.adc.begin(), kWrenchChannels, out.counts.begin());
      out.time = all.sample_.wrench_time + all.shift_;
      out.fault = (all.sample_.faults & kSensorPiece) != 0;
      return true;
    }
    Simulation& all;
  };
  struct SimulatedRobot : Robot {
    explicit SimulatedRobot(Simulation& s) : all(s) {}
    bool read(JointReading& out) noexcept override {
      out = {all.sample_.q, all.sample_.joints_time + all.shift_,
             (all.sample_.faults & kRobotPiece) != 0};
      return true;
    }
    Simulation& all;
  };
  struct SimulatedSwitches : Switches {
    explicit SimulatedSwitches(Simulation& s) : all(s) {}
    bool read(std::uint32_t& out) noexcept override {
      out = all.sample_.switches;
      return true;
    }
    Simulation& all;
  };

  plant::Plant plant_;
  Sample sample_;
  std::int64_t shift_ = 0;  // [ns] from the plant's clock to the host's
  SimulatedLegs legs_;
  SimulatedSensor sensor_;
  SimulatedRobot robot_;
  SimulatedSwitches switches_;
};

}  // namespace ves::devices
